//! CPU twin of the gutter dilation.

use crate::coverage_map::CoverageMap;
use glam::Vec3;
use localprt_formats::Checked;

/// Writes every receiver's irradiance into its texel and into the gutter texels that take their value from it.
///
/// Texels are only ever written here, so the same map can be passed again for the next gather. A texel named twice keeps
/// its last value: gutters come after receivers, both in file order.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn gutter_dilation(baked: &Checked<'_>, irradiance: &[Vec3], map: &mut CoverageMap) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;

    #[test]
    fn gutters_take_the_value_of_their_receiver() {
        let arrays = test_bake::random(1, 0, 1);
        let baked = arrays.checked().unwrap();
        let irradiance: Vec<_> = (0..11).map(|receiver| Vec3::new(receiver as f32, 1.0, 2.0)).collect();
        let mut map = CoverageMap::uncovered(4);
        gutter_dilation(&baked, &irradiance, &mut map);
        for (texel, irradiance) in irradiance.iter().enumerate() {
            assert_eq!(map.color(texel), *irradiance);
        }
        assert_eq!([13, 14].map(|texel| map.color(texel).x), [0.0, 4.0]);
        let covered = (0..16).map(|texel| map.coverage(texel)).sum::<f32>();
        assert_eq!((covered, map.coverage(11), map.coverage(12)), (13.0, 0.0, 0.0));
    }
}
