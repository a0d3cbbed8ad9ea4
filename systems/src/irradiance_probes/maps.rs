//! The two maps of one probe: irradiance, and the moments of the distance to what is around.

use super::ProbeRay;
use crate::octahedral::OctahedralMap;
use glam::{Vec2, Vec3};
use std::ops::{Add, Mul};

/// Bytes of a texel of either map: R11G11B10F or R10G10B10A2 for irradiance, two halves for the moments.
///
/// Source: the code of Majercik et al. 2019, and RTXGI; neither paper names formats.
const TEXEL_BYTES: usize = 4;
/// Rays whose weights sum to less than this say nothing about a texel, which stays as it is.
const LEAST_WEIGHT: f32 = 1e-6;

/// Sides of the maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapSizes {
    /// Of irradiance.
    pub irradiance: OctahedralMap,
    /// Of distance moments.
    pub distance: OctahedralMap,
}

/// The maps of one probe, each with its border.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeMaps {
    sizes: MapSizes,
    /// Mean radiance by cosine, W sr^-1 m^-2, or what a system makes of it. Times pi it is irradiance.
    irradiance: Vec<Vec3>,
    /// Mean distance and mean squared distance, m and m^2.
    moments: Vec<Vec2>,
}

impl MapSizes {
    /// 8 x 8 and 16 x 16: the DDGI evaluation, Fig. 1, and the scaling paper, sec. 7.1.
    pub const PAPER: Self = Self { irradiance: OctahedralMap { side: 8 }, distance: OctahedralMap { side: 16 } };

    /// Those of some tests: distances coarse, since their lobes take the most time.
    #[cfg(test)]
    pub(crate) const TEST: Self = Self { distance: OctahedralMap { side: 4 }, ..Self::PAPER };

    /// Texels of both maps, with their borders.
    pub fn texels(self) -> usize {
        self.irradiance.texels() + self.distance.texels()
    }

    /// Bytes of both maps.
    pub const fn bytes(self) -> u64 {
        let (irradiance, distance) = (self.irradiance.side + 2, self.distance.side + 2);
        ((irradiance * irradiance + distance * distance) * TEXEL_BYTES) as u64
    }
}

impl ProbeMaps {
    /// Maps of zeros.
    pub fn new(sizes: MapSizes) -> Self {
        let irradiance = vec![Vec3::ZERO; sizes.irradiance.texels()];
        Self { sizes, irradiance, moments: vec![Vec2::ZERO; sizes.distance.texels()] }
    }

    /// Takes in a frame's rays by the cosine-weighted mean of their radiance: of each texel `blend(old, mean)` is kept.
    ///
    /// Differs from the papers: Eq. (1) of the evaluation is a bare sum; the mean by weight is that of Majercik et al. 2019 and of the
    /// scaling paper's text.
    pub fn blend_irradiance(&mut self, rays: &[ProbeRay], blend: impl Fn(Vec3, Vec3) -> Vec3) {
        blend_means(self.sizes.irradiance, &mut self.irradiance, rays, |cosine| cosine, |ray| ray.radiance, blend);
    }

    /// Takes in a frame's rays by the mean of distance and squared distance, weighted by a power of the cosine.
    ///
    /// Source: Eq. (2) of the evaluation, with the power of Majercik et al. 2019.
    pub fn blend_distance(&mut self, rays: &[ProbeRay], power: i32, hysteresis: f32) {
        let moments = |ray: &ProbeRay| Vec2::new(ray.distance, ray.distance * ray.distance);
        let weight = |cosine: f32| cosine.powi(power);
        blend_means(self.sizes.distance, &mut self.moments, rays, weight, moments, |old, fresh| {
            fresh.lerp(old, hysteresis)
        });
    }

    /// What the irradiance map holds in a direction.
    pub fn irradiance(&self, dir: Vec3) -> Vec3 {
        read(self.sizes.irradiance, &self.irradiance, dir)
    }

    /// Mean distance and mean squared distance in a direction.
    pub fn moments(&self, dir: Vec3) -> Vec2 {
        read(self.sizes.distance, &self.moments, dir)
    }

    /// What the maps of probes hold, probe after probe, with their borders, row by row: irradiance and moments.
    pub fn concat<'a>(probes: impl Iterator<Item = &'a Self>) -> (Vec<Vec3>, Vec<Vec2>) {
        let (mut irradiance, mut moments) = (Vec::new(), Vec::new());
        for maps in probes {
            irradiance.extend_from_slice(&maps.irradiance);
            moments.extend_from_slice(&maps.moments);
        }
        (irradiance, moments)
    }

    /// The same irradiance in all directions and no end of free space: a probe that is known, for tests.
    #[cfg(test)]
    pub(crate) fn constant(sizes: MapSizes, irradiance: Vec3) -> Self {
        let far = Vec2::new(1e3, 1e6);
        Self {
            sizes,
            irradiance: vec![irradiance; sizes.irradiance.texels()],
            moments: vec![far; sizes.distance.texels()],
        }
    }
}

/// Blends a mean over rays into each texel, then copies the border.
fn blend_means<T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>>(
    map: OctahedralMap,
    texels: &mut [T],
    rays: &[ProbeRay],
    weight: impl Fn(f32) -> f32,
    value: impl Fn(&ProbeRay) -> T,
    blend: impl Fn(T, T) -> T,
) {
    for y in 0..map.side {
        for x in 0..map.side {
            let dir = map.dir(x, y);
            let (mut sum, mut weights) = (T::default(), 0.0);
            for ray in rays {
                let cosine = dir.dot(ray.dir);
                if cosine <= 0.0 {
                    continue;
                }
                let weight = weight(cosine);
                sum = sum + value(ray) * weight;
                weights += weight;
            }
            if weights > LEAST_WEIGHT {
                let texel = &mut texels[map.index(x, y)];
                *texel = blend(*texel, sum * (1.0 / weights));
            }
        }
    }
    map.copy_border(texels);
}

fn read<T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>>(map: OctahedralMap, texels: &[T], dir: Vec3) -> T {
    map.bilinear(dir).iter().fold(T::default(), |sum, &(texel, weight)| sum + texels[texel] * weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::spherical_fibonacci;

    /// Rays into a surrounding whose radiance and distance are linear in the direction.
    fn linear_rays(n: u32, axis: Vec3) -> Vec<ProbeRay> {
        let dirs = (0..n).map(|ray| Vec3::from(spherical_fibonacci(ray, n)));
        dirs.map(|dir| ProbeRay { dir, distance: 2.0 + dir.dot(axis), radiance: Vec3::splat(1.0 + dir.dot(axis)) })
            .collect()
    }

    #[test]
    fn irradiance_of_linear_light_is_two_thirds_of_its_slope() {
        // The cosine-weighted mean of 1 + a.d over the hemisphere about n is 1 + 2/3 a.n.
        let axis = Vec3::new(0.5, -0.3, 0.6);
        let mut maps = ProbeMaps::new(MapSizes::PAPER);
        maps.blend_irradiance(&linear_rays(1024, axis), |_, fresh| fresh);
        let mut worst = 0f32;
        for ray in 0..500 {
            let dir = Vec3::from(spherical_fibonacci(ray, 500));
            worst = worst.max((maps.irradiance(dir).x - 1.0 - axis.dot(dir) * 2.0 / 3.0).abs());
        }
        // Texels are 1/4 of the square apart; at a crease of the mapping a slope of up to 2 x 2/3 x |a| turns within half of that:
        // 1/8 x 1.33 x 0.84 = 0.14. Found: 0.075.
        assert!(worst < 0.1, "{worst}");
        assert!(worst > 1e-3, "8 x 8 texels cannot be exact");
    }

    #[test]
    fn distances_are_means_over_a_narrow_lobe() {
        // The mean of a.d over the lobe cos^50 about n is 51/52 a.n; of (2 + a.d)^2 likewise from the moments of the lobe.
        let axis = Vec3::Z;
        let mut maps = ProbeMaps::new(MapSizes::PAPER);
        maps.blend_distance(&linear_rays(8192, axis), 50, 0.0);
        let map = maps.sizes.distance;
        for (x, y) in [(7, 7), (3, 9), (0, 0), (12, 4)] {
            let (dir, read) = (map.dir(x, y), maps.moments[map.index(x, y)]);
            let along = dir.dot(axis);
            let mean = 2.0 + along * 51.0 / 52.0;
            // E[(a.d)^2] = along^2 E[c^2] + (1 - along^2) (1 - E[c^2]) / 2, with E[c^2] = 51/53.
            let squares = along * along * 51.0 / 53.0 + (1.0 - along * along) / 53.0;
            // Some 80 rays are in the lobe of 2 pi / 51 sr, evenly spread: found 7e-6 and 4e-5.
            assert!((read.x - mean).abs() < 2e-5, "{read} {mean}");
            assert!((read.y - (4.0 + 4.0 * (mean - 2.0) + squares)).abs() < 1e-4, "{read}");
        }
    }

    #[test]
    fn reads_at_the_edge_of_the_square_need_the_border() {
        let axis = Vec3::new(0.0, 0.0, 0.9);
        let mut maps = ProbeMaps::new(MapSizes::PAPER);
        maps.blend_irradiance(&linear_rays(1024, axis), |_, fresh| fresh);
        // Straight back lie all four corners of the square, to the sides the middles of its edges.
        let dirs = [Vec3::NEG_Z, Vec3::X, Vec3::NEG_Y];
        let read = |maps: &ProbeMaps| dirs.map(|dir| (maps.irradiance(dir).x - 1.0 - axis.dot(dir) * 2.0 / 3.0).abs());
        assert!(read(&maps).iter().all(|error| *error < 0.07), "{:?}", read(&maps));
        let map = maps.sizes.irradiance;
        for texel in 0..map.texels() {
            let (x, y) = (texel % map.width(), texel / map.width());
            if x == 0 || y == 0 || x == map.width() - 1 || y == map.width() - 1 {
                maps.irradiance[texel] = Vec3::ZERO;
            }
        }
        // Half of such a read, and at a corner three quarters, comes from the border; radiance is at least 0.4 there.
        assert!(read(&maps).iter().all(|error| *error > 0.2), "{:?}", read(&maps));
    }

    #[test]
    fn a_texel_that_no_ray_points_to_stays() {
        let mut maps = ProbeMaps::constant(MapSizes::PAPER, Vec3::ONE);
        let ray = ProbeRay { dir: Vec3::Z, distance: 1.0, radiance: Vec3::splat(5.0) };
        maps.blend_irradiance(&[ray], |_, fresh| fresh);
        assert_eq!(maps.irradiance(Vec3::NEG_Z), Vec3::ONE);
        assert_eq!(maps.irradiance(Vec3::Z), Vec3::splat(5.0));
    }
}
