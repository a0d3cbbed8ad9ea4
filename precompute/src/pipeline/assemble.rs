//! Clusters, probes, rays and receivers to the arrays of a file.

use crate::{
    clusters::Cluster,
    error::BakeError,
    lightmap::{LayoutReport, ReceiverSet},
    probes::ProbeSet,
    relight_rays::RelightRays,
    settings::BakeSettings,
};
use half::f16;
use localprt_formats::{BakedArrays, ClusterRecord, Metadata, Probe};
use localprt_scenes::Scene;

/// Clusters as stored.
#[derive(Default)]
pub(super) struct Packed {
    pub(super) clusters: Vec<ClusterRecord>,
    pub(super) cluster_probes: Vec<u32>,
    pub(super) projection: Vec<f16>,
    pub(super) reconstruction: Vec<f16>,
    /// Receivers in stored order.
    pub(super) members: Vec<u32>,
    /// Unseen share of each.
    unseen: Vec<f32>,
}

impl Packed {
    /// # Errors
    /// More values than 32-bit offsets reach; `what` they are, and `remedy` beside a lower degree or a larger threshold.
    pub(super) fn of(clusters: Vec<Cluster>, what: &str, remedy: &str) -> Result<Self, BakeError> {
        let values: usize =
            clusters.iter().map(|cluster| cluster.rows.projection.len() + cluster.rows.reconstruction.len()).sum();
        if u32::try_from(values / 2 + 2 * clusters.len()).is_err() {
            return Err(BakeError::Limit {
                what: what.into(),
                needed: format!("{} GB", values / 500_000_000),
                allowed: "17 GB".into(),
                remedy: format!("use {remedy}, a lower degree or a larger --threshold"),
            });
        }
        let mut packed = Self::default();
        let mut first_light = 0;
        for cluster in clusters {
            packed.clusters.push(ClusterRecord {
                first_receiver: packed.members.len() as u32,
                n_receivers: cluster.members.len() as u32,
                first_probe: packed.cluster_probes.len() as u32,
                n_probes: cluster.probes.len() as u32,
                n_sky: cluster.n_sky as u32,
                n_coefficients: cluster.rows.n_coefficients as u32,
                first_light,
                projection_pair: (packed.projection.len() / 2) as u32,
                reconstruction_pair: (packed.reconstruction.len() / 2) as u32,
                reserved: 0,
            });
            first_light += cluster.rows.n_coefficients as u32;
            packed.cluster_probes.extend_from_slice(&cluster.probes);
            extend_even(&mut packed.projection, &cluster.rows.projection);
            extend_even(&mut packed.reconstruction, &cluster.rows.reconstruction);
            packed.members.extend_from_slice(&cluster.members);
            packed.unseen.extend_from_slice(&cluster.unseen);
        }
        Ok(packed)
    }
}

/// Arrays of the file: receivers in cluster order.
///
/// # Errors
/// More values than 32-bit offsets reach.
pub(super) fn assemble(
    scene: &Scene,
    settings: &BakeSettings,
    layout: &LayoutReport,
    receivers: &ReceiverSet,
    probes: &ProbeSet,
    rays: RelightRays,
    clusters: Vec<Cluster>,
) -> Result<BakedArrays, BakeError> {
    let packed = Packed::of(clusters, "the cluster matrices", "fewer --receivers")?;
    let mut arrays = BakedArrays {
        probes: probes
            .positions
            .iter()
            .map(|position| Probe { position: position.to_array(), support_radius_m: probes.radius_m })
            .collect(),
        ray_dirs: rays.dirs,
        ray_sh: rays.sh,
        ray_uv: rays.uv,
        ray_level: rays.level,
        ray_distance: rays.distance,
        ..BakedArrays::default()
    };
    let mut stored = vec![u32::MAX; receivers.len()];
    for (place, &member) in packed.members.iter().enumerate() {
        let member = member as usize;
        stored[member] = place as u32;
        arrays.receiver_texel.push(receivers.texel[member]);
        arrays.receiver_position.push(receivers.position[member].to_array());
        arrays.receiver_normal.push(receivers.normal[member].to_array());
    }
    arrays.receiver_unseen = packed.unseen;
    arrays.clusters = packed.clusters;
    arrays.cluster_probes = packed.cluster_probes;
    arrays.projection = packed.projection;
    arrays.reconstruction = packed.reconstruction;
    arrays.gutters = receivers.gutters.iter().map(|&(texel, receiver)| [texel, stored[receiver as usize]]).collect();
    arrays.seams = receivers
        .seams
        .iter()
        .map(|&(a, b)| {
            let (a, b) = (stored[a as usize], stored[b as usize]);
            [a.min(b), a.max(b)]
        })
        .collect();
    arrays.seams.sort_unstable();
    let (low, high) = scene.bounds().unwrap_or_default();
    arrays.metadata = Metadata {
        tool_version: env!("CARGO_PKG_VERSION").into(),
        scene_path: String::new(),
        scene_hash: scene.hash,
        lightmap_size: layout.size,
        direct_size: settings.direct_map,
        probe_degree: settings.probe_degree,
        receiver_degree: settings.receiver_degree,
        sky_degree: settings.sky_degree,
        n_rays: settings.relight_rays,
        bounds: [low.to_array(), high.to_array()],
        options: settings.to_toml(),
    };
    Ok(arrays)
}

/// Appends values and a zero if their number is odd, so that every block starts at a pair.
fn extend_even(all: &mut Vec<f16>, block: &[f16]) {
    all.extend_from_slice(block);
    if !all.len().is_multiple_of(2) {
        all.push(f16::ZERO);
    }
}
