//! Checked reading of accessors: every range is proved against the bytes present before the first read, and every
//! component type is converted (KHR_mesh_quantization included).

use super::document::{Document, pointer, remedy_for};
use super::error::{LoadError, Source};
use super::resources::Limits;
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use std::borrow::Cow;
use std::collections::BTreeMap;

const REPAIR: &str = "export the file again or repair it (npx gltf-validator names every fault)";

/// The bytes of a buffer view.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub bytes: &'a [u8],
    stride: Option<usize>,
    /// Where the view starts in its buffer, for alignment.
    offset: u64,
}

/// Checks all buffer views against their buffers.
///
/// `decoded` has the bytes of those that are stored compressed.
pub(super) fn views<'a>(
    source: &Source,
    document: &Document,
    buffers: &'a [Cow<'_, [u8]>],
    decoded: &'a [Option<Vec<u8>>],
) -> Result<Vec<View<'a>>, LoadError> {
    let view_of = |(index, view): (usize, &json::buffer::View)| {
        let place = pointer("bufferViews", index);
        let (buffer, start) = match &decoded[index] {
            Some(bytes) => (bytes.as_slice(), 0),
            None => (&*buffers[view.buffer.value()], view.byte_offset.unwrap_or_default().0),
        };
        let (offset, length) = (start, view.byte_length.0);
        let end = offset.checked_add(length).filter(|&end| end <= buffer.len() as u64).ok_or_else(|| {
            let present = buffer.len();
            let found = format!("byteOffset {offset} + byteLength {length} in a buffer of {present} bytes");
            source.invalid(&place, found, REPAIR)
        })?;
        let stride = view.byte_stride.map(|stride| stride.0);
        if let Some(stride) = stride.filter(|stride| !(4..=252).contains(stride) || stride % 4 != 0) {
            let found = format!("byteStride {stride}, must be a multiple of 4 from 4 to 252");
            return Err(source.invalid(place, found, REPAIR));
        }
        Ok(View { bytes: &buffer[offset as usize..end as usize], stride, offset })
    };
    document.buffer_views.iter().enumerate().map(view_of).collect()
}

/// A typed view of numbers whose every element can be read.
pub(super) struct Accessor<'a> {
    /// JSON pointer, for messages.
    pub place: String,
    /// Number of elements.
    pub count: usize,
    /// Elements are stored somewhere; otherwise all are zero.
    pub has_data: bool,
    shape: Type,
    component: ComponentType,
    normalized: bool,
    base: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
}

#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

struct Sparse<'a> {
    /// Strictly rising, each below the accessor's count.
    indices: Vec<u32>,
    values: Elements<'a>,
}

/// Checks all accessors against their buffer views.
///
/// `decoded` has the elements of those that are stored elsewhere, without gaps.
pub(super) fn accessors<'a>(
    source: &Source,
    limits: &Limits,
    document: &Document,
    views: &[View<'a>],
    decoded: &'a BTreeMap<usize, Vec<u8>>,
) -> Result<Vec<Accessor<'a>>, LoadError> {
    // Each sparse element has bytes of its own in a sound file; without this, many accessors over the same bytes could
    // ask for any amount of work.
    let most_sparse: u64 = document.buffers.iter().map(|buffer| buffer.byte_length.0).sum();
    let mut sparse: u64 = 0;
    let of = |(index, accessor): (usize, &json::Accessor)| {
        let place = pointer("accessors", index);
        sparse = sparse.saturating_add(accessor.sparse.as_ref().map_or(0, |sparse| sparse.count.0));
        if sparse > most_sparse {
            let found = format!("{sparse} sparse elements up to here, more than the buffers have bytes");
            return Err(source.too_large(place, found, most_sparse, REPAIR));
        }
        let elsewhere = decoded.get(&index).map(|bytes| View { bytes, stride: None, offset: 0 });
        open(source, limits, accessor, views, elsewhere, place)
    };
    document.accessors.iter().enumerate().map(of).collect()
}

fn open<'a>(
    source: &Source,
    limits: &Limits,
    accessor: &json::Accessor,
    views: &[View<'a>],
    elsewhere: Option<View<'a>>,
    place: String,
) -> Result<Accessor<'a>, LoadError> {
    let (Checked::Valid(component), Checked::Valid(shape)) = (&accessor.component_type, &accessor.type_) else {
        return Err(source.invalid(place, "an unknown type or componentType", REPAIR));
    };
    let (component, shape) = (component.0, *shape);
    let count = accessor.count.0;
    if count == 0 {
        return Err(source.invalid(place, "count 0, must be at least 1", "remove empty meshes before exporting"));
    }
    let element = element_bytes(shape, component);
    let stored = accessor.buffer_view.map(|view| (views[view.value()], accessor.byte_offset.unwrap_or_default().0));
    let base = match stored.or(elsewhere.map(|view| (view, 0))) {
        Some((view, offset)) => Some(elements(source, &place, view, Range { offset, count, element }, component)?),
        None if count > limits.implicit_count => {
            let found = format!("{count} elements without a bufferView");
            return Err(source.too_large(place, found, limits.implicit_count, "store the data in a bufferView"));
        }
        None => None,
    };
    let sparse = match &accessor.sparse {
        Some(sparse) => Some(open_sparse(source, &place, sparse, views, count, component, element)?),
        None => None,
    };
    Ok(Accessor {
        place,
        count: count as usize,
        has_data: base.is_some() || sparse.is_some(),
        shape,
        component,
        normalized: accessor.normalized,
        base,
        sparse,
    })
}

fn open_sparse<'a>(
    source: &Source,
    place: &str,
    sparse: &json::accessor::sparse::Sparse,
    views: &[View<'a>],
    total: u64,
    component: ComponentType,
    element: usize,
) -> Result<Sparse<'a>, LoadError> {
    let count = sparse.count.0;
    if count == 0 || count > total {
        let found = format!("{count} sparse elements of {total}, must be 1 to {total}");
        return Err(source.invalid(format!("{place}/sparse/count"), found, REPAIR));
    }
    let Checked::Valid(index_type) = &sparse.indices.component_type else {
        return Err(source.invalid(format!("{place}/sparse/indices"), "an unknown componentType", REPAIR));
    };
    let index_type = index_type.0;
    let index_range = Range { offset: sparse.indices.byte_offset.0, count, element: index_type.size() };
    let index_place = format!("{place}/sparse/indices");
    let index_view = packed(source, &index_place, views[sparse.indices.buffer_view.value()])?;
    let stored = elements(source, &index_place, index_view, index_range, index_type)?;
    let indices: Vec<u32> = (0..count as usize).map(|at| unsigned(index_type, stored.at(at))).collect();
    if indices.windows(2).any(|pair| pair[0] >= pair[1]) || indices.last().is_some_and(|&last| u64::from(last) >= total)
    {
        let found = format!("sparse indices that do not rise, or reach {total} (the accessor's count)");
        return Err(source.invalid(index_place, found, REPAIR));
    }
    let value_place = format!("{place}/sparse/values");
    let value_range = Range { offset: sparse.values.byte_offset.0, count, element };
    let value_view = packed(source, &value_place, views[sparse.values.buffer_view.value()])?;
    let values = elements(source, &value_place, value_view, value_range, component)?;
    Ok(Sparse { indices, values })
}

impl Sparse<'_> {
    /// Whether a value is another than zero.
    fn says_something(&self) -> bool {
        (0..self.indices.len()).any(|at| self.values.at(at)[..self.values.stride].iter().any(|byte| *byte != 0))
    }
}

fn packed<'a>(source: &Source, place: &str, view: View<'a>) -> Result<View<'a>, LoadError> {
    match view.stride {
        None => Ok(view),
        Some(_) => Err(source.invalid(place, "a bufferView with byteStride, which sparse data must not have", REPAIR)),
    }
}

struct Range {
    offset: u64,
    count: u64,
    element: usize,
}

/// Proves that `count` elements lie within the view.
fn elements<'a>(
    source: &Source,
    place: &str,
    view: View<'a>,
    range: Range,
    component: ComponentType,
) -> Result<Elements<'a>, LoadError> {
    let Range { offset, count, element } = range;
    let stride = view.stride.unwrap_or(element);
    if stride < element {
        let found = format!("elements of {element} bytes at a byteStride of {stride}");
        return Err(source.invalid(place, found, REPAIR));
    }
    let end = (count - 1)
        .checked_mul(stride as u64)
        .and_then(|last| last.checked_add(offset))
        .and_then(|last| last.checked_add(element as u64));
    if end.is_none_or(|end| end > view.bytes.len() as u64) {
        let present = view.bytes.len();
        let found = format!(
            "{count} elements of {element} bytes, {stride} bytes apart from byte {offset}, in a bufferView of {present} \
             bytes"
        );
        return Err(source.invalid(place, found, REPAIR));
    }
    let size = component.size() as u64;
    if !offset.is_multiple_of(size)
        || !(view.offset + offset).is_multiple_of(size)
        || !(stride as u64).is_multiple_of(size)
    {
        let start = view.offset;
        let found = format!(
            "{size}-byte components at byte {offset} of a bufferView at {start}, must be aligned to their size"
        );
        return Err(source.invalid(place, found, REPAIR));
    }
    Ok(Elements { bytes: &view.bytes[offset as usize..], stride })
}

impl<'a> Elements<'a> {
    fn at(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..]
    }
}

/// Bytes of an element; the columns of small matrices are padded to four bytes.
fn element_bytes(shape: Type, component: ComponentType) -> usize {
    let columns = match shape {
        Type::Mat2 => 2,
        Type::Mat3 => 3,
        Type::Mat4 => 4,
        _ => return shape.multiplicity() * component.size(),
    };
    columns * (columns * component.size()).next_multiple_of(4)
}

impl Accessor<'_> {
    /// Refuses a shape or component type that an attribute cannot have.
    pub fn expect(&self, source: &Source, what: &str, shapes: &[Type], allow_u32: bool) -> Result<(), LoadError> {
        if !shapes.contains(&self.shape) {
            let found = format!("{what} of type {:?}, must be {shapes:?}", self.shape);
            return Err(source.invalid(&self.place, found, REPAIR));
        }
        if self.component == ComponentType::U32 && !allow_u32 {
            return Err(source.invalid(&self.place, format!("{what} with 32-bit integers"), REPAIR));
        }
        Ok(())
    }

    /// Refuses integers that do not stand for fractions.
    pub fn expect_scaled(&self, source: &Source, what: &str) -> Result<(), LoadError> {
        if self.component != ComponentType::F32 && !self.normalized {
            let found = format!("{what} of integers that are not normalized");
            return Err(source.invalid(&self.place, found, REPAIR));
        }
        Ok(())
    }

    /// Whether elements may be other than zero.
    pub fn says_something(&self) -> bool {
        self.base.is_some() || self.sparse.as_ref().is_some_and(Sparse::says_something)
    }

    /// Refuses an accessor that cannot hold indices.
    pub fn expect_indices(&self, source: &Source) -> Result<(), LoadError> {
        let unsigned = matches!(self.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if self.shape != Type::Scalar || !unsigned || self.normalized {
            let found =
                format!("indices of type {:?} and {:?}, must be SCALAR and unsigned", self.shape, self.component);
            return Err(source.invalid(&self.place, found, REPAIR));
        }
        Ok(())
    }

    /// Refuses an accessor that stores nothing because its data is only in an extension.
    pub fn expect_data(&self, source: &Source, what: &str, draco: bool) -> Result<(), LoadError> {
        const DRACO: &str = "KHR_draco_mesh_compression";
        match (self.has_data, draco) {
            (true, _) => Ok(()),
            (false, true) => {
                Err(source.unsupported(&self.place, format!("geometry stored only with {DRACO}"), remedy_for(DRACO)))
            }
            (false, false) => {
                let found = format!("{what} with neither bufferView nor sparse data, so all are zero");
                Err(source.invalid(&self.place, found, "export the file again with its geometry"))
            }
        }
    }

    /// Components of a vector.
    pub fn components(&self) -> usize {
        self.shape.multiplicity()
    }

    /// An element as floats, missing components zero. Normalized integers become -1..1 or 0..1.
    pub fn floats(&self, index: usize) -> [f32; 4] {
        let mut values = [0.0; 4];
        if let Some(bytes) = self.bytes_at(index) {
            let size = self.component.size();
            for (at, value) in values.iter_mut().enumerate().take(self.components()) {
                *value = float(self.component, self.normalized, &bytes[at * size..]);
            }
        }
        values
    }

    /// An element as an index.
    pub fn index(&self, index: usize) -> u32 {
        self.bytes_at(index).map_or(0, |bytes| unsigned(self.component, bytes))
    }

    fn bytes_at(&self, index: usize) -> Option<&[u8]> {
        if let Some(sparse) = &self.sparse
            && let Ok(at) = sparse.indices.binary_search(&(index as u32))
        {
            return Some(sparse.values.at(at));
        }
        self.base.map(|base| base.at(index))
    }
}

fn unsigned(component: ComponentType, bytes: &[u8]) -> u32 {
    match component {
        ComponentType::U8 => u32::from(bytes[0]),
        ComponentType::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}

fn float(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    // The divisions of section 3.11 of the glTF specification.
    let scaled = |value: f32, largest: f32| if normalized { (value / largest).max(-1.0) } else { value };
    match component {
        ComponentType::I8 => scaled(f32::from(bytes[0] as i8), 127.0),
        ComponentType::U8 => scaled(f32::from(bytes[0]), 255.0),
        ComponentType::I16 => scaled(f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        ComponentType::U16 => scaled(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        ComponentType::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
        ComponentType::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}
