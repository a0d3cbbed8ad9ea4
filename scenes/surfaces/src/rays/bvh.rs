//! Watertight closest-hit and visibility queries; the only file that names obvhs.
//!
//! obvhs supplies a two-wide tree; `wide.rs` traverses it eight nodes at a time, `triangles.rs` has the watertight triangle test. Boxes are
//! padded by [`BOX_PADDING`] times the largest coordinate, because such a test is lost in a box that the ray misses by rounding.

use super::triangles::{LANES, Shear, Triangle, TriangleBlock};
use super::wide::{MAX_STACK, WIDTH, WideTree};
use glam::{Vec3, Vec3A};
use obvhs::{
    Boundable, BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::reinsertion::ReinsertionOptimizer, ploc::PlocBuilder,
};

/// Boxes grow by this times (largest absolute coordinate + 1) on every side: a few f32 roundings.
const BOX_PADDING: f32 = 1e-6;

/// A hit on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance along the unit ray direction.
    pub t: f32,
    /// Index of the triangle as given at the build.
    pub triangle: u32,
    /// Weights of the three corners, summing to 1.
    pub barycentrics: Vec3,
    /// The ray met the counter-clockwise side.
    pub front: bool,
}

/// Why a tree could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TreeError {
    /// The tree is too deep for its traversal stack; only geometry whose sizes span tens of orders of magnitude does it.
    #[error(
        "triangle sizes span too many orders of magnitude: the ray tree needs a stack of {depth} groups, at most {MAX_STACK} can be traversed"
    )]
    TooDeep {
        /// Groups needed.
        depth: usize,
    },
}

impl TreeError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        "remove stray far-away or microscopic geometry"
    }
}

/// A bounding volume hierarchy over triangles.
pub(super) struct Tree(WideTree);

struct PaddedBox(Aabb);

impl Boundable for PaddedBox {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    /// Builds over finite triangles; `masked[i]` asks for confirmation of hits on triangle i.
    pub(super) fn build(triangles: &[[Vec3; 3]], masked: &[bool]) -> Result<Self, TreeError> {
        let largest =
            triangles.iter().flatten().fold(0.0f32, |largest, corner| largest.max(corner.abs().max_element()));
        let padding = Vec3A::splat(BOX_PADDING * (largest + 1.0).min(f32::MAX / 4.0));
        let boxes: Vec<PaddedBox> = triangles
            .iter()
            .map(|[a, b, c]| {
                let (low, high) = (Vec3A::from(a.min(*b).min(*c)) - padding, Vec3A::from(a.max(*b).max(*c)) + padding);
                PaddedBox(Aabb::new(low, high))
            })
            .collect();
        if boxes.is_empty() {
            return Ok(Self(WideTree::empty()));
        }
        let params = BvhBuildParams::medium_build();
        let mut two = two_wide_tree(&boxes, params);
        ReinsertionOptimizer::default().run(&mut two, params.reinsertion_batch_ratio, None);
        let stored = |index: u32| {
            let (corners, masked) = (triangles[index as usize], masked[index as usize]);
            Triangle { corners, index, masked }
        };
        let wide = eight_wide_tree(&two, stored);
        let depth = wide.stack_need();
        if depth > MAX_STACK {
            return Err(TreeError::TooDeep { depth });
        }
        Ok(Self(wide))
    }

    /// Nearest hit with `0 < t < t_max` that `confirm` accepts (asked for masked triangles only); of equally near ones that on the
    /// triangle given first, whatever the tree looks like.
    pub(super) fn closest_hit(
        &self,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<TriangleHit> {
        self.0.closest_hit(origin, dir, t_max, confirm)
    }

    /// A triangle that `confirm` accepts strictly between 0 and `t_max`, as a place in the tree's own order; `None` if the
    /// way is clear.
    ///
    /// `hint` is such a place, tested first: neighboring rays are mostly stopped by the same triangle. Whether the way is
    /// clear does not depend on it. Any number is allowed.
    pub(super) fn occluder(
        &self,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        hint: u32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<u32> {
        let shear = Shear::new(origin, dir);
        let stops = |(block, lane): (&TriangleBlock, usize)| {
            shear.intersect(block, lane, t_max).is_some_and(|hit| !block.is_masked(lane) || confirm(&hit))
        };
        if self.0.at(hint).is_some_and(stops) {
            return Some(hint);
        }
        self.0.occluder(&shear, dir, t_max, confirm)
    }
}

/// Which triangles are near a box.
pub struct BoxTree(Bvh2);

impl BoxTree {
    /// Of boxes by their lowest and highest corners.
    pub fn of(boxes: impl Iterator<Item = (Vec3, Vec3)>) -> Self {
        let boxes: Vec<PaddedBox> = boxes.map(|(low, high)| PaddedBox(Aabb::new(low.into(), high.into()))).collect();
        Self(if boxes.is_empty() { Bvh2::default() } else { two_wide_tree(&boxes, BvhBuildParams::fast_build()) })
    }

    /// Boxes that this one touches, and maybe some beside it, by rising number.
    pub fn around(&self, low: Vec3, high: Vec3) -> Vec<u32> {
        let mut found = Vec::new();
        self.0.aabb_traverse(Aabb::new(low.into(), high.into()), |tree, node| {
            let node = tree.nodes[node as usize];
            found.extend_from_slice(&tree.primitive_indices[node.first_index as usize..][..node.prim_count as usize]);
            true
        });
        found.sort_unstable();
        found
    }
}

fn two_wide_tree(boxes: &[PaddedBox], params: BvhBuildParams) -> Bvh2 {
    PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    )
}

/// Over the triangles of a two-wide tree with one of them in each leaf: subtrees of few triangles become leaves, and of the other
/// nodes the largest are opened until a node has eight children.
fn eight_wide_tree(two: &Bvh2, stored: impl Fn(u32) -> Triangle) -> WideTree {
    let counts = triangle_counts(two);
    let is_leaf = |node: usize| counts[node] as usize <= LANES;
    let mut wide = WideTree::with_capacity(counts[0] as usize);
    let mut open = vec![(0usize, wide.add_node())];
    while let Some((node, number)) = open.pop() {
        let mut children = vec![node];
        while children.len() < WIDTH {
            let area = |&child: &usize| two.nodes[child].aabb().half_area();
            let inner = (0..children.len()).filter(|&place| !is_leaf(children[place]));
            let Some(largest) = inner.max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b]))) else { break };
            let first = two.nodes[children[largest]].first_index as usize;
            children[largest] = first;
            children.push(first + 1);
        }
        let mut of_node = Vec::with_capacity(WIDTH);
        for child in children {
            let bounds = two.nodes[child].aabb();
            let bounds = (bounds.min.into(), bounds.max.into());
            of_node.push(if is_leaf(child) {
                wide.leaf(bounds, triangles_below(two, child).map(&stored))
            } else {
                let inner = wide.inner(bounds);
                open.push((child, inner.number()));
                inner
            });
        }
        wide.set_children(number, &of_node);
    }
    wide
}

/// `[n_nodes]` triangles below each node.
fn triangle_counts(two: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(two.nodes.len());
    let mut open = vec![0usize];
    while let Some(node) = open.pop() {
        order.push(node);
        if !two.nodes[node].is_leaf() {
            open.extend([0, 1].map(|child| two.nodes[node].first_index as usize + child));
        }
    }
    let mut counts = vec![0u32; two.nodes.len()];
    for &node in order.iter().rev() {
        let own = &two.nodes[node];
        let first = own.first_index as usize;
        counts[node] = if own.is_leaf() { own.prim_count } else { counts[first] + counts[first + 1] };
    }
    counts
}

/// Triangles below a node, in the tree's order.
fn triangles_below(two: &Bvh2, node: usize) -> impl Iterator<Item = u32> {
    let mut open = vec![node];
    let mut found = Vec::with_capacity(LANES);
    while let Some(node) = open.pop() {
        let own = &two.nodes[node];
        let first = own.first_index as usize;
        if own.is_leaf() {
            found.extend_from_slice(&two.primitive_indices[first..first + own.prim_count as usize]);
        } else {
            open.extend([first + 1, first]);
        }
    }
    found.into_iter()
}

/// Brute-force closest hit in f64 (Möller-Trumbore), the reference for tests.
#[cfg(test)]
pub(super) fn brute_force(triangles: &[[Vec3; 3]], origin: Vec3, dir: Vec3) -> Option<(f64, usize)> {
    let (origin, dir) = (origin.as_dvec3(), dir.as_dvec3());
    let mut nearest: Option<(f64, usize)> = None;
    for (index, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let (e1, e2) = (b - a, c - a);
        let p = dir.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            continue;
        }
        let s = origin - a;
        let u = s.dot(p) / determinant;
        let q = s.cross(e1);
        let v = dir.dot(q) / determinant;
        let t = e2.dot(q) / determinant;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && nearest.is_none_or(|(held, _)| t < held) {
            nearest = Some((t, index));
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::Tree;
    use glam::Vec3;
    #[cfg(target_arch = "x86_64")]
    use localprt_formats::directions::{counter_uniform, spherical_fibonacci};

    /// Some of them in one plane and some no larger than a point, by all tests that this processor has.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_processor_meets_the_same() {
        let corner = |number: u64, k: u64| {
            let random = |axis| counter_uniform(4, number, 3 * k + axis) as f32;
            let place = Vec3::new(random(0), random(1), random(2)) * 9.0;
            if number.is_multiple_of(3) { place.floor() } else { place }
        };
        let triangles: Vec<[Vec3; 3]> = (0..3000)
            .map(|number| {
                let first = corner(number, 0);
                [0, 1, 2].map(|k| if k == 0 { first } else { first.lerp(corner(number, k), 0.3) })
            })
            .collect();
        let masked: Vec<bool> = (0..triangles.len()).map(|number| number % 5 == 0).collect();
        let tree = Tree::build(&triangles, &masked).expect("a tree");
        let portable = Tree(Tree::build(&triangles, &masked).expect("a tree").0.portable());
        let mut met = 0;
        for ray in 0..50_000u64 {
            let (origin, dir) = (corner(ray, 9), Vec3::from(spherical_fibonacci((ray % 4099) as u32, 4099)));
            let confirm = |hit: &super::TriangleHit| hit.barycentrics.x < 0.5;
            let hits = [&tree, &portable].map(|tree| tree.closest_hit(origin, dir, 6.0, confirm));
            assert_eq!(hits[0], hits[1], "{ray}");
            let found = [&tree, &portable].map(|tree| tree.occluder(origin, dir, 6.0, u32::MAX, confirm).is_some());
            assert_eq!(found, [hits[0].is_some(); 2], "{ray}");
            met += usize::from(found[0]);
        }
        assert!((5_000..45_000).contains(&met), "{met}");
    }

    /// Distances far below the traversal's own 1e-4, in scenes of any unit.
    #[test]
    fn a_surface_close_by_is_not_lost() {
        for scale in [1e-3f32, 1.0, 1e4] {
            let square = [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]];
            let triangles = square.map(|triangle| triangle.map(|corner| (2.0 * corner - 1.0) * scale));
            let tree = Tree::build(&triangles, &[false; 2]).unwrap();
            for distance in [1e-3, 1e-4, 1e-5, 1e-6].map(|share| share * scale) {
                let origin = Vec3::new(0.1 * scale, 0.2 * scale, -scale) + Vec3::Z * distance;
                let hit = tree.closest_hit(origin, Vec3::NEG_Z, f32::INFINITY, |_| true);
                // The origin is rounded to 2^-24 of the scale.
                assert!(
                    hit.is_some_and(|hit| (hit.t - distance).abs() <= 6e-8 * scale),
                    "{scale}, {distance}: {hit:?}"
                );
                assert!(
                    tree.occluder(origin, Vec3::NEG_Z, 0.5 * scale, u32::MAX, |_| true).is_some(),
                    "{scale}, {distance}"
                );
                assert!(
                    tree.occluder(origin, Vec3::Z, f32::INFINITY, u32::MAX, |_| true).is_none(),
                    "{scale}, {distance}"
                );
            }
        }
    }
}
