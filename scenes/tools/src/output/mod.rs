//! Files other than the baked one: images and point clouds, each written whole or not at all.

mod exr;
mod ktx2;
mod ply;
mod png;

pub use exr::{ExrPrecision, write_exr};
pub use ktx2::write_ktx2;
pub use ply::{ReceiverVertex, write_ply};
pub use png::write_png;

use crate::error::{CommandError, Exit, reason};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The folder to write into is not there.
    #[error("the folder `{}` does not exist", folder.display())]
    NoFolder {
        /// The file asked for.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// The path is a folder, or has no file name.
    #[error("this is a folder, not a file")]
    IsFolder {
        /// The file asked for.
        path: PathBuf,
    },
    /// A baked file is renamed into place, which a device or a pipe does not allow.
    #[error("exists and is not a regular file")]
    NotAFile {
        /// The file asked for.
        path: PathBuf,
    },
    /// The system refused: no permission, disk full, ...
    #[error("cannot be written: {}", reason(cause))]
    Write {
        /// The file asked for.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
    /// The encoder refused.
    #[error("cannot be encoded: {what}")]
    Encode {
        /// The file asked for.
        path: PathBuf,
        /// Why.
        what: String,
    },
}

/// The folder that a file lies in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

impl OutputError {
    /// A refusal of the system.
    pub fn write(path: &Path, cause: io::Error) -> Self {
        Self::Write { path: path.to_owned(), cause }
    }

    /// The file asked for.
    pub fn path(&self) -> &Path {
        match self {
            Self::NoFolder { path, .. }
            | Self::IsFolder { path }
            | Self::NotAFile { path }
            | Self::Write { path, .. }
            | Self::Encode { path, .. } => path,
        }
    }

    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::NoFolder { folder, .. } => format!("create it first: mkdir -p {}", folder.display()),
            Self::IsFolder { path } => format!("name a file in it, such as {}", path.join("out").display()),
            Self::NotAFile { .. } => "choose another name".into(),
            Self::Write { cause, .. } => match cause.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "free some space, or write elsewhere",
                io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                    "choose a folder that this user may write to"
                }
                _ => "check the disk and the connection to it",
            }
            .into(),
            Self::Encode { .. } => "choose a smaller size".into(),
        }
    }
}

impl From<OutputError> for CommandError {
    fn from(error: OutputError) -> Self {
        Self::of(Exit::Io, &error).in_file(error.path()).help(error.help())
    }
}

/// Refuses now what writing would refuse later, so that long work is not done in vain.
///
/// # Errors
/// As [`write_file`], apart from a disk that gets full meanwhile.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    match target(path)? {
        Target::Direct => Ok(()),
        Target::Renamed { path: real, folder } => temporary(&real, &folder).map(drop).map_err(|cause| {
            // Shown with the path as the user wrote it.
            OutputError::write(path, cause)
        }),
    }
}

/// Writes a file whole or not at all: to a temporary name in the same folder, synced, renamed. What is there already and
/// is not a plain file (a device, a pipe) is written into.
///
/// # Errors
/// [`OutputError`]; an existing file is unchanged then.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let refused = |cause| OutputError::write(path, cause);
    match target(path)? {
        Target::Direct => {
            let mut file = File::options().write(true).open(path).map_err(refused)?;
            file.write_all(bytes).map_err(refused)
        }
        Target::Renamed { path: real, folder } => {
            let mut file = temporary(&real, &folder).map_err(refused)?;
            file.write_all(bytes).map_err(refused)?;
            file.as_file().sync_all().map_err(refused)?;
            file.persist(&real).map(drop).map_err(|error| refused(error.error))
        }
    }
}

enum Target {
    Direct,
    Renamed { path: PathBuf, folder: PathBuf },
}

fn target(path: &Path) -> Result<Target, OutputError> {
    let real = match fs::metadata(path) {
        Ok(data) if data.is_dir() => return Err(OutputError::IsFolder { path: path.to_owned() }),
        Ok(data) if !data.is_file() => return Ok(Target::Direct),
        // Follow links, so that what they point to is replaced and not the link.
        Ok(_) => fs::canonicalize(path).map_err(|cause| OutputError::write(path, cause))?,
        Err(_) => path.to_owned(),
    };
    if real.file_name().is_none() || path.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Err(OutputError::IsFolder { path: path.to_owned() });
    }
    let folder = folder_of(&real).to_owned();
    match fs::metadata(&folder) {
        Ok(data) if data.is_dir() => Ok(Target::Renamed { path: real, folder }),
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => Err(OutputError::write(path, cause)),
        _ => Err(OutputError::NoFolder { path: path.to_owned(), folder }),
    }
}

fn temporary(path: &Path, folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push(".tmp");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any other new file: readable by all, less the umask. Temporary files are private otherwise.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.bin");
        check_writable(&path).expect("writable");
        assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 0);
        write_file(&path, b"old").expect("written");
        write_file(&path, b"new").expect("written");
        assert_eq!(fs::read(&path).expect("read"), b"new");
        assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 1);
    }

    #[test]
    fn paths_that_cannot_be_files_are_refused_with_a_remedy() {
        let folder = tempfile::tempdir().expect("folder");
        let error = write_file(&folder.path().join("no/a.bin"), b"").expect_err("no folder");
        assert!(matches!(error, OutputError::NoFolder { .. }) && error.help().contains("mkdir -p"));
        let error = check_writable(folder.path()).expect_err("folder");
        assert!(matches!(error, OutputError::IsFolder { .. }));
        let error = check_writable(&folder.path().join("x/")).expect_err("folder");
        assert!(matches!(error, OutputError::IsFolder { .. }));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_reported_as_such() {
        let error = write_file(Path::new("/dev/full"), b"x").expect_err("full");
        assert!(matches!(&error, OutputError::Write { cause, .. } if cause.kind() == io::ErrorKind::StorageFull));
        assert!(error.help().contains("space"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_keeps_pointing_to_the_file_that_is_replaced() {
        let folder = tempfile::tempdir().expect("folder");
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, b"old").expect("written");
        std::os::unix::fs::symlink(&real, &link).expect("linked");
        write_file(&link, b"new").expect("written");
        assert_eq!(fs::read(&real).expect("read"), b"new");
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    }
}
