//! Sky images, to be sampled by brightness: a sun in one covers few directions.

use crate::emitters::distribution::Distribution;
use glam::{DVec3, Vec3};
use localprt_scenes::Sky;
use std::f64::consts::{PI, TAU};

/// An equirect sky as a distribution of directions; nothing for skies that are smooth.
#[derive(Default)]
pub(super) struct SkySampler {
    width: usize,
    height: usize,
    /// Radians about +Y by which the picture is turned.
    turn: f64,
    /// Of the pixels, row by row.
    pixels: Distribution,
}

impl SkySampler {
    /// Pixels are drawn in proportion to their solid angle times the brightest band of themselves and their neighbors.
    pub(super) fn of(sky: &Sky) -> Self {
        let Sky::Equirect { width, height, pixels, rotation, .. } = sky else { return Self::default() };
        let (width, height) = (*width as usize, *height as usize);
        let mut sampler = Self { width, height, turn: f64::from(*rotation).to_radians(), ..Self::default() };
        sampler.pixels = Distribution::of((0..pixels.len()).map(|index| {
            let (column, row) = (index % width, index / width);
            // Reads between pixels blend them, so that light reaches into the cells around its own.
            let around = (row.saturating_sub(1)..(row + 2).min(height)).flat_map(|row| {
                [width - 1, 0, 1].map(|step| pixels[row * width + (column + step) % width].max_element())
            });
            f64::from(around.fold(0.0, f32::max)) * sampler.solid_angle(row)
        }));
        sampler
    }

    pub(super) fn is_sampled(&self) -> bool {
        !self.pixels.is_empty()
    }

    /// Steradians of a pixel.
    fn solid_angle(&self, row: usize) -> f64 {
        let edge = |row: usize| (PI * row as f64 / self.height as f64).cos();
        (edge(row) - edge(row + 1)) * TAU / self.width as f64
    }

    /// A direction toward the sky, uniform within its pixel.
    pub(super) fn sample(&self, which: f64, [u, v]: [f64; 2]) -> Vec3 {
        let index = self.pixels.choose(which);
        let (column, row) = (index % self.width, index / self.width);
        let edge = |row: usize| (PI * row as f64 / self.height as f64).cos();
        let height = edge(row) + v * (edge(row + 1) - edge(row));
        // Column 0 begins at -Z and columns grow toward +X; a positive rotation turns the picture the other way round.
        let azimuth = (column as f64 + u) / self.width as f64 * TAU - self.turn;
        let across = (1.0 - height * height).max(0.0).sqrt();
        DVec3::new(across * azimuth.sin(), height, -across * azimuth.cos()).as_vec3().normalize()
    }

    /// Density of [`SkySampler::sample`] in a direction, per steradian.
    pub(super) fn density(&self, dir: Vec3) -> f32 {
        if self.pixels.is_empty() {
            return 0.0;
        }
        let dir = dir.as_dvec3();
        let turns = ((dir.x.atan2(-dir.z) + self.turn) / TAU).rem_euclid(1.0);
        let polar = dir.x.hypot(dir.z).atan2(dir.y) / PI;
        let column = ((turns * self.width as f64) as usize).min(self.width - 1);
        let row = ((polar * self.height as f64) as usize).min(self.height - 1);
        (self.pixels.probability(row * self.width + column) / self.solid_angle(row)) as f32
    }
}
