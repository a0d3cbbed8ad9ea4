//! Where scale is measured: coarsely, and more densely where it is small.
//!
//! Surfaces are sorted into the cells of a grid, by the way they face; each cell is measured at the middle of a few of its pieces.
//! A cell wider than the least that it measured is halved, large triangles with it, until all fit or the samples are used up.

use super::{Sample, harmonic_mean, rays};
use crate::rays::{RayCaster, frame};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Cells along the longest side of the scene box to begin with, as a power of two.
const FIRST_LEVEL: i32 = 3;
/// Halvings of the scene box, at most.
const LAST_LEVEL: i32 = 17;
/// Pieces of a cell that are measured: a room's floor and the plain that it stands on may share a cell.
const PER_CELL: usize = 4;

/// A part of a triangle.
#[derive(Clone, Copy)]
struct Piece {
    corners: [Vec3; 3],
    normal: Vec3,
    face: u32,
}

impl Piece {
    fn middle(&self) -> Vec3 {
        self.corners.iter().sum::<Vec3>() / 3.0
    }

    fn area(&self) -> f32 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a).length()
    }

    /// Halves it along its longest edge until no edge is longer than that.
    fn cut(self, longest_m: f32, pieces: &mut Vec<Self>) {
        let [a, b, c] = self.corners;
        let edges = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
        let longest = (0..3).fold(0, |longest, edge| if edges[edge] > edges[longest] { edge } else { longest });
        if edges[longest] <= longest_m * longest_m {
            pieces.push(self);
            return;
        }
        let [from, to, opposite] = [0, 1, 2].map(|corner| self.corners[(corner + longest) % 3]);
        let middle = 0.5 * (from + to);
        Self { corners: [from, middle, opposite], ..self }.cut(longest_m, pieces);
        Self { corners: [middle, to, opposite], ..self }.cut(longest_m, pieces);
    }
}

/// Samples of the surfaces of a scene: about `most`, fewer where fewer tell all.
pub fn measure(caster: &RayCaster<'_>, most: usize) -> Vec<Sample> {
    let scene = caster.scene();
    let Some((low, high)) = scene.bounds() else { return Vec::new() };
    let longest_m = (high - low).max_element();
    let rays = rays();
    let mut pieces: Vec<Piece> = scene
        .faces()
        .zip(0..)
        .map(|((mesh, triangle), face)| Piece {
            corners: scene.corners(mesh, triangle),
            normal: scene.geometric_normal(mesh, triangle),
            face,
        })
        .filter(|piece| piece.normal != Vec3::ZERO)
        .collect();
    let mut samples = Vec::new();
    for level in FIRST_LEVEL..=LAST_LEVEL {
        let cell_m = longest_m / 2.0f32.powi(level);
        pieces = pieces
            .par_iter()
            .flat_map_iter(|piece| {
                let mut parts = Vec::new();
                piece.cut(cell_m, &mut parts);
                parts
            })
            .collect();
        let groups = by_cell(&pieces, low, cell_m);
        let found: Vec<Vec<Sample>> = groups
            .par_iter()
            .map(|group| {
                let count = group.len().min(PER_CELL);
                let chosen = (0..count).map(|rank| group[(2 * rank + 1) * group.len() / (2 * count)]);
                let area_m2: f32 = group.iter().map(|&piece| pieces[piece as usize].area()).sum();
                chosen.map(|piece| sample(caster, &rays, &pieces[piece as usize], area_m2 / count as f32)).collect()
            })
            .collect();
        let measured: usize = found.iter().map(Vec::len).sum();
        let is_last = level == LAST_LEVEL || samples.len() + 2 * measured > most;
        let mut left = Vec::new();
        for (group, found) in groups.iter().zip(found) {
            let least_m = found.iter().map(|sample| sample.scale_m).fold(f32::INFINITY, f32::min);
            let is_settled = is_last || cell_m <= least_m;
            if !is_settled {
                left.extend(group.iter().map(|&piece| pieces[piece as usize]));
            }
            // Area counts where it is settled.
            samples.extend(
                found
                    .into_iter()
                    .map(|found| Sample { area_m2: if is_settled { found.area_m2 } else { 0.0 }, ..found }),
            );
        }
        pieces = left;
        if pieces.is_empty() {
            break;
        }
    }
    samples
}

/// Pieces by cell and way of facing, in a fixed order.
fn by_cell(pieces: &[Piece], low: Vec3, cell_m: f32) -> Vec<Vec<u32>> {
    let mut keys: Vec<([i32; 3], u32, u32)> = pieces
        .par_iter()
        .zip(0u32..pieces.len() as u32)
        .map(|(piece, index)| {
            let cell: IVec3 = ((piece.middle() - low) / cell_m).floor().as_ivec3();
            let axis = piece.normal.abs().max_position();
            (cell.to_array(), 2 * axis as u32 + u32::from(piece.normal[axis] > 0.0), index)
        })
        .collect();
    keys.par_sort_unstable();
    keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(|run| run.iter().map(|key| key.2).collect()).collect()
}

fn sample(caster: &RayCaster<'_>, rays: &[Vec3], piece: &Piece, area_m2: f32) -> Sample {
    let (position, normal) = (piece.middle(), piece.normal);
    let (tangent, bitangent) = frame(normal);
    let origin = position + normal * caster.offset_m();
    let distances = rays.iter().map(|ray| {
        let dir = (tangent * ray.x + bitangent * ray.y + normal * ray.z).normalize();
        caster.closest_hit(origin, dir).map_or(f32::INFINITY, |hit| hit.t)
    });
    Sample { position, normal, scale_m: harmonic_mean(distances), area_m2, face: piece.face, seen: 1.0 }
}
