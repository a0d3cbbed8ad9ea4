//! A scene to a scene with a layout and the receivers on it: as many as were asked for, where the local scale says.

use super::Reuse;
use super::{
    failures::{placement_error, tree_error, unwrap_error, voxel_error},
    keep_layout::keep_layout,
    layout_cache::LayoutCache,
};
use crate::{
    error::BakeError,
    lightmap::{
        Atlas, LayoutReport, ReceiverSet, cut, hidden, receivers,
        sides::{self, Sides},
        unwrap::{self, Fineness, LayoutSize, Wanted},
    },
    plan::{ChartPlan, MeshPlan},
    probes,
    progress::{Cancelled, Progress},
    rays::RayCaster,
    scale::{self, Focus, LocalScale, Seen},
    settings::{BakeSettings, Density},
    voxels::{self, VoxelGrid},
};
use glam::Vec3;
use localprt_scenes::Scene;
use rayon::prelude::*;

/// Samples of the local scale: one for so many receivers.
const RECEIVERS_PER_SAMPLE: usize = 4;
const LEAST_SAMPLES: usize = 4000;
/// Share of a map that charts cover, about.
const MAP_USED: f64 = 0.5;
/// Layouts that are made to meet the number of receivers, at most.
const LAYOUTS: usize = 4;
/// Share by which it may be missed.
const BUDGET_MISSED: f64 = 0.02;
/// Texels for a receiver, at most, where most of the surface is inside of geometry.
const MOST_EXTRA: f64 = 8.0;

/// What is known of the space around the surfaces.
pub(super) struct Space {
    /// Probe spacing, metres.
    pub(super) rho: f32,
    pub(super) grid: VoxelGrid,
    pub(super) scale: LocalScale,
}

impl Space {
    /// Measures the scale of a scene and rasterizes it.
    pub(super) fn of(caster: &RayCaster<'_>, settings: &BakeSettings, progress: &Progress) -> Result<Self, BakeError> {
        let scene = caster.scene();
        let rho = voxels::spacing(scene.bounds().unwrap_or_default(), settings);
        let mut scale = {
            let _stage = progress.stage("local scale", 0);
            local_scale(caster, settings)
        };
        progress.check()?;
        let _stage = progress.stage("voxelize", 0);
        let probes =
            probes::target_count(scene.bounds().unwrap_or_default(), rho, settings).map_err(placement_error)?;
        let grid = VoxelGrid::build(scene, caster, rho, scale.closest(probes), settings).map_err(voxel_error)?;
        if !scale.is_uniform() {
            let seen = scale::importance(&scale, &grid, caster);
            scale.look(scene, &seen);
        }
        progress.check()?;
        Ok(Self { rho, grid, scale })
    }

    /// That of the scene as it is written, with its cut and split faces: baked again from there, it gets the same probes.
    pub(super) fn of_laid_out(
        self,
        caster: &RayCaster<'_>,
        layout: &LayoutReport,
        settings: &BakeSettings,
        progress: &Progress,
    ) -> Result<Self, BakeError> {
        match layout.kept || self.scale.is_uniform() {
            true => Ok(self),
            false => Self::of(caster, settings, progress),
        }
    }
}

/// R of a scene, as the settings ask for it.
fn local_scale(caster: &RayCaster<'_>, settings: &BakeSettings) -> LocalScale {
    if settings.density == Density::Uniform {
        return LocalScale::uniform();
    }
    let most = (settings.receivers as usize / RECEIVERS_PER_SAMPLE).max(LEAST_SAMPLES);
    let focus = settings.focus.iter().map(|&[x, y, z, radius_m]| Focus { center: Vec3::new(x, y, z), radius_m });
    LocalScale::of(scale::measure(caster, most), caster.scene().extent(), settings.receivers, focus.collect())
}

/// About the edge of a texel at a place, metres, before the charts are known.
pub(super) fn texel_edge<'a>(
    scale: &'a LocalScale,
    scene: &Scene,
    settings: &BakeSettings,
) -> impl Fn(Vec3) -> f32 + Sync + use<'a> {
    let of_map = settings.lightmap.map_or(f64::INFINITY, |texels| f64::from(texels).powi(2) * MAP_USED);
    let receivers = f64::from(settings.receivers).min(of_map);
    let unit_m = scale.texel_unit_m(scene, receivers) as f32;
    let least_m = settings.texel.unwrap_or(0.0);
    move |place| (unit_m * scale.texel(scale.of_texels(place), 1.0)).max(least_m)
}

/// A scene with its layout, and the receivers on it.
pub(super) struct LaidOut {
    pub(super) scene: Scene,
    pub(super) layout: LayoutReport,
    pub(super) receivers: ReceiverSet,
    /// Whose charts are whose; `None` of a layout that the scene brought.
    pub(super) charts: Option<ChartPlan>,
    /// It is that of an earlier bake, whose probes and leaves belong to the same scene.
    pub(super) is_kept: bool,
}

impl LaidOut {
    /// Refuses a layout without receivers.
    pub(super) fn checked(self) -> Result<Self, BakeError> {
        if self.receivers.is_empty() {
            return Err(BakeError::Scene {
                what: "no texel of the lightmap is a receiver: every surface lies inside or behind geometry".into(),
                place: None,
                remedy: "check that front faces look into the space to light".into(),
            });
        }
        Ok(self)
    }
}

/// The same with the layout of an earlier bake where it can be kept, or one that a cache holds; kept there if it is new.
pub(super) fn lay_out_with(
    Reuse { cache, previous, .. }: Reuse<'_>,
    scene: &Scene,
    caster: &RayCaster<'_>,
    space: &Space,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<LaidOut, BakeError> {
    let reason = match own_layout(scene, settings, progress)? {
        Ok(laid_out) => {
            // The same texels, and so about the same surfaces.
            let is_kept = previous.is_some_and(|previous| previous.is_of(&laid_out.receivers.position));
            return Ok(LaidOut { is_kept, ..laid_out });
        }
        Err(reason) => reason,
    };
    if let Some(previous) = previous {
        match keep_layout(scene, space, previous, settings, progress)? {
            Some(laid_out) => return Ok(laid_out),
            None => progress.note(&format!(
                "the layout of {} cannot be kept: no mesh has charts there, or there is no room for new ones",
                previous.path.display()
            )),
        }
    }
    let cache = cache.map(|cache| LayoutCache::of(cache, scene, settings));
    if let Some((scene, layout, charts)) = cache.as_ref().and_then(|cache| cache.find(scene)) {
        let receivers = place_receivers(&scene, &Atlas::of(&scene), layout.size, progress)?;
        return Ok(LaidOut { scene, layout, receivers, charts: Some(charts), is_kept: false });
    }
    let laid_out = lay_out(scene, caster, space, settings, reason, progress)?;
    if let (Some(cache), Some(charts)) = (cache, &laid_out.charts) {
        cache.keep(&laid_out.scene, &laid_out.layout, charts);
    }
    Ok(laid_out)
}

/// The scene with its own coordinates, or why they are not usable.
fn own_layout(
    scene: &Scene,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<Result<LaidOut, String>, BakeError> {
    let texels = {
        let _stage = progress.stage("unwrap", 0);
        match unwrap::usable_layout(scene, layout_size(settings)).map_err(unwrap_error)? {
            Ok(texels) => texels,
            Err(reason) => return Ok(Err(reason)),
        }
    };
    let atlas = Atlas::of(scene);
    let receivers = place_receivers(scene, &atlas, texels, progress)?;
    let layout = LayoutReport { kept: true, size: texels, charts: atlas.n_charts, ..LayoutReport::default() };
    Ok(Ok(LaidOut { scene: scene.clone(), layout, receivers, charts: None, is_kept: false }))
}

fn layout_size(settings: &BakeSettings) -> LayoutSize {
    LayoutSize { texels: settings.receivers, lightmap: settings.lightmap, finest_m: settings.texel }
}

pub(super) fn place_receivers(
    scene: &Scene,
    atlas: &Atlas,
    size: u32,
    progress: &Progress,
) -> Result<ReceiverSet, BakeError> {
    let _stage = progress.stage("receivers", 0);
    let caster = RayCaster::new(scene).map_err(tree_error)?;
    let watch = |_: &str, _: usize, _: usize| !progress.is_cancelled();
    Ok(receivers::place(scene, atlas, &caster, size, &watch).ok_or(Cancelled)?)
}

/// The scene with lightmap coordinates and as many receivers as were asked for: unwrapped, with a face for each live side, and faces cut where they need very different densities or where other surfaces stand on them.
fn lay_out(
    given: &Scene,
    caster: &RayCaster<'_>,
    Space { grid, scale, .. }: &Space,
    settings: &BakeSettings,
    reason: String,
    progress: &Progress,
) -> Result<LaidOut, BakeError> {
    let stage = progress.stage("unwrap", 0);
    let mut size = layout_size(settings);
    let watch = |_: &str, _: usize, _: usize| !progress.is_cancelled();
    let Sides { scene: mut split, parts, back_faces } =
        sides::split(given.clone(), &|_, mesh, triangle, front| sides::is_live(caster, grid, mesh, triangle, front));
    cut::by_scale(&mut split, scale);
    let edge_m = texel_edge(scale, &split, settings);
    let walls = cut::by_surfaces(&mut split, caster, &edge_m);
    let (seen, hidden) = match scale.is_uniform() {
        true => (Seen::default(), Vec::new()),
        false => {
            let caster = RayCaster::new(&split).map_err(tree_error)?;
            let seen = scale::importance(scale, grid, &caster);
            let hidden = hidden::faces(&caster, grid, &seen, &edge_m);
            (seen, hidden)
        }
    };
    let backend = unwrap::backend(settings.unwrap).map_err(unwrap_error)?;
    let wanted = Wanted { scale, seen: &seen, hidden: &hidden, walls: &walls, texel_m: &edge_m, finest: None };
    let charts = unwrap::charts(&split, wanted, backend.as_ref(), &watch).map_err(unwrap_error)?;
    drop(stage);
    let (split, of_light_map) = {
        let _stage = progress.stage("light map", 0);
        charts.lay_out_light_map(split, caster, settings.direct_map, &watch).map_err(unwrap_error)?
    };
    let meshes: Vec<MeshPlan> =
        given.meshes.par_iter().zip(parts).map(|(mesh, parts)| MeshPlan::of(given, mesh, parts)).collect();
    let mut best: Option<(f64, LaidOut)> = None;
    for _ in 0..LAYOUTS {
        let stage = progress.stage("layout", 0);
        let (scene, texels, of_receivers) =
            charts.lay_out(split.clone(), caster, size, &watch).map_err(unwrap_error)?;
        drop(stage);
        let atlas = Atlas::of(&scene);
        let receivers = place_receivers(&scene, &atlas, texels, progress)?;
        let found = receivers.len();
        let miss = (found as f64 / f64::from(settings.receivers) - 1.0).abs();
        let layout = LayoutReport {
            kept: false,
            reason: Some(reason.clone()),
            back_faces,
            size: texels,
            charts: atlas.n_charts,
        };
        if best.as_ref().is_none_or(|best| miss < best.0) {
            let fineness =
                Fineness { finest: charts.finest(), receivers: of_receivers as f32, light_map: of_light_map as f32 };
            let plan = ChartPlan { fineness, meshes: meshes.clone() };
            best = Some((miss, LaidOut { scene, layout, receivers, charts: Some(plan), is_kept: false }));
        }
        // Texels inside of geometry and in the holes of masks hold none: as many more are needed. A map or a texel that is given
        // may not allow them.
        let wanted = f64::from(size.texels) * f64::from(settings.receivers) / found.max(1) as f64;
        let is_free = settings.lightmap.is_none() && settings.texel.is_none();
        if miss < BUDGET_MISSED || found == 0 || !is_free {
            break;
        }
        size.texels = wanted.min(MOST_EXTRA * f64::from(settings.receivers)) as u32;
    }
    best.map(|best| best.1).ok_or_else(|| BakeError::Internal { what: "no layout was made".into() })
}
