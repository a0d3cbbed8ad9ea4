//! A light that moves slowly makes light that changes slowly: no flicker.

use glam::Vec3;
use localprt_precompute::{
    pipeline::BakeOutput,
    rays::RayCaster,
    relight,
    settings::{BakeSettings, Transport},
};
use localprt_runtime::{CpuRelighter, RelightInputs};
use localprt_scenes::Lighting;
use localprt_tests::{TRANSPORTS, bake, scene, small_settings};

const FRAMES: usize = 24;
const STEP_M: f32 = 0.01;

/// RMS over receivers and frames of the second difference in time, over the mean: what a smooth motion hardly has and
/// flicker is made of. And the same of the first difference.
fn roughness(baked: &BakeOutput) -> (f64, f64) {
    let caster = RayCaster::new(&baked.scene).expect("tree");
    let view = baked.arrays.view();
    let texels = relight::scene_texels(&caster, &view);
    let mut lighting = Lighting::of_scene(&baked.scene);
    let start = lighting.lights[0].position;
    let mut relighter = CpuRelighter::new(view).expect("consistent arrays");
    let frames: Vec<Vec<Vec3>> = (0..FRAMES)
        .map(|frame| {
            lighting.lights[0].position = start + Vec3::new(STEP_M * frame as f32, 0.0, 0.5 * STEP_M * frame as f32);
            let direct = relight::traced_irradiance(&caster, &texels, &lighting.lights);
            let surface = texels.shaded(&[], None, direct);
            relighter
                .relight(&RelightInputs { bounces: 2, ..RelightInputs::new(&surface) })
                .expect("inputs")
                .irradiance
                .clone()
        })
        .collect();
    let mean = frames.iter().flatten().map(|value| f64::from(value.element_sum())).sum::<f64>()
        / (3 * FRAMES * frames[0].len()) as f64;
    let rms = |difference: &dyn Fn(usize, usize) -> Vec3, times: std::ops::Range<usize>| {
        let n = 3 * times.len() * frames[0].len();
        let squares: f64 = times
            .flat_map(|time| (0..frames[0].len()).map(move |receiver| (time, receiver)))
            .map(|(time, receiver)| f64::from(difference(time, receiver).length_squared()))
            .sum();
        (squares / n as f64).sqrt() / mean
    };
    let first = rms(&|time, receiver| frames[time + 1][receiver] - frames[time][receiver], 0..FRAMES - 1);
    let second = rms(
        &|time, receiver| frames[time + 1][receiver] - 2.0 * frames[time][receiver] + frames[time - 1][receiver],
        1..FRAMES - 1,
    );
    (first, second)
}

#[test]
fn a_slowly_moving_light_does_not_flicker() {
    TRANSPORTS.into_iter().for_each(does_not_flicker);
}

fn does_not_flicker(transport: Transport) {
    // Of the probes alone; near light is looked at below.
    let settings = BakeSettings { transport, near_bytes: 0, ..small_settings() };
    let mut baked = bake(scene("cornell"), &settings);
    let (change, flicker) = roughness(&baked);
    eprintln!(
        "{transport:?}: a centimetre of the light changes receivers by {change:.4} of the mean, {flicker:.5} of it unevenly"
    );
    assert!(change > 1e-3, "the light moves, but nothing changes: {change}");
    // Without mip levels, relight rays read single texels of the light map, and shadow edges jump from ray to ray.
    baked.arrays.ray_level.iter_mut().filter(|level| **level <= 15).for_each(|level| *level = 0);
    let (_, without_mips) = roughness(&baked);
    eprintln!("without mip levels: {without_mips:.5}");
    assert!(flicker < without_mips, "mip levels smooth: {flicker}, without {without_mips}");
    // What is left are shadow edges that jump from point to point of the texels of a light map of 128, of which each has four: a
    // finer one has smaller jumps, but other changes remain.
    let finer = bake(scene("cornell"), &BakeSettings { direct_map: 512, relight_rays: 8000, ..settings.clone() });
    let (_, of_finer) = roughness(&finer);
    eprintln!("with 512 texels and 8000 rays: {of_finer:.5}");
    assert!(of_finer < 0.75 * flicker, "512 texels: {of_finer}, 128: {flicker}");
    assert!(of_finer < 2e-3, "{of_finer}");
    if transport == Transport::Paper {
        // Its rows read no near light.
        return;
    }
    // Near light reads texels of the map too, and not coarser ones than probes do: as even as without, but for a few percent.
    let near =
        bake(scene("cornell"), &BakeSettings { near_bytes: 32, direct_map: 512, relight_rays: 8000, ..settings });
    let (_, with_near) = roughness(&near);
    eprintln!("the same with near light: {with_near:.5}");
    assert!(with_near <= 1.05 * of_finer, "near light: {with_near}, without {of_finer}");
}
