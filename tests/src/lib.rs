//! Harness of the tests that cross crates: small bakes of built-in scenes, relit on the CPU.

pub mod moving;

use glam::Vec3;
use localprt_precompute::{BakeOutput, BakeSettings, Progress, rays::RayCaster, settings::Transport};
use localprt_runtime::{
    CpuRelighter, DirectLight, Relighter, RelighterOptions, Relit,
    gpu::headless,
    scene_light::{scene_texels, traced_irradiance},
};
use localprt_scenes::{Lighting, Scene, builtin};
use std::path::PathBuf;

/// Both ways to make transport rows, for what must hold of either.
pub const TRANSPORTS: [Transport; 2] = [Transport::Paper, Transport::Fitted];

/// Settings that bake a small room in a second or two.
pub fn small_settings() -> BakeSettings {
    BakeSettings {
        probes: Some(16),
        lightmap: Some(48),
        direct_map: 128,
        gather_rays: 256,
        relight_rays: 2000,
        ..BakeSettings::default()
    }
}

/// A built-in scene by name.
pub fn scene(name: &str) -> Scene {
    builtin::scene(name).unwrap_or_else(|| panic!("no built-in scene {name}"))
}

/// Bakes a scene; the test fails if that fails.
pub fn bake(scene: Scene, settings: &BakeSettings) -> BakeOutput {
    localprt_precompute::bake(scene, settings, &Progress::silent()).unwrap_or_else(|error| panic!("bake: {error}"))
}

/// `[n_receivers]` indirect irradiance after `bounces` gathers.
pub fn irradiance(baked: &BakeOutput, lighting: &Lighting, bounces: u32) -> Vec<Vec3> {
    relit(baked, lighting, bounces, |relighter| relighter.relit().irradiance.clone())
}

/// What `look` finds in the light after `bounces` gathers.
pub fn relit<T>(baked: &BakeOutput, lighting: &Lighting, bounces: u32, look: impl FnOnce(&CpuRelighter<'_>) -> T) -> T {
    let mut relighter = CpuRelighter::new(baked.arrays.checked().expect("consistent arrays"));
    relighter.set_scene(&baked.scene).expect("tree");
    relighter.set_lighting(lighting).expect("a scene is set");
    for _ in 0..bounces {
        relighter.bounce().expect("inputs of the right size");
    }
    look(&relighter)
}

/// The same on the GPU, direct light by shadow maps or traced; `None`, with a line that says so, without an adapter.
pub fn irradiance_on_gpu(
    test: &str,
    baked: &BakeOutput,
    lighting: &Lighting,
    bounces: u32,
    shadow_maps: bool,
) -> Option<Vec<Vec3>> {
    let (device, queue) = match pollster::block_on(headless()) {
        Ok(found) => found,
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some() => panic!("{test}: {error}"),
        Err(error) => {
            eprintln!("SKIPPED {test}: {error}");
            return None;
        }
    };
    let scene = &baked.scene;
    let caster = RayCaster::new(scene).expect("tree");
    let checked = baked.arrays.checked().expect("consistent arrays");
    let mut relighter =
        Relighter::new(&device, &queue, &checked, RelighterOptions::default()).expect("room on the device");
    relighter.set_scene(scene, &checked).expect("a scene that fits");
    relighter.set_lighting(lighting).expect("a lighting of the scene");
    let direct = if shadow_maps {
        DirectLight::Lights
    } else {
        let texels = scene_texels(&caster, checked.view());
        let direct = traced_irradiance(&caster, &texels, &lighting.lights);
        relighter.set_direct(&direct).expect("one per texel");
        DirectLight::Irradiance
    };
    for _ in 0..bounces {
        let mut encoder = device.create_command_encoder(&Default::default());
        relighter.encode(&mut encoder, &direct).expect("inputs that fit");
        queue.submit([encoder.finish()]);
    }
    let coefficients = relighter.read_coefficients().expect("a device that answers");
    Some(Relit::of_coefficients(&checked, coefficients).irradiance)
}

/// Mean of the three bands over some receivers.
pub fn mean(values: impl IntoIterator<Item = Vec3>) -> f32 {
    let (sum, n) =
        values.into_iter().fold((0.0f64, 0u32), |(sum, n), value| (sum + f64::from(value.element_sum()) / 3.0, n + 1));
    assert!(n > 0, "nothing to average");
    (sum / f64::from(n)) as f32
}

/// Folder with large scenes that are not part of the repository: `LOCALPRT_SHARED`, else `../shared` beside it.
///
/// `None`, with a line that says so, where it is absent.
pub fn shared_scenes(test: &str) -> Option<PathBuf> {
    let root = std::env::var_os("LOCALPRT_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared"), PathBuf::from);
    let scenes = root.join("scenes");
    if scenes.is_dir() {
        return Some(scenes);
    }
    eprintln!("SKIPPED {test}: no folder {} (set LOCALPRT_SHARED)", scenes.display());
    None
}
