//! Volume for objects that move: a regular grid over the scene box, and which of its cells are in the open.
//!
//! A cell is in the open by the rules for probe candidates: not in a solid or enclosed voxel, and not behind surfaces by
//! what rays from it meet. Such cells are receivers without a normal; [`crate::transport`] gathers their light from all
//! directions. Cells inside geometry take the values of the nearest one in the open, so that a trilinear lookup beside a
//! wall does not find darkness.

#[cfg(test)]
mod tests;

use crate::{
    rays::RayCaster,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use localprt_formats::{VolumeGrid, check::MAX_VOLUME_CELLS};
use rayon::prelude::*;

/// How far a cell may lie from the one whose values it takes, in spacings.
const FILL_REACH: i32 = 3;
/// A box may stick out of the grid by this share of a spacing: else rounding would add a layer of cells.
const ROUNDING: f64 = 1e-5;

/// A grid with more cells than a file may hold.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{cells:.0} cells")]
pub struct TooManyCells {
    /// Cells asked for.
    pub cells: f64,
}

/// Cells of a volume by what they hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeCells {
    /// Where the cells lie.
    pub grid: VolumeGrid,
    /// Cells in the open, rising: the volume receivers.
    pub cells: Vec<u32>,
    /// Their positions, metres.
    pub positions: Vec<Vec3>,
    /// `[cell, cell]`: one inside geometry, by rising number, and the one in the open that it takes its values from.
    pub fill: Vec<[u32; 2]>,
}

/// The grid of a spacing over a box in metres: `ceil(extent / spacing) + 1` cells per axis, centered on the box.
///
/// # Errors
/// [`TooManyCells`] above [`MAX_VOLUME_CELLS`].
pub fn grid((low, high): (Vec3, Vec3), spacing_m: f32, degree: u32) -> Result<VolumeGrid, TooManyCells> {
    let spacing = f64::from(spacing_m);
    let steps = ((high.as_dvec3() - low.as_dvec3()) / spacing - ROUNDING).ceil().max(glam::DVec3::ZERO);
    let cells = (steps + 1.0).element_product();
    if cells > MAX_VOLUME_CELLS as f64 {
        return Err(TooManyCells { cells });
    }
    let origin = 0.5 * (low.as_dvec3() + high.as_dvec3()) - 0.5 * spacing * steps;
    let dims = (steps + 1.0).as_uvec3();
    Ok(VolumeGrid { origin: origin.as_vec3().to_array(), spacing_m, dims: dims.to_array(), degree })
}

/// Finds the cells in the open, and what fills the others.
pub fn cells(grid: VolumeGrid, voxels: &VoxelGrid, caster: &RayCaster) -> VolumeCells {
    let n_cells = grid.n_cells() as usize;
    let position = |cell: usize| Vec3::from(grid.position(cell));
    let is_open: Vec<bool> = (0..n_cells)
        .into_par_iter()
        .map(|cell| {
            // Outside of the voxels there is nothing solid.
            matches!(voxels.at(position(cell)), None | Some(Voxel::Open))
                && !surroundings(caster, position(cell)).is_behind()
        })
        .collect();
    let cells: Vec<u32> = (0..n_cells as u32).filter(|&cell| is_open[cell as usize]).collect();
    let near = nearest_first();
    let fill = (0..n_cells)
        .into_par_iter()
        .filter(|&cell| !is_open[cell])
        .filter_map(|cell| {
            let at = grid.coordinates(cell).map(|coordinate| coordinate as i32);
            near.iter().find_map(|step| {
                let source = [0, 1, 2].map(|axis| at[axis] + step[axis]);
                let inside = (0..3).all(|axis| (0..grid.dims[axis] as i32).contains(&source[axis]));
                let source = inside.then(|| grid.index(source.map(|coordinate| coordinate as u32)))?;
                is_open[source].then_some([cell as u32, source as u32])
            })
        })
        .collect();
    let positions = cells.iter().map(|&cell| position(cell as usize)).collect();
    VolumeCells { grid, cells, positions, fill }
}

/// Steps to other cells within [`FILL_REACH`], the nearest first, those of equal length by z, y, x.
fn nearest_first() -> Vec<[i32; 3]> {
    let range = || -FILL_REACH..=FILL_REACH;
    let length = |step: &[i32; 3]| step.iter().map(|axis| axis * axis).sum::<i32>();
    let mut steps: Vec<[i32; 3]> = range()
        .flat_map(|z| range().flat_map(move |y| range().map(move |x| [x, y, z])))
        .filter(|step| (1..=FILL_REACH * FILL_REACH).contains(&length(step)))
        .collect();
    steps.sort_by_key(length);
    steps
}
