//! Probes of an earlier bake, where they still stand in the open, and more where an edit has opened space without any.

use super::by_scale::UNSEEN_DISTANCE;
use crate::{
    rays::RayCaster,
    voxels::{Voxel, VoxelGrid, surroundings},
};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Candidates that are asked how far they are from the probes, spread evenly over all of them.
const MOST_ASKED: usize = 16_384;
/// Probes around a candidate that are asked whether it sees them.
const ASKED_PROBES: usize = 8;
/// A place gets a probe of its own if it is this many times farther from all probes than any place was when they were placed.
const MARGIN: f32 = 1.5;

/// And only if none of them is within this share of the support radius: those that are there support what is around the place.
const WITHIN: f32 = 0.5;

/// How probes were spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Spacings are the same everywhere.
    pub is_even: bool,
    /// Of all candidates the largest distance to a probe, in spacings at the candidate.
    pub gap: f32,
}

/// Probes of an earlier bake.
#[derive(Clone, Copy, Debug)]
pub struct KeptProbes<'a> {
    /// World positions, metres.
    pub positions: &'a [Vec3],
    /// Their support radius, metres.
    pub radius_m: f32,
    /// How they were spread.
    pub spread: Spread,
}

/// Places where probes could stand, and the spacing that is wanted at each, relative; none where it is even.
pub(super) struct Places<'a> {
    pub positions: &'a [Vec3],
    pub spacing: Option<&'a [f32]>,
}

impl Places<'_> {
    fn spacing(&self, index: usize) -> f32 {
        self.spacing.map_or(1.0, |spacing| spacing[index])
    }

    fn asked(&self) -> impl IndexedParallelIterator<Item = usize> {
        let (count, all) = (self.positions.len().min(MOST_ASKED), self.positions.len());
        (0..count).into_par_iter().map(move |rank| rank * all / count)
    }

    /// Distance to a probe, in spacings.
    fn away(&self, caster: &RayCaster<'_>, index: usize, distance: f32, probe: Vec3) -> f32 {
        let seen = caster.visible(self.positions[index], probe);
        distance / self.spacing(index) * if seen { 1.0 } else { UNSEEN_DISTANCE }
    }

    /// `[n_asked]` how far each is from the nearest probe, in spacings.
    fn apart(&self, caster: &RayCaster<'_>, probes: &[Vec3]) -> Vec<(usize, f32)> {
        let nearest = |around: &mut Vec<(f32, u32)>, index: usize| {
            around.clear();
            around.extend(probes.iter().zip(0..).map(|(probe, id)| (probe.distance(self.positions[index]), id)));
            let asked = ASKED_PROBES.min(around.len());
            if asked < around.len() {
                around.select_nth_unstable_by(asked - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            }
            let away = |&(distance, id): &(f32, u32)| self.away(caster, index, distance, probes[id as usize]);
            (index, around[..asked].iter().map(away).fold(f32::INFINITY, f32::min))
        };
        self.asked().map_init(Vec::new, nearest).collect()
    }

    /// How these probes are spread.
    pub(super) fn spread(&self, caster: &RayCaster<'_>, probes: &[Vec3]) -> Spread {
        let gap = self.apart(caster, probes).iter().map(|(_, apart)| *apart).fold(0.0, f32::max);
        Spread { is_even: self.spacing.is_none(), gap }
    }

    /// Those of the kept probes that stand in the open, and behind them others at places that are farther from all of them than any
    /// place was; at most `most` in all.
    pub(super) fn extend(
        &self,
        kept: &KeptProbes<'_>,
        caster: &RayCaster<'_>,
        grid: &VoxelGrid,
        most: usize,
    ) -> Vec<Vec3> {
        let is_open = |position: &&Vec3| {
            surroundings(caster, **position).is_open(0.0) && grid.at(**position) != Some(Voxel::Enclosed)
        };
        let mut probes: Vec<Vec3> = kept.positions.par_iter().filter(is_open).copied().collect();
        let mut apart = self.apart(caster, &probes);
        let farthest = |apart: &[(usize, f32)]| {
            let is_far = |(index, apart): &(usize, f32)| {
                *apart > (MARGIN * kept.spread.gap).max(WITHIN * kept.radius_m / self.spacing(*index))
            };
            let far = apart.iter().copied().filter(is_far);
            far.reduce(|best, other| if other.1 > best.1 { other } else { best })
        };
        while let Some((index, _)) = farthest(&apart).filter(|_| probes.len() < most) {
            let probe = self.positions[index];
            probes.push(probe);
            apart.par_iter_mut().for_each(|(index, apart)| {
                let distance = probe.distance(self.positions[*index]);
                if distance / self.spacing(*index) < *apart {
                    *apart = apart.min(self.away(caster, *index, distance, probe));
                }
            });
        }
        probes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        settings::BakeSettings,
        voxels::test_scenes::{block, room, scene},
    };
    use localprt_scenes::Scene;

    /// Places half a metre apart at half height, from x = 0.5 on.
    fn lattice(to_x: f32) -> Vec<Vec3> {
        let columns = (2.0 * to_x) as u32;
        (1..columns).flat_map(|x| (1..8).map(move |z| Vec3::new(0.5 * x as f32, 1.5, 0.5 * z as f32))).collect()
    }

    /// Corners of two rooms beside each other.
    fn rooms() -> ([Vec3; 2], [Vec3; 2]) {
        let (first, second) = (Vec3::ZERO, Vec3::new(5.0, 0.0, 0.0));
        ([first, first + Vec3::new(4.0, 3.0, 4.0)], [second, second + Vec3::new(4.0, 3.0, 4.0)])
    }

    /// Probes in a scene, of those that stood in one room at every other place.
    fn extended(scene: &Scene, positions: &[Vec3], kept: &KeptProbes<'_>) -> Vec<Vec3> {
        let caster = RayCaster::new(scene).expect("tree");
        let grid = VoxelGrid::build(scene, &caster, 1.0, 1.0, &BakeSettings::default()).expect("voxels");
        Places { positions, spacing: None }.extend(kept, &caster, &grid, 10_000)
    }

    #[test]
    fn probes_stay_those_in_a_new_block_go_and_a_new_room_gets_its_own() {
        let ([low, high], [other_low, other_high]) = rooms();
        let one = room(low, high);
        let first = scene(std::slice::from_ref(&one), false);
        let places = lattice(4.0);
        let probes: Vec<Vec3> = places.iter().step_by(2).copied().collect();
        let caster = RayCaster::new(&first).expect("tree");
        let spread = Places { positions: &places, spacing: None }.spread(&caster, &probes);
        // A step of the lattice from the next.
        assert!(spread.is_even && (0.49..0.72).contains(&spread.gap), "{spread:?}");
        let kept = KeptProbes { positions: &probes, radius_m: 1.2, spread };
        assert_eq!(extended(&first, &places, &kept), probes, "nothing has changed");

        let blocked = scene(&[one.clone(), block(Vec3::new(0.8, 0.8, 0.8), Vec3::new(2.2, 2.2, 2.2))], false);
        let left = extended(&blocked, &places, &kept);
        let is_free = |at: &&Vec3| !(at.x > 0.8 && at.x < 2.2 && at.z > 0.8 && at.z < 2.2);
        let expected: Vec<Vec3> = probes.iter().filter(is_free).copied().collect();
        assert!(expected.len() < probes.len() && left[..expected.len()] == expected);

        let both = scene(&[one, room(other_low, other_high)], false);
        let places: Vec<Vec3> = places.iter().copied().chain(places.iter().map(|at| *at + other_low)).collect();
        let found = extended(&both, &places, &kept);
        assert!(found[..probes.len()] == probes && found[probes.len()..].iter().all(|at| at.x > 5.0));
        // No place there is farther from all than places were, by the margin, or than half of the radius.
        let new = &found[probes.len()..];
        let gap = |at: &Vec3| new.iter().map(|probe| probe.distance(*at)).fold(f32::INFINITY, f32::min);
        let most = (MARGIN * spread.gap).max(WITHIN * kept.radius_m);
        assert!(places.iter().filter(|at| at.x > 5.0).all(|at| gap(at) <= most));
        assert!(new.len() > 4 && new.len() < probes.len(), "{} of {}", new.len(), probes.len());
    }
}
