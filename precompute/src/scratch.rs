//! Large results of a bake on disk until they are needed, so that memory holds what the threads work on and no more: what the probes
//! see, and finished leaves.

use crate::output::OutputError;
use bytemuck::{NoUninit, Pod, cast_slice, cast_slice_mut};
use std::{
    borrow::Cow,
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

/// Where large results lie: in memory, or in a file without a name, which is gone when nobody holds any of them.
#[derive(Clone, Debug, Default)]
pub struct Scratch(Option<Arc<ScratchFile>>);

#[derive(Debug)]
struct ScratchFile {
    file: File,
    folder: PathBuf,
    /// Byte behind the last one.
    end: AtomicU64,
}

/// A list of values that a scratch holds.
#[derive(Debug)]
pub struct Stowed<T>(Lies<T>);

#[derive(Debug)]
enum Lies<T> {
    Here(Vec<T>),
    There { file: Arc<ScratchFile>, first: u64, len: usize },
}

impl Scratch {
    /// In a folder; in memory where the system cannot write to places of a file from several threads.
    ///
    /// # Errors
    /// [`OutputError`] if no file can be made there.
    pub fn in_folder(folder: &Path) -> Result<Self, OutputError> {
        if !cfg!(unix) {
            return Ok(Self::default());
        }
        let file = tempfile::tempfile_in(folder).map_err(|cause| OutputError::write(folder, cause))?;
        Ok(Self(Some(Arc::new(ScratchFile { file, folder: folder.into(), end: AtomicU64::new(0) }))))
    }

    /// Bytes that it takes of the disk; 0 in memory.
    pub fn disk_bytes(&self) -> u64 {
        self.0.as_ref().map_or(0, |file| file.end.load(Relaxed))
    }

    /// Takes a list of values in.
    ///
    /// # Errors
    /// [`OutputError`] if the disk refuses.
    pub fn stow<T: NoUninit>(&self, values: Vec<T>) -> Result<Stowed<T>, OutputError> {
        let Some(file) = self.0.as_ref().filter(|_| !values.is_empty()) else { return Ok(Stowed::in_memory(values)) };
        let bytes: &[u8] = cast_slice(&values);
        let first = file.end.fetch_add(bytes.len() as u64, Relaxed);
        write_at(&file.file, bytes, first).map_err(|cause| OutputError::write(&file.folder, cause))?;
        Ok(Stowed(Lies::There { file: Arc::clone(file), first, len: values.len() }))
    }
}

impl<T> Stowed<T> {
    /// A list that stays in memory.
    pub fn in_memory(values: Vec<T>) -> Self {
        Self(Lies::Here(values))
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        match &self.0 {
            Lies::Here(values) => values.len(),
            Lies::There { len, .. } => *len,
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl<T: Pod> Stowed<T> {
    /// The values.
    ///
    /// # Errors
    /// [`OutputError`] if the disk does not give them back.
    pub fn get(&self) -> Result<Cow<'_, [T]>, OutputError> {
        match &self.0 {
            Lies::Here(values) => Ok(Cow::Borrowed(values)),
            Lies::There { file, first, len } => {
                let mut values = vec![T::zeroed(); *len];
                read_at(&file.file, cast_slice_mut(&mut values), *first)
                    .map_err(|cause| OutputError::write(&file.folder, cause))?;
                Ok(Cow::Owned(values))
            }
        }
    }
}

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], first: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, first)
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], first: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, first)
}

#[cfg(not(unix))]
fn write_at(_: &File, _: &[u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(not(unix))]
fn read_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn lists_come_back_from_memory_and_from_disk() {
        let folder = tempfile::tempdir().expect("folder");
        for scratch in [Scratch::default(), Scratch::in_folder(folder.path()).expect("opens")] {
            let list = |number: u32| (0..number % 7).map(|place| [number, place]).collect::<Vec<_>>();
            let stowed: Vec<_> =
                (0..500u32).into_par_iter().map(|number| scratch.stow(list(number)).expect("fits")).collect();
            for (stowed, number) in stowed.iter().zip(0..) {
                assert_eq!((stowed.len(), stowed.is_empty()), (list(number).len(), number % 7 == 0));
                assert_eq!(stowed.get().expect("is there")[..], list(number)[..]);
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("there").count(), 0, "the file has no name");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_folder_that_takes_nothing_is_an_error() {
        assert!(matches!(Scratch::in_folder(Path::new("/proc")), Err(OutputError::Write { .. })));
    }
}
