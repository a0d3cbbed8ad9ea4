//! The surfaces of a baked scene in one file: texels of the light map with their samples, and what casts shadows on them.
//!
//! What [`localprt_runtime::Relighter::set_scene`] computes and uploads, as the shaders read it. Little-endian:
//!
//! | byte | type | content |
//! |---|---|---|
//! | 0 | 8 bytes | magic `89 4C 50 53 0D 0A 1A 0A` |
//! | 8 | u32 | version, 1 |
//! | 12 | u32 | texels per side of the light map |
//! | 16 | 32 bytes | content hash of the baked file |
//! | 48 | u32 | number of arrays, 11 |
//! | 52 | u32 | 0 |
//! | 56 | 11 × 2 × u64 | bytes of each array, and its bytes in the file; then the arrays, one after the other, each a zlib stream |

use localprt_formats::{Baked, quantize::pack_uv};
use localprt_runtime::passes::shadow_map::records::{mask_records, masked_vertices, opaque_indices};
use localprt_runtime::scene_light::scene_texels;
use localprt_runtime::{SceneTexels, ShadowCasters};
use localprt_scenes::Scene;
use localprt_surfaces::rays::RayCaster;
use miniz_oxide::deflate::compress_to_vec_zlib;
use std::error::Error;
use std::fs;
use std::path::Path;

const MAGIC: [u8; 8] = *b"\x89LPS\r\n\x1a\n";
const VERSION: u32 = 1;
/// Where a baked file's content hash is.
const HASH: std::ops::Range<usize> = 24..56;
/// From 0 to 10.
const COMPRESSION: u8 = 6;

/// Writes the surfaces of a baked file's scene.
pub fn write(file: &Path, scene: Option<&Path>, out: &Path) -> Result<(), Box<dyn Error>> {
    let in_file = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let baked = Baked::open(file).map_err(|error| in_file(&error))?;
    let beside = file.with_file_name(&baked.metadata().scene_path);
    let path = scene.unwrap_or(&beside);
    let scene = localprt_scenes::load(path).map_err(|error| format!("{}: {error}", path.display()))?;
    if scene.hash != baked.metadata().scene_hash {
        return Err(format!("{} is not the scene that {} was baked from", path.display(), file.display()).into());
    }
    let caster = RayCaster::new(&scene)?;
    let texels = scene_texels(&caster, &baked.view());
    texels.check(baked.metadata().direct_size)?;
    if texels.material.iter().any(|&material| material > u32::from(u16::MAX)) {
        return Err("more than 65536 materials".into());
    }
    let casters = ShadowCasters::of_scene(&scene);
    casters.check()?;
    let hash = fs::read(file)?.get(HASH).map(<[u8]>::to_vec).unwrap_or_default();
    let arrays = arrays(&scene, &texels, &casters);
    let mut bytes = MAGIC.to_vec();
    bytes.extend([VERSION, texels.size].iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(&hash);
    bytes.extend([arrays.len() as u32, 0].iter().flat_map(|word| word.to_le_bytes()));
    let packed: Vec<Vec<u8>> = arrays.iter().map(|array| compress_to_vec_zlib(array, COMPRESSION)).collect();
    let lengths = arrays.iter().zip(&packed).flat_map(|(array, packed)| [array.len() as u64, packed.len() as u64]);
    bytes.extend(lengths.flat_map(u64::to_le_bytes));
    packed.iter().for_each(|array| bytes.extend(array));
    let n_bytes: usize = arrays.iter().map(Vec::len).sum();
    fs::write(out, &bytes).map_err(|error| format!("{}: {error}", out.display()))?;
    let (n_texels, n_samples) = (texels.len(), texels.samples.len());
    println!("{}: {n_texels} texels, {n_samples} samples, {n_bytes} bytes in {}", out.display(), bytes.len());
    Ok(())
}

/// In the order of `surfaces.gd`.
fn arrays(scene: &Scene, texels: &SceneTexels, casters: &ShadowCasters) -> [Vec<u8>; 11] {
    let names: Vec<u8> = scene
        .materials
        .iter()
        .flat_map(|material| material.name.bytes().filter(|&byte| byte != 0).chain([0]))
        .collect();
    let surface: Vec<[u32; 3]> = (0..texels.len()).map(|texel| surface_record(texels, texel)).collect();
    let is_dark = texels.emission.iter().all(|emission| emission.to_array() == [0.0; 3]);
    let emission: &[_] = if is_dark { &[] } else { &texels.emission };
    let geometry: Vec<u32> = (0..texels.len()).flat_map(|texel| geometry_record(texels, texel)).collect();
    // All images in one page.
    let images = 0..casters.masks.as_ref().map_or(0, |masks| masks.images.len());
    let (indices, masked) = (opaque_indices(casters), masked_vertices(casters, &images));
    let (masks, mask_texels) = casters.masks.as_ref().map(|masks| mask_records(masks, &images)).unwrap_or_default();
    let bounds = casters.bounds();
    [
        padded(names),
        bytemuck::cast_slice(&texels.index).to_vec(),
        bytemuck::cast_slice(&surface).to_vec(),
        emission.iter().flat_map(|emission| emission.to_array()).flat_map(f32::to_le_bytes).collect(),
        bytemuck::cast_slice(&geometry).to_vec(),
        bytemuck::cast_slice(&texels.samples).to_vec(),
        casters.positions.iter().flat_map(|position| position.to_array()).flat_map(f32::to_le_bytes).collect(),
        bytemuck::cast_slice(&indices).to_vec(),
        bytemuck::cast_slice(&masked).to_vec(),
        [bounds.low, bounds.high]
            .iter()
            .flat_map(|corner| corner.to_array())
            .flat_map(f32::to_le_bytes)
            .chain(bytemuck::cast_slice(&masks).to_vec())
            .collect(),
        mask_texels,
    ]
}

/// `Surface` of direct_lightmap.wgsl.
fn surface_record(texels: &SceneTexels, texel: usize) -> [u32; 3] {
    let unorm16 = |value: f32| (value.clamp(0.0, 1.0) * 65535.0).round() as u32;
    let [r, g, b] = texels.albedo[texel].to_array().map(unorm16);
    let (index, size) = (texels.index[texel], texels.size);
    let center = || pack_uv([index % size, index / size].map(|at| (at as f32 + 0.5) / size as f32));
    let place = texels.lightmap_uv.get(texel).copied().unwrap_or_else(center);
    [r | g << 16, b | texels.material[texel] << 16, place]
}

/// Ten words of direct_irradiance.wgsl.
fn geometry_record(texels: &SceneTexels, texel: usize) -> [u32; 10] {
    let vectors = [texels.position[texel], texels.normal[texel], texels.geometric_normal[texel]];
    let mut words = [0; 10];
    for (word, value) in words.iter_mut().zip(vectors.iter().flat_map(|vector| vector.to_array())) {
        *word = value.to_bits();
    }
    words[9] = texels.sample_end.get(texel).copied().unwrap_or(0);
    words
}

fn padded(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}
