//! A complete host program without a window: a device, a baked file, frames, and the light in numbers.
//!
//! Usage: `cargo run --release --example headless_frame`. The file is made by hand here, a probe in a closed white box and
//! one receiver; a real one comes from `Baked::open(PATH)`, and its surface texels from the scene it was baked from.

use glam::Vec3;
use half::f16;
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, Metadata, Probe, TransportBlock, directions::spherical_fibonacci,
};
use localprt_runtime::{
    DirectLight, Relighter, RelighterOptions, SceneTexels, ShadowCasters,
    gpu::{headless, readback},
};
use localprt_scenes::MaterialOverride;
use std::f32::consts::PI;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. A renderer has its own device and queue; the limits and features that WebGPU guarantees are enough.
    let (device, queue) = pollster::block_on(headless())?;
    println!("adapter: {}", device.adapter_info().name);

    // 2. The file, once.
    let arrays = white_box();
    let mut gi = Relighter::new(&device, &queue, &arrays.checked()?, RelighterOptions::default())?;

    // 3. The scene, once: what the covered texels of the direct light map show, and what casts shadows.
    let texels = SceneTexels {
        lightmap_uv: Vec::new(),
        size: 1,
        index: vec![0],
        position: vec![Vec3::ZERO],
        normal: vec![Vec3::Y],
        geometric_normal: vec![Vec3::Y],
        albedo: vec![Vec3::splat(0.5)],
        emission: vec![Vec3::ZERO],
        material: vec![0],
        ..SceneTexels::default()
    };
    gi.set_texels(&texels, &ShadowCasters::default())?;

    // 4. Whatever changes, whenever it changes: materials, lights, sky, occluders.
    let glowing = MaterialOverride { albedo: None, emission: Some(Vec3::ONE) };
    gi.set_materials(&[glowing], None)?;
    gi.set_lights(&[]);

    // 5. Every frame: record the passes before whatever samples the irradiance map.
    for _ in 0..20 {
        let mut encoder = device.create_command_encoder(&Default::default());
        gi.encode(&mut encoder, &DirectLight::Lights)?;
        // A renderer draws here: outgoing = albedo / pi * (direct + textureSample(gi.irradiance_view(), TEXCOORD_1)).
        queue.submit([encoder.finish()]);
    }

    // 6. Times and light, for the curious: emission 1 and albedo 0.5 settle at radiance 2, irradiance 2 pi.
    for pass in gi.wait_for_pass_times().unwrap_or_default() {
        println!("{:<24} {:.4} ms", pass.name, pass.milliseconds);
    }
    let texel = readback::texture(&device, &queue, gi.irradiance_view().texture(), 0)?;
    let irradiance = f16::from_le_bytes([texel[0], texel[1]]).to_f32();
    println!("irradiance {irradiance:.3}, expected {:.3}", 2.0 * PI);
    assert!((irradiance / (2.0 * PI) - 1.0).abs() < 0.01);
    Ok(())
}

/// One probe of degree 0 whose 64 rays all see the one texel of the direct light map, and one receiver:
/// E = pi L = pi / sqrt(4 pi) * lambda_00.
fn white_box() -> BakedArrays {
    let n_rays = 64;
    let y_00 = 1.0 / (4.0 * PI).sqrt();
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 1, n_probes: 1, n_sky: 0, n_coefficients: 1 };
    block.push(record, &[0], &[f16::from_f32(PI / (4.0 * PI).sqrt())], &[f16::ONE]);
    BakedArrays {
        metadata: Metadata { lightmap_size: 1, direct_size: 1, n_rays, ..Metadata::default() },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }],
        ray_dirs: (0..n_rays).map(|i| spherical_fibonacci(i, n_rays)).map(|[x, y, z]| [x, y, z, 0.0]).collect(),
        ray_sh: vec![y_00 * 4.0 * PI / n_rays as f32; 64],
        ray_uv: vec![0x8000_8000; 64],
        ray_level: vec![0; 64],
        receiver_texel: vec![0],
        receiver_position: vec![[0.0; 3]],
        receiver_normal: vec![[0.0, 1.0, 0.0]],
        receiver_unseen: vec![0.0],
        blocks: BlockArrays::of_one(&block, &[[0.0; 3]], 1),
        ..BakedArrays::default()
    }
}
