//! From covered texels to receivers: where each stands, and whether it stands in free space.
//!
//! A receiver leaves its texel's sample point for another covered point of the texel, or moves along the surface out of
//! near geometry, where the sample is inside of something; else the texel is invalid. What it gets is a mean over points of the texel
//! that stand in the open with it, its sites.

use super::{
    Atlas, Progress, ReceiverSet, Texel, TexelMap,
    gutters::{self, Filled},
    lent,
    samples::SampledMap,
    seams::Seams,
    texels,
};
use crate::rays::{RayCaster, frame};
use glam::{DVec2, Vec3};
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use localprt_scenes::{Scene, SurfacePoint};
use localprt_surfaces::atlas::raster::Footprint;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Cosine-weighted rays that ask whether a point is inside of geometry.
const RAYS: u32 = 16;
/// A point with no back face among its first rays is free, without asking the rest.
const FIRST_RAYS: u32 = 8;
/// A point is inside when more than this many of its rays, half of them, meet back faces. Fewer far ones are a view of
/// something one-sided from behind, which is black but does not make the point less real.
const MOST_BACK_FACES: u32 = 8;
/// A point is behind something when more than this many of its rays, a quarter, meet back faces nearby: its dark would
/// show in the bilinear taps of lit neighbors.
const MOST_NEAR_BACK_FACES: u32 = 4;
/// What is nearby, texels.
const NEAR_TEXELS: f32 = 3.0;
/// Tangent rays that look for a near way out.
const TANGENT_RAYS: u32 = 8;
/// Texels per task.
const TASK: usize = 4096;
/// Other points of a texel that are tried, texels from its corner, nearest to the center first.
const SUB_SAMPLES: [[f64; 2]; 8] = {
    const LOW: f64 = 1.0 / 6.0;
    const HIGH: f64 = 5.0 / 6.0;
    [[0.5, LOW], [LOW, 0.5], [HIGH, 0.5], [0.5, HIGH], [LOW, LOW], [HIGH, LOW], [LOW, HIGH], [HIGH, HIGH]]
};

/// Places one receiver in every texel of a `size` x `size` map that a face covers and that has a point in free space.
/// Texels in the holes of alpha masks get none. `None` if cancelled.
pub fn place(scene: &Scene, atlas: &Atlas, caster: &RayCaster, size: u32, progress: Progress) -> Option<ReceiverSet> {
    let map = texels::cover(scene, atlas, size);
    let placer = Placer { scene, atlas, caster, map: &map };
    let watch =
        Watch { progress, done: AtomicUsize::new(0), cancelled: AtomicBool::new(false), total: map.texels.len() };
    let first: Vec<Placed> =
        watch.run("placing receivers", map.texels.len(), |index| placer.at_sample(&map.texels[index]))?;
    let stuck: Vec<usize> = (0..first.len()).filter(|&index| !matches!(first[index], Placed::Free(_))).collect();
    let faces = placer.faces_of(&stuck);
    let watch = Watch { done: AtomicUsize::new(0), total: stuck.len(), ..watch };
    let second: Vec<Placed> = watch.run("freeing receivers", stuck.len(), |place| {
        placer.elsewhere(&map.texels[stuck[place]], &faces[place], first[stuck[place]])
    })?;
    let mut placed = first;
    for (&index, place) in stuck.iter().zip(second) {
        placed[index] = place;
    }
    let mut set = ReceiverSet { size, ..ReceiverSet::default() };
    let mut sites = placer.sites(&placed).into_iter();
    for (texel, placed) in map.texels.iter().zip(&placed) {
        match placed {
            Placed::Free(spot) => {
                set.push(texel.index, spot.point, &sites.next().expect("every free texel has a list of sites"));
                set.chart.push(texel.chart);
                set.pushed += usize::from(spot.pushed);
            }
            Placed::Inside => set.invalid.push(texel.index),
            Placed::Hole => {}
        }
    }
    let mut receiver_at = vec![super::NO_RECEIVER; size as usize * size as usize];
    for (receiver, &texel) in set.texel.iter().enumerate() {
        receiver_at[texel as usize] = receiver as u32;
    }
    let seams = Seams::of(caster, atlas);
    let Filled { mut gutters, lone } = gutters::fill(scene, atlas, &map, &set, &receiver_at);
    seams.continue_over(&set, &receiver_at, &mut gutters);
    gutters.extend(lent::lend(caster, atlas, &map, &set, &lone));
    gutters.sort_unstable();
    set.gutters = gutters;
    set.seams = seams.pairs(&set, &receiver_at);
    Some(set)
}

/// Where a receiver stands.
#[derive(Clone, Copy, Debug)]
struct Spot {
    point: SurfacePoint,
    pushed: bool,
}

#[derive(Clone, Copy, Debug)]
enum Placed {
    Free(Spot),
    /// Inside or behind geometry.
    Inside,
    /// In the hole of an alpha mask.
    Hole,
}

struct Placer<'a> {
    scene: &'a Scene,
    atlas: &'a Atlas,
    caster: &'a RayCaster<'a>,
    map: &'a TexelMap,
}

impl Placer<'_> {
    /// The texel's own sample point.
    fn at_sample(&self, texel: &Texel) -> Placed {
        self.try_point(texel.mesh as usize, texel.triangle as usize, texel.barycentrics, self.texel_m(texel))
    }

    fn try_point(&self, mesh: usize, triangle: usize, weights: Vec3, texel_m: f32) -> Placed {
        if !self.scene.is_present(mesh, triangle, weights) {
            return Placed::Hole;
        }
        let point = self.scene.surface_point(mesh, triangle, weights);
        if self.is_free(&point, texel_m) { Placed::Free(Spot { point, pushed: false }) } else { Placed::Inside }
    }

    /// Sites of each receiver that stands in free space.
    fn sites(&self, placed: &[Placed]) -> Vec<Vec<SurfacePoint>> {
        let sampled = SampledMap {
            caster: self.caster,
            atlas: self.atlas,
            map: self.map,
            is_wanted: &|point| self.scene.is_present(point.mesh, point.triangle, point.barycentrics),
        };
        let own = |texel: &Texel| {
            let number = self.map.texels.partition_point(|other| other.index < texel.index);
            if let Placed::Free(spot) = &placed[number] { Some(spot.point) } else { None }
        };
        let bands = sampled.visit(Vec::with_capacity, own, |band, texel, samples| {
            if own(texel).is_some() {
                // All of a whole texel varies slowly: its center does, with less noise.
                let points = if samples.is_whole { &[] } else { samples.points.as_slice() };
                band.push(points.iter().map(|point| point.surface_point(self.scene)).collect());
            }
        });
        bands.into_iter().flatten().collect()
    }

    /// Whether few rays from the point meet back faces.
    fn is_free(&self, point: &SurfacePoint, texel_m: f32) -> bool {
        let normal = point.geometric_normal;
        if normal == Vec3::ZERO {
            return false;
        }
        let (tangent, bitangent) = frame(normal);
        let origin = point.position + normal * self.caster.offset_m();
        let (mut back_faces, mut near) = (0, 0);
        for ray in 0..RAYS {
            if ray == FIRST_RAYS && back_faces == 0 {
                return true;
            }
            // Each half of the rays is spread over the whole hemisphere. All points use the same ones: what is free then
            // ends in a clean line.
            let spread = (ray % FIRST_RAYS) * 2 + ray / FIRST_RAYS;
            let [x, y, z] = cosine_hemisphere(fibonacci_square(spread, RAYS, [0.0; 2]));
            let dir = tangent * x + bitangent * y + normal * z;
            if let Some(hit) = self.caster.closest_hit(origin, dir).filter(|hit| hit.point.is_none()) {
                back_faces += 1;
                near += u32::from(hit.t < NEAR_TEXELS * texel_m);
            }
            if back_faces > MOST_BACK_FACES || near > MOST_NEAR_BACK_FACES {
                return false;
            }
        }
        true
    }

    /// Faces of the texel's own chart that touch each of these texels, by rising number.
    fn faces_of(&self, stuck: &[usize]) -> Vec<Vec<u32>> {
        const OTHER: u32 = u32::MAX;
        let size = self.map.size;
        let mut faces = vec![Vec::new(); stuck.len()];
        if stuck.is_empty() {
            return faces;
        }
        let mut place_of = vec![OTHER; size as usize * size as usize];
        for (place, &index) in stuck.iter().enumerate() {
            place_of[self.map.texels[index].index as usize] = place as u32;
        }
        for (face, &uv) in self.atlas.corners.iter().enumerate() {
            let Some(footprint) = Footprint::new(uv, size) else { continue };
            for y in footprint.rows(size) {
                for x in footprint.columns(y, size) {
                    let place = place_of[(y * size + x) as usize];
                    if place != OTHER && self.map.texels[stuck[place as usize]].chart == self.atlas.chart[face] {
                        faces[place as usize].push(face as u32);
                    }
                }
            }
        }
        faces
    }

    /// Another covered point of the texel, or a point beyond near geometry.
    fn elsewhere(&self, texel: &Texel, faces: &[u32], first: Placed) -> Placed {
        let size = self.map.size;
        let corner = DVec2::new(f64::from(texel.index % size), f64::from(texel.index / size));
        let footprints: Vec<(u32, Footprint)> = faces
            .iter()
            .filter_map(|&face| Some((face, Footprint::new(self.atlas.corners[face as usize], size)?)))
            .collect();
        let mut worst = first;
        for offset in SUB_SAMPLES {
            let point = corner + DVec2::from(offset);
            let Some((face, footprint)) = footprints.iter().find(|(_, footprint)| footprint.contains(point)) else {
                continue;
            };
            let (mesh, triangle) = self.place_of_face(*face, texel);
            match self.try_point(mesh, triangle, texels::weights(footprint, point), self.texel_m(texel)) {
                Placed::Free(spot) => return Placed::Free(spot),
                Placed::Inside => worst = Placed::Inside,
                Placed::Hole => {}
            }
        }
        match (worst, first) {
            (Placed::Inside, Placed::Inside) => self.pushed(texel).map_or(Placed::Inside, Placed::Free),
            (worst, _) => worst,
        }
    }

    /// Mesh and triangle of a face of the texel's chart; charts lie within one mesh.
    fn place_of_face(&self, face: u32, texel: &Texel) -> (usize, usize) {
        (texel.mesh as usize, (texel.triangle + face - texel.face.0) as usize)
    }

    /// Moves the sample along the surface past the nearest back face within a texel.
    fn pushed(&self, texel: &Texel) -> Option<Spot> {
        let (mesh, triangle) = (texel.mesh as usize, texel.triangle as usize);
        let start = self.scene.surface_point(mesh, triangle, texel.barycentrics);
        let normal = start.geometric_normal;
        let offset_m = self.caster.offset_m();
        let texel_m = self.texel_m(texel);
        let (tangent, bitangent) = frame(normal);
        let origin = start.position + normal * offset_m;
        let mut ways: Vec<(f32, Vec3)> = (0..TANGENT_RAYS)
            .filter_map(|ray| {
                let (sin, cos) = (std::f32::consts::TAU * ray as f32 / TANGENT_RAYS as f32).sin_cos();
                let dir = tangent * cos + bitangent * sin;
                let hit = self.caster.closest_hit(origin, dir)?;
                (hit.point.is_none() && hit.t < texel_m).then_some((hit.t, dir))
            })
            .collect();
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        ways.into_iter().find_map(|(t, dir)| {
            // Beyond the back face, and down to the surface again, which must go on there.
            let beyond = origin + dir * (t + (4.0 * offset_m).max(0.02 * texel_m));
            let below = self.caster.closest_hit(beyond + normal * offset_m, -normal)?;
            let point = below.point?;
            let same_surface = below.t < 8.0 * offset_m && self.atlas.chart[point.face.0 as usize] == texel.chart;
            if !same_surface || !self.scene.is_present(point.mesh, point.triangle, point.barycentrics) {
                return None;
            }
            let spot = Spot { point: point.surface_point(self.scene), pushed: true };
            self.is_free(&spot.point, texel_m).then_some(spot)
        })
    }

    /// Edge of a texel on the texel's face, metres.
    fn texel_m(&self, texel: &Texel) -> f32 {
        let [a, b, c] = self.scene.corners(texel.mesh as usize, texel.triangle as usize);
        let area = 0.5 * (b - a).cross(c - a).length();
        Footprint::new(self.atlas.corners[texel.face.0 as usize], self.map.size)
            .map_or(0.0, |footprint| (f64::from(area) / footprint.area()).sqrt() as f32)
    }
}

/// Tells of progress and hears of cancellation between tasks.
struct Watch<'a> {
    progress: Progress<'a>,
    done: AtomicUsize,
    cancelled: AtomicBool,
    total: usize,
}

impl Watch<'_> {
    /// Results of `work` in index order, or `None` if cancelled.
    fn run<T: Send>(&self, doing: &str, count: usize, work: impl Fn(usize) -> T + Sync) -> Option<Vec<T>> {
        let tasks: Vec<Vec<T>> = (0..count.div_ceil(TASK))
            .into_par_iter()
            .map(|task| {
                if self.cancelled.load(Ordering::Relaxed) {
                    return Vec::new();
                }
                let range = task * TASK..count.min((task + 1) * TASK);
                let done = self.done.fetch_add(range.len(), Ordering::Relaxed) + range.len();
                let results = range.map(&work).collect();
                if !(self.progress)(doing, done, self.total) {
                    self.cancelled.store(true, Ordering::Relaxed);
                }
                results
            })
            .collect();
        (!self.cancelled.load(Ordering::Relaxed)).then(|| tasks.into_iter().flatten().collect())
    }
}
