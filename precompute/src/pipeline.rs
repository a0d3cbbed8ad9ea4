//! The bake: the only file that knows the order of the stages. Reads like section 4.1 of the paper.

mod assemble;
mod facts;
mod failures;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod keep_layout;
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
    cache::Cache,
    error::BakeError,
    forecast::Room,
    lightmap::Atlas,
    plan::{BakePlan, Previous},
    progress::Progress,
    rays::RayCaster,
    report::{BakeReport, CacheUse},
    scratch::Scratch,
    settings::{BakeSettings, Glass},
    transport::FitScene,
    volume::VolumeCells,
};
use assemble::assemble;
use facts::{Finished, scene_facts};
use failures::tree_error;
use lay_out::{LaidOut, Space, lay_out_with};
use localprt_formats::BakedArrays;
use localprt_scenes::{Material, Scene};
use place::{Placed, volume_grid};
use std::{
    convert::Infallible,
    ops::ControlFlow::{self, Break, Continue},
};
use transported::{Given, Stages, Transported, with_leaves};
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

/// What a bake may use beside its scene.
#[derive(Clone, Copy, Default)]
pub struct Reuse<'a> {
    /// What the bake may take: one that is going to take more is refused after a few leaves. Absent: all there is.
    pub room: Option<&'a Room>,
    /// Results by what they depend on. The output is the same with it and without.
    pub cache: Option<&'a Cache>,
    /// Where large results lie until the bake ends; absent: in memory.
    pub scratch: Option<&'a Scratch>,
    /// An earlier bake, whose charts, probes and leaves stay where they are as far as the scene lets them.
    pub previous: Option<&'a Previous>,
}

/// Help for options out of range.
const RANGES_HELP: &str = "see `precompute bake --help` for the ranges";

/// Bakes a scene. The same scene and settings give the same bytes on any number of threads.
///
/// # Errors
/// Those of the stages, by who can act; see [`BakeError`].
pub fn bake(scene: Scene, settings: &BakeSettings, progress: &Progress) -> Result<BakeOutput, BakeError> {
    bake_with(scene, settings, Reuse::default(), progress)
}

/// The same with layout and leaves taken from a cache that holds them, and others kept in it: the output is the same, but for the use
/// of the cache in the report. Or with the plan of an earlier bake, whose options have to be the same where it depends on them.
///
/// # Errors
/// See [`bake`]; [`BakeError::Option`] for a plan by other options.
pub fn bake_with(
    scene: Scene,
    settings: &BakeSettings,
    reuse: Reuse<'_>,
    progress: &Progress,
) -> Result<BakeOutput, BakeError> {
    let all = |stages: Stages<'_>, cells: Option<&VolumeCells>| Transported::of(stages, cells).map(Continue);
    match run::<Infallible>(scene, settings, reuse, all, progress)? {
        Continue(baked) => Ok(baked),
        Break(never) => match never {},
    }
}

/// About how much work each leaf of a bake is, in no unit: those of the lightmap and, after them, those of the volume. What the stages
/// before the leaves make is kept in the cache.
///
/// # Errors
/// See [`bake_with`].
pub fn costs(
    scene: Scene,
    settings: &BakeSettings,
    reuse: Reuse<'_>,
    progress: &Progress,
) -> Result<Vec<f64>, BakeError> {
    before_all(run(scene, settings, reuse, |stages, _| Ok(Break(stages.costs())), progress)?)
}

/// Makes some leaves of a bake that has so many, numbered as in [`costs`], and keeps them in the cache, but for those that it holds
/// already.
///
/// # Errors
/// See [`bake_with`]; [`BakeError::Option`] if the bake has another number of leaves.
pub fn keep_leaves(
    scene: Scene,
    settings: &BakeSettings,
    reuse: Reuse<'_>,
    (numbers, n_leaves): (&[usize], usize),
    progress: &Progress,
) -> Result<CacheUse, BakeError> {
    let keep = |stages: Stages<'_>, _: Option<&VolumeCells>| stages.of(n_leaves)?.keep(numbers).map(Break);
    before_all(run(scene, settings, reuse, keep, progress)?)
}

/// A bake from leaves that the cache holds, all of so many.
///
/// # Errors
/// See [`keep_leaves`]; [`BakeError::Missing`] with the numbers of leaves that are not there.
pub fn merge(
    scene: Scene,
    settings: &BakeSettings,
    reuse: Reuse<'_>,
    n_leaves: usize,
    progress: &Progress,
) -> Result<BakeOutput, BakeError> {
    let found = |stages: Stages<'_>, cells: Option<&VolumeCells>| {
        let stages = stages.of(n_leaves)?;
        match stages.missing() {
            leaves if leaves.is_empty() => Transported::of(stages, cells).map(Continue),
            leaves => Err(BakeError::Missing { leaves }),
        }
    };
    match run::<Infallible>(scene, settings, reuse, found, progress)? {
        Continue(baked) => Ok(baked),
        Break(never) => match never {},
    }
}

/// What a bake was left with, before all of its leaves were made.
fn before_all<T>(end: ControlFlow<T, BakeOutput>) -> Result<T, BakeError> {
    end.break_value().ok_or_else(|| BakeError::Internal { what: "a bake went on that was to be left".into() })
}

/// The scene as light is to see it.
fn without_clear(mut scene: Scene, settings: &BakeSettings, progress: &Progress) -> Scene {
    let is_clear = |material: &Material| material.transmission > 0.0;
    match settings.glass {
        Glass::Clear => {
            let triangles = scene.leave_out_clear();
            progress.note(&format!("{triangles} triangles of clear materials are left out"));
        }
        Glass::Opaque if scene.materials.iter().any(is_clear) => {
            progress.note("clear materials block light like others; --glass clear leaves them out");
        }
        Glass::Opaque => {}
    }
    scene
}

/// All stages. `leaves` makes those of transport, or leaves the bake with what it was for.
fn run<T>(
    scene: Scene,
    settings: &BakeSettings,
    reuse: Reuse<'_>,
    leaves: impl FnOnce(Stages<'_>, Option<&VolumeCells>) -> Result<ControlFlow<T, Transported>, BakeError>,
    progress: &Progress,
) -> Result<ControlFlow<T, BakeOutput>, BakeError> {
    settings.check().map_err(|range| BakeError::Option { what: range.to_string(), remedy: RANGES_HELP.into() })?;
    if let Some(previous) = reuse.previous.filter(|previous| !previous.plan.is_for(settings)) {
        return Err(BakeError::Option {
            what: format!("{} was laid out with other options", previous.path.display()),
            remedy: "give the options that it was baked with, or no --layout".into(),
        });
    }
    let source = scene_facts(&scene);
    let scene = without_clear(scene, settings, progress);
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
        let laid_out = lay_out_with(reuse, &scene, &caster, &space, settings, progress)?.checked()?;
        (space, volume, laid_out)
    };
    progress.check()?;
    let caster = RayCaster::new(&laid_out.scene).map_err(tree_error)?;
    let atlas = Atlas::of(&laid_out.scene);
    let LaidOut { layout, receivers, .. } = &laid_out;
    // Probes and leaves of another scene are of no use.
    let reuse = Reuse { previous: reuse.previous.filter(|_| laid_out.is_kept), ..reuse };
    let space = space.of_laid_out(&caster, layout, settings, progress)?;

    // Probes, what supports whom, and what each sees.
    let placed = Placed::of(&caster, space, receivers, volume, reuse.previous, settings, progress)?;
    let mut views = Views::of(&caster, &atlas, &laid_out, &placed.probes, reuse, settings, progress)?;

    // Local transport: one leaf at a time to finished clusters; no type holds all rows.
    let given = Given { caster: &caster, receivers, placed: &placed, views: &mut views, settings };
    let transported = match with_leaves(given, reuse, progress, |stages| leaves(stages, placed.volume.as_ref()))? {
        Continue(transported) => transported,
        Break(end) => return Ok(Break(end)),
    };

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
    let use_of_cache = reuse.cache.map(|_| transported.cache);
    let plan = BakePlan {
        fit: views.fit.as_ref().map(FitScene::constants),
        near_least_gain: transported.near_least_gain,
        volume_radius_m: transported.volume_radius_m,
        leaves: transported.tree.clone(),
        ..BakePlan::new(settings, laid_out.charts.clone(), placed.report.spread)
    };
    let mut arrays = assemble(&laid_out, settings, &placed.probes, views.rays, transported)?;
    report.count_bytes(&arrays.view());
    drop(stage);
    report.warnings = progress.warnings();
    arrays.report = report.to_embedded_json();
    arrays.plan = plan.to_json();
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
    let unwrapped = !laid_out.layout.kept;
    Ok(Continue(BakeOutput { arrays, unwrapped, scene: laid_out.scene, report }))
}
