//! The GPU against the twins. Without a Vulkan adapter these tests say so and pass, unless `REQUIRE_GPU=1` is set.

use crate::scenes::{TestScene, box_below_a_screen, light, lights, masked_sheets};
use glam::Vec3;
use localprt_runtime::passes::direct_irradiance::{
    DirectOptions, DirectPass, DirectTimestamps, add_light, direct_irradiance,
};
use localprt_runtime::passes::shadow_map::{ShadowMap, shadow_map, shadow_views};
use localprt_runtime::{SceneTexels, ShadowCasters};
use localprt_scenes::{Light, LightKind};

struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Gpu {
    /// A device with these limits, `None` where there is no adapter.
    fn new(test: &str, limits: wgpu::Limits, features: wgpu::Features) -> Option<Self> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let Ok(adapter) = pollster::block_on(instance.request_adapter(&Default::default())) else {
            assert!(std::env::var_os("REQUIRE_GPU").is_none_or(|value| value != "1"), "no Vulkan adapter");
            println!("SKIPPED {test}: no Vulkan adapter");
            return None;
        };
        let required_features = features & adapter.features();
        let descriptor = wgpu::DeviceDescriptor { required_features, required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("a device");
        Some(Self { device, queue })
    }

    fn pass(&self, scene: &TestScene, shadow_map_size: u32, shadow_layers: u32) -> DirectPass {
        let mut pass = DirectPass::new(&self.device, &DirectOptions { shadow_map_size, shadow_layers });
        pass.set_scene(&self.device, &scene.texels, &scene.casters).unwrap();
        pass
    }

    fn irradiance(&self, pass: &mut DirectPass, scene: &TestScene, lights: &[Light]) -> Vec<Vec3> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        pass.encode(&self.device, &self.queue, &mut encoder, lights, DirectTimestamps::default());
        let size = pass.irradiance_buffer().size();
        let copy = self.readable(size);
        encoder.copy_buffer_to_buffer(pass.irradiance_buffer(), 0, &copy, 0, size);
        self.queue.submit([encoder.finish()]);
        let values = self.read(&copy);
        assert_eq!(values.len(), 4 * scene.texels.len().max(1));
        values.chunks_exact(4).map(|value| Vec3::new(value[0], value[1], value[2])).collect()
    }

    /// The layers of the last batch.
    fn shadow_maps(&self, pass: &DirectPass) -> Vec<ShadowMap> {
        let texture = pass.shadow_maps();
        let size = texture.width();
        assert_eq!(size % 64, 0, "rows of copies are multiples of 256 bytes");
        let copy = self.readable(u64::from(size * size * texture.depth_or_array_layers()) * 4);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &copy,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(size * 4),
                    rows_per_image: Some(size),
                },
            },
            texture.size(),
        );
        self.queue.submit([encoder.finish()]);
        let depths = self.read(&copy);
        let layers = depths.chunks_exact((size * size) as usize);
        layers.map(|depth| ShadowMap { size, depth: depth.to_vec() }).collect()
    }

    fn readable(&self, size: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("test.copy"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    fn read(&self, buffer: &wgpu::Buffer) -> Vec<f32> {
        buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let bytes = buffer.get_mapped_range(..).unwrap();
        bytes.chunks_exact(4).map(|value| f32::from_le_bytes([value[0], value[1], value[2], value[3]])).collect()
    }
}

/// Root of the mean squared difference over the root of the mean square.
fn relative_rms(found: &[Vec3], expected: &[Vec3]) -> f64 {
    assert!(!expected.is_empty() && found.len() == expected.len());
    let squares = |difference: &dyn Fn(usize) -> Vec3| -> f64 {
        (0..expected.len()).map(|texel| f64::from(difference(texel).length_squared())).sum()
    };
    let whole = squares(&|texel| expected[texel]);
    assert!(whole > 0.0, "nothing to compare");
    (squares(&|texel| found[texel] - expected[texel]) / whole).sqrt()
}

/// The default limits of WebGPU are enough.
fn gpu(test: &str) -> Option<Gpu> {
    Gpu::new(test, wgpu::Limits::default(), wgpu::Features::empty())
}

const MAP_SIZE: u32 = 512;
/// Views of [`lights`]: 1, 1, 6, 6.
const N_VIEWS: u32 = 14;

#[test]
fn maps_of_the_gpu_are_those_of_the_twin() {
    let Some(gpu) = gpu("maps_of_the_gpu_are_those_of_the_twin") else { return };
    let scene = box_below_a_screen(32);
    let mut pass = gpu.pass(&scene, MAP_SIZE, N_VIEWS);
    gpu.irradiance(&mut pass, &scene, &lights());
    let bounds = scene.casters.bounds();
    let views: Vec<_> = lights().iter().flat_map(|light| shadow_views(light, &bounds, MAP_SIZE)).collect();
    let maps = gpu.shadow_maps(&pass);
    assert_eq!(maps.len(), views.len());
    let mut n_all_covered = 0;
    for (index, (view, found)) in views.iter().zip(&maps).enumerate() {
        let expected = shadow_map(view, &scene.casters, MAP_SIZE);
        let n_covered = expected.depth.iter().filter(|depth| **depth > 0.0).count();
        n_all_covered += n_covered;
        let width = MAP_SIZE as usize;
        let (mut n_different, mut n_unexplained) = (0, 0);
        for (texel, (&found, &expected_depth)) in found.depth.iter().zip(&expected.depth).enumerate() {
            let (x, y) = (texel % width, texel / width);
            let at = |x: usize, y: usize| expected.depth[y.min(width - 1) * width + x.min(width - 1)];
            let neighbors = [at(x + 1, y), at(x.saturating_sub(1), y), at(x, y + 1), at(x, y.saturating_sub(1))];
            let steps = neighbors.map(|depth| (depth - expected_depth).abs());
            // Rasterizers may snap corners to 1 / 256 texel before they interpolate, which moves a surface by up to
            // half of that in x and y, and so its depth by that part of its change to the next texel. And f32
            // planes over 512 texels: 512 * 2^-24 = 3e-5 of that change, less than 1 / 256.
            let slope = steps.iter().copied().fold(0.0, f32::max);
            if (found - expected_depth).abs() <= 1e-6 * expected_depth + slope / 128.0 {
                continue;
            }
            n_different += 1;
            // An edge may pass on the other side of a texel's center: it then has a neighbor's surface.
            let of_neighbor = |(depth, step): (&f32, &f32)| (depth - found).abs() <= 0.1 * step;
            n_unexplained += usize::from(!neighbors.iter().zip(&steps).any(of_neighbor));
        }
        let share = n_different as f64 / n_covered.max(1) as f64;
        println!(
            "view {index}: {n_different} of {n_covered} covered texels differ ({share:.1e}), {n_unexplained} unexplained"
        );
        assert_eq!(n_unexplained, 0, "view {index}");
        // Seen: 3 of 153280. A center is within 1 / 256 texel of an edge once in 128 texels of silhouette.
        assert!(n_different * 2000 <= n_covered, "view {index}: {n_different} of {n_covered}");
    }
    assert!(n_all_covered > 100_000, "{n_all_covered}");
}

#[test]
fn masks_of_the_gpu_are_those_of_the_twin() {
    let test = "masks_of_the_gpu_are_those_of_the_twin";
    // One image to a page.
    let small = wgpu::Limits { max_storage_buffer_binding_size: 1 << 16, ..wgpu::Limits::default() };
    let (Some(large), Some(small)) = (gpu(test), Gpu::new(test, small, wgpu::Features::empty())) else { return };
    let scene = masked_sheets();
    let kind = LightKind::Spot { inner_cone: 0.0, outer_cone: 0.8 };
    let light = Light { position: Vec3::ZERO, direction: Vec3::NEG_Z, ..light(kind) };
    let view = shadow_views(&light, &scene.casters.bounds(), MAP_SIZE)[0];
    let expected = shadow_map(&view, &scene.casters, MAP_SIZE);
    let solid = shadow_map(&view, &ShadowCasters { masks: None, ..scene.casters.clone() }, MAP_SIZE);
    let covered = |map: &ShadowMap| map.depth.iter().filter(|depth| **depth > 0.0).count();
    assert!(covered(&expected) * 4 > covered(&solid) && covered(&expected) * 4 < covered(&solid) * 3);
    for gpu in [large, small] {
        let mut pass = gpu.pass(&scene, MAP_SIZE, 6);
        gpu.irradiance(&mut pass, &scene, std::slice::from_ref(&light));
        let found = &gpu.shadow_maps(&pass)[0];
        let pairs = || found.depth.iter().zip(&expected.depth);
        let n_different = pairs().filter(|(found, expected)| (**found > 0.0) != (**expected > 0.0)).count();
        println!("{n_different} of {} covered texels differ", covered(&solid));
        // Coordinates differ by roundings, and by 1 / 256 texel where corners are snapped before interpolation; borders of
        // holes pass within that of a texel's center once in 128 of their texels.
        assert!(n_different * 1000 <= covered(&solid), "{n_different} of {}", covered(&solid));
    }
}

#[test]
fn irradiance_from_the_same_maps_is_that_of_the_twin() {
    let Some(gpu) = gpu("irradiance_from_the_same_maps_is_that_of_the_twin") else { return };
    let scene = box_below_a_screen(64);
    let mut pass = gpu.pass(&scene, MAP_SIZE, N_VIEWS);
    let bounds = scene.casters.bounds();
    for light in lights() {
        let found = gpu.irradiance(&mut pass, &scene, std::slice::from_ref(&light));
        let views = shadow_views(&light, &bounds, MAP_SIZE);
        let mut expected = vec![Vec3::ZERO; scene.texels.len()];
        let maps = gpu.shadow_maps(&pass);
        add_light(&scene.texels, &bounds, &light, &views, &maps[..views.len()], &mut expected);
        let error = relative_rms(&found, &expected);
        println!("{:?}: relative RMS {error:.1e}", light.kind);
        // Places on a map are rounded to about 4 * 2^-24 * 512 = 1e-4 texels, which is the error of a weight between
        // light and shadow; of all texels less than a tenth lies there.
        assert!(error <= 1e-4, "{:?}: {error}", light.kind);
    }
}

#[test]
fn means_over_samples_are_those_of_the_twin() {
    let Some(gpu) = gpu("means_over_samples_are_those_of_the_twin") else { return };
    let mut scene = box_below_a_screen(64);
    scene.scatter_samples();
    let mut pass = gpu.pass(&scene, 64, N_VIEWS);
    let bounds = scene.casters.bounds();
    for light in lights() {
        let found = gpu.irradiance(&mut pass, &scene, std::slice::from_ref(&light));
        let views = shadow_views(&light, &bounds, 64);
        let mut expected = vec![Vec3::ZERO; scene.texels.len()];
        let maps = gpu.shadow_maps(&pass);
        add_light(&scene.texels, &bounds, &light, &views, &maps[..views.len()], &mut expected);
        let error = relative_rms(&found, &expected);
        println!("{:?}: relative RMS {error:.1e}", light.kind);
        // Places on a map are rounded to about 4 * 2^-24 * 64 = 1.5e-5 texels, at edges alone.
        assert!(error <= 1e-5, "{:?}: {error}", light.kind);
        // The texels' own points would have another light.
        let mut own = vec![Vec3::ZERO; expected.len()];
        let points = SceneTexels { sample_end: Vec::new(), samples: Vec::new(), ..scene.texels.clone() };
        add_light(&points, &bounds, &light, &views, &maps[..views.len()], &mut own);
        assert!(relative_rms(&own, &expected) > 0.01);
    }
}

#[test]
fn irradiance_is_that_of_the_twin_but_for_edges() {
    let Some(gpu) = gpu("irradiance_is_that_of_the_twin_but_for_edges") else { return };
    let scene = box_below_a_screen(64);
    let found = gpu.irradiance(&mut gpu.pass(&scene, MAP_SIZE, 6), &scene, &lights());
    let expected = direct_irradiance(&scene.texels, &scene.casters, &lights(), MAP_SIZE);
    let differs = |&texel: &usize| (found[texel] - expected[texel]).length() > 1e-3 * expected[texel].length();
    let n_different = (0..expected.len()).filter(differs).count();
    println!("{n_different} of {} differ, relative RMS {:.1e}", expected.len(), relative_rms(&found, &expected));
    assert!(n_different * 200 <= expected.len(), "{n_different} of {}", expected.len());
}

#[test]
fn neither_batches_nor_pages_change_anything() {
    let test = "neither_batches_nor_pages_change_anything";
    let small = wgpu::Limits {
        // 1638 texels to a page, or 1024 with four samples.
        max_storage_buffer_binding_size: 1 << 16,
        // Rows of 7 * 64 texels.
        max_compute_workgroups_per_dimension: 7,
        ..wgpu::Limits::default()
    };
    let (Some(gpu), Some(small)) = (gpu(test), Gpu::new(test, small, wgpu::Features::empty())) else { return };
    let mut scene = box_below_a_screen(32);
    assert!(scene.texels.len() > 2 * 1638);
    for _ in 0..2 {
        let together = gpu.irradiance(&mut gpu.pass(&scene, 128, N_VIEWS), &scene, &lights());
        assert_eq!(gpu.irradiance(&mut gpu.pass(&scene, 128, 6), &scene, &lights()), together);
        assert_eq!(small.irradiance(&mut small.pass(&scene, 128, 6), &scene, &lights()), together);
        scene.texels.sample_end.clear();
        scene.texels.samples.clear();
        scene.scatter_samples();
    }
}

#[test]
fn a_pass_can_be_used_again() {
    let Some(gpu) = gpu("a_pass_can_be_used_again") else { return };
    let scene = box_below_a_screen(16);
    let mut pass = gpu.pass(&scene, 128, 6);
    let point = [light(LightKind::Point)];
    let first = gpu.irradiance(&mut pass, &scene, &point);
    // More lights than before, so that buffers grow.
    let many: Vec<Light> = lights().into_iter().cycle().take(40).collect();
    let ten_times = gpu.irradiance(&mut pass, &scene, &many);
    let once = gpu.irradiance(&mut pass, &scene, &lights());
    let expected: Vec<Vec3> = once.iter().map(|e| *e * 10.0).collect();
    // 40 additions of f32.
    assert!(relative_rms(&ten_times, &expected) < 40.0 / 16777216.0);
    assert_eq!(gpu.irradiance(&mut pass, &scene, &point), first);
    for dark in [vec![], vec![Light { intensity: 0.0, ..light(LightKind::Point) }]] {
        assert!(gpu.irradiance(&mut pass, &scene, &dark).iter().all(|e| *e == Vec3::ZERO));
    }
    // Another scene, and none at all.
    let mut floor = TestScene::default();
    floor.quad([Vec3::Z, Vec3::X + Vec3::Z, Vec3::X, Vec3::ZERO], 4);
    pass.set_scene(&gpu.device, &floor.texels, &floor.casters).unwrap();
    assert!(gpu.irradiance(&mut pass, &floor, &point).iter().all(|e| e.x > 0.0));
    let nothing = TestScene::default();
    pass.set_scene(&gpu.device, &nothing.texels, &nothing.casters).unwrap();
    gpu.irradiance(&mut pass, &nothing, &point);
}

#[test]
fn surfaces_without_casters_are_lit() {
    let Some(gpu) = gpu("surfaces_without_casters_are_lit") else { return };
    let mut scene = TestScene::default();
    scene.quad([Vec3::Z, Vec3::X + Vec3::Z, Vec3::X, Vec3::ZERO], 4);
    scene.casters = Default::default();
    let mut lights = lights().to_vec();
    // Below the surface's horizon, but not below that of all shading normals.
    let from_below = Vec3::new(1.0, 0.1, 0.0).normalize();
    lights.push(Light { direction: from_below, ..light(LightKind::Directional) });
    let found = gpu.irradiance(&mut gpu.pass(&scene, 64, 6), &scene, &lights);
    let expected = direct_irradiance(&scene.texels, &scene.casters, &lights, 64);
    // A few roundings of each product.
    assert!(relative_rms(&found, &expected) < 1e-6);
    assert!(found.iter().all(|e| e.x > 0.0));
}

#[test]
fn times_are_written_with_and_without_lights() {
    let test = "times_are_written_with_and_without_lights";
    let Some(gpu) = Gpu::new(test, wgpu::Limits::default(), wgpu::Features::TIMESTAMP_QUERY) else { return };
    if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        println!("SKIPPED {test}: the adapter has no timestamps");
        return;
    }
    let scene = box_below_a_screen(16);
    let mut pass = gpu.pass(&scene, 128, 6);
    for lights in [lights().to_vec(), Vec::new()] {
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("test.times"),
            ty: wgpu::QueryType::Timestamp,
            count: 4,
        });
        let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("test.times"),
            size: 32,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let copy = gpu.readable(32);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let timestamps = DirectTimestamps { shadow_maps: Some((&queries, 0, 1)), irradiance: Some((&queries, 2, 3)) };
        pass.encode(&gpu.device, &gpu.queue, &mut encoder, &lights, timestamps);
        encoder.resolve_query_set(&queries, 0..4, &resolved, 0);
        encoder.copy_buffer_to_buffer(&resolved, 0, &copy, 0, 32);
        gpu.queue.submit([encoder.finish()]);
        let halves: Vec<u64> = gpu.read(&copy).iter().map(|half| u64::from(half.to_bits())).collect();
        let times: Vec<u64> = halves.chunks_exact(2).map(|half| half[0] | half[1] << 32).collect();
        assert!(times[0] > 0 && times[0] <= times[1] && times[2] > 0 && times[2] <= times[3], "{times:?}");
        assert!(lights.is_empty() || times[0] < times[1] && times[2] < times[3], "{times:?}");
    }
}
