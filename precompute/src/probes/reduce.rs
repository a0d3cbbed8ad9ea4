//! Thins candidates to a number of evenly spread probes.

use super::point_grid::PointGrid;
use glam::Vec3;
use localprt_formats::weight::weight_kernel;
use rayon::prelude::*;
use std::{cmp::Reverse, collections::BinaryHeap};

/// Densities are sums of weights in steps of 2^-32: sums of integers are the same in any order, and subtracting a
/// removed candidate's weight undoes its addition exactly.
const STEPS: f32 = 4_294_967_296.0;
/// Growth of the kernel once it reaches no two candidates.
const GROWTH: f32 = 1.25;

/// Which candidates are left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reduction {
    /// Indices of the candidates kept, rising.
    pub kept: Vec<u32>,
    /// Indices of those removed, first removed first.
    pub removed: Vec<u32>,
}

impl Reduction {
    /// Indices of `count` candidates, rising: those kept, and the last removed as far as they are needed.
    pub fn padded(&self, count: usize) -> Vec<u32> {
        let missing = count.saturating_sub(self.kept.len()).min(self.removed.len());
        let mut padded = self.kept.clone();
        padded.extend(self.removed.iter().rev().take(missing));
        padded.sort_unstable();
        padded
    }

    /// The same with some of the removed candidates kept.
    pub fn with(&self, added: &[u32]) -> Self {
        let mut kept = self.kept.clone();
        kept.extend(added);
        kept.sort_unstable();
        let removed = self.removed.iter().copied().filter(|index| !added.contains(index)).collect();
        Self { kept, removed }
    }
}

/// Removes the candidate of highest kernel density until `target` are left (section 4.1). Among equals the one with the
/// lowest index goes first.
///
/// The density of a candidate is the sum of the weights Eq. (10), of radius `rho` in metres, of all other candidates.
///
/// Differs from the paper: once no two candidates are within `rho` of each other and there are still too many, the
/// kernel grows. The target is the number of points of a volume grid, so a scene with more surface than its box reaches
/// that state, where all densities are 0 and the order of removal would leave holes.
pub fn reduce(candidates: &[Vec3], target: usize, rho: f32) -> Reduction {
    let mut kept: Vec<u32> = (0..candidates.len() as u32).collect();
    let mut removed = Vec::with_capacity(candidates.len().saturating_sub(target));
    let mut kernel_m = rho.max(f32::MIN_POSITIVE);
    while kept.len() > target && kernel_m.is_finite() {
        // Starting afresh every time half are gone keeps the neighborhoods short.
        let stop = target.max(kept.len() / 2);
        let before = kept.len();
        thin(candidates, &mut kept, &mut removed, stop, kernel_m);
        if kept.len() == before {
            kernel_m *= GROWTH;
        }
    }
    Reduction { kept, removed }
}

/// Removes candidates until `stop` are left or none has another within the kernel.
fn thin(candidates: &[Vec3], kept: &mut Vec<u32>, removed: &mut Vec<u32>, stop: usize, kernel_m: f32) {
    let points: Vec<Vec3> = kept.iter().map(|&index| candidates[index as usize]).collect();
    let grid = PointGrid::new(&points, kernel_m);
    let weight = |distance: f32| (weight_kernel(distance / kernel_m) * STEPS) as u64;
    let mut density: Vec<u64> = (0..points.len() as u32)
        .into_par_iter()
        .map(|own| {
            let mut sum = 0;
            grid.for_each_within(points[own as usize], kernel_m, |other, distance| {
                sum += if other == own { 0 } else { weight(distance) };
            });
            sum
        })
        .collect();
    // Densities only fall, so a stored one is an upper bound: an entry that is out of date goes back in.
    let mut densest: BinaryHeap<(u64, Reverse<u32>)> =
        density.iter().zip(0..).map(|(&density, index)| (density, Reverse(index))).collect();
    let mut alive = vec![true; points.len()];
    let mut count = points.len();
    while count > stop {
        let Some((stored, Reverse(index))) = densest.pop() else { break };
        let current = density[index as usize];
        if stored != current {
            densest.push((current, Reverse(index)));
            continue;
        }
        if current == 0 {
            break;
        }
        alive[index as usize] = false;
        count -= 1;
        removed.push(kept[index as usize]);
        grid.for_each_within(points[index as usize], kernel_m, |other, distance| {
            if alive[other as usize] {
                density[other as usize] -= weight(distance);
            }
        });
    }
    let mut index = 0;
    kept.retain(|_| {
        index += 1;
        alive[index - 1]
    });
}
