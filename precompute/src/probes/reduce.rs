//! Thins candidates to a number of evenly spread probes.

use super::point_grid::PointGrid;
use glam::Vec3;
use localprt_formats::weight::weight_kernel;
use rayon::prelude::*;
use std::{cmp::Reverse, collections::BinaryHeap};

/// Candidates per probe asked for, at most: on a surface the nearest of 64 is within an eighth of a spacing or so
/// (64^(-1/2)) of where a probe would best be.
const PER_PROBE: usize = 64;
/// Bounds of the number of candidates. The upper one is 2 s of work.
const LEAST_CANDIDATES: usize = 8192;
const MOST_CANDIDATES: usize = 200_000;
/// Densities are sums of weights in steps of 2^-32: sums of integers are the same in any order, and subtracting a
/// removed candidate's weight undoes its addition exactly.
const STEPS: f32 = 4_294_967_296.0;
/// Growth of the kernel once it reaches no two candidates.
const GROWTH: f32 = 1.25;
/// Widest kernel, in spacings of the candidates that will be left at the end.
///
/// Eq. (10) is flat at 0, so under a kernel much wider than the final spacing two candidates side by side cost hardly
/// more than two apart, and the thinning keeps clumps: with 100 points left on a square, the nearest two are 0.91
/// spacings apart at 1.1, 0.52 at 1.3 and 0.005 at 1.5.
const WIDEST: f64 = 1.13;

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

    /// Thins what is kept further; `thin` takes indices of candidates and the number to keep, and answers by rank among them.
    pub fn further(&self, target: usize, thin: impl Fn(&[u32], usize) -> Self) -> Self {
        let fewer = thin(&self.kept, target);
        let mut removed = self.removed.clone();
        removed.extend(fewer.removed.iter().map(|&rank| self.kept[rank as usize]));
        Self { kept: fewer.kept.iter().map(|&rank| self.kept[rank as usize]).collect(), removed }
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
/// Of far more candidates than `target` needs (64 each, and 200 000) an even share by index is thinned; the rest count
/// as removed first.
///
/// Differs from the paper, because the target is the number of points of a volume grid while candidates lie near
/// surfaces, so `rho` may be far from their final spacing: in a scene with much surface the kernel grows once no two
/// candidates are within it (all densities would be 0, and the order of removal would leave holes), and in a scene with
/// little it shrinks to about the spacing that is left at the end (see the source for the clumps this avoids).
pub fn reduce(candidates: &[Vec3], target: usize, rho: f32) -> Reduction {
    let count = candidates.len();
    let most = most_candidates(target).min(count);
    let chosen = |index: &u32| {
        let rank = *index as u64 * most as u64;
        rank / count as u64 != (rank + most as u64) / count as u64
    };
    let (mut kept, mut removed): (Vec<u32>, Vec<u32>) = (0..count as u32).partition(chosen);
    let mut kernel_m = rho.max(f32::MIN_POSITIVE);
    let mut may_shrink = true;
    while kept.len() > target && kernel_m.is_finite() {
        // Starting afresh every time half are gone keeps the neighborhoods short.
        let stop = target.max(kept.len() / 2);
        match thin(candidates, &mut kept, &mut removed, stop, may_shrink.then_some(target), kernel_m) {
            Thinned::Removed => {}
            Thinned::TooNarrow => {
                kernel_m *= GROWTH;
                // On a lattice a kernel is too narrow or too wide: not back and forth for ever.
                may_shrink = false;
            }
            Thinned::TooWide { excess } => kernel_m /= excess.max(1.01) as f32,
        }
    }
    Reduction { kept, removed }
}

/// Candidates that thinning to `target` makes good use of.
pub(super) fn most_candidates(target: usize) -> usize {
    target.saturating_mul(PER_PROBE).clamp(LEAST_CANDIDATES, MOST_CANDIDATES.max(target.saturating_mul(2)))
}

enum Thinned {
    /// At least one candidate was removed.
    Removed,
    /// No candidate has another within the kernel.
    TooNarrow,
    /// The kernel is this many times wider than it should be for the target count.
    TooWide { excess: f64 },
}

/// Removes candidates until `stop` are left or none has another within the kernel, unless the kernel is too wide for
/// the target count.
fn thin(
    candidates: &[Vec3],
    kept: &mut Vec<u32>,
    removed: &mut Vec<u32>,
    stop: usize,
    target: Option<usize>,
    kernel_m: f32,
) -> Thinned {
    let points: Vec<Vec3> = kept.iter().map(|&index| candidates[index as usize]).collect();
    // Half the radius: the cells searched hold a third of what cells of the radius would, on a surface a half.
    let grid = PointGrid::new(&points, 0.5 * kernel_m);
    let weight = |distance: f32| (weight_kernel(distance / kernel_m) * STEPS) as u64;
    let (mut density, neighbors): (Vec<u64>, Vec<[u32; 2]>) = (0..points.len() as u32)
        .into_par_iter()
        .map(|own| {
            // Neighbors within the kernel and within half of it.
            let (mut sum, mut neighbors) = (0, [0, 0]);
            grid.for_each_within(points[own as usize], kernel_m, |other, distance| {
                if other != own {
                    sum += weight(distance);
                    // Not those in the same place, which no kernel tells apart.
                    neighbors[0] += u32::from(distance > 0.0);
                    neighbors[1] += u32::from(distance > 0.0 && distance < 0.5 * kernel_m);
                }
            });
            (sum, neighbors)
        })
        .unzip();
    let mean = |half: usize| {
        neighbors.iter().map(|neighbors| u64::from(neighbors[half])).sum::<u64>() as f64 / points.len() as f64
    };
    if let Some(excess) = target.and_then(|target| excess(mean(0), mean(1), target as f64 / points.len() as f64)) {
        return Thinned::TooWide { excess };
    }
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
    if count == points.len() { Thinned::TooNarrow } else { Thinned::Removed }
}

/// How many times too wide a kernel is, if it is: from the mean number of neighbors within it and within half of it, and
/// the share of candidates that will be left.
fn excess(within: f64, within_half: f64, left: f64) -> Option<f64> {
    // Candidates lie along lines, on surfaces or in volumes: doubling the radius doubles the neighbors 1, 2 or 3 times.
    let dimension = if within_half > 0.0 { (within / within_half).log2().clamp(1.0, 3.0) } else { 2.0 };
    // Unit balls hold 2, pi and 4.19 units; between them, a straight line is within 2 %.
    let most = (2.0 + 1.1 * (dimension - 1.0)) * WIDEST.powf(dimension);
    let expected = within * left;
    (expected > most).then(|| (expected / most).powf(1.0 / dimension))
}
