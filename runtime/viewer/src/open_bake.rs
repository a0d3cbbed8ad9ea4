//! What one run of the viewer shows: a baked file, its scene, and what follows from the two.

use glam::Vec3;
use localprt_formats::{Baked, Checked};
use localprt_runtime::scene_light::scene_texels;
use localprt_runtime::{SceneTexels, ShadowCasters};
use localprt_scenes::{Camera, Scene};
use localprt_surfaces::rays::RayCaster;
use localprt_tools::error::{CommandError, Exit};
use localprt_tools::inputs;
use localprt_tools::reference_file::ReferenceFile;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// A baked file and the scene that it was baked from.
pub struct Files {
    /// Path of the baked file, as given.
    pub path: PathBuf,
    /// The baked file, as it was opened.
    pub baked: Baked,
    /// The scene with the file's lightmap coordinates.
    pub scene: Scene,
    /// What `validate` has measured, if it left a file beside this one that belongs to it.
    pub reference: Option<ReferenceFile>,
    /// Why there is no reference although there is a file.
    pub reference_note: Option<String>,
    /// Time and length of the baked file when it was opened; `None` in pages.
    pub stamp: Option<FileStamp>,
}

/// Time of the last change of a file, and its length.
pub type FileStamp = (SystemTime, u64);

/// `None` of a file that is not there.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn stamp(path: &Path) -> Option<FileStamp> {
    let data = std::fs::metadata(path).ok()?;
    Some((data.modified().ok()?, data.len()))
}

/// Which scene the user named for a file, and in which of its material variants.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Clone, Debug, Default)]
pub struct SceneSource {
    /// A file other than the one that the baked file names.
    pub path: Option<PathBuf>,
    /// A variant.
    pub variant: Option<String>,
}

impl Files {
    /// The same from memory, in pages: a baked file, and its scene as one .glb with everything in it.
    ///
    /// # Errors
    /// A file or scene that is broken, or not the one that was baked.
    #[cfg(target_arch = "wasm32")]
    pub fn from_memory(name: &str, file: Vec<u8>, scene_name: &str, scene: &[u8]) -> Result<Self, CommandError> {
        let path = PathBuf::from(name);
        let baked = Baked::from_bytes(file).map_err(|error| inputs::refused(&path, &error))?;
        let scene = localprt_scenes::load_bytes(scene_name, scene)
            .map_err(|error| CommandError::from(error).in_file(Path::new(scene_name)))?;
        if scene.hash != baked.metadata().scene_hash {
            let what = format!("is not the scene that {name} was baked from");
            return Err(CommandError::new(Exit::InvalidInput, what).in_file(Path::new(scene_name)));
        }
        Ok(Self { path, baked, scene, reference: None, reference_note: None, stamp: None })
    }

    /// Opens a baked file and finds its scene: `scene`, or the one named in the file.
    ///
    /// # Errors
    /// A file or scene that is missing, broken, or not the one that was baked, with its remedy and exit code.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn open(path: &Path, scene: Option<&Path>) -> Result<Self, CommandError> {
        // Before it is read: a file that is replaced meanwhile is another one.
        let stamp = stamp(path);
        let baked = inputs::baked(path)?;
        let scene = inputs::baked_scene(path, baked.metadata(), scene)?;
        let (reference, reference_note) = reference_beside(path, &baked);
        Ok(Self { path: path.to_owned(), baked, scene, reference, reference_note, stamp })
    }
}

#[cfg(not(target_arch = "wasm32"))]
impl Files {
    /// The same with the scene in a material variant, if one is named.
    ///
    /// # Errors
    /// A variant that the scene lacks, or that has other holes than were baked.
    pub fn in_variant(self, name: Option<&str>) -> Result<Self, CommandError> {
        Ok(Self { scene: inputs::in_variant(self.scene, name)?, ..self })
    }

    /// Whether they can be shown, as far as that is quick to tell.
    ///
    /// # Errors
    /// As [`OpenBake::new`].
    pub(crate) fn check(&self) -> Result<(), CommandError> {
        inputs::checked(&self.path, &self.baked)?;
        self.scene.bounds().map(drop).ok_or_else(|| empty(&self.path))
    }
}

fn empty(path: &Path) -> CommandError {
    let help = "bake a scene that has some";
    CommandError::new(Exit::InvalidInput, "the scene has no triangles").in_file(path).help(help)
}

#[cfg(not(target_arch = "wasm32"))]
fn reference_beside(path: &Path, baked: &Baked) -> (Option<ReferenceFile>, Option<String>) {
    let beside = ReferenceFile::path_beside(path);
    if !beside.exists() {
        return (None, None);
    }
    match ReferenceFile::read(&beside).and_then(|reference| reference.matches(baked).map(|()| reference)) {
        Ok(reference) => (Some(reference), None),
        Err(error) => (None, Some(format!("{}: {error}; {}", beside.display(), error.help()))),
    }
}

/// Files with what the passes and the mouse need of them.
pub struct OpenBake<'a> {
    /// The files.
    pub files: &'a Files,
    /// The baked file, every block checked.
    pub baked: Checked<'a>,
    /// Rays against the scene.
    pub caster: RayCaster<'a>,
    /// Texels of the direct light map.
    pub texels: SceneTexels,
    /// What casts shadows.
    pub casters: ShadowCasters,
    /// The scene's cameras, or one that shows the whole scene.
    pub cameras: Vec<Camera>,
    /// Corners of the scene's box, metres.
    pub bounds: (Vec3, Vec3),
}

impl<'a> OpenBake<'a> {
    /// Prepares files.
    ///
    /// # Errors
    /// A scene without triangles, or a file whose transport breaks a rule.
    pub fn new(files: &'a Files) -> Result<Self, CommandError> {
        let (scene, baked) = (&files.scene, inputs::checked(&files.path, &files.baked)?);
        let bounds = scene.bounds().ok_or_else(|| empty(&files.path))?;
        let caster = inputs::caster(scene)?;
        let texels = scene_texels(&caster, baked.view());
        let cameras = match scene.cameras.is_empty() {
            false => scene.cameras.clone(),
            true => vec![inputs::camera(&caster, None)?],
        };
        Ok(Self { files, baked, caster, texels, casters: ShadowCasters::of_scene(scene), cameras, bounds })
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        &self.files.scene
    }

    /// One line: what is open, and how long that took.
    pub fn summary(&self, device: &str, took: Duration) -> String {
        format!(
            "{}: {} receivers, {} probes, {} clusters; on {device}; ready in {:.2} s",
            self.files.path.display(),
            self.baked.n_receivers(),
            self.baked.n_probes(),
            self.baked.transport().clusters.len(),
            took.as_secs_f64()
        )
    }

    /// Longest side of the scene's box, metres.
    pub fn extent_m(&self) -> f32 {
        (self.bounds.1 - self.bounds.0).max_element()
    }

    /// Median support radius of the probes, metres; 0 without probes.
    pub fn median_support_radius_m(&self) -> f32 {
        let mut radii: Vec<f32> = self.baked.view().probes.iter().map(|probe| probe.support_radius_m).collect();
        radii.sort_unstable_by(f32::total_cmp);
        radii.get(radii.len() / 2).copied().unwrap_or(0.0)
    }

    /// The receiver nearest to a point among those whose normals face the same way as `normal`.
    pub fn nearest_receiver(&self, point: Vec3, normal: Vec3) -> Option<u32> {
        let distance = |receiver: usize| point.distance_squared(self.baked.view().receiver_position[receiver].into());
        (0..self.baked.n_receivers())
            .filter(|&receiver| normal.dot(self.baked.view().receiver_normal[receiver].into()) > 0.5)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
            .map(|receiver| receiver as u32)
    }
}
