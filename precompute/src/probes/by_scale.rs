//! Probes by the local scale: close together where surfaces are, few in the open.

use crate::{
    rays::RayCaster,
    scale::LocalScale,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use rayon::prelude::*;

/// Least distance to surfaces, as a share of the distance that was wanted.
const CLEARANCE: f32 = 0.25;
/// Probes that do not see each other count as this many times farther apart: each side of a wall needs its own.
const UNSEEN_DISTANCE: f32 = 1.5;
/// Visibility is asked for up to so many pairs of a probe and a candidate.
const MOST_PAIRS: usize = 60_000_000;
/// Candidates stand no higher above a surface than this many spacings.
const MOST_UP: f32 = 2.0;

/// Possible probe positions and what their distances from others are in proportion to.
#[derive(Clone, Debug, Default)]
pub(super) struct ScaledCandidates {
    /// World positions, metres.
    pub positions: Vec<Vec3>,
    /// Spacing at each, relative.
    pub spacing: Vec<f32>,
    /// Samples without a good position.
    pub rejected: usize,
}

/// Candidates off the surfaces whose scale was measured: at `standoff` times the spacing that `target` probes will have there, and in
/// the middle of the space above if that is not far up. Not those behind surfaces, too close to others, or in enclosed space. In a
/// fixed order.
pub(super) fn candidates(
    scale: &LocalScale,
    grid: &VoxelGrid,
    caster: &RayCaster<'_>,
    target: usize,
    standoff: f32,
) -> ScaledCandidates {
    let samples = scale.samples();
    // Over a surface there are as many probes as it has squares of their spacing.
    let demand: f64 = (0..samples.len())
        .map(|index| f64::from(samples[index].area_m2) / f64::from(scale.spacing(index)).powi(2))
        .sum();
    let unit_m = (demand / target.max(1) as f64).sqrt() as f32;
    let found: Vec<Vec<(Vec3, f32)>> = samples
        .par_iter()
        .enumerate()
        .map(|(index, sample)| {
            let spacing = scale.spacing(index);
            let wanted_m = standoff * unit_m * spacing;
            let middle_m = 0.5 * caster.free_above(sample.position, sample.normal);
            let is_good = |&height_m: &f32| {
                let position = sample.position + sample.normal * height_m;
                surroundings(caster, position).is_open(CLEARANCE * height_m.min(wanted_m))
                    && grid.at(position) != Some(Voxel::Enclosed)
            };
            // Off the surface where there is room, and in the middle of the space above where that is not far up.
            let off = (wanted_m < middle_m).then_some(wanted_m);
            let middle = (middle_m <= MOST_UP * unit_m * spacing).then_some(middle_m);
            let heights = off.into_iter().chain(middle).filter(is_good);
            heights.map(|height_m| (sample.position + sample.normal * height_m, spacing)).collect()
        })
        .collect();
    let rejected = found.iter().filter(|found| found.is_empty()).count();
    let (positions, spacing): (Vec<Vec3>, Vec<f32>) = found.into_iter().flatten().unzip();
    ScaledCandidates { positions, spacing, rejected }
}

/// The first `count` of an order in which each candidate is the farthest, in spacings at its place, from all before it; and the rest.
///
/// Every beginning of that order is spread evenly (farthest point strategy, Eldar et al. 1997).
pub(super) fn spread(
    candidates: &[Vec3],
    spacings: &[f32],
    caster: &RayCaster<'_>,
    count: usize,
) -> (Vec<u32>, Vec<u32>) {
    let count = count.min(candidates.len());
    let asks = candidates.len().saturating_mul(count) <= MOST_PAIRS;
    let mut apart = vec![f32::INFINITY; candidates.len()];
    let mut chosen: Vec<u32> = Vec::with_capacity(count);
    // The first stands where they are closest.
    let mut next = (0..candidates.len()).min_by(|&a, &b| spacings[a].total_cmp(&spacings[b])).unwrap_or_default();
    while chosen.len() < count {
        chosen.push(next as u32);
        apart[next] = f32::NEG_INFINITY;
        let (place, own) = (candidates[next], spacings[next]);
        apart.par_iter_mut().enumerate().with_min_len(512).for_each(|(index, apart)| {
            let distance = place.distance(candidates[index]) / (0.5 * (own + spacings[index]));
            if distance < *apart {
                let seen = !asks || caster.visible(place, candidates[index]);
                *apart = apart.min(if seen { distance } else { UNSEEN_DISTANCE * distance });
            }
        });
        next = (0..candidates.len()).rev().max_by(|&a, &b| apart[a].total_cmp(&apart[b])).unwrap_or_default();
    }
    let mut rest: Vec<u32> =
        (0..candidates.len() as u32).filter(|index| apart[*index as usize] > f32::NEG_INFINITY).collect();
    // As thinning leaves them: those that would be missed most come last.
    rest.sort_by(|&a, &b| apart[a as usize].total_cmp(&apart[b as usize]).then(a.cmp(&b)));
    chosen.sort_unstable();
    (chosen, rest)
}
