//! Where probes stand, which of them sleep, and what becomes of those inside of things.

use super::super::{Probe, ScaledDdgi, Settings, Sight, State, Volume, Window};
use crate::irradiance_probes::test_scenes::solid;
use crate::irradiance_probes::{MapSizes, turned_directions};
use crate::test_worlds::{furnace, furnace_points, in_world, settle};
use crate::{Feedback, Frame, Object, ProbeGrid, Query, Shaded, System, Work, World};
use glam::{UVec3, Vec3};
use localprt_scenes::{Lighting, Scene, SurfacePoint};
use std::f32::consts::PI;

/// The furnace with a block on its floor, all of it glowing: irradiance is pi everywhere.
fn with_block(low: Vec3, high: Vec3) -> Scene {
    let mut scene = furnace(0.0, 1.0);
    scene.meshes.push(solid(low, high));
    scene
}

/// A grid 8 x 8 x 8 in the furnace's 4 x 3 x 5 m, half a spacing from its walls.
fn grid() -> ProbeGrid {
    let spacing = Vec3::new(4.0, 3.0, 5.0) / 8.0;
    ProbeGrid { low: spacing * 0.5, spacing, size: UVec3::splat(8) }
}

fn on_grid(world: &World<'_>, grid: ProbeGrid, objects: Vec<Object>, settings: Settings) -> ScaledDdgi {
    let volume = Volume::fixed(Window::new(grid), &settings);
    ScaledDdgi::new(world, vec![volume], objects, settings, 1)
}

fn count(scaled: &ScaledDdgi, state: State) -> usize {
    scaled.states().filter(|of_probe| *of_probe == state).count()
}

fn frame(scaled: &mut ScaledDdgi, world: &World<'_>, number: u64) -> Work {
    scaled.update(&Frame { world, number, camera: None, feedback: Feedback::Own, events: &[], still: false })
}

/// Points of the block's five free sides, half a metre across.
fn block_points(low: Vec3, high: Vec3) -> Vec<Shaded> {
    let sides = [(0, 1.0), (0, -1.0), (1, 1.0), (2, 1.0), (2, -1.0f32)];
    let middle = (low + high) * 0.5;
    sides
        .into_iter()
        .flat_map(|(axis, sign)| (0..16).map(move |k| (axis, sign, k)))
        .map(|(axis, sign, k)| {
            let normal = Vec3::AXES[axis] * sign;
            let across = Vec3::AXES[(axis + 1) % 3] * (k % 4) as f32 + Vec3::AXES[(axis + 2) % 3] * (k / 4) as f32;
            let spread = (across - (Vec3::ONE - normal.abs()) * 1.5) / 4.0 * (high - low);
            let position = middle + spread + normal * (high - low) * 0.5;
            Shaded::from_above(SurfacePoint { position, normal, geometric_normal: normal })
        })
        .collect()
}

/// Mean share by which irradiance at the block is below pi.
fn missing(world: &World<'_>, (low, high): (Vec3, Vec3), settings: Settings) -> f32 {
    let mut scaled = on_grid(world, grid(), Vec::new(), settings);
    settle(&mut scaled, world, Feedback::Nothing, 2);
    let points = block_points(low, high);
    let irradiance = scaled.irradiance(world, &Query::of(&points));
    irradiance.iter().map(|value| 1.0 - value.x / PI).sum::<f32>() / points.len() as f32
}

/// Quick settings for what has nothing to do with visibility.
fn quick() -> Settings {
    Settings { rays: 64, first_rays: 64, sizes: MapSizes::TEST, ..Settings::default() }
}

#[test]
fn shortened_backs_hide_probes_that_are_inside() {
    // Probes at 1.25 and 1.75, 0.19 and 0.56, 2.19 and 2.81 m are inside. All take part.
    let block = (Vec3::new(1.1, 0.0, 2.0), Vec3::new(2.0, 0.8, 3.0));
    in_world(&with_block(block.0, block.1), &Lighting::default(), |world| {
        let settings = Settings {
            rays: 64,
            first_rays: 64,
            moves: 0,
            sleeps: false,
            self_shadow_bias: 0.05,
            ..Settings::default()
        };
        let run = |shortens_backs| missing(world, block, Settings { shortens_backs, ..settings });
        let (with, without) = (run(true), run(false));
        eprintln!("missing light at a block with black probes inside: {with} with shortened backs, {without} without");
        assert!(without > 0.02 && with < 0.3 * without, "{with} {without}");
    });
}

#[test]
fn the_optimizer_moves_probes_out_of_a_block() {
    // Only its rim is within reach of probes inside, 0.15 m from the sides.
    let block = (Vec3::new(1.1, 0.0, 2.0), Vec3::new(2.0, 0.8, 3.0));
    in_world(&with_block(block.0, block.1), &Lighting::default(), |world| {
        let inside = |moves| {
            let scaled = on_grid(world, grid(), Vec::new(), Settings { moves, ..quick() });
            let volume = &scaled.volumes[0];
            let inside = |position: Vec3| block.0.cmplt(position).all() && position.cmplt(block.1).all();
            let positions = (0..volume.probes.len()).map(|slot| volume.position(slot));
            (positions.filter(|position| inside(*position)).count(), count(&scaled, State::Off))
        };
        // Eight are inside and find themselves off.
        assert_eq!(inside(0), (8, 8));
        assert_eq!(inside(5), (0, 0));
    });
}

#[test]
fn probes_deep_inside_are_off() {
    // 4 x 4 x 4 probes are inside. The outer ones are 0.14 to 0.16 m from its sides and may move by 0.17 to 0.28; the inner 8 may not
    // get that far.
    let block = (Vec3::new(1.1, 0.8, 1.4), Vec3::new(2.9, 2.2, 3.6));
    in_world(&with_block(block.0, block.1), &Lighting::default(), |world| {
        let mut scaled = on_grid(world, grid(), Vec::new(), quick());
        assert_eq!(count(&scaled, State::Off), 8);
        let work = frame(&mut scaled, world, 0);
        let awake = scaled.states().filter(|state| state.is_active()).count() as u64;
        assert_eq!(work.probes, awake);
        assert_eq!(count(&scaled, State::Off), 8);
        // And they do not darken the block.
        let points = block_points(block.0, block.1);
        let irradiance = scaled.irradiance(world, &Query::of(&points));
        // One value everywhere, through the powers of the encoding.
        assert!(irradiance.iter().all(|value| (value.x / PI - 1.0).abs() < 1e-4), "{irradiance:?}");
    });
}

#[test]
fn probes_far_from_surfaces_sleep_and_nobody_sees_it() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let run = |sleeps| {
            let mut scaled = on_grid(world, grid(), Vec::new(), Settings { sleeps, ..quick() });
            let work = (0..2).map(|number| frame(&mut scaled, world, number)).last().expect("frames");
            let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
            (work, count(&scaled, State::Sleeping), scaled.irradiance(world, &Query::of(&points)))
        };
        let (with, without) = (run(true), run(false));
        // The outermost layer lights walls. The second stands 1.5 spacings off: 6 x 6 x 6 of 8 x 8 x 8, 42 %, and as much of the
        // rays, the shadow rays and the texels.
        assert_eq!((with.1, without.1), (216, 0));
        assert_eq!((with.0.probes, without.0.probes), (296, 512));
        assert_eq!(with.0.rays * 512, without.0.rays * 296);
        assert_eq!(with.0.texels * 512, without.0.texels * 296);
        assert_eq!(with.2, without.2);
    });
}

#[test]
fn a_box_in_the_air_wakes_sleepers() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        // Without thresholds, which would take over such a change, too.
        let mut scaled = on_grid(world, grid(), Vec::new(), Settings { thresholds: false, ..quick() });
        frame(&mut scaled, world, 0);
        let point = SurfacePoint { position: Vec3::new(2.0, 1.5, 2.5), normal: Vec3::Y, geometric_normal: Vec3::Y };
        let ask = |scaled: &ScaledDdgi| scaled.irradiance(world, &Query::of(&[Shaded::from_above(point)]))[0].x;
        assert_eq!((count(&scaled, State::Awake), ask(&scaled)), (0, 0.0));
        // A cell and the bias around a box of 0.1 m: 4 probes along x (0.5 m apart, 0.25 and 0.75 from the middle of 2; reach 0.63),
        // of which 2 are within, and so along every axis.
        let half = Vec3::splat(0.05);
        scaled.set_moving(&[Object { low: point.position - half, high: point.position + half }]);
        let work = frame(&mut scaled, world, 1);
        assert_eq!((count(&scaled, State::Awake), work.probes), (8, 296 + 8));
        // Woken with their first values whole, which are those of a furnace.
        assert!((ask(&scaled) / PI - 1.0).abs() < 1e-4, "{}", ask(&scaled));
        scaled.set_moving(&[]);
        frame(&mut scaled, world, 2);
        assert_eq!((count(&scaled, State::Awake), count(&scaled, State::Sleeping)), (0, 216));
    });
}

#[test]
fn what_moves_does_not_move_probes() {
    let block = (Vec3::new(1.1, 0.0, 2.0), Vec3::new(2.0, 0.8, 3.0));
    in_world(&with_block(block.0, block.1), &Lighting::default(), |world| {
        // A probe in the block sees the room's walls and not the block, where that is one that moves.
        let dirs = turned_directions(64, 1, 0, 0);
        let look = |objects: &[Object]| {
            let place = (Vec3::new(1.5, 0.5, 2.5), Vec3::ZERO);
            Sight::of(world, place, Vec3::splat(0.5), &dirs, objects)
        };
        let margin = Vec3::splat(1e-3);
        let object = Object { low: block.0 - margin, high: block.1 + margin };
        assert!(look(&[]).is_inside() && !look(&[object]).is_inside());
        let scaled = on_grid(world, grid(), vec![object], quick());
        assert!(scaled.volumes[0].probes.iter().all(|probe| probe.offset == Vec3::ZERO));
        assert_eq!(count(&scaled, State::Off), 0);
    });
}

#[test]
fn new_probes_take_their_first_values_whole_and_with_more_rays() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let mut scaled = on_grid(world, grid(), Vec::new(), Settings { first_rays: 128, thresholds: false, ..quick() });
        assert_eq!((count(&scaled, State::NewlyVigilant), count(&scaled, State::Vigilant)), (296, 0));
        let works = [0, 1].map(|number| frame(&mut scaled, world, number));
        assert_eq!(works.map(|work| work.rays), [296 * 128, 296 * 64]);
        assert_eq!((count(&scaled, State::NewlyVigilant), count(&scaled, State::Vigilant)), (0, 296));
        // One at hysteresis 0.97 would have taken over 3 %.
        scaled.volumes[0].probes[0] = Probe { state: State::NewlyVigilant, ..Probe::NEW };
        scaled.volumes[0].maps[0] = crate::irradiance_probes::ProbeMaps::new(MapSizes::TEST);
        frame(&mut scaled, world, 2);
        let root = scaled.settings.root(scaled.volumes[0].maps[0].irradiance(Vec3::Y));
        assert!((root.x - 1.0).abs() < 1e-4, "{root}");
    });
}
