//! Every pass against its twin, and the whole chain, on any adapter.

mod chain;
mod scene;

use super::*;
use crate::gpu::readback;
use crate::passes::direct_irradiance::DirectOptions;
use crate::test_gpu::{device, device_with, relative_rms};
use crate::{CoverageMap, CpuRelighter, MAX_OCCLUDERS, OccluderShape, RelightInputs, test_bake};
use half::f16;
use localprt_formats::directions::counter_uniform;
use localprt_formats::{BakedArrays, VolumeArrays};

/// Both sides add the same numbers in another order, in f32: sums of up to 1000 rays and 217 columns, whose errors grow
/// with the root of their number: 2^-24 * sqrt(1000) = 2e-6. Maps in half precision are compared elsewhere.
const TOLERANCE: f64 = 1e-5;

const SINGLE: RelighterOptions = RelighterOptions {
    light_map: MapPrecision::Single,
    irradiance_map: MapPrecision::Single,
    bounces: 1,
    feedback_albedo_cap: 0.95,
    direct: DirectOptions { shadow_map_size: 256, shadow_layers: 6 },
};

/// Random surface that covers about two thirds of the texels.
fn surface(size: u32, stream: u64) -> SurfaceTexels {
    let covered = |texel: &u32| counter_uniform(stream, 1, u64::from(*texel)) < 0.66;
    let index: Vec<u32> = (0..size * size).filter(covered).collect();
    let colors = |stream| {
        let centered = test_bake::random_colors(stream, index.len());
        centered.into_iter().map(|color| color + 0.5).collect::<Vec<_>>()
    };
    SurfaceTexels {
        lightmap_uv: Vec::new(),
        size,
        albedo: colors(stream),
        // Multiples of 1/65535 would be stored exactly; these are rounded by up to 2^-17.
        emission: colors(stream + 1),
        direct: colors(stream + 2).into_iter().map(|color| 10.0 * color).collect(),
        index,
    }
}

fn frame(relighter: &mut Relighter, direct: &DirectLight<'_>) {
    let mut encoder = relighter.device.create_command_encoder(&Default::default());
    relighter.encode(&mut encoder, direct).unwrap();
    relighter.queue.submit([encoder.finish()]);
}

/// Texels of a map as the twin stores them.
fn map_texels(relighter: &Relighter, texture: &wgpu::Texture, level: u32) -> (u32, Vec<glam::Vec4>) {
    let bytes = readback::texture(&relighter.device, &relighter.queue, texture, level).unwrap();
    let width = texture.size().mip_level_size(level, texture.dimension()).width;
    let texels = match texture.format() {
        wgpu::TextureFormat::Rgba16Float => bytes
            .chunks_exact(8)
            .map(|texel| {
                let texel: [f16; 4] = bytemuck::pod_read_unaligned(texel);
                glam::Vec4::from_array(texel.map(f16::to_f32))
            })
            .collect(),
        _ => bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect(),
    };
    (width, texels)
}

/// The part of a wider texture that holds a map; the rest must be empty.
fn cropped(width: u32, texels: &[glam::Vec4], size: u32) -> Vec<glam::Vec4> {
    let mut kept = Vec::new();
    for (index, texel) in texels.iter().enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        if x < size && y < size {
            kept.push(*texel);
        } else {
            assert_eq!(*texel, glam::Vec4::ZERO, "texel {x}, {y} lies outside of the map");
        }
    }
    kept
}

#[track_caller]
fn assert_close(what: &str, found: &[Vec3], expected: &[Vec3], tolerance: f64) {
    let difference = relative_rms(found, expected);
    assert!(difference <= tolerance, "{what}: relative RMS {difference:.2e}, allowed {tolerance:.0e}");
}

#[track_caller]
fn assert_maps_close(what: &str, found: &[glam::Vec4], expected: &CoverageMap, tolerance: f64) {
    let rgb = |texels: &[glam::Vec4]| texels.iter().map(|texel| texel.truncate()).collect::<Vec<_>>();
    assert_eq!(found.len(), expected.texels().len(), "{what}");
    for (index, (found, expected)) in found.iter().zip(expected.texels()).enumerate() {
        assert_eq!(found.w, expected.w, "{what}: coverage of texel {index}");
    }
    assert_close(what, &rgb(found), &rgb(expected.texels()), tolerance);
}

/// Compares what every pass of the last gather has left behind.
#[track_caller]
fn assert_passes_agree(gpu: &Relighter, cpu: &CpuRelighter<'_>, tolerance: f64) {
    for (level, expected) in cpu.light_map().iter().enumerate() {
        let (width, texels) = map_texels(gpu, gpu.light_map(), level as u32);
        let what = format!("light map, level {level}");
        assert_maps_close(&what, &cropped(width, &texels, expected.size()), expected, tolerance);
    }
    assert_close("probe radiance", &gpu.read_probe_radiance().unwrap(), cpu.probe_radiance(), tolerance);
    assert_close("cluster lights", &gpu.read_cluster_lights().unwrap(), cpu.cluster_lights(), tolerance);
    assert_close("coefficients", &gpu.read_coefficients().unwrap(), &cpu.relit().coefficients, tolerance);
    let (_, texels) = map_texels(gpu, &gpu.maps.irradiance, 0);
    assert_maps_close("irradiance map", &texels, &cpu.relit().maps.irradiance, tolerance);
}

/// Three gathers of both relighters under the same light, compared pass by pass after each.
#[track_caller]
fn assert_chain_agrees(device: &wgpu::Device, queue: &wgpu::Queue, arrays: &BakedArrays, sky: bool) -> usize {
    let mut gpu = Relighter::new(device, queue, &arrays.checked().unwrap(), SINGLE).unwrap();
    let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
    let surface = surface(arrays.metadata.direct_size, 5);
    let sky_sh = test_bake::random_colors(2, if sky { arrays.metadata.n_sky() } else { 0 });
    let sky_rays: Vec<Vec3> = test_bake::random_colors(3, if sky { arrays.ray_dirs.len() } else { 0 });
    gpu.set_surface(&surface).unwrap();
    gpu.set_sky(&sky_sh, &sky_rays).unwrap();
    let inputs =
        RelightInputs { sky_sh: &sky_sh, sky_rays: &sky_rays, sky_in_probes: true, ..RelightInputs::new(&surface) };
    for _ in 0..3 {
        cpu.step(&inputs).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        assert_passes_agree(&gpu, &cpu, TOLERANCE);
    }
    gpu.pages.len()
}

/// Many copies of the clusters of the random bake, so that their arrays are longer than small limits.
fn repeated(copies: usize) -> BakedArrays {
    let mut arrays = test_bake::random(3, 1, 2);
    arrays.metadata.lightmap_size = 256;
    let original = arrays.clone();
    let blocks = vec![test_bake::blocks(&arrays); copies].concat();
    let n = (original.receiver_texel.len() * copies) as u32;
    arrays.receiver_texel = (0..n).map(|receiver| receiver * 3).collect();
    arrays.gutters = (0..n).map(|receiver| [receiver * 3 + 1, receiver]).collect();
    let repeat = |values: &[[f32; 3]]| (0..n as usize).map(|receiver| values[receiver % values.len()]).collect();
    arrays.receiver_normal = repeat(&original.receiver_normal);
    arrays.receiver_position = repeat(&original.receiver_position);
    arrays.receiver_unseen = vec![0.0; n as usize];
    test_bake::set_blocks(&mut arrays, &blocks);
    arrays
}
