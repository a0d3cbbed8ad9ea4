//! What can be wrong with a scene file.

use std::fmt::{self, Display};
use std::io;
use std::path::{Path, PathBuf};

/// Why a scene did not load. As text it names the file, the place in it and what was found; no further cause needs to be
/// printed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LoadError {
    /// Who can act.
    pub kind: LoadErrorKind,
    /// The scene file, or one that it names and that cannot be read.
    pub file: PathBuf,
    /// JSON pointer to the place; none where it is the file as a whole.
    pub pointer: Option<String>,
    /// What was found, and what is allowed.
    pub found: String,
    /// What to do.
    pub help: &'static str,
}

/// Who can act on a [`LoadError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LoadErrorKind {
    /// The scene has to be repaired (or made smaller): it contradicts the glTF specification or itself, names a file that is missing
    /// or out of bounds, or exceeds one of the [`Limits`](super::Limits).
    Invalid,
    /// The scene has to be converted: it is valid, and needs something that this importer does not read.
    Unsupported,
    /// The machine: permissions, disk, a scene path that is not there.
    Io,
}

impl Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file.display())?;
        if let Some(pointer) = &self.pointer {
            write!(f, "at {pointer}: ")?;
        }
        f.write_str(&self.found)
    }
}

impl std::error::Error for LoadError {}

/// The system refused to read a file.
pub(super) fn unreadable(file: PathBuf, cause: &io::Error) -> LoadError {
    let (found, help) = (format!("cannot be read: {cause}"), "check that it is a file and may be read");
    LoadError { kind: LoadErrorKind::Io, file, pointer: None, found, help }
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

    pub fn container(&self, found: impl Into<String>, help: &'static str) -> LoadError {
        LoadError { kind: LoadErrorKind::Invalid, file: self.file.clone(), pointer: None, found: found.into(), help }
    }

    pub fn invalid(&self, pointer: impl Display, found: impl Into<String>, help: &'static str) -> LoadError {
        LoadError { pointer: Some(pointer.to_string()), ..self.container(found, help) }
    }

    /// `name` is an address as written, or the name of an image.
    pub fn resource(&self, pointer: impl Display, name: &str, reason: impl Display, help: &'static str) -> LoadError {
        self.invalid(pointer, format!("cannot use {}: {reason}", shortened(name)), help)
    }

    pub fn unsupported(&self, pointer: impl Display, feature: impl Display, help: &'static str) -> LoadError {
        let error = self.invalid(pointer, format!("{feature} is not supported"), help);
        LoadError { kind: LoadErrorKind::Unsupported, ..error }
    }

    /// `found` and `limit` have one unit.
    pub fn too_large(&self, pointer: impl Display, found: impl Display, limit: u64, help: &'static str) -> LoadError {
        self.invalid(pointer, format!("{found}, the limit is {limit}"), help)
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
