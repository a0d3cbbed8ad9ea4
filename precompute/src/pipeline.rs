//! The bake: the only file that knows the order of the stages. Reads like section 4.1 of the paper.

mod assemble;
mod facts;
mod failures;
mod kept_bake;
mod lay_out;
mod layout_cache;
mod leaf;
mod leaf_cache;
mod near_tiles;
mod place;
mod transported;
mod views;
mod write;

pub use kept_bake::KeptBake;
pub use write::Written;

use crate::{
    cache::Cache, error::BakeError, lightmap::Atlas, progress::Progress, rays::RayCaster, report::BakeReport,
    settings::BakeSettings,
};
use assemble::assemble;
use facts::{Finished, scene_facts};
use failures::tree_error;
use lay_out::{LaidOut, Space, lay_out_with};
use localprt_formats::BakedArrays;
use localprt_scenes::Scene;
use place::{Placed, volume_grid};
use transported::Transported;
use views::Views;

/// What a bake makes.
#[derive(Debug)]
pub struct BakeOutput {
    /// Content of the baked file, which knows its scene once it is [written](BakeOutput::write).
    pub arrays: BakedArrays,
    /// The scene with its lightmap coordinates as TEXCOORD_1.
    pub scene: Scene,
    /// Whether those coordinates are new, so that the scene has to be written beside the baked file.
    pub unwrapped: bool,
    /// Facts and figures, but for what writing adds.
    pub report: BakeReport,
}

/// Help for options out of range.
const RANGES_HELP: &str = "see `precompute bake --help` for the ranges";

/// Bakes a scene. The same scene and settings give the same bytes on any number of threads.
///
/// # Errors
/// Those of the stages, by who can act; see [`BakeError`].
pub fn bake(scene: Scene, settings: &BakeSettings, progress: &Progress) -> Result<BakeOutput, BakeError> {
    bake_with(scene, settings, None, progress)
}

/// The same with the layout and the leaves that a cache holds taken from there, and others kept in it: the output is the same, but
/// for the use of the cache in the report.
///
/// # Errors
/// See [`bake`].
pub fn bake_with(
    scene: Scene,
    settings: &BakeSettings,
    cache: Option<&Cache>,
    progress: &Progress,
) -> Result<BakeOutput, BakeError> {
    settings.check().map_err(|range| BakeError::Option { what: range.to_string(), remedy: RANGES_HELP.into() })?;
    let source = scene_facts(&scene);
    if scene.face_count() == 0 {
        return Err(BakeError::Scene {
            what: "the scene has no triangles".into(),
            place: None,
            remedy: "export meshes, not only points, lines or cameras".into(),
        });
    }

    // Space, which side of a surface light can reach; and receivers, texels of the lightmap.
    let (space, volume, laid_out) = {
        let caster = RayCaster::new(&scene).map_err(tree_error)?;
        let volume = volume_grid(&caster, settings)?;
        let space = Space::of(&caster, settings, progress)?;
        let laid_out = lay_out_with(cache, &scene, &caster, &space, settings, progress)?.checked()?;
        (space, volume, laid_out)
    };
    progress.check()?;
    let caster = RayCaster::new(&laid_out.scene).map_err(tree_error)?;
    let atlas = Atlas::of(&laid_out.scene);
    let LaidOut { layout, receivers, .. } = &laid_out;
    let space = space.of_laid_out(&caster, layout, settings, progress)?;

    // Probes, what supports whom, and what each sees.
    let placed = Placed::of(&caster, space, receivers, volume, settings, progress)?;
    let mut views = Views::of(&caster, &atlas, &laid_out, &placed.probes, settings, progress)?;

    // Local transport: one leaf at a time to finished clusters; no type holds all rows.
    let transported = Transported::of(&caster, receivers, &placed, &mut views, settings, cache, progress)?;

    let stage = progress.stage("assemble", 0);
    let finished = Finished {
        caster: &caster,
        atlas: &atlas,
        laid_out: &laid_out,
        placed: &placed,
        views: &views,
        transported: &transported,
    };
    let mut report = finished.report(source, settings, progress);
    let use_of_cache = cache.map(|_| transported.cache);
    let mut arrays = assemble(&laid_out, settings, &placed.probes, views.rays, transported);
    report.count_bytes(&arrays.view());
    drop(stage);
    report.warnings = progress.warnings();
    arrays.report = report.to_embedded_json();
    report.cache = use_of_cache;
    report.measure_run(progress);
    if let Some(allowed) = settings.max_unseen.filter(|&allowed| report.unseen.mean > f64::from(allowed)) {
        return Err(BakeError::Quality {
            measure: "mean unseen share",
            measured: report.unseen.mean,
            allowed: f64::from(allowed),
            remedy: "use more probes, a larger overlap or a larger repair share".into(),
        });
    }
    Ok(BakeOutput { arrays, unwrapped: !laid_out.layout.kept, scene: laid_out.scene, report })
}
