//! `precompute relight`: a baked file and a lighting state in; maps, points, pictures and figures out.

use super::lit_scene::lit_scene;
use super::{check_output, to_json, write_text};
use crate::cli::{Backend, Direct, Relight, View};
use glam::{Vec3, Vec4};
use localprt_formats::Checked;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::output::{self, ExrPrecision, ReceiverVertex};
use localprt_precompute::picture::{self, Exposure, Picture, PictureSize, Surfaces};
use localprt_precompute::progress::Progress;
use localprt_precompute::rays::{RayCaster, SurfaceHit};
use localprt_precompute::report::StageTime;
use localprt_runtime::passes::direct_irradiance::direct_irradiance as shadow_mapped_irradiance;
use localprt_runtime::scene_light::{direct_irradiance, scene_texels, traced_irradiance};
use localprt_runtime::{CpuRelighter, RelightError, Relit, SceneLight, ShadowCasters};
use localprt_scenes::{Lighting, export_glb};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

#[cfg(feature = "gpu")]
#[path = "relight_gpu.rs"]
mod relight_gpu;
#[cfg(feature = "gpu")]
use relight_gpu::Source;

/// Texels per side of shadow maps: as many as the direct light map has by default.
const SHADOW_MAP_SIZE: u32 = 2048;

/// Runs the subcommand.
pub fn run(command: &Relight, progress: &Progress) -> Result<(), CommandError> {
    for path in [&command.output, &command.ktx2, &command.glb, &command.receivers, &command.json, &command.picture] {
        check_output(path.as_deref())?;
    }
    let started = Instant::now();
    let baked = inputs::baked(&command.file)?;
    let scene = inputs::baked_scene(&command.file, baked.metadata(), command.scene.as_deref())?;
    let scene = inputs::in_variant(scene, command.variant.as_deref())?;
    let baked = inputs::checked(&command.file, &baked)?;
    let lighting = inputs::lighting(command.lights.as_deref(), &scene)?;
    let caster = inputs::caster(&scene)?;
    let how = How { backend: command.backend, direct: command.direct, bounces: command.bounces };
    let (relit, shining) = lit(&baked, &caster, &lighting, how, progress)?;

    if let Some(path) = &command.output {
        write_lightmap(path, &relit, command.half)?;
    }
    if let Some(path) = &command.ktx2 {
        let map = &relit.maps.irradiance;
        let pixels: Vec<Vec4> = (0..map.texels().len())
            .map(|texel| map.color(texel).extend(f32::from(u8::from(map.coverage(texel) > 0.0))))
            .collect();
        output::write_ktx2(path, map.size(), map.size(), &pixels)?;
    }
    if let Some(path) = &command.glb {
        let stage = progress.stage("light map", 0);
        let shining = shining.unwrap_or_else(|| scene_light(&baked, &caster, &lighting, how.direct));
        let scene = lit_scene(caster.scene(), &shining, &relit);
        export_glb(&scene, path)
            .map_err(|error| CommandError::of(Exit::Io, &error).help(error.help()).in_file(path))?;
        drop(stage);
    }
    if let Some(path) = &command.receivers {
        output::write_ply(path, &vertices(&baked, &relit))?;
    }
    let mut exposure = None;
    if let Some(path) = &command.picture {
        let picture = take_picture(&caster, &lighting, &relit, &command.view, progress)?;
        let look = command.view.exposure.map_or(Exposure::Auto, Exposure::Ev);
        exposure = Some(write_picture(path, &picture, look)?);
    }
    if let Some(path) = &command.json {
        let figures = figures(command, &lighting, &relit, exposure, progress.stages(), started);
        write_text(path, &to_json(&figures))?;
    }
    let written = [&command.output, &command.ktx2, &command.glb, &command.receivers, &command.picture, &command.json];
    for path in written.into_iter().flatten().filter(|path| path.as_path() != Path::new("-")) {
        progress.note(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// How a lighting state is computed.
#[derive(Clone, Copy, Debug, Default)]
pub struct How {
    /// What computes.
    pub backend: Backend,
    /// How direct light finds its shadows.
    pub direct: Direct,
    /// Gathers.
    pub bounces: u32,
}

/// Indirect light after so many gathers. The caster's scene carries the file's lightmap coordinates.
pub fn light(
    baked: &Checked<'_>,
    caster: &RayCaster<'_>,
    lighting: &Lighting,
    how: How,
    progress: &Progress,
) -> Result<Relit, CommandError> {
    lit(baked, caster, lighting, how, progress).map(|(relit, _)| relit)
}

/// The same with what shines, which nobody knows here where the GPU makes it.
fn lit(
    baked: &Checked<'_>,
    caster: &RayCaster<'_>,
    lighting: &Lighting,
    how: How,
    progress: &Progress,
) -> Result<(Relit, Option<SceneLight>), CommandError> {
    #[cfg(feature = "gpu")]
    let gpu = match how.backend {
        Backend::Cpu => None,
        // Before anything is computed, so that a missing adapter is told at once.
        Backend::Gpu => Some(relight_gpu::device()?),
    };
    #[cfg(not(feature = "gpu"))]
    if how.backend == Backend::Gpu {
        return Err(CommandError::new(Exit::Unsupported, "this build has no GPU backend")
            .help("leave --backend out: the CPU does the same; or build with the feature gpu"));
    }
    let stage = progress.stage("direct light", 0);
    #[cfg(feature = "gpu")]
    if let (Some(gpu), Direct::ShadowMap) = (&gpu, how.direct) {
        drop(stage);
        let source = Source::ShadowMaps { scene: caster.scene(), lighting };
        return Ok((relight_gpu::light(gpu, baked, &source, how.bounces, progress)?, None));
    }
    let light = scene_light(baked, caster, lighting, how.direct);
    drop(stage);
    progress.check()?;
    #[cfg(feature = "gpu")]
    if let Some(gpu) = gpu {
        let relit = relight_gpu::light(&gpu, baked, &Source::Light(&light), how.bounces, progress)?;
        return Ok((relit, Some(light)));
    }
    let inputs = light.inputs(how.bounces);
    let stage = progress.stage("bounces", how.bounces.into());
    let mut relighter = CpuRelighter::new(baked.clone());
    for _ in 0..how.bounces {
        progress.check()?;
        relighter.step(&inputs).map_err(refused)?;
        stage.inc(1);
    }
    Ok((relighter.relit().clone(), Some(light)))
}

/// What shines in the scene, with shadows by rays or by maps.
fn scene_light(baked: &Checked<'_>, caster: &RayCaster<'_>, lighting: &Lighting, direct: Direct) -> SceneLight {
    let (scene, texels) = (caster.scene(), scene_texels(caster, baked.view()));
    let direct = match direct {
        Direct::Traced => traced_irradiance(caster, &texels, &lighting.lights),
        Direct::ShadowMap => {
            shadow_mapped_irradiance(&texels, &ShadowCasters::of_scene(scene), &lighting.lights, SHADOW_MAP_SIZE)
        }
    };
    SceneLight::new(scene, &texels, lighting, direct, baked.view())
}

/// Scene and file fit each other, or the hash would differ; what is left is a scene that defeats the arithmetic, or a GPU
/// that is too small.
fn refused(error: RelightError) -> CommandError {
    match error {
        #[cfg(feature = "gpu")]
        RelightError::Limit { .. } | RelightError::Device { .. } => {
            CommandError::of(Exit::Unsupported, &error).help("leave --backend out: the CPU does the same")
        }
        _ => CommandError::of(Exit::InvalidInput, &error).help(error.help()),
    }
}

/// The indirect irradiance as an image, row 0 at v = 0; black where no receiver is.
pub fn write_lightmap(path: &Path, relit: &Relit, half: bool) -> Result<(), CommandError> {
    let map = &relit.maps.irradiance;
    let side = map.size() as usize;
    let pixels: Vec<Vec3> = (0..side * side).map(|texel| map.color(texel)).collect();
    let precision = if half { ExrPrecision::Half } else { ExrPrecision::Full };
    Ok(output::write_exr(path, side, side, &pixels, precision)?)
}

fn vertices(baked: &Checked<'_>, relit: &Relit) -> Vec<ReceiverVertex> {
    let view = baked.view();
    let clusters = baked.transport().clusters.iter().enumerate();
    let members =
        clusters.flat_map(|(number, cluster)| cluster.receivers.clone().map(move |receiver| (receiver, number)));
    let vertex = |(receiver, cluster): (usize, usize)| ReceiverVertex {
        position: view.receiver_position[receiver],
        normal: view.receiver_normal[receiver],
        irradiance: relit.irradiance[receiver].to_array(),
        unseen: view.receiver_unseen[receiver],
        cluster: cluster as u32,
    };
    members.map(vertex).collect()
}

/// The scene as a camera sees it under this light.
pub fn take_picture(
    caster: &RayCaster<'_>,
    lighting: &Lighting,
    relit: &Relit,
    view: &View,
    progress: &Progress,
) -> Result<Picture, CommandError> {
    let camera = inputs::camera(caster, view.camera)?;
    let mut size = PictureSize::of_camera(&camera);
    if let Some((width, height)) = view.size {
        size = PictureSize { width, height, ..size };
    }
    let surfaces = Surfaces::new(caster.scene(), lighting, view.albedo_override);
    let radiance = |hit: &SurfaceHit| {
        surfaces.radiance(
            hit,
            |position, normal| direct_irradiance(caster, &lighting.lights, position, normal, hit.normal),
            |uv, normal| relit.maps.irradiance_about(normal, |map| map.sample(uv)).unwrap_or(Vec3::ZERO),
        )
    };
    Ok(picture::render(caster, &camera, size, progress, radiance, |dir| lighting.sky.radiance(dir))?)
}

/// Writes a picture and returns the exposure value it was developed with.
pub fn write_picture(path: &Path, picture: &Picture, exposure: Exposure) -> Result<f32, CommandError> {
    let ev = exposure.ev(&picture.pixels);
    output::write_png(path, picture.width, picture.height, &picture.develop(Exposure::Ev(ev)))?;
    Ok(ev)
}

/// `relight --json`
#[derive(Serialize)]
struct Figures {
    file: String,
    lights: usize,
    bounces: u32,
    backend: &'static str,
    direct: &'static str,
    receivers: usize,
    /// Indirect irradiance over receivers, linear RGB, W/m^2.
    irradiance: Irradiance,
    /// Of the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    exposure: Option<f32>,
    stages: Vec<StageTime>,
    seconds: f64,
}

#[derive(Serialize)]
struct Irradiance {
    mean: [f64; 3],
    max: [f32; 3],
}

fn figures(
    command: &Relight,
    lighting: &Lighting,
    relit: &Relit,
    exposure: Option<f32>,
    stages: Vec<StageTime>,
    started: Instant,
) -> Figures {
    let sum = relit.irradiance.iter().fold(glam::DVec3::ZERO, |sum, value| sum + value.as_dvec3());
    let mean = sum / relit.irradiance.len().max(1) as f64;
    let max = relit.irradiance.iter().fold(Vec3::ZERO, |max, value| max.max(*value));
    Figures {
        file: command.file.display().to_string(),
        lights: lighting.lights.len(),
        bounces: command.bounces,
        backend: match command.backend {
            Backend::Cpu => "cpu",
            Backend::Gpu => "gpu",
        },
        direct: match command.direct {
            Direct::Traced => "traced",
            Direct::ShadowMap => "shadow-map",
        },
        receivers: relit.irradiance.len(),
        irradiance: Irradiance { mean: mean.to_array(), max: max.to_array() },
        exposure,
        stages,
        seconds: started.elapsed().as_secs_f64(),
    }
}
