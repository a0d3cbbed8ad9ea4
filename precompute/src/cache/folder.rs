//! Records in a folder: `aa/bb....kind`, two digits of the name a folder of their own.
//!
//! A record is written beside its place and renamed into it; of two writers the last one wins. The time of its last use is the time
//! of its last change.

use super::{
    TAG, TAG_TEXT,
    store::{Listed, Store},
};
use crate::output::{OutputError, write_file};
use std::{
    fs, io,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

/// How names of records begin that are being written.
const UNFINISHED: &str = ".lprtrec-";
/// Whoever wrote one of these that is older has been killed.
pub(super) const LONGEST_WRITE: Duration = Duration::from_secs(3600);

/// A folder that may not be there yet.
pub(super) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// A folder, which is made and marked unless it is only read.
    pub(super) fn open(path: &Path, read_only: bool) -> Result<Self, OutputError> {
        if !read_only {
            fs::create_dir_all(path).map_err(|cause| OutputError::write(path, cause))?;
            let tag = path.join(TAG);
            // Once: a folder on a full disk may still be read.
            if !tag.exists() {
                write_file(&tag, TAG_TEXT.as_bytes())?;
            }
        }
        Ok(Self { path: path.to_owned() })
    }

    /// Whether one was opened there that was not only read.
    pub(super) fn is_marked(path: &Path) -> bool {
        fs::read_to_string(path.join(TAG)).is_ok_and(|text| text == TAG_TEXT)
    }

    /// All that lies in the folders of records, with its name.
    fn files(&self) -> impl Iterator<Item = (String, PathBuf)> {
        let below = |folder: &Path| {
            let entries = fs::read_dir(folder).into_iter().flatten().flatten();
            // Names that are no text are of others.
            entries.filter_map(|entry| Some((entry.file_name().into_string().ok()?, entry.path())))
        };
        let is_of_records = |(name, path): &(String, PathBuf)| {
            name.len() == 2 && name.bytes().all(|letter| letter.is_ascii_hexdigit()) && path.is_dir()
        };
        below(&self.path)
            .filter(is_of_records)
            .flat_map(move |(folder, path)| below(&path).map(move |(name, path)| (format!("{folder}/{name}"), path)))
    }
}

impl Store for Folder {
    fn place(&self) -> String {
        self.path.display().to_string()
    }

    fn remedy(&self) -> &'static str {
        "free some space, or name another place with --cache"
    }

    fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>> {
        Ok(fs::read(self.path.join(name)).ok())
    }

    fn put(&self, name: &str, record: &[u8], _only_new: bool) -> io::Result<()> {
        let path = self.path.join(name);
        let folder = path.parent().unwrap_or(&self.path);
        fs::create_dir_all(folder)?;
        let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder)?;
        io::Write::write_all(&mut file, record)?;
        // Not synced: after a loss of power a record may be cut off, which its checksum tells.
        file.persist(path).map(drop).map_err(|error| error.error)
    }

    fn list(&self) -> io::Result<Vec<Listed>> {
        let listed = |(name, path): (String, PathBuf)| {
            let data = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
            Some(Listed { name, bytes: data.len(), used: data.modified().unwrap_or(SystemTime::UNIX_EPOCH) })
        };
        Ok(self.files().filter_map(listed).collect())
    }

    fn remove(&self, names: &[&str]) -> Vec<bool> {
        names.iter().map(|name| fs::remove_file(self.path.join(name)).is_ok()).collect()
    }

    fn touch(&self, name: &str) {
        let file = fs::File::options().write(true).open(self.path.join(name));
        file.and_then(|file| file.set_modified(SystemTime::now())).ok();
    }

    fn sweep(&self) {
        let is_left = |(name, path): &(String, PathBuf)| {
            let age = fs::metadata(path).and_then(|data| data.modified()).ok().and_then(|at| at.elapsed().ok());
            let is_unfinished = name.split_once('/').is_some_and(|(_, file)| file.starts_with(UNFINISHED));
            is_unfinished && age.is_some_and(|age| age > LONGEST_WRITE)
        };
        self.files().filter(is_left).for_each(|(_, path)| drop(fs::remove_file(path)));
    }
}
