//! `precompute bake`: a scene in, a baked file and a report out.

use super::{cache, check_output, grouped, print_data, shards, size, write_text};
use crate::cli::{Bake, BakeFlags, CacheFlags, LayoutFlags};
use localprt_precompute::cache::Cache;
use localprt_precompute::error::{BakeError, CommandError, Exit};
use localprt_precompute::forecast::Room;
use localprt_precompute::inputs;
use localprt_precompute::output::{OutputError, check_writable, folder_of};
use localprt_precompute::pipeline::{self, BakeOutput, KeptBake, Reuse, Written};
use localprt_precompute::plan::Previous;
use localprt_precompute::progress::Progress;
use localprt_precompute::report::BakeReport;
use localprt_precompute::scratch::Scratch;
use localprt_precompute::settings::{BakeSettings, Preset};
use localprt_scenes::Scene;
use localprt_tools::hex;
use std::path::{Path, PathBuf};

/// Runs the subcommand.
pub fn run(command: &Bake, progress: &Progress) -> Result<(), CommandError> {
    if command.plan.is_none() && command.shard.is_some() {
        let help = "give --plan PLAN as well, and no scene";
        return Err(CommandError::new(Exit::Usage, "a shard is one of a plan").help(help));
    }
    if let (Some(plan), Some(shard)) = (&command.plan, command.shard) {
        if !command.flags.given.is_empty() {
            let what = "options of the bake are those of the plan";
            let help = "leave them out, or plan with them";
            return Err(CommandError::new(Exit::Usage, what).in_file(plan).help(help));
        }
        return shards::shard(plan, shard, command.report.as_deref(), progress);
    }
    let settings = settings(command.config.as_deref(), command.preset, &command.flags)?;
    if command.print_config {
        return print_data(&settings.to_toml());
    }
    // Both are required by the command line.
    let (Some(source), Some(output)) = (&command.scene, &command.output) else { return Ok(()) };
    check_output(command.report.as_deref())?;
    let report = bake(source, output, &settings, Some(&command.cache), &command.layout, progress)?;
    if let Some(path) = &command.report {
        write_text(path, &report.to_json())?;
    }
    Ok(())
}

/// Options of a bake: a preset, a file of them and flags.
pub fn settings(config: Option<&Path>, preset: Preset, flags: &BakeFlags) -> Result<BakeSettings, CommandError> {
    let config = match config {
        Some(path) => Some((path.display().to_string(), inputs::text(path)?)),
        None => None,
    };
    let config = config.as_ref().map(|(name, text)| (name.as_str(), text.as_str()));
    Ok(BakeSettings::resolve(preset, config, &flags.given)?)
}

/// Bakes `source` into `output`, with the unwrapped scene beside it where there is one.
pub fn bake(
    source: &str,
    output: &Path,
    settings: &BakeSettings,
    cache: Option<&CacheFlags>,
    layout: &LayoutFlags,
    progress: &Progress,
) -> Result<BakeReport, CommandError> {
    inputs::check_scene(source)?;
    let scene_output = scene_output(source, output)?;
    check_baked_output(output)?;
    let stage = progress.stage("load", 0);
    let scene = inputs::scene(source)?;
    drop(stage);
    warn_of_dropped(&scene, progress);
    // Only now: a command that is refused leaves no folder behind.
    let cache = match cache {
        Some(flags) => cache::of_bake(flags, output, progress)?,
        None => None,
    };
    let report = bake_scene(scene, source, [output, &scene_output], settings, cache.as_ref(), layout, progress);
    if let Some(cache) = &cache {
        cache.finish(progress);
    }
    report
}

fn bake_scene(
    scene: Scene,
    source: &str,
    [output, scene_output]: [&Path; 2],
    settings: &BakeSettings,
    cache: Option<&Cache>,
    layout: &LayoutFlags,
    progress: &Progress,
) -> Result<BakeReport, CommandError> {
    let named = layout.layout.as_deref().map(Previous::open).transpose()?;
    let layout_key = match (&named, layout.new_layout) {
        (Some(named), _) => hex(&named.digest()),
        (None, is_new) => if is_new { "new" } else { "own" }.into(),
    };
    let names = [output, scene_output];
    let kept = cache.map(|cache| KeptBake::of(cache, &scene, settings, names, source, &layout_key));
    if let Some(mut report) = kept.as_ref().and_then(KeptBake::find) {
        report.warnings.iter().for_each(|warning| progress.warn(warning));
        report.measure_run(progress);
        let seconds = report.seconds;
        progress
            .note(&format!("{} is up to date: nothing that it depends on is new, {seconds:.1} s", output.display()));
        return Ok(report);
    }
    let previous = match named {
        Some(named) => Some(named),
        None if layout.new_layout => None,
        // Whatever else lies there is replaced without a word.
        None => Previous::open(output).ok().filter(|previous| previous.plan.is_for(settings)),
    };
    let room = Room::for_file(output.to_owned());
    let scratch = Scratch::in_folder(folder_of(output))?;
    let reuse = Reuse { cache, previous: previous.as_ref(), room: Some(&room), scratch: Some(&scratch) };
    let baked = pipeline::bake_with(scene, settings, reuse, progress);
    let baked = baked.map_err(|error| of_scene(error, source))?;
    let written = write(baked, source, [output, scene_output], progress)?;
    if let Some(kept) = &kept {
        kept.keep(&written);
    }
    Ok(written.report)
}

/// What went wrong in the bake of a scene.
pub fn of_scene(error: BakeError, source: &str) -> CommandError {
    let about_scene = matches!(error, BakeError::Scene { .. });
    let error = CommandError::from(error);
    if about_scene { error.in_file(Path::new(source)) } else { error }
}

/// Writes a bake of a scene, and says so.
pub fn write(
    baked: BakeOutput,
    source: &str,
    [output, scene_output]: [&Path; 2],
    progress: &Progress,
) -> Result<Written, CommandError> {
    let source = (!source.starts_with(inputs::BUILTIN)).then(|| Path::new(source));
    let written = baked.write(output, scene_output, source, progress)?;
    let Written { scene, is_scene_new, report } = &written;
    if *is_scene_new {
        progress.note(&format!("wrote {} (the scene with lightmap coordinates)", scene.display()));
    }
    if let Some(leaves) = report.cache.filter(|leaves| leaves.reused > 0) {
        let all = leaves.reused + leaves.baked;
        progress.note(&format!("{} of {} leaves were in the cache", grouped(leaves.reused), grouped(all)));
    }
    progress.note(&format!(
        "wrote {}: {}, {} receivers, {} probes, {} clusters, unseen {:.2} %, {:.1} s",
        output.display(),
        size(report.bytes.file),
        grouped(report.receivers),
        grouped(report.probes),
        grouped(report.clusters),
        100.0 * report.unseen.mean,
        report.seconds
    ));
    Ok(written)
}

/// Refuses a place where no baked file can be.
pub fn check_baked_output(output: &Path) -> Result<(), OutputError> {
    if std::fs::metadata(output).is_ok_and(|data| !data.is_file() && !data.is_dir()) {
        return Err(OutputError::NotAFile { path: output.to_owned() });
    }
    check_writable(output)
}

/// Where the scene with lightmap coordinates goes, beside OUT.lprt: OUT.glb, or OUT.lightmap.glb where that is the input.
/// Neither this nor OUT.lprt may be the input.
pub fn scene_output(source: &str, output: &Path) -> Result<PathBuf, CommandError> {
    // Links and other spellings of a path lead to the same file.
    let input = Path::new(source).canonicalize().ok().filter(|_| !source.starts_with(inputs::BUILTIN));
    let is_input = |path: &Path| input.is_some() && path.canonicalize().ok() == input;
    let mut path = output.with_extension("glb");
    if path == output {
        let help = "give it the extension .lprt: OUT.glb, the scene with lightmap coordinates, is written beside it";
        return Err(CommandError::new(Exit::Usage, "a baked file is not a .glb file").in_file(output).help(help));
    }
    if is_input(output) {
        let what = "the baked file would overwrite the input";
        return Err(CommandError::new(Exit::Usage, what).in_file(output).help("give it the extension .lprt"));
    }
    if is_input(&path) {
        path = output.with_extension("lightmap.glb");
    }
    if is_input(&path) {
        let what = "the scene with lightmap coordinates would overwrite the input";
        let help = "give -o another name or folder: OUT.glb or OUT.lightmap.glb is written beside OUT.lprt";
        return Err(CommandError::new(Exit::Usage, what).in_file(&path).help(help));
    }
    check_writable(&path)?;
    Ok(path)
}

fn warn_of_dropped(scene: &Scene, progress: &Progress) {
    let dropped = scene.dropped;
    if dropped.degenerate + dropped.duplicate > 0 {
        progress.detail(&format!(
            "left out {} triangles without area and {} repeated ones",
            grouped(dropped.degenerate as u64),
            grouped(dropped.duplicate as u64)
        ));
    }
}
