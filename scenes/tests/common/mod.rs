//! Helpers of the import tests: small glTF files from parts, and comparison of scenes.
#![allow(dead_code)] // Each test binary uses its own part of this module.

use localprt_scenes::{Material, Scene, TextureRef};
use serde_json::{Value, json};

/// Bytes of floats as glTF stores them.
pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Bytes of 16-bit integers as glTF stores them.
pub fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A GLB of a JSON part and a binary chunk.
pub fn glb(root: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend_from_slice(&((12 + 8 + text.len() + 8 + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        bytes.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(chunk);
    }
    bytes
}

/// Positions of a unit square in the plane z = 0, counter-clockwise, and its two triangles.
pub const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
/// Indices over [`SQUARE`].
pub const SQUARE_INDICES: [u16; 6] = [0, 1, 2, 0, 2, 3];

/// The square as glTF with everything in one buffer: positions, indices, normals and texture coordinates.
pub fn square() -> (Value, Vec<u8>) {
    let mut bin = floats(&SQUARE);
    bin.extend(shorts(&SQUARE_INDICES));
    bin.extend(floats(&[0.0, 0.0, 1.0].repeat(4)));
    bin.extend(floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]));
    let root = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 2, "TEXCOORD_0": 3 }, "indices": 1, "material": 0,
        }] }],
        "materials": [{ "name": "paint", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1.0] } }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 3, "componentType": 5126, "count": 4, "type": "VEC2" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 60, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 108, "byteLength": 32 },
        ],
        "buffers": [{ "byteLength": 140 }],
    });
    (root, bin)
}

fn same_reference(a: &Option<TextureRef>, b: &Option<TextureRef>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.texture == b.texture && a.uv_set == b.uv_set && a.transform == b.transform,
        (a, b) => a.is_none() && b.is_none(),
    }
}

/// Whether two materials are equal in every field.
pub fn same_material(a: &Material, b: &Material) -> bool {
    a.name == b.name
        && a.base_color == b.base_color
        && same_reference(&a.base_color_texture, &b.base_color_texture)
        && a.emission == b.emission
        && same_reference(&a.emission_texture, &b.emission_texture)
        && same_reference(&a.normal_texture, &b.normal_texture)
        && a.normal_scale == b.normal_scale
        && a.metallic == b.metallic
        && a.roughness == b.roughness
        && a.alpha == b.alpha
        && a.double_sided == b.double_sided
}

/// Compares what a bake sees, exactly; cameras to rounding.
pub fn assert_same(a: &Scene, b: &Scene) {
    assert_eq!(a.meshes.len(), b.meshes.len());
    for (a, b) in a.meshes.iter().zip(&b.meshes) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.material, b.material, "{}", a.name);
        assert!(a.positions == b.positions, "positions of {}", a.name);
        assert!(a.triangles == b.triangles, "triangles of {}", a.name);
        assert!(a.normals == b.normals, "normals of {}", a.name);
        assert!(a.tangents == b.tangents, "tangents of {}", a.name);
        assert!(a.uv_sets == b.uv_sets, "texture coordinates of {}", a.name);
        assert!(a.colors == b.colors, "colors of {}", a.name);
        assert_eq!(a.lightmap, b.lightmap, "{}", a.name);
    }
    assert_eq!(a.light_map_set, b.light_map_set);
    assert_eq!(a.materials.len(), b.materials.len());
    for (a, b) in a.materials.iter().zip(&b.materials) {
        assert!(same_material(a, b), "{a:?} and {b:?}");
    }
    assert_eq!(a.textures.len(), b.textures.len());
    for (a, b) in a.textures.iter().zip(&b.textures) {
        assert_eq!((a.image, a.wrap_u, a.wrap_v, a.nearest), (b.image, b.wrap_u, b.wrap_v, b.nearest));
    }
    assert_eq!(a.images.len(), b.images.len());
    for (a, b) in a.images.iter().zip(&b.images) {
        assert_eq!((&a.name, a.width, a.height), (&b.name, b.width, b.height));
        assert!(a.rgba == b.rgba && a.encoded == b.encoded, "image {}", a.name);
    }
    assert_eq!(a.lights, b.lights);
    assert_eq!(a.cameras.len(), b.cameras.len());
    for (a, b) in a.cameras.iter().zip(&b.cameras) {
        assert_eq!((&a.name, a.fov_y, a.aspect), (&b.name, b.fov_y, b.aspect));
        // Orthonormalizing rounded unit axes moves them by a few units of 2^-24.
        assert!(a.to_world.abs_diff_eq(b.to_world, 4.0 * f32::EPSILON), "{} and {}", a.to_world, b.to_world);
    }
}
