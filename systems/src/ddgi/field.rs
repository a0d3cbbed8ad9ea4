//! The field of probes: the four steps of a frame, and the query.

use super::Settings;
use crate::irradiance_probes::{ProbeMaps, ProbeRays, Weights, cage_weights, far_m, turned_directions};
use crate::{Frame, ProbeGrid, Query, Shaded, ShaderLight, ShaderProbes, System, Weighting, Work, World};
use glam::{UVec3, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// A uniform grid of irradiance probes with visibility.
pub struct Ddgi {
    settings: Settings,
    grid: ProbeGrid,
    maps: Vec<ProbeMaps>,
    seed: u64,
    /// No frame has been yet: there is nothing old to keep.
    is_fresh: bool,
}

impl Ddgi {
    /// On a grid.
    pub fn new(grid: ProbeGrid, settings: Settings, seed: u64) -> Self {
        Self { settings, grid, maps: vec![ProbeMaps::new(settings.sizes); grid.len()], seed, is_fresh: true }
    }

    /// Within a box, with not more than so many probes.
    pub fn over(bounds: (Vec3, Vec3), probes: usize, settings: Settings, seed: u64) -> Self {
        Self::new(ProbeGrid::within(bounds, probes, settings.inset), settings, seed)
    }

    /// Its grid.
    pub fn grid(&self) -> &ProbeGrid {
        &self.grid
    }

    /// Weights of the cage's probes for a point, with their places in the list of probes; not normalized.
    ///
    /// Source: the evaluation, sec. 3.4.1.
    fn weights(&self, shaded: &Shaded) -> impl Iterator<Item = (usize, f32)> {
        let point = &shaded.point;
        let tested = point.position + point.normal * self.bias_m();
        let probe = |at: UVec3| {
            let place = self.grid.index(at);
            Some((place, self.grid.position(at), &self.maps[place]))
        };
        cage_weights(self.settings.weights, self.grid.cage(point.position), point, tested, probe)
    }

    /// How far before a surface the point lies whose visibility is asked for.
    fn bias_m(&self) -> f32 {
        self.settings.normal_bias * self.grid.spacing.min_element()
    }

    fn irradiance_at(&self, shaded: &Shaded) -> Vec3 {
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (probe, weight) in self.weights(shaded) {
            sum += self.maps[probe].irradiance(shaded.point.normal) * weight;
            weights += weight;
        }
        // The maps hold mean radiance by cosine.
        sum * (PI / weights)
    }
}

impl System for Ddgi {
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        let settings = self.settings;
        let turn = if settings.turns { frame.number } else { 0 };
        let dirs = turned_directions(settings.rays, self.seed, turn, 0);
        let (own, far_m) = (&*self, far_m(&self.grid));
        let rays = ProbeRays { frame, own, backs: settings.backs, far_m };
        let gathered: Vec<_> = (0..self.grid.len())
            .into_par_iter()
            .map(|probe| rays.shaded(own.grid.position(own.grid.at(probe)), &dirs))
            .collect();
        let hysteresis = if self.is_fresh { 0.0 } else { settings.hysteresis };
        self.maps.par_iter_mut().zip(&gathered).for_each(|(maps, (rays, _))| {
            maps.blend_irradiance(rays, |old, fresh| fresh.lerp(old, hysteresis)); // Eq. (1)
            maps.blend_distance(rays, settings.distance_power, hysteresis); // Eq. (2)
        });
        self.is_fresh = false;
        let probes = self.grid.len() as u64;
        let mut work = Work { probes, texels: probes * settings.sizes.texels() as u64, ..Work::default() };
        gathered.into_iter().for_each(|(_, traced)| work += traced);
        work
    }

    fn irradiance(&self, _: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        query.points.par_iter().with_min_len(256).map(|shaded| self.irradiance_at(shaded)).collect()
    }

    fn shader_light(&self) -> Option<ShaderLight> {
        let position = |probe: usize| self.grid.position(self.grid.at(probe));
        if self.settings.weights != Weights::default() {
            return None;
        }
        let (irradiance, moments) = ProbeMaps::concat(self.maps.iter());
        Some(ShaderLight::Octahedral(ShaderProbes {
            grid: self.grid,
            positions: (0..self.grid.len()).map(position).collect(),
            is_lit: vec![true; self.grid.len()],
            irradiance,
            moments,
            sizes: self.settings.sizes,
            weighting: Weighting::Wrapped,
            normal_bias_m: self.bias_m(),
            eye_bias_m: 0.0,
            is_cage_biased: false,
            stored_power: 1.0,
            mean_power: 1.0,
        }))
    }

    fn probes(&self) -> usize {
        self.grid.len()
    }

    fn bytes(&self) -> u64 {
        self.settings.sizes.bytes() * self.grid.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Feedback;
    use crate::irradiance_probes::{MapSizes, Weights};
    use crate::test_worlds::{furnace, in_world, settle};
    use localprt_scenes::{Lighting, SurfacePoint};

    /// Mean Chebyshev weight of points of the furnace's floor, 2 to 16 cm from a wall. They see all eight probes, so it should be 1.
    fn seen(normal_bias: f32) -> f32 {
        let weights = Weights { chebyshev: true, ..Weights::NONE };
        let settings = Settings { weights, normal_bias, ..Settings::default() };
        let scene = furnace(0.0, 1.0);
        in_world(&scene, &Lighting::default(), |world| {
            let mut ddgi = Ddgi::over(world.bounds(), 64, settings, 3);
            settle(&mut ddgi, world, Feedback::Nothing, 8);
            let floor = (0..64).map(|k| Vec3::new(0.02 * (1 + k % 8) as f32, 0.0, 0.7 + 0.45 * (k / 8) as f32));
            let weights: Vec<f32> = floor
                .flat_map(|position| {
                    let point = SurfacePoint { position, normal: Vec3::Y, geometric_normal: Vec3::Y };
                    ddgi.weights(&Shaded::from_above(point)).map(|probe| probe.1).collect::<Vec<f32>>()
                })
                .collect();
            weights.iter().sum::<f32>() / weights.len() as f32
        })
    }

    #[test]
    fn normal_bias_brings_probes_back_into_sight_of_corners() {
        // A corner is farther off than the mean of what a probe sees around it, as if it lay in the shadow of its walls.
        let (without, with) = (seen(0.0), seen(0.25));
        eprintln!("seen without {without}, with {with}");
        assert!(with > 0.9 && without < 0.7, "{without} {with}");
    }

    #[test]
    fn a_probe_does_not_look_beyond_its_cells() {
        in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
            let grid = ProbeGrid { low: Vec3::ONE, spacing: Vec3::splat(0.2), size: UVec3::splat(2) };
            let mut ddgi = Ddgi::new(grid, Settings::default(), 3);
            settle(&mut ddgi, world, Feedback::Nothing, 1);
            // Walls are 0.8 m away and more, and 1.5 diagonals 0.52 m: all distances are that, up to the rounding of means.
            let moments = ddgi.maps[0].moments(Vec3::X);
            assert!((moments - glam::Vec2::new(0.27f32.sqrt(), 0.27)).abs().max_element() < 1e-6, "{moments}");
        });
    }

    #[test]
    fn bytes_are_those_of_two_maps_of_four_byte_texels() {
        let grid = ProbeGrid { low: Vec3::ZERO, spacing: Vec3::ONE, size: UVec3::splat(4) };
        let ddgi = Ddgi::new(grid, Settings::default(), 0);
        assert_eq!(ddgi.bytes(), 64 * 4 * (10 * 10 + 18 * 18));
        assert_eq!(super::super::KIND.probe_bytes, 4 * (MapSizes::PAPER.texels() as u64));
    }
}
