//! Which voxels a triangle touches: exact triangle-box overlap, in f64.
//!
//! A voxel is solid when the closed voxel and the closed triangle share a point. No path of face-adjacent empty voxels
//! can then cross a surface, however thin.

use glam::{DVec3, UVec3, Vec3};
use localprt_scenes::Scene;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Boxes grow by this share of a voxel: far above the rounding of f64 coordinates (below 1e-12 voxels), far below
/// anything that matters.
const MARGIN: f64 = 1e-7;
/// Cells of a triangle's range above which its halves are done in parallel.
const PARALLEL_CELLS: u64 = 1 << 15;

/// Marks the voxels that any triangle touches, `[z][y][x]`. The result does not depend on the order of triangles.
pub(super) fn solid_voxels(scene: &Scene, origin: Vec3, voxel_m: f32, size: UVec3) -> Vec<bool> {
    let cells = size.x as usize * size.y as usize * size.z as usize;
    let solid: Vec<AtomicBool> = (0..cells).into_par_iter().map(|_| AtomicBool::new(false)).collect();
    let grid = Target { solid: &solid, size };
    let to_voxels = |point: Vec3| (point.as_dvec3() - origin.as_dvec3()) / f64::from(voxel_m);
    for (mesh_index, mesh) in scene.meshes.iter().enumerate() {
        (0..mesh.triangles.len()).into_par_iter().for_each(|triangle| {
            let triangle = Triangle::new(scene.corners(mesh_index, triangle).map(to_voxels));
            let (low, high) = triangle.cells(size);
            grid.mark(&triangle, low, high);
        });
    }
    solid.into_iter().map(AtomicBool::into_inner).collect()
}

/// A triangle in voxel units, with the axes of its separating-axis test.
pub(super) struct Triangle {
    corners: [DVec3; 3],
    low: DVec3,
    high: DVec3,
    normal: DVec3,
}

impl Triangle {
    pub(super) fn new(corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, low: a.min(b).min(c), high: a.max(b).max(c), normal: (b - a).cross(c - a) }
    }

    /// Lowest and highest cell of the triangle's box.
    fn cells(&self, size: UVec3) -> (UVec3, UVec3) {
        let last = (size - UVec3::ONE).as_dvec3();
        let cell = |point: DVec3| point.floor().clamp(DVec3::ZERO, last).as_uvec3();
        (cell(self.low - MARGIN), cell(self.high + MARGIN))
    }

    /// Whether the triangle and the closed box share a point: 13 separating axes.
    ///
    /// Source: Akenine-Möller 2001, Fast 3D Triangle-Box Overlap Testing.
    pub(super) fn overlaps(&self, center: DVec3, half: DVec3) -> bool {
        let half = half + MARGIN;
        if (self.low - center).cmpgt(half).any() || (center - self.high).cmpgt(half).any() {
            return false;
        }
        let [a, b, c] = self.corners.map(|corner| corner - center);
        if self.normal.dot(a).abs() > self.normal.abs().dot(half) {
            return false;
        }
        [b - a, c - b, a - c].into_iter().all(|edge| {
            [DVec3::new(0.0, -edge.z, edge.y), DVec3::new(edge.z, 0.0, -edge.x), DVec3::new(-edge.y, edge.x, 0.0)]
                .into_iter()
                .all(|axis| {
                    let (pa, pb, pc) = (axis.dot(a), axis.dot(b), axis.dot(c));
                    let reach = axis.abs().dot(half);
                    pa.min(pb).min(pc) <= reach && pa.max(pb).max(pc) >= -reach
                })
        })
    }
}

struct Target<'a> {
    solid: &'a [AtomicBool],
    size: UVec3,
}

impl Target<'_> {
    /// Marks the cells of a range (inclusive) that the triangle touches, by halving the range: the work follows the
    /// triangle's area and not its box.
    fn mark(&self, triangle: &Triangle, low: UVec3, high: UVec3) {
        let cells = high - low + UVec3::ONE;
        let half = 0.5 * cells.as_dvec3();
        if !triangle.overlaps(low.as_dvec3() + half, half) {
            return;
        }
        if cells == UVec3::ONE {
            let row = low.z as usize * self.size.y as usize + low.y as usize;
            self.solid[row * self.size.x as usize + low.x as usize].store(true, Ordering::Relaxed);
            return;
        }
        let axis = if cells.x >= cells.y && cells.x >= cells.z {
            0
        } else if cells.y >= cells.z {
            1
        } else {
            2
        };
        let (mut first_high, mut second_low) = (high, low);
        first_high[axis] = low[axis] + cells[axis] / 2 - 1;
        second_low[axis] = first_high[axis] + 1;
        let volume = u64::from(cells.x) * u64::from(cells.y) * u64::from(cells.z);
        if volume > PARALLEL_CELLS {
            rayon::join(|| self.mark(triangle, low, first_high), || self.mark(triangle, second_low, high));
        } else {
            self.mark(triangle, low, first_high);
            self.mark(triangle, second_low, high);
        }
    }
}
