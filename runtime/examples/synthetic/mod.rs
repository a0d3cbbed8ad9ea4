//! Synthetic bakes of the size of the paper's Sponza and of multiples of it, for the timing examples.

use glam::Vec3;
use half::f16;
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_formats::{BakedArrays, ClusterRecord, Metadata, Probe, TransportBlock, sh::Basis};
use localprt_runtime::SurfaceTexels;

const N_RAYS: u32 = 8000;
pub const LIGHTMAP_SIZE: u32 = 1216;
pub const DIRECT_SIZE: u32 = 2048;
/// Share of the lightmap that is covered, as in the paper's table 1 (246 325 receivers of 1216^2).
const COVERED: f64 = 0.167;

/// What decides how much is read per frame.
#[derive(Clone, Copy)]
pub struct Shape {
    pub n_probes: u32,
    pub n_clusters: u32,
    pub probes_per_cluster: u32,
    pub n_coefficients: u32,
    pub receivers_per_cluster: u32,
    pub lightmap_size: u32,
}

impl Shape {
    /// Table 1 of the paper: Sponza.
    #[allow(dead_code)]
    pub const PAPER: Self = Self {
        n_probes: 150,
        n_clusters: 1000,
        probes_per_cluster: 20,
        n_coefficients: 25,
        receivers_per_cluster: 250,
        lightmap_size: LIGHTMAP_SIZE,
    };
    /// The many small clusters that this program makes of the same scene at the paper's settings.
    #[allow(dead_code)]
    pub const OURS: Self = Self {
        n_probes: 150,
        n_clusters: 14_600,
        probes_per_cluster: 7,
        n_coefficients: 6,
        receivers_per_cluster: 14,
        lightmap_size: LIGHTMAP_SIZE,
    };

    /// So many times as many probes, clusters and receivers.
    #[allow(dead_code)]
    pub fn times(self, factor: u32) -> Self {
        Self {
            n_probes: self.n_probes * factor,
            n_clusters: self.n_clusters * factor,
            lightmap_size: self.lightmap_size * f64::from(factor).sqrt().ceil() as u32,
            ..self
        }
    }
}

/// Random weights and rays of that shape.
pub fn bake(shape: Shape, surface: &SurfaceTexels) -> BakedArrays {
    let random = |stream, i: u64| counter_uniform(1, stream, i);
    let mut arrays = BakedArrays {
        metadata: Metadata {
            lightmap_size: shape.lightmap_size,
            direct_size: DIRECT_SIZE,
            probe_degree: 7,
            n_rays: N_RAYS,
            ..Metadata::default()
        },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }; shape.n_probes as usize],
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
    arrays.ray_distance = Vec::new();
    let n_hits = u64::from(shape.n_probes * N_RAYS);
    // Hits anywhere on covered texels, levels 0 to 5: worse for caches than a real scene, where rays of one probe meet
    // near surfaces.
    let hit = |i| surface.index[(random(0, i) * surface.len() as f64) as usize];
    let unorm16 = |texel: u32| ((2 * texel + 1) * 65535) / (2 * DIRECT_SIZE);
    let pack = |index: u32| unorm16(index % DIRECT_SIZE) | unorm16(index / DIRECT_SIZE) << 16;
    arrays.ray_uv = (0..n_hits).map(|i| pack(hit(i))).collect();
    arrays.ray_level = (0..n_hits).map(|i| (random(1, i) * 6.0) as u8).collect();
    // A block of so many clusters has about as many receivers as a leaf.
    let clusters_per_block = (1000 / shape.receivers_per_cluster).max(1);
    let record = ClusterRecord {
        n_receivers: shape.receivers_per_cluster,
        n_probes: shape.probes_per_cluster,
        n_sky: 0,
        n_coefficients: shape.n_coefficients,
    };
    let n_projection = u64::from(shape.n_coefficients * shape.probes_per_cluster) * n_sh as u64;
    let n_reconstruction = u64::from(shape.n_coefficients * shape.receivers_per_cluster);
    let weights = |stream: u64, cluster: u32, count: u64| -> Vec<f16> {
        (0..count).map(|i| f16::from_f64(random(stream, u64::from(cluster) * count + i) - 0.5)).collect()
    };
    let mut first_cluster = 0;
    while first_cluster < shape.n_clusters {
        let end = shape.n_clusters.min(first_cluster + clusters_per_block);
        let mut block = TransportBlock::default();
        for cluster in first_cluster..end {
            let first = (cluster * 7) % (shape.n_probes - shape.probes_per_cluster);
            let probes: Vec<u32> = (first..first + shape.probes_per_cluster).collect();
            block.push(record, &probes, &weights(2, cluster, n_projection), &weights(3, cluster, n_reconstruction));
        }
        arrays.blocks.push(&block, &vec![[0.0; 3]; block.n_receivers()], 1);
        first_cluster = end;
    }
    let n_receivers = shape.n_clusters * shape.receivers_per_cluster;
    // Every fifth texel: 1.25 of 1.48 million.
    arrays.receiver_texel = (0..n_receivers).map(|receiver| receiver * 5).collect();
    arrays.receiver_normal = vec![[0.0, 1.0, 0.0]; n_receivers as usize];
    arrays.receiver_position = vec![[0.0; 3]; n_receivers as usize];
    arrays.receiver_unseen = vec![0.0; n_receivers as usize];
    arrays.gutters = (0..n_receivers / 4).map(|i| [i * 5 + 1, i]).collect();
    arrays
}

/// A surface that covers as much of the direct light map as Sponza does.
pub fn surface(size: u32) -> SurfaceTexels {
    // Whole charts of 32 x 32 texels are covered or not.
    let covered = |index: &u32| {
        let (x, y) = (index % size / 32, index / size / 32);
        counter_uniform(2, u64::from(y), u64::from(x)) < COVERED
    };
    let index: Vec<u32> = (0..size * size).filter(covered).collect();
    let n = index.len();
    SurfaceTexels {
        lightmap_uv: Vec::new(),
        size,
        index,
        albedo: vec![Vec3::splat(0.5); n],
        emission: vec![Vec3::ZERO; n],
        direct: vec![Vec3::ONE; n],
    }
}
