//! Two rooms on both sides of a wall 5 mm thick, with a light in the left one only.
//!
//! The rooms are inward surfaces of their own and the wall is the space between them. With the doorway both are one
//! closed surface, connected through the jambs, and no edge ends in the middle of another one.

use super::shapes::Shape;
use super::{camera, matte, point_light};
use crate::scene::{Mesh, Scene};
use glam::Vec3;

/// Half of the wall's thickness in metres.
const HALF_WALL: f32 = 0.0025;
/// Far end of each room from the middle.
const END: f32 = 3.0;
/// Heights: floor, lintel, ceiling.
const HEIGHTS: [f32; 3] = [0.0, 2.1, 2.6];
/// Depths: front, doorway, back.
const DEPTHS: [f32; 4] = [-2.0, -0.5, 0.5, 2.0];

pub(super) fn build(doorway: bool) -> Scene {
    let (plaster, boards, party_wall) = (0, 1, 2);
    let mut meshes = room("left", [-END, -HALF_WALL], doorway, [plaster, boards, party_wall]);
    meshes.extend(room("right", [HALF_WALL, END], doorway, [plaster, boards, party_wall]));
    if doorway {
        let mut jambs = Shape::default();
        let splits: [&[f32]; 3] = [&[-HALF_WALL, HALF_WALL], &HEIGHTS[..2], &DEPTHS[1..3]];
        jambs.grid_box(splits, true, |face| face.axis != 0);
        meshes.push(jambs.into_mesh("doorway", party_wall, None));
    }
    Scene {
        meshes,
        materials: vec![
            matte("plaster", [0.7, 0.7, 0.7]),
            matte("boards", [0.5, 0.36, 0.22]),
            matte("party wall", [0.75, 0.55, 0.35]),
        ],
        lights: vec![point_light("left lamp", Vec3::new(-1.5, 2.0, 0.0), 6.0)],
        cameras: vec![
            camera("left room", Vec3::new(-2.8, 1.5, 1.7), Vec3::new(0.0, 1.1, -0.4), 65.0),
            camera("right room", Vec3::new(2.8, 1.5, 1.7), Vec3::new(0.0, 1.1, -0.4), 65.0),
        ],
        ..Scene::default()
    }
}

fn room(side: &str, ends: [f32; 2], doorway: bool, [plaster, boards, party_wall]: [usize; 3]) -> Vec<Mesh> {
    let faces_party_wall = |high: bool| high == (ends[1] < 0.0);
    let part = |name: &str, material: usize, select: &dyn Fn(usize, bool) -> bool| {
        let mut shape = Shape::default();
        // Cyclic axes: on the x faces u counts heights and v depths.
        let hole = |face: super::shapes::Face| doorway && face.axis == 0 && (face.u, face.v) == (0, 1);
        shape.grid_box([&ends, &HEIGHTS, &DEPTHS], true, |face| {
            let party = face.axis == 0 && faces_party_wall(face.high);
            select(face.axis, face.high) && !(party && hole(face))
        });
        shape.into_mesh(&format!("{side} {name}"), material, None)
    };
    vec![
        part("floor", boards, &|axis, high| axis == 1 && !high),
        part("ceiling", plaster, &|axis, high| axis == 1 && high),
        part("walls", plaster, &|axis, high| axis == 2 || axis == 0 && !faces_party_wall(high)),
        part("party wall", party_wall, &|axis, high| axis == 0 && faces_party_wall(high)),
    ]
}
