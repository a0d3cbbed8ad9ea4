//! Times the CPU passes on a synthetic bake of the size of the paper's Sponza.
//!
//! Usage: `cargo run --release --example cpu_timing`. Milliseconds, best and median of ten runs.

use glam::Vec3;
use half::f16;
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_formats::{BakedArrays, ClusterRecord, Metadata, Probe, sh::Basis};
use localprt_runtime::passes::{
    cluster_projection::cluster_projection,
    direct_lightmap::direct_lightmap,
    gutter_dilation::gutter_dilation,
    lightmap_mips::{level_sizes, lightmap_mips},
    probe_relight::probe_relight,
    receiver_reconstruction::{receiver_irradiance, receiver_reconstruction},
};
use localprt_runtime::{CheckedBake, CoverageMap, RelightError, SurfaceTexels};
use std::time::Instant;

const N_PROBES: u32 = 150;
const N_RAYS: u32 = 8000;
const N_CLUSTERS: u32 = 1000;
const N_COEFFICIENTS: u32 = 25;
const PROBES_PER_CLUSTER: u32 = 20;
const RECEIVERS_PER_CLUSTER: u32 = 250;
const LIGHTMAP_SIZE: u32 = 1216;
const DIRECT_SIZE: u32 = 2048;
/// Share of the lightmap that is covered, as in the paper's table 1 (246 325 receivers of 1216^2).
const COVERED: f64 = 0.167;
const RUNS: usize = 10;

fn main() -> Result<(), RelightError> {
    let surface = synthetic_surface();
    let arrays = synthetic_bake(&surface);
    let baked = CheckedBake::new(arrays.view())?;
    surface.check(DIRECT_SIZE)?;
    let mut light_map: Vec<_> = level_sizes(DIRECT_SIZE).into_iter().map(CoverageMap::uncovered).collect();
    let mut probe_radiance = vec![Vec3::ZERO; baked.n_probes() * baked.n_sh()];
    let mut cluster_lights = vec![Vec3::ZERO; baked.n_cluster_lights()];
    let mut coefficients = vec![Vec3::ZERO; baked.n_receivers()];
    let mut irradiance = vec![Vec3::ZERO; baked.n_receivers()];
    let mut map = CoverageMap::uncovered(LIGHTMAP_SIZE);

    println!("{} threads, {} covered texels", rayon::current_num_threads(), surface.len());
    time("check of the inputs", || {
        let _ = surface.check(DIRECT_SIZE);
    });
    time("direct_lightmap", || direct_lightmap(&surface, Some(&map), 0.95, &mut light_map[0]));
    time("lightmap_mips", || lightmap_mips(&mut light_map));
    time("probe_relight", || probe_relight(&baked, &light_map, &[], &[], &mut probe_radiance));
    time("cluster_projection", || cluster_projection(baked.transport(), &probe_radiance, &[], &mut cluster_lights));
    time("receiver_reconstruction", || {
        receiver_reconstruction(baked.transport(), &cluster_lights, &mut coefficients);
        receiver_irradiance(&baked, &coefficients, &mut irradiance);
    });
    time("gutter_dilation", || gutter_dilation(&baked, &irradiance, &mut map));
    Ok(())
}

fn time(name: &str, mut pass: impl FnMut()) {
    let mut milliseconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            pass();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    milliseconds.sort_by(f64::total_cmp);
    println!("{name:<24} best {:8.2} ms, median {:8.2} ms", milliseconds[0], milliseconds[RUNS / 2]);
}

fn synthetic_bake(surface: &SurfaceTexels) -> BakedArrays {
    let random = |stream, i: u64| counter_uniform(1, stream, i);
    let mut arrays = BakedArrays {
        metadata: Metadata {
            lightmap_size: LIGHTMAP_SIZE,
            direct_size: DIRECT_SIZE,
            probe_degree: 7,
            n_rays: N_RAYS,
            ..Metadata::default()
        },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }; N_PROBES as usize],
        ..BakedArrays::default()
    };
    let n_sh = arrays.metadata.n_sh();
    let basis = Basis::new(7);
    let mut values = vec![0.0; n_sh];
    for ray in 0..N_RAYS {
        let [x, y, z] = spherical_fibonacci(ray, N_RAYS);
        basis.evaluate([x, y, z], &mut values);
        arrays.ray_dirs.push([x, y, z, 0.0]);
        arrays.ray_sh.extend(values.iter().map(|value| value * 4.0 * std::f32::consts::PI / N_RAYS as f32));
    }
    let n_hits = u64::from(N_PROBES * N_RAYS);
    // Hits anywhere on covered texels, levels 0 to 5: worse for caches than a real scene, where rays of one probe meet
    // near surfaces.
    let hit = |i| surface.index[(random(0, i) * surface.len() as f64) as usize];
    let unorm16 = |texel: u32| ((2 * texel + 1) * 65535) / (2 * DIRECT_SIZE);
    let pack = |index: u32| unorm16(index % DIRECT_SIZE) | unorm16(index / DIRECT_SIZE) << 16;
    arrays.ray_uv = (0..n_hits).map(|i| pack(hit(i))).collect();
    arrays.ray_level = (0..n_hits).map(|i| (random(1, i) * 6.0) as u8).collect();
    let n_projection = N_COEFFICIENTS * PROBES_PER_CLUSTER * n_sh as u32;
    let n_reconstruction = N_COEFFICIENTS * RECEIVERS_PER_CLUSTER;
    for cluster in 0..N_CLUSTERS {
        arrays.clusters.push(ClusterRecord {
            first_receiver: cluster * RECEIVERS_PER_CLUSTER,
            n_receivers: RECEIVERS_PER_CLUSTER,
            first_probe: cluster * PROBES_PER_CLUSTER,
            n_probes: PROBES_PER_CLUSTER,
            n_coefficients: N_COEFFICIENTS,
            first_light: cluster * N_COEFFICIENTS,
            projection_pair: cluster * n_projection / 2,
            reconstruction_pair: cluster * n_reconstruction / 2,
            ..ClusterRecord::default()
        });
        let first = (cluster * 7) % (N_PROBES - PROBES_PER_CLUSTER);
        arrays.cluster_probes.extend(first..first + PROBES_PER_CLUSTER);
    }
    let weight = |stream, i| f16::from_f64(random(stream, i) - 0.5);
    arrays.projection = (0..u64::from(N_CLUSTERS * n_projection)).map(|i| weight(2, i)).collect();
    arrays.reconstruction = (0..u64::from(N_CLUSTERS * n_reconstruction)).map(|i| weight(3, i)).collect();
    let n_receivers = N_CLUSTERS * RECEIVERS_PER_CLUSTER;
    // Every fifth texel: 1.25 of 1.48 million.
    arrays.receiver_texel = (0..n_receivers).map(|receiver| receiver * 5).collect();
    arrays.receiver_normal = vec![[0.0, 1.0, 0.0]; n_receivers as usize];
    arrays.gutters = (0..n_receivers / 4).map(|i| [i * 5 + 1, i]).collect();
    arrays
}

fn synthetic_surface() -> SurfaceTexels {
    // Whole charts of 32 x 32 texels are covered or not.
    let covered = |index: &u32| {
        let (x, y) = (index % DIRECT_SIZE / 32, index / DIRECT_SIZE / 32);
        counter_uniform(2, u64::from(y), u64::from(x)) < COVERED
    };
    let index: Vec<u32> = (0..DIRECT_SIZE * DIRECT_SIZE).filter(covered).collect();
    let n = index.len();
    SurfaceTexels {
        size: DIRECT_SIZE,
        index,
        albedo: vec![Vec3::splat(0.5); n],
        emission: vec![Vec3::ZERO; n],
        direct: vec![Vec3::ONE; n],
    }
}
