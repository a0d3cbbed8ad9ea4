//! A dining room behind blinds: 6 x 2.8 x 5 m, lit by a sun through 26 slats of 3 mm.
//!
//! Everything is modeled as people model by hand: closed boxes and cylinders that run through each other. The floor is the
//! slab of a terrace and goes on under the walls into the sun; walls run past each other and below the floor; columns run
//! through floor and ceiling, one of them half within a wall; skirting boards and slats end inside of walls; furniture and
//! the partition stand on the floor with their bottoms on it. A screen is a single sheet with two sides. No two faces that
//! look the same way share a plane where they overlap.
//!
//! The scene has a sun, and no sky as no scene has one. With both, as a lighting file:
//!
//! ```json
//! {
//!   "lights": [{"type": "directional", "direction": [-0.8, -0.5, 0.2], "color": [1, 0.95, 0.85], "intensity": 20}],
//!   "sky": {"type": "gradient", "zenith": [0.35, 0.55, 1], "horizon": [0.8, 0.85, 0.9], "ground": [0.2, 0.2, 0.2]}
//! }
//! ```

use super::shapes::{Shape, sin_cos};
use super::{camera, matte, sun};
use crate::scene::{Material, Mesh, Scene};
use glam::{Vec2, Vec3};

const STONE: usize = 0;
const RENDER: usize = 1;
const PAINT: usize = 2;
const OAK: usize = 3;
const WALNUT: usize = 4;
const ENAMEL: usize = 5;
const CONCRETE: usize = 6;
const PAPER: usize = 7;

/// Low and high corner.
type Box3 = [[f32; 3]; 2];

/// Boxes by the mesh that they are part of. The room within the walls is x from -3 to 3, y from 0 to 2.8, z from -2.5 to 2.5.
const BOXES: [(&str, usize, &[Box3]); 8] = [
    ("floor", STONE, &[[[-4.0, -0.2, -3.6], [6.5, 0.0, 3.6]]]),
    ("ceiling", PAINT, &[[[-3.4, 2.8, -3.0], [3.6, 2.98, 3.0]]]),
    ("wall -x", RENDER, &[[[-3.25, -0.31, -2.9], [-3.0, 3.06, 2.9]]]),
    ("wall -z", RENDER, &[[[-3.7, -0.3, -2.75], [3.7, 3.05, -2.5]]]),
    ("wall +z", RENDER, &[[[-3.7, -0.3, 2.5], [3.7, 3.05, 2.75]]]),
    (
        "skirting",
        OAK,
        &[
            [[-3.05, -0.01, -2.51], [3.05, 0.08, -2.485]],
            [[-3.05, -0.01, 2.485], [3.05, 0.08, 2.51]],
            [[-3.01, -0.02, -2.55], [-2.985, 0.078, 2.55]],
            [[2.985, -0.02, -2.55], [3.01, 0.078, 2.55]],
            // On both sides of the partition, up to its doorway.
            [[-0.96, -0.02, -2.55], [-0.935, 0.078, 0.69]],
            [[-0.96, -0.02, 1.61], [-0.935, 0.078, 2.55]],
            [[-1.015, -0.02, -2.55], [-0.99, 0.078, 0.69]],
            [[-1.015, -0.02, 1.61], [-0.99, 0.078, 2.55]],
        ],
    ),
    (
        "table",
        WALNUT,
        &[
            [[0.3, 0.72, -1.2], [1.2, 0.76, 0.6]],
            [[0.36, 0.0, -1.14], [0.42, 0.74, -1.08]],
            [[1.08, 0.0, -1.14], [1.14, 0.74, -1.08]],
            [[0.36, 0.0, 0.48], [0.42, 0.74, 0.54]],
            [[1.08, 0.0, 0.48], [1.14, 0.74, 0.54]],
        ],
    ),
    (
        "sideboard",
        OAK,
        &[
            [[0.2, 0.1, -2.51], [2.0, 0.85, -2.05]],
            [[0.25, 0.0, -2.45], [1.95, 0.12, -2.1]],
            [[0.9, 0.84, -2.4], [1.3, 1.1, -2.15]],
        ],
    ),
];

/// Wall with the window, and the partition with its doorway: the box and what is cut out.
const WINDOW_WALL: [Box3; 2] = [[[3.0, -0.31, -2.9], [3.25, 3.06, 2.9]], [[2.9, 0.8, -1.5], [3.4, 2.3, 1.5]]];
const PARTITION: [Box3; 2] = [[[-1.0, 0.0, -2.6], [-0.95, 2.9, 2.6]], [[-1.1, -0.1, 0.7], [-0.9, 2.05, 1.6]]];

const N_SLATS: usize = 26;
/// Depth, thickness and length of a slat; the ends are within the wall.
const SLAT: Vec3 = Vec3::new(0.05, 0.003, 3.02);
/// Outer edge downwards.
const SLAT_TILT_DEGREES: f32 = 8.0;

/// Radius and feet of the columns, the second one half within a wall.
const COLUMN_RADIUS: f32 = 0.14;
const COLUMNS: [Vec3; 2] = [Vec3::new(2.3, -0.28, -1.2), Vec3::new(0.9, -0.28, 2.5)];

/// Where chairs stand, and the side of their backs along x.
const CHAIRS: [([f32; 2], f32); 4] =
    [([0.1, -0.75], -1.0), ([0.12, 0.15], -1.0), ([1.4, -0.78], 1.0), ([1.45, 0.1], 1.0)];

pub(super) fn build() -> Scene {
    let mut meshes: Vec<Mesh> = BOXES.iter().map(|&(name, material, boxes)| blocks(name, material, boxes)).collect();
    meshes.push(cut("wall +x", RENDER, WINDOW_WALL));
    meshes.push(cut("partition", PAINT, PARTITION));
    meshes.push(window());
    meshes.push(slats());
    meshes.push(columns());
    meshes.push(chairs());
    meshes.push(screen());
    Scene {
        meshes,
        materials: materials(),
        // Through the window toward +X, as far as the partition.
        lights: vec![sun(Vec3::new(-0.8, -0.5, 0.2))],
        cameras: vec![
            camera("room", Vec3::new(-0.7, 1.6, 2.2), Vec3::new(1.7, 0.9, -1.0), 62.0),
            camera("partition", Vec3::new(2.75, 1.55, -0.55), Vec3::new(-0.6, 0.85, 0.75), 62.0),
        ],
        ..Scene::default()
    }
}

fn materials() -> Vec<Material> {
    let paper = Material { double_sided: true, ..matte("paper", [0.7, 0.66, 0.58]) };
    vec![
        matte("stone", [0.5, 0.46, 0.4]),
        matte("render", [0.72, 0.7, 0.66]),
        matte("paint", [0.8, 0.8, 0.78]),
        matte("oak", [0.56, 0.42, 0.27]),
        matte("walnut", [0.3, 0.23, 0.2]),
        matte("enamel", [0.75, 0.75, 0.74]),
        matte("concrete", [0.45, 0.45, 0.44]),
        paper,
    ]
}

/// Closed boxes, each by itself.
fn blocks(name: &str, material: usize, boxes: &[Box3]) -> Mesh {
    let mut shape = Shape::default();
    for corners in boxes {
        let [low, high] = corners.map(Vec3::from_array);
        shape.block(low, high);
    }
    shape.into_mesh(name, material, None)
}

/// A closed box with a hole through it.
fn cut(name: &str, material: usize, [whole, hole]: [Box3; 2]) -> Mesh {
    let mut shape = Shape::default();
    shape.solid(&[whole.map(Vec3::from_array)], &[hole.map(Vec3::from_array)], |_, _| true);
    shape.into_mesh(name, material, None)
}

/// Frame and mullions outside of the slats, which end within the wall.
fn window() -> Mesh {
    let uprights = [-1.51, -0.525, 0.475, 1.46].map(|z| [[3.16, 0.79, z], [3.21, 2.31, z + 0.05]]);
    let rails = [0.79, 2.26].map(|y| [[3.15, y, -1.51], [3.22, y + 0.05, 1.51]]);
    // The box that the slats hang from.
    let head = [[3.05, 2.25, -1.51], [3.11, 2.305, 1.51]];
    blocks("window", ENAMEL, &[&uprights[..], &rails, &[head]].concat())
}

fn slats() -> Mesh {
    let [_, [low, high]] = WINDOW_WALL;
    let head = high[1] - 0.05;
    let pitch = (head - low[1]) / N_SLATS as f32;
    let (sin, cos) = sin_cos(SLAT_TILT_DEGREES.to_radians());
    let mut shape = Shape::default();
    for _ in 0..N_SLATS {
        shape.block(-SLAT / 2.0, SLAT / 2.0);
    }
    let mut mesh = shape.into_mesh("slats", ENAMEL, None);
    let turned = |at: Vec3| Vec3::new(at.x * cos + at.y * sin, at.y * cos - at.x * sin, at.z);
    let per_slat = mesh.positions.len() / N_SLATS;
    for (index, position) in mesh.positions.iter_mut().enumerate() {
        let y = low[1] + ((index / per_slat) as f32 + 0.5) * pitch;
        *position = turned(*position) + Vec3::new(3.08, y, 0.0);
    }
    for normal in &mut mesh.normals {
        *normal = turned(*normal);
    }
    mesh
}

fn columns() -> Mesh {
    let profile = [(0.0, 0.0), (COLUMN_RADIUS, 0.0), (COLUMN_RADIUS, 3.29), (0.0, 3.29)];
    let mut shape = Shape::default();
    for foot in COLUMNS {
        shape.lathe(foot, &profile.map(|(radius, y)| Vec2::new(radius, y)), 24);
    }
    shape.into_mesh("columns", CONCRETE, None)
}

/// Seats, legs that run into them, backs that run through them.
fn chairs() -> Mesh {
    let mut boxes: Vec<Box3> = Vec::new();
    for ([x, z], back) in CHAIRS {
        boxes.push([[x - 0.21, 0.43, z - 0.2], [x + 0.21, 0.46, z + 0.2]]);
        for (side_x, side_z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let [leg_x, leg_z] = [x + side_x * 0.17, z + side_z * 0.16];
            boxes.push([[leg_x - 0.02, 0.0, leg_z - 0.02], [leg_x + 0.02, 0.445, leg_z + 0.02]]);
        }
        let middle = x + back * 0.18;
        boxes.push([[middle - 0.012, 0.4, z - 0.18], [middle + 0.012, 0.9, z + 0.18]]);
    }
    blocks("chairs", WALNUT, &boxes)
}

/// One sheet with two sides, standing on the floor across the light.
fn screen() -> Mesh {
    let corner = |z: f32, y: f32| Vec3::new(1.9 - 0.15 * (z - 0.9), y, z);
    let mut shape = Shape::default();
    shape.quad([corner(0.9, 0.0), corner(0.9, 1.5), corner(1.9, 1.5), corner(1.9, 0.0)]);
    shape.into_mesh("screen", PAPER, None)
}
