//! The transport kernel K_ij of Eq. (4), summed over the gather rays of one receiver.

use super::{
    GatherPart, GatherRay, LeafFit, TransportScene,
    found::{Found, OutputSums, Surface},
    gather::SKY_TIMES,
    near::{NearHit, Node},
    openings::Openings,
    outputs::OutputFunctions,
    traced::Traced,
};
use crate::{
    emitters::SAME_POINT,
    rays::{OccluderHint, SurfaceHit},
};
use glam::Vec3;
use localprt_formats::{
    sh::{self, Directions, LANES},
    weight::weight_kernel,
};

/// Below this sum of weights a point counts as seen by no probe: only a guard of the division in Eq. (4).
const LEAST_WEIGHT: f32 = 1e-6;

/// Scratch memory of one thread, and the rows of the receiver worked on last.
#[derive(Default)]
pub(super) struct Workspace {
    /// `[n_k]` rows.
    pub outputs: Vec<OutputSums>,
    /// What the fit needs, where rows are fitted.
    pub found: Found,
    /// What it reads from the light map.
    pub links: Links,
    /// All rays so far.
    pub traced: Traced,
    near: Vec<NearHit>,
    rays: Vec<Ray>,
    /// Directions of gather rays that meet nothing.
    escaped: Vec<Vec3>,
    weights: Vec<f32>,
    visible: Vec<(u32, Vec3)>,
    hints: Vec<OccluderHint>,
    batches: Vec<Batch>,
    sky: Batch,
}

/// Nodes of the light map that a receiver reads beside its probes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// Each once.
    pub nodes: Vec<Node>,
    /// `[n_links][n_k]`.
    pub weights: Vec<f32>,
    /// `[n_links]` how much each is worth.
    pub gains: Vec<f32>,
}

/// A ray that met a surface.
#[derive(Clone, Copy)]
struct Ray {
    dir: Vec3,
    /// With the shading normal.
    cosine: f32,
    hit: SurfaceHit,
    /// What a fit knows of it, if there is one.
    surface: Option<Surface>,
    /// Share of its light that it brings, where emitters are sampled too.
    brings: f32,
    /// Share of its light that is read from the light map.
    linked: f32,
    /// It was sent to a point of what emits.
    to_emitter: bool,
    /// It is of the first half of the first level.
    first_half: bool,
    /// It is looked up in all probes; of another one it is enough to know that one sees what it meets.
    looked_up: bool,
}

/// Rays that wait until a full set of lanes can be evaluated together, and their sums.
#[derive(Clone, Default)]
struct Batch {
    directions: Directions,
    /// `[n_k]` lanes.
    weights: Vec<[f32; LANES]>,
    filled: usize,
    /// `[n_k * n_functions]` lanes. A lane adds up at most an eighth of the rays in f32; lanes are joined in f64.
    sums: Vec<[f32; LANES]>,
}

/// Which rays are looked up in all probes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LookUps {
    /// Those that are [`looked_up`](super::GatherRay::looked_up), where a fit corrects what few get wrong; else all.
    Few,
    /// All.
    All,
}

/// How the rays of a receiver are chosen.
#[derive(Clone, Copy, Default)]
pub(super) struct Sampling<'a> {
    /// More rays look for the sky, where they may see it; absent: gather rays do.
    pub openings: Option<&'a Openings>,
    /// When there are enough gather rays.
    pub enough: Enough<'a>,
}

/// When there are enough gather rays.
#[derive(Clone, Copy, Default)]
pub(super) enum Enough<'a> {
    /// After the last level.
    #[default]
    All,
    /// After the first.
    First,
    /// Once their sums over the light that `fit` expects are off by less than `tolerance`, `[n_k]`, squared.
    Within { fit: &'a LeafFit, tolerance: &'a [f32] },
}

/// Fills `workspace.outputs` with the rows of one receiver. Returns the cosine-weighted share of directions whose surface neither
/// a supporting probe sees nor a link reads; in the open, the plain share.
pub(super) fn receiver_rows(
    scene: &TransportScene<'_>,
    receiver: usize,
    look_ups: LookUps,
    sampling: Sampling<'_>,
    workspace: &mut Workspace,
) -> f32 {
    let all_looked_up = look_ups == LookUps::All || scene.fit.is_none();
    let caster = scene.caster;
    let gather = scene.gather;
    let n_k = gather.n_outputs();
    let position = scene.receivers.positions()[receiver];
    let sites = scene.receivers.sites(receiver);
    let functions = gather.outputs(scene.receivers.normal(receiver));

    let support = scene.support.of(receiver);
    let radius = scene.support.radius_m[receiver];
    let probes: Vec<(Vec3, f32)> = support
        .iter()
        .map(|&id| {
            let probe = scene.probes.positions[id as usize];
            (probe, weight_kernel(position.distance(probe) / radius))
        })
        .collect();

    workspace.weights.resize(n_k, 0.0);
    workspace.batches.resize_with(support.len(), Batch::default);
    for batch in &mut workspace.batches {
        batch.reset(n_k, scene.probe_basis.len());
    }
    workspace.sky.reset(n_k, scene.sky_basis.len());

    workspace.hints.clear();
    workspace.hints.resize(support.len(), OccluderHint::default());
    workspace.found.clear(support.len(), n_k);
    let mut surfaces = 0.0;
    let openings = sampling.openings.map(|openings| openings.of_receiver(receiver as u32));
    // What the rays meet, level by level until they are enough.
    workspace.rays.clear();
    workspace.escaped.clear();
    let mut level = 0;
    let gathered = loop {
        let before = workspace.rays.len();
        for GatherRay { origin, dir, cosine, looked_up, first_half } in
            gather.rays_of_level(level, sites, caster.offset_m())
        {
            let Some(hit) = workspace.traced.closest_hit(caster, origin, dir) else {
                workspace.escaped.push(dir);
                continue;
            };
            // The back of a one-sided surface is black.
            let Some(point) = hit.point else { continue };
            let surface = scene.fit.map(|fit| fit.surface(caster, &point));
            let ray =
                Ray { dir, cosine, hit, surface, brings: 1.0, linked: 0.0, to_emitter: false, first_half, looked_up };
            workspace.rays.push(ray);
        }
        let part = gather.up_to(level);
        if let Some(fit) = scene.fit {
            for ray in &mut workspace.rays {
                ray.brings = fit.share_of_gather(&ray.hit, ray.dir, part.density(ray.cosine));
            }
        }
        level += 1;
        if level == gather.n_levels() || sampling.enough.is_reached(&workspace.rays, before, part, &functions) {
            break part;
        }
    };
    if all_looked_up {
        workspace.rays.iter_mut().for_each(|ray| ray.looked_up = true);
    }
    match openings {
        None => {
            for &dir in &workspace.escaped {
                gathered.weights(dir, &functions, &mut workspace.weights);
                workspace.sky.push(dir, 1.0, &workspace.weights, scene.sky_basis);
            }
        }
        Some(mut openings) => {
            workspace.escaped.iter().for_each(|&dir| openings.show(dir, true));
            workspace.rays.iter().for_each(|ray| openings.show(ray.dir, false));
            let mut hint = OccluderHint::default();
            for GatherRay { origin, dir, .. } in gather.rays_to_sky(sites, caster.offset_m(), [0, 1]) {
                let look = || workspace.traced.escapes(caster, origin, dir, &mut hint);
                if openings.is_sky(dir).unwrap_or_else(look) {
                    gather.all().weights(dir, &functions, &mut workspace.weights);
                    workspace.sky.push(dir, 1.0 / SKY_TIMES as f32, &workspace.weights, scene.sky_basis);
                }
            }
        }
    }
    if let Some(fit) = scene.fit {
        // What emits is sampled as well: gather rays meet a small lamp too seldom, and at much the same places for all.
        for (index, &sample) in fit.emitter_samples().iter().enumerate() {
            let start = sites.start(index, caster.offset_m());
            let way = sample.1 - start.origin;
            let dir = way.normalize_or_zero();
            let cosine = start.cosine(dir);
            let density = gathered.density(cosine);
            if density <= 0.0 || !start.is_above(dir) {
                continue;
            }
            // It may meet the triangle beside the sample, a little beyond.
            let beyond = SAME_POINT * caster.offset_m() / way.length().max(caster.offset_m());
            workspace.traced.gather(start.origin, way, 1.001 + beyond);
            let Some((hit, brings)) = fit.meet_emitter(caster, start.origin, dir, sample, density) else { continue };
            let Some(point) = hit.point else { continue };
            workspace.rays.push(Ray {
                dir,
                cosine,
                hit,
                surface: Some(fit.surface(caster, &point)),
                brings,
                linked: 0.0,
                to_emitter: true,
                first_half: false,
                looked_up: false,
            });
        }
    }
    let mut look = LookUp {
        scene,
        gathered,
        functions: &functions,
        probes: &probes,
        stands_for: if all_looked_up { 1.0 } else { gathered.rays_per_look_up() },
        saw_last: 0,
        unseen: 0.0,
    };

    // What is near is read from the light map, and so is what no probe sees; the probes have the rest.
    let mut all = std::mem::take(&mut workspace.rays);
    workspace.near.clear();
    for (index, ray) in all.iter_mut().enumerate() {
        surfaces += if ray.to_emitter { 0.0 } else { look.share(ray) };
        let Some(near) = scene.near else {
            look.up(ray, 1.0, workspace, true);
            continue;
        };
        ray.linked = near.share(receiver, ray.hit.t);
        let mut is_seen = true;
        if ray.linked < 1.0 && !look.up(ray, 1.0 - ray.linked, workspace, false) {
            ray.linked = 1.0;
            is_seen = false;
        }
        if ray.linked <= 0.0 {
            continue;
        }
        match near.hit(caster.scene(), &ray.hit, look.share(ray), index as u32) {
            Some(hit) => {
                let times = near.urgency(receiver, ray.hit.t, is_seen);
                workspace.near.push(hit.weighted(ray.linked * ray.brings, times));
            }
            None => {
                // The map has no texel there.
                let left = std::mem::take(&mut ray.linked);
                look.up(ray, left, workspace, true);
            }
        }
    }
    workspace.links.clear();
    if let Some(near) = scene.near {
        let mut hits = std::mem::take(&mut workspace.near);
        let (nodes, left) = near.cut(&mut hits);
        for of_node in nodes {
            let Workspace { links, weights, .. } = workspace;
            let sums = links.add(of_node.node, of_node.gain, n_k);
            for hit in &hits[of_node.hits] {
                let ray = &all[hit.ray as usize];
                gathered.weights(ray.dir, &functions, weights);
                sums.iter_mut().zip(&*weights).for_each(|(sum, weight)| *sum += ray.linked * ray.brings * weight);
            }
        }
        for hit in left.into_iter().flat_map(|range| &hits[range]) {
            let ray = &mut all[hit.ray as usize];
            let left = std::mem::take(&mut ray.linked);
            look.up(ray, left, workspace, true);
        }
        workspace.near = hits;
    }
    workspace.rays = all;
    let unseen = look.unseen;

    for (weight, &(_, kernel)) in workspace.found.seen_weights.iter_mut().zip(&probes) {
        *weight *= kernel / surfaces.max(f32::MIN_POSITIVE);
    }
    workspace.found.seen_share = 1.0 - (unseen as f32 / surfaces.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);

    workspace.outputs.resize_with(n_k, OutputSums::default);
    let n_sh = scene.probe_basis.len();
    for output in &mut workspace.outputs {
        output.probes.resize(support.len() * n_sh, 0.0);
        output.sky.resize(scene.sky_basis.len(), 0.0);
    }
    for (slot, batch) in workspace.batches.iter_mut().enumerate() {
        batch.finish(scene.probe_basis);
        for (k, output) in workspace.outputs.iter_mut().enumerate() {
            batch.read(k, &mut output.probes[slot * n_sh..(slot + 1) * n_sh]);
        }
    }
    workspace.sky.finish(scene.sky_basis);
    for (k, output) in workspace.outputs.iter_mut().enumerate() {
        workspace.sky.read(k, &mut output.sky);
    }
    unseen.clamp(0.0, 1.0) as f32
}

impl Enough<'_> {
    /// Whether the rays of some levels are enough: those up to `before` of the levels before the last, and the others of that. The
    /// halves of the first level are held against each other.
    fn is_reached(self, rays: &[Ray], before: usize, part: GatherPart<'_>, functions: &OutputFunctions) -> bool {
        let (fit, tolerance) = match self {
            Self::All => return false,
            Self::First => return true,
            Self::Within { fit, tolerance } => (fit, tolerance),
        };
        let mut weights = vec![0.0; tolerance.len()];
        let mut differences = fit.mode_sums(tolerance.len());
        for (index, ray) in rays.iter().enumerate() {
            let Some(surface) = ray.surface else { continue };
            part.weights(ray.dir, functions, &mut weights);
            let is_first = if before == 0 { ray.first_half } else { index < before };
            let side = if is_first { 1.0 } else { -1.0 };
            weights.iter_mut().for_each(|weight| *weight *= side * ray.brings);
            differences.add(ray.hit.position, ray.hit.normal, surface, &weights);
        }
        differences.variances().zip(tolerance).all(|(found, allowed)| found <= *allowed)
    }
}

/// How what a ray meets is looked up in the probes.
struct LookUp<'a> {
    scene: &'a TransportScene<'a>,
    gathered: GatherPart<'a>,
    functions: &'a OutputFunctions,
    /// Place and weight kernel of each supporting probe.
    probes: &'a [(Vec3, f32)],
    /// How many rays one that is looked up in all probes stands for.
    stands_for: f32,
    /// The probe that saw what a ray met last, which will see what the next one meets.
    saw_last: usize,
    /// Cosine-weighted share of directions whose light is lost.
    unseen: f64,
}

impl LookUp<'_> {
    /// Share of the cosine-weighted hemisphere that a ray stands for.
    fn share(&self, ray: &Ray) -> f32 {
        self.gathered.cosine_share(ray.cosine.max(0.0))
    }

    /// Adds `part` of a ray to the row by Eq. (4), and to what the fit needs. Returns whether a probe sees what it meets; what
    /// none sees is lost if `is_last`, and else nothing is done.
    fn up(&mut self, ray: &Ray, part: f32, workspace: &mut Workspace, is_last: bool) -> bool {
        let Self { scene, probes, .. } = *self;
        let caster = scene.caster;
        let share = part * self.share(ray);
        let Ray { dir, hit, surface, brings, to_emitter, looked_up, .. } = *ray;
        // V_i: the probe sees that side of that point.
        let seen_point = hit.position + hit.normal * caster.offset_m();
        workspace.visible.clear();
        let mut sum = 0.0;
        let first = if looked_up { 0 } else { self.saw_last };
        for slot in (first..probes.len()).chain(0..first) {
            let (probe, weight) = probes[slot];
            let way = probe - hit.position;
            if weight <= 0.0 || way.dot(hit.normal) <= caster.offset_m() {
                continue;
            }
            if workspace.traced.visible(caster, seen_point, probe, &mut workspace.hints[slot]) {
                sum += weight;
                self.saw_last = slot;
                if !looked_up {
                    break;
                }
                workspace.visible.push((slot as u32, -way.normalize()));
            }
        }
        let is_seen = sum > if looked_up { LEAST_WEIGHT } else { 0.0 };
        if !is_seen && !is_last {
            return false;
        }
        self.gathered.weights(dir, self.functions, &mut workspace.weights);
        workspace.weights.iter_mut().for_each(|weight| *weight *= part);
        if let (Some(fit), Some(surface)) = (scene.fit, surface) {
            if is_seen {
                workspace.found.add(&hit, surface, &workspace.weights, brings);
            } else if !surface.glows {
                // What lamps emit has nothing to do with the light around.
                workspace.found.add_unseen(fit.common_light(surface), &workspace.weights);
            }
        }
        if to_emitter {
            return is_seen;
        }
        if !is_seen {
            self.unseen += f64::from(share);
            return false;
        }
        if !looked_up {
            return true;
        }
        for &(slot, psi) in &workspace.visible {
            let slot = slot as usize;
            workspace.found.seen_weights[slot] += self.stands_for * share;
            // Eq. (4): w_i V_i / sum_k w_k V_k, times Y_j(psi_i) when the batch is evaluated.
            workspace.batches[slot].push(
                psi,
                self.stands_for * probes[slot].1 / sum,
                &workspace.weights,
                scene.probe_basis,
            );
        }
        true
    }
}

impl Links {
    fn clear(&mut self) {
        self.nodes.clear();
        self.weights.clear();
        self.gains.clear();
    }

    /// One more node; its weights `[n_k]`, zero.
    fn add(&mut self, node: Node, gain: f32, n_k: usize) -> &mut [f32] {
        self.nodes.push(node);
        self.gains.push(gain);
        let first = self.weights.len();
        self.weights.resize(first + n_k, 0.0);
        &mut self.weights[first..]
    }
}

impl Workspace {
    /// A new one that goes on counting rays.
    pub fn after(traced: Traced) -> Self {
        Self { traced, ..Self::default() }
    }

    /// Directions of the gather rays of the receiver worked on last whose light it reads from the light map, and the share of it.
    pub fn linked(&self) -> impl Iterator<Item = (Vec3, f32)> + '_ {
        self.rays.iter().filter(|ray| !ray.to_emitter && ray.linked > 0.0).map(|ray| (ray.dir, ray.linked))
    }
}

impl Batch {
    fn reset(&mut self, n_k: usize, n_functions: usize) {
        self.filled = 0;
        self.weights.clear();
        self.weights.resize(n_k, [0.0; LANES]);
        self.sums.clear();
        self.sums.resize(n_k * n_functions, [0.0; LANES]);
    }

    #[inline]
    fn push(&mut self, dir: Vec3, factor: f32, weights: &[f32], basis: &sh::Basis) {
        let lane = self.filled;
        self.directions.x[lane] = dir.x;
        self.directions.y[lane] = dir.y;
        self.directions.z[lane] = dir.z;
        for (lanes, weight) in self.weights.iter_mut().zip(weights) {
            lanes[lane] = weight * factor;
        }
        self.filled += 1;
        if self.filled == LANES {
            self.evaluate(basis);
        }
    }

    fn evaluate(&mut self, basis: &sh::Basis) {
        for (weights, sums) in self.weights.iter().zip(self.sums.chunks_exact_mut(basis.len())) {
            basis.accumulate(&self.directions, weights, sums);
        }
        self.filled = 0;
    }

    fn finish(&mut self, basis: &sh::Basis) {
        if self.filled > 0 {
            for lanes in &mut self.weights {
                lanes[self.filled..].fill(0.0);
            }
            self.evaluate(basis);
        }
    }

    fn read(&self, k: usize, values: &mut [f32]) {
        let sums = &self.sums[k * values.len()..(k + 1) * values.len()];
        for (value, lanes) in values.iter_mut().zip(sums) {
            *value = lanes.iter().map(|&lane| f64::from(lane)).sum::<f64>() as f32;
        }
    }
}
