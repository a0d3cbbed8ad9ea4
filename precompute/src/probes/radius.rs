//! The support radius: one for all probes, so that receivers have the asked-for number of them on average.

use super::{PlacementError, ProbeSet, Support, point_grid::PointGrid};
use crate::settings::BakeSettings;
use glam::Vec3;
use rayon::prelude::*;

/// A radius found from a distance exceeds it by this factor, so that the weight there is not quite 0 (ANCHORS 4.4).
const BEYOND: f32 = 1.05;
/// How far probes that a receiver sees are looked for, times the distance to the probe that completes its overlap.
const REACH: f32 = 1.5;
/// Overlap by which the mean may miss the asked-for one before the search stops early.
const CLOSE_ENOUGH: f64 = 0.01;
/// Halvings of the radius's bracket; below an f32 rounding after about 24.
const MOST_STEPS: u32 = 32;

/// Supporting probes per receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// Mean over receivers.
    pub mean: f32,
    /// Least of any receiver.
    pub least: u32,
    /// Most of any receiver.
    pub most: u32,
}

/// Finds the support radius and every receiver's supporting probes.
///
/// `receivers` and `probes` are positions in metres; `sees` tells whether a receiver, by index, and a probe see each other.
/// The radius r is such that `settings.overlap` probes are nearer than it to a receiver, on average over receivers and
/// with the minimum rules counted. A receiver with fewer than `settings.min_overlap` probes within r uses 1.05 times the
/// distance to that many. One that sees no probe within r uses 1.05 times the distance to the nearest that it sees, looked
/// for up to 1.5 times the distance that completes the overlap: the nearest probes of a corner may all stand behind its
/// walls, and would leave it black. (Not so if `settings.min_overlap` is 0.) With no more probes than the overlap asked
/// for, r holds all of them for every receiver. A radius that is given is r.
///
/// # Errors
///
/// [`PlacementError::NoReceivers`], and [`PlacementError::TooManyPairs`] beyond 2^32 - 1 entries.
pub fn support(
    receivers: &[Vec3],
    probes: &[Vec3],
    sees: &(dyn Fn(usize, Vec3) -> bool + Sync),
    settings: &BakeSettings,
    given_m: Option<f32>,
) -> Result<(ProbeSet, Support, Overlap), PlacementError> {
    if receivers.is_empty() {
        return Err(PlacementError::NoReceivers);
    }
    let asked = f64::from(settings.overlap);
    let nearest = (settings.min_overlap as usize).min(probes.len());
    let typical = (asked.ceil() as usize).clamp(1, probes.len().max(1));
    let grid = PointGrid::new(probes, typical_spacing(probes));
    // Of each receiver: least radius by these rules, and distance to the probe that completes the overlap.
    let (least_m, typical_m): (Vec<f32>, Vec<f32>) = receivers
        .par_iter()
        .enumerate()
        .map_init(Vec::new, |distances, (index, &receiver)| {
            grid.nearest(receiver, nearest.max(typical), distances);
            let at = |rank: usize| rank.checked_sub(1).and_then(|rank| distances.get(rank)).copied().unwrap_or(0.0);
            let mut around: Vec<(f32, u32)> = Vec::new();
            grid.for_each_within(receiver, REACH * at(typical), |id, distance| around.push((distance, id)));
            around.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut seen = around.iter().filter(|(_, id)| sees(index, probes[*id as usize]));
            // Without a minimum nobody asks to be seen.
            let seen_m = seen.next().filter(|_| nearest > 0).map_or(0.0, |&(distance, _)| distance);
            (BEYOND * at(nearest).max(seen_m), at(typical))
        })
        .unzip();
    let links = Links { grid: &grid, receivers, least_m: &least_m };
    let radius_m = if let Some(radius_m) = given_m {
        radius_m
    } else if asked >= probes.len() as f64 {
        // Rank `typical` is the farthest probe here.
        BEYOND * typical_m.iter().copied().fold(0.0, f32::max)
    } else {
        let mean = typical_m.iter().map(|&distance| f64::from(distance)).sum::<f64>() / receivers.len() as f64;
        links.search(asked, mean as f32)
    };
    // Probes at the receivers themselves: any radius holds them.
    let radius_m = radius_m.max(f32::MIN_POSITIVE);
    let (support, overlap) = links.list(radius_m)?;
    Ok((ProbeSet { positions: probes.to_vec(), radius_m }, support, overlap))
}

/// Cell size for neighbor searches: with the probes spread evenly over their box, one per cell.
fn typical_spacing(probes: &[Vec3]) -> f32 {
    let Some(&first) = probes.first() else { return 1.0 };
    let (low, high) = probes.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)));
    let extent = (high - low).max_element();
    if extent > 0.0 { extent / (probes.len() as f32).cbrt() } else { 1.0 }
}

struct Links<'a> {
    grid: &'a PointGrid,
    receivers: &'a [Vec3],
    /// Least radius of each receiver.
    least_m: &'a [f32],
}

impl Links<'_> {
    /// The radius whose mean overlap is closest to the asked-for one, starting at a guess.
    fn search(&self, asked: f64, guess_m: f32) -> f32 {
        let asked = asked * self.receivers.len() as f64;
        let close = CLOSE_ENOUGH * self.receivers.len() as f64;
        let guess_m = guess_m.max(f32::MIN_POSITIVE);
        let mut best = (guess_m, f64::INFINITY);
        let mut miss = |radius_m: f32| {
            let miss = self.pairs(radius_m) as f64 - asked;
            if miss.abs() < best.1 {
                best = (radius_m, miss.abs());
            }
            miss
        };
        // Bracket. The minimum rule alone may exceed the overlap, hence the bound on the way down.
        let (mut low, mut high) = (guess_m, guess_m);
        let first = miss(guess_m);
        let mut found = first.abs() <= close;
        while !found && first < 0.0 && high.is_finite() && miss(high) < 0.0 {
            low = high;
            high *= 1.25;
        }
        for _ in 0..MOST_STEPS {
            if found || first < 0.0 || miss(low) < 0.0 {
                break;
            }
            high = low;
            low *= 0.75;
        }
        for _ in 0..MOST_STEPS {
            if found {
                break;
            }
            let middle = 0.5 * (low + high);
            let miss = miss(middle);
            found = miss.abs() <= close;
            if miss < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        best.0
    }

    /// Pairs of a receiver and a supporting probe.
    fn pairs(&self, radius_m: f32) -> u64 {
        let count = |(&receiver, &least_m): (&Vec3, &f32)| {
            let mut count = 0u64;
            self.grid.for_each_within(receiver, radius_m.max(least_m), |_, _| count += 1);
            count
        };
        self.receivers.par_iter().zip(self.least_m).map(count).sum()
    }

    fn list(&self, radius_m: f32) -> Result<(Support, Overlap), PlacementError> {
        let (pairs, limit) = (self.pairs(radius_m), u64::from(u32::MAX));
        if pairs > limit {
            return Err(PlacementError::TooManyPairs { pairs, limit });
        }
        let radii: Vec<f32> = self.least_m.iter().map(|&least_m| least_m.max(radius_m)).collect();
        // One list per run of receivers, not per receiver, to spare allocations.
        let runs: Vec<(Vec<u32>, Vec<u32>)> = self
            .receivers
            .par_chunks(1024)
            .zip(radii.par_chunks(1024))
            .map(|(receivers, radii)| {
                let (mut counts, mut probes) = (Vec::with_capacity(receivers.len()), Vec::new());
                for (&receiver, &radius_m) in receivers.iter().zip(radii) {
                    let first = probes.len();
                    self.grid.for_each_within(receiver, radius_m, |probe, _| probes.push(probe));
                    probes[first..].sort_unstable();
                    counts.push((probes.len() - first) as u32);
                }
                (counts, probes)
            })
            .collect();
        let mut support = Support { start: vec![0], probes: Vec::with_capacity(pairs as usize), radius_m: radii };
        let (mut least, mut most, mut end) = (u32::MAX, 0, 0);
        for (counts, probes) in runs {
            support.probes.extend(probes);
            for count in counts {
                (least, most, end) = (least.min(count), most.max(count), end + count);
                support.start.push(end);
            }
        }
        let mean = (pairs as f64 / self.receivers.len() as f64) as f32;
        Ok((support, Overlap { mean, least, most }))
    }
}
