//! What neither people nor light see of a scene: buried walls, undersides, the ground below a pavement.

use super::sides;
use crate::{
    rays::{RayCaster, frame},
    scale::Seen,
    voxels::VoxelGrid,
};
use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, counter_uniform, fibonacci_square};
use localprt_surfaces::subdivision;
use rayon::prelude::*;

/// Rays from each place of a face, about one place a texel...
const RAYS: u32 = 16;
/// ...and so many along an edge of the face, at most.
const MOST_STEPS: u32 = 64;
/// Stream of random numbers of this file.
const STREAM: u64 = 0x6869_6464_656e;

/// `[n_faces]` whether a face is hidden: no viewpoint saw it, none of a few rays from it reaches the space to light, and no ray met it
/// of some that leave every texel of the faces that are not hidden. `texel_m` is about the edge of a texel at a place, metres.
///
/// The last of these matters most: a face may be open along a strip that is thinner than its own rays tell.
pub fn faces(
    caster: &RayCaster<'_>,
    grid: &VoxelGrid,
    seen: &Seen,
    texel_m: &(dyn Fn(Vec3) -> f32 + Sync),
) -> Vec<bool> {
    let scene = caster.scene();
    let faces: Vec<(usize, usize)> = scene.faces().collect();
    let is_buried = |(&(mesh, triangle), &hits): (&(usize, usize), &u32)| {
        hits == 0 && !sides::is_live(caster, grid, mesh, triangle, true)
    };
    let mut hidden: Vec<bool> = faces.par_iter().zip(&seen.hits).map(is_buried).collect();
    let met_from = |(face, &(mesh, triangle)): (usize, &(usize, usize))| {
        let mut met = Vec::new();
        if hidden[face] {
            return met;
        }
        let normal = scene.geometric_normal(mesh, triangle);
        let (tangent, bitangent) = frame(normal);
        let [a, b, c] = scene.corners(mesh, triangle);
        let edge_m = (2.0 * scene.area_m2(mesh, triangle)).sqrt() as f32;
        let steps = (edge_m / texel_m((a + b + c) / 3.0)).ceil().clamp(1.0, MOST_STEPS as f32) as u32;
        for (place, [u, v, w]) in subdivision(steps).enumerate() {
            let origin = a * u + b * v + c * w + normal * caster.offset_m();
            let number = face as u64 * u64::from(MOST_STEPS * MOST_STEPS) + place as u64;
            let shift = [0, 1].map(|axis| counter_uniform(STREAM, number, axis));
            for ray in 0..RAYS {
                let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, RAYS, shift));
                let hit = caster.closest_hit(origin, tangent * x + bitangent * y + normal * z);
                met.extend(
                    hit.and_then(|hit| hit.point).map(|point| point.face.0).filter(|&face| hidden[face as usize]),
                );
            }
        }
        met
    };
    let met: Vec<Vec<u32>> = faces.par_iter().enumerate().map(met_from).collect();
    for face in met.into_iter().flatten() {
        hidden[face as usize] = false;
    }
    hidden
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{cuboid, inward, plane, scene};
    use super::*;
    use crate::{settings::BakeSettings, voxels::VoxelGrid};

    #[test]
    fn the_floor_below_a_slab_is_hidden_and_a_joint_between_slabs_is_not() {
        // In a room of 4 x 4 x 3 m a floor of 8 x 8 squares: seven rows below two slabs with a joint of 2 cm between them.
        let room = inward(cuboid("room", Vec3::ZERO, Vec3::new(4.0, 3.0, 4.0)));
        let floor = plane("floor", 0.01 * Vec3::Y, 4.0 * Vec3::X, 4.0 * Vec3::Z, 8, 8);
        let slab = |name: &str, from: f32, to: f32| cuboid(name, Vec3::new(-0.1, 0.011, from), Vec3::new(4.1, 0.1, to));
        let scene = scene(vec![room, floor, slab("first", -0.1, 1.74), slab("second", 1.76, 3.55)]);
        let caster = RayCaster::new(&scene).expect("tree");
        let grid = VoxelGrid::build(&scene, &caster, 1.0, 1.0, &BakeSettings::default()).expect("voxels");
        let seen = Seen { hits: vec![0; scene.face_count()], typical: 1.0 };
        let hidden = faces(&caster, &grid, &seen, &|_| 0.1);
        let mut count = 0;
        for (face, (mesh, triangle)) in scene.faces().enumerate() {
            let [a, b, c] = scene.corners(mesh, triangle);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            match mesh {
                1 => {
                    let is_open = high.z > 3.55 || low.z < 1.75 && high.z > 1.75;
                    assert_eq!(hidden[face], !is_open, "square from {low} to {high}");
                    count += usize::from(hidden[face]);
                }
                // Tops of slabs, walls and ceiling.
                2 | 3 if low.y > 0.05 => assert!(!hidden[face]),
                0 if high.y > 2.0 => assert!(!hidden[face]),
                _ => {}
            }
        }
        assert_eq!(count, 2 * 6 * 8);
    }
}
