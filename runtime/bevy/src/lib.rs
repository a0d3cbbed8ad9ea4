#![doc = include_str!("../README.md")]

mod baked_light;
mod extract;
mod light_maps;
mod output;
mod relight;
mod relit;
mod units;

pub use baked_light::{BakedLight, BakedLightError, BakedLightLoader};
pub use relit::{Relit, RelitMaps, RelitStatus, SkyRadiance};

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::AssetApp;
use bevy::core_pipeline::schedule::camera_driver;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::render::renderer::RenderGraph;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderSystems};

/// Loads `.lprt` files, and relights below every entity with a [`Relit`] once per frame, before any camera draws. Comes after
/// `DefaultPlugins`.
pub struct LocalprtPlugin;

impl Plugin for LocalprtPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<BakedLight>().init_asset_loader::<BakedLightLoader>();
        // Maps that go are gone a frame before others come: Bevy does not see a light map that is replaced within a frame.
        app.add_systems(
            PostUpdate,
            (light_maps::create, light_maps::apply, light_maps::note_materials, light_maps::remove).chain(),
        );
        // Without a GPU there is nothing to relight.
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .init_gpu_resource::<relight::Relighters>()
            .init_resource::<extract::ExtractedScenes>()
            .add_systems(ExtractSchedule, extract::extract)
            .add_systems(Render, relight::prepare.in_set(RenderSystems::PrepareResources))
            .add_systems(RenderGraph, relight::relight.before(camera_driver));
    }
}
