//! Why a lighting file was refused.

use std::path::PathBuf;

/// A lighting file or one of its images that cannot be used. `place` is a JSON pointer such as `/lights/0/range`.
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
    #[error("{place}: unknown key `{key}`, nearest known one is `{nearest}` (known: {known})")]
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
    #[error("{place}: missing key `{key}` ({reason})")]
    MissingKey {
        /// The object that lacks the key.
        place: String,
        /// The key.
        key: &'static str,
        /// Why it is needed.
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
    #[error("/materials: the scene has no material named \"{name}\"; {near}")]
    UnknownMaterial {
        /// The name found.
        name: String,
        /// Names to choose from, as a phrase.
        near: String,
    },
    /// An equirect image that cannot be used.
    #[error("/sky/file: cannot use {path}: {reason}")]
    SkyImage {
        /// The image file.
        path: PathBuf,
        /// What is wrong and what would be right.
        reason: String,
    },
}
