//! How much people see of each face: hits of rays from where they may stand. In: a scene's scale, voxels and rays; out: a count a face.
//!
//! Viewpoints stand off the surfaces where there is detail, and at the scene's cameras; rays leave them evenly in all directions. What
//! nobody sees, inside of furniture or far away on a plain, gets few hits for its area and so coarse texels.

use super::LocalScale;
use crate::{
    rays::RayCaster,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use rayon::prelude::*;

/// Viewpoints off the surfaces.
const VIEWPOINTS: usize = 2048;
/// Rays of each.
const RAYS: u32 = 256;
/// Viewpoints at each camera; together no more than a third of all.
const PER_CAMERA: usize = 256;
/// Distance from the surface, in finest scales of probes, or the middle of the space above; where that is lower nobody stands.
const DISTANCE: f32 = 4.0;
/// Least distance from any surface, as a share of that.
const CLEARANCE: f32 = 0.125;
/// Stream of random numbers of this file.
const STREAM: u64 = 0x7669_6577;

/// `[n_faces]` hits of each face of the caster's scene, which is the one that the scale was measured on, cut into smaller faces
/// or not.
pub fn importance(scale: &LocalScale, grid: &VoxelGrid, caster: &RayCaster<'_>) -> Vec<u32> {
    let mut hits = vec![0; caster.scene().face_count()];
    let mut viewpoints = off_surfaces(scale, grid, caster);
    let cameras: Vec<Vec3> = caster.scene().cameras.iter().map(|camera| camera.to_world.w_axis.truncate()).collect();
    let at_cameras = (PER_CAMERA * cameras.len()).min(viewpoints.len().max(PER_CAMERA) / 2);
    if let Some(count) = cameras.len().checked_sub(1) {
        viewpoints.extend((0..at_cameras).map(|index| cameras[index * (count + 1) / at_cameras]));
    }
    let met: Vec<Vec<u32>> = viewpoints
        .par_iter()
        .enumerate()
        .map(|(index, &viewpoint)| {
            let index = index as u64;
            // Turned about the axis, so that viewpoints look at different places.
            let (sin, cos) = (std::f32::consts::TAU * counter_uniform(STREAM, index, 0) as f32).sin_cos();
            let shift = counter_uniform(STREAM, index, 1) as f32;
            (0..RAYS)
                .filter_map(|ray| {
                    let [x, y, z] = spherical_fibonacci(ray, RAYS);
                    let z = (z + shift / RAYS as f32).clamp(-1.0, 1.0);
                    let dir = Vec3::new(x * cos - y * sin, x * sin + y * cos, z).normalize();
                    Some(caster.closest_hit(viewpoint, dir)?.point?.face.0)
                })
                .collect()
        })
        .collect();
    met.into_iter().flatten().for_each(|face| hits[face as usize] += 1);
    hits
}

/// Places in the open off the surfaces: as many per detail everywhere.
fn off_surfaces(scale: &LocalScale, grid: &VoxelGrid, caster: &RayCaster<'_>) -> Vec<Vec3> {
    let samples = scale.samples();
    let mut sum = 0.0;
    let sums: Vec<f64> = samples
        .iter()
        .map(|sample| {
            sum += f64::from(sample.area_m2) / f64::from(scale.at(sample.position).max(scale.finest_of_probes_m));
            sum
        })
        .collect();
    let chosen = (0..VIEWPOINTS).map(|index| (index as f64 + 0.5) / VIEWPOINTS as f64 * sum);
    let places: Vec<usize> =
        chosen.map(|target| sums.partition_point(|&sum| sum < target)).filter(|&place| place < samples.len()).collect();
    let stand = |&place: &usize| {
        let sample = &samples[place];
        let free_m = caster.free_above(sample.position, sample.normal);
        let wanted_m = DISTANCE * scale.finest_of_probes_m;
        if free_m < wanted_m {
            return None;
        }
        let viewpoint = sample.position + sample.normal * wanted_m.min(0.5 * free_m);
        let is_good = surroundings(caster, viewpoint).is_open(CLEARANCE * wanted_m)
            && grid.at(viewpoint) != Some(Voxel::Enclosed);
        is_good.then_some(viewpoint)
    };
    places.par_iter().map(stand).collect::<Vec<_>>().into_iter().flatten().collect()
}
