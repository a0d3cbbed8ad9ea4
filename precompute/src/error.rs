//! What can go wrong in a bake ([`BakeError`]), and how a command says so ([`CommandError`], [`Exit`]).
//!
//! A command prints one error, once: `error: FILE: what happened (place)` and `help: what to do`.

use crate::output::OutputError;
use crate::progress::Cancelled;
use crate::settings::SettingsError;
use std::error::Error;
use std::fmt::{self, Write as _};
use std::io;
use std::path::{Path, PathBuf};

/// Exit codes of the commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// A defect of this program.
    Internal = 1,
    /// A flag or option is wrong.
    Usage = 2,
    /// A file was read, and its content is wrong.
    InvalidInput = 3,
    /// A part of the work is missing.
    Incomplete = 4,
    /// Right, but not supported here: a feature of the scene, of the build or of the adapter.
    Unsupported = 5,
    /// A file cannot be read or written: missing, no permission, disk full.
    Io = 6,
    /// The work is done and its quality is below the given limit.
    Quality = 7,
    /// Stopped by Ctrl-C or SIGTERM.
    Interrupted = 130,
}

impl Exit {
    /// The number given to the operating system.
    pub fn code(self) -> u8 {
        self as u8
    }
}

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
            Self::Output(_) => Exit::Io,
            Self::Cancelled(_) => Exit::Interrupted,
            Self::Internal { .. } => Exit::Internal,
        }
    }
}

/// An error as a command prints it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandError {
    /// Exit code.
    pub exit: Exit,
    /// The file it is about.
    pub file: Option<PathBuf>,
    /// What happened, the whole chain in one line.
    pub what: String,
    /// Where in the file.
    pub place: Option<String>,
    /// What to do.
    pub help: Option<String>,
}

impl CommandError {
    /// An error without file, place and help.
    pub fn new(exit: Exit, what: impl Into<String>) -> Self {
        Self { exit, file: None, what: what.into(), place: None, help: None }
    }

    /// The same about a file; a message that starts with the file's name does not repeat it.
    pub fn in_file(self, file: &Path) -> Self {
        let what = match self.what.strip_prefix(&format!("{}: ", file.display())) {
            Some(rest) => rest.to_owned(),
            None => self.what,
        };
        Self { file: Some(file.to_owned()), what, ..self }
    }

    /// The same with what follows the message's last semicolon, the remedy by custom of this project, as help.
    pub fn with_remedy(mut self) -> Self {
        if let (None, Some((what, remedy))) = (&self.help, self.what.rsplit_once("; ")) {
            self.help = Some(remedy.to_owned());
            self.what = what.to_owned();
        }
        self
    }

    /// The same at a place of the file.
    pub fn at(self, place: impl Into<String>) -> Self {
        Self { place: Some(place.into()), ..self }
    }

    /// The same with what to do.
    pub fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// An error of a library, with its whole chain.
    pub fn of(exit: Exit, error: &dyn Error) -> Self {
        Self::new(exit, chain(error))
    }

    /// A file that could not be read.
    pub fn read(file: &Path, error: &io::Error) -> Self {
        let help = match error.kind() {
            io::ErrorKind::NotFound => "check the path; relative paths start at the current folder",
            io::ErrorKind::PermissionDenied => "allow this user to read it",
            io::ErrorKind::IsADirectory => "name a file, not a folder",
            _ => "check the disk and the connection to it",
        };
        Self::new(Exit::Io, format!("cannot be read: {}", reason(error))).in_file(file).help(help)
    }
}

/// The operating system's words without Rust's `(os error 2)`, in lower case.
pub(crate) fn reason(error: &io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or(&text);
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

/// All messages of an error and its sources in one line; a source that its parent already quotes is left out.
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        let cause = error.to_string();
        if !text.contains(&cause) {
            let _ = write!(text, ": {cause}");
        }
        source = error.source();
    }
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

impl fmt::Display for CommandError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(formatter, "{}: ", file.display())?;
        }
        formatter.write_str(&self.what)?;
        if let Some(place) = &self.place {
            write!(formatter, " ({place})")?;
        }
        if let Some(help) = &self.help {
            write!(formatter, "\nhelp: {help}")?;
        }
        Ok(())
    }
}

impl Error for CommandError {}

impl From<SettingsError> for CommandError {
    fn from(error: SettingsError) -> Self {
        Self::of(Exit::Usage, &error).help(error.help())
    }
}

impl From<OutputError> for CommandError {
    fn from(error: OutputError) -> Self {
        Self::of(Exit::Io, &error).in_file(error.path()).help(error.help())
    }
}

impl From<Cancelled> for CommandError {
    fn from(error: Cancelled) -> Self {
        Self::of(Exit::Interrupted, &error)
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

    #[derive(Debug, thiserror::Error)]
    #[error("texture cannot be decoded")]
    struct Outer(#[source] io::Error);

    #[test]
    fn an_error_names_file_place_cause_and_remedy() {
        let error = CommandError::of(Exit::InvalidInput, &Outer(io::Error::other("bad magic")))
            .in_file(Path::new("hall.gltf"))
            .at("/images/3")
            .help("export it as PNG");
        let text = "hall.gltf: texture cannot be decoded: bad magic (/images/3)\nhelp: export it as PNG";
        assert_eq!(error.to_string(), text);
        assert_eq!(error.exit.code(), 3);
    }

    #[test]
    fn a_cause_that_is_already_quoted_is_not_said_twice() {
        #[derive(Debug, thiserror::Error)]
        #[error("line 3: {0}")]
        struct Quoting(#[source] io::Error);
        assert_eq!(chain(&Quoting(io::Error::other("unknown key"))), "line 3: unknown key");
    }

    #[test]
    fn messages_that_bring_file_and_remedy_are_taken_apart() {
        let error = CommandError::new(Exit::InvalidInput, "a.glb: at /nodes/1: has a loop; export it again");
        let text = error.with_remedy().in_file(Path::new("a.glb")).to_string();
        assert_eq!(text, "a.glb: at /nodes/1: has a loop\nhelp: export it again");
    }

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
