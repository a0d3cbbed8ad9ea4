//! What pictures with known pixels start from: a device, and a file without light.

use half::f16;
use localprt_formats::{BakedArrays, ClusterRecord, Metadata, Probe, directions::spherical_fibonacci};
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
        clusters: vec![ClusterRecord { n_receivers: 1, n_probes: 1, n_coefficients: 1, ..Default::default() }],
        cluster_probes: vec![0],
        projection: vec![f16::ZERO; 2],
        reconstruction: vec![f16::ZERO; 2],
        ..BakedArrays::default()
    }
}
