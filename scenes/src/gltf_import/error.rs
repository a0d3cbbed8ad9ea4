//! What can be wrong with a scene file.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a scene did not load. Every message names the file, the place in it as a JSON pointer, what was found and what
/// to do; no further cause needs to be printed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The operating system refused to read the scene or a file it names.
    #[error("{}: cannot be read: {cause}; check that it exists and may be read", .file.display())]
    Read {
        /// The file that was being read.
        file: PathBuf,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// Not glTF 2.0: wrong magic, damaged container, not JSON.
    #[error("{}: {found}; {remedy}", .file.display())]
    Container {
        /// The scene file.
        file: PathBuf,
        /// What was found.
        found: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The file contradicts the glTF specification, or itself.
    #[error("{}: at {pointer}: {found}; {remedy}", .file.display())]
    Invalid {
        /// The scene file.
        file: PathBuf,
        /// JSON pointer to the place.
        pointer: String,
        /// What was found.
        found: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A buffer or image that is missing, outside of the scene's folder, or not what its reader needs.
    #[error("{}: at {pointer}: cannot use {uri}: {reason}; {remedy}", .file.display())]
    Resource {
        /// The scene file.
        file: PathBuf,
        /// JSON pointer to the place.
        pointer: String,
        /// The address as written, shortened, or the image's name.
        uri: String,
        /// Why it cannot be used.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Larger than a limit of [`Limits`](super::Limits).
    #[error("{}: at {pointer}: {found}, the limit is {limit}; {remedy}", .file.display())]
    TooLarge {
        /// The scene file.
        file: PathBuf,
        /// JSON pointer to the place, empty for the file itself.
        pointer: String,
        /// What was found, with its unit.
        found: String,
        /// The limit, in the same unit.
        limit: u64,
        /// What to do.
        remedy: &'static str,
    },
    /// Valid glTF that needs something this importer does not read.
    #[error("{}: at {pointer}: {feature} is not supported; {remedy}", .file.display())]
    Unsupported {
        /// The scene file.
        file: PathBuf,
        /// JSON pointer to the place.
        pointer: String,
        /// Extension, version or image format.
        feature: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// Who can act on a [`LoadError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LoadErrorKind {
    /// The scene has to be repaired (or made smaller).
    Invalid,
    /// The scene has to be converted.
    Unsupported,
    /// The machine: permissions, disk, a scene path that is not there.
    Io,
}

impl LoadError {
    /// Who can act on it.
    pub fn kind(&self) -> LoadErrorKind {
        match self {
            Self::Read { .. } => LoadErrorKind::Io,
            Self::Unsupported { .. } => LoadErrorKind::Unsupported,
            Self::Container { .. } | Self::Invalid { .. } | Self::Resource { .. } | Self::TooLarge { .. } => {
                LoadErrorKind::Invalid
            }
        }
    }
}

/// The scene file's path, and shorthands for errors about it.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub file: PathBuf,
}

impl Source {
    pub fn new(file: &Path) -> Self {
        Self { file: file.to_owned() }
    }

    pub fn container(&self, found: impl Into<String>, remedy: &'static str) -> LoadError {
        LoadError::Container { file: self.file.clone(), found: found.into(), remedy }
    }

    pub fn invalid(&self, pointer: impl fmt::Display, found: impl Into<String>, remedy: &'static str) -> LoadError {
        LoadError::Invalid { file: self.file.clone(), pointer: pointer.to_string(), found: found.into(), remedy }
    }

    pub fn resource(
        &self,
        pointer: impl fmt::Display,
        uri: &str,
        reason: impl Into<String>,
        remedy: &'static str,
    ) -> LoadError {
        LoadError::Resource {
            file: self.file.clone(),
            pointer: pointer.to_string(),
            uri: shortened(uri),
            reason: reason.into(),
            remedy,
        }
    }

    pub fn unsupported(
        &self,
        pointer: impl fmt::Display,
        feature: impl Into<String>,
        remedy: &'static str,
    ) -> LoadError {
        LoadError::Unsupported {
            file: self.file.clone(),
            pointer: pointer.to_string(),
            feature: feature.into(),
            remedy,
        }
    }

    pub fn too_large(
        &self,
        pointer: impl fmt::Display,
        found: impl Into<String>,
        limit: u64,
        remedy: &'static str,
    ) -> LoadError {
        LoadError::TooLarge {
            file: self.file.clone(),
            pointer: pointer.to_string(),
            found: found.into(),
            limit,
            remedy,
        }
    }
}

/// Text from the file for a message: quoted, control characters escaped, at most 80 characters.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 80;
    let mut quoted: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().nth(LONGEST).is_some() {
        quoted.push_str("...");
    }
    format!("\"{quoted}\"")
}
