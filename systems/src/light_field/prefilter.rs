//! Prefiltered maps: irradiance for every normal, and moments of distance for every direction; and irradiance at points from those of
//! the eight probes around.
//!
//! Source: sec. 5.2; its supplement for the least weights.

use super::{geometry::Geometry, settings::Settings};
use crate::{ProbeGrid, ShaderProbes, Weighting, irradiance_probes::MapSizes, octahedral::OctahedralMap};
use glam::{Vec2, Vec3};
use localprt_scenes::SurfacePoint;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Least weight of a probe that a surface faces away from, before visibility.
const LEAST_FACING: f32 = 0.05;
/// Least weight of a probe, so that a point which sees none has the light of all.
const LEAST_WEIGHT: f32 = 2e-4;
/// Texels per side of the maps that irradiance is integrated over: the cosine is taken as constant over 5 degrees.
const RADIANCE_SIDE: usize = 32;
/// The same of moments of distance, whose lobe is narrower.
const DISTANCE_SIDE: usize = 64;

/// Prefiltered maps of all probes, each with a border of one texel, probe after probe.
pub struct Prefiltered {
    map: OctahedralMap,
    /// Irradiance of a surface with this normal, W m^-2.
    irradiance: Vec<Vec3>,
    /// Mean distance and mean squared distance, metres and square metres.
    moments: Vec<Vec2>,
}

/// Directions to integrate over: means of squares of texels.
struct Quadrature {
    dirs: Vec<Vec3>,
    solid_angles: Vec<f32>,
}

impl Prefiltered {
    /// Moments of distance, and no light yet.
    pub(super) fn new(geometry: &Geometry, settings: &Settings) -> Self {
        let map = OctahedralMap { side: settings.prefiltered };
        let quadrature = Quadrature::of(geometry.map, DISTANCE_SIDE);
        let moments = maps(map, geometry.grid.len(), |probe| {
            let distances = &geometry.distances[probe * geometry.texels()..][..geometry.texels()];
            // Sky is as far as anything can be.
            let moments = quadrature.means(geometry.map, |texel| {
                let distance = distances[texel].min(geometry.extent_m);
                Vec3::new(distance, distance * distance, 0.0)
            });
            let quadrature = &quadrature;
            move |dir| quadrature.mean(&moments, |source| source.dot(dir).max(0.0).powf(settings.lobe_power)).truncate()
        });
        let irradiance = vec![Vec3::ZERO; geometry.grid.len() * map.texels()];
        Self { map, irradiance, moments }
    }

    /// Filters radiance maps anew.
    pub(super) fn filter(&mut self, geometry: &Geometry, radiance: &[Vec3]) {
        let quadrature = Quadrature::of(geometry.map, RADIANCE_SIDE);
        self.irradiance = maps(self.map, geometry.grid.len(), |probe| {
            let radiance = &radiance[probe * geometry.texels()..][..geometry.texels()];
            let radiance = quadrature.means(geometry.map, |texel| radiance[texel]);
            let quadrature = &quadrature;
            // E = integral L cos, with the cosine's own sum scaled to pi.
            move |normal| PI * quadrature.mean(&radiance, |dir| dir.dot(normal).max(0.0))
        });
    }

    /// Texels of all irradiance maps, without borders.
    pub(super) fn texels(&self) -> u64 {
        (self.irradiance.len() / self.map.texels() * self.map.side * self.map.side) as u64
    }

    /// Irradiance at a point, W m^-2: of the eight probes around it by their shares.
    pub(super) fn irradiance(&self, grid: &ProbeGrid, point: &SurfacePoint) -> Vec3 {
        let taps = self.map.bilinear(point.normal);
        self.shares(grid, point)
            .into_iter()
            .map(|(probe, share)| share * self.read(&self.irradiance, probe, &taps))
            .sum()
    }

    /// The eight probes around a point and their weights, scaled to a sum of 1.
    pub(super) fn shares(&self, grid: &ProbeGrid, point: &SurfacePoint) -> [(usize, f32); 8] {
        let weighted = grid.cage(point.position).probes().map(|(at, trilinear)| {
            let (probe, way) = (grid.index(at), grid.position(at) - point.position);
            let moments = self.read(&self.moments, probe, &self.map.bilinear((-way).normalize_or(Vec3::Y)));
            (probe, weight(way, point.normal, moments, trilinear))
        });
        let sum: f32 = weighted.iter().map(|probe| probe.1).sum();
        weighted.map(|(probe, weight)| (probe, weight / sum))
    }

    /// As a shader shades with them.
    pub(super) fn shader_probes(&self, grid: &ProbeGrid) -> ShaderProbes {
        ShaderProbes {
            grid: *grid,
            positions: (0..grid.len()).map(|probe| grid.position(grid.at(probe))).collect(),
            is_lit: vec![true; grid.len()],
            irradiance: self.irradiance.iter().map(|light| *light / PI).collect(),
            moments: self.moments.clone(),
            sizes: MapSizes { irradiance: self.map, distance: self.map },
            weighting: Weighting::Facing,
            normal_bias_m: 0.0,
            eye_bias_m: 0.0,
            is_cage_biased: false,
            stored_power: 1.0,
            mean_power: 1.0,
        }
    }

    fn read<T>(&self, maps: &[T], probe: usize, taps: &[(usize, f32); 4]) -> T
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::iter::Sum,
    {
        let first = probe * self.map.texels();
        taps.iter().map(|&(texel, weight)| maps[first + texel] * weight).sum()
    }
}

/// Weight of a probe for a point, given the way to the probe and the moments of distance that the probe has in direction of the point.
///
/// Source: sec. 5.2: trilinear, clamped cosine to the probe, Chebyshev.
fn weight(way: Vec3, normal: Vec3, moments: Vec2, trilinear: f32) -> f32 {
    let distance = way.length();
    let facing = normal.dot(way / distance.max(f32::MIN_POSITIVE)).max(LEAST_FACING);
    (trilinear * facing * chebyshev(moments, distance)).max(LEAST_WEIGHT)
}

/// Most that can be seen beyond a distance, given its moments: 1 up to the mean, then variance over variance and squared excess.
///
/// Source: sec. 5.2 with the variance |E[r]^2 - E[r^2]|; Donnelly and Lauritzen 2006, Eq. (5).
fn chebyshev(moments: Vec2, distance: f32) -> f32 {
    let excess = distance - moments.x;
    if excess <= 0.0 {
        return 1.0;
    }
    let variance = (moments.x * moments.x - moments.y).abs();
    variance / (variance + excess * excess)
}

/// Maps of all probes with borders; `of` gives, for a probe, the value of a direction.
fn maps<T: Copy + Default + Send, F: Fn(Vec3) -> T>(
    map: OctahedralMap,
    probes: usize,
    of: impl Fn(usize) -> F + Sync,
) -> Vec<T> {
    let parts: Vec<Vec<T>> = (0..probes)
        .into_par_iter()
        .map(|probe| {
            let value = of(probe);
            let mut texels = vec![T::default(); map.texels()];
            for y in 0..map.side {
                for x in 0..map.side {
                    texels[map.index(x, y)] = value(map.dir(x, y));
                }
            }
            map.copy_border(&mut texels);
            texels
        })
        .collect();
    parts.concat()
}

impl Quadrature {
    /// Of a map's texels, in squares so that there are at most so many per side.
    fn of(map: OctahedralMap, most: usize) -> Self {
        let coarse = OctahedralMap { side: map.side.min(most) };
        let mut dirs = vec![Vec3::ZERO; coarse.side * coarse.side];
        let mut solid_angles = vec![0.0; dirs.len()];
        for texel in 0..map.side * map.side {
            let (block, solid_angle) = (block(map, coarse, texel), solid_angle(map, texel));
            dirs[block] += solid_angle * map.dir(texel % map.side, texel / map.side);
            solid_angles[block] += solid_angle;
        }
        Self { dirs: dirs.into_iter().map(Vec3::normalize).collect(), solid_angles }
    }

    /// Means of a map over its squares.
    fn means(&self, map: OctahedralMap, value: impl Fn(usize) -> Vec3) -> Vec<Vec3> {
        let coarse = OctahedralMap { side: self.dirs.len().isqrt() };
        let mut sums = vec![Vec3::ZERO; self.dirs.len()];
        for texel in 0..map.side * map.side {
            let block = block(map, coarse, texel);
            sums[block] += value(texel) * (solid_angle(map, texel) / self.solid_angles[block]);
        }
        sums
    }

    /// Mean over all directions, weighted.
    fn mean(&self, values: &[Vec3], weight: impl Fn(Vec3) -> f32) -> Vec3 {
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for ((&dir, &solid_angle), &value) in self.dirs.iter().zip(&self.solid_angles).zip(values) {
            let weight = weight(dir) * solid_angle;
            sum += weight * value;
            weights += weight;
        }
        sum / weights
    }
}

fn block(map: OctahedralMap, coarse: OctahedralMap, texel: usize) -> usize {
    let [x, y] = [texel % map.side, texel / map.side].map(|at| at * coarse.side / map.side);
    y * coarse.side + x
}

/// Solid angle of a texel, steradians, from its middle: area over the cubed length of the point on the octahedron.
fn solid_angle(map: OctahedralMap, texel: usize) -> f32 {
    let norm = map.dir(texel % map.side, texel / map.side).abs().element_sum();
    let texel_side = 2.0 / map.side as f32;
    texel_side * texel_side * norm * norm * norm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solid_angles_add_up_to_the_sphere() {
        for side in [16, 128] {
            let map = OctahedralMap { side };
            let sum: f32 = (0..side * side).map(|texel| solid_angle(map, texel)).sum();
            // Midpoint rule: its error falls with the square of the texel; 0.3 % at 16, found.
            assert!((sum / (4.0 * PI) - 1.0).abs() < 1.0 / (side * side) as f32, "{side}: {sum}");
        }
    }

    #[test]
    fn irradiance_of_a_hemisphere_is_its_closed_form() {
        // Radiance 1 from above an axis: E(n) = pi (1 + n.a) / 2.
        let map = OctahedralMap { side: 64 };
        let quadrature = Quadrature::of(map, RADIANCE_SIDE);
        let axis = Vec3::new(0.36, 0.48, 0.8);
        let values =
            quadrature.means(map, |texel| Vec3::splat(f32::from(map.dir(texel % 64, texel / 64).dot(axis) > 0.0)));
        for normal in [axis, -axis, Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, -0.8, 0.0)] {
            let irradiance = PI * quadrature.mean(&values, |dir| dir.dot(normal).max(0.0)).x;
            let expected = PI * (1.0 + normal.dot(axis)) / 2.0;
            // The horizon is a line of texels of a 40th of a radian, on or off: 1 % of pi.
            assert!((irradiance - expected).abs() < 0.01 * PI, "{normal}: {irradiance} {expected}");
        }
    }

    #[test]
    fn moments_of_a_wall_are_their_closed_forms() {
        // A plane at 1 m below a lobe cos^50: E[1 / cos] = 51 / 50 and E[1 / cos^2] = 51 / 49. Other walls begin where the lobe is 1e-11.
        let settings = Settings { side: 128, ..Settings::PAPER };
        let scene = crate::test_worlds::furnace(0.5, 1.0);
        crate::test_worlds::in_world(&scene, &localprt_scenes::Lighting::default(), |world| {
            let setup = crate::Setup { probes: 8, cameras: &[], seed: 0 };
            let maps = Prefiltered::new(
                &Geometry::new(world, &setup, &Settings { prefiltered: 16, ..settings }),
                &Settings { prefiltered: 16, ..settings },
            );
            let found = maps.moments[maps.map.nearest(Vec3::NEG_X)];
            let cosine = (0..256)
                .map(|texel| maps.map.dir(texel % 16, texel / 16))
                .find(|&dir| maps.map.nearest(dir) == maps.map.nearest(Vec3::NEG_X))
                .map_or(1.0, |dir| -dir.x);
            // About the texel's middle, which is off the axis by 7 degrees: distances grow by its cosine.
            let expected = Vec2::new(51.0 / 50.0 / cosine, 51.0 / 49.0 / (cosine * cosine));
            // Off the axis tan^2 / 50 and thrice that come to both, below 0.1 %; squares of 64^2 are of 3 degrees: 1 %.
            assert!(((found - expected) / expected).abs().max_element() < 0.01, "{found} {expected}");
        });
    }

    #[test]
    fn a_probe_behind_a_surface_or_out_of_sight_hardly_counts() {
        let (normal, open) = (Vec3::Y, Vec2::new(10.0, 101.0));
        let above = weight(Vec3::Y, normal, open, 0.125);
        // Straight above it is the trilinear weight; at 60 degrees half of it; below a twentieth.
        assert_eq!(above, 0.125);
        let slanted = weight(Vec3::new(3f32.sqrt(), 1.0, 0.0) * 0.5, normal, open, 0.125);
        assert!((slanted / above - 0.5).abs() < 1e-6);
        assert_eq!(weight(Vec3::NEG_Y, normal, open, 0.125), LEAST_FACING * 0.125);
        // A wall at 0.5 m with a spread of 0.1 m, and the point at 1 m: 0.01 / (0.01 + 0.25).
        let hidden = weight(Vec3::Y, normal, Vec2::new(0.5, 0.26), 0.125);
        assert!((hidden / above - 0.01 / 0.26).abs() < 1e-5, "{hidden}");
        assert_eq!(weight(Vec3::Y, normal, Vec2::new(0.5, 0.25), 0.125), LEAST_WEIGHT);
        // Nearer than the mean it is seen.
        assert_eq!(chebyshev(Vec2::new(0.5, 0.26), 0.5), 1.0);
    }
}
