//! Coarse cells of space, and which of them rays have crossed: what was found by rays stays true while nothing changes in those.

use crate::digest::Digester;
use glam::{IVec3, Vec3};

/// Cells along the longest side of the scene box, between this many and half of it.
const MOST_CELLS: f32 = 128.0;
/// How much larger than itself a thing counts, in edges of a cell: more than the rounding of a walk along a ray.
pub const MARGIN: f32 = 1e-3;

/// Cubes side by side over a scene. Their edge is a power of two metres and their corners are multiples of it, so that scenes of
/// about the same size have the same cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellGrid {
    edge_m: f32,
    /// Lowest cell, in cells.
    first: IVec3,
    /// Cells along each axis.
    size: IVec3,
}

/// Some cells of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct CellSet {
    grid: CellGrid,
    bits: Vec<u64>,
}

impl CellGrid {
    /// Over a box, metres.
    pub fn of((low, high): (Vec3, Vec3)) -> Self {
        let longest_m = (high - low).max_element();
        let edge_m = if longest_m > 0.0 { (longest_m / MOST_CELLS).log2().ceil().exp2() } else { 1.0 };
        let cell = |place: Vec3, margin: f32| (place / edge_m + margin).floor().as_ivec3();
        let first = cell(low, -2.0 * MARGIN);
        Self { edge_m, first, size: cell(high, 2.0 * MARGIN) - first + 1 }
    }

    /// Takes in which cells these are.
    pub fn digest(&self, digester: &mut Digester) {
        digester.one(self.edge_m).one(self.first).one(self.size);
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.size.as_i64vec3().element_product() as usize
    }

    /// Lowest and highest cell that a box touches, margins counted; `low` is above `high` if it lies outside.
    pub fn range(&self, low: Vec3, high: Vec3) -> (IVec3, IVec3) {
        let cell = |place: Vec3, margin: f32| (self.in_cells(place) + margin).floor().as_ivec3();
        (cell(low, -MARGIN).max(IVec3::ZERO), cell(high, MARGIN).min(self.size - 1))
    }

    /// A place in the world, in edges from the lowest corner: the difference first, so that scenes far from the origin lose nothing.
    pub fn in_cells(&self, place: Vec3) -> Vec3 {
        (place - self.first.as_vec3() * self.edge_m) / self.edge_m
    }

    /// Number of a cell.
    pub fn number(&self, cell: IVec3) -> usize {
        let [x, y, z] = cell.to_array().map(|value| value as usize);
        let size = self.size.as_usizevec3();
        (z * size.y + y) * size.x + x
    }

    /// Walks along a ray of length `t`, which may be infinite, and visits the cells that it crosses (Amanatides and Woo 1987).
    #[inline]
    fn walk(&self, origin: Vec3, dir: Vec3, t: f32, mut visit: impl FnMut(usize)) {
        let size = self.size.as_vec3();
        let (from, way) = (self.in_cells(origin), dir / self.edge_m);
        // Where it enters and leaves the grid.
        let inverse = way.recip();
        let (near, far) = (-from * inverse, (size - from) * inverse);
        // A component of 0 gives no bound: NaN where the ray lies in the plane itself.
        let bound = |a: f32, b: f32, low: f32, high: f32| match a.is_nan() || b.is_nan() {
            true => (low, high),
            false => (a.min(b), a.max(b)),
        };
        let (mut enter, mut leave) = (0.0f32, t);
        for axis in 0..3 {
            let (low, high) = bound(near[axis], far[axis], f32::NEG_INFINITY, f32::INFINITY);
            enter = enter.max(low);
            leave = leave.min(high);
        }
        if enter > leave {
            return;
        }
        let place = (from + way * enter).clamp(Vec3::ZERO, size);
        let mut cell = place.floor().as_ivec3().min(self.size - 1);
        let step = IVec3::from_array(way.to_array().map(|value| if value < 0.0 { -1 } else { 1 }));
        // Where it leaves a cell along an axis: of the planes' own numbers, so that no rounding adds up.
        let next_plane = |axis: usize, cell: i32| match way[axis] == 0.0 {
            true => f32::INFINITY,
            false => ((cell + step[axis].max(0)) as f32 - from[axis]) * inverse[axis],
        };
        let mut next = [0, 1, 2].map(|axis| next_plane(axis, cell[axis]));
        let strides = [1, self.size.x as isize, (self.size.x * self.size.y) as isize];
        let mut number = self.number(cell) as isize;
        loop {
            visit(number as usize);
            let axis = if next[0] <= next[1] && next[0] <= next[2] {
                0
            } else if next[1] <= next[2] {
                1
            } else {
                2
            };
            if next[axis] > leave {
                return;
            }
            cell[axis] += step[axis];
            if cell[axis] < 0 || cell[axis] >= self.size[axis] {
                return;
            }
            number += strides[axis] * step[axis] as isize;
            next[axis] = next_plane(axis, cell[axis]);
        }
    }
}

impl CellSet {
    /// None yet.
    pub fn new(grid: CellGrid) -> Self {
        Self { grid, bits: vec![0; grid.n_cells().div_ceil(64)] }
    }

    /// Takes in the cells that a ray of length `t` crosses; it may be infinite.
    #[inline]
    pub fn cross(&mut self, origin: Vec3, dir: Vec3, t: f32) {
        let Self { grid, bits } = self;
        grid.walk(origin, dir, t, |number| bits[number / 64] |= 1 << (number % 64));
    }

    /// As words of 64 cells by rising number.
    pub fn words(&self) -> &[u64] {
        &self.bits
    }

    /// From words; `None` if the grid has another number of cells.
    pub fn from_words(grid: CellGrid, bits: Vec<u64>) -> Option<Self> {
        let is_within = bits.len() == grid.n_cells().div_ceil(64)
            && bits.last().is_none_or(|last| grid.n_cells().is_multiple_of(64) || last >> (grid.n_cells() % 64) == 0);
        is_within.then_some(Self { grid, bits })
    }

    /// Numbers of its cells, rising.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.bits.iter().enumerate().flat_map(|(word, &bits)| {
            let mut bits = bits;
            std::iter::from_fn(move || {
                (bits != 0).then(|| {
                    let bit = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    64 * word + bit
                })
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_uniform;

    const LOW: Vec3 = Vec3::new(-3.3, 0.0, -11.0);
    const HIGH: Vec3 = Vec3::new(17.0, 5.1, 2.0);

    fn random(i: u64, axis: u64) -> f32 {
        counter_uniform(7, i, axis) as f32
    }

    #[test]
    fn scenes_of_about_the_same_size_have_the_same_cells() {
        let (a, b) = (CellGrid::of((LOW, HIGH)), CellGrid::of((LOW - 0.7, HIGH)));
        assert_eq!((a.edge_m, b.edge_m), (0.25, 0.25));
        for i in 0..200 {
            let place = LOW + Vec3::from([0, 1, 2].map(|axis| random(i, axis))) * (HIGH - LOW);
            let [cell, in_b] = [a, b].map(|grid| grid.range(place, place).0);
            assert_eq!(cell + a.first, in_b + b.first);
            assert!(a.number(cell) < a.n_cells());
        }
        assert!(CellGrid::of((LOW, LOW)).n_cells() <= 8);
    }

    #[test]
    fn every_point_of_a_ray_within_its_length_is_in_a_cell_that_it_crossed() {
        let grid = CellGrid::of((LOW, HIGH));
        for i in 0..2000 {
            let at = |first: u64| LOW + Vec3::from([0, 1, 2].map(|axis| random(i, first + axis))) * (HIGH - LOW);
            // Some along the axes, some along the planes between cells, some from outside.
            let origin = if i % 5 == 0 { (at(0) / grid.edge_m).round() * grid.edge_m } else { at(0) };
            let origin = if i % 7 == 0 { origin - Vec3::Y * 30.0 } else { origin };
            let dir = if i % 3 == 0 { Vec3::AXES[i as usize % 3] } else { (at(3) - origin).normalize() };
            let t = if i % 2 == 0 { f32::INFINITY } else { 9.0 * random(i, 6) };
            let mut crossed = CellSet::new(grid);
            crossed.cross(origin, dir, t);
            let cells: Vec<usize> = crossed.iter().collect();
            assert!(cells.windows(2).all(|pair| pair[0] < pair[1]));
            for step in 0..200 {
                let place = origin + dir * t.min(60.0) * (step as f32 / 199.0);
                let (low, high) = grid.range(place, place);
                let inside = place.cmpge(LOW).all() && place.cmple(HIGH).all();
                if !inside {
                    continue;
                }
                // With the margin that things have, one of the cells around.
                let mut found = false;
                for z in low.z..=high.z {
                    for y in low.y..=high.y {
                        for x in low.x..=high.x {
                            found |= cells.binary_search(&grid.number(IVec3::new(x, y, z))).is_ok();
                        }
                    }
                }
                assert!(found, "{place} of {origin} {dir} {t}");
            }
            assert!(cells.len() < 4 * (128 + 64), "{} cells", cells.len());
        }
    }
}
