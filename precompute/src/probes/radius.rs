//! Support radii: one for all probes or one by the space around each, in proportions that are given, so that receivers have the
//! asked-for number of probes on average; and how much each of them counts.

use super::{PlacementError, ProbeSet, Support, point_grid::PointGrid};
use crate::settings::BakeSettings;
use glam::Vec3;
use localprt_formats::weight::weight_kernel;
use rayon::prelude::*;

/// A radius found from a distance exceeds it by this factor, so that the weight there is not quite 0 (ANCHORS 4.4).
const BEYOND: f32 = 1.05;
/// How far probes that a receiver sees are looked for, times the distance to the probe that completes its overlap.
const REACH: f32 = 1.5;
/// Overlap by which the mean may miss the asked-for one before the search stops early.
const CLOSE_ENOUGH: f64 = 0.01;
/// Halvings of the radius's bracket; below an f32 rounding after about 24.
const MOST_STEPS: u32 = 32;
/// A probe's reach is its distance to this many-th nearest other that it sees.
const NEIGHBORS: usize = 6;
/// Nearest other probes that it is looked for among.
const MOST_NEIGHBORS: usize = 48;
/// Its reach is no more than this many times the distance to that many-th nearest other, seen or not.
const MOST_UNSEEN: f32 = 3.0;

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

/// Finds the support radii and every receiver's supporting probes.
///
/// `receivers` and `probes` are positions in metres, `reach` is `[n_probes]` proportions of the radii; `sees` tells whether a
/// receiver, by index, and a probe see each other. Distances count in multiples of the probe's reach. The radii are such that
/// `settings.overlap` probes hold a receiver, on average over receivers and with the minimum rules counted. A receiver held by
/// fewer than `settings.min_overlap` enlarges all radii for itself to 1.05 times what holds it that often. One that sees no probe
/// that holds it enlarges them to 1.05 times what takes in the nearest that it sees, looked for up to 1.5 times what completes the
/// overlap: the nearest probes of a corner may all stand behind its walls, and would leave it black. (Not so if
/// `settings.min_overlap` is 0.) With no more probes than the overlap asked for, all of them hold every receiver.
///
/// # Errors
///
/// [`PlacementError::NoReceivers`], and [`PlacementError::TooManyPairs`] beyond 2^32 - 1 entries.
pub fn support(
    receivers: &[Vec3],
    probes: &[Vec3],
    reach: &[f32],
    sees: &(dyn Fn(usize, Vec3) -> bool + Sync),
    settings: &BakeSettings,
) -> Result<(ProbeSet, Support, Overlap), PlacementError> {
    let (links, typical) = Links::new(receivers, probes, reach, sees, settings)?;
    let asked = f64::from(settings.overlap);
    let factor = if asked >= probes.len() as f64 {
        // Rank `typical` is the farthest probe here.
        BEYOND * typical.iter().copied().fold(0.0, f32::max)
    } else {
        let mean = typical.iter().map(|&distance| f64::from(distance)).sum::<f64>() / receivers.len() as f64;
        links.search(asked, mean as f32)
    };
    // Probes at the receivers themselves: any radius holds them.
    let factor = factor.max(f32::MIN_POSITIVE);
    let (support, overlap) = links.list(factor)?;
    let radius_m = reach.iter().map(|reach| factor * reach).collect();
    Ok((ProbeSet { positions: probes.to_vec(), radius_m }, support, overlap))
}

/// Every receiver's supporting probes by the radii that the probes have; the rules are those of [`support`].
///
/// # Errors
///
/// As [`support`].
pub fn link(
    receivers: &[Vec3],
    probes: &ProbeSet,
    sees: &(dyn Fn(usize, Vec3) -> bool + Sync),
    settings: &BakeSettings,
) -> Result<(Support, Overlap), PlacementError> {
    Links::new(receivers, &probes.positions, &probes.radius_m, sees, settings)?.0.list(1.0)
}

/// How far each probe's neighborhood reaches, metres: to the sixth nearest other probe that it sees, at most three times as far as
/// to the sixth nearest of all, and on geometric average over those six.
///
/// Differs from the paper, which has one radius: near surfaces that need many probes they would all support each other's
/// receivers, and far from them none.
pub(super) fn reach(probes: &[Vec3], sees: &(dyn Fn(Vec3, Vec3) -> bool + Sync)) -> Vec<f32> {
    if probes.len() < 2 {
        return vec![1.0; probes.len()];
    }
    let grid = PointGrid::new(probes, typical_spacing(probes));
    // Of each probe: how far its neighborhood reaches, and who is in it.
    let found: Vec<(f32, Vec<u32>)> = probes
        .par_iter()
        .map_init(Vec::new, |distances, &probe| {
            grid.nearest(probe, MOST_NEIGHBORS + 1, distances);
            let farthest = distances.last().copied().unwrap_or_default();
            let mut around: Vec<(f32, u32)> = Vec::new();
            grid.for_each_within(probe, farthest * (1.0 + f32::EPSILON), |id, distance| around.push((distance, id)));
            around.retain(|other| other.0 > 0.0);
            around.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let of_all = around.get(NEIGHBORS - 1).or(around.last()).map_or(1.0, |other| other.0);
            let seen: Vec<(f32, u32)> =
                around.iter().filter(|other| sees(probe, probes[other.1 as usize])).take(NEIGHBORS).copied().collect();
            let of_seen = if seen.len() == NEIGHBORS { seen[NEIGHBORS - 1].0 } else { MOST_UNSEEN * of_all };
            let reach = of_seen.clamp(of_all, MOST_UNSEEN * of_all).max(f32::MIN_POSITIVE);
            (reach, seen.into_iter().map(|other| other.1).collect())
        })
        .collect();
    // Evened out over the neighborhood: one probe in a nook does not make a hole in the overlap around it.
    let logarithms = |own: &(f32, Vec<u32>)| {
        let sum: f32 = own.1.iter().map(|&other| found[other as usize].0.ln()).sum();
        (sum + own.0.ln()) / (own.1.len() + 1) as f32
    };
    found.iter().map(|own| logarithms(own).exp()).collect()
}

/// Cell size for neighbor searches: with the probes spread evenly over their box, one per cell.
fn typical_spacing(probes: &[Vec3]) -> f32 {
    let Some(&first) = probes.first() else { return 1.0 };
    let (low, high) = probes.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)));
    let extent = (high - low).max_element();
    if extent > 0.0 { extent / (probes.len() as f32).cbrt() } else { 1.0 }
}

struct Links<'a> {
    grid: PointGrid,
    receivers: &'a [Vec3],
    reach: &'a [f32],
    /// Longest reach.
    longest: f32,
    /// Least factor of each receiver.
    least: Vec<f32>,
}

impl<'a> Links<'a> {
    /// Links, and for each receiver the distance, in reaches, of the probe that completes its overlap.
    fn new(
        receivers: &'a [Vec3],
        probes: &[Vec3],
        reach: &'a [f32],
        sees: &(dyn Fn(usize, Vec3) -> bool + Sync),
        settings: &BakeSettings,
    ) -> Result<(Self, Vec<f32>), PlacementError> {
        if receivers.is_empty() {
            return Err(PlacementError::NoReceivers);
        }
        let nearest = (settings.min_overlap as usize).min(probes.len());
        let completing = (f64::from(settings.overlap).ceil() as usize).clamp(1, probes.len().max(1));
        let longest = reach.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let grid = PointGrid::new(probes, typical_spacing(probes));
        let mut links = Self { grid, receivers, reach, longest, least: Vec::new() };
        let (least, typical) = receivers
            .par_iter()
            .enumerate()
            .map_init(Vec::new, |distances, (index, &receiver)| {
                links.nearest(receiver, nearest.max(completing), distances);
                let at = |rank: usize| rank.checked_sub(1).and_then(|rank| distances.get(rank)).copied().unwrap_or(0.0);
                let mut around: Vec<(f32, u32)> = Vec::new();
                links.for_each_within(receiver, REACH * at(completing), |id, distance| around.push((distance, id)));
                around.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let mut seen = around.iter().filter(|(_, id)| sees(index, probes[*id as usize]));
                // Without a minimum nobody asks to be seen.
                let seen = seen.next().filter(|_| nearest > 0).map_or(0.0, |&(distance, _)| distance);
                (BEYOND * at(nearest).max(seen), at(completing))
            })
            .unzip();
        links.least = least;
        Ok((links, typical))
    }

    /// Calls `visit(id, distance)` for every probe nearer than `factor` reaches.
    fn for_each_within(&self, center: Vec3, factor: f32, mut visit: impl FnMut(u32, f32)) {
        self.grid.for_each_within(center, factor * self.longest, |id, distance_m| {
            let distance = distance_m / self.reach[id as usize];
            if distance < factor {
                visit(id, distance);
            }
        });
    }

    /// The `count` smallest distances in reaches, rising.
    fn nearest(&self, center: Vec3, count: usize, distances: &mut Vec<f32>) {
        // The nearest by metres bound the nearest by reaches.
        self.grid.nearest(center, count, distances);
        let Some(&farthest_m) = distances.last() else { return };
        let shortest = self.reach.iter().copied().fold(f32::INFINITY, f32::min);
        if shortest == self.longest {
            distances.iter_mut().for_each(|distance| *distance /= shortest);
            return;
        }
        let mut factor = farthest_m / self.longest;
        loop {
            distances.clear();
            self.for_each_within(center, factor * (1.0 + f32::EPSILON), |_, distance| distances.push(distance));
            if distances.len() >= count.min(self.reach.len()) || !factor.is_finite() {
                break;
            }
            factor = (factor * 1.5).max(f32::MIN_POSITIVE);
        }
        distances.sort_unstable_by(f32::total_cmp);
        distances.truncate(count);
    }

    /// The factor whose mean overlap is closest to the asked-for one, starting at a guess.
    fn search(&self, asked: f64, guess: f32) -> f32 {
        let asked = asked * self.receivers.len() as f64;
        let close = CLOSE_ENOUGH * self.receivers.len() as f64;
        let guess = guess.max(f32::MIN_POSITIVE);
        let mut best = (guess, f64::INFINITY);
        let mut miss = |factor: f32| {
            let miss = self.pairs(factor) as f64 - asked;
            if miss.abs() < best.1 {
                best = (factor, miss.abs());
            }
            miss
        };
        // Bracket. The minimum rule alone may exceed the overlap, hence the bound on the way down.
        let (mut low, mut high) = (guess, guess);
        let first = miss(guess);
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
    fn pairs(&self, factor: f32) -> u64 {
        let count = |(&receiver, &least): (&Vec3, &f32)| {
            let mut count = 0u64;
            self.for_each_within(receiver, factor.max(least), |_, _| count += 1);
            count
        };
        self.receivers.par_iter().zip(&self.least).map(count).sum()
    }

    fn list(&self, factor: f32) -> Result<(Support, Overlap), PlacementError> {
        let (pairs, limit) = (self.pairs(factor), u64::from(u32::MAX));
        if pairs > limit {
            return Err(PlacementError::TooManyPairs { pairs, limit });
        }
        // One list per run of receivers, not per receiver, to spare allocations.
        struct Run {
            counts: Vec<u32>,
            probes: Vec<u32>,
            weights: Vec<f32>,
            radii_m: Vec<f32>,
        }
        let runs: Vec<Run> = self
            .receivers
            .par_chunks(1024)
            .zip(self.least.par_chunks(1024))
            .map(|(receivers, least)| {
                let mut run = Run { counts: Vec::new(), probes: Vec::new(), weights: Vec::new(), radii_m: Vec::new() };
                let mut found: Vec<(u32, f32)> = Vec::new();
                for (&receiver, &least) in receivers.iter().zip(least) {
                    let factor = factor.max(least);
                    found.clear();
                    self.for_each_within(receiver, factor, |probe, distance| found.push((probe, distance)));
                    found.sort_unstable_by_key(|found| found.0);
                    run.counts.push(found.len() as u32);
                    run.probes.extend(found.iter().map(|found| found.0));
                    let first = run.weights.len();
                    run.weights.extend(found.iter().map(|found| weight_kernel(found.1 / factor)));
                    let reach = |found: &(u32, f32)| self.reach[found.0 as usize];
                    run.radii_m.push(factor * even_out(&mut run.weights[first..], found.iter().map(reach)));
                }
                run
            })
            .collect();
        let mut support = Support { start: vec![0], probes: Vec::with_capacity(pairs as usize), ..Support::default() };
        let (mut least, mut most, mut end) = (u32::MAX, 0, 0);
        for run in runs {
            support.probes.extend(run.probes);
            support.weights.extend(run.weights);
            support.radius_m.extend(run.radii_m);
            for count in run.counts {
                (least, most, end) = (least.min(count), most.max(count), end + count);
                support.start.push(end);
            }
        }
        let mean = (pairs as f64 / self.receivers.len() as f64) as f32;
        Ok((support, Overlap { mean, least, most }))
    }
}

/// Weights so that probes of long reach do not outweigh near ones of short reach: each divided by the square of its reach, their sum
/// as before. Returns the typical reach.
///
/// Differs from the paper, where all are alike and nothing changes: a probe that reaches 30 m across a plain counts half as much
/// 15 m away, in a room with probes of its own.
fn even_out(weights: &mut [f32], reach: impl Iterator<Item = f32> + Clone) -> f32 {
    let Some(first) = reach.clone().next() else { return 0.0 };
    if reach.clone().all(|reach| reach == first) {
        return first;
    }
    let sum: f32 = weights.iter().sum();
    let scaled: f32 = weights.iter().zip(reach.clone()).map(|(weight, reach)| weight / (reach * reach)).sum();
    if scaled <= 0.0 {
        return first;
    }
    // Of all probes together: of one reach it is that reach.
    let typical = (sum / scaled).sqrt();
    for (weight, reach) in weights.iter_mut().zip(reach) {
        *weight *= (typical / reach).powi(2);
    }
    typical
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_probes_of_short_reach_count_more_than_far_ones_of_long_reach() {
        let mut weights = [0.5, 0.5];
        let typical = even_out(&mut weights, [1.0, 10.0].into_iter());
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((weights[0] / weights[1] - 100.0).abs() < 1e-2 && typical > 1.0 && typical < 2.0);
        let mut alike = [0.25, 0.5];
        assert_eq!(even_out(&mut alike, [3.0, 3.0].into_iter()), 3.0);
        assert_eq!(alike, [0.25, 0.5]);
    }

    #[test]
    fn reach_follows_the_spacing_on_each_side_of_a_wall() {
        // A row of probes every metre on the left, every ten on the right; neither side sees the other.
        let probes: Vec<Vec3> = (0..40)
            .map(|index| Vec3::X * if index < 20 { index as f32 - 20.0 } else { (index - 20) as f32 * 10.0 + 0.5 })
            .collect();
        let reach = reach(&probes, &|a, b| (a.x < 0.0) == (b.x < 0.0));
        assert!((reach[10] - 3.0).abs() < 1e-5 && (reach[30] - 30.0).abs() < 1e-4);
        // Beside the wall one looks twice as far along one's own side.
        assert!((3.0..6.0).contains(&reach[19]) && (10.0..60.0).contains(&reach[20]), "{} {}", reach[19], reach[20]);
    }
}
