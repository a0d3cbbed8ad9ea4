//! How much people see of each face: hits of rays from where they may stand. In: a scene's scale, voxels and rays; out: a count a face.
//!
//! Viewpoints stand off the surfaces where there is detail, and at the scene's cameras; rays leave them evenly in all directions. What
//! nobody sees, inside of furniture or far away on a plain, gets few hits for its area and so coarse texels.

use super::{LocalScale, weighted_quantile};
use crate::{
    rays::RayCaster,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_scenes::Scene;
use rayon::prelude::*;

/// Viewpoints off the surfaces.
const VIEWPOINTS: usize = 2048;
/// Rays of each.
const RAYS: u32 = 256;
/// Viewpoints at each camera; together no more than a third of all.
const PER_CAMERA: usize = 256;
/// Distance from the surface, in finest scales of charts, or the middle of the space above; where that is lower nobody stands.
const DISTANCE: f32 = 2.0;
/// Least distance from any surface, as a share of that.
const CLEARANCE: f32 = 0.125;
/// Hits that faces of typical density have to have before their own density counts as much as the typical one.
const PRIOR_HITS: f64 = 4.0;
/// Stream of random numbers of this file.
const STREAM: u64 = 0x7669_6577;

/// How often each face of a scene is seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// `[n_faces]` hits.
    pub hits: Vec<u32>,
    /// Hits per square metre of the face that the median hit met.
    pub typical: f64,
}

impl Seen {
    fn of(scene: &Scene, hits: Vec<u32>) -> Self {
        let faces = scene.faces().zip(&hits).filter(|(_, hits)| **hits > 0);
        let densities = faces.map(|((mesh, triangle), &hits)| {
            let density = f64::from(hits) / scene.area_m2(mesh, triangle).max(f64::MIN_POSITIVE);
            (density as f32, f64::from(hits))
        });
        let typical = weighted_quantile(densities, 0.5).map_or(1.0, f64::from);
        Self { hits, typical }
    }

    /// W of some faces together, given with their areas in square metres: hits per square metre over what is typical; 1 where the faces
    /// are too small to tell.
    pub fn density(&self, faces: impl Iterator<Item = (usize, f64)>) -> f32 {
        let (hits, area_m2) = faces.fold((0.0, 0.0), |(hits, area_m2), (face, of_face_m2)| {
            (hits + f64::from(self.hits[face]), area_m2 + of_face_m2)
        });
        ((hits + PRIOR_HITS) / (area_m2 * self.typical + PRIOR_HITS)) as f32
    }
}

/// How often the faces of the caster's scene are seen: the scene that the scale was measured on, cut into smaller faces or not.
pub fn importance(scale: &LocalScale, grid: &VoxelGrid, caster: &RayCaster<'_>) -> Seen {
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
    Seen::of(caster.scene(), hits)
}

/// Places in the open off the surfaces: as many per detail everywhere.
fn off_surfaces(scale: &LocalScale, grid: &VoxelGrid, caster: &RayCaster<'_>) -> Vec<Vec3> {
    let samples = scale.samples();
    let mut sum = 0.0;
    let sums: Vec<f64> = samples
        .iter()
        .map(|sample| {
            sum += f64::from(sample.area_m2) / f64::from(scale.at(sample.position).max(scale.finest_of_charts_m));
            sum
        })
        .collect();
    let chosen = (0..VIEWPOINTS).map(|index| (index as f64 + 0.5) / VIEWPOINTS as f64 * sum);
    let places: Vec<usize> =
        chosen.map(|target| sums.partition_point(|&sum| sum < target)).filter(|&place| place < samples.len()).collect();
    let stand = |&place: &usize| {
        let sample = &samples[place];
        let free_m = caster.free_above(sample.position, sample.normal);
        let wanted_m = DISTANCE * scale.finest_of_charts_m;
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
