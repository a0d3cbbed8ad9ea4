//! The unit sphere seen from inside, with a light at its center.
//!
//! With intensity I and albedo a the direct light leaves every point as radiance `a I / pi`, here 0.5, and all bounces
//! together as `a I / (pi (1 - a))`, here 1.

use super::shapes::Shape;
use super::{camera, matte, point_light};
use crate::scene::Scene;
use glam::{DVec3, Vec3};

/// Albedo of the scene `sphere`.
pub const SPHERE_ALBEDO: f32 = 0.5;
/// Candela of the light at its center.
pub const SPHERE_INTENSITY: f32 = std::f32::consts::PI;

/// An icosahedron, every triangle split in four this many times: 5120 triangles, whose middles are at most 0.12 %
/// nearer to the center than their corners.
const SUBDIVISIONS: usize = 4;

pub(super) fn build() -> Scene {
    let mut shape = Shape::default();
    for corners in icosphere() {
        let corners = corners.map(DVec3::as_vec3);
        shape.triangle_with(corners, corners.map(|corner| -corner));
    }
    Scene {
        meshes: vec![shape.into_mesh("sphere", 0, None)],
        materials: vec![matte("wall", [SPHERE_ALBEDO; 3])],
        lights: vec![point_light("center", Vec3::ZERO, SPHERE_INTENSITY)],
        cameras: vec![camera("inside", Vec3::new(0.0, 0.0, 0.8), Vec3::ZERO, 75.0)],
        ..Scene::default()
    }
}

/// Triangles of the unit sphere, clockwise seen from outside. A corner is the same for all triangles that meet there.
fn icosphere() -> Vec<[DVec3; 3]> {
    let golden = (1.0 + 5.0f64.sqrt()) / 2.0;
    let corner = |index: usize| {
        let (short, long) = (if index & 1 == 0 { 1.0 } else { -1.0 }, if index & 2 == 0 { golden } else { -golden });
        match index / 4 {
            0 => DVec3::new(0.0, short, long),
            1 => DVec3::new(short, long, 0.0),
            _ => DVec3::new(long, 0.0, short),
        }
    };
    let corners: Vec<DVec3> = (0..12).map(corner).collect();
    // The 20 triples of corners with edges of length 2.
    let is_edge = |i: usize, j: usize| (corners[i].distance_squared(corners[j]) - 4.0).abs() < 1e-9;
    let mut triangles = vec![];
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if is_edge(i, j) && is_edge(j, k) && is_edge(k, i) {
                    let [a, b, c] = [i, j, k].map(|index| corners[index].normalize());
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [a, c, b] } else { [a, b, c] });
                }
            }
        }
    }
    for _ in 0..SUBDIVISIONS {
        let split = |[a, b, c]: [DVec3; 3]| {
            // Addition commutes, so both sides of an edge get the same middle.
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    triangles
}
