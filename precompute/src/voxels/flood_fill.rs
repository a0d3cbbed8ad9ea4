//! Which empty voxels belong to the space to light.
//!
//! Empty voxels joined by faces form a component (joined by edges or corners, a diagonal wall would leak). A component
//! is open when it holds an interior point of the settings, or, where none is given, when rays say so.
//!
//! Differs from ANCHORS' reading of the flood fill, which drops a component whose rays as a whole meet more than 25 %
//! back faces: over a one-sided ground the space above and below is one component with half of each, and would be lost.
//! The 25 % apply to each sampled voxel by itself, and a component is dropped when hardly any of them passes. What is
//! behind surfaces in an open component is refused voxel by voxel when candidates are drawn.

use super::{Voxel, VoxelError, VoxelGrid};
use crate::{rays::RayCaster, settings::BakeSettings};
use glam::Vec3;
use localprt_formats::directions::spherical_fibonacci;
use rayon::prelude::*;

/// A point is behind surfaces when more than this share of its ray hits are back faces (the scaling paper's threshold).
pub const MAX_BACK_SHARE: f32 = 0.25;
/// Directions of [`surroundings`].
const RAYS: u32 = 32;
/// Sampled voxels per component: this many, up to twice as many. A region of 2 % of a component is missed with
/// probability 0.98^256 = 0.6 % even if samples fell at random.
const SAMPLES: usize = 256;
/// A component with a smaller share of passing voxels is enclosed. Passing inside a solid takes three in four rays to
/// meet front faces, which only stray triangles there can cause.
const LEAST_PASSING_SHARE: f32 = 0.02;

const EMPTY: u8 = 0;
const SOLID: u8 = 1;
const VISITED: u8 = 2;
const OPEN: u8 = 3;
const ENCLOSED: u8 = 4;

/// What the rays of a point met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Rays that met a surface.
    pub hits: u32,
    /// Rays that met the black back of a one-sided surface.
    pub backs: u32,
    /// Nearest hit, metres; infinite where no ray hit.
    pub clearance_m: f32,
}

impl Surroundings {
    /// Whether the point is behind surfaces or inside of a solid. Rays that leave the scene count for neither side.
    pub fn is_behind(&self) -> bool {
        self.backs as f32 > MAX_BACK_SHARE * self.hits as f32
    }

    /// Whether the point sees surfaces, stands in front of them, and this far from all.
    pub fn is_open(&self, clearance_m: f32) -> bool {
        self.hits > 0 && !self.is_behind() && self.clearance_m >= clearance_m
    }
}

/// Shoots 32 spherical Fibonacci rays from a point.
pub fn surroundings(caster: &RayCaster, point: Vec3) -> Surroundings {
    let mut found = Surroundings { hits: 0, backs: 0, clearance_m: f32::INFINITY };
    for ray in 0..RAYS {
        if let Some(hit) = caster.closest_hit(point, Vec3::from(spherical_fibonacci(ray, RAYS))) {
            found.hits += 1;
            found.backs += u32::from(hit.point.is_none());
            found.clearance_m = found.clearance_m.min(hit.t);
        }
    }
    found
}

/// Classifies every voxel; `solid` is `[z][y][x]` over the grid, whose own `voxels` are not read.
pub(super) fn classify(
    grid: &VoxelGrid,
    solid: Vec<bool>,
    caster: &RayCaster,
    settings: &BakeSettings,
) -> Result<Vec<Voxel>, VoxelError> {
    let mut states: Vec<u8> = solid.into_iter().map(u8::from).collect();
    let mut fill = Fill { grid, stack: Vec::new() };
    if settings.interior.is_empty() {
        let mut components = Vec::new();
        for seed in 0..states.len() {
            if states[seed] == EMPTY {
                let mut samples = Samples::default();
                fill.replace(&mut states, seed, VISITED, |index| samples.offer(index));
                components.push((seed, samples.kept));
            }
        }
        let open: Vec<bool> = components.par_iter().map(|(_, samples)| is_open(grid, samples, caster)).collect();
        for ((seed, _), open) in components.into_iter().zip(open) {
            fill.replace(&mut states, seed, if open { OPEN } else { ENCLOSED }, |_| ());
        }
    } else {
        for (index, &point) in settings.interior.iter().enumerate() {
            let seed = interior_voxel(grid, &states, index, point.into(), caster)?;
            if states[seed] == EMPTY {
                fill.replace(&mut states, seed, OPEN, |_| ());
            }
        }
    }
    let voxel = |state| match state {
        SOLID => Voxel::Solid,
        OPEN => Voxel::Open,
        _ => Voxel::Enclosed,
    };
    Ok(states.into_iter().map(voxel).collect())
}

/// Whether enough of a component's sampled voxels see front faces. One that sees nothing at all is open.
fn is_open(grid: &VoxelGrid, samples: &[usize], caster: &RayCaster) -> bool {
    let (passing, seeing) = samples
        .par_iter()
        .map(|&index| surroundings(caster, grid.center(grid.cell(index))))
        .filter(|found| found.hits > 0)
        .map(|found| (usize::from(!found.is_behind()), 1))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    passing as f32 >= LEAST_PASSING_SHARE * seeing as f32
}

/// The empty voxel an interior point stands for: its own, or the nearest neighbor of a solid one that it sees.
fn interior_voxel(
    grid: &VoxelGrid,
    states: &[u8],
    index: usize,
    point: Vec3,
    caster: &RayCaster,
) -> Result<usize, VoxelError> {
    let low = grid.origin;
    let Some(cell) = grid.cell_at(point) else {
        let high = low + grid.size.as_vec3() * grid.voxel_m;
        return Err(VoxelError::InteriorOutside { index, point, low, high });
    };
    if states[grid.index(cell)] != SOLID {
        return Ok(grid.index(cell));
    }
    grid.neighbors(cell)
        .filter(|&other| states[other] != SOLID)
        .map(|other| (other, grid.center(grid.cell(other))))
        .filter(|&(_, center)| caster.visible(point, center))
        .min_by(|a, b| a.1.distance_squared(point).total_cmp(&b.1.distance_squared(point)))
        .map(|(other, _)| other)
        .ok_or(VoxelError::InteriorSolid { index, point, voxel_m: grid.voxel_m })
}

/// Every k-th voxel of a component in the order visited, k a power of two, so that all parts of it are sampled.
#[derive(Default)]
struct Samples {
    kept: Vec<usize>,
    seen: usize,
    log2_step: u32,
}

impl Samples {
    fn offer(&mut self, index: usize) {
        if self.seen & ((1 << self.log2_step) - 1) == 0 {
            if self.kept.len() == 2 * SAMPLES {
                let mut rank = 0usize;
                self.kept.retain(|_| {
                    rank += 1;
                    rank % 2 == 1
                });
                self.log2_step += 1;
            }
            self.kept.push(index);
        }
        self.seen += 1;
    }
}

/// Row-wise flood fill over face neighbors; its stack holds one entry per run of a row, not per voxel.
struct Fill<'a> {
    grid: &'a VoxelGrid,
    stack: Vec<usize>,
}

impl Fill<'_> {
    /// Gives the region of equal state around `seed` the state `to` (another one), visiting each voxel once.
    fn replace(&mut self, states: &mut [u8], seed: usize, to: u8, mut visit: impl FnMut(usize)) {
        let from = states[seed];
        let width = self.grid.size.x as usize;
        let slice = width * self.grid.size.y as usize;
        self.stack.push(seed);
        while let Some(index) = self.stack.pop() {
            if states[index] != from {
                continue;
            }
            let row = index - index % width;
            let mut first = index;
            while first > row && states[first - 1] == from {
                first -= 1;
            }
            let mut end = index;
            while end < row + width && states[end] == from {
                end += 1;
            }
            for (offset, state) in states[first..end].iter_mut().enumerate() {
                *state = to;
                visit(first + offset);
            }
            let (y, z) = (row % slice / width, row / slice);
            let rows = [
                (y > 0).then(|| (first - width, end - width)),
                (y + 1 < self.grid.size.y as usize).then_some((first + width, end + width)),
                (z > 0).then(|| (first - slice, end - slice)),
                (z + 1 < self.grid.size.z as usize).then_some((first + slice, end + slice)),
            ];
            for (first, end) in rows.into_iter().flatten() {
                let mut inside = false;
                for (index, &state) in (first..end).zip(&states[first..end]) {
                    if state == from && !inside {
                        self.stack.push(index);
                    }
                    inside = state == from;
                }
            }
        }
    }
}
