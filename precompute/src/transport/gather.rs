//! Gather directions of a receiver: one low-discrepancy set, turned into the frame of each receiver on a surface.

use super::{outputs::OutputFunctions, receivers::Sites};
use crate::{digest::Digester, morton, rays::frame};
use glam::Vec3;
use localprt_formats::{directions, sh};
use std::f32::consts::PI;

/// One in so many rays is looked up in all supporting probes (Eq. 4). Of the others a fitted row needs to know only what they meet,
/// and whether any probe sees it: the correction (F3) takes out most of what few looked-up rays get wrong, and visibility
/// rays to all probes are most of the cost of a ray. Points in the open are few: all of their rays are
/// looked up; and so are those of receivers whose rows the fit cannot correct.
const LOOKED_UP_ONE_IN: u32 = 4;

/// Directions that look for the sky through openings, over those of the set: a lattice is off by the power -3/4 of it.
pub(super) const SKY_TIMES: u32 = 4;

/// Which directions a set holds, and what the outputs measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// Hemisphere about the shading normal, cosine-weighted: irradiance.
    Cosine,
    /// Hemisphere about the geometric normal, uniform: SH of the radiance there.
    Hemisphere,
    /// All directions, uniform, in world axes: SH of the radiance about a point in the open.
    Sphere,
}

/// A set of directions with the weights of every receiver output.
///
/// All receivers share one set: neighboring receivers then differ by what they see and not by where they looked, which
/// keeps transport rows of a cluster close to a low-dimensional space.
#[derive(Clone, Debug)]
pub struct GatherSet {
    directions: Vec<Vec3>,
    /// `[n]` whether a fitted row looks the ray up in all probes.
    looked_up: Vec<bool>,
    /// `[SKY_TIMES * n]` directions that look for the sky, and their numbers in the lattice.
    to_sky: Vec<(u32, Vec3)>,
    domain: Domain,
    receiver_degree: u32,
}

/// A gather ray of a receiver.
#[derive(Clone, Copy, Debug)]
pub struct GatherRay {
    /// The point that it starts from, off the surface, metres.
    pub origin: Vec3,
    /// Unit direction.
    pub dir: Vec3,
    /// Its cosine with the shading normal.
    pub cosine: f32,
    /// Whether a fitted row looks it up in all probes.
    pub looked_up: bool,
}

impl GatherSet {
    /// `n` directions for receivers of the given degree: cosine-weighted for irradiance (degree 0), uniform over the
    /// hemisphere for degree 1, whose functions do not vanish at the horizon.
    ///
    /// The set is a Fibonacci lattice shifted by `seed`.
    pub fn new(n: u32, receiver_degree: u32, seed: u64) -> Self {
        Self::over(if receiver_degree == 0 { Domain::Cosine } else { Domain::Hemisphere }, n, receiver_degree, seed)
    }

    /// `n` directions for receivers in the open: uniform over the sphere, for radiance of the given degree.
    pub fn sphere(n: u32, degree: u32, seed: u64) -> Self {
        Self::over(Domain::Sphere, n, degree, seed)
    }

    fn over(domain: Domain, n: u32, receiver_degree: u32, seed: u64) -> Self {
        let shift = [0, 1].map(|axis| if seed == 0 { 0.0 } else { directions::counter_uniform(seed, 0, axis) });
        let map = match domain {
            Domain::Cosine => directions::cosine_hemisphere,
            Domain::Hemisphere => directions::uniform_hemisphere,
            Domain::Sphere => directions::uniform_sphere,
        };
        let mut rays: Vec<(Vec3, bool)> = (0..n)
            .map(|i| {
                (
                    Vec3::from(map(directions::fibonacci_square(i, n, shift))),
                    domain == Domain::Sphere || i.is_multiple_of(LOOKED_UP_ONE_IN),
                )
            })
            .collect();
        // Neighbors follow each other, so that the rays of a receiver share the ray tree's nodes and their occluders.
        rays.sort_by_cached_key(|(direction, _)| along_curve(*direction));
        let (directions, looked_up) = rays.into_iter().unzip();
        let n_to_sky = n.saturating_mul(SKY_TIMES);
        let mut to_sky: Vec<(u32, Vec3)> =
            (0..n_to_sky).map(|i| (i, Vec3::from(map(directions::fibonacci_square(i, n_to_sky, shift))))).collect();
        to_sky.sort_by_cached_key(|(_, direction)| along_curve(*direction));
        Self { directions, looked_up, to_sky, domain, receiver_degree }
    }

    /// Takes in all rays.
    pub fn digest(&self, digester: &mut Digester) {
        digester
            .all(&self.directions)
            .all(&self.to_sky.iter().map(|ray| ray.1).collect::<Vec<_>>())
            .one(self.domain as u8)
            .one(self.receiver_degree);
    }

    /// Whether they go in all directions.
    pub fn is_sphere(&self) -> bool {
        self.domain == Domain::Sphere
    }

    /// Directions, about +Z or in world axes.
    pub fn directions(&self) -> &[Vec3] {
        &self.directions
    }

    /// Rays of a receiver from its sites, each of which sends the same share of them into all parts of its hemisphere. Those below
    /// the horizon of the geometric normal are left out.
    pub fn rays(&self, sites: Sites<'_>, offset_m: f32) -> impl Iterator<Item = GatherRay> {
        // Of both kinds of rays, which follow each other along a curve over the directions, the sites take turns.
        let mut count = [0; 2];
        let numbered = self.directions.iter().zip(&self.looked_up).map(move |(&local, &looked_up)| {
            let count = &mut count[usize::from(looked_up)];
            *count += 1;
            (*count - 1, local, looked_up)
        });
        self.starting_at(sites, offset_m, numbered)
    }

    /// The same of the rays that look for the sky, of which there are [`SKY_TIMES`] as many.
    pub(super) fn rays_to_sky(&self, sites: Sites<'_>, offset_m: f32) -> impl Iterator<Item = GatherRay> {
        self.starting_at(sites, offset_m, self.to_sky.iter().map(|&(number, local)| (number as usize, local, false)))
    }

    /// Rays of local directions, each with the number of its turn, and whether it is looked up in all probes.
    fn starting_at(
        &self,
        sites: Sites<'_>,
        offset_m: f32,
        numbered: impl Iterator<Item = (usize, Vec3, bool)>,
    ) -> impl Iterator<Item = GatherRay> {
        let stands: Vec<_> = (0..sites.len())
            .map(|turn| {
                let start = sites.start(turn, offset_m);
                // Irradiance is measured about the shading normal; the radiance field is projected over the hemisphere that the
                // surface can see; the frame of +Z are the world axes.
                let axis = match (self.domain, start.normals) {
                    (Domain::Cosine, Some([shading, _])) => shading,
                    (Domain::Hemisphere, Some([_, geometric])) => geometric,
                    _ => Vec3::Z,
                };
                (start, axis, frame(axis))
            })
            .collect();
        numbered.filter_map(move |(number, local, looked_up)| {
            let (start, axis, (tangent, bitangent)) = stands[number % stands.len()];
            let dir = tangent * local.x + bitangent * local.y + axis * local.z;
            let ray = GatherRay { origin: start.origin, dir, cosine: start.cosine(dir), looked_up };
            start.is_above(dir).then_some(ray)
        })
    }

    /// Rays over those that a fitted row looks up.
    pub fn rays_per_look_up(&self) -> f32 {
        self.directions.len() as f32 / self.looked_up.iter().filter(|&&is| is).count().max(1) as f32
    }

    /// Outputs per receiver, n_k.
    pub fn n_outputs(&self) -> usize {
        sh::function_count(self.receiver_degree)
    }

    /// What the outputs of a receiver weigh light by, given its shading normal; none in the open.
    pub fn outputs(&self, normal: Option<Vec3>) -> OutputFunctions {
        OutputFunctions::of(self.domain, self.receiver_degree, normal)
    }

    /// Weights of a ray for all outputs: the sum over rays of `weights[k] * L` estimates output k.
    ///
    /// `world` is the ray in world axes.
    pub fn weights(&self, world: Vec3, outputs: &OutputFunctions, weights: &mut [f32]) {
        let n = self.directions.len() as f32;
        let steradians = match self.domain {
            // Eq. (7): density cos/pi, measured by cos.
            Domain::Cosine => PI / n,
            // Eq. (8): density 1/2pi or 1/4pi, measured by B_k.
            Domain::Hemisphere => 2.0 * PI / n,
            Domain::Sphere => 4.0 * PI / n,
        };
        outputs.evaluate(world, weights);
        for weight in weights {
            *weight *= steradians;
        }
    }

    /// A ray's share of the cosine-weighted hemisphere, given its cosine with the normal; of the whole sphere, its share
    /// of that.
    pub fn cosine_share(&self, cosine: f32) -> f32 {
        let n = self.directions.len() as f32;
        match self.domain {
            Domain::Cosine | Domain::Sphere => 1.0 / n,
            Domain::Hemisphere => 2.0 * cosine / n,
        }
    }

    /// Rays per steradian in a direction, given its cosine with the normal.
    pub fn density(&self, cosine: f32) -> f32 {
        let n = self.directions.len() as f32;
        match self.domain {
            Domain::Cosine => n * cosine / PI,
            Domain::Hemisphere => n / (2.0 * PI),
            Domain::Sphere => n / (4.0 * PI),
        }
    }

    /// Degree of the receiver outputs.
    pub fn receiver_degree(&self) -> u32 {
        self.receiver_degree
    }
}

/// What puts directions after each other that are neighbors: of a sphere, the upper half first.
fn along_curve(direction: Vec3) -> (bool, u32, u32, u32) {
    (direction.z < 0.0, place(direction), direction.z.to_bits(), direction.x.to_bits())
}

/// Place of a direction about +Z on a Morton curve over the disc below it.
fn place(direction: Vec3) -> u32 {
    morton::of_plane([direction.x, direction.y].map(|value| ((value * 0.5 + 0.5) * 1023.0) as u32))
}
