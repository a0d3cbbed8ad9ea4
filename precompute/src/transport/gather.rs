//! Gather directions of a receiver: one low-discrepancy set, turned into each receiver's frame.

use glam::Vec3;
use localprt_formats::{directions, sh};
use std::f32::consts::PI;

/// A set of directions about +Z with the weights of every receiver output.
///
/// All receivers share one set: neighbouring receivers then differ by what they see and not by where they looked, which
/// keeps transport rows of a cluster close to a low-dimensional space.
#[derive(Clone, Debug)]
pub struct GatherSet {
    directions: Vec<Vec3>,
    receiver_degree: u32,
}

impl GatherSet {
    /// `n` directions for receivers of the given degree: cosine-weighted for irradiance (degree 0), uniform over the
    /// hemisphere for radiance, whose basis functions do not vanish at the horizon.
    ///
    /// The set is a Fibonacci lattice shifted by `seed`.
    pub fn new(n: u32, receiver_degree: u32, seed: u64) -> Self {
        let shift = [0, 1].map(|axis| if seed == 0 { 0.0 } else { directions::counter_uniform(seed, 0, axis) });
        let map = if receiver_degree == 0 { directions::cosine_hemisphere } else { directions::uniform_hemisphere };
        let mut directions: Vec<Vec3> =
            (0..n).map(|i| Vec3::from(map(directions::fibonacci_square(i, n, shift)))).collect();
        // Neighbors follow each other, so that the rays of a receiver share the ray tree's nodes and their occluders.
        directions.sort_by_cached_key(|direction| (morton(*direction), direction.z.to_bits(), direction.x.to_bits()));
        Self { directions, receiver_degree }
    }

    /// Directions about +Z.
    pub fn directions(&self) -> &[Vec3] {
        &self.directions
    }

    /// Outputs per receiver, n_k.
    pub fn n_outputs(&self) -> usize {
        sh::function_count(self.receiver_degree)
    }

    /// Weights of a ray for all outputs: the sum over rays of `weights[k] * L` estimates output k.
    ///
    /// `world` is the ray in world axes.
    pub fn weights(&self, world: Vec3, basis: &sh::Basis, weights: &mut [f32]) {
        let n = self.directions.len() as f32;
        if self.receiver_degree == 0 {
            // Eq. (7): density cos/pi, measured by cos.
            weights[0] = PI / n;
        } else {
            // Eq. (8): density 1/2pi, measured by B_k.
            basis.evaluate(world.to_array(), weights);
            for weight in weights {
                *weight *= 2.0 * PI / n;
            }
        }
    }

    /// A ray's share of the cosine-weighted hemisphere, given its cosine with the normal.
    pub fn cosine_share(&self, cosine: f32) -> f32 {
        let n = self.directions.len() as f32;
        if self.receiver_degree == 0 { 1.0 / n } else { 2.0 * cosine / n }
    }

    /// Degree of the receiver outputs.
    pub fn receiver_degree(&self) -> u32 {
        self.receiver_degree
    }
}

/// Place of a direction about +Z on a Morton curve over the disc below it.
fn morton(direction: Vec3) -> u64 {
    let spread = |value: f32| {
        let cell = ((value * 0.5 + 0.5) * 1023.0) as u64;
        (0..10).fold(0, |bits, bit| bits | ((cell >> bit & 1) << (2 * bit)))
    };
    spread(direction.x) | (spread(direction.y) << 1)
}
