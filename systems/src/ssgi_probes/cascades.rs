//! Cascades: nested grids of probes around the camera, each twice as wide as the one inside it.
//!
//! Grids follow the camera in steps of their own spacing. Nothing is copied when they do: the light stays at its place in the grid, and
//! so moves with the camera until samples have corrected it (sec. 6.2).

use crate::ProbeGrid;
use glam::Vec3;
use localprt_formats::directions::counter_uniform;

/// Cells over which a cascade fades into the next, at its border; not more than a quarter of its cells.
const FADE_CELLS: f32 = 1.0;

/// Nested grids, finest first, of the same number of probes each.
#[derive(Clone, Debug, PartialEq)]
pub struct Cascades {
    grids: Vec<ProbeGrid>,
    /// Where the last one stands, if no grid leaves it.
    within: Option<ProbeGrid>,
}

impl Cascades {
    /// `count` grids around `middle`, with not more than so many probes together (but 8 each). The last one reaches `reach` metres to
    /// both sides of its own middle along each axis, which is within half a spacing of the eye.
    pub fn new(middle: Vec3, reach: Vec3, probes: usize, count: usize) -> Self {
        let mut cascades =
            Self { grids: nested(ProbeGrid::over((-reach, reach), probes / count.max(1)), count), within: None };
        cascades.follow(middle);
        cascades
    }

    /// The same with grids that stay within a box: the last one fills it, each probe in the middle of its part, and the others are as near
    /// to the eye as they get without leaving it.
    pub fn within(bounds: (Vec3, Vec3), probes: usize, count: usize) -> Self {
        let last = ProbeGrid::within(bounds, probes / count.max(1), 0.5);
        let mut cascades = Self { grids: nested(last, count), within: Some(last) };
        cascades.follow((bounds.0 + bounds.1) * 0.5);
        cascades
    }

    /// Moves every grid to the multiple of its spacing that is next to the eye.
    pub fn follow(&mut self, eye: Vec3) {
        for grid in &mut self.grids {
            let middle = (eye / grid.spacing).round() * grid.spacing;
            grid.low = middle - grid.width() * 0.5;
            if let Some(most) = self.within {
                grid.low = grid.low.clamp(most.low, most.low + most.width() - grid.width());
            }
        }
    }

    /// Number of probes.
    pub fn probes(&self) -> usize {
        self.grids.iter().map(ProbeGrid::len).sum()
    }

    /// Grids, finest first.
    pub fn grids(&self) -> &[ProbeGrid] {
        &self.grids
    }

    /// Where a probe stands, metres: at its vertex, or, with a key for random numbers, anywhere in the cell around it.
    pub fn position(&self, probe: usize, jitter: Option<u64>) -> Vec3 {
        let each = self.grids[0].len();
        let grid = &self.grids[probe / each];
        let within = |axis: u64, key| counter_uniform(key, probe as u64, axis) as f32 - 0.5;
        let offset = jitter.map_or(Vec3::ZERO, |key| Vec3::new(within(0, key), within(1, key), within(2, key)));
        grid.position(grid.at(probe % each)) + offset * grid.spacing
    }

    /// Probes around a point, with weights that sum to 1: trilinear in each cascade, the finest one that holds the point first, and
    /// across its border the next. The last one holds all that is left, by the probes at its border where it does not reach.
    pub fn around(&self, point: Vec3, mut probe: impl FnMut(usize, f32)) {
        let mut left = 1.0;
        for (number, grid) in self.grids.iter().enumerate() {
            let is_last = number + 1 == self.grids.len();
            let share = left * if is_last { 1.0 } else { inside(grid, point) };
            left -= share;
            if share > 0.0 {
                for (at, weight) in grid.cage(point).probes() {
                    probe(number * grid.len() + grid.index(at), share * weight);
                }
            }
        }
    }
}

/// Grids of as many probes, of which the last is given and every other half as wide as the next.
fn nested(last: ProbeGrid, count: usize) -> Vec<ProbeGrid> {
    let finer = |steps: usize| ProbeGrid { spacing: last.spacing / (1u64 << steps) as f32, ..last };
    (0..count.max(1)).rev().map(finer).collect()
}

/// 1 well inside of a grid, 0 outside, in between over the last cell.
fn inside(grid: &ProbeGrid, point: Vec3) -> f32 {
    let (cells, last) = ((point - grid.low) / grid.spacing, (grid.size - 1).as_vec3());
    let fade = (last * 0.25).min(Vec3::splat(FADE_CELLS));
    (cells.min(last - cells) / fade).min_element().clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cascades() -> Cascades {
        Cascades::new(Vec3::new(0.3, 1.0, -2.0), Vec3::new(16.0, 8.0, 12.0), 900, 3)
    }

    fn read(cascades: &Cascades, point: Vec3, value: impl Fn(usize) -> Vec3) -> (Vec3, f32) {
        let mut sum = (Vec3::ZERO, 0.0);
        cascades.around(point, |probe, weight| {
            sum.0 += value(probe) * weight;
            sum.1 += weight;
        });
        sum
    }

    #[test]
    fn grids_are_nested_and_not_more_than_allowed() {
        let cascades = cascades();
        assert!(cascades.probes() <= 900 && cascades.probes() > 300, "{}", cascades.probes());
        let widths: Vec<Vec3> = cascades.grids().iter().map(|grid| grid.spacing * (grid.size - 1).as_vec3()).collect();
        // A quarter and a half of the last one, which is as wide as asked.
        assert!((widths[2] - Vec3::new(32.0, 16.0, 24.0)).abs().max_element() < 1e-4);
        assert!((widths[0] * 4.0 - widths[2]).abs().max_element() < 1e-4 && widths[1] == widths[0] * 2.0);
        // Each within half a spacing of the eye.
        for (grid, width) in cascades.grids().iter().zip(widths) {
            let off = (grid.low + width * 0.5 - Vec3::new(0.3, 1.0, -2.0)).abs() / grid.spacing;
            assert!(off.max_element() <= 0.5 + 1e-5, "{off}");
        }
    }

    #[test]
    fn a_linear_field_is_read_back_and_seamless_across_cascades() {
        let cascades = cascades();
        for step in 0..200 {
            // Out of the finest one, through the second, to the third.
            let point = Vec3::new(0.3, 1.0, -2.0) + Vec3::new(14.0, 3.0, -9.0) * (step as f32 / 200.0);
            let (found, weight) = read(&cascades, point, |probe| cascades.position(probe, None));
            // Roundings of coordinates up to 20.
            assert!((found - point).abs().max_element() < 2e-5 && (weight - 1.0).abs() < 1e-6, "{found} {point}");
        }
        // Beyond the last one its border goes on.
        let far = read(&cascades, Vec3::splat(100.0), |probe| cascades.position(probe, None)).0;
        let grid = cascades.grids()[2];
        assert_eq!(far, grid.position(grid.size - 1));
        // Cascades of other light meet without a step: probes of the finest hold 1, the others 0.
        let each = cascades.grids()[0].len();
        let values: Vec<f32> = (0..400)
            .map(|step| {
                let point = Vec3::new(0.3 + step as f32 * 0.02, 1.0, -2.0);
                read(&cascades, point, |probe| Vec3::splat(f32::from(u8::from(probe < each)))).0.x
            })
            .collect();
        assert!((values[0] - 1.0).abs() < 1e-6 && values[399] == 0.0, "{values:?}");
        // A step of 2 cm in a fade of one cell.
        let steepest = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        assert!(steepest < 1.01 * 0.02 / cascades.grids()[0].spacing.x.min(0.25 * 8.0), "{steepest}");
    }

    #[test]
    fn grids_within_a_box_fill_it_and_stay_there() {
        let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
        let mut cascades = Cascades::within((low, high), 125, 2);
        for eye in [Vec3::new(0.0, 1.0, 3.9), Vec3::new(0.3, 0.4, -0.2), Vec3::splat(-50.0)] {
            cascades.follow(eye);
            let [fine, coarse] = [cascades.grids()[0], cascades.grids()[1]];
            // Roundings of coordinates up to 2.
            assert!((coarse.low - coarse.spacing * 0.5 - low).abs().max_element() < 1e-6);
            assert!((coarse.low + coarse.width() + coarse.spacing * 0.5 - high).abs().max_element() < 1e-6);
            let ends = fine.low + fine.width();
            assert!(fine.low.cmpge(coarse.low - 1e-6).all() && ends.cmple(coarse.low + coarse.width() + 1e-6).all());
        }
    }

    #[test]
    fn grids_move_in_steps_of_their_spacing() {
        let mut moved = cascades();
        let before = moved.clone();
        let spacing = before.grids()[0].spacing.x;
        moved.follow(Vec3::new(0.3 + spacing, 1.0, -2.0));
        let step = moved.grids()[0].low.x - before.grids()[0].low.x;
        assert!((step - spacing).abs() < 1e-5, "{step} {spacing}");
        let low = moved.grids()[2].low;
        moved.follow(Vec3::new(0.3 + spacing * 1.001, 1.0, -2.0));
        assert_eq!(moved.grids()[2].low, low);
    }

    #[test]
    fn jitter_fills_the_cell_around_each_probe() {
        let cascades = cascades();
        for probe in [0, 77, cascades.probes() - 1] {
            let grid = cascades.grids()[probe / cascades.grids()[0].len()];
            let vertex = cascades.position(probe, None);
            let offsets: Vec<Vec3> =
                (0..500).map(|key| (cascades.position(probe, Some(key)) - vertex) / grid.spacing).collect();
            let mean = offsets.iter().sum::<Vec3>() / 500.0;
            let square = offsets.iter().map(|offset| *offset * *offset).sum::<Vec3>() / 500.0;
            assert!(offsets.iter().all(|offset| offset.abs().max_element() <= 0.5 + 1e-4));
            // Uniform: mean 0 with a standard error of 0.29 / sqrt(500) = 0.013, mean square 1/12 with one of 0.0033; four of each.
            assert!(mean.abs().max_element() < 0.052, "{mean}");
            assert!((square - 1.0 / 12.0).abs().max_element() < 0.0133, "{square}");
        }
    }
}
