//! What pictures with known pixels start from: a device, and a file without light.

use half::f16;
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, Metadata, Probe, TransportBlock, directions::spherical_fibonacci,
};
use localprt_runtime::gpu::headless;

/// A device, or `None` with a line that says so; a failure if `REQUIRE_GPU` is set.
pub fn device(test: &str) -> Option<(wgpu::Device, wgpu::Queue)> {
    match pollster::block_on(headless()) {
        Ok(found) => Some(found),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some() => panic!("{test}: {error}"),
        Err(error) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
    }
}

/// Transport to one receiver: its output is this row times the radiance of the first `n_probes` probes and of the sky.
pub fn one_receiver(n_probes: u32, n_sky: u32, row: &[f32]) -> BlockArrays {
    let row: Vec<f16> = row.iter().map(|&value| f16::from_f32(value)).collect();
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 1, n_probes, n_sky, n_coefficients: 1 };
    block.push(record, &(0..n_probes).collect::<Vec<_>>(), &row, &[f16::ONE]);
    BlockArrays::of_one(&block, &[[0.0; 3]], 1)
}

/// A file whose transport is zero.
pub fn dark_file() -> BakedArrays {
    let n_rays = 64;
    BakedArrays {
        metadata: Metadata { lightmap_size: 1, direct_size: 1, n_rays, ..Metadata::default() },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }],
        ray_dirs: (0..n_rays).map(|i| spherical_fibonacci(i, n_rays)).map(|[x, y, z]| [x, y, z, 0.0]).collect(),
        ray_sh: vec![0.0; 64],
        ray_uv: vec![0x8000_8000; 64],
        ray_level: vec![0; 64],
        receiver_texel: vec![0],
        receiver_position: vec![[0.0; 3]],
        receiver_normal: vec![[0.0, 1.0, 0.0]],
        receiver_unseen: vec![0.0],
        blocks: one_receiver(1, 0, &[0.0]),
        ..BakedArrays::default()
    }
}
