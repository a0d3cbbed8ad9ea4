//! Every pass against its twin, and the whole chain, on any adapter.

use super::*;
use crate::test_gpu::{device, device_with, relative_rms};
use crate::{CoverageMap, CpuRelighter, MAX_OCCLUDERS, OccluderShape, RelightInputs, test_bake};
use half::f16;
use localprt_formats::BakedArrays;
use localprt_formats::directions::counter_uniform;

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
    assert_maps_close("irradiance map", &texels, &cpu.relit().irradiance_map, tolerance);
}

/// Three gathers of both relighters under the same light, compared pass by pass after each.
#[track_caller]
fn assert_chain_agrees(device: &wgpu::Device, queue: &wgpu::Queue, arrays: &BakedArrays, sky: bool) -> usize {
    let mut gpu = Relighter::new(device, queue, arrays.view(), SINGLE).unwrap();
    let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
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

#[test]
fn every_pass_equals_its_twin() {
    let Some((device, queue)) = device("every_pass_equals_its_twin") else { return };
    for (probe_degree, receiver_degree, sky_degree) in [(2, 0, 2), (3, 1, 1), (7, 0, 0), (10, 1, 2), (0, 0, 2)] {
        for sky in [false, true] {
            // Blocks of odd length are padded with NaN, which must never be used.
            let mut arrays = test_bake::random(probe_degree, receiver_degree, sky_degree);
            for (ray, level) in arrays.ray_level.iter_mut().enumerate() {
                *level = [0, 1, 2, 3, 9, localprt_formats::LEVEL_SKY, localprt_formats::LEVEL_BLACK][ray % 7];
            }
            assert_eq!(assert_chain_agrees(&device, &queue, &arrays, sky), 1);
        }
    }
}

#[test]
fn maps_of_any_size_equal_their_twins() {
    let Some((device, queue)) = device("maps_of_any_size_equal_their_twins") else { return };
    for direct_size in [1, 2, 3, 16, 17, 37, 100, 129] {
        let mut arrays = test_bake::random(2, 0, 1);
        arrays.metadata.direct_size = direct_size;
        arrays.ray_level.iter_mut().enumerate().for_each(|(ray, level)| *level = (ray % 9) as u8);
        assert_chain_agrees(&device, &queue, &arrays, false);
    }
}

/// Many copies of the clusters of the random bake, so that their arrays are longer than small limits.
fn repeated(copies: usize) -> BakedArrays {
    let mut arrays = test_bake::random(3, 1, 2);
    arrays.metadata.lightmap_size = 256;
    let original = arrays.clone();
    // The last receiver has no cluster; copies go before it.
    let (n_receivers, n_lights) = (11, 6);
    for copy in 1..copies as u32 {
        for record in &original.clusters {
            let mut record = *record;
            record.first_receiver += copy * n_receivers;
            record.first_light += copy * n_lights;
            record.first_probe += copy * original.cluster_probes.len() as u32;
            record.projection_pair += copy * (original.projection.len() / 2) as u32;
            record.reconstruction_pair += copy * (original.reconstruction.len() / 2) as u32;
            arrays.clusters.push(record);
        }
        arrays.cluster_probes.extend(&original.cluster_probes);
        arrays.projection.extend(&original.projection);
        arrays.reconstruction.extend(&original.reconstruction);
    }
    let n = n_receivers * copies as u32 + 1;
    arrays.receiver_texel = (0..n).map(|receiver| receiver * 3).collect();
    arrays.gutters = (0..n).map(|receiver| [receiver * 3 + 1, receiver]).collect();
    let repeat = |values: &[[f32; 3]]| (0..n as usize).map(|receiver| values[receiver % values.len()]).collect();
    arrays.receiver_normal = repeat(&original.receiver_normal);
    arrays.receiver_position = repeat(&original.receiver_position);
    arrays.receiver_unseen = vec![0.0; n as usize];
    arrays
}

#[test]
fn small_limits_give_the_same_light_in_pages() {
    let test = "small_limits_give_the_same_light_in_pages";
    let small = |adapter: &wgpu::Adapter| wgpu::Limits {
        max_storage_buffer_binding_size: 1 << 16,
        max_compute_workgroups_per_dimension: 64,
        ..wgpu::Limits::default().or_worse_values_from(&adapter.limits())
    };
    let Some((device, queue)) = device_with(test, small) else { return };
    let arrays = repeated(800);
    let n_pages = assert_chain_agrees(&device, &queue, &arrays, true);
    assert!(n_pages > 5, "{n_pages} pages");

    // Too small for a single cluster, or for what is never split: a message instead of a panic.
    let tiny = |adapter: &wgpu::Adapter| wgpu::Limits {
        max_storage_buffer_binding_size: 256,
        ..wgpu::Limits::default().or_worse_values_from(&adapter.limits())
    };
    let Some((device, queue)) = device_with(test, tiny) else { return };
    let refused = Relighter::new(&device, &queue, arrays.view(), SINGLE).err().expect("nothing fits into 256 bytes");
    assert!(matches!(refused, RelightError::Limit { .. }), "{refused}");
}

#[test]
fn default_limits_of_webgpu_are_enough() {
    let test = "default_limits_of_webgpu_are_enough";
    let Some((device, queue)) = device_with(test, |_| wgpu::Limits::default()) else { return };
    assert_chain_agrees(&device, &queue, &test_bake::random(7, 1, 4), true);
}

#[test]
fn half_precision_maps_lose_no_more_than_their_rounding() {
    let Some((device, queue)) = device("half_precision_maps_lose_no_more_than_their_rounding") else { return };
    // Positive weights: no cancellation enlarges a relative error.
    let arrays = test_bake::furnace(3);
    let half = RelighterOptions {
        light_map: MapPrecision::Half,
        irradiance_map: MapPrecision::Half,
        ..RelighterOptions::default()
    };
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), half).unwrap();
    let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
    let surface = surface(8, 5);
    gpu.set_surface(&surface).unwrap();
    for _ in 0..3 {
        cpu.step(&RelightInputs::new(&surface)).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        // Drivers may cut off instead of rounding to 11 bits: 2^-10 at most, half of that on average, whenever a level is
        // written; four levels are read, one made from the other.
        assert_passes_agree(&gpu, &cpu, 4.0 * 2f64.powi(-11));
    }
}

#[test]
fn the_furnace_settles_at_its_closed_form() {
    let Some((device, queue)) = device("the_furnace_settles_at_its_closed_form") else { return };
    let arrays = test_bake::furnace(3);
    let options = RelighterOptions { bounces: 4, ..SINGLE };
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), options).unwrap();
    let texels = SurfaceTexels {
        size: 8,
        index: (0..64).collect(),
        albedo: vec![Vec3::splat(0.5); 64],
        emission: vec![Vec3::new(1.0, 2.0, 3.0); 64],
        direct: vec![Vec3::ZERO; 64],
    };
    gpu.set_surface(&texels).unwrap();
    for _ in 0..8 {
        frame(&mut gpu, &DirectLight::Irradiance);
    }
    assert_eq!(gpu.gathers(), 32);
    // E = pi e / (1/g - a), g the gain of the rounded weights; 32 gathers leave 2^-32 of it.
    let expected = std::f64::consts::PI / (1.0 / test_bake::furnace_gain() - 0.5);
    for irradiance in gpu.read_coefficients().unwrap() {
        let relative = (irradiance.as_dvec3() / glam::DVec3::new(1.0, 2.0, 3.0) / expected - 1.0).abs().max_element();
        // Albedo stored as unorm16: 0.5 is off by 2^-17, twice amplified; SH sums of 1000 rays of the twin's table.
        assert!(relative < 1e-4, "{irradiance}, expected {expected}");
    }
    // After a reset the first frame holds four bounces again, not thirty-six.
    gpu.reset();
    frame(&mut gpu, &DirectLight::Irradiance);
    assert_eq!(gpu.gathers(), 4);
    let after_four = std::f64::consts::PI * (1.0 + 0.5 + 0.25 + 0.125);
    let found = f64::from(gpu.read_coefficients().unwrap()[0].x);
    // The gain of the weights, rounded to f16, four times.
    assert!((found / after_four - 1.0).abs() < 4.0 * 2f64.powi(-11), "{found}, expected {after_four}");
}

#[test]
fn materials_replace_albedo_and_emission() {
    let Some((device, queue)) = device("materials_replace_albedo_and_emission") else { return };
    let arrays = test_bake::random(2, 0, 1);
    let base = surface(8, 5);
    let material: Vec<u32> = base.index.iter().map(|texel| texel % 3).collect();
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    let direct = zeros(&device, "direct", base.len() as u64 * 16);
    gpu.upload_surface(&Surface { material: &material, ..Surface::of_texels(&base) }, direct);
    gpu.set_direct(&base.direct).unwrap();
    let overrides = [
        MaterialOverride { albedo: Some(Vec3::new(0.25, 0.5, 2.0)), emission: None },
        MaterialOverride::default(),
        MaterialOverride { albedo: None, emission: Some(Vec3::new(7.0, 8.0, 9.0)) },
    ];
    for albedo_override in [None, Some(0.5)] {
        gpu.set_materials(&overrides, albedo_override).unwrap();
        gpu.reset();
        frame(&mut gpu, &DirectLight::Irradiance);
        let mut expected = base.clone();
        for (texel, &material) in material.iter().enumerate() {
            let own = overrides[material as usize];
            let albedo = own.albedo.unwrap_or(base.albedo[texel]).clamp(Vec3::ZERO, Vec3::ONE);
            expected.albedo[texel] = albedo_override.map_or(albedo, Vec3::splat);
            expected.emission[texel] = own.emission.unwrap_or(base.emission[texel]);
        }
        let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
        cpu.step(&RelightInputs::new(&expected)).unwrap();
        assert_passes_agree(&gpu, &cpu, TOLERANCE);
    }
}

#[test]
fn occluders_block_the_same_rays_as_in_the_twin() {
    let Some((device, queue)) = device("occluders_block_the_same_rays_as_in_the_twin") else { return };
    let mut arrays = test_bake::random(3, 0, 1);
    for (probe, record) in arrays.probes.iter_mut().enumerate() {
        record.position = [probe as f32, 0.5 * probe as f32, -0.25 * probe as f32];
    }
    let random = |number: u64, k: u64| counter_uniform(4, number, k) as f32;
    let point = |number, k| 6.0 * Vec3::new(random(number, k), random(number, k + 1), random(number, k + 2)) - 2.0;
    let occluders: Vec<Occluder> = (0..MAX_OCCLUDERS as u64)
        .map(|number| {
            let rotation = glam::Quat::from_euler(glam::EulerRot::XYZ, random(number, 9), random(number, 10), 0.3);
            let shape = match number % 3 {
                0 => OccluderShape::Sphere { center: point(number, 0), radius: 0.4 * random(number, 3) },
                1 => OccluderShape::Box { center: point(number, 0), half_extents: Vec3::new(0.1, 0.2, 0.4), rotation },
                _ => OccluderShape::Capsule { a: point(number, 0), b: point(number, 3), radius: 0.1 },
            };
            Occluder { shape, radiance: 10.0 * Vec3::new(random(number, 6), random(number, 7), random(number, 8)) }
        })
        .collect();
    let surface = surface(8, 5);
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    gpu.set_surface(&surface).unwrap();
    let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
    let mut without = Vec::new();
    for occluders in [&[][..], &occluders[..3], &occluders] {
        gpu.set_occluders(occluders).unwrap();
        gpu.reset();
        frame(&mut gpu, &DirectLight::Irradiance);
        cpu.relight(&RelightInputs { occluders, ..RelightInputs::new(&surface) }).unwrap();
        // A ray that grazes an occluder may pass on one side and not on the other: of 1000 rays one changes a probe by
        // a thousandth. None does here.
        assert_passes_agree(&gpu, &cpu, TOLERANCE);
        if occluders.is_empty() {
            without = cpu.probe_radiance().to_vec();
        } else {
            let difference = relative_rms(cpu.probe_radiance(), &without);
            assert!(difference > 0.05, "{} occluders change probes by {difference}", occluders.len());
        }
    }
    let too_many = [occluders.clone(), occluders].concat();
    assert!(matches!(gpu.set_occluders(&too_many), Err(RelightError::Occluders { .. })));
    arrays.ray_distance.clear();
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    assert!(matches!(gpu.set_occluders(&too_many[..1]), Err(RelightError::Occluders { .. })));
}

#[test]
fn a_map_of_the_host_takes_the_place_of_the_direct_light_map() {
    let Some((device, queue)) = device("a_map_of_the_host_takes_the_place_of_the_direct_light_map") else { return };
    let arrays = test_bake::random(2, 0, 1);
    let surface = surface(8, 5);
    let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
    cpu.step(&RelightInputs::new(&surface)).unwrap();
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    let map = |size: u32| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    };
    let host_map = map(8);
    queue.write_texture(
        host_map.as_image_copy(),
        bytemuck::cast_slice(cpu.light_map()[0].texels()),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(8 * 16), rows_per_image: Some(8) },
        host_map.size(),
    );
    frame(&mut gpu, &DirectLight::Texture(&host_map.create_view(&Default::default())));
    assert_passes_agree(&gpu, &cpu, TOLERANCE);

    // Texels of the host's map that the surface does not cover are gone afterwards.
    gpu.set_surface(&SurfaceTexels {
        index: vec![9],
        albedo: vec![Vec3::ONE],
        emission: vec![Vec3::ONE],
        direct: vec![Vec3::ONE],
        size: 8,
    })
    .unwrap();
    frame(&mut gpu, &DirectLight::Irradiance);
    let (_, texels) = map_texels(&gpu, gpu.light_map(), 0);
    assert_eq!(texels.iter().filter(|texel| texel.w > 0.0).count(), 1);

    let mut encoder = device.create_command_encoder(&Default::default());
    let wrong = map(16).create_view(&Default::default());
    let refused = gpu.encode(&mut encoder, &DirectLight::Texture(&wrong));
    assert!(matches!(refused, Err(RelightError::MapSize { expected: 8, found: 16 })));
}

#[test]
fn the_same_frame_has_the_same_bits() {
    let Some((device, queue)) = device("the_same_frame_has_the_same_bits") else { return };
    let arrays = repeated(50);
    let surface = surface(8, 5);
    let run = || {
        let mut gpu = Relighter::new(&device, &queue, arrays.view(), RelighterOptions::default()).unwrap();
        gpu.set_surface(&surface).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        frame(&mut gpu, &DirectLight::Irradiance);
        gpu.read_coefficients().unwrap()
    };
    assert_eq!(run(), run());
}

#[test]
fn passes_are_timed_and_memory_is_told() {
    let Some((device, queue)) = device("passes_are_timed_and_memory_is_told") else { return };
    let arrays = repeated(50);
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), RelighterOptions { bounces: 2, ..SINGLE }).unwrap();
    gpu.set_surface(&surface(8, 5)).unwrap();
    frame(&mut gpu, &DirectLight::Irradiance);
    if device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        let times = gpu.wait_for_pass_times().expect("times of the frame");
        let names: Vec<_> = times.iter().map(|time| (time.name, time.runs)).collect();
        // The first frame after a reset writes the empty map as well.
        let twice =
            ["direct_lightmap", "lightmap_mips", "probe_relight", "cluster_projection", "receiver_reconstruction"];
        assert_eq!(names[0], ("gutter_dilation", 3));
        assert_eq!(names[1..], twice.map(|name| (name, 2)));
        assert!(times.iter().all(|time| time.milliseconds >= 0.0 && time.milliseconds < 1e4), "{times:?}");
        // The next frame is timed anew.
        frame(&mut gpu, &DirectLight::Irradiance);
        assert_eq!(gpu.wait_for_pass_times().expect("times of the next frame").len(), 6);
    }
    let memory = gpu.memory();
    let bytes = |name| memory.iter().find(|(found, _)| *found == name).expect("named").1;
    assert_eq!(bytes("projection"), arrays.projection.len() as u64 * 2);
    assert_eq!(bytes("probe radiance"), 5 * 16 * 16);
}

#[test]
fn files_without_receivers_clusters_or_probes_are_dark_and_no_error() {
    let Some((device, queue)) = device("files_without_receivers_clusters_or_probes_are_dark_and_no_error") else {
        return;
    };
    let mut empty = BakedArrays::default();
    (empty.metadata.lightmap_size, empty.metadata.direct_size) = (1, 8);
    let mut without_clusters = test_bake::random(2, 1, 1);
    without_clusters.clusters.clear();
    let mut without_cells = test_bake::furnace_volume(0, 1);
    let volume = without_cells.volume.as_mut().expect("a volume");
    volume.cells.clear();
    volume.fill.clear();
    volume.clusters.clear();
    for arrays in [empty, without_clusters, without_cells] {
        let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
        gpu.set_surface(&SurfaceTexels { size: arrays.metadata.direct_size, ..SurfaceTexels::default() }).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        assert!(gpu.read_coefficients().unwrap().iter().all(|value| *value == Vec3::ZERO));
    }
}

#[test]
fn a_texel_too_bright_for_its_map_stays_finite() {
    let Some((device, queue)) = device("a_texel_too_bright_for_its_map_stays_finite") else { return };
    let arrays = test_bake::random(3, 0, 1);
    for light_map in [MapPrecision::Half, MapPrecision::Single] {
        let mut gpu = Relighter::new(&device, &queue, arrays.view(), RelighterOptions { light_map, ..SINGLE }).unwrap();
        let mut surface = surface(8, 5);
        surface.emission[7] = Vec3::splat(1e37);
        gpu.set_surface(&surface).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        frame(&mut gpu, &DirectLight::Irradiance);
        assert!(gpu.read_coefficients().unwrap().iter().all(|value| value.is_finite()));
    }
}

#[test]
fn inputs_that_do_not_fit_are_refused() {
    let Some((device, queue)) = device("inputs_that_do_not_fit_are_refused") else { return };
    let arrays = test_bake::random(2, 0, 1);
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    assert!(matches!(gpu.set_surface(&surface(4, 5)), Err(RelightError::MapSize { expected: 8, found: 4 })));
    assert!(matches!(gpu.set_direct(&[Vec3::ONE]), Err(RelightError::Length { .. })));
    assert!(matches!(gpu.set_sky(&[Vec3::ONE], &[]), Err(RelightError::Length { .. })));
    assert!(matches!(gpu.set_sky(&[Vec3::NAN; 4], &[]), Err(RelightError::NotFinite { index: 0, .. })));
    let cap = RelighterOptions { feedback_albedo_cap: 1.5, ..SINGLE };
    assert!(matches!(Relighter::new(&device, &queue, arrays.view(), cap), Err(RelightError::AlbedoCap { .. })));
}

/// A floor of 8 x 8 texels, 4 metres wide, with a roof of one triangle over one corner.
fn lit_floor() -> (SceneTexels, ShadowCasters) {
    let place = |texel: u32| Vec3::new((texel % 8) as f32 / 2.0 - 1.75, 0.0, (texel / 8) as f32 / 2.0 - 1.75);
    let n = 64;
    let texels = SceneTexels {
        size: 8,
        index: (0..64).collect(),
        position: (0..64).map(place).collect(),
        normal: vec![Vec3::Y; n],
        geometric_normal: vec![Vec3::Y; n],
        albedo: vec![Vec3::splat(0.5); n],
        emission: vec![Vec3::ZERO; n],
        material: vec![0; n],
    };
    let casters = ShadowCasters {
        positions: vec![Vec3::new(-6.0, 1.0, -6.0), Vec3::new(-6.0, 1.0, 6.3), Vec3::new(6.3, 1.0, -6.0)],
        triangles: vec![[0, 1, 2]],
        masks: None,
    };
    (texels, casters)
}

#[test]
fn lights_shine_through_shadow_maps_into_the_probes() {
    let Some((device, queue)) = device("lights_shine_through_shadow_maps_into_the_probes") else { return };
    let arrays = test_bake::random(2, 0, 1);
    let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
    let mut encoder = device.create_command_encoder(&Default::default());
    assert_eq!(gpu.encode(&mut encoder, &DirectLight::Lights), Err(RelightError::NoScene));

    let (texels, casters) = lit_floor();
    gpu.set_scene(&texels, &casters).unwrap();
    let sun = Light {
        name: String::new(),
        kind: localprt_scenes::LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::NEG_Y,
        color: Vec3::new(1.0, 0.5, 0.25),
        intensity: 8.0,
        range: None,
    };
    let lamp = Light { kind: localprt_scenes::LightKind::Point, position: Vec3::new(1.0, 2.0, 1.0), ..sun.clone() };
    // Lights on, changed, off.
    for lights in [vec![sun.clone()], vec![sun, lamp], vec![]] {
        gpu.set_lights(&lights);
        gpu.reset();
        frame(&mut gpu, &DirectLight::Lights);
        let direct = crate::passes::direct_irradiance::direct_irradiance(&texels, &casters, &lights, 256);
        let n_shadowed = direct.iter().filter(|value| **value == Vec3::ZERO).count();
        let expected = if lights.len() == 1 {
            8..60
        } else if lights.is_empty() {
            64..65
        } else {
            0..60
        };
        assert!(expected.contains(&n_shadowed), "{n_shadowed} texels in shadow of {} lights", lights.len());
        let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
        cpu.step(&RelightInputs::new(&texels.shaded(&[], None, direct))).unwrap();
        if lights.is_empty() {
            assert!(gpu.read_coefficients().unwrap().iter().all(|value| *value == Vec3::ZERO));
        } else {
            // Shadow edges of the two rasterizers agree here: no texel center lies on one.
            assert_passes_agree(&gpu, &cpu, 1e-4);
        }
    }
    // Unchanged lights are not drawn again.
    if device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        gpu.wait_for_pass_times();
        frame(&mut gpu, &DirectLight::Lights);
        let times = gpu.wait_for_pass_times().expect("times");
        assert!(times.iter().all(|time| time.name != "shadow_map"), "{times:?}");
    }
}

#[test]
fn the_volume_equals_its_twin_in_buffers_and_textures() {
    let Some((device, queue)) = device("the_volume_equals_its_twin_in_buffers_and_textures") else { return };
    for (degree, dims) in [(1, [2, 2, 2]), (1, [4, 2, 1]), (2, [1, 4, 2])] {
        let mut arrays = test_bake::furnace_volume(2, degree);
        arrays.volume.as_mut().expect("a volume").grid.dims = dims;
        let mut gpu = Relighter::new(&device, &queue, arrays.view(), SINGLE).unwrap();
        let mut cpu = CpuRelighter::new(arrays.view()).unwrap();
        let surface = surface(arrays.metadata.direct_size, 5);
        gpu.set_surface(&surface).unwrap();
        let inputs = RelightInputs::new(&surface);
        cpu.step(&inputs).unwrap();
        cpu.step(&inputs).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        frame(&mut gpu, &DirectLight::Irradiance);
        let cells = cpu.volume().expect("a volume");
        let baked = CheckedBake::new(arrays.view()).unwrap();
        let volume = baked.volume().expect("a volume");
        let n_k = volume.n_k();
        let of_receivers: Vec<Vec3> =
            volume.view().cells.iter().flat_map(|&cell| cells[cell as usize * n_k..][..n_k].iter().copied()).collect();
        assert_close("volume coefficients", &gpu.read_volume().unwrap(), &of_receivers, TOLERANCE);

        let textures = gpu.volume().expect("a volume");
        assert_eq!((textures.grid, textures.coefficients.len()), (volume.grid(), n_k));
        for (k, texture) in gpu.volume.as_ref().unwrap().textures.iter().enumerate() {
            let (_, texels) = map_texels(&gpu, texture, 0);
            assert_eq!(texels.len(), volume.n_cells());
            for (cell, texel) in texels.iter().enumerate() {
                let weight = match volume.validity()[cell] {
                    crate::Validity::Empty => 0.0,
                    crate::Validity::Filled => 1.0 / 8.0,
                    crate::Validity::Valid => 1.0,
                };
                assert_eq!(texel.w, weight, "cell {cell}");
                let expected = cells[cell * n_k + k] * weight;
                // f16, cut off at worst.
                let allowed = expected.abs() * 2f32.powi(-10) + 1e-6;
                assert!(
                    (texel.truncate() - expected).abs().cmple(allowed).all(),
                    "cell {cell}, {k}: {texel}, {expected}"
                );
            }
        }
    }
}
