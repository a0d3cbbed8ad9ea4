//! Probes, and the cells of the volume: everything that stands in the open.

use super::{failures::placement_error, lay_out::Space};
use crate::{
    error::BakeError,
    lightmap::ReceiverSet,
    plan::Previous,
    probes::{self, PlacementReport, ProbeSet, Support},
    progress::Progress,
    rays::RayCaster,
    settings::BakeSettings,
    volume::{self, VolumeCells},
    voxels::VoxelGrid,
};
use localprt_formats::{VolumeGrid, check::MAX_VOLUME_CELLS};

/// What stands in the open.
pub(super) struct Placed {
    pub(super) probes: ProbeSet,
    /// Of the receivers of the lightmap.
    pub(super) support: Support,
    pub(super) report: PlacementReport,
    pub(super) volume: Option<VolumeCells>,
}

impl Placed {
    /// `volume` is the grid that was asked for; probes of a `previous` bake stay where they are.
    pub(super) fn of(
        caster: &RayCaster<'_>,
        Space { rho, grid, scale }: Space,
        receivers: &ReceiverSet,
        volume: Option<VolumeGrid>,
        previous: Option<&Previous>,
        settings: &BakeSettings,
        progress: &Progress,
    ) -> Result<Self, BakeError> {
        let (probes, support, report) = {
            let _stage = progress.stage("probes", 0);
            let kept = previous.map(Previous::probes);
            probes::place(caster, &grid, rho, &scale, &receivers.position, &receivers.geometric_normal, settings, kept)
                .map_err(placement_error)?
        };
        let volume = match volume {
            Some(volume) => {
                let _stage = progress.stage("volume", 0);
                Some(volume_cells(volume, &grid, caster)?)
            }
            None => None,
        };
        progress.check()?;
        Ok(Self { probes, support, report, volume })
    }
}

/// Grid of the volume that the settings ask for.
pub(super) fn volume_grid(caster: &RayCaster<'_>, settings: &BakeSettings) -> Result<Option<VolumeGrid>, BakeError> {
    let Some(spacing_m) = settings.volume else { return Ok(None) };
    let bounds = caster.scene().bounds().unwrap_or_default();
    let grid = volume::grid(bounds, spacing_m, settings.volume_degree).map_err(|error| BakeError::Limit {
        what: format!("a volume of {spacing_m} m spacing over the scene box"),
        needed: error.to_string(),
        allowed: format!("{MAX_VOLUME_CELLS} cells"),
        remedy: "use a larger --volume spacing".into(),
    })?;
    Ok(Some(grid))
}

/// Its cells in the open.
fn volume_cells(grid: VolumeGrid, voxels: &VoxelGrid, caster: &RayCaster<'_>) -> Result<VolumeCells, BakeError> {
    let cells = volume::cells(grid, voxels, caster);
    if cells.cells.is_empty() {
        return Err(BakeError::Option {
            what: format!("none of the {} cells of the volume is in the open", grid.n_cells()),
            remedy: "use a smaller --volume spacing, or leave the volume out".into(),
        });
    }
    Ok(cells)
}
