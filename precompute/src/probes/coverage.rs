//! Coverage: whether the surfaces that receivers see are seen by a probe that supports them, and its repair.
//!
//! Light from a surface that no supporting probe sees is lost (Eq. 4, zero case). The paper names full coverage as a
//! goal but has no step for it; this one measures it on a sample and adds the candidates that lower it most.

use super::{ProbeSet, Support};
use crate::rays::{RayCaster, frame};
use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, counter_uniform, fibonacci_square};
use rayon::prelude::*;

/// Receivers sampled, evenly by index.
const RECEIVERS: usize = 2048;
/// Cosine-distributed rays of each. Together 65 536 samples: a share of 1 % has a standard error of 0.04 %, if
/// samples were independent.
const RAYS: u32 = 32;
/// Candidates weighed, spread evenly over those that could help.
const MOST_CANDIDATES: usize = 2048;
/// Unseen samples they are weighed on, spread evenly. Both bound the work: four million visibility rays.
const MOST_UNSEEN: usize = 2048;
/// Candidates tested for whether they could.
const MOST_TESTED: usize = 8 * MOST_CANDIDATES;
/// A candidate must cover this share of all samples to be worth a probe. Ten probes of this kind are 2 %.
const WORTHWHILE: f64 = 0.002;
/// Stream of random numbers of this file.
const STREAM: u64 = 0x636f_7665_7261_6765;

/// A surface point that a receiver sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The receiver.
    pub receiver: u32,
    /// World position just off the surface on the side seen, metres.
    pub position: Vec3,
    /// Unit normal on the side seen.
    pub normal: Vec3,
}

/// Surface points that a sample of the receivers sees, cosine-weighted. Misses and black backs are left out.
pub struct Coverage<'a> {
    caster: &'a RayCaster<'a>,
    /// By rising receiver.
    pub samples: Vec<SurfaceSample>,
}

impl<'a> Coverage<'a> {
    /// Shoots 32 rays from each of about 2000 receivers: `[n_receivers]` positions in metres, unit normals.
    pub fn sample(caster: &'a RayCaster<'a>, receivers: &[Vec3], normals: &[Vec3], seed: u64) -> Self {
        let count = receivers.len().min(normals.len());
        let sampled = count.min(RECEIVERS);
        let samples = (0..sampled)
            .into_par_iter()
            .map(|rank| {
                let receiver = rank * count / sampled;
                let normal = normals[receiver];
                let (tangent, bitangent) = frame(normal);
                let origin = receivers[receiver] + normal * caster.offset_m();
                let shift = [0, 1].map(|axis| counter_uniform(seed, STREAM + receiver as u64, axis));
                (0..RAYS)
                    .filter_map(|ray| {
                        let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, RAYS, shift));
                        let hit = caster.closest_hit(origin, (tangent * x + bitangent * y + normal * z).normalize())?;
                        hit.point?;
                        let position = hit.position + hit.normal * caster.offset_m();
                        Some(SurfaceSample { receiver: receiver as u32, position, normal: hit.normal })
                    })
                    .collect::<Vec<_>>()
            })
            .collect::<Vec<_>>()
            .concat();
        Self { caster, samples }
    }

    /// Share of the samples that no probe supporting their receiver sees, 0..=1.
    pub fn unseen_share(&self, probes: &ProbeSet, support: &Support) -> f32 {
        if self.samples.is_empty() {
            return 0.0;
        }
        self.unseen(probes, support).len() as f32 / self.samples.len() as f32
    }

    /// The `budget` candidates, or fewer, whose addition to the probes leaves the fewest samples unseen, chosen
    /// greedily. `pool` are indices into `candidates`; the answer is a part of it, best first.
    ///
    /// Ends when no candidate covers another 0.2 % of all samples.
    pub fn repair(
        &self,
        probes: &ProbeSet,
        support: &Support,
        receivers: &[Vec3],
        candidates: &[Vec3],
        pool: &[u32],
        budget: usize,
    ) -> Vec<u32> {
        if budget == 0 || pool.is_empty() {
            return Vec::new();
        }
        let all_unseen = self.unseen(probes, support);
        let unseen = evenly(&all_unseen, MOST_UNSEEN);
        let weighed = unseen.len() as f64 / all_unseen.len().max(1) as f64;
        let least = ((WORTHWHILE * weighed * self.samples.len() as f64).ceil() as usize).max(1);
        if unseen.len() < least {
            return Vec::new();
        }
        let could_help = |position: Vec3| {
            // Whether it would support a receiver that lacks something. Samples are by rising receiver.
            let mut before = None;
            unseen.iter().any(|&sample| {
                let receiver = self.samples[sample as usize].receiver as usize;
                before.replace(receiver) != Some(receiver)
                    && position.distance(receivers[receiver]) < support.radius_m[receiver]
            })
        };
        let chosen = helpful(pool, candidates, could_help);
        let covers = self.covers(&unseen, support, receivers, candidates, &chosen);
        let mut open = vec![true; unseen.len()];
        let mut added = Vec::new();
        while added.len() < budget {
            let gain = |covered: &[u32]| covered.iter().filter(|&&sample| open[sample as usize]).count();
            // Of equals the first.
            let best = covers
                .iter()
                .map(|(index, covered)| (gain(covered), *index, covered))
                .reduce(|best, other| if other.0 > best.0 { other } else { best });
            let Some((gain, index, covered)) = best else { break };
            if gain < least {
                break;
            }
            covered.iter().for_each(|&sample| open[sample as usize] = false);
            added.push(index);
        }
        added
    }

    /// Indices of the samples that no supporting probe sees, rising.
    fn unseen(&self, probes: &ProbeSet, support: &Support) -> Vec<u32> {
        (0..self.samples.len() as u32)
            .into_par_iter()
            .filter(|&index| {
                let sample = &self.samples[index as usize];
                let supporting = support.of(sample.receiver as usize);
                !supporting.iter().any(|&probe| self.sees(probes.positions[probe as usize], sample))
            })
            .collect()
    }

    /// V: whether a position sees that side of that surface point (ANCHORS 4.11).
    fn sees(&self, position: Vec3, sample: &SurfaceSample) -> bool {
        sample.normal.dot(position - sample.position) > 0.0 && self.caster.visible(sample.position, position)
    }

    /// For each candidate, the ranks in `unseen` of the samples it would cover.
    fn covers(
        &self,
        unseen: &[u32],
        support: &Support,
        receivers: &[Vec3],
        candidates: &[Vec3],
        chosen: &[u32],
    ) -> Vec<(u32, Vec<u32>)> {
        chosen
            .par_iter()
            .map(|&index| {
                let position = candidates[index as usize];
                let covered = (0..unseen.len() as u32).filter(|&rank| {
                    let sample = &self.samples[unseen[rank as usize] as usize];
                    let receiver = sample.receiver as usize;
                    position.distance(receivers[receiver]) < support.radius_m[receiver] && self.sees(position, sample)
                });
                (index, covered.collect())
            })
            .collect()
    }
}

/// At most [`MOST_CANDIDATES`] of the pool, evenly spread over those that pass the test.
fn helpful(pool: &[u32], candidates: &[Vec3], test: impl Fn(Vec3) -> bool + Sync) -> Vec<u32> {
    // The order of removal says nothing about places; that of candidates does.
    let mut ordered = pool.to_vec();
    ordered.sort_unstable();
    let near: Vec<u32> =
        evenly(&ordered, MOST_TESTED).into_par_iter().filter(|&index| test(candidates[index as usize])).collect();
    evenly(&near, MOST_CANDIDATES)
}

/// At most `most` of the values, evenly by position.
fn evenly(values: &[u32], most: usize) -> Vec<u32> {
    let count = values.len().min(most);
    (0..count).map(|rank| values[rank * values.len() / count]).collect()
}
