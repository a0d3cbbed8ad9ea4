//! Why a lighting file was refused.

use std::path::PathBuf;

/// A lighting file or one of its images that cannot be used. `place` is a JSON pointer such as `/lights/0/range`; what to do is
/// [`LightingError::help`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightingError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The lighting file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not JSON.
    #[error("not valid JSON: {source}")]
    Syntax {
        /// Line, column and reason.
        source: serde_json::Error,
    },
    /// A key that means nothing here.
    #[error("{place}: unknown key `{key}`")]
    UnknownKey {
        /// The object that holds the key.
        place: String,
        /// The key found.
        key: String,
        /// The known key that differs least from it.
        nearest: &'static str,
        /// All known keys, joined with commas.
        known: String,
    },
    /// A key that has to be there.
    #[error("{place}: missing key `{key}`")]
    MissingKey {
        /// The object that lacks the key.
        place: String,
        /// The key.
        key: &'static str,
        /// What it is for.
        reason: &'static str,
    },
    /// A value of another JSON type.
    #[error("{place}: must be {expected}, found {found}")]
    WrongType {
        /// The value.
        place: String,
        /// What it should be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A number outside of its range.
    #[error("{place}: must be {allowed}, found {found}")]
    OutOfRange {
        /// The value.
        place: String,
        /// The range.
        allowed: &'static str,
        /// The number found.
        found: String,
    },
    /// A word that is none of the choices.
    #[error("{place}: must be one of {allowed}, found \"{found}\"")]
    UnknownChoice {
        /// The value.
        place: String,
        /// The choices.
        allowed: &'static str,
        /// The word found.
        found: String,
    },
    /// An override for a material that the scene does not have.
    #[error("/materials: the scene has no material named \"{name}\"")]
    UnknownMaterial {
        /// The name found.
        name: String,
        /// Names that differ least from it, quoted; none if the scene has no materials.
        near: String,
    },
    /// An equirect image that cannot be used.
    #[error("/sky/file: cannot use {path}: {reason}")]
    SkyImage {
        /// The image file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl LightingError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::Read { .. } => "check that it is a file and may be read".into(),
            Self::UnknownKey { nearest, known, .. } => format!("did you mean `{nearest}`? known are {known}"),
            Self::MissingKey { reason, .. } => format!("add it: {reason}"),
            Self::Syntax { .. } | Self::WrongType { .. } | Self::OutOfRange { .. } | Self::UnknownChoice { .. } => {
                "correct it there; scenes/README.md describes lighting files".into()
            }
            Self::UnknownMaterial { near, .. } if near.is_empty() => "remove it: the scene has no materials".into(),
            Self::UnknownMaterial { near, .. } => format!("choose one of the scene's, such as {near}"),
            Self::SkyImage { .. } => {
                "save it as a whole .exr or .hdr image of finite numbers, beside the lighting file or below".into()
            }
        }
    }
}
