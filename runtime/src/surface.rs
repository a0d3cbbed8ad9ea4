//! The surfaces behind the texels of the direct light map: what stays while lights and materials change.

use crate::error::RelightError;
use crate::surface_texels::{SurfaceTexels, check_index, check_places, check_values};
use crate::texel_sample::TexelSample;
use glam::Vec3;
use localprt_scenes::{MaterialOverride, SurfacePoint};

/// Geometry and own colors of every covered texel of the direct light map. Arrays of equal length, one entry per covered
/// texel, but for those of samples. World space, metres; unit normals; linear Rec. 709.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneTexels {
    /// Texels per side; the file's `direct_size`.
    pub size: u32,
    /// Covered texels, `y * size + x`, rising.
    pub index: Vec<u32>,
    /// Where the texel's surface lies in the receiver map, as [`localprt_formats::quantize::pack_uv`] packs it; empty where both maps
    /// share a layout.
    pub lightmap_uv: Vec<u32>,
    /// The texel's own point of the surface.
    pub position: Vec<Vec3>,
    /// Shading normal, on the side of the geometric normal.
    pub normal: Vec<Vec3>,
    /// Normal of the triangle.
    pub geometric_normal: Vec<Vec3>,
    /// End of each texel's samples in `samples`, not falling; empty where no texel has any.
    pub sample_end: Vec<u32>,
    /// Points over which direct light is averaged, texel after texel. A texel without any is lit at its own point.
    pub samples: Vec<TexelSample>,
    /// The scene's own diffuse albedo.
    pub albedo: Vec<Vec3>,
    /// The scene's own emitted radiance, W sr^-1 m^-2.
    pub emission: Vec<Vec3>,
    /// Material, by its index in the scene.
    pub material: Vec<u32>,
}

impl SceneTexels {
    /// Number of covered texels.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// True if no texel is covered.
    pub fn is_empty(&self) -> bool {
        self.index.is_empty()
    }

    /// Mean of a value over the samples of a texel; the value at its own point if it has none.
    pub fn mean(&self, texel: usize, value: impl Fn(&SurfacePoint) -> Vec3) -> Vec3 {
        let (position, normal) = (self.position[texel], self.normal[texel]);
        match self.samples_of(texel) {
            [] => value(&SurfacePoint { position, normal, geometric_normal: self.geometric_normal[texel] }),
            samples => samples.iter().map(|sample| value(&sample.point(position))).sum::<Vec3>() / samples.len() as f32,
        }
    }

    /// The samples of a texel.
    pub fn samples_of(&self, texel: usize) -> &[TexelSample] {
        let end = |texel: usize| self.sample_end.get(texel).map_or(0, |&end| end as usize);
        &self.samples[if texel == 0 { 0 } else { end(texel - 1) }..end(texel)]
    }

    /// Checks lengths, indices and values against a file's `direct_size`.
    ///
    /// # Errors
    /// [`RelightError::MapSize`], [`RelightError::Length`], [`RelightError::TexelIndex`], [`RelightError::SampleEnd`],
    /// [`RelightError::NotFinite`].
    pub fn check(&self, direct_size: u32) -> Result<(), RelightError> {
        if self.size != direct_size {
            return Err(RelightError::MapSize { expected: direct_size, found: self.size });
        }
        if self.material.len() != self.len() {
            let (expected, found) = (self.len(), self.material.len());
            return Err(RelightError::Length { what: "texel material", expected, found });
        }
        check_index(self.size, &self.index)?;
        check_places(self.len(), &self.lightmap_uv)?;
        self.check_samples()?;
        check_values(
            self.len(),
            &[
                ("texel position", &self.position),
                ("texel normal", &self.normal),
                ("texel geometric normal", &self.geometric_normal),
                ("texel albedo", &self.albedo),
                ("texel emission", &self.emission),
            ],
        )
    }

    fn check_samples(&self) -> Result<(), RelightError> {
        let (ends, samples) = (&self.sample_end, self.samples.len());
        if (!ends.is_empty() || samples > 0) && ends.len() != self.len() {
            return Err(RelightError::Length { what: "texel sample ends", expected: self.len(), found: ends.len() });
        }
        let is_bad = |texel: usize| {
            let end = ends[texel] as usize;
            end > samples || (texel > 0 && ends[texel] < ends[texel - 1]) || (texel + 1 == ends.len() && end < samples)
        };
        if let Some(texel) = (0..ends.len()).find(|&texel| is_bad(texel)) {
            return Err(RelightError::SampleEnd { texel, end: ends[texel], samples });
        }
        match self.samples.iter().position(|sample| !sample.is_finite()) {
            Some(index) => Err(RelightError::NotFinite { what: "texel sample", index }),
            None => Ok(()),
        }
    }

    /// Albedo and emission under a lighting state, with the given direct irradiance.
    ///
    /// `overrides` has an entry per material; materials beyond its end keep their own colors. `albedo_override` comes
    /// before a material's albedo, as in [`SurfaceShading`](localprt_scenes::SurfaceShading).
    pub fn shaded(
        &self,
        overrides: &[MaterialOverride],
        albedo_override: Option<f32>,
        direct: Vec<Vec3>,
    ) -> SurfaceTexels {
        let of_texel = |texel: usize| overrides.get(self.material[texel] as usize).copied().unwrap_or_default();
        let albedo = |texel: usize| {
            let own = albedo_override.map(Vec3::splat).or(of_texel(texel).albedo).unwrap_or(self.albedo[texel]);
            own.clamp(Vec3::ZERO, Vec3::ONE)
        };
        SurfaceTexels {
            size: self.size,
            index: self.index.clone(),
            lightmap_uv: self.lightmap_uv.clone(),
            albedo: (0..self.len()).map(albedo).collect(),
            emission: (0..self.len()).map(|texel| of_texel(texel).emission.unwrap_or(self.emission[texel])).collect(),
            direct,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texels() -> SceneTexels {
        SceneTexels {
            size: 4,
            index: vec![3, 5, 9],
            lightmap_uv: Vec::new(),
            position: vec![Vec3::ZERO; 3],
            normal: vec![Vec3::Y; 3],
            geometric_normal: vec![Vec3::Y; 3],
            albedo: vec![Vec3::splat(0.25), Vec3::splat(1.5), Vec3::splat(0.75)],
            emission: vec![Vec3::ZERO, Vec3::splat(3.0), Vec3::ZERO],
            material: vec![0, 1, 2],
            ..SceneTexels::default()
        }
    }

    /// A sample at this distance along x.
    fn sample(x: f32) -> TexelSample {
        let point = SurfacePoint { position: x * Vec3::X, normal: Vec3::Y, geometric_normal: Vec3::Y };
        TexelSample::new(&point, Vec3::ZERO)
    }

    #[test]
    fn means_are_over_samples_or_at_the_texel_s_own_point() {
        let mut texels = texels();
        let at = |texels: &SceneTexels| [0, 1, 2].map(|texel| texels.mean(texel, |point| point.position).x);
        assert_eq!(at(&texels), [0.0, 0.0, 0.0]);
        texels.position[0].x = 8.0;
        texels.sample_end = vec![2, 2, 3];
        texels.samples = vec![sample(1.0), sample(2.0), sample(0.5)];
        // Samples lie where their texel's point is, and so far from it.
        assert_eq!(at(&texels), [9.5, 0.0, 0.5]);
        assert_eq!(texels.check(4), Ok(()));
    }

    #[test]
    fn overrides_replace_by_material_and_albedo_is_clamped() {
        let colors = |overrides: &[MaterialOverride], albedo| {
            let shaded = texels().shaded(overrides, albedo, vec![Vec3::splat(7.0); 3]);
            assert_eq!(shaded.check(4), Ok(()));
            [0, 1, 2].map(|texel| (shaded.albedo[texel].x, shaded.emission[texel].x))
        };
        assert_eq!(colors(&[], None), [(0.25, 0.0), (1.0, 3.0), (0.75, 0.0)]);
        let overrides = [
            MaterialOverride { albedo: None, emission: Some(Vec3::splat(9.0)) },
            MaterialOverride { albedo: Some(Vec3::splat(0.125)), emission: None },
        ];
        assert_eq!(colors(&overrides, None), [(0.25, 9.0), (0.125, 3.0), (0.75, 0.0)]);
        assert_eq!(colors(&overrides, Some(0.5)), [(0.5, 9.0), (0.5, 3.0), (0.5, 0.0)]);
    }

    #[test]
    fn wrong_texels_are_refused() {
        use crate::RelightError::{Length, MapSize, NotFinite, SampleEnd, TexelIndex};
        assert_eq!(texels().check(4), Ok(()));
        assert_eq!(texels().check(8), Err(MapSize { expected: 8, found: 4 }));
        let short = SceneTexels { material: vec![0], ..texels() };
        assert_eq!(short.check(4), Err(Length { what: "texel material", expected: 3, found: 1 }));
        let short = SceneTexels { normal: vec![Vec3::Y], ..texels() };
        assert_eq!(short.check(4), Err(Length { what: "texel normal", expected: 3, found: 1 }));
        let falling = SceneTexels { index: vec![3, 2, 9], ..texels() };
        assert_eq!(falling.check(4), Err(TexelIndex { position: 1, index: 2, limit: 16 }));
        let sampled = |sample_end: &[u32], samples: &[TexelSample]| SceneTexels {
            sample_end: sample_end.to_vec(),
            samples: samples.to_vec(),
            ..texels()
        };
        let two = [sample(1.0), sample(2.0)];
        assert_eq!(sampled(&[1, 1, 2], &two).check(4), Ok(()));
        let what = "texel sample ends";
        assert_eq!(sampled(&[1, 2], &two).check(4), Err(Length { what, expected: 3, found: 2 }));
        assert_eq!(sampled(&[], &two).check(4), Err(Length { what, expected: 3, found: 0 }));
        for (ends, texel) in [([1, 0, 2], 1), ([0, 3, 2], 1), ([0, 1, 1], 2)] {
            assert_eq!(sampled(&ends, &two).check(4), Err(SampleEnd { texel, end: ends[texel], samples: 2 }));
        }
        let far = sampled(&[1, 1, 2], &[sample(1.0), sample(f32::INFINITY)]);
        assert_eq!(far.check(4), Err(NotFinite { what: "texel sample", index: 1 }));
        let infinite = SceneTexels { emission: vec![Vec3::ZERO, Vec3::NAN, Vec3::ZERO], ..texels() };
        assert_eq!(infinite.check(4), Err(NotFinite { what: "texel emission", index: 1 }));
    }
}
