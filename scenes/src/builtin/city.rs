//! Courts of the atrium in a grid with streets between them, a scene of any size: each block is 29.2 x 19.6 m, about that of the
//! Sponza palace, has 11 meshes and no light but from above, so that what a place sees does not grow with the city.

use super::shapes::{Shape, noise};
use super::{atrium, camera};
use crate::scene::{Mesh, Scene};
use glam::{Vec2, Vec3};

/// Most blocks of a city.
pub const MOST_BLOCKS: usize = 1024;
/// Distance of blocks along x and z.
const PITCH: Vec2 = Vec2::new(29.2, 19.6);
/// Half of a block's outer walls.
const WALLS: Vec2 = Vec2::new(12.0, 7.2);
/// Height of the streets.
const STREET: f32 = -0.1;

/// Number of blocks that a name asks for: `city`, `city:N` or, as files are named, `city-N`.
pub(super) fn blocks(name: &str) -> Option<usize> {
    let number = match name.strip_prefix("city")? {
        "" => return Some(4),
        rest => rest.strip_prefix([':', '-'])?.parse().ok()?,
    };
    (1..=MOST_BLOCKS).contains(&number).then_some(number)
}

/// So many blocks, row by row in a grid that is about as many blocks wide as deep.
pub(super) fn build(blocks: usize) -> Scene {
    let columns = (1..).find(|columns| columns * columns >= blocks).unwrap_or(1);
    let court = atrium::coarse();
    let mut meshes = Vec::new();
    for block in 0..blocks {
        let cell = [block % columns, block / columns];
        // Half of them are turned by half a turn.
        let turn = if noise(block as u32) < 0.5 { 1.0 } else { -1.0 };
        for part in &court {
            let mut mesh = placed(part, middle(cell), turn);
            mesh.name = format!("block {block} {}", part.name);
            meshes.push(mesh);
        }
        meshes.push(street(cell).into_mesh(&format!("block {block} street"), atrium::PAVING, None));
    }
    let first = middle([0, 0]);
    Scene {
        meshes,
        lights: vec![atrium::sunlight()],
        cameras: vec![
            camera("court", first + Vec3::new(-7.7, 1.7, 0.25), first + Vec3::new(3.0, 3.6, -0.5), 66.0),
            camera("street", first + Vec3::new(-13.3, 1.7, -9.0), first + Vec3::new(-13.3, 3.0, 8.0), 66.0),
            camera("roofs", first + Vec3::new(-24.0, 24.0, -20.0), first + Vec3::new(14.6, 0.0, 9.8), 55.0),
        ],
        ..atrium::looks()
    }
}

/// Middle of a block.
fn middle(cell: [usize; 2]) -> Vec3 {
    Vec3::new(cell[0] as f32 * PITCH.x, 0.0, cell[1] as f32 * PITCH.y)
}

/// Ends of a block along an axis, the same of both neighbors.
fn ends(cell: [usize; 2], axis: usize) -> [f32; 2] {
    [cell[axis], cell[axis] + 1].map(|edge| (edge as f32 - 0.5) * PITCH[axis])
}

/// A part of a court, turned by no or half a turn about its middle, and moved there.
fn placed(part: &Mesh, to: Vec3, turn: f32) -> Mesh {
    let turned = |at: &Vec3| *at * Vec3::new(turn, 1.0, turn);
    let mut mesh = part.clone();
    mesh.positions = part.positions.iter().map(|at| turned(at) + to).collect();
    mesh.normals = part.normals.iter().map(turned).collect();
    mesh
}

/// What is around a block's walls.
fn street(cell: [usize; 2]) -> Shape {
    let ([x, to_x], [z, to_z], middle) = (ends(cell, 0), ends(cell, 1), middle(cell));
    let plot = [Vec3::new(x, STREET - 1.0, z), Vec3::new(to_x, STREET, to_z)];
    // A little into the walls, as all parts that touch.
    let walls = Vec3::new(WALLS.x - 0.02, 2.0, WALLS.y - 0.02);
    let mut shape = Shape::default();
    shape.solid(&[plot], &[[middle - walls, middle + walls]], |_, normal| normal == Vec3::Y);
    shape
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_city_grows_by_its_blocks() {
        let [one, five] = [1, 5].map(build);
        assert_eq!(five.face_count(), 5 * one.face_count());
        assert!(one.face_count() < 10_000, "{}", one.face_count());
        let (low, high) = five.bounds().expect("meshes");
        // Three columns, two rows.
        assert!((high.x - low.x - 3.0 * PITCH.x).abs() < 1e-3 && (high.z - low.z - 2.0 * PITCH.y).abs() < 1e-3);
    }

    #[test]
    fn only_numbers_in_range_name_a_city() {
        let named = ["city", "city:1", "city-16", "city:1024"].map(blocks);
        assert_eq!(named, [4, 1, 16, 1024].map(Some));
        for name in ["city:0", "city:1025", "city:", "cityx", "city 4", "town", "city:-1"] {
            assert_eq!(blocks(name), None, "{name}");
        }
    }
}
