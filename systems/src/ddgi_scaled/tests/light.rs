//! Light that is known, light that leaks, glossy light.

use super::super::{KIND, ScaledDdgi, Settings, Volume, Window};
use crate::irradiance_probes::MapSizes;
use crate::irradiance_probes::test_scenes::{
    self, against_paths, cornell_points, linear_sky, mean, path_traced, rooms, rooms_grid, two_rooms,
};
use crate::test_worlds::{furnace, furnace_points, in_world, settle};
use crate::{Feedback, ProbeGrid, Query, Setup, Shaded, System, World};
use glam::{UVec3, Vec3};
use localprt_scenes::{Lighting, SurfacePoint};
use std::f32::consts::PI;

/// Greatest share by which red irradiance at the furnace's points is off.
fn furnace_error(scaled: &ScaledDdgi, world: &World<'_>, expected: f32) -> f32 {
    let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
    let irradiance = scaled.irradiance(world, &Query::of(&points));
    irradiance.iter().map(|value| (value.x / expected - 1.0).abs()).fold(0.0, f32::max)
}

#[test]
fn a_furnace_settles_at_every_bounce() {
    let settings = Settings { hysteresis: 0.2, ..Settings::default() };
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let prepared = || ScaledDdgi::over(world, 27, settings, 1);
        let mut first = prepared();
        settle(&mut first, world, Feedback::Nothing, 1);
        // Means of equal values; their rounding goes through the powers 1/5 and 5/2.
        assert!(furnace_error(&first, world, PI) < 1e-4);
        let mut second = prepared();
        settle(&mut second, world, Feedback::Of(&first), 1);
        assert!(furnace_error(&second, world, 1.5 * PI) < 1e-4);
        let mut all = prepared();
        settle(&mut all, world, Feedback::Own, 24);
        assert!(furnace_error(&all, world, 2.0 * PI) < 1e-3, "{}", furnace_error(&all, world, 2.0 * PI));
    });
}

/// Four probes' distance apart in the linear sky. Nothing is near: they must not sleep.
fn in_sky(world: &World<'_>) -> ScaledDdgi {
    let settings = Settings { sleeps: false, hysteresis: 0.9, sizes: MapSizes::TEST, ..Settings::default() };
    let window = Window::new(ProbeGrid { low: Vec3::ZERO, spacing: Vec3::ONE, size: UVec3::splat(2) });
    let mut scaled = ScaledDdgi::new(world, vec![Volume::fixed(window, &settings)], Vec::new(), settings, 1);
    settle(&mut scaled, world, Feedback::Own, 30);
    scaled
}

fn in_air(normal: Vec3, to_eye: Vec3) -> Shaded {
    Shaded { point: SurfacePoint { position: Vec3::splat(0.4), normal, geometric_normal: normal }, to_eye }
}

#[test]
fn light_of_a_linear_sky_has_its_direction() {
    let (scene, lighting) = linear_sky();
    in_world(&scene, &lighting, |world| {
        let scaled = in_sky(world);
        for normal in Vec3::AXES.into_iter().chain([Vec3::new(0.6, 0.8, 0.0), Vec3::NEG_Y]) {
            let found = scaled.irradiance(world, &Query::of(&[in_air(normal, normal)]))[0].x;
            // As with DDGI: what bilinear reads of 8 x 8 texels miss.
            assert!((found / PI - 1.0 - normal.y / 3.0).abs() < 0.04, "{normal}: {found}");
        }
    });
}

#[test]
fn glossy_light_comes_from_the_mirror_direction() {
    let (scene, lighting) = linear_sky();
    in_world(&scene, &lighting, |world| {
        let scaled = in_sky(world);
        // A wall, seen from below and from above: its mirror shows the other side of the sky.
        for y in [-0.8f32, 0.8] {
            let shaded = in_air(Vec3::X, Vec3::new(0.6, y, 0.0));
            let glossy = scaled.second_order(&shaded).x;
            assert!((glossy - 1.0 + y / 3.0).abs() < 0.04, "{y}: {glossy}");
            // Its diffuse light is the same from everywhere.
            let diffuse = scaled.irradiance(world, &Query::of(&[shaded]))[0].x / PI;
            assert!((glossy - diffuse).abs() > 0.2, "{y}: {glossy} {diffuse}");
        }
    });
}

#[test]
fn reflections_have_light_of_the_second_order() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let mut scaled = ScaledDdgi::over(world, 27, Settings { hysteresis: 0.2, ..Settings::default() }, 1);
        settle(&mut scaled, world, Feedback::Own, 24);
        let point = furnace_points()[1];
        let shaded = Shaded { point, to_eye: (point.normal + Vec3::new(0.3, 0.0, 0.8)).normalize() };
        // Every surface sends Le / (1 - albedo) = 2, and each mirror adds what the next one sends, times its gloss. As accurate as
        // the furnace is.
        for gloss in [0.0, 0.4] {
            let found = scaled.reflection(world, &shaded, gloss).x;
            assert!((found - 2.0 * (1.0 + gloss)).abs() < 4e-3, "{gloss}: {found}");
        }
    });
}

/// Light of the dark one of two sealed rooms as a share of the lit one's.
fn leak(world: &World<'_>, settings: Settings) -> f32 {
    let settings = Settings { rays: 64, hysteresis: 0.5, ..settings };
    let volume = Volume::fixed(Window::new(rooms_grid()), &settings);
    test_scenes::leak(&mut ScaledDdgi::new(world, vec![volume], Vec::new(), settings, 1), world)
}

#[test]
fn a_moved_probe_does_not_light_the_room_that_it_left() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        // A plane of probes in the wall of 5 mm, a millimetre nearer to the lit room, into which the optimizer moves them; and eyes at a slant
        // along the wall in the dark one.
        let (low, high) = world.bounds();
        let size = UVec3::new(7, 3, 5);
        let spacing = (high - low) / size.as_vec3();
        let grid = ProbeGrid { low: low + spacing * 0.5 - Vec3::X * 1e-3, spacing, size };
        let (lit, dark) = rooms();
        let wall = dark.iter().filter(|shaded| shaded.point.normal == Vec3::X);
        let slanted: Vec<Shaded> =
            wall.map(|shaded| Shaded { to_eye: Vec3::new(0.4, 0.0, 0.84f32.sqrt()), ..*shaded }).collect();
        let leak = |biased_cage: bool| {
            let settings = Settings { rays: 64, biased_cage, ..Settings::default() };
            let volume = Volume::fixed(Window::new(grid), &settings);
            let mut scaled = ScaledDdgi::new(world, vec![volume], Vec::new(), settings, 1);
            settle(&mut scaled, world, Feedback::Nothing, 12);
            mean(&scaled, world, &slanted) / mean(&scaled, world, &lit)
        };
        let (biased, as_printed) = (leak(true), leak(false));
        eprintln!("seen at a slant: {biased} with the cage of the biased point, {as_printed} without");
        assert!(biased < 0.5 * as_printed, "{biased} {as_printed}");
    });
}

#[test]
fn the_self_shadow_bias_keeps_light_in_its_room_and_too_much_does_not() {
    let (scene, lighting) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let run = |self_shadow_bias| leak(world, Settings { self_shadow_bias, ..Settings::default() });
        let (none, paper, much) = (run(0.0), run(0.3), run(3.0));
        eprintln!("two rooms: {none} without bias, {paper} at 0.3, {much} at 3");
        assert!(paper < 0.005 && none > 5.0 * paper, "{none} {paper}");
        // Fig. 3. At 3 a point is moved by more than two spacings, out of its room.
        assert!(much > 2.0 * paper, "{much} {paper}");
    });
}

#[test]
fn the_cornell_box_is_near_what_paths_find() {
    let scene = localprt_scenes::builtin::scene("cornell").expect("cornell");
    in_world(&scene, &Lighting::of_scene(&scene), |world| {
        let points = cornell_points(world, 10);
        let paths = path_traced(world, &points, 200);
        let settings = Settings { rays: 64, hysteresis: 0.8, ..Settings::default() };
        let mut scaled = ScaledDdgi::over(world, 64, settings, 1);
        settle(&mut scaled, world, Feedback::Own, 12);
        let (mean, off) = against_paths(&scaled.irradiance(world, &Query::of(&points)), &paths);
        eprintln!("cornell, 64 probes: mean {mean} of the truth, off by {off}");
        // Found: 0.92 and 18 %: as DDGI, and darker by what the encoding makes of noise.
        assert!((mean - 1.0).abs() < 0.12 && off < 0.25, "{mean} {off}");
    });
}

#[test]
fn frames_are_the_same_on_any_number_of_threads() {
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(|| {
            in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
                let mut scaled = (KIND.prepare)(world, &Setup { probes: 30, cameras: &[], seed: 9 });
                settle(&mut *scaled, world, Feedback::Own, 3);
                assert!(scaled.probes() <= 30 && scaled.bytes() == KIND.probe_bytes * scaled.probes() as u64);
                let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
                scaled.irradiance(world, &Query::of(&points))
            })
        })
    };
    assert_eq!(run(1), run(3));
}
