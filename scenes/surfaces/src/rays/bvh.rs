//! Watertight closest-hit and visibility queries; the only file that names obvhs.
//!
//! obvhs supplies the tree and its traversal. Its own triangle tests leak at shared edges, so triangles are tested here
//! after Woop, Benthin and Wald 2013 (edge functions in f32, again in f64 where one vanishes), over boxes padded by
//! [`BOX_PADDING`] times the largest coordinate, because a watertight triangle test is lost in a box that the ray
//! misses by rounding.

use glam::{Vec3, Vec3A};
use obvhs::{
    Boundable, BvhBuildParams,
    aabb::Aabb,
    bvh2::Bvh2,
    bvh2::reinsertion::ReinsertionOptimizer,
    cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh},
    ploc::PlocBuilder,
    ray::{Ray, RayHit},
};

/// Boxes grow by this times (largest absolute coordinate + 1) on every side: a few f32 roundings.
const BOX_PADDING: f32 = 1e-6;
/// The tree holds boxes scaled so that the largest coordinate is about two to this power: its traversal ignores boxes
/// that a ray leaves within 1e-4 units, which would lose surfaces nearer than a tenth of a millimetre in metres. Here
/// it is 1e-10 of the largest coordinate, below the rounding of f32.
const SCALED_COORDINATE: f32 = 1_048_576.0;
/// The traversal of the eight-wide tree has a stack of this many groups.
const MAX_STACK: usize = 32;

/// A triangle as the tree stores it.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredTriangle {
    corners: [Vec3; 3],
    /// Index given at the build.
    pub index: u32,
    /// Whether hits must be confirmed by the caller (alpha masks).
    pub masked: bool,
}

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
pub(super) struct Tree {
    bvh: CwBvh,
    /// Tree units per metre, a power of two, so that scaling does not round.
    scale: f32,
    /// In tree order, so that a leaf's triangles lie together.
    triangles: Vec<StoredTriangle>,
}

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
        let scale =
            if largest > 0.0 { (SCALED_COORDINATE / largest).log2().round().clamp(-100.0, 100.0).exp2() } else { 1.0 };
        let boxes: Vec<PaddedBox> = triangles
            .iter()
            .map(|[a, b, c]| {
                let (low, high) = (Vec3A::from(a.min(*b).min(*c)) - padding, Vec3A::from(a.max(*b).max(*c)) + padding);
                PaddedBox(Aabb::new(low * scale, high * scale))
            })
            .collect();
        if boxes.is_empty() {
            return Ok(Self { bvh: CwBvh::default(), scale, triangles: Vec::new() });
        }
        let bvh = eight_wide_tree(&boxes, BvhBuildParams::medium_build());
        let depth = stack_need(&bvh);
        if depth > MAX_STACK {
            return Err(TreeError::TooDeep { depth });
        }
        let triangles = bvh
            .primitive_indices
            .iter()
            .map(|&index| StoredTriangle { corners: triangles[index as usize], index, masked: masked[index as usize] })
            .collect();
        Ok(Self { bvh, scale, triangles })
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
        if self.triangles.is_empty() {
            return None;
        }
        let shear = Shear::new(origin, dir);
        let mut nearest: Option<TriangleHit> = None;
        let mut tree_hit = RayHit::none();
        self.bvh.ray_traverse(self.ray(origin, dir, t_max), &mut tree_hit, |_, id| {
            let triangle = &self.triangles[id];
            // A tie has to pass for the comparison.
            let t_max = nearest.map_or(t_max, |nearest| nearest.t.next_up());
            let precedes =
                |hit: &TriangleHit| nearest.is_none_or(|nearest| (hit.t, hit.triangle) < (nearest.t, nearest.triangle));
            match shear.intersect(triangle, t_max) {
                Some(hit) if precedes(&hit) && (!triangle.masked || confirm(&hit)) => {
                    nearest = Some(hit);
                    hit.t * self.scale
                }
                _ => f32::INFINITY,
            }
        });
        nearest
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
        if self.triangles.is_empty() {
            return None;
        }
        let shear = Shear::new(origin, dir);
        let stops = |triangle: &StoredTriangle| {
            shear.intersect(triangle, t_max).filter(|hit| !triangle.masked || confirm(hit)).is_some()
        };
        if self.triangles.get(hint as usize).is_some_and(stops) {
            return Some(hint);
        }
        let mut occluder = None;
        self.bvh.ray_traverse_miss(self.ray(origin, dir, t_max), |_, id| {
            if stops(&self.triangles[id]) {
                occluder = Some(id as u32);
                0.0
            } else {
                f32::INFINITY
            }
        });
        occluder
    }

    /// A ray in tree units.
    ///
    /// obvhs takes the sign of a component once from the direction and once from its inverse, which disagree for -0.0:
    /// such a ray would miss boxes. Adding zero makes it +0.0.
    fn ray(&self, origin: Vec3, dir: Vec3, t_max: f32) -> Ray {
        Ray::new((origin * self.scale).into(), (dir + Vec3::ZERO).into(), 0.0, t_max * self.scale)
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

/// What obvhs's `build_cwbvh` makes, without its clock, which browsers do not have.
fn eight_wide_tree(boxes: &[PaddedBox], params: BvhBuildParams) -> CwBvh {
    let mut tree = two_wide_tree(boxes, params);
    ReinsertionOptimizer::default().run(&mut tree, params.reinsertion_batch_ratio, None);
    bvh2_to_cwbvh(&tree, params.max_prims_per_leaf.clamp(1, 3), true, false)
}

/// Most groups that a traversal can have on its stack: the nodes on the way to a leaf that leave a second inner child
/// behind.
fn stack_need(bvh: &CwBvh) -> usize {
    let mut most = 0;
    let mut open = vec![(0usize, 0usize)];
    while let Some((node, held)) = open.pop() {
        let node = &bvh.nodes[node];
        let inner = node.imask.count_ones();
        let held = held + usize::from(inner > 1);
        most = most.max(held);
        for child in 0..inner {
            open.push((node.child_base_idx as usize + child as usize, held));
        }
    }
    most
}

/// Per-ray constants of the watertight test: axes so that the ray's largest component is z, and the shear that turns it
/// into the z axis.
struct Shear {
    origin: Vec3,
    axes: [usize; 3],
    shear: [f32; 3],
}

impl Shear {
    fn new(origin: Vec3, dir: Vec3) -> Self {
        let size = dir.abs();
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if dir[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        Self { origin, axes: [x, y, z], shear: [dir[x] / dir[z], dir[y] / dir[z], 1.0 / dir[z]] }
    }

    /// Hit with `0 < t < t_max`, from either side.
    #[inline]
    fn intersect(&self, triangle: &StoredTriangle, t_max: f32) -> Option<TriangleHit> {
        let [x, y, z] = self.axes;
        let [shear_x, shear_y, shear_z] = self.shear;
        let a = triangle.corners[0] - self.origin;
        let b = triangle.corners[1] - self.origin;
        let c = triangle.corners[2] - self.origin;
        let (ax, ay) = (a[x] - shear_x * a[z], a[y] - shear_y * a[z]);
        let (bx, by) = (b[x] - shear_x * b[z], b[y] - shear_y * b[z]);
        let (cx, cy) = (c[x] - shear_x * c[z], c[y] - shear_y * c[z]);
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let product = |a: f32, b: f32| f64::from(a) * f64::from(b);
            u = (product(cx, by) - product(cy, bx)) as f32;
            v = (product(ax, cy) - product(ay, cx)) as f32;
            w = (product(bx, ay) - product(by, ax)) as f32;
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let distance = (u * a[z] + v * b[z] + w * c[z]) * shear_z;
        let t = distance / determinant;
        if !(t > 0.0 && t < t_max) {
            return None;
        }
        let inverse = 1.0 / determinant;
        Some(TriangleHit {
            t,
            triangle: triangle.index,
            barycentrics: Vec3::new(u * inverse, v * inverse, w * inverse),
            front: determinant > 0.0,
        })
    }
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
