//! Convergence of the progressive projection to the static one, as numbers: what Figs. 4 and 5 of the paper show.

use super::projection::{Arriving, Coefficients, DEGREE, Filter, SPHERE_SR, Sums};
use glam::Vec3;
use localprt_formats::{
    directions::{counter_uniform, uniform_sphere},
    sh::Basis,
};

/// Errors of both projections after some samples, relative to the exact coefficients: the root mean square over the sphere of the
/// difference of two reconstructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Samples so far.
    pub samples: usize,
    /// Of the progressive projection.
    pub progressive: f64,
    /// Of the static projection of all samples so far.
    pub fixed: f64,
    /// Between the two.
    pub apart: f64,
}

/// Projects a function on the sphere both ways from the same samples, which come in the order of `dirs`, uniform over the sphere.
///
/// A step of the progressive projection takes `per_step` samples of `sample_sr` steradians each: `4 pi / dirs.len()` for one pass over
/// directions that cover the sphere together, `4 pi / per_step` where those of every step do so by themselves. One entry per step.
///
/// The static projection is the classical one, `4 pi / n` times the sum of `f y` (Green 2003).
///
/// # Panics
/// If `per_step` is 0.
pub fn convergence(
    radiance: &dyn Fn(Vec3) -> Vec3,
    exact: &Coefficients,
    dirs: &[Vec3],
    per_step: usize,
    sample_sr: f32,
    filter: &Filter,
) -> Vec<Errors> {
    let basis = Basis::new(DEGREE);
    let (mut progressive, mut sum, mut samples) = (Coefficients::default(), Coefficients::default(), 0);
    let step = |dirs: &[Vec3]| {
        let arriving = dirs.iter().map(|&dir| Arriving { dir, solid_angle_sr: sample_sr, radiance: radiance(dir) });
        let arriving: Vec<Arriving> = arriving.collect();
        progressive.step(&basis, arriving.iter().copied(), filter);
        let own = arriving.iter().map(|sample| Arriving { solid_angle_sr: 1.0, ..*sample });
        let added = Sums::of(&basis, own, None).projected;
        sum.0.iter_mut().zip(added.0).for_each(|(sum, added)| *sum += added);
        samples += dirs.len();
        let fixed = Coefficients(sum.0.map(|sum| sum * (SPHERE_SR / samples as f32)));
        let norm = distance(exact, &Coefficients::default());
        Errors {
            samples,
            progressive: distance(&progressive, exact) / norm,
            fixed: distance(&fixed, exact) / norm,
            apart: distance(&progressive, &fixed) / norm,
        }
    };
    dirs.chunks(per_step).map(step).collect()
}

/// Root of the integral, over the sphere, of the squared difference: by Parseval that of the coefficients.
fn distance(a: &Coefficients, b: &Coefficients) -> f64 {
    let squared = |(a, b): (&Vec3, &Vec3)| (a.as_dvec3() - b.as_dvec3()).length_squared();
    a.0.iter().zip(&b.0).map(squared).sum::<f64>().sqrt()
}

/// Random directions, uniform over the sphere.
pub fn sphere_samples(n: u32, seed: u64) -> impl Iterator<Item = Vec3> {
    (0..u64::from(n))
        .map(move |i| Vec3::from(uniform_sphere([counter_uniform(seed, i, 0), counter_uniform(seed, i, 1)])))
}

/// Cosine about an axis, 0 behind it.
#[cfg(test)]
pub(super) fn clamped_cosine(axis: Vec3, dir: Vec3) -> f32 {
    axis.dot(dir).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::projection::{FUNCTIONS, Rule};
    use super::*;
    use localprt_formats::{directions::spherical_fibonacci, sh::COSINE_LOBE};

    const AXIS: Vec3 = Vec3::new(0.48, -0.6, 0.64);

    fn light(dir: Vec3) -> Vec3 {
        Vec3::splat(clamped_cosine(AXIS, dir))
    }

    /// The clamped cosine, by its zonal coefficients.
    fn exact() -> Coefficients {
        let mut values = [0.0; FUNCTIONS];
        Basis::new(DEGREE).evaluate(AXIS.to_array(), &mut values);
        Coefficients(std::array::from_fn(|k| Vec3::splat(COSINE_LOBE[k.isqrt()] * values[k])))
    }

    /// Root mean square over seeds of the errors after each step.
    fn mean_errors(rule: Rule, hysteresis: f32, n: u32, per_step: usize) -> Vec<Errors> {
        let seeds = 200;
        let mut mean: Vec<Errors> = Vec::new();
        for seed in 0..seeds {
            let dirs: Vec<Vec3> = sphere_samples(n, seed).collect();
            let sample_sr = SPHERE_SR / per_step as f32;
            let run = convergence(&light, &exact(), &dirs, per_step, sample_sr, &Filter { rule, hysteresis });
            if mean.is_empty() {
                mean = run.iter().map(|at| Errors { progressive: 0.0, fixed: 0.0, apart: 0.0, ..*at }).collect();
            }
            for (mean, at) in mean.iter_mut().zip(&run) {
                mean.progressive += at.progressive.powi(2) / f64::from(seeds as u32);
                mean.fixed += at.fixed.powi(2) / f64::from(seeds as u32);
                mean.apart += at.apart.powi(2) / f64::from(seeds as u32);
            }
        }
        let root = |at: Errors| Errors {
            progressive: at.progressive.sqrt(),
            fixed: at.fixed.sqrt(),
            apart: at.apart.sqrt(),
            ..at
        };
        mean.into_iter().map(root).collect()
    }

    /// Variance of one sample's `4 pi f y` over the squared norm: `9 int f^2 = 6 pi` and `|c|^2 = (1/4 + 1/3 + 5/64) pi`.
    fn one_sample() -> f64 {
        let norm = 0.25 + 1.0 / 3.0 + 5.0 / 64.0;
        (6.0 - norm) / norm
    }

    #[test]
    fn the_static_error_falls_with_the_root_of_the_samples_and_the_filters_to_its_floor() {
        let run = mean_errors(Rule::Filter, 0.05, 4000, 20);
        for at in [&run[9], &run[49], &run[199]] {
            // Monte Carlo: sqrt(variance / n); 200 seeds of about nine dimensions know a root mean square to 3 %, four of them.
            let expected = (one_sample() / at.samples as f64).sqrt();
            assert!((at.fixed / expected - 1.0).abs() < 0.12, "{at:?} {expected}");
            // The filter: what is left of the beginning, (1 - h)^k, and noise of h / (2 - h) of a step's, less what has not come yet.
            let steps = (at.samples / 20) as i32;
            let left = 0.95f64.powi(2 * steps);
            let expected = (left + one_sample() / 20.0 * 0.05 / 1.95 * (1.0 - left)).sqrt();
            assert!((at.progressive / expected - 1.0).abs() < 0.12, "{at:?} {expected}");
        }
        // Slower at first: 60 % against 21 % after 200 samples; 10 % against 4.5 % in the end, as if it had 20 * 1.95 / 0.05 = 780.
        assert!(run[9].progressive > 2.0 * run[9].fixed && run[199].progressive > 1.8 * run[199].fixed);
    }

    #[test]
    fn correcting_the_error_has_a_lower_floor_than_the_filter() {
        let (error, filter) = (mean_errors(Rule::Error, 0.05, 4000, 20), mean_errors(Rule::Filter, 0.05, 4000, 20));
        // What is left after the step is what three bands do not hold: 2/3 - (1/4 + 1/3 + 5/64) = 0.005 of int f^2, against 2/3.
        // Sampled noise falls with the root of these; 9 * 0.0052 * pi against (6 - 0.66) pi: 1 to 10.6 in the error.
        let ratio = filter[199].progressive / error[199].progressive;
        // Both known to 3 % each (200 seeds); the error's own step of 9 h / M adds a little: 10 %.
        assert!((ratio / 10.6 - 1.0).abs() < 0.15, "{ratio}");
        // So that it beats the static projection of all samples, which the filter does not.
        assert!(error[199].progressive < 0.3 * error[199].fixed);
    }

    #[test]
    fn regular_samples_bring_both_together_pass_by_pass() {
        // As in the paper's validation: regular samples, one at a time, in passes over the sphere.
        let n = 4000;
        let pass: Vec<Vec3> = (0..n).map(|i| Vec3::from(spherical_fibonacci(i * 1597 % n, n))).collect();
        let dirs: Vec<Vec3> = (0..10).flat_map(|_| pass.iter().copied()).collect();
        let filter = Filter { rule: Rule::Filter, hysteresis: 1.0 };
        let run = convergence(&light, &exact(), &dirs, 1, SPHERE_SR / n as f32, &filter);
        for passes in 1..=6 {
            let at = &run[passes * n as usize - 1];
            // After k passes e^-k of the beginning is left, and the static projection is exact but for the rule's 1e-4.
            let expected = (-(passes as f64)).exp();
            // Late samples of a pass weigh up to e times as much as early ones, which its order spreads over the sphere: less than 0.005.
            assert!((at.progressive - expected).abs() < 5e-3, "{at:?} {expected}");
            assert!(at.fixed < 1e-3, "{at:?}");
        }
        // Then only the order of a pass shows.
        assert!(run.last().unwrap().apart < 1e-2, "{:?}", run.last());
    }

    #[test]
    fn steps_of_one_over_n_are_the_static_projection() {
        let basis = Basis::new(DEGREE);
        let (mut own, mut sum) = (Coefficients::default(), Coefficients::default());
        for (i, dir) in sphere_samples(300, 3).enumerate() {
            let sample = Arriving { dir, solid_angle_sr: SPHERE_SR, radiance: light(dir) };
            let filter = Filter { rule: Rule::Filter, hysteresis: 1.0 / (i as f32 + 1.0) };
            own.step(&basis, [sample].into_iter(), &filter);
            let added = Sums::of(&basis, [sample].into_iter(), None).projected;
            sum.0.iter_mut().zip(added.0).for_each(|(sum, added)| *sum += added);
        }
        let fixed = Coefficients(sum.0.map(|sum| sum / 300.0));
        // 300 steps, each with a few roundings of coefficients up to 13 at first and 1 later.
        assert!(distance(&own, &fixed) < 1e-4, "{}", distance(&own, &fixed));
    }
}
