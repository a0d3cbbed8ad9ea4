//! `precompute scene`: a built-in scene as a file.

use crate::cli::Scene;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::output::check_writable;
use localprt_precompute::progress::Progress;
use localprt_scenes::export_glb;

/// Runs the subcommand.
pub fn run(command: &Scene, progress: &Progress) -> Result<(), CommandError> {
    let name = command.name.strip_prefix(inputs::BUILTIN).unwrap_or(&command.name);
    let scene = inputs::builtin_scene(name)?;
    check_writable(&command.output)?;
    export_glb(&scene, &command.output)
        .map_err(|error| CommandError::of(Exit::Io, &error).help(error.help()).in_file(&command.output))?;
    progress.note(&format!("wrote {}: {} triangles", command.output.display(), scene.face_count()));
    Ok(())
}
