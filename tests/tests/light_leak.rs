//! Light in a sealed room stays there.

use glam::Vec3;
use localprt_precompute::settings::{BakeSettings, Transport};
use localprt_scenes::{Lighting, Material, Mesh, Scene};
use localprt_tests::{TRANSPORTS, bake, irradiance, mean, scene, small_settings};
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

/// A box whose floor, ceiling and long walls are one piece each, with a wall across its middle.
fn closets() -> Scene {
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
    let meshes = vec![
        block(Vec3::new(-2.0, 0.0, -1.0), Vec3::new(2.0, 2.0, 1.0), true),
        block(Vec3::new(-0.1, -0.1, -1.1), Vec3::new(0.1, 2.1, 1.1), false),
    ];
    Scene { meshes, materials: vec![Material::default()], ..Scene::default() }
}

#[test]
fn links_do_not_read_under_a_wall() {
    // One probe, on one side: in the other room links read whatever its rays meet, at any distance.
    let settings = BakeSettings { probes: Some(1), near_bytes: 400, direct_map: 256, ..small_settings() };
    let baked = bake(closets(), &settings);
    let side = baked.arrays.probes[0].position[0].signum();
    let x = 0.6 * side;
    let lamp = format!(
        r#"{{"lights": [{{"type": "point", "position": [{x}, 0.5, 0.2], "color": [1, 1, 1], "intensity": 5}}]}}"#
    );
    let lighting = Lighting::from_json(&lamp, Path::new("")).expect("lighting");
    let values = irradiance(&baked, &lighting, 1);
    let near = baked.arrays.near.as_ref().expect("links");
    let (mut dark, mut links) = (0, 0);
    for (receiver, position) in baked.arrays.receiver_position.iter().enumerate() {
        if position[0] * side < 0.0 {
            dark += 1;
            links += u32::from(near.counts[receiver]);
            assert_eq!(values[receiver], Vec3::ZERO, "{position:?}");
        }
    }
    assert!(dark > 300 && links > 20 * dark, "{links} links of {dark} receivers");
    assert!(mean(values.iter().copied()) > 0.0, "there is light");
}
