//! A cellar with normal maps: bricks, tiles and a curtain of 4 x 2.6 x 5 m, under a spot that shines on the wall at the right, so that most
//! of what is seen is lit by that wall, from one side.
//!
//! The far wall is mirrored in its middle, and opposite walls have tangents of opposite handedness. The tiles and the far wall have
//! tangents; of the other surfaces the change of the coordinates tells. The curtain is seen from both sides.

use super::drawn::{normal_map, of_cell};
use super::shapes::Shape;
use super::{camera, matte};
use crate::light::{Light, LightKind};
use crate::scene::{Material, Mesh, Scene, Texture, TextureRef, Wrap};
use glam::{Affine2, DVec2, Vec2, Vec3};
use std::f64::consts::TAU;

const LOW: Vec3 = Vec3::new(-2.0, 0.0, -2.5);
const HIGH: Vec3 = Vec3::new(2.0, 2.6, 2.5);
/// Metres that a normal map covers.
const MAP_M: f32 = 1.0;
/// Pixels of a normal map.
const PIXELS: u32 = 256;

pub(super) fn build() -> Scene {
    let (plaster, brick, tile, cloth, lit) = (0, 1, 2, 3, 4);
    let side = |name: &str, material, axis, high| {
        let mut shape = Shape::default();
        let splits = [[LOW.x, HIGH.x], [LOW.y, HIGH.y], [LOW.z, HIGH.z]];
        shape.grid_box([&splits[0], &splits[1], &splits[2]], true, |face| face.axis == axis && face.high == high);
        shape.into_mesh(name, material, Some(MAP_M))
    };
    let texture = |image| Texture { image, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false };
    let bumpy = |name: &str, albedo, texture| {
        let reference = TextureRef { texture, uv_set: 0, transform: Affine2::IDENTITY };
        Material { normal_texture: Some(reference), ..matte(name, albedo) }
    };
    let pixels = |name, height: fn(DVec2) -> f64| normal_map(name, PIXELS, f64::from(MAP_M), height);
    Scene {
        meshes: vec![
            with_tangents(side("floor", tile, 1, false)),
            side("ceiling", plaster, 1, true),
            with_tangents(far_wall(brick)),
            side("near wall", brick, 2, true),
            side("left wall", brick, 0, false),
            side("right wall", lit, 0, true),
            curtain(cloth),
        ],
        materials: vec![
            matte("plaster", [0.7, 0.68, 0.64]),
            bumpy("brick", [0.55, 0.42, 0.36], 0),
            bumpy("tile", [0.5, 0.5, 0.52], 1),
            Material { double_sided: true, ..bumpy("cloth", [0.6, 0.55, 0.3], 2) },
            matte("lit wall", [0.75, 0.6, 0.42]),
        ],
        textures: vec![texture(0), texture(1), texture(2)],
        images: vec![pixels("bricks", bricks), pixels("tiles", tiles), pixels("folds", folds)],
        lights: vec![spot()],
        cameras: vec![
            camera("room", Vec3::new(1.2, 1.5, 2.3), Vec3::new(-0.5, 1.0, -1.5), 62.0),
            camera("wall", Vec3::new(0.3, 1.3, -0.9), Vec3::new(-0.1, 1.2, -2.5), 50.0),
        ],
        ..Scene::default()
    }
}

fn spot() -> Light {
    let position = Vec3::new(0.9, 2.4, 0.2);
    Light {
        name: "spot".into(),
        kind: LightKind::Spot { inner_cone: 0.3, outer_cone: 0.7 },
        position,
        direction: (Vec3::new(HIGH.x, 1.1, -0.2) - position).normalize(),
        color: Vec3::ONE,
        intensity: 60.0,
        range: None,
    }
}

/// Its coordinates run to both sides from the middle.
fn far_wall(material: usize) -> Mesh {
    let mut shape = Shape::default();
    for [left, right] in [[LOW.x, 0.0], [0.0, HIGH.x]] {
        let corners = [[left, LOW.y], [right, LOW.y], [right, HIGH.y], [left, HIGH.y]];
        let uvs = corners.map(|[x, y]| Vec2::new(x.abs(), -y));
        shape.quad_with(corners.map(|[x, y]| Vec3::new(x, y, LOW.z)), [Vec3::Z; 4], uvs);
    }
    shape.into_mesh("far wall", material, Some(MAP_M))
}

/// A sheet from side to side of a corner of the room.
fn curtain(material: usize) -> Mesh {
    let mut shape = Shape::default();
    let ends = [Vec2::new(-1.7, -0.9), Vec2::new(-0.7, -1.9)];
    let along = ends[0].distance(ends[1]);
    let at = |end: usize, y: f32| Vec3::new(ends[end].x, y, ends[end].y);
    let corners = [at(0, 0.3), at(1, 0.3), at(1, 2.3), at(0, 2.3)];
    let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize();
    let uvs = [[0.0, -0.3], [along, -0.3], [along, -2.3], [0.0, -2.3]].map(Vec2::from);
    shape.quad_with(corners, [normal; 4], uvs);
    shape.into_mesh("curtain", material, Some(MAP_M))
}

/// Eight courses of four bricks, each tilted a little, with joints of 1 cm that are 6 mm deep.
fn bricks(at: DVec2) -> f64 {
    let row = (at.y * 8.0).floor().rem_euclid(8.0);
    let x = (at.x * 4.0 + 0.5 * (row % 2.0)).rem_euclid(4.0);
    let inside = DVec2::new(x.fract() / 4.0, (at.y * 8.0).rem_euclid(1.0) / 8.0);
    let cell = DVec2::new(x.floor(), row);
    let tilt = DVec2::new(of_cell(cell, 0), of_cell(cell, 1)) * 0.08;
    edge(inside, DVec2::new(0.25, 0.125), 0.01, 0.006, tilt)
}

/// Tiles of half a metre with round edges, each a little hollow.
fn tiles(at: DVec2) -> f64 {
    let cell = (at * 2.0).floor().rem_euclid(DVec2::splat(2.0));
    let inside = (at * 2.0 - (at * 2.0).floor()) / 2.0;
    let hollow = (inside - 0.25).length_squared() * 0.25;
    let tilt = DVec2::new(of_cell(cell, 2), of_cell(cell, 3)) * 0.02;
    edge(inside, DVec2::splat(0.5), 0.012, 0.004, tilt) + hollow
}

/// Five folds of 2 cm.
fn folds(at: DVec2) -> f64 {
    0.02 * (5.0 * TAU * at.x).sin()
}

/// Height of a block of given size: a tilted plane that falls by `depth` over `width` at its edges.
fn edge(inside: DVec2, size: DVec2, width: f64, depth: f64, tilt: DVec2) -> f64 {
    let to_edge = inside.min(size - inside).min_element();
    let within = (to_edge / width).min(1.0);
    within * within * (3.0 - 2.0 * within) * depth + tilt.dot(inside - size / 2.0) * within
}

/// Tangents of flat faces that share no vertices with others.
fn with_tangents(mut mesh: Mesh) -> Mesh {
    let uvs = &mesh.uv_sets[0];
    mesh.tangents = vec![glam::Vec4::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| vertex as usize);
        let (p, q) = (mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]);
        let (s, t) = (uvs[b] - uvs[a], uvs[c] - uvs[a]);
        let area = s.perp_dot(t);
        let tangent = ((p * t.y - q * s.y) / area).normalize();
        // Images have v down.
        let up = (p * t.x - q * s.x) / area;
        let handedness = mesh.normals[a].cross(tangent).dot(up).signum();
        for vertex in [a, b, c] {
            mesh.tangents[vertex] = tangent.extend(handedness);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mesh with tangents and the same without have the same normals: the one is stored, the other found from the coordinates.
    #[test]
    fn tangents_say_what_the_coordinates_say() {
        let scene = build();
        let mut bare = build();
        let mut signs = Vec::new();
        for (mesh, data) in scene.meshes.iter().enumerate().filter(|(_, mesh)| !mesh.tangents.is_empty()) {
            bare.meshes[mesh].tangents.clear();
            signs.extend(data.tangents.iter().map(|tangent| tangent.w));
            for triangle in 0..data.triangles.len() {
                let normal = scene.geometric_normal(mesh, triangle);
                for step in 1..50 {
                    let [x, y] = [0.618, 0.414].map(|share: f32| (share * step as f32).fract());
                    let weights = Vec3::new(1.0 - x.max(y), x.max(y) - x.min(y), x.min(y));
                    let [stored, found] =
                        [&scene, &bare].map(|scene| scene.mapped_normal(mesh, triangle, weights, normal));
                    assert!(stored.distance(found) < 1e-3, "{}: {stored} {found}", data.name);
                }
            }
        }
        assert!(signs.contains(&1.0) && signs.contains(&-1.0), "both kinds of handedness");
    }

    /// The wall is the mirror image of itself.
    #[test]
    fn the_mirrored_wall_has_mirrored_bumps() {
        let scene = build();
        let wall = scene.meshes.iter().position(|mesh| mesh.name == "far wall").unwrap();
        let normal = |x: f32, y: f32| {
            let hit = (0..4).find_map(|triangle| {
                let [a, b, c] = scene.corners(wall, triangle).map(|corner| corner.truncate());
                let (p, q, at) = (b - a, c - a, Vec2::new(x, y) - a);
                let area = p.perp_dot(q);
                let (v, w) = (at.perp_dot(q) / area, p.perp_dot(at) / area);
                (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| (triangle, Vec3::new(1.0 - v - w, v, w)))
            });
            let (triangle, weights) = hit.unwrap();
            scene.mapped_normal(wall, triangle, weights, Vec3::Z)
        };
        let mut most = 0.0f32;
        for step in 1..200 {
            let [x, y] = [2.0 * (0.618 * step as f32).fract(), 2.6 * (0.414 * step as f32).fract()];
            let (right, left) = (normal(x, y), normal(-x, y));
            assert!(right.distance(left * Vec3::new(-1.0, 1.0, 1.0)) < 2e-3, "{x} {y}: {right} {left}");
            most = most.max(right.x.abs());
        }
        assert!(most > 0.2, "no bumps: {most}");
    }
}
