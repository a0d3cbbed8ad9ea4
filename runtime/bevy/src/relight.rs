//! Render world: a relighter for each scene, on Bevy's device, recorded before any camera.

use crate::baked_light::{BakedLight, Parts};
use crate::extract::{ExtractedScene, ExtractedScenes};
use crate::output::Output;
use crate::relit::{RelitStatus, SkyRadiance};
use crate::units;
use bevy::asset::AssetId;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::log::error;
use bevy::platform::collections::HashMap;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use localprt_formats::OpenError;
use localprt_runtime::{DirectLight, DirectOptions, MapPrecision, RelightError, Relighter, RelighterOptions, sky_sh};
use localprt_scenes::{Light, MaterialOverride};
use std::sync::{Arc, Mutex, PoisonError};

/// By the root in the main world. Made anew with each device, so that none outlives its own.
#[derive(Resource, Default)]
pub(crate) struct Relighters(HashMap<Entity, Scene>);

struct Scene {
    /// What it was made for.
    file: AssetId<BakedLight>,
    lightmap: AssetId<Image>,
    status: Arc<Mutex<RelitStatus>>,
    state: State,
}

enum State {
    /// Uploads and compiles beside the frames.
    Starting(Task<Result<Box<Relighter>, StartError>>),
    Running(Box<Running>),
    Failed,
}

#[derive(Debug, thiserror::Error)]
enum StartError {
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Relight(#[from] RelightError),
}

struct Running {
    relighter: Relighter,
    /// Once Bevy has the maps on the device.
    output: Option<Output>,
    sky_degree: u32,
    sent: Option<Sent>,
}

/// What the relighter was told last.
struct Sent {
    lights: Vec<Light>,
    materials: Vec<MaterialOverride>,
    sky: SkyRadiance,
    reset: u32,
}

/// Starts and stops relighters, and tells them what shines.
pub(crate) fn prepare(
    mut relighters: ResMut<Relighters>,
    extracted: Res<ExtractedScenes>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    relighters.0.retain(|root, scene| {
        extracted.0.iter().any(|now| (now.root, now.file, now.lightmap) == (*root, scene.file, scene.lightmap))
    });
    for now in &extracted.0 {
        let scene = relighters.0.entry(now.root).or_insert_with(|| Scene {
            file: now.file,
            lightmap: now.lightmap,
            status: now.status.clone(),
            state: State::Starting(start(&device, &queue, now)),
        });
        if let State::Starting(task) = &mut scene.state
            && let Some(started) = check_ready(task)
        {
            scene.state = match started {
                Ok(relighter) => State::Running(Box::new(Running::new(*relighter, now))),
                Err(cause) => failed(&scene.status, &cause),
            };
        }
        if let State::Running(running) = &mut scene.state
            && let Err(cause) = running.tell(now, &images, &device, &queue)
        {
            scene.state = failed(&scene.status, &cause);
        }
    }
}

fn start(device: &RenderDevice, queue: &RenderQueue, now: &ExtractedScene) -> Task<Result<Box<Relighter>, StartError>> {
    let (device, queue): (wgpu::Device, wgpu::Queue) = (device.wgpu_device().clone(), (**queue).clone());
    let parts = now.parts.clone();
    // What is scaled may be brighter than f16 holds until it is.
    let irradiance_map = if now.scale == 1.0 { MapPrecision::Half } else { MapPrecision::Single };
    let direct = DirectOptions { shadow_map_size: now.shadow_map_size, ..DirectOptions::default() };
    let options = RelighterOptions { irradiance_map, direct, ..RelighterOptions::default() };
    AsyncComputeTaskPool::get().spawn(async move { relighter(&device, &queue, &parts, options).map(Box::new) })
}

fn relighter(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    parts: &Parts,
    options: RelighterOptions,
) -> Result<Relighter, StartError> {
    let mut relighter = Relighter::new(device, queue, &parts.baked.checked()?, options)?;
    relighter.set_texels(&parts.texels, &parts.casters)?;
    Ok(relighter)
}

fn failed(status: &Mutex<RelitStatus>, cause: &dyn std::error::Error) -> State {
    error!("no relighting: {cause}");
    status.lock().unwrap_or_else(PoisonError::into_inner).error = Some(cause.to_string());
    State::Failed
}

impl Running {
    fn new(relighter: Relighter, now: &ExtractedScene) -> Self {
        let sky_degree = now.parts.baked.metadata().sky_degree;
        Self { relighter, output: None, sky_degree, sent: None }
    }

    fn tell(
        &mut self,
        now: &ExtractedScene,
        images: &RenderAssets<GpuImage>,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<(), RelightError> {
        let sent = self.sent.as_ref();
        if sent.is_none_or(|sent| sent.materials != now.materials) {
            self.relighter.set_materials(&now.materials, None)?;
        }
        if sent.is_none_or(|sent| sent.sky != now.sky) {
            self.relighter.set_sky(&sky_sh(&units::sky(&now.sky), self.sky_degree), &[])?;
        }
        if sent.is_some_and(|sent| sent.reset != now.reset) {
            self.relighter.reset();
        }
        if sent.is_none_or(|sent| sent.lights != now.lights) {
            self.relighter.set_lights(&now.lights);
        }
        self.relighter.set_bounces(now.bounces);
        self.sent =
            Some(Sent { lights: now.lights.clone(), materials: now.materials.clone(), sky: now.sky, reset: now.reset });
        let lightmap = images.get(now.lightmap);
        let voxels = now.voxels.and_then(|voxels| images.get(voxels));
        let is_there = lightmap.is_some() && voxels.is_some() == now.voxels.is_some();
        self.output = lightmap.filter(|_| is_there).map(|lightmap| match self.output.take() {
            Some(output) if output.is_into(lightmap, voxels) => output,
            _ => Output::new(device.wgpu_device(), queue, &self.relighter, now.scale, lightmap, voxels),
        });
        Ok(())
    }
}

/// Records one frame of every relighter and hands its light to Bevy's maps.
pub(crate) fn relight(mut context: RenderContext, mut relighters: ResMut<Relighters>) {
    for scene in relighters.0.values_mut() {
        let State::Running(running) = &mut scene.state else { continue };
        let Some(output) = &running.output else { continue };
        let encoder = context.command_encoder();
        if let Err(cause) = running.relighter.encode(encoder, &DirectLight::Lights) {
            scene.state = failed(&scene.status, &cause);
            continue;
        }
        output.encode(encoder);
        let mut status = scene.status.lock().unwrap_or_else(PoisonError::into_inner);
        status.gathers = running.relighter.gathers();
        status.memory = running.relighter.memory();
    }
}
