//! How a command says what went wrong: [`CommandError`] and its exit code, [`Exit`].
//!
//! A command prints one error, once: `error: FILE: what happened (place)` and `help: what to do`.

use crate::progress::Cancelled;
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
pub fn reason(error: &io::Error) -> String {
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

impl From<Cancelled> for CommandError {
    fn from(error: Cancelled) -> Self {
        Self::of(Exit::Interrupted, &error)
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
    fn a_message_that_names_the_file_does_not_repeat_it() {
        let error = CommandError::new(Exit::InvalidInput, "a.glb: at /nodes/1: has a loop").in_file(Path::new("a.glb"));
        assert_eq!(error.to_string(), "a.glb: at /nodes/1: has a loop");
    }
}
