//! Both rules on functions whose coefficients are known.

use super::*;
use crate::ssgi_probes::convergence::{clamped_cosine, sphere_samples};

type Function = fn(Vec3) -> f32;

const AXIS: Vec3 = Vec3::new(0.48, -0.6, 0.64);

fn basis() -> Basis {
    Basis::new(DEGREE)
}

fn values(dir: Vec3) -> [f32; FUNCTIONS] {
    let mut values = [0.0; FUNCTIONS];
    basis().evaluate(dir.to_array(), &mut values);
    values
}

/// A constant, a function of the first band and one of the second, with their exact coefficients.
fn band_limited() -> Vec<(Function, Coefficients)> {
    let along = values(AXIS);
    let of_band =
        |band: usize, scale: f32| {
            Coefficients(std::array::from_fn(|k| {
                if k.isqrt() == band { Vec3::splat(scale * along[k]) } else { Vec3::ZERO }
            }))
        };
    // By the addition theorem P_l(a . s) = 4 pi / (2 l + 1) sum_m Y_lm(a) Y_lm(s).
    vec![
        (|_| 2.0, of_band(0, 2.0 * SPHERE_SR)),
        (|dir| dir.dot(AXIS), of_band(1, SPHERE_SR / 3.0)),
        (|dir| 1.5 * dir.dot(AXIS).powi(2) - 0.5, of_band(2, SPHERE_SR / 5.0)),
    ]
}

fn sampled(radiance: Function, n: u32, seed: u64) -> impl Iterator<Item = Arriving> {
    sphere_samples(n, seed).map(move |dir| Arriving {
        dir,
        solid_angle_sr: SPHERE_SR / n as f32,
        radiance: Vec3::splat(radiance(dir)),
    })
}

fn apart(a: &Coefficients, b: &Coefficients) -> f32 {
    a.0.iter().zip(&b.0).map(|(a, b)| (a.x - b.x).powi(2)).sum::<f32>().sqrt()
}

#[test]
fn the_error_finds_what_three_bands_hold_exactly() {
    for (radiance, exact) in band_limited() {
        let mut own = Coefficients::default();
        for frame in 0..400 {
            own.step(&basis(), sampled(radiance, 40, frame), &Filter { rule: Rule::Error, hysteresis: 0.1 });
        }
        // The error shrinks by about 1 - h a frame, to 0.9^400 = 5e-19 of itself, and samples of the exact function find none, so
        // that no noise is left: roundings of sums of 40 terms of up to 25 / 0.28, each with a gain of 0.1.
        assert!(apart(&own, &exact) < 2e-5, "{}", apart(&own, &exact));
    }
}

#[test]
fn the_filter_does_too_with_the_noise_of_its_samples() {
    for (radiance, exact) in band_limited() {
        let (mut own, mut mean, mut noise) = (Coefficients::default(), Coefficients::default(), 0.0);
        let frames = 3000;
        for frame in 0..100 + frames {
            own.step(&basis(), sampled(radiance, 40, frame), &Filter { rule: Rule::Filter, hysteresis: 0.1 });
            // 0.9^100 = 3e-5 of the beginning is left.
            if frame >= 100 {
                mean.change(|mean, own| mean + own / frames as f32, &own);
                noise += apart(&own, &exact).powi(2) / frames as f32;
            }
        }
        // One sample's 4 pi f y has the variance 9 int f^2 - |c|^2; 40 of them 1/40 of it, and the filter h / (2 - h) of that.
        let norm = apart(&exact, &Coefficients::default()).powi(2);
        let expected = (9.0 - 1.0) * norm / 40.0 * 0.1 / 1.9;
        // Frames of the filter hang together over 2 / h - 1 = 19, so that 3000 are 158: 0.08 per standard error of a mean square
        // of one dimension; four of them.
        assert!((noise / expected - 1.0).abs() < 0.32, "{noise} {expected}");
        // No bias: the mean over 3000 frames has a variance of 1/3000 of that of one frame; four standard errors.
        let bound = 4.0 * ((9.0 - 1.0) * norm / 40.0 / frames as f32).sqrt();
        assert!(apart(&mean, &exact) < bound, "{} {bound}", apart(&mean, &exact));
    }
}

#[test]
fn a_filter_that_keeps_nothing_is_the_static_projection_of_its_frame() {
    let (dir, radiance) = (AXIS, |dir: Vec3| clamped_cosine(AXIS, dir));
    let samples: Vec<Arriving> = sphere_samples(400, 5)
        .map(|dir| Arriving { dir, solid_angle_sr: SPHERE_SR / 400.0, radiance: Vec3::splat(radiance(dir)) })
        .collect();
    let fixed = Sums::of(&basis(), samples.iter().copied(), None).projected;
    let mut own = Coefficients([Vec3::splat(7.0); FUNCTIONS]);
    own.step(&basis(), samples.into_iter(), &Filter { rule: Rule::Filter, hysteresis: 1.0 });
    // Solid angles sum to 4 pi within 400 roundings of 2^-24, and what is left of 7 with them.
    assert!(apart(&own, &fixed) < 3.0 * 7.0 * 400.0 * 6e-8, "{}", apart(&own, &fixed));
    // Irradiance of a clamped cosine about its own axis, 2 pi / 3, of which three bands hold (1/4 + 1/3 + 5/64) pi.
    let bands = (0.25 + 1.0 / 3.0 + 5.0 / 64.0) * PI;
    // Standard error of one sample 4 pi f sum_l A_l Y_l below 4 * 4 pi / sqrt(6): of 400, 0.34; twice that, which half of it fails.
    assert!((own.irradiance(dir).x - bands).abs() < 0.7, "{} {bands}", own.irradiance(dir).x);
}

#[test]
fn as_printed_the_filter_comes_out_4_pi_too_dark() {
    // Eq. (9) with steradians in both terms, one sample of a constant 1 at a time.
    let (mut printed, mut own) = (Coefficients::default(), Coefficients::default());
    for sample in sampled(|_| 1.0, 20_000, 1) {
        let weight = 1e-3;
        let light = Sums::of(&basis(), [Arriving { solid_angle_sr: weight, ..sample }].into_iter(), None);
        printed.change(|printed, projected| printed * (1.0 - weight) + projected, &light.projected);
        let whole = Arriving { solid_angle_sr: SPHERE_SR, ..sample };
        own.step(&basis(), [whole].into_iter(), &Filter { rule: Rule::Filter, hysteresis: weight });
    }
    // The first function is the same everywhere, so that nothing is random: a constant 1 projects to sqrt(4 pi).
    let (exact, dark) = (SPHERE_SR.sqrt(), SPHERE_SR.sqrt() / SPHERE_SR);
    assert!((printed.0[0].x / dark - 1.0).abs() < 1e-4, "{} {dark}", printed.0[0].x);
    assert!((own.0[0].x / exact - 1.0).abs() < 1e-4, "{} {exact}", own.0[0].x);
}

#[test]
fn large_solid_angles_weigh_more() {
    // Two directions, one with three times the solid angle of the other.
    let of = |dir, solid_angle_sr, radiance| Arriving { dir, solid_angle_sr, radiance: Vec3::splat(radiance) };
    let mut own = Coefficients::default();
    for _ in 0..200 {
        let samples = [of(Vec3::Y, 3.0, 1.0), of(Vec3::NEG_Y, 1.0, 5.0)];
        own.step(&basis(), samples.into_iter(), &Filter { rule: Rule::Filter, hysteresis: 0.5 });
    }
    // The mean radiance, (3 * 1 + 1 * 5) / 4 = 2, where equal weights would give 3. 0.84^200 of the beginning is left.
    assert!((own.0[0].x / SPHERE_SR.sqrt() - 2.0).abs() < 1e-5, "{}", own.0[0].x / SPHERE_SR.sqrt());
}

#[test]
fn hysteresis_trades_speed_for_noise() {
    let run = |hysteresis: f32| {
        let mut own = Coefficients::default();
        let radiance = |dir: Vec3| clamped_cosine(AXIS, dir);
        let filter = Filter { rule: Rule::Filter, hysteresis };
        let mut after = Vec::new();
        for frame in 0..600 {
            own.step(&basis(), sampled(radiance, 16, frame), &filter);
            after.push(own.0[0].x / (PI / SPHERE_SR.sqrt()));
        }
        let late = &after[100..];
        let spread = late.iter().map(|value| (value - 1.0).powi(2)).sum::<f32>() / late.len() as f32;
        (after[4], spread)
    };
    let ((fast, noisy), (slow, smooth)) = (run(0.5), run(0.05));
    // After five frames 1 - (1 - h)^5: 0.97 and 0.23; noise of a frame of 16 samples around it, 0.29 relative, times
    // sqrt(h / (2 - h)): 0.17 and 0.05; three of them.
    assert!((fast - 0.97).abs() < 0.5 && (slow - 0.23).abs() < 0.15, "{fast} {slow}");
    // Variances as h / (2 - h): 13 to 1. 500 frames are 500 * h / (2 - h) = 13 independent ones of the slow run, whose variance
    // is known to 40 %: more than 13 / 2.6.
    assert!(noisy > 5.0 * smooth, "{noisy} {smooth}");
}

#[test]
fn samples_that_cover_more_than_the_sphere_replace_and_do_not_overshoot() {
    for rule in [Rule::Filter, Rule::Error] {
        let mut own = Coefficients([Vec3::ONE; FUNCTIONS]);
        for _ in 0..50 {
            let near = Arriving { dir: AXIS, solid_angle_sr: 1e6, radiance: Vec3::splat(3.0) };
            own.step(&basis(), [near].into_iter(), &Filter { rule, hysteresis: 0.5 });
        }
        // The filter holds 4 pi f y, whose value along the axis is 9 f; the error is gone where it was sampled.
        let expected = if rule == Rule::Filter { 27.0 } else { 3.0 };
        let found = own.radiance(&values(AXIS)).x;
        // Sums of nine products of up to 10, f32.
        assert!((found - expected).abs() < 1e-4, "{rule:?} {found}");
    }
}
