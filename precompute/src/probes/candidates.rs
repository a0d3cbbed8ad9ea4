//! A vastly overcomplete set of possible probe positions near surfaces.

use super::{PlacementError, reduce::most_candidates};
use crate::{
    rays::RayCaster,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use localprt_formats::directions::{counter_hash, counter_uniform};
use rayon::prelude::*;

/// Least distance to surfaces, in voxels (ANCHORS 4.9).
const CLEARANCE: f32 = 0.25;
/// Positions tried within a voxel: its center, then random ones.
const POSITIONS: u64 = 5;
/// Streams of random numbers of this file.
const STREAM: u64 = 0x6361_6e64;

/// Possible probe positions.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    /// World positions, metres, in voxel order.
    pub positions: Vec<Vec3>,
    /// Voxels without a good position.
    pub rejected: usize,
}

/// Candidates for `target` probes: one in every open voxel that lies `layer` voxels from the nearest solid one, counted
/// over 26 neighbors (1 is beside it), and, where the open space is narrower than that, in its middle; unless the voxel is
/// behind surfaces (more than 25 % of the hits of 32 rays are back faces), too close to them (a quarter voxel)
/// or out of their sight (no hit, as beside the rim of a plane) at its center and at four random places.
///
/// Where voxels are far more than the probes need (64 each, and 200 000), an even share of them is tried. Where good ones
/// are fewer than the probes, the other open voxels are tried as well; there may still be fewer candidates than probes.
///
/// # Errors
///
/// [`PlacementError::NoOpenSpace`] and [`PlacementError::NoCandidate`].
pub fn candidates(
    grid: &VoxelGrid,
    caster: &RayCaster,
    target: usize,
    layer: u8,
    seed: u64,
) -> Result<Candidates, PlacementError> {
    let tried = most_candidates(target);
    let (shell, others) = open_voxels(grid, layer.max(1));
    let near = even_subset(shell, tried, seed);
    let (mut voxels, mut positions) = good_positions(grid, caster, &near, seed);
    let mut tested = near.len();
    if positions.len() < target {
        let far = even_subset(others, tried, seed);
        tested += far.len();
        let (far_voxels, far_positions) = good_positions(grid, caster, &far, seed);
        voxels.extend(far_voxels);
        positions.extend(far_positions);
        let mut order: Vec<usize> = (0..voxels.len()).collect();
        order.sort_unstable_by_key(|&index| voxels[index]);
        positions = order.into_iter().map(|index| positions[index]).collect();
    }
    if tested == 0 {
        return Err(PlacementError::NoOpenSpace {
            voxels: grid.voxels.len(),
            solid: grid.count(Voxel::Solid),
            voxel_m: grid.voxel_m,
        });
    }
    if positions.is_empty() {
        return Err(PlacementError::NoCandidate { tested, voxel_m: grid.voxel_m });
    }
    Ok(Candidates { rejected: tested - positions.len(), positions })
}

/// Indices of the open voxels of a layer, or in the middle of narrower space; and of all other open voxels. Rising.
fn open_voxels(grid: &VoxelGrid, layer: u8) -> (Vec<u32>, Vec<u32>) {
    let steps = steps_to_solid(grid, layer);
    let slice = grid.size.x as usize * grid.size.y as usize;
    (0..grid.size.z as usize)
        .into_par_iter()
        .flat_map_iter(|z| (z * slice..(z + 1) * slice).filter(|&index| grid.voxels[index] == Voxel::Open))
        .map(|index| index as u32)
        .partition(|&index| {
            let own = steps[index as usize];
            let is_farther = |other: usize| grid.voxels[other] == Voxel::Open && steps[other] > own;
            own == layer || own < layer && !grid.neighbors(grid.cell(index as usize)).any(is_farther)
        })
}

/// Steps over 26 neighbors from each voxel to the nearest solid one; `most + 1` for those farther away than `most`.
fn steps_to_solid(grid: &VoxelGrid, most: u8) -> Vec<u8> {
    let far = most.saturating_add(1);
    let mut steps: Vec<u8> = grid.voxels.iter().map(|&voxel| if voxel == Voxel::Solid { 0 } else { far }).collect();
    for step in 1..=most {
        let reached: Vec<usize> = (0..steps.len())
            .into_par_iter()
            .filter(|&index| {
                steps[index] == far && grid.neighbors(grid.cell(index)).any(|other| steps[other] == step - 1)
            })
            .collect();
        for index in reached {
            steps[index] = step;
        }
    }
    steps
}

/// At most `count` of the voxels: one out of each of `count` equal runs, at random within the run, because a fixed
/// step would beat with the rows of the grid.
fn even_subset(voxels: Vec<u32>, count: usize, seed: u64) -> Vec<u32> {
    if voxels.len() <= count {
        return voxels;
    }
    (0..count)
        .map(|run| {
            let first = run * voxels.len() / count;
            let end = (run + 1) * voxels.len() / count;
            let pick = counter_hash(seed, STREAM, run as u64) % (end - first) as u64;
            voxels[first + pick as usize]
        })
        .collect()
}

/// Voxels with a good position, and the positions.
fn good_positions(grid: &VoxelGrid, caster: &RayCaster, voxels: &[u32], seed: u64) -> (Vec<u32>, Vec<Vec3>) {
    voxels
        .par_iter()
        .map(|&voxel| good_position(grid, caster, voxel, seed).map(|position| (voxel, position)))
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .unzip()
}

fn good_position(grid: &VoxelGrid, caster: &RayCaster, voxel: u32, seed: u64) -> Option<Vec3> {
    let center = grid.center(grid.cell(voxel as usize));
    (0..POSITIONS).find_map(|attempt| {
        let offset = |axis: u64| {
            // Within the middle three quarters, so that a position stays in its voxel after rounding.
            let uniform = counter_uniform(seed, STREAM + 1 + u64::from(voxel), attempt * 3 + axis) as f32;
            if attempt == 0 { 0.0 } else { 0.75 * (uniform - 0.5) * grid.voxel_m }
        };
        let position = center + Vec3::new(offset(0), offset(1), offset(2));
        surroundings(caster, position).is_open(CLEARANCE * grid.voxel_m).then_some(position)
    })
}
