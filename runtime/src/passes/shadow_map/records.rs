//! Casters as the shader reads them: indices of what is opaque, vertices and masks of what has holes.

use super::{CasterMasks, NO_MASK, ShadowCasters};
use bytemuck::{Pod, Zeroable};
use localprt_scenes::Wrap;
use std::ops::Range;

/// `Mask` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct MaskRecord {
    pub(super) first_texel: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) wrap_u: u32,
    pub(super) wrap_v: u32,
    pub(super) nearest: u32,
    pub(super) cutoff: f32,
}

/// A vertex of a masked triangle: position, metres, then coordinates, vertex alpha and number of the mask.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct MaskedVertex {
    position: [f32; 3],
    uv: [f32; 2],
    alpha: f32,
    mask: u32,
}

/// Vertices of the triangles without holes, three each.
pub fn opaque_indices(casters: &ShadowCasters) -> Vec<u32> {
    let is_opaque = |triangle: usize| casters.masks.as_ref().is_none_or(|masks| masks.mask[triangle] == NO_MASK);
    let triangles = casters.triangles.iter().enumerate().filter(|(triangle, _)| is_opaque(*triangle));
    triangles.flat_map(|(_, corners)| *corners).collect()
}

/// Vertices of the triangles whose mask is one of these images, three each.
pub fn masked_vertices(casters: &ShadowCasters, images: &Range<usize>) -> Vec<MaskedVertex> {
    let Some(masks) = &casters.masks else { return Vec::new() };
    let is_wanted = |mask: u32| mask != NO_MASK && images.contains(&(masks.masks[mask as usize].image as usize));
    let triangles = casters.triangles.iter().zip(&masks.mask).filter(|(_, mask)| is_wanted(**mask));
    let vertex = |vertex: usize, mask: u32| MaskedVertex {
        position: casters.positions[vertex].to_array(),
        uv: masks.uv[vertex].to_array(),
        alpha: masks.alpha[vertex],
        mask,
    };
    triangles.flat_map(|(corners, &mask)| corners.map(|corner| vertex(corner as usize, mask))).collect()
}

/// Records of all masks, and the alpha of some images, padded to whole words. Masks of other images keep their place, so that a vertex
/// holds the same mask everywhere.
pub fn mask_records(masks: &CasterMasks, images: &Range<usize>) -> (Vec<MaskRecord>, Vec<u8>) {
    let mut texels = Vec::new();
    let mut first_texel = vec![0; masks.images.len()];
    for image in images.clone() {
        first_texel[image] = texels.len() as u32;
        texels.extend(&masks.images[image].alpha);
    }
    texels.resize(texels.len().next_multiple_of(4), 0);
    let wrap = |wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => 1,
        Wrap::ClampToEdge => 2,
    };
    let records = masks.masks.iter().map(|mask| {
        let image = &masks.images[mask.image as usize];
        MaskRecord {
            first_texel: first_texel[mask.image as usize],
            width: image.width,
            height: image.height,
            wrap_u: wrap(mask.wrap_u),
            wrap_v: wrap(mask.wrap_v),
            nearest: u32::from(mask.nearest),
            cutoff: mask.cutoff,
        }
    });
    (records.collect(), texels)
}
