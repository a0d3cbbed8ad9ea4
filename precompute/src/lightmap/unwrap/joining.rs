//! Which flattened faces form a chart: those that share edges, but never both sides of a wall.

use super::Piece;
use glam::{IVec3, Vec2, Vec3};
use localprt_surfaces::Sets;
use std::collections::HashMap;

/// Bilinear taps of the two sides of a wall reach so many texels toward each other.
const TAPS: f32 = 2.0;
/// Cosine of the angle between walls that count as parallel.
const PARALLEL: f32 = 0.7;
/// Places along a wall that are looked at, at most.
const MOST_PLACES: u32 = 256;
/// Parts of fewer texels are not cut off at walls.
const LEAST_PART: f64 = 6.0;

/// An edge that two faces share, in space and in the plane.
pub(super) struct SharedEdge {
    faces: [u32; 2],
    /// Ends, metres.
    ends: [Vec3; 2],
    /// Squared length in the plane.
    length2: f32,
    /// Another surface stands on it.
    pub has_wall: bool,
}

/// Edges that faces share, in space and in the plane.
pub(super) fn edges(
    piece: &Piece,
    corners: &[Option<[Vec2; 3]>],
    has_wall: impl Fn([Vec3; 2]) -> bool,
) -> Vec<SharedEdge> {
    type Key = [u32; 5];
    let mut edges: Vec<([Key; 2], u32)> = Vec::with_capacity(3 * piece.triangles.len());
    for (face, (triangle, uv)) in piece.triangles.iter().zip(corners).enumerate() {
        let Some(uv) = uv else { continue };
        let keys: [Key; 3] = std::array::from_fn(|corner| {
            let [x, y, z] = piece.positions[triangle[corner] as usize];
            [x, y, z, uv[corner].x, uv[corner].y].map(|value| (value + 0.0).to_bits())
        });
        for corner in 0..3 {
            let (a, b) = (keys[corner], keys[(corner + 1) % 3]);
            edges.push((if a <= b { [a, b] } else { [b, a] }, face as u32));
        }
    }
    edges.sort_unstable();
    let shared = edges.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    shared
        .map(|pair| {
            let ends = pair[0].0.map(|end| end.map(f32::from_bits));
            let uv = ends.map(|[.., u, v]| Vec2::new(u, v));
            let ends = ends.map(|[x, y, z, ..]| Vec3::new(x, y, z));
            let length2 = uv[0].distance_squared(uv[1]);
            SharedEdge { faces: [pair[0].1, pair[1].1], ends, length2, has_wall: has_wall(ends) }
        })
        .collect()
}

/// Lowest face of each face's set.
pub(super) fn joined(n_faces: usize, edges: &[SharedEdge], together: impl Fn([u32; 2]) -> bool) -> Vec<u32> {
    let mut sets = Sets::new(n_faces);
    for edge in edges.iter().filter(|edge| together(edge.faces)) {
        sets.join(edge.faces[0], edge.faces[1]);
    }
    (0..n_faces as u32).map(|face| sets.lowest(face)).collect()
}

/// Pairs of faces that lie beyond two walls, one on each side, that stand less than two texels apart: bilinear taps reach across the
/// surface between them.
pub(super) fn across(piece: &Piece, edges: &[SharedEdge], texel_m: &dyn Fn(Vec3) -> f32) -> Vec<[u32; 2]> {
    let middle = |face: u32| {
        piece.triangles[face as usize].iter().map(|&corner| Vec3::from(piece.positions[corner as usize])).sum::<Vec3>()
            / 3.0
    };
    let walls: Vec<(&SharedEdge, f32)> = edges
        .iter()
        .filter(|edge| edge.has_wall)
        .map(|edge| (edge, TAPS * texel_m(0.5 * (edge.ends[0] + edge.ends[1]))))
        .collect();
    // Places along each wall, in cells as wide as taps reach there.
    let mut near: HashMap<(i32, [i32; 3]), Vec<u32>> = HashMap::new();
    let cell = |place: Vec3, octave: i32| (octave, (place / 2.0f32.powi(octave)).floor().as_ivec3());
    let places = |(edge, reach_m): &(&SharedEdge, f32)| {
        let [a, b] = edge.ends;
        let steps = ((2.0 * a.distance(b) / reach_m).ceil() as u32).clamp(1, MOST_PLACES);
        (0..steps).map(move |step| a.lerp(b, (step as f32 + 0.5) / steps as f32)).collect::<Vec<Vec3>>()
    };
    for (number, wall) in walls.iter().enumerate() {
        let octave = wall.1.log2().ceil() as i32;
        for place in places(wall) {
            let (octave, cell) = cell(place, octave);
            let list = near.entry((octave, cell.to_array())).or_default();
            if list.last() != Some(&(number as u32)) {
                list.push(number as u32);
            }
        }
    }
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for wall in &walls {
        let (edge, reach_m) = *wall;
        let octave = reach_m.log2().ceil() as i32;
        let way = (edge.ends[1] - edge.ends[0]).normalize_or_zero();
        for place in places(wall) {
            let (octave, at) = cell(place, octave);
            let around = (0..27).map(|i| at + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
            for other in around.filter_map(|cell| near.get(&(octave, cell.to_array()))).flatten() {
                let (other, _) = walls[*other as usize];
                let along = other.ends[1] - other.ends[0];
                let at = ((place - other.ends[0]).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                let between = other.ends[0] + along * at - place;
                let is_parallel = along.normalize_or_zero().dot(way).abs() > PARALLEL;
                if other.faces == edge.faces || !is_parallel || between.length() > reach_m || between == Vec3::ZERO {
                    continue;
                }
                // Of each wall the face on the side that is turned away from the other.
                let outer = |edge: &SharedEdge, inward: Vec3| {
                    let depth = |face: u32| (middle(face) - edge.ends[0]).dot(inward);
                    if depth(edge.faces[0]) < depth(edge.faces[1]) { edge.faces[0] } else { edge.faces[1] }
                };
                let [a, b] = [outer(edge, between), outer(other, -between)];
                if a != b {
                    pairs.push([a.min(b), a.max(b)]);
                }
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// The same, where faces with a wall between them never are in one set, though there may be a way around it: faces are joined
/// along the longest edges first.
pub(super) fn apart(
    n_faces: usize,
    mut edges: Vec<SharedEdge>,
    across: &[[u32; 2]],
    together: impl Fn([u32; 2]) -> bool,
    texels: impl Fn(u32) -> f64,
) -> Vec<u32> {
    let mut sets = Sets::new(n_faces);
    // Faces beyond the walls of each set, by its lowest face.
    let mut beyond: Vec<Vec<u32>> = vec![Vec::new(); n_faces];
    let walls = edges.iter().filter(|edge| edge.has_wall).map(|edge| &edge.faces);
    for &[a, b] in walls.chain(across) {
        beyond[a as usize].push(b);
        beyond[b as usize].push(a);
    }
    edges.retain(|edge| together(edge.faces));
    edges.sort_by(|a, b| b.length2.total_cmp(&a.length2).then(a.faces.cmp(&b.faces)));
    for edge in edges.iter().filter(|edge| !edge.has_wall) {
        let [a, b] = edge.faces.map(|face| sets.lowest(face));
        if a == b {
            continue;
        }
        let (fewer, other) = if beyond[a as usize].len() <= beyond[b as usize].len() { (a, b) } else { (b, a) };
        if beyond[fewer as usize].iter().any(|&face| sets.lowest(face) == other) {
            continue;
        }
        sets.join(a, b);
        let mut of_both = std::mem::take(&mut beyond[fewer as usize]);
        of_both.append(&mut beyond[other as usize]);
        beyond[a.min(b) as usize] = of_both;
    }
    // Parts too small for a chart stay with the neighbor that they share the longest edge with, if need be across a wall.
    let mut size = vec![0.0; n_faces];
    for face in 0..n_faces as u32 {
        size[sets.lowest(face) as usize] += texels(face);
    }
    let (across_walls, free): (Vec<_>, Vec<_>) = edges.iter().partition(|edge| edge.has_wall);
    for edge in free.into_iter().chain(across_walls) {
        let [a, b] = edge.faces.map(|face| sets.lowest(face));
        if a != b && size[a as usize].min(size[b as usize]) < LEAST_PART {
            sets.join(a, b);
            size[a.min(b) as usize] = size[a as usize] + size[b as usize];
        }
    }
    (0..n_faces as u32).map(|face| sets.lowest(face)).collect()
}

/// Faces by set, in the order of their lowest faces.
pub(super) fn groups(set: &[u32], held: impl Fn(usize) -> bool) -> Vec<Vec<u32>> {
    let mut place = vec![u32::MAX; set.len()];
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for (face, &lowest) in set.iter().enumerate().filter(|(face, _)| held(*face)) {
        let place = &mut place[lowest as usize];
        if *place == u32::MAX {
            *place = groups.len() as u32;
            groups.push(Vec::new());
        }
        groups[*place as usize].push(face as u32);
    }
    groups
}
