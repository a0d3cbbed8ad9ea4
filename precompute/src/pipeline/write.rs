//! A finished bake to its files: the scene with its lightmap coordinates, where those are new, and the baked file, which knows the
//! scene.

use super::BakeOutput;
use crate::{
    error::BakeError,
    inputs::relative_path,
    output::{OutputError, folder_of},
    progress::Progress,
    report::BakeReport,
};
use localprt_formats::WriteError;
use localprt_scenes::{ExportError, export_glb};
use std::path::{Path, PathBuf};

/// Files of a bake.
#[derive(Debug)]
pub struct Written {
    /// The scene with the lightmap coordinates.
    pub scene: PathBuf,
    /// It was written, and not there before.
    pub is_scene_new: bool,
    /// The report, whole.
    pub report: BakeReport,
}

impl BakeOutput {
    /// Writes the baked file to `output`. Before that, to `scene`, a .glb file, goes the scene with its lightmap coordinates, unless
    /// the bake kept those of `source`, the file that the scene was read from. Each file appears whole or not at all.
    ///
    /// # Errors
    /// [`BakeError::Option`] where both are one file, the scene is too large for a .glb file, or the options for the baked one,
    /// [`BakeError::Output`] where a file cannot be written, [`BakeError::Scene`] for an image that cannot be encoded,
    /// [`BakeError::Internal`] for arrays that the format refuses.
    pub fn write(
        mut self,
        output: &Path,
        scene: &Path,
        source: Option<&Path>,
        progress: &Progress,
    ) -> Result<Written, BakeError> {
        if output == scene {
            return Err(BakeError::Option {
                what: format!("{} would be the baked file and its scene", output.display()),
                remedy: "give the scene another name".into(),
            });
        }
        let stage = progress.stage("write", 0);
        let kept = source.filter(|_| !self.unwrapped);
        let hash = match kept {
            Some(_) => self.scene.hash,
            None => export_glb(&self.scene, scene).map_err(|error| not_exported(scene, error))?,
        };
        let scene = kept.unwrap_or(scene).to_owned();
        let folder = folder_of(output);
        self.arrays.metadata.scene_hash = hash;
        self.arrays.metadata.scene_path =
            relative_path(folder, &scene).map_err(|cause| OutputError::write(output, cause))?;
        localprt_formats::write(output, &self.arrays).map_err(|error| not_written(output, error))?;
        drop(stage);
        let mut report = self.report;
        report.bytes.file = std::fs::metadata(output).map_or(0, |data| data.len());
        report.measure_run(progress);
        Ok(Written { scene, is_scene_new: kept.is_none(), report })
    }
}

fn not_exported(path: &Path, error: ExportError) -> BakeError {
    let (what, remedy) = (error.to_string(), error.help().into());
    match error {
        ExportError::Write { cause, .. } => OutputError::write(path, cause).into(),
        ExportError::TooLarge { .. } => BakeError::Option { what, remedy },
        _ => BakeError::Scene { what, place: None, remedy },
    }
}

fn not_written(path: &Path, error: WriteError) -> BakeError {
    match error {
        WriteError::Io { source, .. } => OutputError::write(path, source).into(),
        WriteError::NotAFile { path } => OutputError::NotAFile { path }.into(),
        WriteError::MetadataTooLarge { .. } => {
            BakeError::Option { what: error.to_string(), remedy: "shorten options or scene path".into() }
        }
        error => BakeError::Internal { what: error.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::super::bake;
    use super::*;
    use crate::settings::BakeSettings;
    use localprt_formats::Baked;
    use localprt_scenes::builtin;

    fn small() -> BakeSettings {
        BakeSettings {
            probes: Some(4),
            receivers: 200,
            direct_map: 32,
            gather_rays: 16,
            relight_rays: 64,
            ..BakeSettings::default()
        }
    }

    #[test]
    fn a_written_file_finds_its_scene_and_a_scene_with_coordinates_is_left_alone() {
        let folder = tempfile::tempdir().expect("folder");
        let at = |name: &str| folder.path().join(name);
        let progress = Progress::silent();
        let first = bake(builtin::scene("cornell").expect("a scene"), &small(), &progress).expect("bakes");
        let first = first.write(&at("a.lprt"), &at("a.glb"), None, &progress).expect("writes");
        assert!(first.is_scene_new && first.scene == at("a.glb"));
        let scene = localprt_scenes::load(at("a.glb")).expect("reads");
        let file = Baked::open(at("a.lprt")).expect("opens");
        assert_eq!(file.view().metadata.scene_path, "a.glb");
        assert_eq!(file.view().metadata.scene_hash, scene.hash);
        assert_eq!(first.report.bytes.file, std::fs::metadata(at("a.lprt")).expect("there").len());
        assert!(first.report.stages.iter().any(|stage| stage.name == "write"));

        let again = bake(scene, &small(), &progress).expect("bakes");
        assert!(matches!(again.write(&at("b.lprt"), &at("b.lprt"), None, &progress), Err(BakeError::Option { .. })));
        assert!(!at("b.lprt").exists());
        let again = bake(localprt_scenes::load(at("a.glb")).expect("reads"), &small(), &progress).expect("bakes");
        let again = again.write(&at("b.lprt"), &at("b.glb"), Some(&at("a.glb")), &progress).expect("writes");
        assert!(!again.is_scene_new && !at("b.glb").exists());
        assert_eq!(Baked::open(at("b.lprt")).expect("opens").view().metadata.scene_path, "a.glb");
    }
}
