//! How well rays through the maps agree with rays against the scene.

use super::field::LightField;
use super::trace::Answer;
use crate::World;
use glam::Vec3;
use localprt_formats::directions::{counter_uniform, uniform_sphere};
use rayon::prelude::*;

/// A hit that is farther off than this, metres, and this share of its distance, is wrong.
const WRONG_M: f32 = 0.05;
const WRONG_SHARE: f32 = 0.05;
/// Draws of a ray before its place is taken as it is.
const DRAWS: u64 = 64;

/// Shares of random rays, 0 to 1, and errors of distance. The first three add up to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Rays.
    pub rays: u64,
    /// Answered with a hit.
    pub hit: f64,
    /// Answered with a miss.
    pub miss: f64,
    /// Not answered.
    pub unknown: f64,
    /// Hits and misses that are wrong: the following three together.
    pub wrong: f64,
    /// Hits of rays that leave the scene.
    pub wrong_hit: f64,
    /// Misses of rays that meet something.
    pub wrong_miss: f64,
    /// Hits farther off than 5 cm and 5 % of the distance.
    pub wrong_place: f64,
    /// Median of the error of distance over rays that both have hitting, metres.
    pub median_error_m: f64,
    /// What 95 % of these errors are below, metres.
    pub error_95_m: f64,
    /// Mean texels read per ray, of both levels.
    pub steps: f64,
    /// Mean probes asked per ray.
    pub probes: f64,
}

/// Random rays from places in the free space of a scene, in all directions, against the same rays of the scene.
///
/// Places are uniform in the scene's box; those from where a ray meets the black back of a surface first are drawn again.
pub fn agreement(field: &LightField, world: &World<'_>, rays: u64, seed: u64) -> Agreement {
    let (low, high) = world.bounds();
    let compare = |number: u64| {
        let ray = |draw: u64| {
            let random = |k| counter_uniform(seed, number, 5 * draw + k);
            let place = Vec3::from([0, 1, 2].map(|k| random(k) as f32));
            (low + (high - low) * place, Vec3::from(uniform_sphere([random(3), random(4)])))
        };
        let cast = |draw: u64| {
            let (origin, dir) = ray(draw);
            (origin, dir, world.caster().closest_hit(origin, dir))
        };
        let is_free = |draw: &u64| cast(*draw).2.is_none_or(|hit| hit.point.is_some());
        let (origin, dir, met) = cast((0..DRAWS).find(is_free).unwrap_or(0));
        (field.trace(origin, dir), met.map(|hit| hit.t))
    };
    let answers: Vec<_> = (0..rays).into_par_iter().map(compare).collect();
    let share = |count: usize| count as f64 / (rays as f64).max(1.0);
    let of = |answer: Answer| answers.iter().filter(move |(traced, _)| traced.answer == answer);
    let mut errors: Vec<f32> =
        of(Answer::Hit).filter_map(|(traced, met)| met.map(|met| (traced.t - met).abs())).collect();
    errors.sort_by(f32::total_cmp);
    let quantile =
        |share: f64| errors.get((errors.len() as f64 * share) as usize).map_or(0.0, |&error| f64::from(error));
    let is_off = |t: f32, met: f32| (t - met).abs() > WRONG_M + WRONG_SHARE * met;
    let wrong_hit = share(of(Answer::Hit).filter(|(_, met)| met.is_none()).count());
    let wrong_miss = share(of(Answer::Miss).filter(|(_, met)| met.is_some()).count());
    let wrong_place =
        share(of(Answer::Hit).filter(|(traced, met)| met.is_some_and(|met| is_off(traced.t, met))).count());
    Agreement {
        rays,
        hit: share(of(Answer::Hit).count()),
        miss: share(of(Answer::Miss).count()),
        unknown: share(of(Answer::Unknown).count()),
        wrong: wrong_hit + wrong_miss + wrong_place,
        wrong_hit,
        wrong_miss,
        wrong_place,
        median_error_m: quantile(0.5),
        error_95_m: quantile(0.95),
        steps: answers.iter().map(|(traced, _)| f64::from(traced.steps)).sum::<f64>() / (rays as f64).max(1.0),
        probes: answers.iter().map(|(traced, _)| f64::from(traced.probes)).sum::<f64>() / (rays as f64).max(1.0),
    }
}
