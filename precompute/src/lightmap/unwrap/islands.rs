//! Charts as they are flattened, before anybody has said how fine they are or where they go.

use super::{
    Piece, Unwrapped,
    joining::{across, apart, edges, groups, joined},
};
use crate::{
    lightmap::cut::Walls,
    scale::{LocalScale, Seen, weighted_quantile},
};
use glam::{DVec2, Vec2, Vec3};
use localprt_scenes::Scene;
use localprt_surfaces::subdivision;
use rayon::prelude::*;

/// A chart is cut by scale where that of its coarse tenth is more than this many times that of its fine tenth...
const MOST_UNEVEN: f32 = 16.0;
/// ...into faces whose scales are within this factor.
const STEP: f32 = 4.0;
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
    /// Middle of the face that stands for it, metres.
    pub middle: Vec3,
    /// Its unit normal.
    pub normal: Vec3,
    /// The face that is seen most, of those that are not seen the largest that is not hidden, by place in `faces`: where all share a texel,
    /// the one that it is a place of.
    pub shown: usize,
    /// Neither people nor light see any of it.
    pub is_hidden: bool,
}

/// How fine charts are wanted.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// R.
    pub scale: &'a LocalScale,
    /// How much of each face is seen; empty for a uniform scale.
    pub seen: &'a Seen,
    /// `[n_faces]` what neither people nor light see, by [`crate::lightmap::hidden::faces`]; empty for a uniform scale.
    pub hidden: &'a [bool],
    /// Edges at which charts end.
    pub walls: &'a Walls,
    /// About the edge of a texel at a place, metres.
    pub texel_m: &'a (dyn Fn(Vec3) -> f32 + Sync),
    /// What the edge of a texel is in proportion to where it is finest; absent: as the charts are.
    pub finest: Option<f32>,
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
        let is_shown = |face: u32| match self.wanted.hidden.get(self.first_face + self.triangle(face)) {
            Some(is_hidden) => !is_hidden,
            None => true,
        };
        let is_hidden = !faces.iter().any(|&face| is_shown(face));
        let hits = |face: u32| self.wanted.seen.hits.get(self.first_face + self.triangle(face)).copied().unwrap_or(0);
        let rank = |place: usize| (hits(faces[place]), is_shown(faces[place]));
        let shown = (0..areas.len())
            .rev()
            .max_by(|&a, &b| rank(a).cmp(&rank(b)).then(areas[a].total_cmp(&areas[b])))
            .unwrap_or_default();
        let triangle = self.triangle(faces[shown]);
        Island {
            mesh: self.mesh,
            corners,
            area_m2,
            texel,
            middle: self.scene.corners(self.mesh, triangle).iter().sum::<Vec3>() / 3.0,
            normal: self.scene.geometric_normal(self.mesh, triangle),
            shown,
            is_hidden,
            faces,
        }
    }
}
