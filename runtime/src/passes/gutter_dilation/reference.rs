//! CPU twin of the gutter dilation.

use crate::checked_bake::CheckedBake;
use crate::coverage_map::CoverageMap;
use glam::Vec3;

/// Writes every receiver's irradiance into its texel and into the gutter texels that take their value from it.
///
/// Texels are only ever written here, so the same map can be passed again for the next gather. A texel named twice keeps
/// its last value: gutters come after receivers, both in file order.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn gutter_dilation(baked: &CheckedBake<'_>, irradiance: &[Vec3], map: &mut CoverageMap) {
    let view = baked.view();
    assert_eq!(map.size(), view.metadata.lightmap_size);
    assert_eq!(irradiance.len(), baked.n_receivers());
    let texels = map.texels_mut();
    for (&texel, irradiance) in view.receiver_texel.iter().zip(irradiance) {
        texels[texel as usize] = irradiance.extend(1.0);
    }
    for &[texel, receiver] in view.gutters {
        texels[texel as usize] = irradiance[receiver as usize].extend(1.0);
    }
}
