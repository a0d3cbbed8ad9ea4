//! Reading scenes, lighting and baked files, with errors as the user sees them.
//!
//! A path that cannot be read is exit code 6; content that is wrong is 3; content that is right but not supported is 5.

use crate::error::{CommandError, Exit};
use crate::hex;
use crate::picture::default_camera;
use localprt_formats::{Baked, Checked, Metadata, OpenError};
use localprt_scenes::{Camera, Lighting, LightingError, LoadError, LoadErrorKind, Scene, VariantError, builtin};
use localprt_surfaces::rays::RayCaster;
use std::fs::File;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

/// What stands before the name of a built-in scene.
pub const BUILTIN: &str = "builtin:";

/// A .gltf or .glb file, or `builtin:NAME`.
pub fn scene(source: &str) -> Result<Scene, CommandError> {
    match source.strip_prefix(BUILTIN) {
        Some(name) => builtin_scene(name),
        None => scene_file(Path::new(source)),
    }
}

/// Refuses a scene that is not there before anything is started.
pub fn check_scene(source: &str) -> Result<(), CommandError> {
    match source.strip_prefix(BUILTIN) {
        Some(name) => builtin_scene(name).map(drop),
        None => readable(Path::new(source)),
    }
}

/// A built-in scene by its name.
pub fn builtin_scene(name: &str) -> Result<Scene, CommandError> {
    builtin::scene(name).ok_or_else(|| {
        CommandError::new(Exit::Usage, format!("there is no built-in scene `{name}`")).help(format!(
            "choose one of: {}, city:BLOCKS (1 to {})",
            builtin::names().join(", "),
            builtin::MOST_BLOCKS
        ))
    })
}

/// A .gltf or .glb file.
pub fn scene_file(path: &Path) -> Result<Scene, CommandError> {
    readable(path)?;
    localprt_scenes::load(path).map_err(|error| CommandError::from(error).in_file(path))
}

impl From<LoadError> for CommandError {
    fn from(error: LoadError) -> Self {
        let exit = match error.kind {
            LoadErrorKind::Invalid => Exit::InvalidInput,
            LoadErrorKind::Unsupported => Exit::Unsupported,
            LoadErrorKind::Io => Exit::Io,
        };
        Self::of(exit, &error).help(error.help)
    }
}

/// The scene with the lightmap coordinates of a baked file: named by the user, or found beside the file. It has to be
/// the one that was baked.
pub fn baked_scene(file: &Path, metadata: &Metadata, given: Option<&Path>) -> Result<Scene, CommandError> {
    let path = given.map_or_else(|| beside(file, &metadata.scene_path), Path::to_owned);
    let scene = scene_file(&path).map_err(|error| match (given, error.exit) {
        (None, Exit::Io) => {
            error.help(format!("{} was baked from this scene; say where it is now with --scene", file.display()))
        }
        _ => error,
    })?;
    if scene.hash == metadata.scene_hash {
        return Ok(scene);
    }
    let what = format!(
        "is not the scene that {} was baked from: its hash is {}, not {}",
        file.display(),
        short(&scene.hash),
        short(&metadata.scene_hash)
    );
    let help = "bake it again, or name the scene as it was with --scene";
    Err(CommandError::new(Exit::InvalidInput, what).in_file(&path).help(help))
}

/// A scene in one of its material variants, if one is named.
pub fn in_variant(mut scene: Scene, name: Option<&str>) -> Result<Scene, CommandError> {
    if let Some(name) = name {
        scene.apply_variant(name).map_err(|error| {
            let is_unknown = matches!(error, VariantError::Unknown { .. });
            let exit = if is_unknown { Exit::Usage } else { Exit::InvalidInput };
            CommandError::of(exit, &error).help(error.help())
        })?;
    }
    Ok(scene)
}

/// A lighting file, or the scene's own lights under a black sky.
pub fn lighting(path: Option<&Path>, scene: &Scene) -> Result<Lighting, CommandError> {
    let Some(path) = path else { return Ok(Lighting::of_scene(scene)) };
    readable(path)?;
    Lighting::load_for(path, scene).map_err(|error| {
        let exit = if matches!(error, LightingError::Read { .. }) { Exit::Io } else { Exit::InvalidInput };
        CommandError::of(exit, &error).help(error.help()).in_file(path)
    })
}

/// A baked file, its structure validated.
pub fn baked(path: &Path) -> Result<Baked, CommandError> {
    readable(path)?;
    Baked::open(path).map_err(|error| refused(path, &error))
}

/// The same with every block of transport validated.
pub fn checked<'a>(path: &Path, baked: &'a Baked) -> Result<Checked<'a>, CommandError> {
    baked.checked().map_err(|error| refused(path, &error))
}

/// A baked file that was refused.
pub fn refused(path: &Path, error: &OpenError) -> CommandError {
    let exit = match error {
        OpenError::Io { .. } => Exit::Io,
        OpenError::UnsupportedVersion { .. } => Exit::Unsupported,
        _ => Exit::InvalidInput,
    };
    CommandError::of(exit, error).help(error.help()).in_file(path)
}

/// Rays against a scene.
pub fn caster(scene: &Scene) -> Result<RayCaster<'_>, CommandError> {
    RayCaster::new(scene).map_err(|error| CommandError::of(Exit::InvalidInput, &error).help(error.help()))
}

/// A camera of the scene by number, or its first, or one that shows the whole scene.
pub fn camera(caster: &RayCaster<'_>, number: Option<usize>) -> Result<Camera, CommandError> {
    let cameras = &caster.scene().cameras;
    match (number, cameras.first()) {
        (None, Some(first)) => Ok(first.clone()),
        (None, None) => default_camera(caster).ok_or_else(|| {
            let what = "there is nothing to take a picture of: the scene has no triangles";
            CommandError::new(Exit::InvalidInput, what).help("bake a scene that has some")
        }),
        (Some(number), _) => cameras.get(number).cloned().ok_or_else(|| {
            let help = match cameras.len() {
                0 => "leave --camera out for a view of the whole scene".into(),
                count => format!("give a number from 0 to {}", count - 1),
            };
            CommandError::new(Exit::Usage, format!("the scene has no camera {number}")).help(help)
        }),
    }
}

/// Text of a file.
pub fn text(path: &Path) -> Result<String, CommandError> {
    let bytes = std::fs::read(path).map_err(|error| CommandError::read(path, &error))?;
    String::from_utf8(bytes)
        .map_err(|_| CommandError::new(Exit::InvalidInput, "is not UTF-8 text").in_file(path).help("save it as UTF-8"))
}

/// Refuses a path that is missing, closed to this user, or a folder.
pub fn readable(path: &Path) -> Result<(), CommandError> {
    let opened = File::open(path).and_then(|file| file.metadata());
    let data = opened.map_err(|error| CommandError::read(path, &error))?;
    if data.is_dir() {
        return Err(CommandError::read(path, &std::io::ErrorKind::IsADirectory.into()));
    }
    Ok(())
}

fn beside(file: &Path, relative: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(relative)
}

/// The way from a folder to a file, with `/`, as a baked file stores it; both have to exist.
///
/// # Errors
/// What the system says of one that does not.
pub fn relative_path(folder: &Path, file: &Path) -> std::io::Result<String> {
    let (from, to) = (folder.canonicalize()?, file.canonicalize()?);
    // Another drive has no way to it but the whole path.
    let way = pathdiff::diff_paths(&to, from).unwrap_or(to);
    Ok(way.to_string_lossy().replace(MAIN_SEPARATOR, "/"))
}

/// The first digits of a hash, enough to tell two apart.
pub fn short(hash: &[u8; 32]) -> String {
    hex(&hash[..6])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_from_the_baked_file_to_its_scene() {
        let root = tempfile::tempdir().expect("folder");
        let at = |path: &str| root.path().join(path);
        std::fs::create_dir_all(at("a/b")).expect("made");
        std::fs::create_dir_all(at("a/c")).expect("made");
        for file in ["a/b/x.glb", "a/c/y.glb"] {
            std::fs::write(at(file), b"").expect("written");
        }
        assert_eq!(relative_path(&at("a/b"), &at("a/b/x.glb")).expect("there"), "x.glb");
        assert_eq!(relative_path(&at("a/b"), &at("a/b/../c/y.glb")).expect("there"), "../c/y.glb");
        assert_eq!(relative_path(&at("a"), &at("a/c/y.glb")).expect("there"), "c/y.glb");
        assert_eq!(beside(Path::new("a/b/x.lprt"), "../c/y.glb"), Path::new("a/b/../c/y.glb"));
        assert_eq!(beside(Path::new("x.lprt"), "x.glb"), Path::new("x.glb"));
    }
}
