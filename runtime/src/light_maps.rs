//! Light of the receivers as an engine reads it: maps that are sampled with TEXCOORD_1.

use crate::{coverage_map::CoverageMap, passes::gutter_dilation::gutter_dilation};
use glam::Vec3;
use localprt_formats::{Checked, sh};

/// Light in the receiver map's texels, gutters filled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightMaps {
    /// Irradiance about the shading normal, W m^-2, not negative.
    pub irradiance: CoverageMap,
    /// SH coefficients of degree 1 in world axes, one map for each, whose convolution with the cosine is the irradiance about other normals
    /// than that: empty where a file has receivers of degree 0.
    pub radiance: Vec<CoverageMap>,
}

impl LightMaps {
    /// Of one normal only.
    pub fn of_irradiance(irradiance: CoverageMap) -> Self {
        Self { irradiance, radiance: Vec::new() }
    }

    /// Maps of a file's size, without light.
    pub fn uncovered(baked: &Checked<'_>) -> Self {
        let map = CoverageMap::uncovered(baked.view().metadata.lightmap_size);
        let n_maps = if baked.n_k() > 1 { baked.n_k() } else { 0 };
        Self { radiance: vec![map.clone(); n_maps], irradiance: map }
    }

    /// Irradiance about a normal, W m^-2, not negative, where `read` reads a map: a normal map's, of receivers of degree 1; that about the
    /// shading normal otherwise. `None` where `read` finds nothing.
    pub fn irradiance_about(&self, normal: Vec3, read: impl Fn(&CoverageMap) -> Option<Vec3>) -> Option<Vec3> {
        if self.radiance.is_empty() {
            return read(&self.irradiance);
        }
        let weights = sh::irradiance_weights_degree_1(normal.to_array());
        let mut sum = Vec3::ZERO;
        for (map, weight) in self.radiance.iter().zip(weights) {
            sum += read(map)? * weight;
        }
        Some(sum.max(Vec3::ZERO))
    }

    /// Writes `[n_receivers]` irradiance, and the radiance in `[n_receivers, n_k]` coefficients, into the maps.
    pub(crate) fn write(&mut self, baked: &Checked<'_>, irradiance: &[Vec3], coefficients: &[Vec3]) {
        gutter_dilation(baked, irradiance, &mut self.irradiance);
        let n_k = self.radiance.len();
        for (k, map) in self.radiance.iter_mut().enumerate() {
            let of_receivers: Vec<Vec3> = coefficients.iter().skip(k).step_by(n_k).copied().collect();
            gutter_dilation(baked, &of_receivers, map);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        passes::receiver_reconstruction::cosine_weights, passes::receiver_reconstruction::receiver_irradiance,
        test_bake,
    };

    /// About a receiver's own normal the maps of radiance say what the map of irradiance says.
    #[test]
    fn maps_of_radiance_hold_the_irradiance() {
        let arrays = test_bake::random(2, 1, 2);
        let baked = arrays.checked().unwrap();
        let coefficients: Vec<Vec3> = (0..baked.n_receivers() * 4)
            .map(|i| Vec3::new(if i % 4 == 0 { 9.0 } else { 0.5 }, i as f32, 1.0))
            .collect();
        let mut irradiance = vec![Vec3::ZERO; baked.n_receivers()];
        receiver_irradiance(&cosine_weights(&baked), &coefficients, &mut irradiance);
        let mut maps = LightMaps::uncovered(&baked);
        maps.write(&baked, &irradiance, &coefficients);
        for (receiver, (&texel, &normal)) in
            baked.view().receiver_texel.iter().zip(baked.view().receiver_normal).enumerate()
        {
            let read = |map: &CoverageMap| Some(map.color(texel as usize));
            let found = maps.irradiance_about(normal.into(), read).unwrap();
            assert!(found.distance(irradiance[receiver]) < 1e-4, "{receiver}: {found}, not {}", irradiance[receiver]);
            assert_ne!(maps.irradiance_about(-Vec3::from(normal), read), Some(found));
        }
        assert_eq!(maps.irradiance_about(Vec3::Y, |_| None), None);
    }

    #[test]
    fn degree_0_has_one_irradiance() {
        let arrays = test_bake::random(2, 0, 2);
        let maps = LightMaps::uncovered(&arrays.checked().unwrap());
        assert!(maps.radiance.is_empty());
        let read = |_: &CoverageMap| Some(Vec3::X);
        assert_eq!(maps.irradiance_about(Vec3::Y, read), maps.irradiance_about(Vec3::NEG_Y, read));
    }
}
