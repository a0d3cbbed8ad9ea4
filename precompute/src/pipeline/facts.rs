//! What the stages did, as the report says it.

use super::{lay_out::LaidOut, place::Placed, transported::Transported, views::Views};
use crate::{
    budget::{self, Spent},
    lightmap::{Atlas, LayoutReport, ReceiverSet},
    probes::{PlacementReport, Support},
    progress::Progress,
    rays::RayCaster,
    report::{AtlasFacts, BakeReport, Compression, LinkFacts, Overlap, PlacementFacts, SceneFacts, Unseen},
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

fn atlas_facts(layout: &LayoutReport, receivers: &ReceiverSet, settings: &BakeSettings) -> AtlasFacts {
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

fn placement_facts(placement: &PlacementReport) -> PlacementFacts {
    PlacementFacts {
        spacing: placement.spacing_m,
        voxel: placement.voxel_m,
        candidates: placement.candidates as u64,
        rejected: placement.rejected as u64,
        repaired: placement.repaired as u64,
    }
}

/// A finished bake, as far as its report goes.
pub(super) struct Finished<'a> {
    pub(super) caster: &'a RayCaster<'a>,
    pub(super) atlas: &'a Atlas,
    pub(super) laid_out: &'a LaidOut,
    pub(super) placed: &'a Placed,
    pub(super) views: &'a Views,
    pub(super) transported: &'a Transported,
}

impl Finished<'_> {
    /// The report but for bytes and what the run took. Warns where the budget did not go where it should.
    pub(super) fn report(&self, scene: SceneFacts, settings: &BakeSettings, progress: &Progress) -> BakeReport {
        let Self { caster, atlas, laid_out, placed, views, transported } = *self;
        let (receivers, leaves) = (&laid_out.receivers, &transported.leaves);
        let budget = Spent {
            caster,
            atlas,
            receivers,
            probes: &placed.probes,
            unseen: &transported.unseen(receivers.len()),
            direct_texels: views.direct_texels,
        }
        .facts(settings.receivers);
        budget::warnings(&budget.views).iter().for_each(|warning| progress.warn(warning));

        let clusters = || leaves.iter().flat_map(|leaf| &leaf.clusters);
        let n_clusters = clusters().count();
        let kept: u64 =
            clusters().map(|cluster| u64::from(cluster.n_receivers) * u64::from(cluster.n_coefficients)).sum();
        let linked: usize = leaves.iter().map(|leaf| leaf.record.n_cluster_probes as usize).sum();
        let unseen: Vec<f32> = leaves.iter().flat_map(|leaf| leaf.unseen.iter().copied()).collect();
        let errors = || leaves.iter().flat_map(|leaf| leaf.row_error_squared.iter().copied());
        let n_rows = errors().count().max(1);
        let per = |sum: f64, count: usize| sum / count.max(1) as f64;
        let n_probes = placed.probes.positions.len() as u64;
        BakeReport {
            scene,
            options: settings.clone(),
            receivers: receivers.len() as u64,
            invalid_receivers: receivers.invalid.len() as u64,
            probes: n_probes,
            radius: placed.probes.radius_m,
            overlap: overlap(&placed.support, receivers.len()),
            clusters: n_clusters as u64,
            coefficients_per_receiver: per(kept as f64, receivers.len()),
            probes_per_cluster: per(linked as f64, n_clusters),
            unseen: Unseen::of(&unseen),
            compression: Compression {
                rms_error: (errors().sum::<f64>() / n_rows as f64).sqrt(),
                max_error: errors().fold(0.0, f64::max).sqrt(),
            },
            seams: receivers.seams.len() as u64,
            links: LinkFacts::of(leaves.iter().flat_map(|leaf| leaf.links.iter().copied()), receivers.len()),
            rays: transported.rays.gather + transported.rays.visibility + n_probes * u64::from(settings.relight_rays),
            gather_rays: transported.rays.gather,
            visibility_rays: transported.rays.visibility,
            atlas: atlas_facts(&laid_out.layout, receivers, settings),
            placement: placement_facts(&placed.report),
            relight: views.rays.counts,
            budget,
            ..BakeReport::default()
        }
    }
}

fn overlap(support: &Support, n_receivers: usize) -> Overlap {
    let counts = support.start.windows(2).map(|run| run[1] - run[0]);
    Overlap {
        mean: (support.probes.len() as f64 / n_receivers.max(1) as f64) as f32,
        min: counts.clone().min().unwrap_or(0),
        max: counts.max().unwrap_or(0),
    }
}
