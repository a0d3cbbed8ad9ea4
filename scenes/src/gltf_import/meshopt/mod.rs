//! Buffer views that EXT_meshopt_compression or KHR_meshopt_compression store compressed.
//!
//! Source: the text of KHR_meshopt_compression, appendices A and B. It holds the older extension whole: version 0 of its attributes and
//! all but one of its filters. The decoders are written here because no library in Rust reads version 1.

mod attributes;
mod filters;
mod indices;
#[cfg(test)]
mod tests;

use super::document::{Document, pointer, typed};
use super::error::{LoadError, Source};
use super::resources::Limits;
use gltf::json;
use serde::Deserialize;
use serde_json::Value;
use std::borrow::Cow;

const REPAIR: &str = "pack the scene again with gltfpack or `npx @gltf-transform/cli meshopt`";

/// What cannot be decoded, in words.
type Fault = &'static str;

const SHORT: Fault = "its data ends too early";
const LONG: Fault = "its data goes on behind its end";

/// The extension object of a buffer view.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Names of the extension.
const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// Whether a buffer only stands for what views hold compressed, `[n_buffers]`: it has no bytes, or none that need to be read.
pub(super) fn placeholders(document: &Document) -> Vec<bool> {
    let mut stands_in = vec![false; document.buffers.len()];
    let mut is_read = vec![false; document.buffers.len()];
    for view in &document.buffer_views {
        match extension(view) {
            Some((_, value)) => {
                stands_in[view.buffer.value()] = true;
                if let Some(buffer) = value["buffer"].as_u64() {
                    is_read[buffer as usize] = true;
                }
            }
            None => is_read[view.buffer.value()] = true,
        }
    }
    stands_in.into_iter().zip(is_read).map(|(stands_in, is_read)| stands_in && !is_read).collect()
}

/// The extension's name and object, of a compressed view.
fn extension(view: &json::buffer::View) -> Option<(&'static str, &Value)> {
    let others = &view.extensions.as_ref()?.others;
    NAMES.iter().find_map(|name| Some((*name, others.get(*name)?)))
}

/// The bytes of every compressed buffer view, `[n_views]`; `None` of the others.
pub(super) fn views(
    source: &Source,
    limits: &Limits,
    document: &Document,
    buffers: &[Cow<'_, [u8]>],
) -> Result<Vec<Option<Vec<u8>>>, LoadError> {
    let mut total: u64 = 0;
    let view_of = |(index, view): (usize, &json::buffer::View)| {
        let Some((name, value)) = extension(view) else { return Ok(None) };
        let place = format!("{}/extensions/{name}", pointer("bufferViews", index));
        let invalid = |found: String| source.invalid(&place, found, REPAIR);
        let compressed: Compressed = typed(value).map_err(&invalid)?;
        compressed.check(view.byte_length.0).map_err(&invalid)?;
        total = total.saturating_add(view.byte_length.0);
        if total > limits.buffer_bytes {
            let found = format!("{total} bytes of decoded buffer views up to here");
            return Err(source.too_large(&place, found, limits.buffer_bytes, "split the scene or make it smaller"));
        }
        let buffer = &buffers[compressed.buffer];
        let (offset, length) = (compressed.byte_offset, compressed.byte_length);
        let end = offset.checked_add(length).filter(|&end| end <= buffer.len() as u64).ok_or_else(|| {
            invalid(format!("byteOffset {offset} + byteLength {length} in a buffer of {} bytes", buffer.len()))
        })?;
        let bytes = &buffer[offset as usize..end as usize];
        compressed.decode(bytes).map(Some).map_err(|fault| invalid(fault.into()))
    };
    document.buffer_views.iter().enumerate().map(view_of).collect()
}

impl Compressed {
    /// The extension's rules for its fields.
    fn check(&self, view_length: u64) -> Result<(), String> {
        let Self { byte_stride: stride, count, mode, filter, .. } = *self;
        let is_stride = match (mode, filter) {
            (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
            (Mode::Triangles | Mode::Indices, _) => return Err(format!("mode {mode:?} with filter {filter:?}")),
            (Mode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
            (Mode::Attributes, Filter::None | Filter::Exponential) => {
                stride.is_multiple_of(4) && (4..=256).contains(&stride)
            }
        };
        if !is_stride {
            return Err(format!("byteStride {stride}, not one of mode {mode:?} with filter {filter:?}"));
        }
        if mode == Mode::Triangles && !count.is_multiple_of(3) {
            return Err(format!("count {count} of triangles' indices, must be a multiple of 3"));
        }
        if stride.checked_mul(count) != Some(view_length) {
            return Err(format!("{count} elements of {stride} bytes, but byteLength {view_length}"));
        }
        Ok(())
    }

    fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, Fault> {
        let (count, stride) = (self.count as usize, self.byte_stride as usize);
        let mut decoded = match self.mode {
            Mode::Attributes => attributes::decode(bytes, count, stride)?,
            Mode::Triangles => indices::packed(&indices::triangles(bytes, count)?, stride),
            Mode::Indices => indices::packed(&indices::sequence(bytes, count)?, stride),
        };
        match self.filter {
            Filter::None => {}
            Filter::Octahedral => filters::octahedral(&mut decoded, stride),
            Filter::Quaternion => filters::quaternion(&mut decoded),
            Filter::Exponential => filters::exponential(&mut decoded),
            Filter::Color => filters::color(&mut decoded, stride),
        }
        Ok(decoded)
    }
}

/// Bytes that are taken from the front.
#[derive(Default)]
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(SHORT)?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, Fault> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned LEB128 number of at most five bytes.
    fn varint(&mut self) -> Result<u32, Fault> {
        let mut value = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("a number of more than five bytes")
    }

    fn end(&self) -> Result<(), Fault> {
        if self.0.is_empty() { Ok(()) } else { Err(LONG) }
    }
}
