//! `relight --backend gpu`: the same gathers in compute shaders.

use super::{SHADOW_MAP_SIZE, refused};
use localprt_formats::Checked;
use localprt_precompute::error::CommandError;
use localprt_precompute::progress::Progress;
use localprt_runtime::{
    DirectLight, DirectOptions, MapPrecision, RelightError, Relighter, RelighterOptions, Relit, SceneLight,
    gpu::headless,
};
use localprt_scenes::{Lighting, Scene};

/// A GPU and its queue.
pub type Gpu = (wgpu::Device, wgpu::Queue);

/// Where direct light comes from.
pub enum Source<'a> {
    /// Computed before, on the CPU.
    Light(&'a SceneLight),
    /// Shadow maps on the GPU.
    ShadowMaps { scene: &'a Scene, lighting: &'a Lighting },
}

/// The fastest adapter of this machine.
pub fn device() -> Result<Gpu, CommandError> {
    pollster::block_on(headless()).map_err(refused)
}

/// Indirect light after so many gathers from darkness.
pub fn light(
    (device, queue): &Gpu,
    baked: &Checked<'_>,
    source: &Source<'_>,
    bounces: u32,
    progress: &Progress,
) -> Result<Relit, CommandError> {
    // A tool wants figures, not speed.
    let options = RelighterOptions {
        light_map: MapPrecision::Single,
        irradiance_map: MapPrecision::Single,
        direct: DirectOptions { shadow_map_size: SHADOW_MAP_SIZE, ..DirectOptions::default() },
        ..RelighterOptions::default()
    };
    let stage = progress.stage("upload", 0);
    // What the file asks for may be more than the device has left; it says so through these.
    let out_of_memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let invalid = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let mut relighter = Relighter::new(device, queue, baked, options).map_err(refused)?;
    let direct = match source {
        Source::Light(light) => {
            relighter.set_surface(&light.surface).map_err(refused)?;
            relighter.set_sky(&light.sky.sh, &[]).map_err(refused)?;
            DirectLight::Irradiance
        }
        Source::ShadowMaps { scene, lighting } => {
            relighter.set_scene(scene, baked).map_err(refused)?;
            relighter.set_lighting(lighting).map_err(refused)?;
            DirectLight::Lights
        }
    };
    for scope in [invalid, out_of_memory] {
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(refused(RelightError::Device { reason: error.to_string() }));
        }
    }
    drop(stage);
    let stage = progress.stage("bounces", bounces.into());
    for _ in 0..bounces {
        progress.check()?;
        let mut encoder = device.create_command_encoder(&Default::default());
        relighter.encode(&mut encoder, &direct).map_err(refused)?;
        queue.submit([encoder.finish()]);
        stage.inc(1);
    }
    let coefficients = relighter.read_coefficients().map_err(refused)?;
    Ok(Relit::of_coefficients(baked, coefficients))
}
