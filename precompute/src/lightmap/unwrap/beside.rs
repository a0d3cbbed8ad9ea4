//! Charts beside those that a map has: the first free place for each, the largest first.

use super::{
    Progress, UnwrapError,
    uv_unwrap::{FlatChart, Packed},
};
use glam::Vec2;
use localprt_surfaces::atlas::raster::Footprint;

/// Texels of a map that nobody has.
pub(super) struct FreeTexels {
    size: u32,
    /// `[size][size]` how many texels are free from here to the right, this one counted.
    run: Vec<u32>,
}

/// Texels of a chart, and those around it that it keeps free: `[first, end)` in each row, from its own corner.
struct Mask {
    rows: Vec<Vec<[u32; 2]>>,
    width: u32,
    /// Texels of it.
    count: usize,
}

impl FreeTexels {
    /// Of a map that holds these triangles, and keeps `padding` texels around each and from its own border.
    pub(super) fn of(size: u32, triangles: impl Iterator<Item = [Vec2; 3]>, padding: u32) -> Self {
        let mut free = vec![true; size as usize * size as usize];
        for footprint in triangles.filter_map(|uv| Footprint::new(uv, size)) {
            for y in footprint.rows(size) {
                let columns = footprint.columns(y, size);
                if columns.is_empty() {
                    continue;
                }
                let (first, end) = (columns.start.saturating_sub(padding), (columns.end + padding).min(size));
                for y in y.saturating_sub(padding)..(y + padding + 1).min(size) {
                    free[(y * size + first) as usize..(y * size + end) as usize].fill(false);
                }
            }
        }
        let is_border = |at: u32| at < padding || at + padding >= size;
        let mut run = vec![0; free.len()];
        for y in 0..size {
            let mut length = 0;
            for x in (0..size).rev() {
                let at = (y * size + x) as usize;
                length = if free[at] && !is_border(x) && !is_border(y) { length + 1 } else { 0 };
                run[at] = length;
            }
        }
        Self { size, run }
    }

    /// Takes the first place at which a mask is free, row by row; `None` if there is none.
    fn take(&mut self, mask: &Mask) -> Option<[u32; 2]> {
        let height = mask.rows.len() as u32;
        for y in 0..(self.size + 1).saturating_sub(height) {
            let mut x = 0;
            while x + mask.width <= self.size {
                match self.blocked(mask, x, y) {
                    Some(step) => x += step,
                    None => {
                        self.fill(mask, x, y);
                        return Some([x, y]);
                    }
                }
            }
        }
        None
    }

    /// How far to the right the next place is that can be free; `None` if this one is.
    fn blocked(&self, mask: &Mask, x: u32, y: u32) -> Option<u32> {
        mask.rows.iter().zip(y..).find_map(|(row, y)| {
            row.iter().find_map(|&[first, end]| {
                let free = self.run[(y * self.size + x + first) as usize];
                // The texel behind the free ones is taken, and so is any place at which the mask would hold it.
                (free < end - first).then_some(free + 1)
            })
        })
    }

    fn fill(&mut self, mask: &Mask, x: u32, y: u32) {
        for (row, y) in mask.rows.iter().zip(y..) {
            let of_row = &mut self.run[(y * self.size) as usize..((y + 1) * self.size) as usize];
            for &[first, end] in row {
                let (first, end) = ((x + first) as usize, (x + end) as usize);
                of_row[first..end].fill(0);
                let mut length = 0;
                for run in of_row[..first].iter_mut().rev().take_while(|run| **run > 0) {
                    length += 1;
                    *run = length;
                }
            }
        }
    }
}

impl Mask {
    /// Of triangles in texels, from their own corner, with `padding` texels around.
    fn of(triangles: &[[Vec2; 3]], padding: u32) -> Self {
        let high = triangles.iter().flatten().fold(Vec2::ZERO, |high, corner| high.max(*corner));
        let size = high.max_element().ceil() as u32 + 1;
        let (width, height) = (high.x.ceil() as u32 + 1, high.y.ceil() as u32 + 1);
        let mut texels = vec![false; (width * height) as usize];
        for footprint in triangles.iter().filter_map(|corners| Footprint::new(corners.map(|at| at / size as f32), size))
        {
            for y in footprint.rows(size) {
                footprint.columns(y, size).for_each(|x| texels[(y * width + x) as usize] = true);
            }
        }
        let count = texels.iter().filter(|texel| **texel).count();
        let has_texel = |x: u32, y: u32| x < width && y < height && texels[(y * width + x) as usize];
        let around = |at: u32| at.saturating_sub(2 * padding)..=at;
        let row = |y: u32| {
            let is_held = |x: u32| around(y).any(|y| around(x).any(|x| has_texel(x, y)));
            let mut runs: Vec<[u32; 2]> = Vec::new();
            for x in (0..width + 2 * padding).filter(|&x| is_held(x)) {
                match runs.last_mut() {
                    Some([_, end]) if *end == x => *end = x + 1,
                    _ => runs.push([x, x + 1]),
                }
            }
            runs
        };
        let mut rows: Vec<Vec<[u32; 2]>> = (0..height + 2 * padding).map(row).collect();
        while rows.last().is_some_and(Vec::is_empty) {
            rows.pop();
        }
        let width = rows.iter().flatten().map(|[_, end]| *end).max().unwrap_or_default();
        Self { rows, width, count }
    }
}

/// Packs charts at their densities into free texels, `padding` texels around each. `None` if they do not fit.
///
/// # Errors
/// [`UnwrapError::Cancelled`].
pub(super) fn pack_beside(
    charts: &[FlatChart],
    mut free: FreeTexels,
    padding: u32,
    progress: Progress,
) -> Result<Option<Packed>, UnwrapError> {
    let in_texels: Vec<Vec<[Vec2; 3]>> = charts
        .iter()
        .map(|chart| {
            let low = chart.corners.iter().flatten().fold(Vec2::INFINITY, |low, &corner| low.min(corner));
            chart.corners.iter().map(|corners| corners.map(|corner| (corner - low) * chart.density)).collect()
        })
        .collect();
    // None that is larger than the map, and not more than there is room for.
    let high = in_texels.iter().flatten().flatten().map(|at| at.max_element()).fold(0.0, f32::max);
    if high.is_nan() || high + 2.0 + 2.0 * padding as f32 > free.size as f32 {
        return Ok(None);
    }
    let masks: Vec<Mask> = in_texels.iter().map(|triangles| Mask::of(triangles, padding)).collect();
    if masks.iter().map(|mask| mask.count).sum::<usize>() > free.run.iter().filter(|run| **run > 0).count() {
        return Ok(None);
    }
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by_key(|&chart| std::cmp::Reverse(masks[chart].count));
    let mut corners: Vec<Vec<Option<[Vec2; 3]>>> = vec![Vec::new(); charts.len()];
    for (done, chart) in order.into_iter().enumerate() {
        if !progress("packing charts", done, charts.len()) {
            return Err(UnwrapError::Cancelled);
        }
        let Some([x, y]) = free.take(&masks[chart]) else { return Ok(None) };
        let corner = Vec2::new((x + padding) as f32, (y + padding) as f32);
        corners[chart] = in_texels[chart].iter().map(|corners| Some(corners.map(|at| at + corner))).collect();
    }
    Ok(Some(Packed { corners, extent: [free.size; 2] }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_uniform;

    fn rectangle(width: f32, height: f32) -> FlatChart {
        let [a, b, c, d] = [Vec2::ZERO, Vec2::new(width, 0.0), Vec2::new(width, height), Vec2::new(0.0, height)];
        FlatChart { corners: vec![[a, b, c], [a, c, d]], density: 2.0 }
    }

    /// How many charts touch each texel, with a texel around each.
    fn held(size: u32, charts: &[Vec<[Vec2; 3]>]) -> Vec<u32> {
        let mut held = vec![0; (size * size) as usize];
        for chart in charts {
            let own = FreeTexels::of(size, chart.iter().map(|corners| corners.map(|at| at / size as f32)), 1);
            for (held, run) in held.iter_mut().zip(&own.run) {
                *held += u32::from(*run == 0);
            }
        }
        held
    }

    #[test]
    fn charts_go_where_nobody_is_and_keep_apart() {
        let size = 64;
        // What is there: a square in the middle.
        let there: Vec<[Vec2; 3]> =
            rectangle(10.0, 10.0).corners.iter().map(|corners| corners.map(|at| 2.0 * at + 20.0)).collect();
        let charts: Vec<FlatChart> = (0..40)
            .map(|i| {
                rectangle(0.4 + 4.0 * counter_uniform(3, i, 0) as f32, 0.4 + 2.0 * counter_uniform(3, i, 1) as f32)
            })
            .collect();
        let free = FreeTexels::of(size, there.iter().map(|corners| corners.map(|at| at / size as f32)), 1);
        let packed = pack_beside(&charts, free, 1, &|_, _, _| true).expect("not cancelled").expect("fits");
        let mut all: Vec<Vec<[Vec2; 3]>> = vec![there];
        all.extend(packed.corners.iter().map(|chart| chart.iter().flatten().copied().collect()));
        let border = |index: u32| [index % size, index / size].iter().any(|at| *at == 0 || *at == size - 1);
        for (held, index) in held(size, &all).into_iter().zip(0..) {
            // A border texel belongs to nobody, and counts once for each chart here.
            assert!(border(index) || held <= 1, "texel {index} is held {held} times");
        }
        for (chart, packed) in charts.iter().zip(&packed.corners) {
            let size = |corners: [Vec2; 3]| corners[2] - corners[0];
            let packed = packed[0].expect("a place");
            assert!(size(packed).abs_diff_eq(2.0 * size(chart.corners[0]), 1e-4));
        }
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let free = || FreeTexels::of(32, std::iter::empty(), 1);
        assert!(pack_beside(&[rectangle(14.0, 14.0)], free(), 1, &|_, _, _| true).expect("runs").is_some());
        assert!(pack_beside(&[rectangle(16.0, 14.0)], free(), 1, &|_, _, _| true).expect("runs").is_none());
        assert!(pack_beside(&[rectangle(14.0, 14.0)], free(), 1, &|_, _, _| false).is_err());
    }
}
