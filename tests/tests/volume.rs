//! Light in the open space, for objects that move.

use glam::Vec3;
use localprt_precompute::settings::{BakeSettings, Transport};
use localprt_runtime::Validity;
use localprt_scenes::{Lighting, Material, Mesh, Scene, Sky, builtin::furnace_irradiance};
use localprt_tests::{TRANSPORTS, bake, irradiance, mean, relit, scene, small_settings};
use serde_json::Value;
use std::f32::consts::PI;

#[test]
fn the_volume_of_the_furnace_settles_at_the_light_of_its_surface() {
    for volume_degree in [1, 2] {
        let settings = BakeSettings { volume: Some(0.45), volume_degree, threshold: 0.001, ..small_settings() };
        let baked = bake(scene("furnace"), &settings);
        let volume = baked.report.volume.expect("a volume");
        assert!(volume.receivers > 0 && volume.invalid == volume.filled, "{volume:?}");
        let expected = furnace_irradiance(None) as f32;
        relit(&baked, &Lighting::of_scene(&baked.scene), 20, |gi| {
            let sampler = gi.volume_sampler().expect("a volume");
            let grid = *gi.volume_cells().expect("a volume").grid();
            let mut found = Vec::new();
            for cell in 0..grid.n_cells() as usize {
                for normal in [Vec3::X, Vec3::Y, Vec3::NEG_Z, Vec3::new(0.48, -0.6, 0.64)] {
                    // Between cells, too.
                    let position = Vec3::from(grid.position(cell)) + 0.3 * grid.spacing_m;
                    found.push(sampler.irradiance_at(position, normal).expect("all cells are filled"));
                }
            }
            // Gram error of 2000 relight rays, amplified by 1 / (1 - a) = 2.
            let average = mean(found.iter().copied());
            assert!((average / expected - 1.0).abs() < 0.005, "degree {volume_degree}: {average} {expected}");
            // A row is off by 0.001 RMS, so a coefficient by 0.001 sqrt(16 probes) sqrt(4 pi) L = 0.014 L, and E, whose
            // weights for 9 coefficients have the norm 1.44, by 0.02 L = 0.65 % of pi L; three of that.
            let worst = found.iter().map(|value| (value.y / expected - 1.0).abs()).fold(0.0, f32::max);
            assert!(worst < 0.02, "degree {volume_degree}: {worst}");
        });
    }
}

/// Two small triangles that face each other across a cube of 2 m: nearly nothing but sky.
fn two_specks() -> Scene {
    let corner = |sign: f32| {
        let tip = Vec3::splat(sign);
        [tip, tip - 0.05 * sign * Vec3::X, tip - 0.05 * sign * Vec3::Y]
    };
    let positions: Vec<Vec3> = [corner(-1.0), corner(1.0)].concat();
    let mut triangles = vec![[0, 1, 2], [3, 4, 5]];
    for (triangle, toward) in triangles.iter_mut().zip([Vec3::Z, Vec3::NEG_Z]) {
        let [a, b, c] = triangle.map(|index: u32| positions[index as usize]);
        if (b - a).cross(c - a).dot(toward) < 0.0 {
            triangle.swap(1, 2);
        }
    }
    let normals = vec![Vec3::Z, Vec3::Z, Vec3::Z, Vec3::NEG_Z, Vec3::NEG_Z, Vec3::NEG_Z];
    let mesh = Mesh { positions, normals, triangles, ..Mesh::default() };
    Scene { meshes: vec![mesh], materials: vec![Material::default()], ..Scene::default() }
}

#[test]
fn a_constant_sky_is_radiance_without_direction() {
    let settings = BakeSettings { volume: Some(1.0), volume_degree: 2, gather_rays: 1024, ..small_settings() };
    let baked = bake(two_specks(), &settings);
    let sky = Vec3::new(0.5, 1.0, 2.0);
    relit(&baked, &Lighting { sky: Sky::Constant(sky), ..Lighting::default() }, 1, |gi| {
        let volume = gi.volume_cells().expect("a volume");
        assert_eq!(volume.grid().dims, [3, 3, 3]);
        let cells = gi.volume().expect("a volume");
        let mut n_valid = 0;
        for (cell, values) in cells.chunks_exact(9).enumerate() {
            if volume.validity()[cell] != Validity::Valid {
                continue;
            }
            n_valid += 1;
            let constant = (4.0 * PI).sqrt() * sky;
            // At most one of 1024 rays meets a speck; two f16 factors.
            assert!((values[0] / constant - Vec3::ONE).abs().max_element() < 3e-3, "{cell}: {}", values[0]);
            for value in &values[1..] {
                // The lattice of 1024 directions is orthogonal within 2e-3.
                assert!((*value / constant).abs().max_element() < 5e-3, "{cell}: {value}");
            }
        }
        assert!(n_valid >= 20, "{n_valid}");
        let irradiance = gi.volume_sampler().expect("a volume").irradiance_at(Vec3::splat(0.2), Vec3::Y);
        let found = irradiance.expect("valid cells") / (PI * sky);
        assert!((found - Vec3::ONE).abs().max_element() < 0.01, "{found}");
    });
}

#[test]
fn a_sealed_dark_room_stays_exactly_dark() {
    TRANSPORTS.into_iter().for_each(stays_exactly_dark);
}

fn stays_exactly_dark(transport: Transport) {
    let room = BakeSettings { probes: Some(24), lightmap: Some(64), transport, ..small_settings() };
    let settings = BakeSettings { volume: Some(0.4), volume_degree: 1, ..room };
    let baked = bake(scene("two-rooms"), &settings);
    let lighting = Lighting::of_scene(&baked.scene);
    // The lamp is in the left room, the wall between the rooms stands at x = 0.
    assert!(lighting.lights[0].position.x < 0.0);
    let lit = mean(irradiance(&baked, &lighting, 3));
    relit(&baked, &lighting, 3, |gi| {
        let volume = gi.volume_cells().expect("a volume");
        let (mut n_lit, mut n_dark) = (0, 0);
        for (cell, values) in gi.volume().expect("a volume").chunks_exact(4).enumerate() {
            let x = volume.grid().position(cell)[0];
            if volume.validity()[cell] != Validity::Valid {
                continue;
            }
            let brightest = values.iter().map(|value| value.abs().max_element()).fold(0.0, f32::max);
            if x > 0.0 {
                n_dark += 1;
                assert!(brightest == 0.0, "cell {cell} at x = {x}: {brightest}, receivers have {lit}");
            } else {
                n_lit += 1;
                assert!(values[0].min_element() > 0.0, "cell {cell} at x = {x}");
            }
        }
        assert!(n_lit > 50 && n_dark > 50, "{n_lit} {n_dark}");
    });
}

#[test]
fn a_volume_changes_nothing_else() {
    let settings = small_settings();
    let mut with = bake(scene("cornell"), &BakeSettings { volume: Some(0.4), ..settings.clone() }).arrays;
    let mut without = bake(scene("cornell"), &settings).arrays;
    assert!(with.volume.take().is_some() && without.volume.is_none());
    // The options, the report and the plan tell of it.
    assert_ne!(with.metadata.options, without.metadata.options);
    without.metadata.options.clone_from(&with.metadata.options);
    without.report.clone_from(&with.report);
    let [mut told, plan] = [&with.plan, &without.plan].map(|plan| serde_json::from_str::<Value>(plan).expect("a plan"));
    assert!(told.as_object_mut().expect("fields").remove("volume_radius_m").is_some());
    assert_eq!(told, plan);
    without.plan.clone_from(&with.plan);
    assert!(with == without);
}
