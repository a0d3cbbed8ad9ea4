//! Receivers that face each other across a chart border, so that their light can be made to agree.

use super::{Atlas, NO_RECEIVER, ReceiverSet};
use crate::rays::RayCaster;
use glam::{Vec2, Vec3};
use localprt_scenes::Scene;
use rayon::prelude::*;
use std::collections::HashMap;

/// Vertices nearer than this times the scene's extent are at the same place: exporters round.
const SAME_PLACE: f32 = 1e-6;
/// Normals closer than 30 degrees make a surface smooth: cos 30.
const SMOOTH: f32 = 0.866_025_4;
/// More faces than this at one edge are no surface.
const MOST_FACES: usize = 8;
/// Receivers look for each other this far above the surface, over their distance.
const LIFT: f32 = 0.3;
/// A receiver stands for a point of the seam up to this many texels away (a texel's diagonal, and some).
const REACH: f32 = 1.5;

/// Pairs of receivers on the two sides of an edge that faces share in space but not in the map, where nothing stands between
/// them; smaller index first, sorted, unique.
pub(super) fn pair(
    caster: &RayCaster<'_>,
    atlas: &Atlas,
    receivers: &ReceiverSet,
    receiver_at: &[u32],
) -> Vec<(u32, u32)> {
    let edges = edges(caster.scene(), atlas);
    let groups: Vec<&[Edge]> = edges.chunk_by(|a, b| a.ends == b.ends).filter(|group| group.len() > 1).collect();
    let finder = Finder { atlas, receivers, receiver_at };
    let mut pairs: Vec<(u32, u32)> = groups
        .par_iter()
        .filter(|group| group.len() <= MOST_FACES)
        .flat_map_iter(|group| {
            let mut found = Vec::new();
            for (place, first) in group.iter().enumerate() {
                for second in &group[place + 1..] {
                    if is_seam(first, second) {
                        finder.along(first, second, &mut found);
                    }
                }
            }
            found
        })
        .collect();
    pairs.par_sort_unstable();
    pairs.dedup();
    let sees = |&(a, b): &(u32, u32)| {
        let [a, b] = [a, b].map(|receiver| receiver as usize);
        let lift_m = LIFT * receivers.position[a].distance(receivers.position[b]) + caster.offset_m();
        let above = |receiver: usize| receivers.position[receiver] + receivers.geometric_normal[receiver] * lift_m;
        caster.visible(above(a), above(b))
    };
    pairs.into_par_iter().filter(sees).collect()
}

/// An edge of a face, from the lower vertex (after welding) to the higher one.
#[derive(Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    face: u32,
    chart: u32,
    positions: [Vec3; 2],
    normals: [Vec3; 2],
    uv: [Vec2; 2],
    /// Metres per unit of uv.
    scale_m: f32,
}

fn is_seam(a: &Edge, b: &Edge) -> bool {
    let smooth = (0..2).all(|end| a.normals[end].dot(b.normals[end]) > SMOOTH);
    smooth && (a.chart != b.chart || a.uv != b.uv)
}

/// All edges with length in the map, by their ends and then by face.
fn edges(scene: &Scene, atlas: &Atlas) -> Vec<Edge> {
    let mut welder = Welder::new(scene.extent() * SAME_PLACE);
    let mut edges = Vec::with_capacity(scene.face_count() * 3);
    let mut face = 0u32;
    for mesh in &scene.meshes {
        let welded: Vec<u32> = mesh.positions.iter().map(|&position| welder.place(position)).collect();
        for triangle in &mesh.triangles {
            let uv = atlas.corners[face as usize];
            let positions = triangle.map(|vertex| mesh.positions[vertex as usize]);
            let area = (positions[1] - positions[0]).cross(positions[2] - positions[0]).length();
            let on_map = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs();
            for corner in 0..3 {
                let next = (corner + 1) % 3;
                let ends = [welded[triangle[corner] as usize], welded[triangle[next] as usize]];
                if ends[0] == ends[1] || on_map <= 0.0 {
                    continue;
                }
                let order = if ends[0] < ends[1] { [corner, next] } else { [next, corner] };
                edges.push(Edge {
                    ends: [ends[0].min(ends[1]), ends[0].max(ends[1])],
                    face,
                    chart: atlas.chart[face as usize],
                    positions: order.map(|corner| positions[corner]),
                    normals: order.map(|corner| mesh.normals[triangle[corner] as usize]),
                    uv: order.map(|corner| uv[corner]),
                    scale_m: (area / on_map).sqrt(),
                });
            }
            face += 1;
        }
    }
    edges.par_sort_unstable_by_key(|edge| (edge.ends, edge.face));
    edges
}

struct Finder<'a> {
    atlas: &'a Atlas,
    receivers: &'a ReceiverSet,
    receiver_at: &'a [u32],
}

impl Finder<'_> {
    /// Pairs along a seam, at every texel of the finer side.
    fn along(&self, first: &Edge, second: &Edge, found: &mut Vec<(u32, u32)>) {
        let size = self.receivers.size as f32;
        let texels = |edge: &Edge| edge.uv[0].distance(edge.uv[1]) * size;
        let steps = (texels(first).max(texels(second)).ceil()).clamp(1.0, 4.0 * size) as u32;
        for step in 0..steps {
            let along = (step as f32 + 0.5) / steps as f32;
            let (Some(a), Some(b)) = (self.nearest(first, along), self.nearest(second, along)) else { continue };
            if a != b {
                found.push((a.min(b), a.max(b)));
            }
        }
    }

    /// The receiver of the edge's chart nearest to a point of the edge, among the texels around it.
    fn nearest(&self, edge: &Edge, along: f32) -> Option<u32> {
        let size = i64::from(self.receivers.size);
        let position = edge.positions[0].lerp(edge.positions[1], along);
        let at = (edge.uv[0].lerp(edge.uv[1], along) * size as f32).floor();
        let chart = self.atlas.chart[edge.face as usize];
        let reach_m = REACH * edge.scale_m / size as f32;
        (-1..=1i64)
            .flat_map(|dy| (-1..=1i64).map(move |dx| (at.x as i64 + dx, at.y as i64 + dy)))
            .filter(|&(x, y)| (0..size).contains(&x) && (0..size).contains(&y))
            .filter_map(|(x, y)| {
                let receiver = self.receiver_at[(y * size + x) as usize];
                if receiver == NO_RECEIVER || self.receivers.chart[receiver as usize] != chart {
                    return None;
                }
                let distance = self.receivers.position[receiver as usize].distance(position);
                (distance <= reach_m).then_some((distance, receiver))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, receiver)| receiver)
    }
}

/// Gives vertices at the same place the same number, in order of arrival.
struct Welder {
    reach: f32,
    cells: HashMap<[i64; 3], Vec<(Vec3, u32)>>,
    count: u32,
}

impl Welder {
    fn new(reach: f32) -> Self {
        Self { reach: reach.max(f32::MIN_POSITIVE), cells: HashMap::new(), count: 0 }
    }

    fn place(&mut self, position: Vec3) -> u32 {
        let cell_m = f64::from(self.reach) * 4.0;
        let cell = |position: glam::DVec3| (position / cell_m).floor().to_array().map(|value| value as i64);
        let reach = f64::from(self.reach);
        let (low, high) = (cell(position.as_dvec3() - reach), cell(position.as_dvec3() + reach));
        let mut nearest: Option<(f32, u32)> = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    for &(other, number) in self.cells.get(&[x, y, z]).into_iter().flatten() {
                        let distance = other.distance(position);
                        if distance <= self.reach && nearest.is_none_or(|held| (distance, number) < held) {
                            nearest = Some((distance, number));
                        }
                    }
                }
            }
        }
        if let Some((_, number)) = nearest {
            return number;
        }
        self.cells.entry(cell(position.as_dvec3())).or_default().push((position, self.count));
        self.count += 1;
        self.count - 1
    }
}
