//! What the stages did, as the report says it.

use super::leaf::LeafTransport;
use crate::{
    lightmap::{LayoutReport, ReceiverSet},
    probes::{PlacementReport, ProbeSet, Support},
    report::{AtlasFacts, BakeReport, Compression, Overlap, PlacementFacts, SceneFacts, Unseen},
    settings::BakeSettings,
};
use localprt_scenes::Scene;
use localprt_tools::hex;

pub(super) fn scene_facts(scene: &Scene) -> SceneFacts {
    SceneFacts {
        triangles: scene.face_count() as u64,
        materials: scene.materials.len() as u64,
        hash: hex(&scene.hash),
        degenerate: scene.dropped.degenerate as u64,
        duplicate: scene.dropped.duplicate as u64,
    }
}

pub(super) fn atlas_facts(layout: &LayoutReport, receivers: &ReceiverSet, settings: &BakeSettings) -> AtlasFacts {
    AtlasFacts {
        unwrapped: !layout.kept,
        reason: layout.reason.clone(),
        lightmap: layout.size,
        direct_map: settings.direct_map,
        charts: u64::from(layout.charts),
        back_faces: layout.back_faces as u64,
        covered_texels: (receivers.len() + receivers.invalid.len()) as u64,
        pushed_receivers: receivers.pushed as u64,
    }
}

pub(super) fn placement_facts(placement: &PlacementReport) -> PlacementFacts {
    PlacementFacts {
        spacing: placement.spacing_m,
        voxel: placement.voxel_m,
        candidates: placement.candidates as u64,
        rejected: placement.rejected as u64,
        repaired: placement.repaired as u64,
    }
}

pub(super) fn fill_results(
    report: &mut BakeReport,
    receivers: &ReceiverSet,
    probes: &ProbeSet,
    support: &Support,
    leaves: &[LeafTransport],
) {
    report.receivers = receivers.len() as u64;
    report.invalid_receivers = receivers.invalid.len() as u64;
    report.probes = probes.positions.len() as u64;
    report.radius = probes.radius_m;
    let counts = support.start.windows(2).map(|run| run[1] - run[0]);
    report.overlap = Overlap {
        mean: (support.probes.len() as f64 / receivers.len().max(1) as f64) as f32,
        min: counts.clone().min().unwrap_or(0),
        max: counts.max().unwrap_or(0),
    };
    let clusters = || leaves.iter().flat_map(|leaf| &leaf.block.clusters);
    let n_clusters = clusters().count();
    report.clusters = n_clusters as u64;
    let weighted: u64 =
        clusters().map(|cluster| u64::from(cluster.n_receivers) * u64::from(cluster.n_coefficients)).sum();
    report.coefficients_per_receiver = weighted as f64 / receivers.len().max(1) as f64;
    let linked: usize = leaves.iter().map(|leaf| leaf.block.cluster_probes.len()).sum();
    report.probes_per_cluster = linked as f64 / n_clusters.max(1) as f64;
    let unseen: Vec<f32> = leaves.iter().flat_map(|leaf| leaf.unseen.iter().copied()).collect();
    report.unseen = Unseen::of(&unseen);
    let errors = || leaves.iter().flat_map(|leaf| leaf.row_error_squared.iter().copied());
    let n_rows = errors().count().max(1);
    report.compression = Compression {
        rms_error: (errors().sum::<f64>() / n_rows as f64).sqrt(),
        max_error: errors().fold(0.0, f64::max).sqrt(),
    };
    report.seams = receivers.seams.len() as u64;
}
