//! The last leg, from the light of one gather to the receivers, by every method under comparison and step by step from
//! the truth to the compressed result.
//!
//! Per receiver, with L(Γ) the outgoing radiance of what a ray meets:
//!
//! ```text
//! all           E_1 + sum w albedo/pi I(Γ)   path traced first bounce, and the earlier bounces I that the file's light holds
//! seen          all - sum w L(Γ)             over the dense rays whose surface no supporting probe sees and no link reads
//! dense         the transport row of that dense set times the probe radiance (Eq. 7)
//! uncompressed  the transport row of the bake's own gather rays times the probe radiance, and its links times the light map
//! compressed    U S V^T times the probe radiance, from the file in f16
//!
//! compressed - reference = (all - reference)            input: earlier bounces; with one bounce there are none
//!                        + (seen - all)                 unseen light
//!                        + (dense - seen)               band limit: SH, relight rays, light map
//!                        + (uncompressed - dense)       gather rays: their number
//!                        + (compressed - uncompressed)  compression
//! ```
//!
//! The comparators of figure 8, on the same probes:
//!
//! ```text
//! spatial  E = ∫ L̄(ω) max(n·ω, 0) dω,   L̄ = sum_i w_i(x) L(p_i, ω) / sum_k w_k(x)            (Eq. 1)
//! arikan   E = sum w (L(Γ) where |Γ - x| < r, L̄(ω) elsewhere)
//! ```
//!
//! `arikan` is the irradiance decomposition of Arikan et al. (2005) at its best: distant light is interpolated between
//! probes and blocked by near surfaces, near surfaces contribute their own light; which surface is near is sampled by
//! exact rays, and its radiance is exact, where they estimate both. r is half of the radius of support.

use super::{lit::Lit, subject::Subject};
use crate::{
    progress::{Cancelled, Progress},
    rays::SurfaceHit,
    transport::{GatherRay, GatherSet, Sites, TransportLeaf, TransportScene},
};
use glam::{DVec3, Vec3};
use localprt_formats::{
    sh::{self, Basis, Directions, LANES},
    weight::weight_kernel,
};
use localprt_runtime::DEFAULT_FEEDBACK_ALBEDO_CAP;
use localprt_runtime::scene_light::direct_irradiance;
use localprt_scenes::{Lighting, SurfaceShading};
use rayon::prelude::*;
use std::{collections::HashSet, f32::consts::PI};

/// Surfaces nearer than this times the radius of support are near for the comparator `arikan`.
pub const NEAR: f32 = 0.5;

/// Rays of the dense set.
const DENSE_RAYS: u32 = 4096;
/// Rays of the comparators, at least.
const LEAST_RAYS: u32 = 1024;

/// Irradiance at one receiver, W m^-2, not negative, on the way from the truth to the transport row. See the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruthLeg {
    /// All light.
    pub all: Vec3,
    /// All but that from surfaces that no supporting probe sees and no link reads.
    pub seen: Vec3,
    /// Transport row of the dense rays times probe radiance.
    pub dense: Vec3,
}

/// Irradiance at one receiver, W m^-2, not negative, by every method. See the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastLeg {
    /// Transport row times probe radiance, and links times the light map.
    pub uncompressed: Vec3,
    /// The row as it would be without near light, times probe radiance: the same as `uncompressed` in a file without links.
    pub without_links: Vec3,
    /// The paper's row (Eqs. 4, 7) times probe radiance: the same as `uncompressed` in a file whose rows are not fitted.
    pub paper: Vec3,
    /// Eq. (1).
    pub spatial: Vec3,
    /// The idealized comparator.
    pub arikan: Vec3,
    /// Cosine-weighted share of directions in which a surface is nearer than a quarter of the radius of support: high in
    /// corners.
    pub near: f32,
}

/// Evaluates every method at some receivers, given in file order.
///
/// # Errors
/// [`Cancelled`].
pub fn last_leg(
    subject: &Subject<'_>,
    lit: &Lit,
    lighting: &Lighting,
    receivers: &[u32],
    progress: &Progress,
) -> Result<Vec<LastLeg>, Cancelled> {
    let leg = Leg::new(subject, lit, lighting);
    let rays = GatherSet::new(subject.settings.gather_rays.max(LEAST_RAYS), 0, subject.settings.seed);
    each("uncompressed and comparators", subject, receivers, progress, |index, leaf| {
        leg.methods(receivers[index], &rays, leaf)
    })
}

/// Walks from the truth to the transport row at some receivers, given in file order, with their path traced first bounce.
///
/// # Errors
/// [`Cancelled`].
pub fn truth_leg(
    subject: &Subject<'_>,
    lit: &Lit,
    lighting: &Lighting,
    receivers: &[u32],
    first_bounce: &[Vec3],
    progress: &Progress,
) -> Result<Vec<TruthLeg>, Cancelled> {
    let leg = Leg::new(subject, lit, lighting);
    let cosine = GatherSet::new(DENSE_RAYS, 0, subject.settings.seed);
    let of_bake = GatherSet::new(DENSE_RAYS, subject.settings.receiver_degree, subject.settings.seed);
    each("parts of the error", subject, receivers, progress, |index, leaf| {
        leg.truth(receivers[index], first_bounce[index], &cosine, &of_bake, leaf)
    })
}

/// Results by index into `receivers`, worked on leaf by leaf.
pub(super) fn each<T: Send + Clone + Default>(
    name: &str,
    subject: &Subject<'_>,
    receivers: &[u32],
    progress: &Progress,
    at: impl Fn(usize, &TransportLeaf) -> T + Sync,
) -> Result<Vec<T>, Cancelled> {
    let stage = progress.stage(name, receivers.len() as u64);
    let transport = subject.transport();
    let of_leaf = |(members, indices): &(&[u32], Vec<usize>)| {
        progress.check()?;
        let leaf = transport.leaf(members);
        let found = indices.par_iter().map(|&index| {
            progress.check()?;
            let found = at(index, &leaf);
            stage.inc(1);
            Ok((index, found))
        });
        found.collect::<Result<Vec<_>, Cancelled>>()
    };
    let by_leaf = subject.by_leaf(receivers).par_iter().map(of_leaf).collect::<Result<Vec<_>, Cancelled>>()?;
    let mut results = vec![T::default(); receivers.len()];
    for (index, found) in by_leaf.into_iter().flatten() {
        results[index] = found;
    }
    Ok(results)
}

struct Leg<'a> {
    subject: &'a Subject<'a>,
    lit: &'a Lit,
    lighting: &'a Lighting,
    shading: SurfaceShading<'a>,
    basis: Basis,
}

impl<'a> Leg<'a> {
    fn new(subject: &'a Subject<'a>, lit: &'a Lit, lighting: &'a Lighting) -> Self {
        Self {
            subject,
            lit,
            lighting,
            shading: SurfaceShading::new(subject.caster.scene(), lighting),
            basis: Basis::new(subject.view.metadata.probe_degree),
        }
    }

    fn methods(&self, receiver: u32, rays: &GatherSet, leaf: &TransportLeaf) -> LastLeg {
        let radius = self.subject.radius_m(receiver);
        let probes = self.probes(receiver);
        let mut near_light = DVec3::ZERO;
        let mut near = 0.0;
        let mut far = Lobe::new(&self.basis);
        self.for_each_ray(receiver, rays, |dir, weight, hit| {
            let distance = hit.map_or(f32::INFINITY, |hit| hit.t);
            match hit {
                Some(hit) if distance < NEAR * radius => near_light += (weight * self.outgoing(hit)).as_dvec3(),
                _ => far.push(dir, weight),
            }
            if distance < 0.25 * radius {
                near += weight / PI;
            }
        });
        let blended = self.blended(receiver, &probes);
        let spatial = dot(&cosine_lobe(&self.basis, self.subject.point(receiver).normal), &blended);
        let arikan = near_light + dot(&far.finish(), &blended);
        let transport = self.subject.transport();
        let uncompressed = self.transported(receiver, &transport, leaf);
        let otherwise = |differs: bool, transport: &TransportScene<'_>, same: Vec3| {
            if differs { self.transported(receiver, transport, leaf) } else { same }
        };
        let without = TransportScene { near: None, ..transport };
        let without_links = otherwise(transport.near.is_some(), &without, uncompressed);
        let paper = otherwise(transport.fit.is_some(), &TransportScene { fit: None, ..without }, without_links);
        LastLeg { uncompressed, without_links, paper, spatial: positive(spatial), arikan: positive(arikan), near }
    }

    fn truth(
        &self,
        receiver: u32,
        first_bounce: Vec3,
        rays: &GatherSet,
        of_bake: &GatherSet,
        leaf: &TransportLeaf,
    ) -> TruthLeg {
        let probes = self.probes(receiver);
        let (mut all, mut unseen) = (first_bounce.as_dvec3(), DVec3::ZERO);
        // Of the same directions as the rays below.
        let transport = TransportScene { gather: rays, ..self.subject.transport() };
        let bits = |dir: Vec3| dir.to_array().map(f32::to_bits);
        let linked: HashSet<[u32; 3]> =
            transport.linked(self.subject.place(receiver)).into_iter().map(|(dir, _)| bits(dir)).collect();
        self.for_each_ray(receiver, rays, |dir, weight, hit| {
            let Some(hit) = hit else { return };
            let earlier = self.reflected_earlier(hit);
            all += (weight * earlier).as_dvec3();
            if !self.is_seen(hit, &probes) && !linked.contains(&bits(dir)) {
                unseen += (weight * (self.sent_first(hit) + earlier)).as_dvec3();
            }
        });
        let transport = TransportScene { gather: of_bake, ..self.subject.transport() };
        TruthLeg {
            all: positive(all),
            seen: positive(all - unseen),
            dense: self.transported(receiver, &transport, leaf),
        }
    }

    /// Calls `visit(direction, weight of an irradiance sum, hit)` for the rays of a cosine-weighted set above the horizon.
    fn for_each_ray(&self, receiver: u32, rays: &GatherSet, mut visit: impl FnMut(Vec3, f32, Option<&SurfaceHit>)) {
        let caster = self.subject.caster;
        for GatherRay { origin, dir, cosine, .. } in
            rays.rays(Sites::Surface(self.subject.sites(receiver)), caster.offset_m())
        {
            visit(dir, irradiance_weight(rays, cosine), caster.closest_hit(origin, dir).as_ref());
        }
    }

    /// Positions of the supporting probes, metres, and their weights w_i.
    fn probes(&self, receiver: u32) -> Vec<(Vec3, f32)> {
        let position = self.subject.point(receiver).position;
        let radius = self.subject.radius_m(receiver);
        let weighted = |&id: &u32| {
            let probe = self.subject.probe_positions()[id as usize];
            (probe, weight_kernel(position.distance(probe) / radius))
        };
        self.subject.supporting(receiver).iter().map(weighted).collect()
    }

    /// Outgoing radiance of a surface point in the last gather: what the light map holds there, without its texels.
    fn outgoing(&self, hit: &SurfaceHit) -> Vec3 {
        self.sent_first(hit) + self.reflected_earlier(hit)
    }

    /// Emission and reflected direct light.
    fn sent_first(&self, hit: &SurfaceHit) -> Vec3 {
        let Some(face) = hit.point else { return Vec3::ZERO };
        let scene = self.subject.caster.scene();
        let normal = scene.shading_normal(face.mesh, face.triangle, face.barycentrics);
        let normal = if normal.dot(hit.normal) < 0.0 { -normal } else { normal };
        let lights = &self.lighting.lights;
        let direct = direct_irradiance(self.subject.caster, lights, hit.position, normal, hit.normal);
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        self.shading.emission(face.mesh, face.triangle, face.barycentrics) + albedo / PI * direct
    }

    /// Reflected light of the gather before, with the albedo as the feedback limits it.
    fn reflected_earlier(&self, hit: &SurfaceHit) -> Vec3 {
        let (Some(face), Some(_)) = (hit.point, &self.lit.previous) else { return Vec3::ZERO };
        let uv = self.subject.atlas.at(&face);
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        albedo.min(Vec3::splat(DEFAULT_FEEDBACK_ALBEDO_CAP)) / PI * self.lit.previous_irradiance(uv)
    }

    /// Whether any supporting probe sees that side of that point: V_i of Eq. (2).
    fn is_seen(&self, hit: &SurfaceHit, probes: &[(Vec3, f32)]) -> bool {
        let caster = self.subject.caster;
        let seen_point = hit.position + hit.normal * caster.offset_m();
        probes.iter().any(|&(probe, weight)| {
            weight > 0.0
                && (probe - hit.position).dot(hit.normal) > caster.offset_m()
                && caster.visible(seen_point, probe)
        })
    }

    /// Probe radiance blended by distance alone, Eq. (1): `[n_sh]`. Zero without a probe in reach.
    fn blended(&self, receiver: u32, probes: &[(Vec3, f32)]) -> Vec<Vec3> {
        let n_sh = self.basis.len();
        let mut blended = vec![Vec3::ZERO; n_sh];
        let sum: f32 = probes.iter().map(|probe| probe.1).sum();
        if sum > 0.0 {
            for (&id, &(_, weight)) in self.subject.supporting(receiver).iter().zip(probes) {
                let radiance = &self.lit.probe_radiance_with_sky[id as usize * n_sh..][..n_sh];
                for (blended, &radiance) in blended.iter_mut().zip(radiance) {
                    *blended += radiance * (weight / sum);
                }
            }
        }
        blended
    }

    /// The receiver's transport rows, uncompressed, times the probe radiance, as irradiance that is not negative.
    fn transported(&self, receiver: u32, transport: &TransportScene<'_>, leaf: &TransportLeaf) -> Vec3 {
        let rows = transport.rows(leaf, &[self.subject.place(receiver)]);
        let n_sh = self.basis.len();
        let mut outputs: Vec<DVec3> = rows
            .rows
            .chunks_exact(rows.n_columns)
            .map(|row| {
                let (of_probes, of_sky) = row.split_at(rows.probes.len() * n_sh);
                let mut sum = dot(of_sky, &self.lit.sky.sh);
                for (weights, &id) in of_probes.chunks_exact(n_sh).zip(&rows.probes) {
                    sum += dot(weights, &self.lit.probe_radiance[id as usize * n_sh..][..n_sh]);
                }
                sum
            })
            .collect();
        if let Some(links) = rows.links.first() {
            for (&node, weights) in links.nodes.iter().zip(links.weights.chunks_exact(outputs.len())) {
                let light = self.lit.node(node).as_dvec3();
                outputs.iter_mut().zip(weights).for_each(|(output, &weight)| *output += f64::from(weight) * light);
            }
        }
        irradiance(&outputs, self.subject.point(receiver).normal).max(Vec3::ZERO)
    }
}

fn positive(light: DVec3) -> Vec3 {
    light.as_vec3().max(Vec3::ZERO)
}

/// Irradiance from the outputs of a receiver: itself at degree 0, the convolution with the cosine at degree 1.
fn irradiance(outputs: &[DVec3], normal: Vec3) -> Vec3 {
    let sum: DVec3 = match outputs {
        [irradiance] => *irradiance,
        _ => {
            let weights = sh::irradiance_weights_degree_1(normal.to_array());
            outputs.iter().zip(weights).map(|(&output, weight)| output * f64::from(weight)).sum()
        }
    };
    sum.as_vec3()
}

/// Weight of a gather ray in a sum that is irradiance, given its cosine with the shading normal.
pub(super) fn irradiance_weight(gather: &GatherSet, cosine: f32) -> f32 {
    PI * gather.cosine_share(cosine.max(0.0))
}

/// Empty `values` (a black sky) count as zeros.
fn dot(weights: &[f32], values: &[Vec3]) -> DVec3 {
    weights.iter().zip(values).map(|(&weight, value)| f64::from(weight) * value.as_dvec3()).sum()
}

/// SH of the cosine lobe about a normal: `A_l Y_lm(n)`, A = pi, 2 pi/3, pi/4, 0, -pi/24, 0, ...
///
/// Source: Ramamoorthi and Hanrahan 2001, Eq. (8).
pub(super) fn cosine_lobe(basis: &Basis, normal: Vec3) -> Vec<f32> {
    let mut lobe = vec![0.0; basis.len()];
    basis.evaluate(normal.to_array(), &mut lobe);
    for l in 0..=basis.degree() {
        for value in &mut lobe[sh::index(l, -(l as i32))..=sh::index(l, l as i32)] {
            *value *= cosine_lobe_factor(l);
        }
    }
    lobe
}

fn cosine_lobe_factor(l: u32) -> f32 {
    match l {
        1 => 2.0 * PI / 3.0,
        _ if l % 2 == 1 => 0.0,
        _ => {
            // 2 pi (-1)^(l/2 - 1) / ((l + 2)(l - 1)) * l! / (2^l ((l/2)!)^2): the last factor is a product of (2i - 1) / 2i.
            let central: f64 = (1..=l / 2).map(|i| f64::from(2 * i - 1) / f64::from(2 * i)).product();
            let sign = if (l / 2) % 2 == 1 { 1.0 } else { -1.0 };
            (2.0 * std::f64::consts::PI * sign * central / (f64::from(l + 2) * (f64::from(l) - 1.0))) as f32
        }
    }
}

/// SH sums over weighted directions, a set of lanes at a time.
struct Lobe<'a> {
    basis: &'a Basis,
    directions: Directions,
    weights: [f32; LANES],
    filled: usize,
    sums: Vec<[f32; LANES]>,
}

impl<'a> Lobe<'a> {
    fn new(basis: &'a Basis) -> Self {
        let sums = vec![[0.0; LANES]; basis.len()];
        Self { basis, directions: Directions::default(), weights: [0.0; LANES], filled: 0, sums }
    }

    fn push(&mut self, dir: Vec3, weight: f32) {
        let lane = self.filled;
        (self.directions.x[lane], self.directions.y[lane], self.directions.z[lane]) = (dir.x, dir.y, dir.z);
        self.weights[lane] = weight;
        self.filled += 1;
        if self.filled == LANES {
            self.basis.accumulate(&self.directions, &self.weights, &mut self.sums);
            self.filled = 0;
        }
    }

    fn finish(mut self) -> Vec<f32> {
        self.weights[self.filled..].fill(0.0);
        self.basis.accumulate(&self.directions, &self.weights, &mut self.sums);
        self.sums.iter().map(|lanes| lanes.iter().map(|&lane| f64::from(lane)).sum::<f64>() as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_lobe_has_its_known_factors() {
        let known = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0, PI / 64.0];
        for (l, known) in known.into_iter().enumerate() {
            assert!((cosine_lobe_factor(l as u32) - known).abs() < 1e-6, "{l}: {}", cosine_lobe_factor(l as u32));
        }
        // Against the integral of the clamped cosine times the Legendre polynomial, 2 pi ∫ z P_l(z) dz over 0..1, for all.
        for l in 0..=sh::MAX_DEGREE {
            let n = 200_000;
            let mut integral = 0.0;
            for i in 0..n {
                let z = (f64::from(i) + 0.5) / f64::from(n);
                let (mut older, mut newer) = (0.0, 1.0);
                for k in 1..=l {
                    let k = f64::from(k);
                    (older, newer) = (newer, ((2.0 * k - 1.0) * z * newer - (k - 1.0) * older) / k);
                }
                integral += z * newer / f64::from(n);
            }
            let expected = 2.0 * std::f64::consts::PI * integral;
            // Midpoint rule: 1 / 24 n^2 of a second derivative of a few thousand.
            assert!((f64::from(cosine_lobe_factor(l)) - expected).abs() < 1e-6, "{l}: {expected}");
        }
    }

    #[test]
    fn lobes_add_up_over_any_number_of_directions() {
        let basis = Basis::new(3);
        for n in [1, 8, 19] {
            let mut lobe = Lobe::new(&basis);
            let mut expected = vec![0.0f32; basis.len()];
            for i in 0..n {
                let dir = localprt_formats::directions::spherical_fibonacci(i, n);
                lobe.push(Vec3::from(dir), 0.5 + i as f32);
                let mut values = vec![0.0; basis.len()];
                basis.evaluate(dir, &mut values);
                for (sum, value) in expected.iter_mut().zip(values) {
                    *sum += (0.5 + i as f32) * value;
                }
            }
            for (found, expected) in lobe.finish().iter().zip(expected) {
                // 19 terms below 20.
                assert!((found - expected).abs() < 1e-4, "{found} {expected}");
            }
        }
    }
}
