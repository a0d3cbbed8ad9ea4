//! How fast light follows.

use super::super::{ScaledDdgi, Settings};
use crate::irradiance_probes::MapSizes;
use crate::irradiance_probes::test_scenes::{floor_points, furnace_emits, lamp, mean, solid, unrest};
use crate::test_worlds::{furnace, furnace_points, in_world, settle};
use crate::{Event, Feedback, Frame, Shaded, System, World};
use glam::Vec3;
use localprt_scenes::Lighting;
use localprt_surfaces::rays::RayCaster;
use std::f32::consts::PI;

/// The plain exponential mean, for what is switched on one by one.
fn plain() -> Settings {
    Settings { exponent: 1.0, thresholds: false, events: false, rays: 32, sizes: MapSizes::TEST, ..Settings::default() }
}

/// Frames until nine tenths of the way from one emission of a black furnace to another are gone.
fn frames_to_nine_tenths(settings: Settings, [from, to]: [f32; 2], events: &[Event]) -> u32 {
    let scene = furnace(0.0, 0.0);
    let caster = RayCaster::new(&scene).expect("a tree");
    let lightings = [from, to].map(furnace_emits);
    let [before, after] = lightings.each_ref().map(|lighting| World::new(&caster, lighting));
    let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
    let mut scaled = ScaledDdgi::over(&before, 8, settings, 1);
    settle(&mut scaled, &before, Feedback::Own, 2);
    let mut frames = 0;
    while (mean(&scaled, &after, &points) / PI - to).abs() > 0.1 * (from - to).abs() {
        let events = if frames == 0 { events } else { &[] };
        let number = u64::from(frames) + 2;
        scaled.update(&Frame { world: &after, number, camera: None, feedback: Feedback::Own, events, still: false });
        frames += 1;
        assert!(frames < 1000, "it never gets there");
    }
    frames
}

#[test]
fn the_encoding_turns_dark_in_16_frames_instead_of_76() {
    let encoded = Settings { exponent: 5.0, ..plain() };
    // ln 0.1 / ln 0.97 = 75.6; the fifth power of what is stored falls five times as fast: 15.1.
    assert_eq!(frames_to_nine_tenths(plain(), [1.0, 0.0], &[]), 76);
    assert_eq!(frames_to_nine_tenths(encoded, [1.0, 0.0], &[]), 16);
    // Its price: from the dark to light (1 - a^n)^5 >= 0.9, n = 127.1.
    assert_eq!(frames_to_nine_tenths(encoded, [0.0, 1.0], &[]), 128);
}

#[test]
fn thresholds_take_over_a_new_light_at_once() {
    let thresholds = Settings { thresholds: true, ..plain() };
    // By all of the greatest value: the first frame is taken whole.
    assert_eq!(frames_to_nine_tenths(thresholds, [0.0, 1.0], &[]), 1);
    assert_eq!(frames_to_nine_tenths(thresholds, [1.0, 0.0], &[]), 1);
    // By half of it: 0.82 until a quarter is left after 4 frames, 0.82^4 = 0.452, then 0.97 from there: ln(0.1 / 0.452) / ln 0.97 =
    // 49.5 more. By a fifth: no help.
    assert_eq!(frames_to_nine_tenths(thresholds, [0.0, 0.5], &[]), 54);
    assert_eq!(frames_to_nine_tenths(thresholds, [0.0, 0.2], &[]), 76);
}

#[test]
fn an_event_lets_light_follow_within_its_frames() {
    let events = Settings { events: true, ..plain() };
    // 0.5 x 0.97 = 0.485: ln 0.1 / ln 0.485 = 3.2 of 10 frames.
    assert_eq!(frames_to_nine_tenths(events, [0.0, 1.0], &[Event::LargeLight]), 4);
    assert_eq!(frames_to_nine_tenths(events, [0.0, 1.0], &[Event::LargeObject]), 4);
    // 0.85 x 0.97 for 4 frames leaves 0.462: ln(0.1 / 0.462) / ln 0.97 = 50.3 more.
    assert_eq!(frames_to_nine_tenths(events, [0.0, 1.0], &[Event::SmallLight]), 55);
    assert_eq!(frames_to_nine_tenths(plain(), [0.0, 1.0], &[Event::LargeLight]), 76);
}

#[test]
fn all_together_follow_a_lamp_in_a_few_frames() {
    let whole = Settings { rays: 32, sizes: MapSizes::TEST, ..Settings::default() };
    let runs = [[0.0, 1.0], [1.0, 0.0], [0.1, 1.0], [1.0, 0.1]];
    let frames = runs.map(|run| frames_to_nine_tenths(whole, run, &[Event::LargeLight]));
    eprintln!("frames to nine tenths with all, {runs:?}: {frames:?}");
    // Within the 10 frames of the event, of which 0.485^10 leaves nothing.
    assert!(frames.iter().all(|frames| *frames <= 10), "{frames:?}");
}

#[test]
fn the_encoding_calms_fireflies() {
    in_world(&lamp(0.3), &Lighting::default(), |world| {
        let run = |exponent| {
            let settings = Settings { exponent, ..plain() };
            let mut scaled = ScaledDdgi::over(world, 8, settings, 1);
            let floor = floor_points(Vec3::new(1.5, 0.0, 2.0), Vec3::new(2.5, 0.0, 3.0), 2);
            let light: Vec<f32> = (0..300)
                .map(|number| {
                    scaled.update(&Frame {
                        world,
                        number,
                        camera: None,
                        feedback: Feedback::Nothing,
                        events: &[],
                        still: false,
                    });
                    mean(&scaled, world, &floor)
                })
                .collect();
            (light[100..].iter().sum::<f32>() / 200.0, unrest(&light[100..]))
        };
        let (linear, encoded) = (run(1.0), run(5.0));
        eprintln!("mean, unrest: {linear:?} linear, {encoded:?} encoded");
        // A firefly is a short large value: in a fifth root it weighs less.
        assert!(encoded.1 < 0.8 * linear.1, "{encoded:?} {linear:?}");
        // Its price: a mean of roots is below the root of the mean, so that noisy light is too dark.
        assert!(encoded.0 < 0.9 * linear.0, "{encoded:?} {linear:?}");
    });
}

#[test]
fn distances_follow_a_large_object_within_seven_frames() {
    let empty = furnace(0.0, 1.0);
    let mut filled = empty.clone();
    filled.meshes.push(solid(Vec3::new(1.5, 0.2, 2.0), Vec3::new(2.5, 1.0, 3.0)));
    let casters = [&empty, &filled].map(|scene| RayCaster::new(scene).expect("a tree"));
    let lighting = Lighting::default();
    let [before, after] = casters.each_ref().map(|caster| World::new(caster, &lighting));
    // What a probe high up in the room sees below, after the object came.
    let run = |events: &[Event], frames: u64| {
        let settings = Settings { events: true, sleeps: false, moves: 0, sizes: MapSizes::PAPER, ..plain() };
        let mut scaled = ScaledDdgi::over(&before, 8, settings, 1);
        settle(&mut scaled, &before, Feedback::Nothing, 3);
        for number in 0..frames {
            let events = if number == 0 { events } else { &[] };
            let frame = Frame {
                world: &after,
                number: 3 + number,
                camera: None,
                feedback: Feedback::Nothing,
                events,
                still: false,
            };
            scaled.update(&frame);
        }
        let to_block = Vec3::new(2.0, 0.8, 2.5) - scaled.volumes[0].position(2);
        scaled.volumes[0].maps[2].moments(to_block.normalize()).x
    };
    let (old, new) = (run(&[], 0), run(&[Event::LargeObject], 200));
    let way = |at: f32| (old - at) / (old - new);
    let (with, without) = (way(run(&[Event::LargeObject], 7)), way(run(&[Event::LargeLight], 7)));
    eprintln!(
        "of the way of a distance from {old} to {new}: {with} in 7 frames after a large object, {without} after a light"
    );
    // 1 - 0.485^7 = 99.4 % and 1 - 0.97^7 = 19 %, up to what turned rays differ by.
    assert!(with > 0.9 && without < 0.35, "{with} {without}");
}
