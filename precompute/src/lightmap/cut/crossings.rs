//! Where other surfaces stand on a face: lines along which what is on one side does not see what is on the other.

use super::{EdgeKey, key, place, sorted, split::Frame};
use crate::rays::{BoxTree, RayCaster};
use glam::{DVec2, DVec3, Vec3};
use localprt_scenes::{AlphaMode, Scene};
use std::collections::{HashMap, VecDeque};

/// What stands on a face meets the plane this far above it, in texels. What hovers higher lets light pass below.
const ABOVE: f64 = 0.05;
/// What stands on a face stops a look across it at this height...
const HEIGHT: f64 = 0.3;
/// ...from this far on one side to as far on the other, in texels.
const LOOK: f64 = 0.75;
/// Lines may leave the face by this much, in texels: a surface may stand on its very edge.
const MARGIN: f64 = 0.02;
/// Faces shorter than this many texels are left alone.
const SHORTEST: f64 = 0.25;
/// Lines that follow each other are one as long as they leave the straight line by no more than this many texels.
const STRAIGHT: f64 = 0.1;

/// A line on a face on which another surface stands, in the plane of the face, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    pub from: DVec2,
    pub to: DVec2,
    /// Edge of a texel there.
    pub texel_m: f64,
}

/// All triangles of a scene that may stand on others.
pub(super) struct Standing<'a> {
    caster: &'a RayCaster<'a>,
    tree: BoxTree,
    corners: Vec<[Vec3; 3]>,
    /// `[n_faces]` seen through in places: those keep nothing apart.
    is_masked: Vec<bool>,
    /// How many triangles share each edge, whichever side they show.
    sharing: HashMap<EdgeKey, u8>,
    /// How many faces each triangle has, by the places of its corners in order: one for each side that there is.
    sides: HashMap<[[u32; 3]; 3], u8>,
}

/// A line before those that follow each other are joined: its ends lie on edges of what stands there.
struct Piece {
    ends: [DVec2; 2],
    edges: [EdgeKey; 2],
    texel_m: f64,
}

impl<'a> Standing<'a> {
    /// Those of a scene; `caster` holds the same surfaces, cut into faces as finely or not.
    pub(super) fn of(scene: &Scene, caster: &'a RayCaster<'a>) -> Self {
        let corners: Vec<[Vec3; 3]> = scene.faces().map(|(mesh, triangle)| scene.corners(mesh, triangle)).collect();
        let material = |mesh: usize| &scene.materials[scene.meshes[mesh].material];
        let is_masked = scene.faces().map(|(mesh, _)| material(mesh).alpha != AlphaMode::Opaque).collect();
        let tree = BoxTree::of(corners.iter().map(|[a, b, c]| (a.min(*b).min(*c), a.max(*b).max(*c))));
        let mut sharing: HashMap<EdgeKey, u8> = HashMap::with_capacity(3 * corners.len() / 2);
        let mut sides: HashMap<[[u32; 3]; 3], u8> = HashMap::with_capacity(corners.len());
        for corners in &corners {
            let sides = sides.entry(sorted(*corners).map(place)).or_default();
            *sides = sides.saturating_add(1);
            if *sides > 1 {
                continue;
            }
            for corner in 0..3 {
                let count = sharing.entry(key([corners[corner], corners[(corner + 1) % 3]])).or_default();
                *count = count.saturating_add(1);
            }
        }
        Self { caster, tree, corners, is_masked, sharing, sides }
    }

    /// Whether there is a face for each side of a triangle.
    pub(super) fn has_two_sides(&self, face: usize) -> bool {
        self.sides[&sorted(self.corners[face]).map(place)] > 1
    }

    /// What stands on a face, longest lines first; on the side of its frame's normal if `side` is 1, on the other if it is -1.
    /// `texel_m` is the edge of a texel at a place.
    pub(super) fn on(&self, face: usize, frame: &Frame, side: f64, texel_m: &dyn Fn(Vec3) -> f32) -> Vec<Crossing> {
        let corners = sorted(self.corners[face]);
        let [low, high] = bounds(corners);
        let of_face_m = f64::from(texel_m((corners[0] + corners[1] + corners[2]) / 3.0));
        if f64::from(longest(corners)) < SHORTEST * of_face_m {
            return Vec::new();
        }
        let own = corners.map(|corner| frame.flat(corner.as_dvec3()));
        let reach = Vec3::splat(ABOVE as f32 * of_face_m as f32);
        let mut pieces: Vec<Piece> = Vec::new();
        for other in self.tree.around(low - reach, high + reach) {
            let other = other as usize;
            if other == face || self.is_masked[other] || self.is_fold(face, other) {
                continue;
            }
            // Quickly: most lie behind, in the plane, or beside the face.
            let heights = self.corners[other].map(|corner| side * frame.height(corner.as_dvec3()));
            let highest = heights.into_iter().fold(f64::MIN, f64::max);
            if highest <= 0.0 || is_beside(self.corners[other].map(|corner| frame.flat(corner.as_dvec3())), own) {
                continue;
            }
            let [other_low, other_high] = bounds(self.corners[other]);
            let texel_m = f64::from(texel_m(0.5 * (low.max(other_low) + high.min(other_high))));
            let at = at_height(self.corners[other], heights, ABOVE * texel_m);
            let Some((ends, edges)) = at else { continue };
            pieces.push(Piece { ends: ends.map(|end| frame.flat(end)), edges, texel_m });
        }
        let lines = joined(&pieces).into_iter().filter_map(|line| {
            let [from, to] = clipped([line.from, line.to], own, MARGIN * line.texel_m)?;
            Some(Crossing { from, to, ..line })
        });
        let mut found: Vec<Crossing> = lines.filter(|line| self.stops_looks(frame, side, line)).collect();
        let length = |line: &Crossing| line.from.distance_squared(line.to);
        found.sort_by(|a, b| length(b).total_cmp(&length(a)));
        found
    }

    /// Whether two faces are neighbors along an edge that nobody else shares: a surface goes on around a corner there. A third one
    /// stands on the other two.
    fn is_fold(&self, face: usize, other: usize) -> bool {
        let [own, other] = [self.corners[face], self.corners[other]];
        let shared: Vec<Vec3> = own.into_iter().filter(|corner| other.contains(corner)).collect();
        match shared[..] {
            [a, b] => self.sharing.get(&key([a, b])).is_none_or(|&count| count < 3),
            [_, _, _] => true,
            _ => false,
        }
    }

    /// Whether looks across the line above its middle are stopped.
    fn stops_looks(&self, frame: &Frame, side: f64, line: &Crossing) -> bool {
        let along = line.to - line.from;
        let across = along.perp().normalize_or_zero() * (LOOK * line.texel_m);
        let middle = 0.5 * (line.from + line.to);
        let at = |place: DVec2| (frame.place(place) + frame.normal * (side * HEIGHT * line.texel_m)).as_vec3();
        !self.caster.visible(at(middle - across), at(middle + across))
    }
}

fn bounds([a, b, c]: [Vec3; 3]) -> [Vec3; 2] {
    [a.min(b).min(c), a.max(b).max(c)]
}

fn longest([a, b, c]: [Vec3; 3]) -> f32 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// Whether a triangle lies wholly beyond an edge of another.
fn is_beside(corners: [DVec2; 3], of: [DVec2; 3]) -> bool {
    (0..3).any(|edge| {
        let (a, b) = (of[edge], of[(edge + 1) % 3]);
        let beyond = 1e-3 * (b - a).length_squared();
        corners.iter().all(|&corner| (b - a).perp_dot(corner - a) < -beyond)
    })
}

/// Where a triangle passes a height: between two of its edges.
fn at_height(corners: [Vec3; 3], heights: [f64; 3], height: f64) -> Option<([DVec3; 2], [EdgeKey; 2])> {
    let mut ends = (0..3).filter_map(|corner| {
        let (a, b) = (corner, (corner + 1) % 3);
        let is_passed = (heights[a] <= height) != (heights[b] <= height);
        let [from, to] = [a, b].map(|corner| corners[corner].as_dvec3());
        is_passed
            .then(|| (from.lerp(to, (height - heights[a]) / (heights[b] - heights[a])), key([corners[a], corners[b]])))
    });
    let (first, second) = (ends.next()?, ends.next()?);
    Some(([first.0, second.0], [first.1, second.1]))
}

/// Lines that follow each other, joined as far as they are straight.
fn joined(pieces: &[Piece]) -> Vec<Crossing> {
    let mut at: HashMap<EdgeKey, Vec<usize>> = HashMap::new();
    for (index, piece) in pieces.iter().enumerate() {
        piece.edges.iter().for_each(|&edge| at.entry(edge).or_default().push(index));
    }
    let mut is_used = vec![false; pieces.len()];
    let mut lines = Vec::new();
    for start in 0..pieces.len() {
        if std::mem::replace(&mut is_used[start], true) {
            continue;
        }
        let piece = &pieces[start];
        // Points of the line, first to last, and the edges that its two ends lie on.
        let mut points = VecDeque::from(piece.ends);
        let mut ends = piece.edges;
        let mut texel_m = piece.texel_m;
        for side in 0..2 {
            while let Some(&next) = at[&ends[side]].iter().find(|&&next| !is_used[next]) {
                let other = usize::from(pieces[next].edges[0] == ends[side]);
                let end = pieces[next].ends[other];
                let [first, last] = [points[0], points[points.len() - 1]];
                let (near, far) = if side == 0 { (first, last) } else { (last, first) };
                let way = (end - far).normalize_or_zero();
                let leaves = |point: &DVec2| (*point - far).perp_dot(way).abs() > STRAIGHT * texel_m;
                if end.distance(far) <= near.distance(far) || points.iter().any(leaves) {
                    break;
                }
                is_used[next] = true;
                if side == 0 {
                    points.push_front(end)
                } else {
                    points.push_back(end)
                }
                ends[side] = pieces[next].edges[other];
                texel_m = texel_m.min(pieces[next].texel_m);
            }
        }
        lines.push(Crossing { from: points[0], to: points[points.len() - 1], texel_m });
    }
    lines
}

/// The part of a line within a triangle, or beyond its edges by no more than `margin`.
fn clipped(line: [DVec2; 2], triangle: [DVec2; 3], margin: f64) -> Option<[DVec2; 2]> {
    let [from, to] = line;
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for corner in 0..3 {
        let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
        let inward = (b - a).perp().normalize_or_zero();
        let [at_from, at_to] = [from, to].map(|place| (place - a).dot(inward) + margin);
        if at_from < 0.0 && at_to < 0.0 {
            return None;
        }
        if (at_from < 0.0) != (at_to < 0.0) {
            let at = at_from / (at_from - at_to);
            if at_from < 0.0 { first = first.max(at) } else { last = last.min(at) }
        }
    }
    (last > first).then(|| [from.lerp(to, first), from.lerp(to, last)])
}
