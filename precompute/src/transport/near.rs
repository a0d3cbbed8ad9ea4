//! Near light: which nodes of the light map a receiver reads by itself.
//!
//! A receiver a hand's breadth from a lit patch sees it only through probes some metres away, which resolve 25 degrees. The
//! light map knows that light. So what a receiver's rays meet nearby is read from there, and the probes keep the rest:
//!
//! ```text
//! E = α·λ + sum_k β_k d_k                                                                        (N1)
//! β_k = sum over rays r that meet node k of φ(t_r / R) w_r                                       (N2)
//! φ(s) = 1 below FADE, falling smoothly to 0 at 1                                                (N3)
//! ```
//!
//! d_k is a texel of a mip level, R the reach, w_r and t_r weight and length of a ray. The share φ of a ray is taken out of the
//! row's part α, the paper's and the fitted one alike, so that no light counts twice.
//!
//! The nodes are a cut through the quadtree of the light map: the coarsest that hold texels of one chart alone and are no
//! larger than a share of their distance. A receiver reads nothing but what its own rays meet: sealed rooms stay sealed.

use crate::{
    lightmap::{Atlas, ChartPyramid},
    probes::{ProbeSet, Support, point_grid::PointGrid},
    rays::SurfaceHit,
};
use localprt_scenes::Scene;

/// Edge of a node over its distance, at most, but for texels of the map itself.
const ANGLE: f32 = 0.5;
/// Reach over the distance from the probes around to the nearest others.
const REACH: f32 = 0.33;
/// Least share of all directions for which a node is read.
const LEAST: f32 = 0.001;
/// Share of the reach within which a ray's light is read from the map alone.
const FADE: f32 = 0.75;

/// What near light is read from; the same for all leaves of a bake.
pub struct NearField {
    /// Layout of the light map.
    atlas: Atlas,
    /// Its charts.
    charts: ChartPyramid,
    /// `[n_receivers]` R, metres.
    reach_m: Vec<f32>,
    /// Nodes of less weight than this, as a share of all directions, are left to the probes.
    least: f32,
}

/// Address of a texel of a mip level: the level in the upper 4 bits, `y * size + x` below.
pub type Node = u32;

/// A place that a near ray meets.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearHit {
    chart: u32,
    /// Place on a Morton curve over the map.
    place: u32,
    /// Edge of a texel, metres.
    texel_m: f32,
    distance_m: f32,
    /// Share of the cosine-weighted hemisphere.
    share: f32,
    /// Which ray.
    pub ray: u32,
}

impl NearHit {
    /// The hit, as `part` of its ray.
    pub(super) fn times(self, part: f32) -> Self {
        Self { share: part * self.share, ..self }
    }
}

impl NearField {
    /// Of the light map that `atlas` lays out.
    pub fn new(atlas: Atlas, charts: ChartPyramid, probes: &ProbeSet, support: &Support) -> Self {
        let var = |name: &str, default: f32| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
        let spacing = nearest_m(probes);
        let reach = var("REACH", REACH);
        let reach_m = (0..support.radius_m.len())
            .map(|receiver| {
                let of = support.of(receiver);
                let sum: f32 = of.iter().map(|&id| spacing[id as usize]).sum();
                reach * if of.is_empty() { probes.radius_m } else { sum / of.len() as f32 }
            })
            .collect();
        Self { atlas, charts, reach_m, least: var("LEAST", LEAST) }
    }

    /// φ: which share of the light of a ray of length `t` is read from the map (N3).
    pub(super) fn share(&self, receiver: usize, t: f32) -> f32 {
        let s = ((1.0 - t / self.reach_m[receiver]) / (1.0 - FADE)).clamp(0.0, 1.0);
        s * s * (3.0 - 2.0 * s)
    }

    /// The texel of the light map at a hit; `None` where the hit's chart has none.
    pub(super) fn hit(&self, scene: &Scene, hit: &SurfaceHit, share: f32, ray: u32) -> Option<NearHit> {
        let point = hit.point?;
        let chart = self.atlas.chart[point.face.0 as usize];
        let (x, y) = self.charts.texel_near(self.atlas.at(&point), chart)?;
        let texel_m = self.charts.texel_m2(scene, &self.atlas, &point).sqrt();
        Some(NearHit { chart, place: morton(x, y), texel_m, distance_m: hit.t, share, ray })
    }

    /// Calls `visit(node, its hits)` for the nodes of a receiver, `None` for those of too little weight. Sorts the hits.
    pub(super) fn cut(&self, hits: &mut [NearHit], visit: &mut dyn FnMut(Option<Node>, &[NearHit])) {
        hits.sort_unstable_by_key(|hit| (hit.chart, hit.place, hit.ray));
        let top = self.charts.n_levels() - 1;
        for of_chart in hits.chunk_by(|a, b| a.chart == b.chart) {
            self.cut_node(top, of_chart, visit);
        }
    }

    fn cut_node(&self, level: u32, hits: &[NearHit], visit: &mut dyn FnMut(Option<Node>, &[NearHit])) {
        let (x, y) = unmorton(hits[0].place >> (2 * level));
        let is_leaf = level == 0 || {
            let sum = |of: fn(&NearHit) -> f32| hits.iter().map(of).sum::<f32>();
            let edge_m = sum(|hit| hit.texel_m) * (1u32 << level) as f32;
            edge_m <= angle() * sum(|hit| hit.distance_m) && self.charts.is_of(level, x, y, hits[0].chart)
        };
        if is_leaf {
            let counts = hits.iter().map(|hit| hit.share).sum::<f32>() >= self.least;
            visit(counts.then(|| level << 28 | (y * self.charts.level_size(level) + x)), hits);
            return;
        }
        let below = 2 * (level - 1);
        for part in hits.chunk_by(|a, b| a.place >> below == b.place >> below) {
            self.cut_node(level - 1, part, visit);
        }
    }
}

fn morton(x: u32, y: u32) -> u32 {
    (0..14).fold(0, |bits, bit| bits | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}

fn unmorton(place: u32) -> (u32, u32) {
    let gather = |shift: u32| (0..14).fold(0, |bits, bit| bits | (place >> (2 * bit + shift) & 1) << bit);
    (gather(0), gather(1))
}

fn angle() -> f32 {
    static A: std::sync::OnceLock<f32> = std::sync::OnceLock::new();
    *A.get_or_init(|| std::env::var("ANGLE").ok().and_then(|v| v.parse().ok()).unwrap_or(ANGLE))
}

/// Distance from each probe to the nearest other, metres; of a single probe half of its support radius.
fn nearest_m(probes: &ProbeSet) -> Vec<f32> {
    if probes.positions.len() < 2 {
        return vec![0.5 * probes.radius_m; probes.positions.len()];
    }
    let grid = PointGrid::new(&probes.positions, 0.5 * probes.radius_m);
    let mut distances = Vec::new();
    let nearest = |&place| {
        grid.nearest(place, 2, &mut distances);
        distances[1]
    };
    probes.positions.iter().map(nearest).collect()
}
