//! Convergence of the progressive projection of SSGI probes to the static one, as Figs. 4 and 5 of Wang, Bowles and Weeks 2022 show it:
//! numbers, and `docs/ssgi-convergence.svg`.
//!
//!     cargo run --release -p localprt-tests --example ssgi_figures [PLOT.svg]

use glam::Vec3;
use localprt_formats::{
    directions::spherical_fibonacci,
    sh::{Basis, COSINE_LOBE},
};
use localprt_precompute::figures::{Chart, Series};
use localprt_systems::ssgi_probes::{
    convergence::{Errors, convergence, sphere_samples},
    projection::{Coefficients, DEGREE, FUNCTIONS, Filter, Rule, SPHERE_SR},
};

/// Samples of a pass over the sphere, and passes.
const PASS: u32 = 4000;
const PASSES: u32 = 10;
/// Samples of a step where they are random: those of a frame.
const FRAME: u32 = 400;
/// Samples from one point of the plot to the next.
const PLOTTED: usize = 800;

fn main() {
    let plot = std::env::args().nth(1).unwrap_or("docs/ssgi-convergence.svg".into());
    // Regular samples one at a time, as the paper validates it; a step of 1597 spreads each part of a pass over the sphere.
    let pass = (0..PASS).map(|i| Vec3::from(spherical_fibonacci(i * 1597 % PASS, PASS)));
    let regular: Vec<Vec3> = (0..PASSES).flat_map(|_| pass.clone()).collect();
    let random: Vec<Vec3> = sphere_samples(PASS * PASSES, 1).collect();
    let run = |dirs: &[Vec3], per_step: u32, sample_sr: f32, rule: Rule, hysteresis: f32| {
        convergence(&environment, &exact(), dirs, per_step as usize, sample_sr, &Filter { rule, hysteresis })
    };
    let of_pass = SPHERE_SR / PASS as f32;
    let of_frame = SPHERE_SR / FRAME as f32;
    let runs = [
        ("regular, by the filter, Eq. (9)", run(&regular, 1, of_pass, Rule::Filter, 1.0)),
        ("regular, by the error, Eq. (8)", run(&regular, 1, of_pass, Rule::Error, 1.0)),
        ("random, by the filter, Eq. (9)", run(&random, FRAME, of_frame, Rule::Filter, 0.05)),
        ("random, by the error, Eq. (8)", run(&random, FRAME, of_frame, Rule::Error, 0.05)),
    ];
    println!("| samples | {} |", runs.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" | "));
    println!("|---|---|---|---|---|");
    let after = |run: &[Errors], samples: u32| *run.iter().find(|at| at.samples >= samples as usize).expect("a step");
    for samples in [400, 1200, 4000, 8000, 12_000, 20_000, 40_000] {
        let cells: Vec<String> = runs.iter().map(|(_, run)| cell(after(run, samples))).collect();
        println!("| {samples} | {} |", cells.join(" | "));
    }
    let series = runs.iter().map(|(name, run)| {
        let points = run.iter().filter(|at| at.samples % PLOTTED == 0).map(|at| [at.samples as f64, at.apart]);
        Series { name: (*name).into(), points: points.collect() }
    });
    let chart = Chart {
        title: "Progressive projection against the static one".into(),
        x_label: "samples".into(),
        y_label: "difference over the norm".into(),
        y_log: true,
        series: series.collect(),
        ..Chart::default()
    };
    std::fs::write(&plot, chart.to_svg(720, 420)).unwrap_or_else(|error| panic!("{plot}: {error}"));
}

/// Difference between progressive and static, percent of the exact norm.
fn cell(at: Errors) -> String {
    format!("{:.2}", 100.0 * at.apart)
}

/// A blurry environment: three soft lights of different colors.
const LOBES: [(Vec3, Vec3); 3] = [
    (Vec3::new(0.48, -0.6, 0.64), Vec3::new(1.0, 0.9, 0.7)),
    (Vec3::new(-0.8, 0.6, 0.0), Vec3::new(0.2, 0.4, 0.9)),
    (Vec3::new(0.0, 0.28, -0.96), Vec3::new(0.5, 0.1, 0.1)),
];

fn environment(dir: Vec3) -> Vec3 {
    LOBES.into_iter().map(|(axis, color)| color * axis.dot(dir).max(0.0)).sum()
}

/// By the zonal coefficients of the clamped cosine.
fn exact() -> Coefficients {
    let basis = Basis::new(DEGREE);
    let mut sum = Coefficients::default();
    for (axis, color) in LOBES {
        let mut values = [0.0; FUNCTIONS];
        basis.evaluate(axis.to_array(), &mut values);
        sum.0
            .iter_mut()
            .zip(values)
            .enumerate()
            .for_each(|(k, (sum, value))| *sum += color * COSINE_LOBE[k.isqrt()] * value);
    }
    sum
}
