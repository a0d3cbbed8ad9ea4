//! What frames do to light: hysteresis, flicker, delay, turned rays.

use super::super::{Ddgi, Settings};
use crate::irradiance_probes::MapSizes;
use crate::irradiance_probes::test_scenes::{floor_points, furnace_emits, lamp, mean, unrest};
use crate::test_worlds::{furnace, furnace_points, in_world, settle};
use crate::{Feedback, Frame, Shaded, System, World};
use glam::Vec3;
use localprt_scenes::Lighting;
use localprt_surfaces::rays::RayCaster;
use std::f32::consts::PI;

/// Red irradiance in the middle of the lamp's room after each of many frames.
fn frames(world: &World<'_>, settings: Settings, count: u64) -> Vec<f32> {
    let mut ddgi = Ddgi::over(world.bounds(), 8, Settings { sizes: MapSizes::TEST, ..settings }, 1);
    let floor = floor_points(Vec3::new(1.5, 0.0, 2.0), Vec3::new(2.5, 0.0, 3.0), 2);
    (0..count)
        .map(|number| {
            ddgi.update(&Frame { world, number, camera: None, feedback: Feedback::Nothing, events: &[], still: false });
            mean(&ddgi, world, &floor)
        })
        .collect()
}

#[test]
fn low_hysteresis_and_few_rays_flicker() {
    in_world(&lamp(0.0), &Lighting::default(), |world| {
        let run = |hysteresis, rays| {
            let values = frames(world, Settings { hysteresis, rays, ..Settings::default() }, 300);
            unrest(&values[100..])
        };
        let (stable, fast, few) = (run(0.97, 64), run(0.8, 64), run(0.97, 16));
        eprintln!("unrest: {stable} at 0.97 with 64 rays, {fast} at 0.8, {few} with 16 rays");
        // A running mean keeps (1 - a) / (1 + a) of the variance of independent frames: a factor sqrt(7.3) = 2.7. Few frames are
        // independent in the slow one, hence half.
        assert!(fast > 1.5 * stable, "{fast} {stable}");
        // A quarter of independent rays has twice the deviation. Found: 1.6.
        assert!(few > 1.5 * stable, "{few} {stable}");
    });
}

/// Frames until a furnace that begins to glow has nine tenths of its light.
fn frames_to_nine_tenths(albedo: f32, hysteresis: f32) -> u64 {
    let scene = furnace(albedo, 0.0);
    let caster = RayCaster::new(&scene).expect("a tree");
    let lightings = [0.0, 1.0].map(furnace_emits);
    let [dark, lit] = lightings.each_ref().map(|lighting| World::new(&caster, lighting));
    let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
    let settings = Settings { hysteresis, rays: 32, sizes: MapSizes::TEST, ..Settings::default() };
    let mut ddgi = Ddgi::over(dark.bounds(), 8, settings, 1);
    settle(&mut ddgi, &dark, Feedback::Own, 2);
    let mut frames = 0;
    while mean(&ddgi, &lit, &points) < 0.9 * PI / (1.0 - albedo) {
        let frame =
            Frame { world: &lit, number: 2 + frames, camera: None, feedback: Feedback::Own, events: &[], still: false };
        ddgi.update(&frame);
        frames += 1;
        assert!(frames < 1000, "it never gets there");
    }
    frames
}

#[test]
fn a_lamp_takes_76_frames_to_nine_tenths() {
    // 1 - a^n >= 0.9: n = ln 0.1 / ln a, 75.6 at 0.97, 21.9 at 0.9; without hysteresis one frame.
    let frames = [0.97, 0.9, 0.0].map(|hysteresis| frames_to_nine_tenths(0.0, hysteresis));
    assert_eq!(frames, [76, 22, 1]);
}

#[test]
fn bounces_add_to_the_delay() {
    // Light comes back from the last frame's probes: what is missing falls by a + (1 - a) albedo. At 0.97 and albedo 0.5 that is
    // 0.985: 152.4 frames; at 0.9 0.95: 44.9; without hysteresis 0.5: 3.3.
    let frames = [0.97, 0.9, 0.0].map(|hysteresis| frames_to_nine_tenths(0.5, hysteresis));
    assert_eq!(frames, [153, 45, 4]);
}

#[test]
fn turned_rays_find_what_fixed_ones_miss() {
    in_world(&lamp(0.0), &Lighting::default(), |world| {
        let last = |turns, rays, count: usize| {
            let values = frames(world, Settings { turns, rays, ..Settings::default() }, 3 * count as u64);
            values[2 * count..].iter().sum::<f32>() / count as f32
        };
        let truth = last(true, 2048, 10);
        let (turned, fixed) = (last(true, 32, 100), last(false, 32, 100));
        eprintln!("with 2048 rays {truth}, 32 turned {turned}, 32 fixed {fixed}");
        // None of the 32 fixed rays of any of the 8 probes meets the lamp: they miss it for good. Turned ones meet it now and then; with
        // an unrest of some 12 % at 32 rays and a memory of 66 frames, a mean over 100 has a deviation of 8 %.
        assert!((turned / truth - 1.0).abs() < 0.15, "{turned} {truth}");
        assert_eq!(fixed, 0.0);
    });
}
