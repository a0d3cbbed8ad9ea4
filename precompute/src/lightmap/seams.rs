//! Seams: where a smooth surface is cut in the map. Receivers that face each other there, and gutters that go on beyond them.

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
/// Texels this far beyond a seam show the other side: as far as bilinear taps at the seam reach, on a slanted one.
const CONTINUED: f32 = 1.5;

/// Edges that faces share in space but not in the map, over which the surface is smooth.
pub(super) struct Seams<'a> {
    caster: &'a RayCaster<'a>,
    atlas: &'a Atlas,
    /// The two sides of each.
    sides: Vec<[Edge; 2]>,
}

impl<'a> Seams<'a> {
    pub(super) fn of(caster: &'a RayCaster<'a>, atlas: &'a Atlas) -> Self {
        let edges = edges(caster.scene(), atlas);
        let groups = edges.chunk_by(|a, b| a.ends == b.ends).filter(|group| (2..=MOST_FACES).contains(&group.len()));
        let pairs = |group: &'_ [Edge]| -> Vec<[Edge; 2]> {
            let with_later = |(place, &first): (usize, &Edge)| {
                group[place + 1..]
                    .iter()
                    .filter(move |second| is_seam(&first, second))
                    .map(move |&second| [first, second])
            };
            group.iter().enumerate().flat_map(with_later).collect()
        };
        Self { caster, atlas, sides: groups.flat_map(pairs).collect() }
    }

    /// Pairs of receivers on the two sides of a seam, where nothing stands between them; smaller index first, sorted, unique.
    pub(super) fn pairs(&self, receivers: &ReceiverSet, receiver_at: &[u32]) -> Vec<(u32, u32)> {
        let finder = Finder { atlas: self.atlas, receivers, receiver_at };
        let along = |[first, second]: &[Edge; 2]| {
            let mut found = Vec::new();
            finder.along(first, second, &mut found);
            found
        };
        let mut pairs: Vec<(u32, u32)> = self.sides.par_iter().flat_map_iter(along).collect();
        pairs.par_sort_unstable();
        pairs.dedup();
        pairs.into_par_iter().filter(|&(a, b)| self.see_each_other(receivers, a, b)).collect()
    }

    /// Lets the surface go on beyond a seam: gutter texels within reach of a bilinear tap there get the receiver on the other side at
    /// the place that they would have on it, where nothing stands between the two. Light then changes over the
    /// seam as it does within a chart, to the nearest receiver where the texels of the two sides do not meet.
    ///
    /// `gutters` are `(texel, receiver)` by rising texel, the receivers of the same chart.
    pub(super) fn continue_over(&self, receivers: &ReceiverSet, receiver_at: &[u32], gutters: &mut [(u32, u32)]) {
        let size = receivers.size;
        let held = |texel: u32, gutters: &[(u32, u32)]| gutters.binary_search_by_key(&texel, |gutter| gutter.0).ok();
        // Gutter, distance to the seam, and the receiver beyond it.
        let beyond = |[from, to]: [&Edge; 2]| -> Vec<(usize, f32, u32)> {
            let reached = from.texels_beyond(size, CONTINUED).into_iter().filter_map(|(texel, along, texels)| {
                let gutter = held(texel, gutters)?;
                if receivers.chart[gutters[gutter].1 as usize] != from.chart {
                    return None;
                }
                let at = to.place(along, texels / size as f32 * from.scale_m) * size as f32;
                if at.min_element() < 0.0 || at.max_element() >= size as f32 {
                    return None;
                }
                let receiver = receiver_at[(at.y as u32 * size + at.x as u32) as usize];
                let is_there = receiver != NO_RECEIVER && receivers.chart[receiver as usize] == to.chart;
                is_there.then_some((gutter, texels, receiver))
            });
            reached.collect()
        };
        let mut found: Vec<(usize, f32, u32)> =
            self.sides.par_iter().flat_map_iter(|[a, b]| [beyond([a, b]), beyond([b, a])].concat()).collect();
        found.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        found.dedup_by_key(|of| of.0);
        let sees =
            |&(gutter, _, receiver): &(usize, f32, u32)| self.see_each_other(receivers, gutters[gutter].1, receiver);
        let open: Vec<_> = found.into_par_iter().filter(sees).collect();
        open.into_iter().for_each(|(gutter, _, receiver)| gutters[gutter].1 = receiver);
    }

    fn see_each_other(&self, receivers: &ReceiverSet, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|receiver| receiver as usize);
        let lift_m = LIFT * receivers.position[a].distance(receivers.position[b]) + self.caster.offset_m();
        let above = |receiver: usize| receivers.position[receiver] + receivers.geometric_normal[receiver] * lift_m;
        self.caster.visible(above(a), above(b))
    }
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
    /// Unit vector in the map, square to the edge, into the face.
    inward: Vec2,
    /// Metres per unit of uv.
    scale_m: f32,
}

impl Edge {
    /// Texels of a map whose centers lie beyond the edge, outside of the face, by at most so many texels: `(texel, share of the way
    /// along the edge, texels beyond it)`.
    fn texels_beyond(&self, size: u32, reach: f32) -> Vec<(u32, f32, f32)> {
        let [a, b] = self.uv.map(|uv| uv * size as f32);
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        let texels =
            |low: f32, high: f32| (low - 0.5).ceil().max(0.0) as u32..((high - 0.5).floor() + 1.0).max(0.0) as u32;
        let (columns, rows) =
            (texels(low.x, high.x.min(size as f32 - 1.0)), texels(low.y, high.y.min(size as f32 - 1.0)));
        let edge = b - a;
        rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
            .filter_map(|(x, y)| {
                let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - a;
                let (along, beyond) = (center.dot(edge) / edge.length_squared(), -center.dot(self.inward));
                let is_beyond = beyond > 0.0 && beyond <= reach && (0.0..=1.0).contains(&along);
                is_beyond.then_some((y * size + x, along, beyond))
            })
            .collect()
    }

    /// Place in the map at a share of the way along the edge, so many metres within the face.
    fn place(&self, along: f32, within_m: f32) -> Vec2 {
        self.uv[0].lerp(self.uv[1], along) + self.inward * (within_m / self.scale_m)
    }
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
                let third = uv[(corner + 2) % 3];
                let (from, to) = (uv[corner], uv[next]);
                let across = (to - from).perp();
                let inward = across.normalize_or_zero() * across.dot(third - from).signum();
                edges.push(Edge {
                    ends: [ends[0].min(ends[1]), ends[0].max(ends[1])],
                    face,
                    chart: atlas.chart[face as usize],
                    positions: order.map(|corner| positions[corner]),
                    normals: order.map(|corner| mesh.normals[triangle[corner] as usize]),
                    uv: order.map(|corner| uv[corner]),
                    inward,
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
