//! Probes by the local scale: close together where surfaces are, few in the open.

use super::{Candidates, Reduction};
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
pub(super) const UNSEEN_DISTANCE: f32 = 1.5;
/// Visibility is asked for up to so many pairs of a probe and a candidate.
const MOST_PAIRS: usize = 60_000_000;
/// Candidates stand no higher above a surface than this many spacings.
const MOST_UP: f32 = 2.0;

/// Candidates off the surfaces whose scale was measured: at `standoff` times the spacing that `target` probes will have there, and in
/// the middle of the space above if that is not far up. Not those behind surfaces, too close to others, or in enclosed space. In a
/// fixed order. With the spacing wanted at each, relative.
pub(super) fn candidates(
    scale: &LocalScale,
    spacing: &[f32],
    grid: &VoxelGrid,
    caster: &RayCaster<'_>,
    target: usize,
    standoff: f32,
) -> (Candidates, Vec<f32>) {
    let samples = scale.samples();
    // Over a surface there are as many probes as it has squares of their spacing.
    let demand: f64 = samples
        .iter()
        .zip(spacing)
        .map(|(sample, &spacing)| f64::from(sample.area_m2) / f64::from(spacing).powi(2))
        .sum();
    let unit_m = (demand / target.max(1) as f64).sqrt() as f32;
    let found: Vec<Vec<(Vec3, f32)>> = samples
        .par_iter()
        .zip(spacing)
        .map(|(sample, &spacing)| {
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
    let (positions, spacing) = found.into_iter().flatten().unzip();
    (Candidates { positions, rejected }, spacing)
}

/// Keeps the first `count` of an order in which each candidate is the farthest, in spacings at its place, from all before it. Of those
/// removed, the ones that would be missed most come last.
///
/// Every beginning of that order is spread evenly (farthest point strategy, Eldar et al. 1997).
pub(super) fn spread(candidates: &[Vec3], spacings: &[f32], caster: &RayCaster<'_>, count: usize) -> Reduction {
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
    let mut removed: Vec<u32> =
        (0..candidates.len() as u32).filter(|index| apart[*index as usize] > f32::NEG_INFINITY).collect();
    removed.sort_by(|&a, &b| apart[a as usize].total_cmp(&apart[b as usize]).then(a.cmp(&b)));
    chosen.sort_unstable();
    Reduction { kept: chosen, removed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scale::{importance, measure},
        settings::BakeSettings,
        voxels::test_scenes::{room, scene},
    };
    use std::collections::BTreeSet;

    /// A lattice of candidates in the middle of a room, x and z from 0 to 8.
    fn lattice() -> Vec<Vec3> {
        (0..1600).map(|index| Vec3::new((index % 40) as f32 * 0.2, 1.0, (index / 40) as f32 * 0.2)).collect()
    }

    #[test]
    fn more_probes_keep_those_of_fewer_and_density_goes_with_the_spacing() {
        let scene = scene(&[room(Vec3::splat(-1.0), Vec3::new(9.0, 3.0, 9.0))], false);
        let caster = RayCaster::new(&scene).unwrap();
        let candidates = lattice();
        let spacings: Vec<f32> = candidates.iter().map(|place| if place.x < 4.0 { 1.0 } else { 2.0 }).collect();
        let [few, many] = [40, 80].map(|count| spread(&candidates, &spacings, &caster, count));
        let kept: BTreeSet<u32> = many.kept.iter().copied().collect();
        assert!(few.kept.len() == 40 && few.kept.iter().all(|index| kept.contains(index)));
        let all: BTreeSet<u32> = many.kept.iter().chain(&many.removed).copied().collect();
        assert!(many.kept.len() == 80 && all.len() == candidates.len(), "each candidate once");
        let close = many.kept.iter().filter(|index| candidates[**index as usize].x < 4.0).count();
        // 4 to 1 by area.
        assert!((58..=68).contains(&close), "{close}");
        // Of those removed the last is the farthest from all that are kept, in spacings.
        let apart = |index: u32| {
            let index = index as usize;
            let to = |kept: &u32| {
                let kept = *kept as usize;
                candidates[index].distance(candidates[kept]) / (0.5 * (spacings[index] + spacings[kept]))
            };
            many.kept.iter().map(to).fold(f32::INFINITY, f32::min)
        };
        let last = apart(*many.removed.last().unwrap());
        assert!(many.removed.iter().all(|&index| apart(index) <= last * 1.001));
    }

    #[test]
    fn candidates_stand_in_the_open_and_closer_where_the_scale_is_small() {
        let scene = localprt_scenes::builtin::scene("room-on-plain").unwrap();
        let (caster, settings) = (RayCaster::new(&scene).unwrap(), BakeSettings::default());
        let mut scale = LocalScale::of(measure(&caster, 4000), scene.extent(), 60_000, Vec::new());
        let grid = VoxelGrid::build(&scene, &caster, 16.0, scale.closest(150), &settings).unwrap();
        scale.look(&scene, &importance(&scale, &grid, &caster));
        let wanted = scale.spacing(150).unwrap();
        let (found, spacing) = candidates(&scale, &wanted, &grid, &caster, 150, 0.5);
        assert_eq!(found.positions.len(), spacing.len());
        let kept = spread(&found.positions, &spacing, &caster, 150).kept;
        let positions: Vec<Vec3> = kept.iter().map(|&index| found.positions[index as usize]).collect();
        assert!(positions.iter().all(|&position| {
            surroundings(&caster, position).is_open(0.0) && grid.at(position) != Some(Voxel::Enclosed)
        }));
        // The room is a thousandth of the plain.
        let is_inside =
            |position: &Vec3| position.x.abs() < 4.0 && position.z.abs() < 5.0 && (0.0..3.0).contains(&position.y);
        let inside = positions.iter().filter(|position| is_inside(position)).count();
        assert!(inside >= 25, "{inside} of 150");
    }
}
