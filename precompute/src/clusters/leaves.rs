//! Initial clusters: an AABB tree over the receivers (section 4.1).

use crate::morton;
use glam::Vec3;

/// Splits the receivers at the median of the longest axis until every leaf holds fewer than `limit`. Leaves in tree order,
/// members along a Morton curve over the leaf's box, so that those that follow each other are neighbors; ties go by index.
pub fn leaves(positions: &[Vec3], limit: usize) -> Vec<Vec<u32>> {
    let mut finished = Vec::new();
    let mut open = vec![(0..positions.len() as u32).collect::<Vec<u32>>()];
    while let Some(mut members) = open.pop() {
        if members.is_empty() {
            continue;
        }
        let (low, high) = members.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &member| {
            let position = positions[member as usize];
            (low.min(position), high.max(position))
        });
        let size = high - low;
        if members.len() < limit.max(2) {
            members
                .sort_by_cached_key(|&member| (place((positions[member as usize] - low) / size.max_element()), member));
            finished.push(members);
            continue;
        }
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        members.sort_unstable_by(|&a, &b| {
            positions[a as usize][axis].total_cmp(&positions[b as usize][axis]).then(a.cmp(&b))
        });
        let upper = members.split_off(members.len() / 2);
        // Lower half first.
        open.push(upper);
        open.push(members);
    }
    finished
}

/// Place of a point of the unit cube on a Morton curve; of no point, the first.
fn place(point: Vec3) -> u32 {
    morton::of_space(point.to_array().map(|value| (value * 1023.0) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_receiver_is_in_one_leaf_below_the_limit() {
        let positions: Vec<Vec3> = (0..5000u32)
            .map(|i| Vec3::from(localprt_formats::directions::spherical_fibonacci(i, 5000)) * Vec3::new(9.0, 1.0, 1.0))
            .chain(std::iter::repeat_n(Vec3::ONE, 3000))
            .collect();
        let leaves = leaves(&positions, 1024);
        assert!(leaves.iter().all(|leaf| !leaf.is_empty() && leaf.len() < 1024));
        let mut all: Vec<u32> = leaves.into_iter().flatten().collect();
        all.sort_unstable();
        assert_eq!(all, (0..8000).collect::<Vec<u32>>());
    }

    #[test]
    fn no_receivers_no_leaves() {
        assert!(leaves(&[], 1024).is_empty());
    }
}
