//! What the method cannot do, as numbers.

use super::*;
use crate::test_worlds::{furnace, furnace_points, in_world, lit_plane, settle};

const EYE: Vec3 = Vec3::new(2.0, 1.5, 2.5);

#[test]
fn a_turning_camera_brings_the_furnace_near_to_its_light() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let of_pi = |rule, points: &[SurfacePoint]| {
            let mut system = system(world, &all_around(EYE), 200, screen_only(by(rule, 0.4)));
            settle(&mut system, world, Feedback::Nothing, 200);
            irradiance(&system, world, points).iter().map(|light| light / PI).collect::<Vec<f32>>()
        };
        // Amid the room all directions are on screen in turn. The error finds no noise in a constant, the filter does.
        let amid: Vec<SurfacePoint> =
            Vec3::AXES.iter().flat_map(|&axis| [axis, -axis]).map(|n| at(EYE.into(), n)).collect();
        let (error, filter) = (of_pi(Rule::Error, &amid), of_pi(Rule::Filter, &amid));
        assert!(error.iter().all(|share| (share - 1.0).abs() < 0.02), "{error:?}");
        assert!((mean(&filter) - 1.0).abs() < 0.05, "{filter:?}");
        // On the walls, half of the probes around a point are outside of the room and see no more than half of all directions. The error
        // still leads to the constant, from below: in directions that are seldom seen slowly.
        let (error, filter) = (of_pi(Rule::Error, &furnace_points()), of_pi(Rule::Filter, &furnace_points()));
        assert!(error.iter().all(|&share| share > 0.8 && share < 1.02) && mean(&error) > 0.93, "{error:?}");
        // The filter takes the other half to look the same, so that irradiance about the middle of the seen half is twice what it is.
        assert!(filter.iter().all(|&share| share > 0.9 && share < 2.05) && mean(&filter) > 1.25, "{filter:?}");
    });
}

#[test]
fn bounces_by_the_filter_grow_without_end_between_bright_walls() {
    in_world(&furnace(0.8, 1.0), &Lighting::default(), |world| {
        let after = |rule| {
            let mut system = system(world, &all_around(EYE), 100, screen_only(by(rule, 0.4)));
            [0..100, 100..200, 200..300].map(|frames| {
                run(&mut system, world, Feedback::Own, frames);
                mean(&irradiance(&system, world, &furnace_points())) / PI
            })
        };
        // All bounces are 1 / (1 - 0.8) = 5.
        let (error, filter) = (after(Rule::Error), after(Rule::Filter));
        assert!(error[0] < error[1] && error[1] < error[2] && error[2] < 5.0, "{error:?}");
        assert!(filter[2] > 5.0 * 1.5 && filter[2] - filter[1] > 0.5 * (filter[1] - filter[0]), "{filter:?}");
    });
}

#[test]
fn a_lit_plane_is_bright_from_above_and_leaks_from_below() {
    let (scene, lighting) = lit_plane(0.5);
    in_world(&scene, &lighting, |world| {
        let camera = look(Vec3::new(0.0, 6.0, 8.0), Vec3::ZERO, 60.0);
        let points = [at([0.0, 0.0, 0.0], Vec3::Y), at([0.0, 2.0, 0.0], Vec3::NEG_Y)];
        let of_pi = |occlusion| {
            let settings = Settings { occlusion, ..Settings::default() };
            let mut system = system(world, std::slice::from_ref(&camera), 200, settings);
            settle(&mut system, world, Feedback::Nothing, 100);
            let light = irradiance(&system, world, &points);
            [light[0] / PI, light[1] / PI]
        };
        let (free, traced) = (of_pi(false), of_pi(true));
        // Looking up, pi: less what the dark plane takes of the sky in the mean. With rays, probes below the plane have half a sky.
        assert!(free[0] > 0.8 && free[0] < 1.0, "{free:?}");
        assert!(traced[0] > 0.5 && traced[0] < 1.0, "{traced:?}");
        // Looking down there is nothing in the first bounce but the sky through the plane, which rays take away but for its edges.
        assert!(free[1] > 0.6 && traced[1] < 0.4 * free[1], "{free:?} {traced:?}");
    });
}

#[test]
fn light_in_a_sealed_room_leaks_without_occlusion_rays_alone() {
    let (scene, lighting, points) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let views = all_around(Vec3::new(-1.5, 1.3, 0.0));
        let truth: Vec<f32> = points.iter().map(|point| gathered(world, point)).collect();
        assert_eq!(truth[3..], [0.0; 3]);
        let lit = |rule, occlusion| {
            let mut system = system(world, &views, 300, Settings { occlusion, ..by(rule, 0.4) });
            settle(&mut system, world, Feedback::Nothing, 36);
            irradiance(&system, world, &points)
        };
        let (error, filter, traced) = (lit(Rule::Error, false), lit(Rule::Filter, false), lit(Rule::Filter, true));
        // A sixth of the lit room's light and more reaches the one next door.
        assert!(mean(&error[3..]) > mean(&truth[..3]) / 6.0, "{error:?}");
        assert!(mean(&filter[3..]) > mean(&truth[..3]) / 6.0, "{filter:?}");
        // None does with rays, where no probe around the point stands in the lit room.
        assert_eq!(traced[3..], [0.0; 3]);
        // In the lit room the error leads to the truth: 3 % of noise, and after six rounds of six views some is on its way. The filter is
        // between the truth and its double, as some probes are behind the walls; with rays these are dark, which makes up for it.
        let lit = |light: &[f32]| mean(&light[..3]) / mean(&truth[..3]);
        assert!((lit(&error) - 1.0).abs() < 0.15, "{error:?} {truth:?}");
        assert!(lit(&filter) > 1.1 && lit(&filter) < 2.0, "{filter:?} {truth:?}");
        assert!((lit(&traced) - 1.0).abs() < 0.25, "{traced:?} {truth:?}");
    });
}

#[test]
fn light_that_leaves_the_screen_fades() {
    let scene = panel_over_floor(10.0);
    in_world(&scene, &Lighting::default(), |world| {
        let eye = Vec3::new(0.0, 1.5, 7.0);
        let [panel, floor, void] =
            [[0.0, 1.5, 0.0], [0.0, -1.0, 3.0], [0.0, 1.5, 9.0]].map(|target| look(eye, Vec3::from(target), 50.0));
        // Probes around it are above the floor. Below, where no sample of the floor looks at them, they keep the panel's light.
        let point = at([0.0, 2.2, 0.0], Vec3::Y);
        // Shares of the light that are left so many frames after the panel went off screen.
        let faded = |rule, frames: [u64; 3]| {
            let mut system = system(world, &[], 200, screen_only(by(rule, 0.4)));
            watch(&mut system, world, &panel, 0..60);
            let full = irradiance(&system, world, &[point])[0];
            // With nothing on screen nothing changes.
            watch(&mut system, world, &void, 60..80);
            assert_eq!(irradiance(&system, world, &[point])[0], full);
            let mut now = 80;
            frames.map(|frame| {
                watch(&mut system, world, &floor, now..80 + frame);
                now = 80 + frame;
                irradiance(&system, world, &[point])[0] / full
            })
        };
        let (filter, error) = (faded(Rule::Filter, [10, 20, 40]), faded(Rule::Error, [10, 40, 160]));
        // The filter forgets at the rate of what it sees: h w / 4 pi of the light goes with each frame, where samples cover w sr.
        assert!(filter[0] < 0.7 && filter[1] < 0.4 && filter[2] < 0.1 && filter[2] > 1e-4, "{filter:?}");
        assert!((filter[1] * filter[1] / filter[2]).ln().abs() < 1.0, "exponential: {filter:?}");
        // Correcting the error only corrects the directions that are seen.
        assert!(error[0] > 0.7 && error[2] > 0.5, "{error:?}");
    });
}

#[test]
fn light_depends_on_the_view() {
    let (scene, lighting, points) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let views = all_around(Vec3::new(-1.5, 1.3, 0.0));
        let seen = |views: &[Camera]| {
            let mut system = system(world, views, 100, by(Rule::Filter, 0.2));
            settle(&mut system, world, Feedback::Nothing, 60);
            mean(&irradiance(&system, world, &points[..3]))
        };
        // Nothing changes but where the camera looks: at the party wall, at the ceiling above the lamp, at the floor, whose light goes up
        // and so is none of the floor's.
        let [wall, ceiling, floor] = [0, 2, 3].map(|view| seen(&views[view..view + 1]));
        assert!(ceiling > 1.5 * wall && wall > 1.5 * floor, "{wall} {ceiling} {floor}");
    });
}

#[test]
fn light_moves_with_the_grid_until_samples_correct_it() {
    let scene = panel_over_floor(10.0);
    in_world(&scene, &Lighting::default(), |world| {
        let mut system = system(world, &[], 400, screen_only(by(Rule::Filter, 0.2)));
        let step = system.cascades.grids()[1].spacing.x;
        let seen_from = |x: f32, target: Vec3| look(Vec3::new(x, 1.0, 7.0), target, 60.0);
        let middle = Vec3::new(0.0, 1.0, 0.0);
        watch(&mut system, world, &seen_from(0.0, middle), 0..60);
        // Below the panel's edge, and a step of the wider grid aside.
        let [here, aside] = [1.0, 1.0 + step].map(|x| at([x, 1.0, 0.0], Vec3::Y));
        let before = irradiance(&system, world, &[here, aside]);
        // The camera moves by that step and looks away.
        watch(&mut system, world, &seen_from(step, Vec3::new(step, 1.0, 9.0)), 60..61);
        let after = irradiance(&system, world, &[here, aside]);
        watch(&mut system, world, &seen_from(step, middle), 61..160);
        let later = irradiance(&system, world, &[here, aside]);
        // What was here is aside: rounding of positions over cells.
        assert!((after[1] / before[0] - 1.0).abs() < 1e-4, "{before:?} {after:?}");
        assert!((after[1] / before[1] - 1.0).abs() > 0.3, "{before:?} {after:?}");
        // Then it is corrected, to what the new view gives.
        let left = (later[1] / before[1]).ln().abs();
        assert!(left < 0.5 * (after[1] / before[1]).ln().abs(), "{before:?} {after:?} {later:?}");
    });
}
