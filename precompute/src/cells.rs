//! Coarse cells of space, and which of them rays have crossed: what was found by rays stays true while nothing changes in those.

use crate::digest::Digester;
use glam::{IVec3, Vec3};
use std::collections::HashMap;

/// Cells along the longest side of the scene box, between this many and half of it.
const MOST_CELLS: f32 = 64.0;
/// Edge of the blocks in which rays start, in cells: rays of a leaf start close to each other.
const BLOCK: i32 = 4;
/// How much larger than itself a thing counts, in edges of a cell: more than the rounding of where rays are.
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

/// Rays by the block of cells in which they start and the cell in which they end. Of the many rays between two of them one is kept: a
/// leaf has millions of rays, and to walk along each would cost half as much as to trace it.
#[derive(Clone, Debug)]
pub struct Crossings {
    grid: CellGrid,
    /// Blocks of cells in which rays start, by their lowest cell, and the cells in which those end.
    starts: Vec<(u32, CellSet)>,
    /// Where in `starts` a block is.
    place: HashMap<u32, usize>,
    /// Start of the last ray, and its place.
    last: (u32, usize),
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

    /// First and last cell of a ray of length `t` within the grid; `None` if it misses it.
    #[inline]
    fn ends(&self, origin: Vec3, dir: Vec3, t: f32) -> Option<[IVec3; 2]> {
        let size = self.size.as_vec3();
        let (from, way) = (self.in_cells(origin), dir / self.edge_m);
        let to = from + way * t;
        let is_inside = |place: Vec3| place.cmpge(Vec3::ZERO).all() && place.cmple(size).all();
        let cell = |place: Vec3| place.floor().as_ivec3().clamp(IVec3::ZERO, self.size - 1);
        if is_inside(from) && is_inside(to) {
            return Some([cell(from), cell(to)]);
        }
        let (mut enter, mut leave) = (0.0f32, t);
        for axis in 0..3 {
            if way[axis] == 0.0 {
                if from[axis] < 0.0 || from[axis] > size[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = (-from[axis] / way[axis], (size[axis] - from[axis]) / way[axis]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter <= leave).then(|| [enter, leave].map(|t| cell(from + way * t)))
    }

    /// Visits all cells that some straight line from a block of cells, given by the lowest of them, to a cell may touch, and some beside
    /// them: slab by slab, the box of what a cube touches there that moves from the one to the other and shrinks on its way.
    fn between(&self, block: IVec3, end: IVec3, mut visit: impl FnMut(usize)) {
        // Lower and upper corner of the cube, at its start and at its end.
        let low = [block.as_vec3() - MARGIN, end.as_vec3() - MARGIN];
        let high = [(block + BLOCK).as_vec3() + MARGIN, (end + 1).as_vec3() + MARGIN];
        let at = |[from, to]: [Vec3; 2], share: f32| from + (to - from) * share;
        let main = (end - block).abs().max_position();
        let slabs = block[main].min(end[main])..=(block[main] + BLOCK - 1).max(end[main]);
        for slab in slabs {
            // Its way while it is in this slab.
            let mut way = [0.0f32, 1.0];
            for ([from, to], limit) in [(low.map(|low| low[main]), slab + 1), (high.map(|high| -high[main]), -slab)] {
                let reached = (limit as f32 - from) / (to - from);
                if to > from {
                    way[1] = way[1].min(reached);
                } else if to < from {
                    way[0] = way[0].max(reached);
                }
            }
            let mut least = at(low, way[0]).min(at(low, way[1])).floor().as_ivec3().max(IVec3::ZERO);
            let mut most = at(high, way[0]).max(at(high, way[1])).floor().as_ivec3().min(self.size - 1);
            (least[main], most[main]) = (slab, slab);
            if slab < self.size[main] {
                self.visit_box(least, most, &mut visit);
            }
        }
    }

    fn visit_box(&self, low: IVec3, high: IVec3, visit: &mut impl FnMut(usize)) {
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let first = self.number(IVec3::new(low.x, y, z));
                (first..=first + (high.x - low.x) as usize).for_each(&mut *visit);
            }
        }
    }

    /// The cell of a number.
    fn cell(&self, number: usize) -> IVec3 {
        let size = self.size.as_usizevec3();
        let (x, rest) = (number % size.x, number / size.x);
        IVec3::new(x as i32, (rest % size.y) as i32, (rest / size.y) as i32)
    }
}

impl Crossings {
    /// No rays yet.
    pub fn new(grid: CellGrid) -> Self {
        Self { grid, starts: Vec::new(), place: HashMap::new(), last: (u32::MAX, 0) }
    }

    /// Takes in a ray of length `t`, which may be infinite. It costs least if rays that follow each other start in one cell.
    #[inline]
    pub fn cross(&mut self, origin: Vec3, dir: Vec3, t: f32) {
        let Some([from, to]) = self.grid.ends(origin, dir, t) else { return };
        let start = self.grid.number(from / BLOCK * BLOCK) as u32;
        if self.last.0 != start {
            let Self { grid, starts, place, .. } = self;
            let place = *place.entry(start).or_insert_with(|| {
                starts.push((start, CellSet::new(*grid)));
                starts.len() - 1
            });
            self.last = (start, place);
        }
        self.starts[self.last.1].1.insert(self.grid.number(to));
    }

    /// The cells that any of them crossed, and some beside them.
    pub fn cells(&self) -> CellSet {
        let mut cells = CellSet::new(self.grid);
        for (start, ends) in &self.starts {
            let start = self.grid.cell(*start as usize);
            for end in ends.iter() {
                self.grid.between(start, self.grid.cell(end), |cell| cells.insert(cell));
            }
        }
        cells
    }
}

impl CellSet {
    /// None yet.
    pub fn new(grid: CellGrid) -> Self {
        Self { grid, bits: vec![0; grid.n_cells().div_ceil(64)] }
    }

    #[inline]
    fn insert(&mut self, number: usize) {
        self.bits[number / 64] |= 1 << (number % 64);
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
        assert_eq!((a.edge_m, b.edge_m), (0.5, 0.5));
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
            let mut crossed = Crossings::new(grid);
            crossed.cross(origin, dir, t);
            let cells: Vec<usize> = crossed.cells().iter().collect();
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
            // And no others but those beside it. Worst is a diagonal: while the cube of the block is in a slab it moves by its edge and
            // one along each other axis; the box of its way reaches half of that and half an edge from its middle, and by the margins
            // into one cell more; the ray is up to half an edge beside the middle.
            let most = (1.5 * BLOCK as f32 + 1.5) * 2.0f32.sqrt();
            for &cell in &cells {
                let middle = (grid.cell(cell) + grid.first).as_vec3() + 0.5;
                let along = (middle * grid.edge_m - origin).dot(dir).clamp(0.0, t);
                let apart = middle.distance((origin + dir * along) / grid.edge_m);
                assert!(apart <= most, "{apart} cells from {origin} {dir} {t}");
            }
        }
    }
}
