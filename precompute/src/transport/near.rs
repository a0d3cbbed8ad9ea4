//! Near light: which nodes of the light map a receiver reads by itself.
//!
//! A receiver a hand's breadth from a lit patch sees it only through probes some metres away, which resolve 25 degrees. The
//! light map knows that light. So what a receiver's rays meet nearby is read from there, and the probes keep the rest:
//!
//! ```text
//! E = α·λ + sum_k β_k d_k                                                                        (N1)
//! β_k = sum over rays r that meet node k of φ(t_r / R) w_r                                       (N2)
//! φ(s) = 1 below FADE, falling smoothly to 0 at 1; and 1 for what no probe sees                  (N3)
//! ```
//!
//! d_k is a texel of a mip level, R the reach, w_r and t_r weight and length of a ray. The share φ of a ray is taken out of the
//! row's part α, the paper's and the fitted one alike, so that no light counts twice.
//!
//! Nodes are a cut through the quadtree of the light map: the coarsest that cover one piece of one chart, with no wall between
//! its parts, and are no larger than a share of their distance. A receiver reads nothing but pieces that its own rays meet:
//! sealed rooms stay sealed. Of its nodes those are read whose light counts most, as many as there are bytes for: by weight,
//! times how near they are, as the probes know near light least, and most of all what no probe sees. The rest stays with the
//! probes.

use super::{
    TransportScene,
    digests::texels_around,
    kernel::{self, Enough, LookUps, Sampling},
};
use crate::{
    digest::Digester,
    lightmap::{Atlas, ChartPyramid, NEAREST_TEXEL, Pieces, TexelMap},
    morton,
    probes::{ProbeSet, Support},
    rays::{RayCaster, SurfaceHit},
};
use glam::Vec3;
use localprt_formats::{NEAR_NODES, NEAR_TILE, NearTile, node_at};
use localprt_scenes::{FaceId, Scene};
use rayon::prelude::*;
use std::ops::Range;

/// Edge of a node over its distance, at most, but for texels of the map itself.
const ANGLE: f32 = 0.7;
/// R over the distance from the probes around to the nearest others.
const REACH: f32 = 0.5;
/// Share of the reach within which a ray's light is read from the map alone.
const FADE: f32 = 0.75;
/// How much more the light at no distance counts than that at the reach, which the nearest probes can tell best.
const NEAREST: f32 = 3.0;
/// The same of light beyond that no probe sees. Of nearer light no probe is asked.
const UNSEEN: f32 = 4.0;
/// Least gain for which a node is read, however many bytes there are.
const LEAST: f32 = 1e-3;
/// Most links of a receiver: a file counts them in a byte.
const MOST: usize = 255;
/// The least gain is found on one in so many receivers, but at least and at most on this number.
const SAMPLED_ONE_IN: usize = 50;
const LEAST_SAMPLE: usize = 64;
const SAMPLE: usize = 512;
/// Nodes of a tile over its links, as it is in furnished rooms and in level scenes.
const NODES_PER_LINK: f32 = 0.55;

/// What near light is read from; the same for all leaves of a bake.
pub struct NearField {
    /// Layout of the light map.
    atlas: Atlas,
    /// Its charts.
    charts: ChartPyramid,
    /// Which nodes have no wall between their parts.
    pieces: Pieces,
    /// `[n_receivers]` R, metres.
    reach_m: Vec<f32>,
    /// Nodes of less gain than this are left to the probes.
    least: f32,
}

/// Address of a texel of a mip level: [`node_at`].
pub type Node = u32;

/// A place that a ray meets and whose light may be read from the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearHit {
    chart: u32,
    /// Place on a Morton curve over the map.
    place: u32,
    /// Edge of a texel, metres.
    texel_m: f32,
    distance_m: f32,
    /// Share of all directions, times how badly the probes know its light.
    gain: f32,
    /// Which ray.
    pub ray: u32,
}

/// Some hits, by range, and the node that they are read from.
pub(super) struct NodeHits {
    pub node: Node,
    pub hits: Range<usize>,
    /// Of its hits.
    pub gain: f32,
}

impl NearHit {
    /// The hit, as `part` of its ray, counted `times` over.
    pub(super) fn weighted(self, part: f32, times: f32) -> Self {
        Self { gain: part * times * self.gain, ..self }
    }
}

impl NearField {
    /// Of the light map that `atlas` lays out and that covers `map`; every node that may be read is.
    pub fn new(caster: &RayCaster<'_>, atlas: Atlas, map: &TexelMap, probes: &ProbeSet, support: &Support) -> Self {
        let spacing = probes.nearest_m();
        let reach_m = (0..support.radius_m.len())
            .map(|receiver| {
                let of = support.of(receiver);
                let sum: f32 = of.iter().map(|&id| spacing[id as usize]).sum();
                REACH * if of.is_empty() { probes.radius_m } else { sum / of.len() as f32 }
            })
            .collect();
        let (charts, pieces) = (ChartPyramid::of(map), Pieces::of(caster, map));
        Self { atlas, charts, pieces, reach_m, least: LEAST }
    }

    /// The same with only as many nodes as fit `bytes` a receiver on average: those of most gain. The least gain is found
    /// on a sample of the receivers of `scene`.
    pub fn within(self, bytes: f32, scene: &TransportScene<'_>) -> Self {
        let n_receivers = scene.receivers.positions().len();
        let count = (n_receivers / SAMPLED_ONE_IN).clamp(LEAST_SAMPLE, SAMPLE).min(n_receivers);
        let of_link = 1.0 + scene.gather.n_outputs() as f32 + 4.0 * NODES_PER_LINK;
        let of_receiver = 1.0 + size_of::<NearTile>() as f32 / NEAR_TILE as f32;
        let links = ((bytes - of_receiver).max(0.0) / of_link * count as f32) as usize;
        if links == 0 {
            return Self { least: f32::MAX, ..self };
        }
        // A fitted row may do with the first rays, of which each is worth more: bytes have to be enough either way.
        let ways: &[Enough<'_>] = if scene.fit.is_some() { &[Enough::All, Enough::First] } else { &[Enough::All] };
        let scene = TransportScene { near: Some(&self), fit: None, ..*scene };
        let least = |&enough: &Enough<'_>| {
            let sampling = Sampling { enough, ..Sampling::default() };
            let of_receiver = |index: usize| {
                let mut workspace = kernel::Workspace::default();
                kernel::receiver_rows(&scene, index * n_receivers / count, LookUps::Few, sampling, &mut workspace);
                workspace.links.gains
            };
            let mut gains: Vec<f32> = (0..count).into_par_iter().flat_map_iter(of_receiver).collect();
            gains.sort_unstable_by(|a, b| b.total_cmp(a));
            gains.get(links).map_or(LEAST, |gain| gain.next_up().max(LEAST))
        };
        let least = ways.iter().map(least).fold(LEAST, f32::max);
        Self { least, ..self }
    }

    /// The same with the least gain of an earlier bake.
    pub fn with_least_gain(self, least: f32) -> Self {
        Self { least, ..self }
    }

    /// Texels per side of the light map.
    pub fn size(&self) -> u32 {
        self.charts.size()
    }

    /// Nodes of less gain than this are left to the probes.
    pub fn least_gain(&self) -> f32 {
        self.least
    }

    /// Takes in what all leaves read it with alike.
    pub(super) fn digest(&self, digester: &mut Digester) {
        digester.one(self.least).one(self.charts.size());
    }

    /// Takes in what a receiver reads it with.
    pub(super) fn digest_of_receiver(&self, receiver: u32, digester: &mut Digester) {
        digester.one(self.reach_m[receiver as usize]);
    }

    /// Takes in all that is read of a part of a face: a convex part, given by the barycentrics of its corners.
    pub(super) fn digest_of_face(&self, face: FaceId, part: &[Vec3], digester: &mut Digester) {
        let (corners, chart) = (self.atlas.corners[face.0 as usize], self.atlas.chart[face.0 as usize]);
        digester.all(&corners);
        let texels = texels_around(&corners, part, self.charts.size(), NEAREST_TEXEL as f32 + 2.0);
        for level in 0..self.charts.n_levels() {
            let size = self.charts.level_size(level);
            for row in texels.above(level).rows(size) {
                let state = |texel: usize| {
                    let is_own = self.charts.is_of(level, texel as u32 % size, texel as u32 / size, chart);
                    // Nobody asks for the pieces of other charts' texels.
                    u8::from(is_own) | u8::from(is_own && self.pieces.is_one(level, texel as u32)) << 1
                };
                digester.all(&row.map(state).collect::<Vec<_>>());
            }
        }
    }

    /// φ: which share of the light of a ray of length `t` is read from the map (N3).
    pub(super) fn share(&self, receiver: usize, t: f32) -> f32 {
        let s = ((1.0 - t / self.reach_m[receiver]) / (1.0 - FADE)).clamp(0.0, 1.0);
        s * s * (3.0 - 2.0 * s)
    }

    /// How often light counts that a ray of length `t` brings and that a probe sees, or that none does.
    pub(super) fn urgency(&self, receiver: usize, t: f32, is_seen: bool) -> f32 {
        let nearness = (1.0 - t / self.reach_m[receiver]).max(0.0);
        // The nearest first there too, so that gains differ: a limit on them is then met closely.
        let unseen = UNSEEN * (1.0 + 0.1 / (1.0 + t / self.reach_m[receiver]));
        if is_seen { 1.0 + (NEAREST - 1.0) * nearness } else { unseen }
    }

    /// The texel of the light map at a hit whose ray is a `share` of all directions; `None` where the hit's chart has none.
    pub(super) fn hit(&self, scene: &Scene, hit: &SurfaceHit, share: f32, ray: u32) -> Option<NearHit> {
        let point = hit.point?;
        let chart = self.atlas.chart[point.face.0 as usize];
        let texel = self.charts.texel_near(self.atlas.at(&point), chart)?;
        let texel_m = self.charts.texel_m2(scene, &self.atlas, &point).sqrt();
        Some(NearHit { chart, place: morton::of_plane(texel), texel_m, distance_m: hit.t, gain: share, ray })
    }

    /// The nodes that a receiver reads, and its hits that are left to the probes. Sorts the hits.
    pub(super) fn cut(&self, hits: &mut [NearHit]) -> (Vec<NodeHits>, Vec<Range<usize>>) {
        hits.sort_unstable_by_key(|hit| (hit.chart, hit.place, hit.ray));
        let mut nodes = Vec::new();
        let top = self.charts.n_levels() - 1;
        let mut first = 0;
        for of_chart in hits.chunk_by(|a, b| a.chart == b.chart) {
            self.cut_node(top, hits, first..first + of_chart.len(), &mut nodes);
            first += of_chart.len();
        }
        // Nodes are different, so the order is one.
        nodes.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
        let read = nodes.iter().take(MOST).take_while(|node| node.gain >= self.least).count();
        let left = nodes.split_off(read);
        (nodes, left.into_iter().map(|node| node.hits).collect())
    }

    fn cut_node(&self, level: u32, all: &[NearHit], range: Range<usize>, nodes: &mut Vec<NodeHits>) {
        let hits = &all[range.clone()];
        let [x, y] = morton::to_plane(hits[0].place >> (2 * level));
        let sum = |of: fn(&NearHit) -> f32| hits.iter().map(of).sum::<f32>();
        let edge_m = sum(|hit| hit.texel_m) * (1u32 << level) as f32;
        let is_small = edge_m <= ANGLE * sum(|hit| hit.distance_m);
        let texel = y * self.charts.level_size(level) + x;
        let is_whole = || self.charts.is_of(level, x, y, hits[0].chart) && self.pieces.is_one(level, texel);
        if level == 0 || is_small && is_whole() {
            let node = node_at(level, texel);
            nodes.push(NodeHits { node, gain: sum(|hit| hit.gain), hits: range });
            return;
        }
        let below = 2 * (level - 1);
        let mut first = range.start;
        for part in hits.chunk_by(|a, b| a.place >> below == b.place >> below) {
            self.cut_node(level - 1, all, first..first + part.len(), nodes);
            first += part.len();
        }
    }
}

/// Most nodes of a tile hold what one receiver reads.
const _: () = assert!(MOST < NEAR_NODES as usize);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::{Texel, TexelMap};
    use glam::Vec3;
    use localprt_formats::directions::{counter_hash, counter_uniform};
    use localprt_scenes::FaceId;

    const SIZE: u32 = 64;

    /// A map whose left part is chart 0 and whose right part, beside an empty column, is chart 1.
    fn field(least: f32) -> NearField {
        let texel = |index: u32| {
            let chart = match index % SIZE {
                0..40 => 0,
                40 => return None,
                _ => 1,
            };
            let barycentrics = Vec3::X;
            Some(Texel { index, face: FaceId(chart), mesh: 0, triangle: chart, barycentrics, chart })
        };
        let map = TexelMap { size: SIZE, texels: (0..SIZE * SIZE).filter_map(texel).collect() };
        let pieces = Pieces::whole(SIZE);
        NearField { atlas: Atlas::default(), charts: ChartPyramid::of(&map), pieces, reach_m: vec![2.0], least }
    }

    fn hits(count: u64, distance_m: impl Fn(u64) -> f32) -> Vec<NearHit> {
        let hit = |i: u64| {
            let x = counter_hash(5, 0, i) as u32 % 40;
            let chart = u32::from(counter_hash(5, 2, i).is_multiple_of(3));
            NearHit {
                chart,
                place: morton::of_plane([
                    if chart == 0 { x } else { 41 + x % 23 },
                    counter_hash(5, 1, i) as u32 % SIZE,
                ]),
                texel_m: 0.05,
                distance_m: distance_m(i),
                gain: 0.5 / count as f32,
                ray: i as u32,
            }
        };
        (0..count).map(hit).collect()
    }

    #[test]
    fn a_cut_has_every_hit_once_in_the_coarsest_node_that_is_small_and_of_one_chart() {
        let field = field(0.0);
        let mut hits = hits(200, |i| 0.05 + 6.0 * counter_uniform(6, 0, i) as f32);
        let (nodes, left) = field.cut(&mut hits);
        assert!(left.is_empty() && nodes.len() > 20 && nodes.len() < 200, "{} nodes", nodes.len());
        let mut found: Vec<u32> = Vec::new();
        for NodeHits { node, hits: range, gain } in &nodes {
            let (level, texel) = localprt_formats::node_level_and_texel(*node);
            let of_node = &hits[range.clone()];
            found.extend(of_node.iter().map(|hit| hit.ray));
            let size = SIZE >> level;
            for hit in of_node {
                let [x, y] = morton::to_plane(hit.place);
                assert_eq!((y >> level) * size + (x >> level), texel);
            }
            assert!((gain - of_node.len() as f32 * 0.5 / 200.0).abs() < 1e-6);
            let (x, y) = (texel % size, texel / size);
            assert!(field.charts.is_of(level, x, y, of_node[0].chart));
            let mean = |of: fn(&NearHit) -> f32| of_node.iter().map(of).sum::<f32>() / of_node.len() as f32;
            let fits = |level: u32, distance_m: f32| 0.05 * (1u32 << level) as f32 <= ANGLE * distance_m;
            assert!(level == 0 || fits(level, mean(|hit| hit.distance_m)));
        }
        found.sort_unstable();
        assert_eq!(found, (0..200).collect::<Vec<u32>>());
        // A tenth of the distance, more nodes.
        hits.iter_mut().for_each(|hit| hit.distance_m *= 0.1);
        assert!(field.cut(&mut hits).0.len() > nodes.len());
    }

    #[test]
    fn nodes_of_little_gain_and_those_beyond_a_byte_are_left_to_the_probes() {
        let mut few = hits(100, |_| 0.05);
        let (nodes, left) = field(0.0051).cut(&mut few);
        // Each texel of one hit has a gain of 0.005.
        assert!(nodes.iter().all(|node| node.hits.len() > 1));
        let counted = nodes.iter().map(|node| node.hits.len()).chain(left.iter().map(Range::len)).sum::<usize>();
        assert!(counted == 100 && !left.is_empty());
        let mut many = hits(4000, |_| 0.05);
        let (nodes, left) = field(0.0).cut(&mut many);
        assert!(nodes.len() <= MOST && !left.is_empty(), "{} nodes", nodes.len());
    }

    #[test]
    fn the_share_read_from_the_map_falls_smoothly_to_nothing_at_the_reach() {
        let field = field(0.0);
        assert_eq!((field.share(0, 0.0), field.share(0, 2.0 * FADE), field.share(0, 2.0)), (1.0, 1.0, 0.0));
        let shares: Vec<f32> = (0..=100).map(|i| field.share(0, 0.03 * i as f32)).collect();
        // The steepest of a smooth step is 1.5 over its width, 0.03 / (2 (1 - FADE)) at a time.
        assert!(shares.windows(2).all(|pair| pair[1] <= pair[0] && pair[0] - pair[1] < 0.1), "{shares:?}");
    }
}
