//! What probes see: places of their relight rays in the light map, and what rows are fitted with. Each ray is traced once for both.

use super::{Reuse, lay_out::LaidOut};
use crate::{
    error::BakeError,
    lightmap::{
        Atlas, ChartPyramid, TexelMap,
        texels::{self, ReceiverMap},
    },
    probe_views::ProbeDirections,
    probes::ProbeSet,
    progress::Progress,
    rays::RayCaster,
    relight_rays::{LightMapLookups, RelightRays},
    settings::{BakeSettings, Transport},
    transport::{FitPrior, FitScene},
};
use localprt_formats::sh;

/// What probes see, and the light map in which they see it.
pub(super) struct Views {
    pub(super) rays: RelightRays,
    /// `None` for rows of the paper.
    pub(super) fit: Option<FitScene>,
    /// Layout of the direct light map, and its texels that rays may read, until near light has been found.
    pub(super) light_map: Option<(Atlas, TexelMap)>,
    /// Number of these texels.
    pub(super) direct_texels: usize,
}

impl Views {
    pub(super) fn of(
        caster: &RayCaster<'_>,
        atlas: &Atlas,
        LaidOut { layout, receivers, .. }: &LaidOut,
        probes: &ProbeSet,
        Reuse { previous, scratch, .. }: Reuse<'_>,
        settings: &BakeSettings,
        progress: &Progress,
    ) -> Result<Self, BakeError> {
        let scratch = scratch.cloned().unwrap_or_default();
        let prior = (settings.transport == Transport::Fitted).then(|| {
            let _stage = progress.stage("fit", 0);
            FitPrior::of(caster, atlas, receivers, probes, previous.and_then(|previous| previous.plan.fit))
        });
        progress.check()?;
        let _stage = progress.stage("relight rays", 0);
        let mut has_receiver = vec![false; layout.size as usize * layout.size as usize];
        for &texel in &receivers.texel {
            has_receiver[texel as usize] = true;
        }
        let light_map = Atlas::of_light_map(caster.scene());
        let map = ReceiverMap { atlas, size: layout.size, has_receiver: &has_receiver };
        let (texels, _) = texels::cover_visible(caster.scene(), &light_map, settings.direct_map, &map);
        let charts = ChartPyramid::of(&texels);
        let lookups = LightMapLookups { caster, atlas: &light_map, charts: &charts };
        let directions = ProbeDirections::new(settings.relight_rays, &sh::Basis::new(settings.probe_degree));
        let views = directions.views(caster, &probes.positions, |hits| {
            (lookups.of_probe(&directions, hits), prior.as_ref().map(|prior| prior.seen(caster, hits, &scratch)))
        });
        let (rays, seen): (Vec<_>, Vec<_>) = views.into_iter().unzip();
        let seen = seen.into_iter().flatten().collect::<Result<Vec<_>, _>>()?;
        let fit = prior.map(|prior| FitScene::of(caster, prior, &directions, seen));
        progress.check()?;
        let direct_texels = texels.texels.len();
        let rays = RelightRays::of_all(directions, rays);
        Ok(Self { rays, fit, light_map: Some((light_map, texels)), direct_texels })
    }
}
