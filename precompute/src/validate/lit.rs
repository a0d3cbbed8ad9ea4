//! The relit file: what all methods under comparison read.
//!
//! All of them gather the same light: the probe radiance and the light map of the last gather of the compressed relight.
//! They differ by the last leg alone, from there to the receivers.

use super::subject::Subject;
use crate::{error::BakeError, progress::Progress};
use glam::{Vec2, Vec3};
use localprt_formats::node_level_and_texel;
use localprt_runtime::passes::probe_relight::probe_relight;
use localprt_runtime::{
    CoverageMap, CpuRelighter, RelightError, Relit, SceneLight,
    scene_light::{SkyInputs, scene_texels},
};
use localprt_scenes::Lighting;

/// One lighting state after some gathers.
#[derive(Clone, Debug)]
pub struct Lit {
    /// The compressed relight.
    pub relit: Relit,
    /// `[n_probes][n_sh]` probe radiance of the last gather, as the clusters read it.
    pub probe_radiance: Vec<Vec3>,
    /// The same with the sky that the probes see, for methods that take all light from the probes.
    pub probe_radiance_with_sky: Vec<Vec3>,
    /// Levels of the light map of the last gather.
    pub light_map: Vec<CoverageMap>,
    /// Irradiance map of the gather before the last one; `None` before the first.
    pub previous: Option<CoverageMap>,
    /// Sky as the clusters read it.
    pub sky: SkyInputs,
}

impl Lit {
    /// Mean radiance of the covered texels of a node of the light map.
    pub fn node(&self, node: u32) -> Vec3 {
        let (level, texel) = node_level_and_texel(node);
        self.light_map[level as usize].color(texel as usize)
    }

    /// Indirect irradiance that the last gather reads at a lightmap coordinate.
    pub fn previous_irradiance(&self, uv: Vec2) -> Vec3 {
        self.previous.as_ref().and_then(|map| map.sample(uv)).unwrap_or(Vec3::ZERO)
    }
}

/// Relights a file; `bounces` counts gathers and is at least 1.
///
/// # Errors
/// [`BakeError::Scene`] if the arrays contradict each other, [`BakeError::Cancelled`].
pub fn light(subject: &Subject<'_>, lighting: &Lighting, bounces: u32, progress: &Progress) -> Result<Lit, BakeError> {
    let view = subject.view;
    let stage = progress.stage("relight", bounces.into());
    let light = SceneLight::traced(subject.caster, &scene_texels(subject.caster, &view), lighting, &view);
    progress.check()?;
    let inputs = light.inputs(bounces);
    let mut relighter = CpuRelighter::new(subject.checked.clone());
    let mut previous = None;
    for gather in 0..bounces {
        progress.check()?;
        if gather > 0 {
            previous = Some(relighter.relit().irradiance_map.clone());
        }
        relighter.step(&inputs).map_err(refused)?;
        stage.inc(1);
    }
    let mut probe_radiance_with_sky = vec![Vec3::ZERO; relighter.probe_radiance().len()];
    probe_relight(relighter.baked(), relighter.light_map(), &light.sky.rays, &[], &mut probe_radiance_with_sky);
    Ok(Lit {
        relit: relighter.relit().clone(),
        probe_radiance: relighter.probe_radiance().to_vec(),
        probe_radiance_with_sky,
        light_map: relighter.light_map().to_vec(),
        previous,
        sky: light.sky,
    })
}

fn refused(error: RelightError) -> BakeError {
    BakeError::Scene {
        what: error.to_string(),
        place: None,
        remedy: "check the lighting, and bake the scene again".into(),
    }
}
