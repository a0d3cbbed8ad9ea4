//! `precompute bake`: a scene in, a baked file and a report out.

use super::{check_output, grouped, print_data, size, write_text};
use crate::cli::Bake;
use localprt_formats::WriteError;
use localprt_precompute::error::{BakeError, CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::output::{OutputError, check_writable};
use localprt_precompute::pipeline::{self, BakeOutput};
use localprt_precompute::progress::Progress;
use localprt_precompute::report::{self, BakeReport};
use localprt_precompute::settings::BakeSettings;
use localprt_scenes::export_glb;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the subcommand.
pub fn run(command: &Bake, progress: &Progress) -> Result<(), CommandError> {
    let settings = settings(command)?;
    if command.print_config {
        return print_data(&settings.to_toml());
    }
    // Both are required by the command line.
    let (Some(source), Some(output)) = (&command.scene, &command.output) else { return Ok(()) };
    check_output(command.report.as_deref())?;
    let report = bake(source, output, &settings, progress)?;
    if let Some(path) = &command.report {
        write_text(path, &report.to_json())?;
    }
    Ok(())
}

fn settings(command: &Bake) -> Result<BakeSettings, CommandError> {
    let config = match &command.config {
        Some(path) => Some((path.display().to_string(), inputs::text(path)?)),
        None => None,
    };
    let config = config.as_ref().map(|(name, text)| (name.as_str(), text.as_str()));
    Ok(BakeSettings::resolve(command.preset.into(), config, &command.flags.to_table())?)
}

/// Bakes `source` into `output`, with the unwrapped scene beside it where there is one.
pub fn bake(
    source: &str,
    output: &Path,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<BakeReport, CommandError> {
    let started = Instant::now();
    inputs::check_scene(source)?;
    let scene_output = scene_output(source, output)?;
    check_baked_output(output)?;
    let stage = progress.stage("load", 0);
    let scene = inputs::scene(source)?;
    drop(stage);
    warn_of_dropped(&scene, progress);

    let baked = pipeline::bake(scene, settings, progress).map_err(|error| {
        let about_scene = matches!(error, BakeError::Scene { .. });
        let error = CommandError::from(error);
        if about_scene { error.in_file(Path::new(source)) } else { error }
    })?;
    let BakeOutput { mut arrays, scene, unwrapped, mut report } = baked;

    let stage = progress.stage("write", 0);
    let is_builtin = source.starts_with(inputs::BUILTIN);
    let scene_path = if unwrapped || is_builtin {
        export_glb(&scene, &scene_output)
            .map_err(|error| CommandError::of(Exit::Io, &error).with_remedy().in_file(&scene_output))?;
        // As a reader will find it.
        arrays.metadata.scene_hash = inputs::scene_file(&scene_output)?.hash;
        scene_output.clone()
    } else {
        arrays.metadata.scene_hash = scene.hash;
        PathBuf::from(source)
    };
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    arrays.metadata.scene_path = inputs::relative_path(folder, &scene_path)?;
    localprt_formats::write(output, &arrays).map_err(|error| refused(output, error))?;
    drop(stage);

    report.bytes.file = std::fs::metadata(output).map_or(0, |data| data.len());
    report.stages = progress.stages();
    report.seconds = started.elapsed().as_secs_f64();
    report.peak_rss_bytes = report::peak_rss_bytes().unwrap_or(0);
    report.threads = rayon::current_num_threads() as u64;
    if unwrapped || is_builtin {
        progress.note(&format!("wrote {} (the scene with lightmap coordinates)", scene_output.display()));
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
    Ok(report)
}

/// A baked file is renamed into place, which a device or a pipe does not allow.
fn check_baked_output(output: &Path) -> Result<(), CommandError> {
    if std::fs::metadata(output).is_ok_and(|data| !data.is_file() && !data.is_dir()) {
        let error = CommandError::new(Exit::Io, "exists and is not a regular file");
        return Err(error.in_file(output).help("choose another name"));
    }
    Ok(check_writable(output)?)
}

/// Where the scene with lightmap coordinates goes, beside OUT.lprt: OUT.glb, or OUT.lightmap.glb where that is the input.
/// Neither this nor OUT.lprt may be the input.
fn scene_output(source: &str, output: &Path) -> Result<PathBuf, CommandError> {
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

fn warn_of_dropped(scene: &localprt_scenes::Scene, progress: &Progress) {
    let dropped = scene.dropped;
    if dropped.degenerate + dropped.duplicate > 0 {
        progress.detail(&format!(
            "left out {} triangles without area and {} repeated ones",
            grouped(dropped.degenerate as u64),
            grouped(dropped.duplicate as u64)
        ));
    }
}

fn refused(path: &Path, error: WriteError) -> CommandError {
    match error {
        WriteError::Io { source, .. } => OutputError::write(path, source).into(),
        WriteError::Invalid(_) => BakeError::Internal { what: error.to_string() }.into(),
        _ => CommandError::of(Exit::Internal, &error).with_remedy().in_file(path),
    }
}
