//! What relighters know of the surface while light changes: a value for every covered texel of the direct light map.

use crate::error::RelightError;
use glam::Vec3;
use localprt_formats::quantize::pack_uv;
use rayon::prelude::*;

/// What the surface looks like in every covered texel of the direct light map. Arrays of equal length, one entry per
/// covered texel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceTexels {
    /// Texels per side; the file's `direct_size`.
    pub size: u32,
    /// Covered texels, `y * size + x`, rising.
    pub index: Vec<u32>,
    /// Where the texel's surface lies in the receiver map, as [`localprt_formats::quantize::pack_uv`] packs it; empty where both maps
    /// share a layout.
    pub lightmap_uv: Vec<u32>,
    /// Diffuse albedo, linear Rec. 709.
    pub albedo: Vec<Vec3>,
    /// Emitted radiance, W sr^-1 m^-2.
    pub emission: Vec<Vec3>,
    /// Irradiance straight from punctual lights, W m^-2, shadows included. Neither emission nor sky belong here: they
    /// arrive through the transport.
    pub direct: Vec<Vec3>,
}

impl SurfaceTexels {
    /// Number of covered texels.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// True if no texel is covered.
    pub fn is_empty(&self) -> bool {
        self.index.is_empty()
    }

    /// Checks lengths, indices and values against a file's `direct_size`.
    ///
    /// # Errors
    /// [`RelightError::MapSize`], [`RelightError::Length`], [`RelightError::TexelIndex`], [`RelightError::NotFinite`].
    pub fn check(&self, direct_size: u32) -> Result<(), RelightError> {
        if self.size != direct_size {
            return Err(RelightError::MapSize { expected: direct_size, found: self.size });
        }
        let arrays =
            [("surface albedo", &self.albedo), ("surface emission", &self.emission), ("surface direct", &self.direct)];
        check_index(self.size, &self.index)?;
        check_places(self.len(), &self.lightmap_uv)?;
        check_values(self.len(), &arrays.map(|(what, values)| (what, values.as_slice())))
    }
}

/// Refuses texel indices that do not rise or lie outside of a map.
pub(crate) fn check_index(size: u32, index: &[u32]) -> Result<(), RelightError> {
    let limit = u64::from(size) * u64::from(size);
    let rises = |position: usize| position == 0 || index[position - 1] < index[position];
    let is_bad = |position: usize| u64::from(index[position]) >= limit || !rises(position);
    match first_where(index.len(), is_bad) {
        Some(position) => Err(RelightError::TexelIndex { position, index: index[position], limit }),
        None => Ok(()),
    }
}

/// Refuses places that are neither one per texel nor none.
pub(crate) fn check_places(expected: usize, lightmap_uv: &[u32]) -> Result<(), RelightError> {
    if !lightmap_uv.is_empty() && lightmap_uv.len() != expected {
        return Err(RelightError::Length { what: "lightmap coordinates", expected, found: lightmap_uv.len() });
    }
    Ok(())
}

/// Place in the receiver map, packed, of a texel of a map of `size` texels per side; `entry` counts covered texels.
pub(crate) fn lightmap_uv(size: u32, index: u32, entry: usize, lightmap_uv: &[u32]) -> u32 {
    lightmap_uv.get(entry).copied().unwrap_or_else(|| {
        let center = [index % size, index / size].map(|texel| (texel as f32 + 0.5) / size as f32);
        pack_uv(center)
    })
}

/// Refuses named arrays of another length and values that are not finite.
pub(crate) fn check_values(expected: usize, arrays: &[(&'static str, &[Vec3])]) -> Result<(), RelightError> {
    for &(what, values) in arrays {
        if values.len() != expected {
            return Err(RelightError::Length { what, expected, found: values.len() });
        }
    }
    for &(what, values) in arrays {
        if let Some(index) = first_where(values.len(), |index| !values[index].is_finite()) {
            return Err(RelightError::NotFinite { what, index });
        }
    }
    Ok(())
}

/// First of `0..len` for which `is_bad` holds, searched in parallel blocks without a branch per entry.
fn first_where(len: usize, is_bad: impl Fn(usize) -> bool + Sync) -> Option<usize> {
    const BLOCK: usize = 4096;
    let block = |block: usize| block * BLOCK..len.min((block + 1) * BLOCK);
    let has_bad = |&index: &usize| block(index).fold(false, |found, entry| found | is_bad(entry));
    let bad_block = (0..len.div_ceil(BLOCK)).into_par_iter().find_first(has_bad)?;
    block(bad_block).find(|&entry| is_bad(entry))
}
