//! The classic Cornell box, 555 units made 2 m.
//!
//! Walls and blocks are single-sided, and the blocks have no bottoms: they stand on the floor edge to face, so nothing
//! is coplanar with it and their insides are closed off.

use super::shapes::Shape;
use super::{camera, matte, point_light};
use crate::scene::{Mesh, Scene};
use glam::{Vec2, Vec3};

/// Floor plan in the units of the measured box, x growing to the left and z away from the camera, and height.
const SHORT_BLOCK: ([[f32; 2]; 4], f32) = ([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]], 165.0);
const TALL_BLOCK: ([[f32; 2]; 4], f32) = ([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]], 330.0);
/// Width of the measured box.
const UNITS: f32 = 555.0;

pub(super) fn build() -> Scene {
    let (white, red, green) = (0, 1, 2);
    let wall = |name: &str, material, axis, high| {
        let mut shape = Shape::default();
        let splits: [&[f32]; 3] = [&[-1.0, 1.0], &[0.0, 2.0], &[-1.0, 1.0]];
        shape.grid_box(splits, true, |face| face.axis == axis && face.high == high);
        shape.into_mesh(name, material, None)
    };
    Scene {
        meshes: vec![
            wall("floor", white, 1, false),
            wall("ceiling", white, 1, true),
            wall("back wall", white, 2, false),
            wall("left wall", red, 0, false),
            wall("right wall", green, 0, true),
            block("short block", white, SHORT_BLOCK),
            block("tall block", white, TALL_BLOCK),
        ],
        // Reflectances of the measured box as linear RGB, as most renderers ship them.
        materials: vec![
            matte("white", [0.725, 0.71, 0.68]),
            matte("red", [0.63, 0.065, 0.05]),
            matte("green", [0.14, 0.45, 0.091]),
        ],
        // Irradiance 1 on the floor straight below: bright, but not burnt out on the back wall.
        lights: vec![point_light("lamp", Vec3::new(0.0, 1.5, 0.0), 2.25)],
        // The measured camera: 800 units in front of the opening, 25 mm film behind a 35 mm lens.
        cameras: vec![camera("front", Vec3::new(0.0, 1.0, 3.9), Vec3::new(0.0, 1.0, 0.0), 39.3)],
        ..Scene::default()
    }
}

/// Sides and top of a block over its plan.
fn block(name: &str, material: usize, (plan, height): ([[f32; 2]; 4], f32)) -> Mesh {
    let scale = 2.0 / UNITS;
    let plan = plan.map(|[x, z]| Vec2::new(1.0 - x * scale, 1.0 - z * scale));
    let low = plan.map(|at| Vec3::new(at.x, 0.0, at.y));
    let high = low.map(|at| at + Vec3::new(0.0, height * scale, 0.0));
    let mut shape = Shape::default();
    // The measured lists run counter-clockwise seen from above.
    for (i, j) in [(0, 1), (1, 2), (2, 3), (3, 0)] {
        shape.quad([low[i], low[j], high[j], high[i]]);
    }
    shape.quad(high);
    shape.into_mesh(name, material, None)
}
