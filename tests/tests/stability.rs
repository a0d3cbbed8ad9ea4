//! A light that moves slowly makes light that changes slowly: no flicker.

use glam::Vec3;
use localprt_precompute::{
    pipeline::BakeOutput,
    rays::RayCaster,
    settings::{BakeSettings, Transport},
};
use localprt_runtime::{CpuRelighter, RelightInputs, scene_light};
use localprt_scenes::Lighting;
use localprt_tests::{TRANSPORTS, bake, scene, small_settings};

const FRAMES: usize = 24;
const STEP_M: f32 = 0.01;

/// Where direct light falls on a texel of the light map.
#[derive(Clone, Copy, PartialEq)]
enum TexelPoints {
    /// At its own point.
    One,
    /// As a mean over its samples.
    All,
}

/// RMS over receivers and frames of the second difference in time, over the mean: what a smooth motion hardly has and
/// flicker is made of. And the same of the first difference.
fn roughness(baked: &BakeOutput, points: TexelPoints) -> (f64, f64) {
    let caster = RayCaster::new(&baked.scene).expect("tree");
    let view = baked.arrays.view();
    let mut texels = scene_light::scene_texels(&caster, &view);
    if points == TexelPoints::One {
        texels.sample_end.clear();
        texels.samples.clear();
    }
    let mut lighting = Lighting::of_scene(&baked.scene);
    let start = lighting.lights[0].position;
    let mut relighter = CpuRelighter::new(baked.arrays.checked().expect("consistent arrays"));
    let frames: Vec<Vec<Vec3>> = (0..FRAMES)
        .map(|frame| {
            lighting.lights[0].position = start + Vec3::new(STEP_M * frame as f32, 0.0, 0.5 * STEP_M * frame as f32);
            let direct = scene_light::traced_irradiance(&caster, &texels, &lighting.lights);
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
    let (change, flicker) = roughness(&baked, TexelPoints::All);
    eprintln!(
        "{transport:?}: a centimetre of the light changes receivers by {change:.4} of the mean, {flicker:.5} of it unevenly"
    );
    assert!(change > 1e-3, "the light moves, but nothing changes: {change}");
    // Shadow edges jump from texel to texel of a light map of 128; less where a texel has the mean over its points.
    let (_, of_one_point) = roughness(&baked, TexelPoints::One);
    eprintln!("of one point a texel: {of_one_point:.5}");
    assert!(flicker < of_one_point, "means: {flicker}, one point: {of_one_point}");
    // Without mip levels, relight rays read single texels of the light map, and shadow edges jump from ray to ray.
    baked.arrays.ray_level.iter_mut().filter(|level| **level <= 15).for_each(|level| *level = 0);
    let (_, without_mips) = roughness(&baked, TexelPoints::All);
    eprintln!("without mip levels: {without_mips:.5}");
    assert!(flicker < without_mips, "mip levels smooth: {flicker}, without {without_mips}");
    // A finer map has smaller jumps.
    let finer = bake(scene("cornell"), &BakeSettings { direct_map: 512, relight_rays: 8000, ..settings.clone() });
    let (_, of_finer) = roughness(&finer, TexelPoints::All);
    eprintln!("with 512 texels and 8000 rays: {of_finer:.5}");
    assert!(of_finer < 0.6 * of_one_point, "512 texels: {of_finer}, 128, one point: {of_one_point}");
    assert!(of_finer < 2e-3, "{of_finer}");
    if transport == Transport::Paper {
        // Its rows read no near light.
        return;
    }
    // Near light reads texels of the map too, single ones where a site is as close to something as a texel is wide. Light close by
    // changes faster than probes can tell, so what counts is what a map of 1024 has less of: less than a tenth comes from texels.
    let with = |near_bytes: u32, direct_map: u32| {
        let settings = BakeSettings { near_bytes, direct_map, relight_rays: 8000, ..settings.clone() };
        roughness(&bake(scene("cornell"), &settings), TexelPoints::All).1
    };
    let (near, near_of_1024, of_1024) = (with(32, 512), with(32, 1024), with(0, 1024));
    eprintln!("with near light: {near:.5}, of 1024 texels {near_of_1024:.5}; without {of_finer:.5}, {of_1024:.5}");
    assert!(near < 1.1 * near_of_1024, "near light: {near}, of 1024 texels {near_of_1024}");
    assert!(near < 2e-3, "{near}");
}
