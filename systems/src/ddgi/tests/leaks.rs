//! Light where none should be, and what keeps it out.

use super::super::{Ddgi, Settings};
use crate::irradiance_probes::Weights;
use crate::irradiance_probes::test_scenes::{
    self, against_paths, cornell_points, floor_points, mean, path_traced, rooms_grid, two_rooms,
};
use crate::test_worlds::{in_world, lit_plane, settle};
use crate::{Feedback, ProbeGrid, Query, System, World};
use glam::{UVec3, Vec3};
use localprt_scenes::Lighting;
use std::f32::consts::PI;

/// Light of the dark room as a share of the lit one's.
fn leak(world: &World<'_>, weights: Weights, normal_bias: f32) -> f32 {
    let settings = Settings { weights, normal_bias, rays: 64, hysteresis: 0.5, ..Settings::default() };
    test_scenes::leak(&mut Ddgi::new(rooms_grid(), settings, 1), world)
}

#[test]
fn light_in_a_sealed_room_hardly_leaks() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let leak = leak(world, Weights::default(), Settings::default().normal_bias);
        eprintln!("two rooms, all weights: {leak}");
        // Found: 0.2 %, nearly all of it on the party wall.
        assert!(leak < 0.005, "{leak}");
    });
}

#[test]
fn each_weight_of_the_papers_figure_takes_leaking_light_away() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let trilinear = Weights { trilinear: true, ..Weights::NONE };
        let wrap = Weights { wrap: true, ..trilinear };
        let chebyshev = Weights { chebyshev: true, ..wrap };
        let bias = Settings::default().normal_bias;
        let steps = [(trilinear, 0.0), (wrap, 0.0), (chebyshev, 0.0), (chebyshev, bias), (Weights::default(), bias)];
        let leaks = steps.map(|(weights, bias)| leak(world, weights, bias));
        eprintln!("two rooms, trilinear, wrap, Chebyshev, bias, crush: {leaks:?}");
        // Found: 22, 10, 9, 0.5 and 0.2 %. Chebyshev alone does little on the party wall: it lies at the mean of what the probes behind
        // it see, and only the bias brings it out of their sight.
        for (pair, factor) in leaks.windows(2).zip([0.6, 0.95, 0.5, 0.5]) {
            assert!(pair[1] < factor * pair[0], "{leaks:?}");
        }
        assert!(leaks[0] > 0.1, "{leaks:?}");
    });
}

#[test]
fn without_any_one_weight_more_light_leaks() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let (all, bias) = (Weights::default(), Settings::default().normal_bias);
        let whole = leak(world, all, bias);
        let without = [
            (Weights { wrap: false, ..all }, bias),
            (Weights { chebyshev: false, ..all }, bias),
            (Weights { crush: false, ..all }, bias),
            (all, 0.0),
        ];
        let leaks = without.map(|(weights, bias)| leak(world, weights, bias));
        eprintln!("two rooms {whole}, without wrap, Chebyshev, crush, bias: {leaks:?}");
        assert!(leaks.iter().all(|leak| *leak > 1.5 * whole), "{whole} {leaks:?}");
    });
}

#[test]
fn trilinear_weights_make_light_continuous() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        // A millimetre at a time along the lit room's floor.
        let line: Vec<_> = (0..2800)
            .flat_map(|k| {
                floor_points(
                    Vec3::new(-2.9 + 1e-3 * k as f32, 0.0, 0.3),
                    Vec3::new(-2.9 + 1e-3 * k as f32, 0.0, 0.3),
                    1,
                )
            })
            .collect();
        let steepest = |trilinear| {
            let settings = Settings { weights: Weights { trilinear, ..Weights::default() }, ..Settings::default() };
            let mut ddgi = Ddgi::new(rooms_grid(), settings, 1);
            settle(&mut ddgi, world, Feedback::Nothing, 2);
            let light = ddgi.irradiance(world, &Query::of(&line));
            light.windows(2).map(|pair| (pair[1].x / pair[0].x - 1.0).abs()).fold(0.0, f32::max)
        };
        let (with, without) = (steepest(true), steepest(false));
        eprintln!("steepest step: {with} with, {without} without");
        // Probes are about 0.8 m apart: a cell's light may change by all of it in 800 steps, and its weights some times faster.
        assert!(with < 0.01, "{with}");
        assert!(without > 0.05, "{without}");
    });
}

#[test]
fn what_stands_close_to_a_surface_is_overlit() {
    // A black table of 1 m, 10 cm above a plane below the sky, and probes 2 m apart around it.
    let (mut scene, lighting) = lit_plane(0.0);
    let mut table = scene.meshes[0].clone();
    table.positions.iter_mut().for_each(|position| *position = *position * 0.1 + Vec3::Y * 0.1);
    scene.meshes.push(table);
    scene.materials[0].double_sided = true;
    in_world(&scene, &lighting, |world| {
        let grid = ProbeGrid { low: Vec3::new(-3.0, 0.5, -3.0), spacing: Vec3::splat(2.0), size: UVec3::new(4, 2, 4) };
        let mut ddgi = Ddgi::new(grid, Settings::default(), 1);
        settle(&mut ddgi, world, Feedback::Own, 10);
        let below = floor_points(Vec3::ZERO, Vec3::ZERO, 1);
        // In truth the table fills 4 / pi * s atan(s) of the hemisphere, s = 5 / sqrt(26): 96.8 %.
        let s = 5.0 / 26f32.sqrt();
        let truth = PI * (1.0 - 4.0 / PI * s * s.atan());
        let found = mean(&ddgi, world, &below);
        eprintln!("below a table: {found}, in truth {truth}");
        assert!(found > 10.0 * truth && found < 1.1 * PI, "{found} {truth}");
    });
}

#[test]
fn the_cornell_box_is_near_what_paths_find() {
    let scene = localprt_scenes::builtin::scene("cornell").expect("cornell");
    in_world(&scene, &Lighting::of_scene(&scene), |world| {
        let points = cornell_points(world, 10);
        let paths = path_traced(world, &points, 200);
        let mut ddgi = Ddgi::over(world.bounds(), 64, Settings { rays: 64, hysteresis: 0.8, ..Settings::default() }, 1);
        settle(&mut ddgi, world, Feedback::Own, 12);
        let (mean, off) = against_paths(&ddgi.irradiance(world, &Query::of(&points)), &paths);
        eprintln!("cornell, 64 probes: mean {mean} of the truth, off by {off}");
        // Found: 0.96 and 18 %, of which 8 % are the noise of the paths; with 3000 of them 15 %. With the first bounce alone the mean
        // would be 0.62.
        assert!((mean - 1.0).abs() < 0.1 && off < 0.25, "{mean} {off}");
    });
}
