//! Light in a sealed room stays there.

use glam::{Quat, Vec3};
use localprt_formats::directions::spherical_fibonacci;
use localprt_precompute::{
    lightmap::Atlas,
    rays::RayCaster,
    settings::{BakeSettings, Transport},
};
use localprt_runtime::CoverageMap;
use localprt_scenes::{Lighting, Material, Mesh, Scene};
use localprt_tests::{TRANSPORTS, bake, irradiance, mean, relit, scene, small_settings};
use std::path::Path;

#[test]
fn light_in_a_sealed_room_stays_there() {
    TRANSPORTS.into_iter().for_each(stays_there);
}

fn stays_there(transport: Transport) {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), transport, ..small_settings() };
    let baked = bake(scene("two-rooms"), &settings);
    let lighting = Lighting::of_scene(&baked.scene);
    // The lamp is in the left room, the wall between the rooms stands at x = 0.
    assert!(lighting.lights[0].position.x < 0.0);
    let values = irradiance(&baked, &lighting, 3);
    let side = |left: bool| {
        values
            .iter()
            .zip(&baked.arrays.receiver_position)
            .filter(move |(_, position)| (position[0] < 0.0) == left)
            .map(|(value, _)| *value)
    };
    let lit = mean(side(true));
    assert!(lit > 0.0);
    let brightest = side(false).map(|value| value.max_element()).fold(0.0f32, f32::max);
    assert!(side(false).count() > 100);
    assert!(brightest <= 1e-6 * lit, "{transport:?}: dark room: {brightest}, lit room: {lit}");
}

#[test]
fn a_doorway_lets_light_through() {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), ..small_settings() };
    let baked = bake(scene("two-rooms-door"), &settings);
    let values = irradiance(&baked, &Lighting::of_scene(&baked.scene), 3);
    let dark = values.iter().zip(&baked.arrays.receiver_position).filter(|(_, position)| position[0] > 0.1);
    assert!(mean(dark.map(|(value, _)| *value)) > 0.0);
}

/// A box whose floor, ceiling and long walls are one piece each, with a wall of a thickness in metres across its middle and through
/// all of them, turned about the vertical axis.
fn closets(thickness_m: f32, turned: Quat) -> Scene {
    let quad = |mesh: &mut Mesh, corners: [Vec3; 4]| {
        let first = mesh.positions.len() as u32;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        mesh.positions.extend(corners);
        mesh.normals.extend([normal; 4]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    };
    // Faces of a box, outwards or inwards.
    let block = |low: Vec3, high: Vec3, inwards: bool| {
        let mut mesh = Mesh::default();
        for axis in 0..3 {
            for (side, at) in [(false, low[axis]), (true, high[axis])] {
                let corner = |u: f32, v: f32| {
                    let mut corner = Vec3::ZERO;
                    corner[axis] = at;
                    corner[(axis + 1) % 3] = u;
                    corner[(axis + 2) % 3] = v;
                    corner
                };
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                let mut corners = [
                    corner(low[u], low[v]),
                    corner(high[u], low[v]),
                    corner(high[u], high[v]),
                    corner(low[u], high[v]),
                ];
                if side == inwards {
                    corners.reverse();
                }
                quad(&mut mesh, corners);
            }
        }
        mesh
    };
    let half = Vec3::new(0.5 * thickness_m, 1.1, 1.7);
    let mut wall = block(Vec3::Y - half, Vec3::Y + half, false);
    wall.positions.iter_mut().chain(&mut wall.normals).for_each(|vector| *vector = turned * *vector);
    let meshes = vec![block(Vec3::new(-2.0, 0.0, -1.0), Vec3::new(2.0, 2.0, 1.0), true), wall];
    Scene { meshes, materials: vec![Material::default()], ..Scene::default() }
}

#[test]
fn a_wall_through_walls_keeps_light_on_its_side_at_any_angle() {
    // As an engine reads the map: bilinear taps, with gutters, at points that the dark room sees of its floor, walls and ceiling.
    for (degrees, thickness_m) in [(0.0f32, 0.1), (1.0, 0.1), (10.0, 0.1), (45.0, 0.1), (10.0, 0.004)] {
        let turned = Quat::from_rotation_y(degrees.to_radians());
        let baked =
            bake(closets(thickness_m, turned), &BakeSettings { probes: Some(24), gather_rays: 64, ..small_settings() });
        let lamp = r#"{"lights": [{"type": "point", "position": [-1.5, 1, 0.2], "color": [1, 1, 1], "intensity": 5}]}"#;
        let lighting = Lighting::from_json(lamp, Path::new("")).expect("lighting");
        let caster = RayCaster::new(&baked.scene).expect("tree");
        let atlas = Atlas::of(&baked.scene);
        let seen_from = |eye: Vec3, map: &CoverageMap| -> Vec<f32> {
            let look = |ray| {
                let hit = caster.closest_hit(eye, Vec3::from(spherical_fibonacci(ray, 4000)))?;
                map.sample(atlas.at(&hit.point?)).map(|light| light.max_element())
            };
            (0..4000).filter_map(look).collect()
        };
        let [lit, dark] = relit(&baked, &lighting, 3, |relighter| {
            let map = &relighter.relit().maps.irradiance;
            [-1.6, 1.6].map(|x| seen_from(Vec3::new(x, 1.0, 0.0), map))
        });
        let mean = lit.iter().sum::<f32>() / lit.len() as f32;
        let leaks: Vec<f32> = dark.iter().copied().filter(|&light| light > 0.0).collect();
        assert!(mean > 0.0 && dark.len() > 3900, "{degrees} degrees: {mean}, {} points", dark.len());
        assert!(leaks.is_empty(), "{degrees} degrees, {thickness_m} m: {leaks:?} of {mean}");
    }
}

#[test]
fn links_do_not_read_under_a_wall() {
    // One probe, on one side: in the other room links read whatever its rays meet, at any distance.
    let settings = BakeSettings { probes: Some(1), near_bytes: 400, direct_map: 256, ..small_settings() };
    let baked = bake(closets(0.2, Quat::IDENTITY), &settings);
    let side = baked.arrays.probes[0].position[0].signum();
    let x = 0.6 * side;
    let lamp = format!(
        r#"{{"lights": [{{"type": "point", "position": [{x}, 0.5, 0.2], "color": [1, 1, 1], "intensity": 5}}]}}"#
    );
    let lighting = Lighting::from_json(&lamp, Path::new("")).expect("lighting");
    let values = irradiance(&baked, &lighting, 1);
    let checked = baked.arrays.checked().expect("consistent arrays");
    let (mut dark, mut links) = (0, 0);
    for (receiver, position) in baked.arrays.receiver_position.iter().enumerate() {
        if position[0] * side < 0.0 {
            dark += 1;
            links += checked.transport().links_of(receiver).len();
            assert_eq!(values[receiver], Vec3::ZERO, "{position:?}");
        }
    }
    assert!(dark > 300 && links > 20 * dark, "{links} links of {dark} receivers");
    assert!(mean(values.iter().copied()) > 0.0, "there is light");
}
