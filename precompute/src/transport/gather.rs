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

/// Every so many-th direction of the lattice is in the first level of a set, which holds those that are looked up, or in the first two.
const LEVEL_STEPS: [u32; 2] = [LOOKED_UP_ONE_IN, 2];
/// A level has so many rays or more.
const LEAST_LEVEL: u32 = 128;

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
    /// Level by level.
    directions: Vec<Vec3>,
    /// `[n]` whether a fitted row looks the ray up in all probes.
    looked_up: Vec<bool>,
    /// `[n]` whether it is of the half of the lattice that the other half is held against.
    first_half: Vec<bool>,
    /// Where levels end, rising: the directions up to each are a lattice, coarser than the set.
    levels: Vec<usize>,
    /// `[SKY_TIMES * n]` directions that look for the sky, and their numbers in the lattice.
    to_sky: Vec<(u32, Vec3)>,
    domain: Domain,
    receiver_degree: u32,
}

/// Rays of the first levels of a set, each of which stands for as much as one of a smaller set.
#[derive(Clone, Copy, Debug)]
pub struct GatherPart<'a> {
    set: &'a GatherSet,
    n_rays: usize,
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
    /// Whether it is of one half of the first level, a lattice too.
    pub(super) first_half: bool,
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
        let is_sphere = domain == Domain::Sphere;
        let steps: &[u32] = if is_sphere || n < LEVEL_STEPS[0] * LEAST_LEVEL { &[] } else { &LEVEL_STEPS };
        let level_of = |i: u32| steps.iter().position(|&step| i.is_multiple_of(step)).unwrap_or(steps.len());
        let mut rays: Vec<(usize, Vec3, [bool; 2])> = (0..n)
            .map(|i| {
                let direction = Vec3::from(map(directions::fibonacci_square(i, n, shift)));
                let [looked_up, first_half] = [1, 2].map(|times| i.is_multiple_of(times * LOOKED_UP_ONE_IN));
                (level_of(i), direction, [is_sphere || looked_up, first_half])
            })
            .collect();
        // Neighbors follow each other, so that the rays of a receiver share the ray tree's nodes and their occluders.
        rays.sort_by_cached_key(|&(level, direction, _)| (level, along_curve(direction)));
        let levels = (0..=steps.len()).map(|level| rays.partition_point(|ray| ray.0 <= level)).collect();
        let directions = rays.iter().map(|ray| ray.1).collect();
        let [looked_up, first_half] = [0, 1].map(|which| rays.iter().map(|ray| ray.2[which]).collect());
        let n_to_sky = n.saturating_mul(SKY_TIMES);
        let mut to_sky: Vec<(u32, Vec3)> =
            (0..n_to_sky).map(|i| (i, Vec3::from(map(directions::fibonacci_square(i, n_to_sky, shift))))).collect();
        to_sky.sort_by_cached_key(|(_, direction)| along_curve(*direction));
        Self { directions, looked_up, first_half, levels, to_sky, domain, receiver_degree }
    }

    /// The same in one level, so that every receiver gets all rays.
    pub fn in_one_level(self) -> Self {
        Self { levels: vec![self.directions.len()], ..self }
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

    /// Number of levels.
    pub(super) fn n_levels(&self) -> usize {
        self.levels.len()
    }

    /// All rays.
    pub fn all(&self) -> GatherPart<'_> {
        GatherPart { set: self, n_rays: self.directions.len() }
    }

    /// Those of the first levels, up to and with one of them.
    pub(super) fn up_to(&self, level: usize) -> GatherPart<'_> {
        GatherPart { set: self, n_rays: self.levels[level] }
    }

    /// Rays of a receiver from its sites, each of which sends the same share of them into all parts of its hemisphere. Those below
    /// the horizon of the geometric normal are left out.
    pub fn rays(&self, sites: Sites<'_>, offset_m: f32) -> impl Iterator<Item = GatherRay> {
        (0..self.levels.len()).flat_map(move |level| self.rays_of_level(level, sites, offset_m))
    }

    /// The same of one level.
    pub(super) fn rays_of_level(
        &self,
        level: usize,
        sites: Sites<'_>,
        offset_m: f32,
    ) -> impl Iterator<Item = GatherRay> {
        let first = level.checked_sub(1).map_or(0, |before| self.levels[before]);
        let of_level = first..self.levels[level];
        // Of each kind of rays, which follow each other along a curve over the directions, the sites take turns.
        let mut count = [0; 3];
        let numbered = of_level.map(move |ray| {
            let kind = [self.looked_up[ray], self.first_half[ray]];
            let count = &mut count[kind.map(usize::from).iter().sum::<usize>()];
            *count += 1;
            (*count - 1, self.directions[ray], kind)
        });
        self.starting_at(sites, offset_m, numbered)
    }

    /// The same of the rays that look for the sky, of which there are [`SKY_TIMES`] as many; or of one in `one_in` of them, those
    /// with the number `turn` in the lattice or so much more.
    pub(super) fn rays_to_sky(
        &self,
        sites: Sites<'_>,
        offset_m: f32,
        [turn, one_in]: [u32; 2],
    ) -> impl Iterator<Item = GatherRay> {
        let some = move |&&(number, _): &&(u32, Vec3)| number % one_in == turn % one_in;
        // Of those too the sites take turns.
        let numbered = self.to_sky.iter().filter(some).map(move |&(number, local)| {
            let site = number / one_in + number % one_in;
            (site as usize, local, [false; 2])
        });
        self.starting_at(sites, offset_m, numbered)
    }

    /// Rays of local directions, each with the number of its turn, and whether it is looked up in all probes and of the first half.
    fn starting_at(
        &self,
        sites: Sites<'_>,
        offset_m: f32,
        numbered: impl Iterator<Item = (usize, Vec3, [bool; 2])>,
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
        numbered.filter_map(move |(number, local, [looked_up, first_half])| {
            let (start, axis, (tangent, bitangent)) = stands[number % stands.len()];
            let dir = tangent * local.x + bitangent * local.y + axis * local.z;
            let ray = GatherRay { origin: start.origin, dir, cosine: start.cosine(dir), looked_up, first_half };
            start.is_above(dir).then_some(ray)
        })
    }

    /// Outputs per receiver, n_k.
    pub fn n_outputs(&self) -> usize {
        sh::function_count(self.receiver_degree)
    }

    /// What the outputs of a receiver weigh light by, given its shading normal; none in the open.
    pub fn outputs(&self, normal: Option<Vec3>) -> OutputFunctions {
        OutputFunctions::of(self.domain, self.receiver_degree, normal)
    }

    /// Degree of the receiver outputs.
    pub fn receiver_degree(&self) -> u32 {
        self.receiver_degree
    }
}

impl GatherPart<'_> {
    /// Rays over those that a fitted row looks up.
    pub fn rays_per_look_up(self) -> f32 {
        let looked_up = self.set.looked_up[..self.n_rays].iter().filter(|&&is| is).count();
        self.n_rays as f32 / looked_up.max(1) as f32
    }

    /// Weights of a ray for all outputs: the sum over rays of `weights[k] * L` estimates output k.
    ///
    /// `world` is the ray in world axes.
    pub fn weights(self, world: Vec3, outputs: &OutputFunctions, weights: &mut [f32]) {
        let n = self.n_rays as f32;
        let steradians = match self.set.domain {
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
    pub fn cosine_share(self, cosine: f32) -> f32 {
        let n = self.n_rays as f32;
        match self.set.domain {
            Domain::Cosine | Domain::Sphere => 1.0 / n,
            Domain::Hemisphere => 2.0 * cosine / n,
        }
    }

    /// Rays per steradian in a direction, given its cosine with the normal.
    pub fn density(self, cosine: f32) -> f32 {
        let n = self.n_rays as f32;
        match self.set.domain {
            Domain::Cosine => n * cosine / PI,
            Domain::Hemisphere => n / (2.0 * PI),
            Domain::Sphere => n / (4.0 * PI),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_levels_are_coarser_lattices_of_the_same_set() {
        let set = GatherSet::new(1024, 0, 0);
        assert_eq!((0..set.n_levels()).map(|level| set.up_to(level).n_rays).collect::<Vec<_>>(), [256, 512, 1024]);
        assert_eq!(GatherSet::new(511, 0, 0).n_levels(), 1);
        assert_eq!(GatherSet::new(1024, 0, 0).in_one_level().n_levels(), 1);
        assert_eq!(GatherSet::sphere(1024, 1, 0).n_levels(), 1);
        for level in 0..set.n_levels() {
            let part = set.up_to(level);
            // Weights of all rays add up to the irradiance of light that is the same from everywhere, whatever the level.
            let mut weight = [0.0];
            part.weights(Vec3::Z, &OutputFunctions::Irradiance, &mut weight);
            assert!((weight[0] * part.n_rays as f32 - PI).abs() < 1e-4);
            // Cells of equal weight, 8 rings of 8, have as many directions each as a lattice gives: within three of the mean. Of random
            // directions, 4 to 16 for each cell, the worst of 64 cells would be off by more than two deviations, 4 to 8.
            let mut counts = [0usize; 64];
            for direction in &set.directions[..part.n_rays] {
                let ring = ((1.0 - direction.z * direction.z) * 8.0) as usize;
                let sector = (direction.y.atan2(direction.x) / (2.0 * PI) + 0.5) * 8.0;
                counts[ring.min(7) * 8 + (sector as usize).min(7)] += 1;
            }
            let mean = part.n_rays / 64;
            assert!(counts.iter().all(|count| count.abs_diff(mean) <= 3), "level {level}: {counts:?}");
            assert_eq!(part.rays_per_look_up(), part.n_rays as f32 / 256.0);
        }
    }
}
