//! Initial clusters: an AABB tree over the receivers (section 4.1).
//!
//! Its planes are kept with a bake. A tree that is grown again from kept planes puts every receiver that stands where it stood into
//! the leaf that it was in, whatever was added or removed elsewhere.

use crate::morton;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A median plane that leaves less than this share on one side is given up for one across another axis: many receivers of a wall
/// lie in one plane.
const LEAST_SHARE: f32 = 0.25;
/// Deepest tree that is followed.
const MOST_LEVELS: usize = 64;

/// Planes of a tree, parents before their children and lower children first: the axis and where on it, or a leaf.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeafTree(Vec<Option<(u8, f32)>>);

impl LeafTree {
    /// Whether it is a whole tree with planes that can be.
    pub fn is_sound(&self) -> bool {
        // Levels of the subtrees still to come.
        let mut open = vec![0];
        for node in &self.0 {
            match (open.pop(), node) {
                (Some(_), None) => {}
                (Some(level), Some((axis, place))) if *axis < 3 && place.is_finite() && level < MOST_LEVELS => {
                    open.extend([level + 1; 2]);
                }
                _ => return false,
            }
        }
        open.is_empty() || self.0.is_empty()
    }
}

/// Splits the receivers until every leaf holds fewer than `limit`: along the planes of a `kept` tree, and below its leaves at about
/// the median of the longest axis. Leaves in tree order, without empty ones, members along a Morton curve over the leaf's box, so that
/// those that follow each other are neighbors; ties go by index. With the tree.
pub fn leaves(positions: &[Vec3], limit: usize, kept: Option<&LeafTree>) -> (Vec<Vec<u32>>, LeafTree) {
    let kept = kept.filter(|tree| tree.is_sound()).map_or(&[][..], |tree| &tree.0);
    let mut growth =
        Growth { positions, limit: limit.max(2), kept: kept.iter(), leaves: Vec::new(), planes: Vec::new() };
    growth.grow((0..positions.len() as u32).collect(), !kept.is_empty(), 0);
    (growth.leaves, LeafTree(growth.planes))
}

struct Growth<'a> {
    positions: &'a [Vec3],
    limit: usize,
    kept: std::slice::Iter<'a, Option<(u8, f32)>>,
    leaves: Vec<Vec<u32>>,
    planes: Vec<Option<(u8, f32)>>,
}

impl Growth<'_> {
    fn grow(&mut self, members: Vec<u32>, is_kept: bool, level: usize) {
        let kept = if is_kept { self.kept.next().copied().flatten() } else { None };
        let plane = match kept {
            Some(plane) => Some(plane),
            None if members.len() < self.limit || level >= MOST_LEVELS => None,
            None => self.median(&members),
        };
        self.planes.push(plane);
        let Some((axis, place)) = plane else { return self.finish(members) };
        let (lower, upper) =
            members.into_iter().partition(|&member| self.positions[member as usize][usize::from(axis)] < place);
        self.grow(lower, kept.is_some(), level + 1);
        self.grow(upper, kept.is_some(), level + 1);
    }

    /// A plane that halves some receivers, or nearly; `None` if they are all in one place.
    fn median(&self, members: &[u32]) -> Option<(u8, f32)> {
        let (low, high) = self.bounds(members);
        let size = high - low;
        let mut axes = [0usize, 1, 2];
        axes.sort_by(|&a, &b| size[b].total_cmp(&size[a]));
        let mut best: Option<(f32, u8, f32)> = None;
        for axis in axes.into_iter().filter(|&axis| size[axis] > 0.0) {
            let mut along: Vec<f32> = members.iter().map(|&member| self.positions[member as usize][axis]).collect();
            along.sort_unstable_by(f32::total_cmp);
            let middle = along[along.len() / 2];
            // Those in the plane go up, or down with all that lie lower.
            let beyond = along.partition_point(|&place| place <= middle);
            let above = along.get(beyond).copied();
            for place in [Some(middle), above].into_iter().flatten() {
                let below = along.partition_point(|&other| other < place) as f32 / along.len() as f32;
                let share = below.min(1.0 - below);
                if best.is_none_or(|best| share > best.0) {
                    best = Some((share, axis as u8, place));
                }
            }
            if best.is_some_and(|best| best.0 >= LEAST_SHARE) {
                break;
            }
        }
        best.filter(|best| best.0 > 0.0).map(|(_, axis, place)| (axis, place))
    }

    /// Members of one leaf, or of several where they are too many in one place.
    fn finish(&mut self, mut members: Vec<u32>) {
        if members.is_empty() {
            return;
        }
        let (low, high) = self.bounds(&members);
        let edge = (high - low).max_element();
        let on_curve = |&member: &u32| (place((self.positions[member as usize] - low) / edge), member);
        members.sort_by_cached_key(on_curve);
        self.leaves.extend(members.chunks(self.limit - 1).map(<[u32]>::to_vec));
    }

    fn bounds(&self, members: &[u32]) -> (Vec3, Vec3) {
        members.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &member| {
            let position = self.positions[member as usize];
            (low.min(position), high.max(position))
        })
    }
}

/// Place of a point of the unit cube on a Morton curve; of no point, the first.
fn place(point: Vec3) -> u32 {
    morton::of_space(point.to_array().map(|value| (value * 1023.0) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_hash;

    fn cloud() -> Vec<Vec3> {
        let on_sphere = |i: u32| Vec3::from(localprt_formats::directions::spherical_fibonacci(i, 5000));
        let wall = |i: u32| Vec3::new(1.0, (i / 60) as f32 * 0.02, (i % 60) as f32 * 0.05);
        let away = (0..5000).map(|i| on_sphere(i) * Vec3::new(9.0, 1.0, 1.0));
        away.chain((0..3000).map(wall)).chain(std::iter::repeat_n(Vec3::ONE, 3000)).collect()
    }

    #[test]
    fn every_receiver_is_in_one_leaf_below_the_limit() {
        let positions = cloud();
        let (leaves, tree) = leaves(&positions, 1024, None);
        assert!(tree.is_sound());
        assert!(leaves.iter().all(|leaf| !leaf.is_empty() && leaf.len() < 1024));
        assert!(leaves.len() < 22, "{} leaves of {} receivers", leaves.len(), positions.len());
        let mut all: Vec<u32> = leaves.into_iter().flatten().collect();
        all.sort_unstable();
        assert_eq!(all, (0..positions.len() as u32).collect::<Vec<u32>>());
    }

    #[test]
    fn kept_planes_give_the_same_leaves_and_what_is_added_changes_only_its_own() {
        let positions = cloud();
        let (first, tree) = leaves(&positions, 512, None);
        assert_eq!(leaves(&positions, 512, Some(&tree)), (first.clone(), tree.clone()));
        // Some go from one place, and others come in another.
        let stays = |at: &Vec3| at.x > -7.0;
        let mut edited: Vec<Vec3> = positions.iter().copied().filter(stays).collect();
        edited.extend((0..2000).map(|i| Vec3::new(8.0, 0.0, 0.0) + (counter_hash(7, 0, i) % 97) as f32 * 1e-3));
        let (second, _) = leaves(&edited, 512, Some(&tree));
        assert!(second.iter().all(|leaf| leaf.len() < 512));
        let places = |leaf: &Vec<u32>, of: &[Vec3]| -> Vec<[u32; 3]> {
            leaf.iter().map(|&member| of[member as usize].to_array().map(f32::to_bits)).collect()
        };
        let found: std::collections::HashSet<_> = second.iter().map(|leaf| places(leaf, &edited)).collect();
        let touched = |leaf: &&Vec<u32>| {
            leaf.iter().any(|&member| positions[member as usize].x <= -7.0 || positions[member as usize].x > 6.5)
        };
        for leaf in first.iter().filter(|leaf| !touched(leaf)) {
            assert!(found.contains(&places(leaf, &positions)), "a leaf of {} receivers is another", leaf.len());
        }
    }

    #[test]
    fn no_receivers_no_leaves_and_a_broken_tree_is_left_alone() {
        assert!(leaves(&[], 1024, None).0.is_empty());
        let positions = cloud();
        let (fresh, tree) = leaves(&positions, 512, None);
        for broken in [vec![Some((3, 0.0)), None, None], vec![Some((0, f32::NAN)), None, None], vec![None, None]] {
            let broken = LeafTree(broken);
            assert!(!broken.is_sound());
            assert_eq!(leaves(&positions, 512, Some(&broken)), (fresh.clone(), tree.clone()));
        }
    }
}
