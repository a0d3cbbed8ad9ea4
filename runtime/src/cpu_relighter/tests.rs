//! The whole sequence against closed forms, and its refusals.

use super::*;
use crate::test_bake;
use localprt_formats::LEVEL_SKY;
use localprt_scenes::{Material, Mesh, Sky};
use std::f64::consts::PI;

/// Every texel of a `size * size` map alike.
fn uniform_surface(size: u32, albedo: f32, emission: f32, direct: f32) -> SurfaceTexels {
    let n = (size * size) as usize;
    SurfaceTexels {
        lightmap_uv: Vec::new(),
        size,
        index: (0..size * size).collect(),
        albedo: vec![Vec3::splat(albedo); n],
        emission: vec![emission * Vec3::new(1.0, 0.5, 0.25); n],
        direct: vec![Vec3::splat(direct); n],
    }
}

/// `pi g e (1 - q^k) / (1 - q)`, q = a g: irradiance after k gathers in the furnace with gain g.
fn furnace_irradiance(albedo: f64, emission: f64, bounces: u32) -> f64 {
    let gain = test_bake::furnace_gain();
    (0..bounces).map(|k| PI * gain * emission * (albedo * gain).powi(k as i32)).sum()
}

// Per gather: map, mips, 1000 rays in blocks of 64, projection, reconstruction, each a few f32 roundings of 6e-8 and
// 4e-6 for a block of rays (worst case); errors of feedback add up to 1 / (1 - 0.95) = 20 times that: 1e-4.
const FURNACE_TOLERANCE: f64 = 1e-4;

#[track_caller]
fn assert_furnace(relit: &Relit, expected: f64) {
    assert_eq!(relit.irradiance.len(), 16);
    for value in &relit.irradiance {
        for (channel, share) in [(value.x, 1.0), (value.y, 0.5), (value.z, 0.25)] {
            let expected = expected * share;
            assert!((f64::from(channel) - expected).abs() <= FURNACE_TOLERANCE * expected, "{value}, {expected}");
        }
    }
    for (texel, value) in relit.irradiance.iter().enumerate() {
        assert_eq!((relit.maps.irradiance.color(texel), relit.maps.irradiance.coverage(texel)), (*value, 1.0));
    }
}

#[test]
fn bounces_in_a_furnace_form_the_geometric_series() {
    let arrays = test_bake::furnace(2);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    for albedo in [0.0, 0.5, 0.8] {
        let surface = uniform_surface(8, albedo, 2.0, 0.0);
        for bounces in 0..8 {
            let inputs = RelightInputs { bounces, ..RelightInputs::new(&surface) };
            let relit = gi.relight(&inputs).unwrap();
            assert_furnace(relit, furnace_irradiance(f64::from(albedo), 2.0, bounces));
            assert_eq!(gi.gathers(), u64::from(bounces));
        }
    }
}

#[test]
fn a_furnace_settles_at_emission_over_one_minus_albedo() {
    let arrays = test_bake::furnace(2);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    let surface = uniform_surface(8, 0.8, 2.0, 0.0);
    // 0.8^100 = 2e-10 is left to come.
    gi.relight(&RelightInputs { bounces: 100, ..RelightInputs::new(&surface) }).unwrap();
    let expected = 2.0 / (1.0 - 0.8 * test_bake::furnace_gain());
    let radiance = f64::from(gi.light_map()[0].color(20).x);
    assert!((radiance - expected).abs() <= FURNACE_TOLERANCE * expected, "{radiance} instead of {expected}");
    // And that is e / (1 - a) but for the f16 weight: |1 - g| <= 2^-11, amplified by a / (1 - a) = 4.
    assert!((radiance - 10.0).abs() <= 10.0 * (4.0 / 2048.0 + FURNACE_TOLERANCE), "{radiance}");
}

#[test]
fn albedo_one_is_capped_in_the_feedback() {
    let arrays = test_bake::furnace(1);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    let surface = uniform_surface(8, 1.0, 2.0, 0.0);
    // 0.95^400 = 1e-9.
    let relit = gi.relight(&RelightInputs { bounces: 400, ..RelightInputs::new(&surface) }).unwrap();
    assert_furnace(relit, furnace_irradiance(0.95, 2.0, 400));
}

#[test]
fn direct_light_is_reflected_before_it_is_gathered() {
    let arrays = test_bake::furnace(1);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    let surface = uniform_surface(8, 0.5, 0.0, 3.0);
    let relit = gi.relight(&RelightInputs::new(&surface)).unwrap();
    // L = 0.5 / pi * 3, E = pi g L.
    let expected = test_bake::furnace_gain() * 1.5;
    assert!((f64::from(relit.irradiance[7].x) - expected).abs() <= FURNACE_TOLERANCE * expected);
}

#[test]
fn steps_are_the_bounces_of_one_relight() {
    let arrays = test_bake::random(2, 1, 2);
    let surface = uniform_surface(8, 0.5, 1.0, 2.0);
    let inputs = RelightInputs { bounces: 3, ..RelightInputs::new(&surface) };
    let mut whole = CpuRelighter::new(arrays.checked().unwrap());
    let mut stepped = CpuRelighter::new(arrays.checked().unwrap());
    let fresh = stepped.relit().clone();
    whole.relight(&inputs).unwrap();
    for _ in 0..3 {
        stepped.step(&inputs).unwrap();
    }
    assert_eq!(whole.relit(), stepped.relit());
    stepped.reset();
    assert_eq!((stepped.relit(), stepped.gathers()), (&fresh, 0));
    assert!(stepped.probe_radiance().iter().chain(stepped.cluster_lights()).all(|value| *value == Vec3::ZERO));
}

#[test]
fn no_bounce_gives_no_light_but_a_covered_map() {
    let arrays = test_bake::random(1, 0, 1);
    let surface = uniform_surface(8, 0.5, 1.0, 2.0);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    gi.relight(&RelightInputs::new(&surface)).unwrap();
    let relit = gi.relight(&RelightInputs { bounces: 0, ..RelightInputs::new(&surface) }).unwrap();
    assert!(relit.irradiance.iter().all(|value| *value == Vec3::ZERO));
    let covered: Vec<_> = (0..16).filter(|&texel| relit.maps.irradiance.coverage(texel) == 1.0).collect();
    // 11 receivers, and gutters at 13 and 14.
    assert_eq!(covered, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 13, 14]);
}

#[test]
fn light_goes_out_when_the_lights_do() {
    let arrays = test_bake::furnace(1);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    let lit = uniform_surface(8, 0.5, 2.0, 0.0);
    let before = gi.relight(&RelightInputs { bounces: 30, ..RelightInputs::new(&lit) }).unwrap().irradiance[0].x;
    let dark = uniform_surface(8, 0.5, 0.0, 0.0);
    for _ in 0..7 {
        gi.step(&RelightInputs::new(&dark)).unwrap();
    }
    // 0.5^7 = 0.8 %.
    assert!(gi.relit().irradiance[0].x < 0.01 * before && gi.relit().irradiance[0].x > 0.0);
}

#[test]
fn the_sky_reaches_receivers_and_probes_each_in_its_way() {
    let mut arrays = test_bake::furnace(1);
    arrays.ray_level.fill(LEVEL_SKY);
    let surface = uniform_surface(8, 0.5, 0.0, 0.0);
    let sky = vec![Vec3::new(1.0, 0.5, 0.25); test_bake::N_RAYS as usize];
    let without = RelightInputs { sky_rays: &sky, ..RelightInputs::new(&surface) };
    let inputs = RelightInputs { sky_in_probes: true, ..without };
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    assert_furnace(gi.relight(&inputs).unwrap(), furnace_irradiance(0.5, 1.0, 1));
    assert!(gi.relight(&without).unwrap().irradiance.iter().all(|value| *value == Vec3::ZERO));
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let arrays = test_bake::random(3, 1, 2);
    let surface = uniform_surface(8, 0.7, 1.0, 2.0);
    let (sky_sh, sky_rays) = (test_bake::random_colors(1, 9), test_bake::random_colors(2, 1000));
    let inputs = RelightInputs { sky_sh: &sky_sh, sky_rays: &sky_rays, bounces: 3, ..RelightInputs::new(&surface) };
    let run = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut gi = CpuRelighter::new(arrays.checked().unwrap());
            gi.relight(&inputs).unwrap();
            (gi.light_map().to_vec(), gi.probe_radiance().to_vec(), gi.cluster_lights().to_vec(), gi.relit().clone())
        })
    };
    let one = run(1);
    assert!(one.3.irradiance.iter().any(|value| value.max_element() > 0.0));
    assert_eq!(one, run(4));
}

#[test]
fn the_volume_holds_the_radiance_that_the_last_gather_read() {
    for degree in [1, 2] {
        let arrays = test_bake::furnace_volume(2, degree);
        let mut gi = CpuRelighter::new(arrays.checked().unwrap());
        let n_k = gi.volume_cells().unwrap().n_k();
        assert!(gi.volume().unwrap().iter().all(|value| *value == Vec3::ZERO));
        let surface = uniform_surface(8, 0.5, 2.0, 0.0);
        let inputs = RelightInputs { bounces: 3, ..RelightInputs::new(&surface) };
        gi.relight(&inputs).unwrap();
        // The surface as the third gather saw it: e + a / pi * E of two gathers.
        let radiance = 2.0 + 0.5 / PI * furnace_irradiance(0.5, 2.0, 2);
        let constant = (4.0 * PI).sqrt() * radiance;
        let cells = gi.volume().unwrap();
        for (cell, source) in [(0, 4.0), (1, 1.0), (2, 2.0), (3, 3.0), (4, 4.0), (5, 5.0), (6, 6.0)] {
            let values = &cells[cell * n_k..][..n_k];
            for (k, factor) in [(0, 1.0), (1, 0.0), (3, 0.25 * source)] {
                assert!(
                    (f64::from(values[k].x) - factor * constant).abs() <= FURNACE_TOLERANCE * constant,
                    "{cell} {k}"
                );
            }
        }
        assert!(cells[7 * n_k..].iter().all(|value| *value == Vec3::ZERO));
        // Step by step it is the same light; the lightmap does not know of the volume.
        let (relit, cells) = (gi.relit().clone(), cells.to_vec());
        gi.reset();
        assert!(gi.volume().unwrap().iter().all(|value| *value == Vec3::ZERO));
        for _ in 0..3 {
            gi.step(&inputs).unwrap();
        }
        assert_eq!((gi.relit(), gi.volume().unwrap()), (&relit, &cells[..]));
        let without = test_bake::furnace(2);
        let mut other = CpuRelighter::new(without.checked().unwrap());
        assert_eq!(other.relight(&inputs).unwrap(), &relit);
        assert!(other.volume().is_none() && other.volume_sampler().is_none());
    }
}

#[test]
fn wrong_inputs_are_refused_and_leave_the_light_alone() {
    let arrays = test_bake::furnace(1);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    let surface = uniform_surface(8, 0.5, 1.0, 0.0);
    let good = RelightInputs::new(&surface);
    let before = gi.relight(&good).unwrap().clone();
    let small = uniform_surface(4, 0.5, 1.0, 0.0);
    let two = [Vec3::ONE; 2];
    let not_a_number = [Vec3::NAN];
    let length = |what, expected, found| RelightError::Length { what, expected, found };
    for (inputs, expected) in [
        (RelightInputs::new(&small), RelightError::MapSize { expected: 8, found: 4 }),
        (RelightInputs { sky_sh: &two, ..good }, length("sky SH radiance", 1, 2)),
        (RelightInputs { sky_rays: &two, ..good }, length("sky radiance per relight ray", 1000, 2)),
        (
            RelightInputs { sky_sh: &not_a_number, ..good },
            RelightError::NotFinite { what: "sky SH radiance", index: 0 },
        ),
        (RelightInputs { feedback_albedo_cap: 1.5, ..good }, RelightError::AlbedoCap { found: 1.5 }),
    ] {
        assert_eq!(gi.relight(&inputs).unwrap_err(), expected);
        assert_eq!(gi.step(&inputs).unwrap_err(), expected);
        assert_eq!(gi.relit(), &before);
    }
    assert!(gi.relight(&RelightInputs { feedback_albedo_cap: f32::NAN, ..good }).is_err());
}

#[test]
fn a_lighting_needs_a_scene_and_finite_colors() {
    let arrays = test_bake::furnace(2);
    let mut gi = CpuRelighter::new(arrays.checked().unwrap());
    assert_eq!(gi.set_lighting(&Lighting::default()), Err(RelightError::NoScene));
    assert_eq!(gi.bounce().err(), Some(RelightError::NoScene));
    let scene = Scene {
        meshes: vec![Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
            normals: vec![Vec3::NEG_Y; 3],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        }],
        materials: vec![Material::default()],
        ..Scene::default()
    };
    gi.set_scene(&scene).unwrap();
    let before = gi.bounce().unwrap().clone();
    let broken = Lighting { sky: Sky::Constant(Vec3::NAN), ..Lighting::default() };
    assert!(matches!(gi.set_lighting(&broken), Err(RelightError::NotFinite { .. })));
    gi.reset();
    assert_eq!(*gi.bounce().unwrap(), before, "the lighting before is still there");
}
