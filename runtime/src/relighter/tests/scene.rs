//! What is set and what is told: repeatability, times, odd files and inputs, lights with shadow maps, the volume.

use super::*;

#[test]
fn the_same_frame_has_the_same_bits() {
    let Some((device, queue)) = device("the_same_frame_has_the_same_bits") else { return };
    let arrays = repeated(50);
    let surface = surface(8, 5);
    let run = || {
        let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), RelighterOptions::default()).unwrap();
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
    let mut gpu =
        Relighter::new(&device, &queue, &arrays.checked().unwrap(), RelighterOptions { bounces: 2, ..SINGLE }).unwrap();
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
        // What is timed and what is counted are the same passes.
        let timed = |(name, _): &(&str, u64)| times.iter().any(|time| time.name == *name);
        assert!(gpu.traffic().iter().all(timed), "{:?}", gpu.traffic());
    }
    let memory = gpu.memory();
    let bytes = |name| memory.iter().find(|(found, _)| *found == name).expect("named").1;
    assert_eq!(bytes("projection"), arrays.blocks.view().total(|block| block.projection_pairs) * 4);
    assert_eq!(bytes("probe radiance"), 5 * 16 * 16);
}

#[test]
fn files_without_receivers_or_probes_are_dark_and_no_error() {
    let Some((device, queue)) = device("files_without_receivers_or_probes_are_dark_and_no_error") else {
        return;
    };
    let empty = test_bake::rays(0, 2, 8, |_| [0.0; 2]);
    let mut without_cells = test_bake::furnace_volume(0, 1);
    let volume = without_cells.volume.as_mut().expect("a volume");
    *volume = VolumeArrays { grid: volume.grid, ..VolumeArrays::default() };
    for arrays in [empty, without_cells] {
        let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
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
        let mut gpu =
            Relighter::new(&device, &queue, &arrays.checked().unwrap(), RelighterOptions { light_map, ..SINGLE })
                .unwrap();
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
    assert!(matches!(gpu.set_surface(&surface(4, 5)), Err(RelightError::MapSize { expected: 8, found: 4 })));
    assert!(matches!(gpu.set_direct(&[Vec3::ONE]), Err(RelightError::Length { .. })));
    assert!(matches!(gpu.set_sky(&[Vec3::ONE], &[]), Err(RelightError::Length { .. })));
    assert!(matches!(gpu.set_sky(&[Vec3::NAN; 4], &[]), Err(RelightError::NotFinite { index: 0, .. })));
    let cap = RelighterOptions { feedback_albedo_cap: 1.5, ..SINGLE };
    assert!(matches!(
        Relighter::new(&device, &queue, &arrays.checked().unwrap(), cap),
        Err(RelightError::AlbedoCap { .. })
    ));
}

/// A floor of 8 x 8 texels, 4 metres wide, with a roof of one triangle over one corner.
fn lit_floor() -> (SceneTexels, ShadowCasters) {
    let place = |texel: u32| Vec3::new((texel % 8) as f32 / 2.0 - 1.75, 0.0, (texel / 8) as f32 / 2.0 - 1.75);
    let n = 64;
    let texels = SceneTexels {
        lightmap_uv: Vec::new(),
        size: 8,
        index: (0..64).collect(),
        position: (0..64).map(place).collect(),
        normal: vec![Vec3::Y; n],
        geometric_normal: vec![Vec3::Y; n],
        albedo: vec![Vec3::splat(0.5); n],
        emission: vec![Vec3::ZERO; n],
        material: vec![0; n],
        ..SceneTexels::default()
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
    let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
    let mut encoder = device.create_command_encoder(&Default::default());
    assert_eq!(gpu.encode(&mut encoder, &DirectLight::Lights), Err(RelightError::NoScene));

    let (texels, casters) = lit_floor();
    gpu.set_texels(&texels, &casters).unwrap();
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
        let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
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
        let volume = arrays.volume.as_mut().expect("a volume");
        let block = volume.blocks.view().to_block(0, volume.grid.n_k()).expect("a block");
        volume.grid.dims = dims;
        *volume = test_bake::volume(volume.grid, volume.cells.clone(), &block, volume.fill.clone());
        let mut gpu = Relighter::new(&device, &queue, &arrays.checked().unwrap(), SINGLE).unwrap();
        let mut cpu = CpuRelighter::new(arrays.checked().unwrap());
        let surface = surface(arrays.metadata.direct_size, 5);
        gpu.set_surface(&surface).unwrap();
        let inputs = RelightInputs::new(&surface);
        cpu.step(&inputs).unwrap();
        cpu.step(&inputs).unwrap();
        frame(&mut gpu, &DirectLight::Irradiance);
        frame(&mut gpu, &DirectLight::Irradiance);
        let cells = cpu.volume().expect("a volume");
        let volume = cpu.volume_cells().expect("a volume");
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
