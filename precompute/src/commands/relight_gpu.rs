//! `relight --backend gpu`: the same gathers in compute shaders.

use super::refused;
use localprt_formats::BakedView;
use localprt_precompute::error::CommandError;
use localprt_precompute::progress::{Progress, StageGuard};
use localprt_runtime::{
    CheckedBake, DirectLight, MapPrecision, RelightInputs, Relighter, RelighterOptions, Relit, gpu::headless,
};

/// A GPU and its queue.
pub type Gpu = (wgpu::Device, wgpu::Queue);

/// The fastest adapter of this machine.
pub fn device() -> Result<Gpu, CommandError> {
    pollster::block_on(headless()).map_err(refused)
}

/// Indirect light after `inputs.bounces` gathers from darkness.
pub fn light(
    (device, queue): &Gpu,
    view: BakedView<'_>,
    inputs: &RelightInputs<'_>,
    progress: &Progress,
    stage: &StageGuard<'_>,
) -> Result<Relit, CommandError> {
    // A tool wants figures, not speed.
    let options = RelighterOptions {
        light_map: MapPrecision::Single,
        irradiance_map: MapPrecision::Single,
        ..RelighterOptions::default()
    };
    let mut relighter = Relighter::new(device, queue, view, options).map_err(refused)?;
    relighter.set_surface(inputs.surface).map_err(refused)?;
    relighter.set_sky(inputs.sky_sh, &[]).map_err(refused)?;
    for _ in 0..inputs.bounces {
        progress.check()?;
        let mut encoder = device.create_command_encoder(&Default::default());
        relighter.encode(&mut encoder, &DirectLight::Irradiance).map_err(refused)?;
        queue.submit([encoder.finish()]);
        stage.inc(1);
    }
    let coefficients = relighter.read_coefficients().map_err(refused)?;
    let baked = CheckedBake::new(view).map_err(refused)?;
    Ok(Relit::of_coefficients(&baked, coefficients))
}
