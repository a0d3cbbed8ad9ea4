//! Windows that follow, and volumes side by side.

use super::super::{Probe, ScaledDdgi, Settings, State, Volume, Window};
use crate::irradiance_probes::{MapSizes, ProbeMaps};
use crate::test_worlds::{furnace, in_world};
use crate::{Feedback, Frame, ProbeGrid, Query, Shaded, System, World};
use glam::{Mat4, UVec3, Vec3};
use localprt_scenes::{Camera, Lighting, SurfacePoint};
use std::f32::consts::PI;

fn camera(at: Vec3) -> Camera {
    Camera { name: String::new(), to_world: Mat4::from_translation(at), fov_y: 1.0, aspect: None }
}

fn quick() -> Settings {
    Settings { rays: 48, first_rays: 48, sizes: MapSizes::TEST, ..Settings::default() }
}

/// A dense window around a point, in which all probes stay awake, and a sparse volume over the furnace.
fn volumes(world: &World<'_>, center: Vec3, settings: Settings) -> ScaledDdgi {
    let window = Window::around(center, Vec3::splat(0.2), UVec3::splat(6));
    let (low, high) = world.bounds();
    let sparse = ProbeGrid { low: low + 0.5, spacing: (high - low - 1.0) / 2.0, size: UVec3::splat(3) };
    let volumes = vec![Volume::following(window, &settings), Volume::fixed(Window::new(sparse), &settings)];
    ScaledDdgi::new(world, volumes, Vec::new(), settings, 1)
}

fn ask(scaled: &ScaledDdgi, world: &World<'_>, position: Vec3) -> f32 {
    let point = SurfacePoint { position, normal: Vec3::Y, geometric_normal: Vec3::Y };
    scaled.irradiance(world, &Query::of(&[Shaded::from_above(point)]))[0].x / PI
}

#[test]
fn a_window_that_moves_keeps_what_stays() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let settings = Settings { sleeps: false, ..quick() };
        let center = Vec3::new(1.5, 1.5, 2.5);
        let mut scaled = volumes(world, center, settings);
        let update = |scaled: &mut ScaledDdgi, number, at| {
            let camera = camera(at);
            scaled.update(&Frame {
                world,
                number,
                camera: Some(&camera),
                feedback: Feedback::Nothing,
                events: &[],
                still: false,
            })
        };
        update(&mut scaled, 0, center);
        let before: Vec<_> =
            (0..216).map(|slot| (scaled.volumes[0].position(slot), scaled.volumes[0].maps[slot].clone())).collect();
        let states =
            |scaled: &ScaledDdgi, state| scaled.volumes[0].probes.iter().filter(|probe| probe.state == state).count();
        assert_eq!(states(&scaled, State::Vigilant), 216);
        // A spacing and a half along x: one plane of 36.
        scaled.volumes[0].follow(Some(center + Vec3::X * 0.3));
        assert_eq!((states(&scaled, State::Vigilant), states(&scaled, State::Uninitialized)), (180, 36));
        for (slot, (position, maps)) in before.iter().enumerate() {
            if scaled.volumes[0].probes[slot].state == State::Vigilant {
                assert_eq!((scaled.volumes[0].position(slot), &scaled.volumes[0].maps[slot]), (*position, maps));
            }
        }
        // Five frames of looking around, the last with one look more and the first values. The sparse volume has 27 probes.
        let rays = [1, 2, 3, 4, 5].map(|number| update(&mut scaled, number, center + Vec3::X * 0.3).rays);
        assert_eq!(
            rays,
            [1, 1, 1, 1, 2].map(|looks| (looks * 36 + 180 + 27) * 48 + if looks == 2 { 36 * 48 } else { 0 })
        );
        assert_eq!(states(&scaled, State::Vigilant), 216);
    });
}

#[test]
fn planes_that_are_not_placed_leave_points_to_the_next_volume() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let settings = Settings { sleeps: false, ..quick() };
        let center = Vec3::new(2.0, 1.5, 2.5);
        let mut scaled = volumes(world, center, settings);
        scaled.update(&Frame {
            world,
            number: 0,
            camera: None,
            feedback: Feedback::Nothing,
            events: &[],
            still: false,
        });
        scaled.volumes[0].probes.fill(Probe::NEW);
        // The sparse volume's, not darkness.
        assert!((ask(&scaled, world, center) - 1.0).abs() < 1e-4);
    });
}

/// Two volumes whose light differs: 1 in the dense one, 3 in the sparse one.
fn of_two_lights(world: &World<'_>, center: Vec3, settings: Settings) -> ScaledDdgi {
    let mut scaled = volumes(world, center, settings);
    for (volume, light) in scaled.volumes.iter_mut().zip([1.0, 3.0]) {
        volume.probes.fill(Probe { state: State::Vigilant, ..Probe::NEW });
        volume.maps.fill(ProbeMaps::constant(settings.sizes, settings.encoded(Vec3::splat(light))));
    }
    scaled
}

#[test]
fn volumes_blend_over_the_last_cell() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let center = Vec3::new(2.0, 1.5, 2.5);
        let scaled = of_two_lights(world, center, quick());
        // The window reaches 0.5 m; its last cell begins at 0.3.
        for (off, expected) in [(0.0, 1.0), (0.29, 1.0), (0.35, 1.5), (0.4, 2.0), (0.45, 2.5), (0.5, 3.0), (0.8, 3.0)] {
            for axis in Vec3::AXES {
                let found = ask(&scaled, world, center - axis * off);
                // Powers of the encoding.
                assert!((found - expected).abs() < 1e-4, "{axis} {off}: {found}");
            }
        }
    });
}

#[test]
fn nothing_jumps_when_a_plane_leapfrogs() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let center = Vec3::new(1.5, 1.5, 2.5);
        let largest_step = |blends_at_camera| {
            let mut scaled = of_two_lights(world, center, Settings { blends_at_camera, ..quick() });
            // The camera goes 1 m in steps of 1 cm past a point, its window leapfrogging four times or five.
            let light: Vec<f32> = (0..=100)
                .map(|step| {
                    scaled.volumes[0].follow(Some(center + Vec3::X * 0.01 * step as f32));
                    // New planes are at once as good as the others: what is left is blending.
                    scaled.volumes[0].probes.fill(Probe { state: State::Vigilant, ..Probe::NEW });
                    ask(&scaled, world, center + Vec3::X * 0.6)
                })
                .collect();
            // It comes into the window.
            assert!(light[0] == 3.0 || (light[0] - 3.0).abs() < 1e-4);
            assert!((light[60] - 1.0).abs() < 1e-4, "{}", light[60]);
            light.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max)
        };
        let (at_camera, at_window) = (largest_step(true), largest_step(false));
        eprintln!("largest step of a light of 1 to 3: {at_camera} around the camera, {at_window} around the window");
        // A step is 1/20 of a cell, over which light changes by 2.
        assert!(at_camera < 0.1 + 1e-3, "{at_camera}");
        // A leap is a cell.
        assert!(at_window > 0.9, "{at_window}");
    });
}
