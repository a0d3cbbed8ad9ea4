//! Charts as they are flattened, before anybody has said how fine they are or where they go.

use super::{Piece, Unwrapped};
use crate::{
    lightmap::{charts::Sets, cut::Walls},
    scale::{LocalScale, Seen, weighted_quantile},
};
use glam::{DVec2, IVec3, Vec2, Vec3};
use localprt_scenes::Scene;
use rayon::prelude::*;
use std::collections::HashMap;

/// A chart is cut by scale where that of its coarse tenth is more than this many times that of its fine tenth...
const MOST_UNEVEN: f32 = 16.0;
/// ...into faces whose scales are within this factor.
const STEP: f32 = 4.0;
/// Bilinear taps of the two sides of a wall reach so many texels towards each other.
const TAPS: f32 = 2.0;
/// Cosine of the angle between walls that count as parallel.
const PARALLEL: f32 = 0.7;
/// Places along a wall that are looked at, at most.
const MOST_PLACES: u32 = 256;
/// Parts of fewer texels are not cut off at walls.
const LEAST_PART: f64 = 6.0;
/// Steps across a face at which the scale is read, at most.
const MOST_STEPS: u32 = 8;

/// Faces that are flattened together.
#[derive(Clone, Debug, Default)]
pub(super) struct Island {
    /// Mesh, and so piece.
    pub mesh: usize,
    /// Triangles of the piece, rising.
    pub faces: Vec<u32>,
    /// `[faces]` corners in the plane, metres: as large there as on the surface.
    pub corners: Vec<[Vec2; 3]>,
    /// Area, square metres.
    pub area_m2: f64,
    /// What a texel's edge is in proportion to (S1).
    pub texel: f32,
    /// Middle of the largest face, metres.
    pub middle: Vec3,
    /// Its unit normal.
    pub normal: Vec3,
    /// The largest face, by place in `faces`.
    pub largest: usize,
}

/// How fine charts are wanted.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// R.
    pub scale: &'a LocalScale,
    /// How much of each face is seen; empty for a uniform scale.
    pub seen: &'a Seen,
    /// Edges at which charts end.
    pub walls: &'a Walls,
    /// About the edge of a texel at a place, metres.
    pub texel_m: &'a (dyn Fn(Vec3) -> f32 + Sync),
}

/// Charts of all pieces; `kept` gives the triangle of its mesh of each triangle of a piece.
pub(super) fn islands(
    scene: &Scene,
    pieces: &[Piece],
    kept: &[Vec<u32>],
    unwrapped: &Unwrapped,
    wanted: Wanted<'_>,
) -> Vec<Island> {
    let mut first = vec![0; pieces.len()];
    for mesh in 1..pieces.len() {
        first[mesh] = first[mesh - 1] + scene.meshes[mesh - 1].triangles.len();
    }
    (0..pieces.len())
        .into_par_iter()
        .flat_map_iter(|mesh| {
            let facts = Facts {
                scene,
                mesh,
                first_face: first[mesh],
                kept: &kept[mesh],
                corners: &unwrapped.corners[mesh],
                wanted,
            };
            of_piece(&pieces[mesh], &facts)
        })
        .collect()
}

fn of_piece(piece: &Piece, facts: &Facts<'_>) -> Vec<Island> {
    let Facts { scene, mesh, kept, corners, wanted, .. } = *facts;
    let edges = edges(piece, corners, |ends| wanted.walls.stand_on(mesh, ends));
    let held = |face: usize| corners[face].is_some();
    let charts = joined(piece.triangles.len(), &edges, |_| true);
    let whole = groups(&charts, held);
    // Class of each face; 0 for charts that stay whole.
    let mut class = vec![0i32; piece.triangles.len()];
    let mut scales = Vec::new();
    if !wanted.scale.is_uniform() {
        let scale = |&triangle: &u32| face_scale(scene, mesh, triangle as usize, wanted.scale);
        scales = kept.iter().map(scale).collect();
        for faces in &whole {
            if facts.is_uneven(&scales, faces) {
                for &face in faces {
                    class[face as usize] = (scales[face as usize].ln() / STEP.ln()).round() as i32;
                }
            }
        }
    }
    let is_even = |[a, b]: [u32; 2]| class[a as usize] == class[b as usize];
    let cut = if edges.iter().any(|edge| edge.has_wall) {
        let texels = |face: u32| {
            let [a, b, c] = scene.corners(mesh, kept[face as usize] as usize);
            facts.area(face) / f64::from((wanted.texel_m)((a + b + c) / 3.0)).powi(2)
        };
        let across = across(piece, &edges, wanted.texel_m);
        apart(piece.triangles.len(), edges, &across, is_even, texels)
    } else {
        joined(piece.triangles.len(), &edges, is_even)
    };
    groups(&cut, held).into_iter().map(|faces| facts.island(&scales, faces)).collect()
}

/// An edge that two faces share, in space and in the plane.
struct SharedEdge {
    faces: [u32; 2],
    /// Ends, metres.
    ends: [Vec3; 2],
    /// Squared length in the plane.
    length2: f32,
    /// Another surface stands on it.
    has_wall: bool,
}

/// Edges that faces share, in space and in the plane.
fn edges(piece: &Piece, corners: &[Option<[Vec2; 3]>], has_wall: impl Fn([Vec3; 2]) -> bool) -> Vec<SharedEdge> {
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
fn joined(n_faces: usize, edges: &[SharedEdge], together: impl Fn([u32; 2]) -> bool) -> Vec<u32> {
    let mut sets = Sets::new(n_faces);
    for edge in edges.iter().filter(|edge| together(edge.faces)) {
        sets.join(edge.faces[0], edge.faces[1]);
    }
    (0..n_faces as u32).map(|face| sets.lowest(face)).collect()
}

/// Pairs of faces that lie beyond two walls, one on each side, that stand less than two texels apart: bilinear taps reach across the
/// surface between them.
fn across(piece: &Piece, edges: &[SharedEdge], texel_m: &dyn Fn(Vec3) -> f32) -> Vec<[u32; 2]> {
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
    for (number, wall) in walls.iter().enumerate() {
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
        if number % 64 == 63 {
            pairs.sort_unstable();
            pairs.dedup();
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// The same, where faces with a wall between them never are in one set, though there may be a way around it: faces are joined
/// along the longest edges first.
fn apart(
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
fn groups(set: &[u32], held: impl Fn(usize) -> bool) -> Vec<Vec<u32>> {
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

/// Harmonic mean of the scale over a face, metres.
fn face_scale(scene: &Scene, mesh: usize, triangle: usize, scale: &LocalScale) -> f32 {
    let corners = scene.corners(mesh, triangle);
    let [a, b, c] = corners;
    let longest_m = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let middle = scale.of_texels((a + b + c) / 3.0);
    // The scale grows no faster than distance: a small face has one.
    let steps = (2.0 * longest_m / middle).ceil().clamp(1.0, MOST_STEPS as f32) as u32;
    if steps == 1 {
        return middle;
    }
    let inverse: Vec<f32> = subdivision(steps).map(|[u, v, w]| 1.0 / scale.of_texels(a * u + b * v + c * w)).collect();
    inverse.len() as f32 / inverse.iter().sum::<f32>()
}

/// Middles of the `steps²` equal triangles that a triangle falls into, as corner weights.
pub(in crate::lightmap) fn subdivision(steps: u32) -> impl Iterator<Item = [f32; 3]> {
    let at = move |u: f32, v: f32| [u / steps as f32, v / steps as f32, 1.0 - (u + v) / steps as f32];
    (0..steps).flat_map(move |row| {
        (0..steps - row).flat_map(move |column| {
            let (u, v) = (row as f32, column as f32);
            let upright = at(u + 1.0 / 3.0, v + 1.0 / 3.0);
            let turned = (column + row + 1 < steps).then(|| at(u + 2.0 / 3.0, v + 2.0 / 3.0));
            [Some(upright), turned].into_iter().flatten()
        })
    })
}

/// What charts of a piece are made from.
struct Facts<'a> {
    scene: &'a Scene,
    mesh: usize,
    /// First face of the mesh, of all of the scene.
    first_face: usize,
    kept: &'a [u32],
    corners: &'a [Option<[Vec2; 3]>],
    wanted: Wanted<'a>,
}

impl Facts<'_> {
    fn triangle(&self, face: u32) -> usize {
        self.kept[face as usize] as usize
    }

    fn area(&self, face: u32) -> f64 {
        self.scene.area_m2(self.mesh, self.triangle(face))
    }

    /// Whether a chart needs very different densities.
    fn is_uneven(&self, scales: &[f32], faces: &[u32]) -> bool {
        // Area counts in texels, or a far plain would always outweigh what stands on it.
        let texels = faces.iter().map(|&face| {
            let scale_m = scales[face as usize].max(self.wanted.scale.finest_of_charts_m());
            (scale_m, self.area(face) / f64::from(scale_m).powi(2))
        });
        let [fine, coarse] = [0.1, 0.9].map(|share| weighted_quantile(texels.clone(), share).unwrap_or(1.0));
        coarse > MOST_UNEVEN * fine
    }

    /// The chart of some faces; `scales` are those of all faces of the piece, empty where they are even.
    fn island(&self, scales: &[f32], faces: Vec<u32>) -> Island {
        let areas: Vec<f64> = faces.iter().map(|&face| self.area(face)).collect();
        let area_m2: f64 = areas.iter().sum();
        let flat: Vec<[Vec2; 3]> = faces.iter().map(|&face| self.corners[face as usize].unwrap_or_default()).collect();
        let on_plane: f64 = flat
            .iter()
            .map(|uv| {
                let [a, b, c] = uv.map(Vec2::as_dvec2);
                (b - a).perp_dot(c - a).abs() * 0.5
            })
            .sum();
        let zoom = if on_plane > 0.0 { (area_m2 / on_plane).sqrt() } else { 1.0 };
        // From its own corner, so that coordinates are small.
        let low = flat.iter().flatten().fold(Vec2::INFINITY, |low, &uv| low.min(uv)).as_dvec2();
        let corners =
            flat.iter().map(|uv| uv.map(|uv| ((uv.as_dvec2() - low) * DVec2::splat(zoom)).as_vec2())).collect();
        let texel = if scales.is_empty() {
            1.0
        } else {
            let inverse = |(&face, area): (&u32, &f64)| area / f64::from(scales[face as usize]);
            let scale_m = area_m2 / faces.iter().zip(&areas).map(inverse).sum::<f64>().max(f64::MIN_POSITIVE);
            let own = faces.iter().zip(&areas).map(|(&face, &area)| (self.first_face + self.triangle(face), area));
            self.wanted.scale.texel(scale_m as f32, self.wanted.seen.density(own))
        };
        let largest = (0..areas.len()).rev().max_by(|&a, &b| areas[a].total_cmp(&areas[b])).unwrap_or_default();
        let triangle = self.triangle(faces[largest]);
        Island {
            mesh: self.mesh,
            corners,
            area_m2,
            texel,
            middle: self.scene.corners(self.mesh, triangle).iter().sum::<Vec3>() / 3.0,
            normal: self.scene.geometric_normal(self.mesh, triangle),
            largest,
            faces,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_falls_into_equal_triangles_that_cover_it() {
        for steps in 1..6 {
            let middles: Vec<[f32; 3]> = subdivision(steps).collect();
            assert_eq!(middles.len() as u32, steps * steps);
            for corner in 0..3 {
                let mean = middles.iter().map(|weights| weights[corner]).sum::<f32>() / middles.len() as f32;
                assert!((mean - 1.0 / 3.0).abs() < 1e-6);
            }
            assert!(middles.iter().flatten().all(|&weight| weight > 0.0));
        }
    }
}
