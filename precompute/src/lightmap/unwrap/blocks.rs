//! Small charts in blocks, so that few things are left to be nested into each other.
//!
//! The packer looks for a place for every chart from the top of the map, which takes a minute for the ten thousand leaves, links and
//! bolts of a furnished scene. Of a chart of few texels most is padding, and its shape leaves nothing to nest into: such charts lie on
//! shelves in square blocks, and a block is packed as one rectangle.

use super::{PADDING, uv_unwrap::FlatChart};
use glam::{Mat2, Vec2};

/// Charts that are packed by their shapes, at most: the largest.
const MOST_SHAPES: usize = 2500;
/// Blocks of the others, about.
const BLOCKS: f32 = 200.0;
/// Least edge of a block, texels.
const LEAST_EDGE: f32 = 48.0;
/// Ways that a small chart may be turned, within a right angle.
const TURNS: u32 = 6;

/// Charts on shelves.
pub(super) struct Block {
    /// Edges of the rectangle, texels, without the padding around it.
    pub size: [u32; 2],
    /// Each chart with its triangles' corners in the block, texels.
    pub charts: Vec<(usize, Vec<[Vec2; 3]>)>,
}

/// A chart as it lies in a block: its corners in texels from its own lowest corner, and how many texels it takes.
struct Small {
    chart: usize,
    corners: Vec<[Vec2; 3]>,
    size: [u32; 2],
}

/// Charts that are few or large enough to be packed by themselves, rising, and blocks of the others.
pub(super) fn blocks(charts: &[FlatChart], texels_per_unit: f32) -> (Vec<usize>, Vec<Block>) {
    let mut by_size: Vec<usize> = (0..charts.len()).collect();
    if charts.len() <= MOST_SHAPES {
        return (by_size, Vec::new());
    }
    let size: Vec<f32> = charts.iter().map(|chart| chart.density * bounds(&chart.corners).1.element_sum()).collect();
    by_size.sort_by(|&a, &b| size[b].total_cmp(&size[a]).then(a.cmp(&b)));
    let mut small: Vec<Small> = by_size
        .split_off(MOST_SHAPES)
        .into_iter()
        .map(|chart| Small::of(chart, &charts[chart], charts[chart].density * texels_per_unit))
        .collect();
    by_size.sort_unstable();
    // The tallest first, so that a shelf wastes little above its charts.
    small.sort_by_key(|small| (std::cmp::Reverse(small.size), small.chart));
    let area: f32 = small.iter().map(|small| small.padded().map(|edge| edge as f32).iter().product::<f32>()).sum();
    let widest = small.iter().map(|small| small.padded()[1]).max().unwrap_or(1);
    let edge = ((area / BLOCKS).sqrt().max(LEAST_EDGE) as u32).max(widest);
    (by_size, on_shelves(small, edge))
}

impl Small {
    /// Turned to take the fewest texels, and upright: no wider than high.
    fn of(chart: usize, flat: &FlatChart, density: f32) -> Self {
        let turned = |turn: u32| {
            let angle = Mat2::from_angle(turn as f32 / TURNS as f32 * std::f32::consts::FRAC_PI_2);
            let mut corners: Vec<[Vec2; 3]> =
                flat.corners.iter().map(|triangle| triangle.map(|corner| angle * corner * density)).collect();
            let (low, edges) = bounds(&corners);
            // Whole texels, but for rounding.
            let [mut width, mut height] = edges.to_array().map(|edge| (edge - 1e-3).ceil().max(1.0) as u32);
            let upright = width > height;
            for corner in corners.iter_mut().flatten() {
                *corner -= low;
                if upright {
                    *corner = Vec2::new(edges.y - corner.y, corner.x);
                }
            }
            if upright {
                (width, height) = (height, width);
            }
            Self { chart, corners, size: [height, width] }
        };
        let texels = |small: &Self| small.padded().iter().product::<u32>();
        (1..TURNS).map(turned).fold(turned(0), |best, other| if texels(&other) < texels(&best) { other } else { best })
    }

    /// Height and width with padding on both sides.
    fn padded(&self) -> [u32; 2] {
        self.size.map(|edge| edge + 2 * PADDING)
    }
}

/// Fills block after block with shelves, and shelves from left to right.
fn on_shelves(small: Vec<Small>, edge: u32) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    // Where the next chart goes, where the next shelf begins, and how wide the widest is.
    let (mut x, mut shelf, mut next) = (0, 0, u32::MAX);
    for small in small {
        let [height, width] = small.padded();
        if next != u32::MAX && x + width > edge {
            (x, shelf) = (0, next);
        }
        if next == u32::MAX || (x == 0 && shelf + height > edge.max(height)) {
            blocks.push(Block { size: [0, 0], charts: Vec::new() });
            (x, shelf, next) = (0, 0, 0);
        }
        let block = blocks.last_mut().expect("the one begun");
        // The rectangle that is packed has a padding of its own.
        let place = Vec2::new(x as f32, shelf as f32);
        let corners = small.corners.iter().map(|triangle| triangle.map(|corner| corner + place)).collect();
        block.charts.push((small.chart, corners));
        x += width;
        next = next.max(shelf + height);
        block.size = [block.size[0].max(x - 2 * PADDING), block.size[1].max(next - 2 * PADDING)];
    }
    blocks
}

/// Lowest corner and edges of the box around some triangles.
fn bounds(triangles: &[[Vec2; 3]]) -> (Vec2, Vec2) {
    let corners = || triangles.iter().flatten();
    let low = corners().fold(Vec2::INFINITY, |low, corner| low.min(*corner));
    let high = corners().fold(Vec2::NEG_INFINITY, |high, corner| high.max(*corner));
    if low.x > high.x { (Vec2::ZERO, Vec2::ZERO) } else { (low, high - low) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_charts_lie_apart_in_blocks() {
        // 5000 triangles of many sizes, and lines.
        let chart = |number: usize| {
            let (width, height) = (0.1 + (number % 7) as f32, (number % 5) as f32);
            let corners = vec![[Vec2::new(3.0, 2.0), Vec2::new(3.0 + width, 2.0), Vec2::new(3.0, 2.0 + height)]];
            FlatChart { corners, density: 1.0 + (number % 3) as f32 }
        };
        let charts: Vec<FlatChart> = (0..5000).map(chart).collect();
        let (large, blocks) = blocks(&charts, 1.5);
        assert_eq!(large.len(), MOST_SHAPES);
        assert!((10..400).contains(&blocks.len()), "{}", blocks.len());
        let mut seen = vec![false; charts.len()];
        large.iter().for_each(|&chart| seen[chart] = true);
        let mut taken = 0.0;
        for block in &blocks {
            let mut boxes = Vec::new();
            for (chart, corners) in &block.charts {
                assert!(!std::mem::replace(&mut seen[*chart], true), "twice");
                let (low, edges) = bounds(corners);
                assert!(low.min_element() >= 0.0 && (low + edges).x <= block.size[0] as f32 + 1e-3);
                assert!((low + edges).y <= block.size[1] as f32 + 1e-3, "{:?}", block.size);
                // Lengths stay.
                let flat = &charts[*chart];
                let long = |[a, b, _]: [Vec2; 3], density: f32| a.distance(b) * density;
                assert!((long(corners[0], 1.0) - long(flat.corners[0], 1.5 * flat.density)).abs() < 1e-3);
                boxes.push((low, low + edges));
            }
            for (index, a) in boxes.iter().enumerate() {
                for b in &boxes[..index] {
                    let apart = (a.0 - b.1).max(b.0 - a.1).max_element();
                    assert!(apart >= 2.0 * PADDING as f32 - 1e-2, "{apart}");
                }
            }
            taken += (block.size[0] + 2 * PADDING) as f32 * (block.size[1] + 2 * PADDING) as f32;
        }
        assert!(seen.iter().all(|seen| *seen));
        let needed: f32 = blocks
            .iter()
            .flat_map(|block| &block.charts)
            .map(|(_, corners)| (bounds(corners).1.ceil().max(Vec2::ONE) + 2.0 * PADDING as f32).element_product())
            .sum();
        assert!(needed / taken > 0.85, "{}", needed / taken);
    }
}
