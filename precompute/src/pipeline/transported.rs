//! Transport from the probes to all receivers, and to the cells of the volume.

use super::{
    assemble::stored_blocks,
    failures::placement_error,
    leaf::{LeafTransport, local_transport, stored_members},
    place::Placed,
    views::Views,
};
use crate::{
    cache::Cache,
    clusters::RefineSettings,
    error::BakeError,
    lightmap::ReceiverSet,
    probes,
    progress::Progress,
    rays::RayCaster,
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
    pub(super) leaves: Vec<LeafTransport>,
    /// To the cells of the volume.
    pub(super) volume: Option<VolumeArrays>,
    /// Rays that both cost.
    pub(super) rays: RayCounts,
    /// Leaves of both.
    pub(super) cache: CacheUse,
}

impl Transported {
    pub(super) fn of(
        caster: &RayCaster<'_>,
        receivers: &ReceiverSet,
        placed: &Placed,
        views: &mut Views,
        settings: &BakeSettings,
        cache: Option<&Cache>,
        progress: &Progress,
    ) -> Result<Self, BakeError> {
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
            cells: None,
        };
        // The texels are many, and nothing else needs them.
        let near = settings.near_bytes_in_force().zip(views.light_map.take()).map(|(bytes, (atlas, texels))| {
            let _stage = progress.stage("near light", 0);
            NearField::new(caster, atlas, &texels, &placed.probes, &placed.support).within(bytes, &transport)
        });
        let transport = TransportScene { near: near.as_ref(), ..transport };
        let refining = RefineSettings {
            threshold: f64::from(settings.threshold),
            max_coefficients: settings.coefficients as usize,
            n_sh: probe_basis.len(),
            n_sky: sky_basis.len(),
        };
        let (leaves, mut use_of_cache) =
            local_transport(&transport, &refining, settings.leaf, "transport and clusters", cache, progress)?;
        let mut rays: RayCounts = leaves.iter().map(|leaf| leaf.rays).sum();
        let volume = match &placed.volume {
            Some(cells) => {
                let (volume, of_volume, its_use) =
                    volume_transport(cells, &transport, &refining, settings, cache, progress)?;
                rays += of_volume;
                use_of_cache += its_use;
                Some(volume)
            }
            None => None,
        };
        Ok(Self { leaves, volume, rays, cache: use_of_cache })
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

/// The volume as stored, by the same way as the lightmap: support, rows, clusters. `lightmap` gives what both share.
fn volume_transport(
    cells: &VolumeCells,
    lightmap: &TransportScene<'_>,
    refining: &RefineSettings,
    settings: &BakeSettings,
    cache: Option<&Cache>,
    progress: &Progress,
) -> Result<(VolumeArrays, RayCounts, CacheUse), BakeError> {
    let sees = |receiver: usize, probe: Vec3| lightmap.caster.visible(cells.positions[receiver], probe);
    let (_, support, _) =
        probes::support(&cells.positions, &lightmap.probes.positions, &sees, settings).map_err(placement_error)?;
    let gather = GatherSet::sphere(settings.gather_rays, settings.volume_degree, settings.seed);
    let receivers = Receivers::Open(&cells.positions);
    let transport = TransportScene { receivers, support: &support, gather: &gather, near: None, ..*lightmap };
    // As many rows to a leaf as in a lightmap of irradiance: cells lie far apart, so a leaf has many probes, and memory
    // grows with their product.
    let leaf = (settings.leaf / cells.grid.n_k() as u32).max(2);
    let (leaves, use_of_cache) = local_transport(&transport, refining, leaf, "volume transport", cache, progress)?;
    let cell = |member: u32| cells.cells[member as usize];
    let rays = leaves.iter().map(|leaf| leaf.rays).sum();
    let volume = VolumeArrays {
        grid: cells.grid,
        cells: stored_members(&leaves).into_iter().map(cell).collect(),
        blocks: stored_blocks(leaves, cells.grid.n_k(), |member| cells.grid.position(cell(member) as usize)),
        fill: cells.fill.clone(),
    };
    Ok((volume, rays, use_of_cache))
}
