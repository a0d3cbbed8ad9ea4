//! Transport from the probes to all receivers, and to the cells of the volume.

use super::{
    Reuse,
    assemble::stored_blocks,
    failures::placement_error,
    leaf::{LeafWork, StowedLeaf, cells, stored_members},
    place::Placed,
    views::Views,
};
use crate::{
    clusters::{LeafTree, RefineSettings, leaves},
    error::BakeError,
    lightmap::ReceiverSet,
    output::OutputError,
    probes,
    progress::Progress,
    rays::RayCaster,
    relight_rays::RelightRays,
    report::CacheUse,
    settings::BakeSettings,
    transport::{GatherSet, NearField, RayCounts, Receivers, TransportScene},
    volume::VolumeCells,
};
use glam::Vec3;
use localprt_formats::{VolumeArrays, sh};

/// Transport of a bake.
pub(super) struct Transported {
    /// To the receivers of the lightmap.
    pub(super) leaves: Vec<StowedLeaf>,
    /// To the cells of the volume.
    pub(super) volume: Option<VolumeArrays>,
    /// Rays that both cost.
    pub(super) rays: RayCounts,
    /// Leaves of both.
    pub(super) cache: CacheUse,
    /// Planes between the leaves of the lightmap.
    pub(super) tree: LeafTree,
    /// Least gain of near light, if there is any.
    pub(super) near_least_gain: Option<f32>,
    /// Support radius of the volume's cells, metres.
    pub(super) volume_radius_m: Option<f32>,
}

/// Leaves of both, and how they are come by.
pub(super) struct Stages<'a> {
    /// Of the lightmap.
    pub(super) leaves: LeafWork<'a>,
    /// Of the volume.
    pub(super) volume: Option<LeafWork<'a>>,
    tree: LeafTree,
    near_least_gain: Option<f32>,
    volume_radius_m: Option<f32>,
}

impl Stages<'_> {
    /// The same, if there are as many leaves as were planned.
    pub(super) fn of(self, n_leaves: usize) -> Result<Self, BakeError> {
        let found = self.leaves.len() + self.volume.as_ref().map_or(0, LeafWork::len);
        if found != n_leaves {
            return Err(BakeError::Option {
                what: format!("the bake has {found} leaves here, and {n_leaves} where it was planned"),
                remedy: "plan again, and bake on machines with the same kind of processor".into(),
            });
        }
        Ok(self)
    }

    /// About how much work each leaf is: those of the lightmap, and after them those of the volume.
    pub(super) fn costs(&self) -> Vec<f64> {
        let mut costs = self.leaves.costs();
        costs.extend(self.volume.iter().flat_map(LeafWork::costs));
        costs
    }

    /// Makes some of the leaves, numbered in that order, and keeps them.
    pub(super) fn keep(&self, numbers: &[usize]) -> Result<CacheUse, BakeError> {
        let first = self.leaves.len();
        let (of_lightmap, of_volume): (Vec<usize>, Vec<usize>) = numbers.iter().partition(|number| **number < first);
        let mut use_of_cache = self.leaves.keep(OF_LIGHTMAP, of_lightmap)?;
        if let Some(volume) = self.volume.as_ref().filter(|_| !of_volume.is_empty()) {
            let numbers: Vec<usize> = of_volume.iter().map(|number| number - first).collect();
            use_of_cache += volume.keep(OF_VOLUME, numbers)?;
        }
        Ok(use_of_cache)
    }

    /// Numbers of leaves that are not kept.
    pub(super) fn missing(&self) -> Vec<usize> {
        let mut missing = self.leaves.missing();
        let first = self.leaves.len();
        missing.extend(self.volume.iter().flat_map(LeafWork::missing).map(|number| first + number));
        missing
    }
}

/// What a bake is transported with.
pub(super) struct Given<'a> {
    pub(super) caster: &'a RayCaster<'a>,
    pub(super) receivers: &'a ReceiverSet,
    pub(super) placed: &'a Placed,
    pub(super) views: &'a mut Views,
    pub(super) settings: &'a BakeSettings,
}

/// Hands over the leaves of a bake, none of which is made yet.
pub(super) fn with_leaves<T>(
    Given { caster, receivers, placed, views, settings }: Given<'_>,
    reuse: Reuse<'_>,
    progress: &Progress,
    then: impl FnOnce(Stages<'_>) -> Result<T, BakeError>,
) -> Result<T, BakeError> {
    let (probe_basis, sky_basis) = (sh::Basis::new(settings.probe_degree), sh::Basis::new(settings.sky_degree));
    let gather = GatherSet::new(settings.gather_rays, settings.receiver_degree, settings.seed);
    let transport = TransportScene {
        caster,
        receivers: Receivers::Surface(receivers),
        probes: &placed.probes,
        support: &placed.support,
        gather: &gather,
        probe_basis: &probe_basis,
        sky_basis: &sky_basis,
        fit: views.fit.as_ref(),
        near: None,
        cells: cells(reuse.cache, caster),
    };
    let plan = reuse.previous.map(|previous| &previous.plan);
    // The texels are many, and nothing else needs them.
    let near = settings.near_bytes_in_force().zip(views.light_map.take()).map(|(bytes, (atlas, texels))| {
        let _stage = progress.stage("near light", 0);
        let near = NearField::new(caster, atlas, &texels, &placed.probes, &placed.support);
        match plan.and_then(|plan| plan.near_least_gain) {
            Some(least) => near.with_least_gain(least),
            None => near.within(bytes, &TransportScene { cells: None, ..transport }),
        }
    });
    let transport = TransportScene { near: near.as_ref(), ..transport };
    let refining = RefineSettings {
        threshold: f64::from(settings.threshold),
        max_coefficients: settings.coefficients as usize,
        n_sh: probe_basis.len(),
        n_sky: sky_basis.len(),
    };
    let (members, tree) = leaves(&receivers.position, settings.leaf as usize, plan.map(|plan| &plan.leaves));

    // The volume by the same way as the lightmap: support, rows, clusters.
    let of_volume = match &placed.volume {
        Some(cells) => {
            let sees = |receiver: usize, probe: Vec3| caster.visible(cells.positions[receiver], probe);
            let given_m = plan.and_then(|plan| plan.volume_radius_m);
            let (linked, support, _) =
                probes::support(&cells.positions, &placed.probes.positions, &sees, settings, given_m)
                    .map_err(placement_error)?;
            // As many rows to a leaf as in a lightmap of irradiance: cells lie far apart, so a leaf has many probes, and memory
            // grows with their product.
            let limit = (settings.leaf / cells.grid.n_k() as u32).max(2);
            Some((linked.radius_m, support, leaves(&cells.positions, limit as usize, None).0))
        }
        None => None,
    };
    let around = GatherSet::sphere(settings.gather_rays, settings.volume_degree, settings.seed);
    let of_cells = placed.volume.as_ref().zip(of_volume.as_ref()).map(|(cells, (_, support, _))| {
        let receivers = Receivers::Open(&cells.positions);
        TransportScene { receivers, support, gather: &around, near: None, ..transport }
    });
    let volume = of_cells
        .as_ref()
        .zip(of_volume.as_ref())
        .map(|(transport, (_, _, members))| {
            LeafWork::of(transport, &refining, members, Reuse { room: None, ..reuse }, progress)
        })
        .transpose()?;
    let RelightRays { dirs, sh, uv, level, distance, .. } = &views.rays;
    let of_rays =
        size_of_val(&dirs[..]) + size_of_val(&sh[..]) + size_of_val(&uv[..]) + level.len() + size_of_val(&distance[..]);
    then(Stages {
        leaves: LeafWork::of(&transport, &refining, &members, reuse, progress)?.beside(of_rays as u64),
        volume,
        tree,
        near_least_gain: near.as_ref().map(NearField::least_gain),
        volume_radius_m: of_volume.as_ref().map(|(radius_m, ..)| *radius_m),
    })
}

/// Names of the two stages.
pub(super) const OF_LIGHTMAP: &str = "transport and clusters";
pub(super) const OF_VOLUME: &str = "volume transport";

impl Transported {
    /// All leaves.
    pub(super) fn of(stages: Stages<'_>, cells: Option<&VolumeCells>) -> Result<Self, BakeError> {
        let Stages { leaves, volume, tree, near_least_gain, volume_radius_m } = stages;
        let (leaves, mut use_of_cache) = leaves.all(OF_LIGHTMAP)?;
        let mut rays: RayCounts = leaves.iter().map(|leaf| leaf.rays).sum();
        let volume = match volume.zip(cells) {
            Some((volume, cells)) => {
                let (leaves, its_use) = volume.all(OF_VOLUME)?;
                rays += leaves.iter().map(|leaf| leaf.rays).sum();
                use_of_cache += its_use;
                Some(stored_volume(cells, leaves)?)
            }
            None => None,
        };
        Ok(Self { leaves, volume, rays, cache: use_of_cache, tree, near_least_gain, volume_radius_m })
    }

    /// `[n_receivers]` unseen share of each, as they were placed.
    pub(super) fn unseen(&self, n_receivers: usize) -> Vec<f32> {
        let mut unseen = vec![0.0; n_receivers];
        for leaf in &self.leaves {
            leaf.members.iter().zip(&leaf.unseen).for_each(|(&member, &share)| unseen[member as usize] = share);
        }
        unseen
    }
}

/// The volume as stored.
fn stored_volume(cells: &VolumeCells, leaves: Vec<StowedLeaf>) -> Result<VolumeArrays, OutputError> {
    let cell = |member: u32| cells.cells[member as usize];
    Ok(VolumeArrays {
        grid: cells.grid,
        cells: stored_members(&leaves).into_iter().map(cell).collect(),
        blocks: stored_blocks(leaves)?,
        fill: cells.fill.clone(),
    })
}
