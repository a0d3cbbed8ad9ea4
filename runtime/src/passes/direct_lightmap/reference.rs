//! CPU twin of the direct light map.

use super::SurfaceTexels;
use crate::coverage_map::CoverageMap;
use crate::surface_texels::lightmap_uv;
use glam::{Vec3, Vec4};
use localprt_formats::quantize::unpack_uv;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Rows of the map per parallel task; any number gives the same result.
const ROWS_PER_TASK: usize = 16;

/// Fills `light_map` with outgoing radiance `Le + albedo/pi (D + I)`, W sr^-1 m^-2, and coverage 0 or 1.
///
/// `previous` is the receiver irradiance map of the gather before, of any size, read bilinearly at each texel's place there
/// with taps weighted by coverage; `None` is none. Only the albedo that multiplies the previous irradiance is limited to
/// `0..=feedback_albedo_cap`, so that the feedback converges although ringing can push the gain of the reconstruction
/// above 1; the first reflection of direct light keeps the full albedo. Negative irradiance counts as 0, and so does
/// negative outgoing radiance.
///
/// # Panics
/// If `surface` does not pass [`SurfaceTexels::check`] for the map's size.
pub fn direct_lightmap(
    surface: &SurfaceTexels,
    previous: Option<&CoverageMap>,
    feedback_albedo_cap: f32,
    light_map: &mut CoverageMap,
) {
    assert_eq!(surface.size, light_map.size(), "surface texels and light map differ in size");
    let size = surface.size as usize;
    let texels_per_task = (size * ROWS_PER_TASK).max(1);
    light_map.texels_mut().par_chunks_mut(texels_per_task).enumerate().for_each(|(task, texels)| {
        texels.fill(Vec4::ZERO);
        let first = task * texels_per_task;
        let begin = surface.index.partition_point(|&index| (index as usize) < first);
        let end = surface.index.partition_point(|&index| (index as usize) < first + texels.len());
        for entry in begin..end {
            let index = surface.index[entry] as usize;
            let place = unpack_uv(lightmap_uv(surface.size, surface.index[entry], entry, &surface.lightmap_uv));
            let indirect = previous.and_then(|map| map.sample(place.into())).unwrap_or(Vec3::ZERO);
            let feedback_albedo = surface.albedo[entry].clamp(Vec3::ZERO, Vec3::splat(feedback_albedo_cap));
            let reflected = surface.albedo[entry] * surface.direct[entry] + feedback_albedo * indirect.max(Vec3::ZERO);
            let outgoing = surface.emission[entry] + reflected / PI;
            texels[index - first] = outgoing.max(Vec3::ZERO).extend(1.0);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::quantize::pack_uv;

    fn one_texel(albedo: f32, emission: f32, direct: f32) -> SurfaceTexels {
        SurfaceTexels {
            size: 4,
            index: vec![6],
            lightmap_uv: Vec::new(),
            albedo: vec![Vec3::splat(albedo)],
            emission: vec![Vec3::splat(emission)],
            direct: vec![Vec3::splat(direct)],
        }
    }

    fn outgoing(surface: &SurfaceTexels, previous: Option<&CoverageMap>) -> f32 {
        let mut map = CoverageMap::uncovered(4);
        // Left from the frame before: must be cleared.
        map.texels_mut()[1] = Vec4::ONE;
        direct_lightmap(surface, previous, 0.95, &mut map);
        assert_eq!((map.coverage(1), map.coverage(6)), (0.0, 1.0));
        map.color(6).y
    }

    fn constant(irradiance: f32) -> CoverageMap {
        let mut map = CoverageMap::uncovered(2);
        map.texels_mut().fill(Vec3::splat(irradiance).extend(1.0));
        map
    }

    // Sums of a few f32 operations: within 4 ulp, 4 * 2^-23 = 5e-7 relative.
    #[track_caller]
    fn assert_near(found: f32, expected: f32) {
        assert!((found - expected).abs() <= 5e-7 * expected.abs(), "{found} instead of {expected}");
    }

    #[test]
    fn a_lit_plane_sends_albedo_over_pi_times_irradiance() {
        assert_near(outgoing(&one_texel(0.5, 0.25, 3.0), None), 0.25 + 0.5 / PI * 3.0);
        assert_near(outgoing(&one_texel(0.5, 0.25, 3.0), Some(&constant(2.0))), 0.25 + 0.5 / PI * 5.0);
    }

    #[test]
    fn the_albedo_cap_binds_the_feedback_only() {
        assert_near(outgoing(&one_texel(1.0, 0.0, 3.0), None), 3.0 / PI);
        assert_near(outgoing(&one_texel(1.0, 0.0, 3.0), Some(&constant(2.0))), (3.0 + 0.95 * 2.0) / PI);
    }

    #[test]
    fn negative_light_counts_as_none() {
        assert_near(outgoing(&one_texel(0.5, 0.25, 3.0), Some(&constant(-2.0))), 0.25 + 0.5 / PI * 3.0);
        assert_eq!(outgoing(&one_texel(0.5, -9.0, 3.0), None), 0.0);
    }

    #[test]
    fn previous_irradiance_is_read_at_the_texel_center_of_the_other_size() {
        let mut previous = CoverageMap::uncovered(2);
        previous.texels_mut()[0] = Vec3::splat(1.0).extend(1.0);
        previous.texels_mut()[1] = Vec3::splat(5.0).extend(1.0);
        // Texel 6 of 4 x 4 has its center at uv (0.625, 0.375), that is (0.75, 0.25) between the centers of 2 x 2; the
        // lower row is uncovered and takes no part.
        let found = outgoing(&one_texel(0.5, 0.0, 0.0), Some(&previous));
        // Places are stored to half of 1/65535: 2 texels by 4 of irradiance, 4 * 2 / 131070 of 4 at most.
        assert!((found / (0.5 / PI * (0.25 * 1.0 + 0.75 * 5.0)) - 1.0).abs() <= 2e-5, "{found}");
        // In a map of another layout its place is given: the center of the left texel above.
        let elsewhere = SurfaceTexels { lightmap_uv: vec![pack_uv([0.25, 0.25])], ..one_texel(0.5, 0.0, 0.0) };
        assert!((outgoing(&elsewhere, Some(&previous)) / (0.5 / PI) - 1.0).abs() <= 7e-5);
        assert_eq!(
            SurfaceTexels { lightmap_uv: vec![0; 2], ..elsewhere }.check(4),
            Err(crate::RelightError::Length { what: "lightmap coordinates", expected: 1, found: 2 })
        );
    }

    #[test]
    fn wrong_surface_texels_are_refused() {
        use crate::RelightError::{Length, MapSize, NotFinite, TexelIndex};
        let good = one_texel(0.5, 0.0, 0.0);
        assert_eq!(good.check(4), Ok(()));
        assert_eq!(good.check(8), Err(MapSize { expected: 8, found: 4 }));
        let short = SurfaceTexels { direct: Vec::new(), ..good.clone() };
        assert_eq!(short.check(4), Err(Length { what: "surface direct", expected: 1, found: 0 }));
        let outside = SurfaceTexels { index: vec![16], ..good.clone() };
        assert_eq!(outside.check(4), Err(TexelIndex { position: 0, index: 16, limit: 16 }));
        let two = vec![Vec3::ZERO; 2];
        let twice = SurfaceTexels {
            size: 4,
            index: vec![6, 6],
            lightmap_uv: Vec::new(),
            albedo: two.clone(),
            emission: two.clone(),
            direct: two,
        };
        assert_eq!(twice.check(4), Err(TexelIndex { position: 1, index: 6, limit: 16 }));
        let infinite = SurfaceTexels { direct: vec![Vec3::splat(f32::INFINITY)], ..good };
        assert_eq!(infinite.check(4), Err(NotFinite { what: "surface direct", index: 0 }));
    }
}
