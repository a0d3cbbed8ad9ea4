//! Gathers under all kinds of files, lights and limits, compared with the twins.

use super::*;

#[test]
fn every_pass_equals_its_twin() {
    let Some((device, queue)) = device("every_pass_equals_its_twin") else { return };
    for (probe_degree, receiver_degree, sky_degree) in [(2, 0, 2), (3, 1, 1), (7, 0, 0), (10, 1, 2), (0, 0, 2)] {
        for sky in [false, true] {
            let mut arrays = test_bake::random(probe_degree, receiver_degree, sky_degree);
            for (ray, level) in arrays.ray_level.iter_mut().enumerate() {
                *level = [0, 1, 2, 3, 0, localprt_formats::LEVEL_SKY, localprt_formats::LEVEL_BLACK][ray % 7];
            }
            assert_eq!(assert_chain_agrees(&device, &queue, &arrays, sky), 1);
            assert_eq!(assert_chain_agrees(&device, &queue, &test_bake::with_near(arrays), sky), 1);
        }
    }
}

#[test]
fn maps_of_any_size_equal_their_twins() {
    let Some((device, queue)) = device("maps_of_any_size_equal_their_twins") else { return };
    for direct_size in [1, 2, 4, 16, 64, 128] {
        let mut arrays = test_bake::random(2, 0, 1);
        arrays.metadata.direct_size = direct_size;
        arrays
            .ray_level
            .iter_mut()
            .enumerate()
            .for_each(|(ray, level)| *level = (ray % (direct_size.ilog2() as usize + 1)) as u8);
        assert_chain_agrees(&device, &queue, &test_bake::with_near(arrays), false);
    }
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
    let arrays = test_bake::with_near(repeated(800));
    let n_pages = assert_chain_agrees(&device, &queue, &arrays, true);
    assert!(n_pages > 5, "{n_pages} pages");

    // Too small for a single cluster, or for what is never split: a message instead of a panic.
    let tiny = |adapter: &wgpu::Adapter| wgpu::Limits {
        max_storage_buffer_binding_size: 256,
        ..wgpu::Limits::default().or_worse_values_from(&adapter.limits())
    };
    let Some((device, queue)) = device_with(test, tiny) else { return };
    let refused =
        Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).err().expect("nothing fits into 256 bytes");
    assert!(matches!(refused, RelightError::Limit { .. }), "{refused}");
}

#[test]
fn default_limits_of_webgpu_are_enough() {
    let test = "default_limits_of_webgpu_are_enough";
    let Some((device, queue)) = device_with(test, |_| wgpu::Limits::default()) else { return };
    assert_chain_agrees(&device, &queue, &test_bake::with_near(test_bake::random(7, 1, 4)), true);
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), half).unwrap();
    let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), options).unwrap();
    let texels = SurfaceTexels {
        lightmap_uv: Vec::new(),
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
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
        let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
    gpu.set_surface(&surface).unwrap();
    let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
    assert!(matches!(gpu.set_occluders(&too_many[..1]), Err(RelightError::Occluders { .. })));
}

#[test]
fn a_map_of_the_host_takes_the_place_of_the_direct_light_map() {
    let Some((device, queue)) = device("a_map_of_the_host_takes_the_place_of_the_direct_light_map") else { return };
    let arrays = test_bake::random(2, 0, 1);
    let surface = surface(8, 5);
    let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
    cpu.step(&RelightInputs::new(&surface)).unwrap();
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
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
        lightmap_uv: Vec::new(),
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
