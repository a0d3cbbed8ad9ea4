//! What can go wrong in a bake ([`BakeError`]), and what a command says of it ([`CommandError`], [`Exit`]).

pub use localprt_tools::error::{CommandError, Exit};

use crate::output::OutputError;
use crate::progress::Cancelled;
use crate::settings::SettingsError;

/// Why a bake did not come to its end; variants follow who can act.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// The scene has something that cannot be baked.
    #[error("{what}")]
    Scene {
        /// What is wrong.
        what: String,
        /// Where in the scene: a JSON pointer, a mesh or material name.
        place: Option<String>,
        /// What to do.
        remedy: String,
    },
    /// An option's value.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Options that do not fit the scene.
    #[error("{what}")]
    Option {
        /// What is wrong, with the option's name.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// Options that ask for more than a limit allows.
    #[error("{what}: needs {needed}, allowed is {allowed}")]
    Limit {
        /// Of what.
        what: String,
        /// With its unit.
        needed: String,
        /// With its unit.
        allowed: String,
        /// What to do.
        remedy: String,
    },
    /// Something this build or this machine does not do.
    #[error("{what}")]
    Unsupported {
        /// What.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// The baked file's quality is below the limit that the options set.
    #[error("{measure} is {measured:.4}, allowed is {allowed:.4}")]
    Quality {
        /// Name of the figure.
        measure: &'static str,
        /// Its value.
        measured: f64,
        /// The limit.
        allowed: f64,
        /// What to do.
        remedy: String,
    },
    /// Leaves that should have been baked elsewhere are not there.
    #[error("{} leaves are missing", leaves.len())]
    Missing {
        /// Their numbers.
        leaves: Vec<usize>,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Stopped on request.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A defect.
    #[error("{what}")]
    Internal {
        /// Which promise is broken.
        what: String,
    },
}

impl BakeError {
    /// The exit code it leads to.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Scene { .. } => Exit::InvalidInput,
            Self::Settings(_) | Self::Option { .. } | Self::Limit { .. } => Exit::Usage,
            Self::Unsupported { .. } => Exit::Unsupported,
            Self::Quality { .. } => Exit::Quality,
            Self::Missing { .. } => Exit::Incomplete,
            Self::Output(_) => Exit::Io,
            Self::Cancelled(_) => Exit::Interrupted,
            Self::Internal { .. } => Exit::Internal,
        }
    }
}

impl From<SettingsError> for CommandError {
    fn from(error: SettingsError) -> Self {
        Self::of(Exit::Usage, &error).help(error.help())
    }
}

impl From<BakeError> for CommandError {
    fn from(error: BakeError) -> Self {
        let shown = Self::of(error.exit(), &error);
        match error {
            BakeError::Scene { place, remedy, .. } => Self { place, ..shown }.help(remedy),
            BakeError::Limit { remedy, .. }
            | BakeError::Option { remedy, .. }
            | BakeError::Unsupported { remedy, .. }
            | BakeError::Quality { remedy, .. } => shown.help(remedy),
            BakeError::Missing { .. } => shown.help("bake the shards that hold them, and merge again"),
            BakeError::Settings(error) => error.into(),
            BakeError::Output(error) => error.into(),
            BakeError::Cancelled(error) => error.into(),
            BakeError::Internal { .. } => {
                shown.help("this is a defect of localprt; please report it with the scene and the command")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io, path::Path};

    #[test]
    fn every_bake_error_has_the_exit_code_of_who_can_act() {
        let text = || String::from("x");
        let code = |error: BakeError| CommandError::from(error).exit.code();
        assert_eq!(code(BakeError::Scene { what: text(), place: None, remedy: text() }), 3);
        let limit = BakeError::Limit { what: text(), needed: text(), allowed: text(), remedy: text() };
        assert_eq!(code(limit), 2);
        assert_eq!(code(BakeError::Unsupported { what: text(), remedy: text() }), 5);
        let quality = BakeError::Quality { measure: "unseen", measured: 0.5, allowed: 0.1, remedy: text() };
        assert_eq!(code(quality), 7);
        assert_eq!(code(BakeError::Cancelled(Cancelled)), 130);
        assert_eq!(code(BakeError::Internal { what: text() }), 1);
        let full = io::Error::from(io::ErrorKind::StorageFull);
        assert_eq!(code(BakeError::Output(OutputError::write(Path::new("a.exr"), full))), 6);
    }
}
