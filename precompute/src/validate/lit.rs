//! The relit file: what the methods under comparison read.
//!
//! Those of the file's own probes gather the same light: the probe radiance and the light map of the last gather of the
//! compressed relight. They differ by the last leg alone, from there to the receivers, for which [`Lit`] has the light of
//! surfaces and of transport rows.

use super::subject::Subject;
use crate::{
    error::BakeError,
    metrics::mean,
    progress::Progress,
    rays::SurfaceHit,
    transport::{GatherRay, GatherSet, Sites, TransportLeaf, TransportScene},
};
use glam::{DVec3, Vec3};
use localprt_formats::{
    node_level_and_texel,
    sh::{self, Basis},
    weight::weight_kernel,
};
use localprt_runtime::passes::probe_relight::probe_relight;
use localprt_runtime::{
    CoverageMap, CpuRelighter, DEFAULT_FEEDBACK_ALBEDO_CAP, RelightError, Relit, SceneLight,
    scene_light::{SkyInputs, direct_irradiance, scene_texels},
};
use localprt_scenes::{Lighting, SurfaceShading};
use std::f32::consts::PI;

/// A file under one lighting, after some gathers.
pub struct Lit<'a> {
    /// The file.
    pub subject: &'a Subject<'a>,
    /// What shines.
    pub lighting: &'a Lighting,
    /// Gathers so far; 1 is the first indirect bounce.
    pub bounces: u32,
    /// The compressed relight.
    pub relit: Relit,
    /// `[n_probes][n_sh]` probe radiance of the last gather, as the clusters read it.
    pub probe_radiance: Vec<Vec3>,
    /// The same with the sky that the probes see, for methods that take all light from the probes.
    pub probe_radiance_with_sky: Vec<Vec3>,
    /// Levels of the light map of the last gather.
    pub light_map: Vec<CoverageMap>,
    /// Mean irradiance after every gather.
    pub gather_means: Vec<f64>,
    /// Irradiance map of the gather before the last one, which that one reads; `None` before the first.
    pub previous: Option<CoverageMap>,
    /// Sky as the clusters read it.
    pub sky: SkyInputs,
    /// SH of the probes.
    pub basis: Basis,
    shading: SurfaceShading<'a>,
}

/// A ray of a receiver, and what it met.
#[derive(Clone, Copy, Debug)]
pub struct MetRay {
    /// Unit direction.
    pub dir: Vec3,
    /// Its weight in a sum that is irradiance.
    pub weight: f32,
    /// `None` for the sky.
    pub hit: Option<SurfaceHit>,
}

impl Lit<'_> {
    /// Mean radiance of the covered texels of a node of the light map.
    pub fn node(&self, node: u32) -> Vec3 {
        let (level, texel) = node_level_and_texel(node);
        self.light_map[level as usize].color(texel as usize)
    }

    /// A receiver's rays of a cosine-weighted set, above the horizon.
    pub fn rays(&self, receiver: u32, rays: &GatherSet) -> impl Iterator<Item = MetRay> {
        let caster = self.subject.caster;
        let met = move |GatherRay { origin, dir, cosine, .. }| MetRay {
            dir,
            weight: irradiance_weight(rays, cosine),
            hit: caster.closest_hit(origin, dir),
        };
        rays.rays(Sites::Surface(self.subject.sites(receiver)), caster.offset_m()).map(met)
    }

    /// Positions of the supporting probes, metres, and their weights w_i.
    pub fn probes(&self, receiver: u32) -> Vec<(Vec3, f32)> {
        let position = self.subject.point(receiver).position;
        let radius = self.subject.radius_m(receiver);
        let weighted = |&id: &u32| {
            let probe = self.subject.probe_positions()[id as usize];
            (probe, weight_kernel(position.distance(probe) / radius))
        };
        self.subject.supporting(receiver).iter().map(weighted).collect()
    }

    /// Outgoing radiance of a surface point in the last gather: what the light map holds there, without its texels.
    pub fn outgoing(&self, hit: &SurfaceHit) -> Vec3 {
        self.sent_first(hit) + self.reflected_earlier(hit)
    }

    /// Emission and reflected direct light.
    pub fn sent_first(&self, hit: &SurfaceHit) -> Vec3 {
        let Some(face) = hit.point else { return Vec3::ZERO };
        let normal = hit.surface_point(self.subject.caster.scene()).normal;
        let lights = &self.lighting.lights;
        let direct = direct_irradiance(self.subject.caster, lights, hit.position, normal, hit.normal);
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        self.shading.emission(face.mesh, face.triangle, face.barycentrics) + albedo / PI * direct
    }

    /// Reflected light of the gather before, with the albedo as the feedback limits it.
    pub fn reflected_earlier(&self, hit: &SurfaceHit) -> Vec3 {
        let (Some(face), Some(previous)) = (hit.point, &self.previous) else { return Vec3::ZERO };
        let irradiance = previous.sample(self.subject.atlas.at(&face)).unwrap_or(Vec3::ZERO);
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        albedo.min(Vec3::splat(DEFAULT_FEEDBACK_ALBEDO_CAP)) / PI * irradiance
    }

    /// The receiver's transport rows, uncompressed, times the probe radiance, as irradiance that is not negative.
    pub fn transported(&self, receiver: u32, transport: &TransportScene<'_>, leaf: &TransportLeaf) -> Vec3 {
        let rows = transport.rows_alone(leaf, &[self.subject.place(receiver)]);
        let n_sh = self.basis.len();
        let mut outputs: Vec<DVec3> = rows
            .rows
            .chunks_exact(rows.n_columns)
            .map(|row| {
                let (of_probes, of_sky) = row.split_at(rows.probes.len() * n_sh);
                let mut sum = dot(of_sky, &self.sky.sh);
                for (weights, &id) in of_probes.chunks_exact(n_sh).zip(&rows.probes) {
                    sum += dot(weights, &self.probe_radiance[id as usize * n_sh..][..n_sh]);
                }
                sum
            })
            .collect();
        if let Some(links) = rows.links.first() {
            for (&node, weights) in links.nodes.iter().zip(links.weights.chunks_exact(outputs.len())) {
                let light = self.node(node).as_dvec3();
                outputs.iter_mut().zip(weights).for_each(|(output, &weight)| *output += f64::from(weight) * light);
            }
        }
        irradiance(&outputs, self.subject.point(receiver).normal).max(Vec3::ZERO)
    }
}

/// Relights a file; `bounces` counts gathers and is at least 1.
///
/// # Errors
/// [`BakeError::Scene`] if the arrays contradict each other, [`BakeError::Cancelled`].
pub fn light<'a>(
    subject: &'a Subject<'a>,
    lighting: &'a Lighting,
    bounces: u32,
    progress: &Progress,
) -> Result<Lit<'a>, BakeError> {
    let view = subject.view;
    let stage = progress.stage("relight", bounces.into());
    let light = SceneLight::traced(subject.caster, &scene_texels(subject.caster, &view), lighting, &view);
    progress.check()?;
    let inputs = light.inputs(bounces);
    let mut relighter = CpuRelighter::new(subject.checked.clone());
    let (mut previous, mut gather_means) = (None, Vec::new());
    for gather in 0..bounces {
        progress.check()?;
        if gather > 0 {
            previous = Some(relighter.relit().maps.irradiance.clone());
        }
        gather_means.push(mean(&relighter.step(&inputs).map_err(refused)?.irradiance));
        stage.inc(1);
    }
    let mut probe_radiance_with_sky = vec![Vec3::ZERO; relighter.probe_radiance().len()];
    probe_relight(relighter.baked(), relighter.light_map(), &light.sky.rays, &[], &mut probe_radiance_with_sky);
    Ok(Lit {
        subject,
        lighting,
        bounces,
        relit: relighter.relit().clone(),
        probe_radiance: relighter.probe_radiance().to_vec(),
        probe_radiance_with_sky,
        light_map: relighter.light_map().to_vec(),
        gather_means,
        previous,
        sky: light.sky,
        basis: Basis::new(view.metadata.probe_degree),
        shading: SurfaceShading::new(subject.caster.scene(), lighting),
    })
}

fn refused(error: RelightError) -> BakeError {
    BakeError::Scene { what: error.to_string(), place: None, remedy: error.help().into() }
}

/// Light is not negative, whatever SH and weights make of it.
pub(super) fn positive(light: DVec3) -> Vec3 {
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
    PI * gather.all().cosine_share(cosine.max(0.0))
}

/// Empty `values` (a black sky) count as zeros.
pub(super) fn dot(weights: &[f32], values: &[Vec3]) -> DVec3 {
    weights.iter().zip(values).map(|(&weight, value)| f64::from(weight) * value.as_dvec3()).sum()
}
