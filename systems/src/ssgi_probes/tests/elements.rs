//! What the method has: each test fails without its element.

use super::*;
use crate::test_worlds::{furnace, in_world, lit_plane, settle};
use localprt_scenes::Sky;
use projection::Sums;

#[test]
fn probes_learn_from_all_that_is_on_screen() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let camera = look(Vec3::new(2.0, 1.5, 2.5), Vec3::new(0.0, 1.2, 0.0), 90.0);
        let settings = Settings { jitter: false, ..screen_only(Settings::default()) };
        let setup = Setup { probes: 300, cameras: &[], seed: 1 };
        let mut system = SsgiProbes::new(world, &setup, settings);
        let frame =
            Frame { world, number: 0, camera: Some(&camera), feedback: Feedback::Nothing, events: &[], still: false };
        let work = system.update(&frame);
        let n = system.probes() as u64;
        assert!(n <= 300 && n > 150);
        assert_eq!(work, Work { rays: 400, texels: 27 * n, probes: n, ..Work::default() });
        assert_eq!(system.bytes(), 56 * n);
        // Each holds the light of all samples that face it, by one step from nothing.
        let (samples, _) = settings.frame_buffer.samples(&system, &frame, &camera, system.key(&frame, Purpose::Pixels));
        assert_eq!(samples.len(), 400);
        for probe in 0..system.probes() {
            let place = system.cascades.position(probe, None);
            let seen = samples.iter().filter_map(|sample| sample.arriving(place));
            let sums = Sums::of(&system.basis, seen, None);
            // Of these probes none is so near to a wall that the step is cut.
            let expected = sums.projected.0[0].x * settings.filter.hysteresis;
            let found = system.coefficients[probe].0[0].x;
            // Half precision.
            assert!((found - expected).abs() <= expected * 2f32.powi(-11), "{probe}: {found} {expected}");
        }
        assert!(system.coefficients.iter().filter(|own| own.0[0].x > 0.0).count() > system.probes() / 2);
        // Occlusion takes a ray per probe and sample that faces it.
        let mut traced = SsgiProbes::new(world, &setup, Settings { occlusion: true, ..settings });
        let facing = |probe| samples.iter().filter(|sample| sample.arriving(probe).is_some()).count() as u64;
        let rays: u64 = (0..traced.probes()).map(|probe| facing(traced.cascades.position(probe, None))).sum();
        assert_eq!(rays + 400, traced.update(&frame).rays);
    });
}

#[test]
fn coefficients_are_kept_in_half_precision() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let mut system = system(world, &all_around(Vec3::new(2.0, 1.5, 2.5)), 100, Settings::default());
        settle(&mut system, world, Feedback::Own, 7);
        for own in &system.coefficients {
            assert_eq!(own, &in_half_precision(own));
        }
        // 1 + 2^-12 is none of theirs, and 10^6 is beyond them.
        let third = in_half_precision(&Coefficients([Vec3::new(1.0 + 2f32.powi(-12), 1e6, -1e6); FUNCTIONS]));
        assert_eq!(third.0[0], Vec3::new(1.0, LARGEST_F16, -LARGEST_F16));
    });
}

#[test]
fn frames_without_a_camera_take_those_of_the_setup_in_turn() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        // The first looks out of the room, in which nothing else is.
        let away = look(Vec3::new(9.0, 1.5, 2.5), Vec3::new(12.0, 1.5, 2.5), 50.0);
        let inside = look(Vec3::new(2.0, 1.5, 2.5), Vec3::new(0.0, 1.5, 2.5), 50.0);
        let point = [at([2.0, 1.5, 2.5], Vec3::NEG_X)];
        let mut seen = system(world, &[away, inside], 100, screen_only(Settings::default()));
        settle(&mut seen, world, Feedback::Nothing, 1);
        assert_eq!(irradiance(&seen, world, &point), [0.0]);
        run(&mut seen, world, Feedback::Nothing, 1..2);
        assert!(irradiance(&seen, world, &point)[0] > 0.0);
        // Without any there is no screen.
        let mut blind = system(world, &[], 100, screen_only(Settings::default()));
        settle(&mut blind, world, Feedback::Nothing, 3);
        assert_eq!(irradiance(&blind, world, &point), [0.0]);
    });
}

#[test]
fn bounces_come_with_the_frames() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let views = all_around(Vec3::new(2.0, 1.5, 2.5));
        let settled = |feedback: Feedback<'_>, frames| {
            let mut system = system(world, &views, 100, screen_only(by(Rule::Error, 0.4)));
            settle(&mut system, world, feedback, frames);
            mean(&irradiance(&system, world, &crate::test_worlds::furnace_points()))
        };
        let (first, all) = (settled(Feedback::Nothing, 200), settled(Feedback::Own, 200));
        // All bounces are 1 / (1 - 0.5) of the first one. Where that has come to a share s of its light, walls seem to have an albedo of
        // 0.5 s: (1 - 0.5) / (1 - 0.5 s) of it, 4 % less at s = 0.96, and as much again is on its way.
        assert!(all / first > 1.8 && all / first < 2.0, "{first} {all}");
        // In time: not in the first frames.
        let early = settled(Feedback::Own, 6) / settled(Feedback::Nothing, 6);
        assert!(early < 1.2, "{early}");
    });
}

#[test]
fn the_sky_is_injected() {
    let (scene, mut lighting) = lit_plane(0.5);
    let points = [Vec3::Y, Vec3::X, Vec3::NEG_Y].map(|normal| at([0.0, 2.0, 0.0], normal));
    let sky = Sky::Gradient { zenith: Vec3::splat(3.0), horizon: Vec3::splat(1.0), ground: Vec3::ZERO };
    lighting.sky = sky.clone();
    in_world(&scene, &lighting, |world| {
        let mut lit = system(world, &[], 60, by(Rule::Filter, 0.02));
        settle(&mut lit, world, Feedback::Nothing, 600);
        let basis = Basis::new(DEGREE);
        let samples =
            sky.quadrature().map(|(dir, solid_angle_sr, radiance)| Arriving { dir, solid_angle_sr, radiance });
        let exact = Sums::of(&basis, samples, None).projected;
        for (point, found) in points.iter().zip(irradiance(&lit, world, &points)) {
            let expected = exact.irradiance(point.normal).x;
            // Nothing hides the sky, not even the plane. Sixteen random directions would be off by a third, of which a filter of 0.02 lets
            // through a tenth and the mean of eight probes a third of that: three of these, as even sets are better.
            assert!((found / expected - 1.0).abs() < 0.035, "{} {found} {expected}", point.normal);
        }
        let mut dark = system(world, &[], 100, screen_only(Settings::default()));
        settle(&mut dark, world, Feedback::Nothing, 10);
        assert_eq!(irradiance(&dark, world, &points), [0.0; 3]);
    });
}

#[test]
fn emissive_surfaces_off_screen_are_injected() {
    let scene = panel_over_floor(10.0);
    in_world(&scene, &Lighting::default(), |world| {
        // The floor is on screen, the panel is not.
        let camera = look(Vec3::new(0.0, 2.0, 7.0), Vec3::new(0.0, 0.0, 1.0), 40.0);
        let point = at([0.0, 0.0, 0.0], Vec3::Y);
        let lit = |weight: f32| {
            let mut settings = by(Rule::Filter, 0.1);
            settings.sources.weight = weight;
            let mut system = system(world, std::slice::from_ref(&camera), 200, settings);
            settle(&mut system, world, Feedback::Nothing, 150);
            irradiance(&system, world, &[point])[0]
        };
        // A square of half side 1 at height 3, Le 10: 4 Le atan(1 / sqrt 10) / sqrt 10.
        let truth = 40.0 * (1.0 / 10f32.sqrt()).atan() / 10f32.sqrt();
        assert!((gathered(world, &point) / truth - 1.0).abs() < 0.01);
        assert_eq!(lit(0.0), 0.0);
        // The filter takes all directions to look like the floor and the panel, which together are a quarter of them: four times too
        // bright, until the "magic number" makes up for it.
        let (even, tuned) = (lit(1.0) / truth, lit(0.2) / truth);
        assert!(even > 3.0 && even < 6.0, "{even}");
        assert!(tuned > 0.7 && tuned < 1.3, "{tuned}");
    });
}

#[test]
fn cascades_reach_far() {
    let mut scene = Scene { name: "far".into(), materials: vec![shine(0.1), shine(4.0)], ..Scene::default() };
    scene.meshes = vec![level(10.0, -20.0..8.0, 0.0, 0), level(10.0, 8.0..20.0, 0.0, 1)];
    in_world(&scene, &Lighting::default(), |world| {
        let camera = look(Vec3::new(-18.0, 2.0, 0.0), Vec3::ZERO, 60.0);
        let settings = Settings { cascades: 3, ..screen_only(by(Rule::Filter, 0.4)) };
        let mut system = system(world, std::slice::from_ref(&camera), 600, settings);
        watch(&mut system, world, &camera, 0..60);
        let finest = system.cascades.grids()[0];
        let border = finest.low.x + finest.spacing.x * (finest.size.x - 1) as f32;
        let light = irradiance(&system, world, &[border, 16.0].map(|x| at([x, 2.0, 0.0], Vec3::NEG_Y)));
        // The finest one ends over the dim end of the floor, whose radiance is a fortieth of that of the bright one.
        assert!(border < 0.0 && light[1] > 10.0 * light[0], "{border} {light:?}");
    });
}

#[test]
fn jitter_takes_the_grid_out_of_the_light() {
    // A bright strip, half a metre above which probes are; it, and the point that looks at it, move by a cell.
    let lit = |jitter: bool, shift: f32| {
        let materials = vec![shine(1.0), shine(100.0), shine(0.0)];
        let mut scene = Scene { name: "strip".into(), materials, ..Scene::default() };
        let strip = |from: f32, to: f32, material| level(8.0, from + shift..to + shift, 1.5, material);
        scene.meshes = vec![strip(-8.0, -0.1, 0), strip(-0.1, 0.1, 1), strip(0.1, 8.0, 0)];
        // For bounds of 4 m, and so a row of probes at 2 m.
        scene.meshes.extend([0.0, 4.0].map(|height| level(1.0, shift - 1.0..shift + 1.0, height, 2)));
        in_world(&scene, &Lighting::default(), |world| {
            let settings = Settings { jitter, cascades: 1, ..by(Rule::Filter, 0.05) };
            let mut system = system(world, &[], 300, settings);
            settle(&mut system, world, Feedback::Nothing, 120);
            irradiance(&system, world, &[at([shift, 2.0, 0.0], Vec3::NEG_Y)])[0]
        })
    };
    let over_cell = |jitter: bool| {
        let light: Vec<f32> = (0..6).map(|step| lit(jitter, step as f32 * 0.3)).collect();
        let (least, most) = light.iter().fold((f32::MAX, 0f32), |(least, most), at| (least.min(*at), most.max(*at)));
        most / least
    };
    let (fixed, jittered) = (over_cell(false), over_cell(true));
    // The light is the same everywhere. Whether a probe stands above the strip or beside it makes seven times as much of it; with jitter it
    // is 1.8, of which some is noise.
    assert!(fixed > 3.0 && jittered < 2.0, "{fixed} {jittered}");
}

#[test]
fn a_camera_outside_of_a_room_needs_probes_inside() {
    // The Cornell box, seen through its opening, first bounce at points of its floor and back wall.
    let scene = localprt_scenes::builtin::scene("cornell").expect("built in");
    let lighting = Lighting { lights: scene.lights.clone(), ..Lighting::default() };
    let mut points: Vec<SurfacePoint> = Vec::new();
    for [u, v] in [[-0.8, 0.2], [-0.2, 0.8], [0.0, 1.4], [0.3, 1.8], [0.8, 0.3], [0.9, 1.2]] {
        points.extend([at([u, 0.0, v - 0.9], Vec3::Y), at([u, v, -1.0], Vec3::Z)]);
    }
    in_world(&scene, &lighting, |world| {
        let truth: Vec<f32> = points.iter().map(|point| gathered(world, point)).collect();
        let bias = |within_scene: bool| {
            let settings = Settings { within_scene, ..Settings::COMPARED };
            let mut system = system(world, &scene.cameras, 125, settings);
            watch(&mut system, world, &scene.cameras[0], 0..120);
            mean(&irradiance(&system, world, &points)) / mean(&truth) - 1.0
        };
        let (inside, around) = (bias(true), bias(false));
        eprintln!("inside {inside}, around the camera {around}");
        // Found: 1.54 and 2.01. What is left is the method's: off screen is taken to look like what is on it.
        assert!(inside.abs() < 0.85 * around, "{inside} {around}");
    });
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let (scene, lighting, points) = two_rooms();
    in_world(&scene, &lighting, |world| {
        let lit = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let mut system = system(world, &scene.cameras, 60, Settings { occlusion: true, ..Settings::default() });
                settle(&mut system, world, Feedback::Own, 4);
                irradiance(&system, world, &points)
            })
        };
        assert_eq!(lit(1), lit(3));
        assert!(lit(1)[0] > 0.0);
    });
}

#[test]
fn kinds_prepare_not_more_probes_than_allowed() {
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let kinds = [SSGI_PROBES, SSGI_PROBES_ERROR, SSGI_PROBES_OCCLUSION];
        let names = kinds.each_ref().map(|kind| kind.name);
        assert_eq!(names, ["ssgi-probes", "ssgi-probes-error", "ssgi-probes-occlusion"]);
        for kind in kinds {
            let system = (kind.prepare)(world, &Setup { probes: 400, cameras: &[], seed: 1 });
            assert!(system.probes() <= 400 && system.probes() > 100);
            assert_eq!(system.bytes(), system.probes() as u64 * kind.probe_bytes);
        }
    });
}
