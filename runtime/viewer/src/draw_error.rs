//! Why a picture cannot be drawn.

use std::fmt;

/// Why a scene cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DrawError {
    /// The relighter has no scene, and so no lights.
    NoScene,
    /// The relighter's shadow maps hold some of the lights only.
    TooManyLights,
}

impl DrawError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::NoScene => "call `Relighter::set_scene` first",
            Self::TooManyLights => "raise `shadow_layers` of the relighter's options",
        }
    }
}

impl fmt::Display for DrawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoScene => "the relighter has no scene",
            Self::TooManyLights => "not all shadow maps fit at once",
        })
    }
}

impl std::error::Error for DrawError {}
