//! Primitives whose geometry KHR_draco_mesh_compression stores.
//!
//! What a stream holds takes the place of the accessors' data, in their own component types.

use super::accessors::View;
use super::document::{Document, typed};
use super::error::{LoadError, Source};
use super::geometry::place_of;
use super::resources::Limits;
use crate::guarded::guarded;
use draco_core::{
    AttributeValueIndex, DataType, DecodeLimits, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointAttribute,
    PointIndex,
};
use gltf::json;
use gltf::json::accessor::ComponentType;
use gltf::json::validation::Checked;
use serde::Deserialize;
use std::collections::BTreeMap;

const NAME: &str = "KHR_draco_mesh_compression";
const REPAIR: &str = "compress the mesh again, for example with `npx @gltf-transform/cli draco`";

/// The extension object of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer_view: usize,
    /// Numbers of the stream's attributes by the names that the primitive has for them.
    attributes: BTreeMap<String, u32>,
}

/// The bytes of accessors that are stored in streams alone, by their numbers, without gaps between elements.
pub(super) fn accessors(
    source: &Source,
    limits: &Limits,
    document: &Document,
    views: &[View<'_>],
) -> Result<BTreeMap<usize, Vec<u8>>, LoadError> {
    let mut decoded = BTreeMap::new();
    let mut total: u64 = 0;
    for (mesh, data) in document.meshes.iter().enumerate() {
        for (number, primitive) in data.primitives.iter().enumerate() {
            let others = primitive.extensions.as_ref().map(|extensions| &extensions.others);
            let Some(value) = others.and_then(|others| others.get(NAME)) else { continue };
            let place = format!("{}/extensions/{NAME}", place_of(mesh, number));
            let invalid = |found: String| source.invalid(&place, found, REPAIR);
            let compressed: Compressed = typed(value).map_err(&invalid)?;
            let wanted = wanted(document, primitive, &compressed, &decoded);
            if wanted.is_empty() {
                continue;
            }
            let left = limits.buffer_bytes.saturating_sub(total);
            let streamed = decode(views[compressed.buffer_view].bytes, limits, left).map_err(&invalid)?;
            for (accessor, part) in wanted {
                let bytes = part.bytes(&streamed, &document.accessors[accessor]).map_err(&invalid)?;
                total += bytes.len() as u64;
                if total > limits.buffer_bytes {
                    let found = format!("{total} bytes of decoded geometry up to here");
                    return Err(source.too_large(
                        place,
                        found,
                        limits.buffer_bytes,
                        "split the scene or make it smaller",
                    ));
                }
                decoded.insert(accessor, bytes);
            }
        }
    }
    Ok(decoded)
}

/// A part of a stream.
#[derive(Clone, Copy)]
enum Part {
    Indices,
    Attribute(u32),
}

/// The accessors of a primitive that have no data of their own and were not decoded before, and what they stand for.
fn wanted(
    document: &Document,
    primitive: &json::mesh::Primitive,
    compressed: &Compressed,
    decoded: &BTreeMap<usize, Vec<u8>>,
) -> Vec<(usize, Part)> {
    let attributes = primitive.attributes.iter().filter_map(|(semantic, accessor)| {
        let Checked::Valid(semantic) = semantic else { return None };
        Some((accessor.value(), Part::Attribute(*compressed.attributes.get(&semantic.to_string())?)))
    });
    let indices = primitive.indices.iter().map(|accessor| (accessor.value(), Part::Indices));
    let is_wanted = |(accessor, _): &(usize, Part)| {
        let stored = &document.accessors[*accessor];
        stored.buffer_view.is_none() && stored.sparse.is_none() && !decoded.contains_key(accessor)
    };
    indices.chain(attributes).filter(is_wanted).collect()
}

fn decode(stream: &[u8], limits: &Limits, most_bytes: u64) -> Result<Mesh, String> {
    let ceilings = DecodeLimits::default()
        .with_max_points(limits.triangles.saturating_mul(3))
        .with_max_faces(limits.triangles)
        .with_max_decoded_bytes(most_bytes);
    guarded("the decoder of Draco streams failed", || {
        let mut mesh = Mesh::new();
        let mut buffer = DecoderBuffer::new(stream).with_limits(ceilings);
        let decoded = MeshDecoder::new().decode(&mut buffer, &mut mesh);
        decoded.map(|()| mesh).map_err(|error| format!("the Draco stream does not decode: {error}"))
    })
}

impl Part {
    /// The part as an accessor says that it is.
    fn bytes(self, mesh: &Mesh, accessor: &json::Accessor) -> Result<Vec<u8>, String> {
        let Checked::Valid(component) = accessor.component_type else { return Err("an unknown componentType".into()) };
        let Checked::Valid(shape) = accessor.type_ else { return Err("an unknown type".into()) };
        let (components, count) = (shape.multiplicity(), accessor.count.0);
        let (what, held) = match self {
            Self::Indices => ("indices", 3 * mesh.num_faces() as u64),
            Self::Attribute(_) => ("vertices", mesh.num_points() as u64),
        };
        if held != count {
            return Err(format!("{held} {what} in the stream, but its accessor has count {count}"));
        }
        let mut bytes = Vec::with_capacity(held as usize * components * component.0.size());
        match self {
            Self::Indices => {
                for face in 0..mesh.num_faces() {
                    let corners = mesh.face(FaceIndex(face as u32));
                    corners.iter().for_each(|corner| push(&mut bytes, component.0, f64::from(corner.0)));
                }
            }
            Self::Attribute(number) => {
                let attribute = mesh
                    .attribute_by_unique_id(number)
                    .ok_or_else(|| format!("no attribute {number} in the stream"))?;
                if usize::from(attribute.num_components()) < components {
                    let found = attribute.num_components();
                    return Err(format!("attribute {number} of {found} components, its accessor has {components}"));
                }
                for point in 0..mesh.num_points() {
                    let value = attribute.mapped_index(PointIndex(point as u32));
                    for at in 0..components {
                        let number = number_at(attribute, value, at).ok_or("attribute values behind their end")?;
                        push(&mut bytes, component.0, number);
                    }
                }
            }
        }
        Ok(bytes)
    }
}

/// A component of an attribute's value; `None` of types that glTF does not have.
fn number_at(attribute: &PointAttribute, value: AttributeValueIndex, component: usize) -> Option<f64> {
    let size = match attribute.data_type() {
        DataType::Int8 | DataType::Uint8 | DataType::Bool => 1,
        DataType::Int16 | DataType::Uint16 => 2,
        DataType::Int32 | DataType::Uint32 | DataType::Float32 => 4,
        _ => return None,
    };
    let start = usize::try_from(attribute.byte_stride()).ok()?.checked_mul(value.0 as usize)? + component * size;
    let bytes = attribute.buffer().data().get(start..start + size)?;
    Some(match (attribute.data_type(), bytes) {
        (DataType::Int8, &[a]) => f64::from(a as i8),
        (_, &[a]) => f64::from(a),
        (DataType::Int16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (_, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (DataType::Int32, &[a, b, c, d]) => f64::from(i32::from_le_bytes([a, b, c, d])),
        (DataType::Uint32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => return None,
    })
}

fn push(bytes: &mut Vec<u8>, component: ComponentType, number: f64) {
    match component {
        ComponentType::I8 => bytes.push(number as i8 as u8),
        ComponentType::U8 => bytes.push(number as u8),
        ComponentType::I16 => bytes.extend((number as i16).to_le_bytes()),
        ComponentType::U16 => bytes.extend((number as u16).to_le_bytes()),
        ComponentType::U32 => bytes.extend((number as u32).to_le_bytes()),
        ComponentType::F32 => bytes.extend((number as f32).to_le_bytes()),
    }
}
