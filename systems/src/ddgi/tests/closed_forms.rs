//! Light that is known in closed form.

use super::super::{Ddgi, KIND, Settings};
use crate::irradiance_probes::test_scenes::linear_sky;
use crate::irradiance_probes::{BackFaces, MapSizes};
use crate::test_worlds::{furnace, furnace_points, in_world, lit_plane, settle};
use crate::{Feedback, ProbeGrid, Query, Setup, Shaded, System, World};
use glam::{UVec3, Vec3};
use localprt_scenes::{Lighting, SurfacePoint};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Greatest share by which red irradiance at the furnace's points is off.
fn furnace_error(ddgi: &Ddgi, world: &World<'_>, expected: f32) -> f32 {
    let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
    let irradiance = ddgi.irradiance(world, &Query::of(&points));
    irradiance.iter().map(|value| (value.x / expected - 1.0).abs()).fold(0.0, f32::max)
}

fn at(position: Vec3, normal: Vec3) -> Shaded {
    Shaded::from_above(SurfacePoint { position, normal, geometric_normal: normal })
}

#[test]
fn a_furnace_settles_at_every_bounce() {
    // In a frame 0.2 + 0.8 x 0.5 of what is missing stays: 5e-6 of it after 24.
    let settings = Settings { hysteresis: 0.2, ..Settings::default() };
    in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
        let prepared = || Ddgi::over(world.bounds(), 27, settings, 1);
        let mut first = prepared();
        settle(&mut first, world, Feedback::Nothing, 1);
        // Means by weight of equal values, up to f32 sums over 128 rays.
        assert!(furnace_error(&first, world, PI) < 1e-5);
        let mut second = prepared();
        settle(&mut second, world, Feedback::Of(&first), 1);
        assert!(furnace_error(&second, world, 1.5 * PI) < 1e-5);
        let mut all = prepared();
        settle(&mut all, world, Feedback::Own, 24);
        assert!(furnace_error(&all, world, 2.0 * PI) < 1e-4, "{}", furnace_error(&all, world, 2.0 * PI));
        assert!(furnace_error(&all, world, 1.5 * PI) > 0.1, "the check would see a missing bounce");
    });
}

#[test]
fn probes_on_the_walls_would_see_outside() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        let mut on_walls = Ddgi::over(world.bounds(), 64, Settings { inset: 0.0, ..Settings::default() }, 1);
        settle(&mut on_walls, world, Feedback::Nothing, 1);
        // A probe in an edge of the room sees a quarter of all directions inside, one on a wall a half.
        let error = furnace_error(&on_walls, world, PI);
        assert!(error > 0.25, "{error}");
    });
}

#[test]
fn light_of_a_linear_sky_has_its_direction() {
    let (scene, lighting) = linear_sky();
    in_world(&scene, &lighting, |world| {
        let grid = ProbeGrid { low: Vec3::ZERO, spacing: Vec3::ONE, size: UVec3::splat(2) };
        let mut ddgi = Ddgi::new(grid, Settings { hysteresis: 0.9, ..Settings::default() }, 1);
        settle(&mut ddgi, world, Feedback::Own, 30);
        for normal in Vec3::AXES.into_iter().chain([Vec3::new(0.6, 0.8, 0.0), Vec3::NEG_Y]) {
            let point = [at(Vec3::splat(0.4), normal)];
            let found = ddgi.irradiance(world, &Query::of(&point))[0].x;
            // What bilinear reads of 8 x 8 texels miss of the slope 1/3, found in `irradiance_probes/maps`: up to 0.07 of 0.56.
            assert!((found * FRAC_1_PI - 1.0 - normal.y / 3.0).abs() < 0.04, "{normal}: {found}");
        }
    });
}

/// Share of the cosine-weighted hemisphere that looks down from a point, that the plane of 10 m fills.
fn plane_share(point: Vec3) -> f32 {
    let corner = |a: f32, b: f32| {
        let (a, b) = (a / point.y, b / point.y);
        let (s, t) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        (a / s * (b / s).atan() + b / t * (a / t).atan()) / TAU
    };
    let sides = |x: f32| [5.0 - x, 5.0 + x];
    sides(point.x).iter().flat_map(|&a| sides(point.z).map(|b| corner(a, b))).sum()
}

#[test]
fn a_lit_plane_is_seen_from_the_air() {
    let albedo = 0.6;
    let (scene, lighting) = lit_plane(albedo);
    in_world(&scene, &lighting, |world| {
        let grid = ProbeGrid { low: Vec3::new(-3.0, 0.5, -3.0), spacing: Vec3::splat(1.5), size: UVec3::new(5, 3, 5) };
        let mut ddgi = Ddgi::new(grid, Settings { hysteresis: 0.8, sizes: MapSizes::TEST, ..Settings::default() }, 1);
        settle(&mut ddgi, world, Feedback::Own, 20);
        let ask = |point| ddgi.irradiance(world, &Query::of(&[point]))[0].x;
        // Above the plane there is sky alone. Texels near the zenith lean by 10 degrees and see (1 - cos 10) / 2 of the plane.
        let up = ask(at(Vec3::new(0.2, 0.0, -0.1), Vec3::Y));
        assert!((up / PI - 1.0).abs() < 0.01, "{up}");
        // At a probe, where none other counts: the plane, whose radiance is its albedo, and the sky beside it.
        for position in [Vec3::new(0.0, 0.5, 0.0), Vec3::new(1.5, 2.0, -1.5), Vec3::new(0.0, 3.5, 1.5)] {
            let share = plane_share(position);
            let expected = PI * (share * albedo + 1.0 - share);
            let down = ask(at(position, Vec3::NEG_Y));
            // Straight down is a vertex of the mapping, too: a texel's lean, times the slope of radiance.
            assert!((down / expected - 1.0).abs() < 0.03, "{position}: {down} {expected}");
            assert!((down / PI - 1.0).abs() > 0.1, "not the sky");
        }
    });
}

#[test]
fn probes_outside_stay_dark_because_backs_are_not_culled() {
    in_world(&furnace(0.0, 1.0), &Lighting::default(), |world| {
        // Outside, looking at the black back of a wall.
        let outside = [at(Vec3::new(-0.8, 1.5, 2.5), Vec3::X)];
        let ask = |backs| {
            let grid = ProbeGrid { low: Vec3::new(-1.25, 0.5, 0.5), spacing: Vec3::ONE, size: UVec3::new(6, 3, 5) };
            let mut ddgi = Ddgi::new(grid, Settings { backs, ..Settings::default() }, 1);
            settle(&mut ddgi, world, Feedback::Own, 4);
            ddgi.irradiance(world, &Query::of(&outside))[0].x
        };
        let (black, culled) = (ask(BackFaces::Black), ask(BackFaces::Culled));
        // Its cage is outside altogether and sees backs and the black sky.
        assert_eq!(black, 0.0);
        assert!(culled > 1.0, "{culled}");
    });
}

#[test]
fn frames_are_the_same_on_any_number_of_threads() {
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(|| {
            in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
                let setup = Setup { probes: 30, cameras: &[], seed: 9 };
                let mut ddgi = (KIND.prepare)(world, &setup);
                settle(&mut *ddgi, world, Feedback::Own, 3);
                let points: Vec<_> = furnace_points().into_iter().map(Shaded::from_above).collect();
                assert!(ddgi.probes() <= 30 && ddgi.bytes() == KIND.probe_bytes * ddgi.probes() as u64);
                ddgi.irradiance(world, &Query::of(&points))
            })
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn work_counts_what_a_frame_does() {
    let scene = localprt_scenes::builtin::scene("cornell").expect("cornell");
    in_world(&scene, &Lighting::of_scene(&scene), |world| {
        let mut ddgi = Ddgi::over(world.bounds(), 8, Settings { rays: 32, ..Settings::default() }, 1);
        let frame = crate::Frame { world, number: 0, camera: None, feedback: Feedback::Own, events: &[], still: false };
        let work = ddgi.update(&frame);
        assert_eq!((work.probes, work.rays, work.texels), (8, 8 * 32, 8 * (100 + 324)));
        // One lamp: a shadow ray from each surface that faces it. Some rays leave by the open front.
        assert!(work.shadow_rays > 64 && work.shadow_rays < work.rays, "{work:?}");
    });
}
