//! Results by the digest of their inputs, in a folder that any number of bakes may share.
//!
//! In and out: bytes ([`Packer`], [`Unpacker`]) under a kind and a [`Digest`]. A record is written beside its place and renamed into it,
//! so that it appears whole or not at all; of two writers the last one wins. It carries its own checksum: a record that does not
//! match it counts as absent, and is made anew. What cannot be written is not kept, and that is all: a cache never fails a bake.

mod pack;

pub use pack::{Packer, Unpacker};

use crate::{
    digest::{Digest, Digester},
    output::{OutputError, write_file},
    progress::Progress,
};
use localprt_tools::hex;
use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering::Relaxed},
    time::{Duration, SystemTime},
};

/// First bytes of a record; the last one is the version of this layout.
const MAGIC: [u8; 8] = *b"lprtrec\x01";
/// Marks the folder as one that backups may leave out (bford.info/cachedir).
const TAG: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Results of precompute that it can make again.\n";

/// How names of records begin that are being written.
const UNFINISHED: &str = ".lprtrec-";
/// Whoever wrote one of these that is older has been killed.
const LONGEST_WRITE: Duration = Duration::from_secs(3600);

/// A folder of results.
pub struct Cache {
    folder: PathBuf,
    options: CacheOptions,
    /// Bytes written by this process, and records that could not be.
    written: AtomicU64,
    failed: AtomicU64,
}

/// What a cache may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CacheOptions {
    /// Nothing is written, trimmed or removed.
    pub read_only: bool,
    /// Bytes that records may have in all when a bake ends; those used longest ago go first.
    pub limit_bytes: u64,
    /// A bake says of each leaf that it makes why it is not there.
    pub explain: bool,
}

impl Default for CacheOptions {
    fn default() -> Self {
        Self { read_only: false, limit_bytes: 16 << 30, explain: false }
    }
}

/// What a cache holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheFacts {
    /// Records.
    pub records: u64,
    /// Their bytes.
    pub bytes: u64,
}

struct RecordFile {
    path: PathBuf,
    kind: String,
    digest: Digest,
    bytes: u64,
    used: SystemTime,
}

impl Cache {
    /// The cache in a folder, which is made unless it is only read.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot be made, or written into.
    pub fn open(folder: &Path, options: CacheOptions) -> Result<Self, OutputError> {
        let cache = Self { folder: folder.to_owned(), options, written: AtomicU64::new(0), failed: AtomicU64::new(0) };
        if !options.read_only {
            fs::create_dir_all(folder).map_err(|cause| OutputError::write(folder, cause))?;
            let tag = folder.join(TAG);
            // Once: a folder on a full disk may still be read.
            if !tag.exists() {
                write_file(&tag, TAG_TEXT.as_bytes())?;
            }
        }
        Ok(cache)
    }

    /// What it may do.
    pub fn options(&self) -> CacheOptions {
        self.options
    }

    /// Whether a folder is one that a cache was opened in.
    pub fn is_one(folder: &Path) -> bool {
        fs::read_to_string(folder.join(TAG)).is_ok_and(|text| text == TAG_TEXT)
    }

    /// Content of a record; `None` if there is none that is whole.
    pub fn get(&self, kind: &str, digest: &Digest) -> Option<Vec<u8>> {
        let path = self.path(kind, digest);
        let mut record = fs::read(&path).ok()?;
        if !is_whole(&record, kind, digest) {
            if !self.options.read_only {
                fs::remove_file(&path).ok();
            }
            return None;
        }
        // Time of its last use, for trimming; whoever may not set it trims nothing either.
        if !self.options.read_only {
            fs::File::options().write(true).open(&path).and_then(|file| file.set_modified(SystemTime::now())).ok();
        }
        record.drain(..MAGIC.len() + size_of::<Digest>());
        Some(record)
    }

    /// Keeps a record. What cannot be written is [noted](Cache::finish) at the end.
    pub fn put(&self, kind: &str, digest: &Digest, content: &[u8]) {
        if self.options.read_only {
            return;
        }
        let record = [&MAGIC[..], &checksum(kind, digest, content), content].concat();
        match self.write(&self.path(kind, digest), &record) {
            Ok(()) => self.written.fetch_add(record.len() as u64, Relaxed),
            Err(_) => self.failed.fetch_add(1, Relaxed),
        };
    }

    fn write(&self, path: &Path, record: &[u8]) -> io::Result<()> {
        let folder = path.parent().unwrap_or(&self.folder);
        fs::create_dir_all(folder)?;
        let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder)?;
        io::Write::write_all(&mut file, record)?;
        // Not synced: after a loss of power a record may be cut off, which its checksum tells.
        file.persist(path).map(drop).map_err(|error| error.error)
    }

    /// Records that could not be written, since this was last said.
    pub fn failed(&self) -> u64 {
        self.failed.load(Relaxed)
    }

    /// Ends the use of a bake: says what could not be kept, and trims.
    pub fn finish(&self, progress: &Progress) {
        let failed = self.failed.swap(0, Relaxed);
        if failed > 0 {
            progress.note(&format!(
                "{failed} results could not be kept in {}, of {} bytes in all so far: free some space, or name another place \
                 with --cache",
                self.folder.display(),
                self.written.load(Relaxed)
            ));
        }
        if !self.options.read_only {
            self.trim(self.options.limit_bytes);
        }
    }

    /// Removes records until they have no more bytes than these in all: those used longest ago first. Returns how many bytes
    /// went.
    pub fn trim(&self, most_bytes: u64) -> u64 {
        self.sweep();
        let mut records = self.records();
        let mut left: u64 = records.iter().map(|record| record.bytes).sum();
        let before = left;
        records.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        for record in records {
            if left <= most_bytes {
                break;
            }
            if fs::remove_file(&record.path).is_ok() {
                left -= record.bytes;
            }
        }
        before - left
    }

    /// What the cache holds.
    pub fn facts(&self) -> CacheFacts {
        let records = self.records();
        let bytes = records.iter().map(|record| record.bytes).sum();
        CacheFacts { records: records.len() as u64, bytes }
    }

    /// Holds every record against its checksum and removes those that do not match it, unless the cache is only read. Returns how
    /// many these were.
    pub fn verify(&self) -> u64 {
        let is_damaged = |record: &&RecordFile| {
            // One that is gone was trimmed by somebody else.
            fs::read(&record.path).is_ok_and(|content| !is_whole(&content, &record.kind, &record.digest))
        };
        let damaged: Vec<RecordFile> = self.records().into_iter().filter(|record| is_damaged(&record)).collect();
        if !self.options.read_only {
            damaged.iter().for_each(|record| drop(fs::remove_file(&record.path)));
        }
        damaged.len() as u64
    }

    fn records(&self) -> Vec<RecordFile> {
        let record = |path: PathBuf| {
            // Whatever else lies there is not ours.
            let (kind, digest) = self.name_of(&path)?;
            let data = fs::metadata(&path).ok().filter(fs::Metadata::is_file)?;
            let used = data.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            Some(RecordFile { path, kind, digest, bytes: data.len(), used })
        };
        self.files().filter_map(record).collect()
    }

    /// Removes what killed writers left behind.
    fn sweep(&self) {
        let is_left = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().as_encoded_bytes();
            let age = fs::metadata(path).and_then(|data| data.modified()).ok().and_then(|at| at.elapsed().ok());
            name.starts_with(UNFINISHED.as_bytes()) && age.is_some_and(|age| age > LONGEST_WRITE)
        };
        self.files().filter(is_left).for_each(|path| drop(fs::remove_file(path)));
    }

    /// All that lies in the folders of records.
    fn files(&self) -> impl Iterator<Item = PathBuf> {
        let below = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let is_of_records = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().as_encoded_bytes();
            name.len() == 2 && name.iter().all(u8::is_ascii_hexdigit) && path.is_dir()
        };
        below(&self.folder).filter(is_of_records).flat_map(move |folder| below(&folder))
    }

    /// Kind and digest of a record by its path; `None` of any other file.
    fn name_of(&self, path: &Path) -> Option<(String, Digest)> {
        let kind = path.extension()?.to_str()?.to_owned();
        let name = path.parent()?.file_name()?.to_str()?.to_owned() + path.file_stem()?.to_str()?;
        let digits = name.as_bytes().as_chunks::<2>().0;
        let bytes = digits.iter().map(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        let digest: Digest = bytes.collect::<Option<Vec<u8>>>()?.try_into().ok()?;
        (self.path(&kind, &digest) == path).then_some((kind, digest))
    }

    fn path(&self, kind: &str, digest: &Digest) -> PathBuf {
        let name = hex(digest);
        self.folder.join(&name[..2]).join(format!("{}.{kind}", &name[2..]))
    }
}

/// A record of that kind and digest, with its checksum.
fn is_whole(record: &[u8], kind: &str, digest: &Digest) -> bool {
    let Some(rest) = record.strip_prefix(&MAGIC) else { return false };
    rest.split_first_chunk().is_some_and(|(stated, content)| checksum(kind, digest, content) == *stated)
}

fn checksum(kind: &str, digest: &Digest, content: &[u8]) -> Digest {
    Digester::new(kind).one(*digest).all(content).finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(options: CacheOptions) -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().expect("folder");
        let cache = Cache::open(folder.path(), CacheOptions::default()).expect("opens");
        for number in 0..10u8 {
            cache.put("thing", &[number; 32], &vec![number; 1000]);
        }
        let cache = Cache::open(folder.path(), options).expect("opens");
        (folder, cache)
    }

    #[test]
    fn records_come_back_and_damaged_ones_do_not() {
        let (_folder, cache) = filled(CacheOptions::default());
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![3; 1000]));
        assert_eq!(cache.get("other", &[3; 32]), None);
        assert_eq!(cache.get("thing", &[77; 32]), None);
        let path = cache.path("thing", &[3; 32]);
        let whole = fs::read(&path).expect("there");
        assert!(is_whole(&whole, "thing", &[3; 32]));
        assert!(!is_whole(&whole, "other", &[3; 32]) && !is_whole(&whole, "thing", &[4; 32]));
        for length in [0, 5, 8, 39, 40, 500, whole.len() - 1] {
            fs::write(&path, &whole[..length]).expect("written");
            assert_eq!(cache.get("thing", &[3; 32]), None, "{length} bytes of it");
            assert!(!path.exists(), "a damaged record is out of the way");
        }
        for byte in [0, 7, 9, 39, 40, 1039] {
            let mut damaged = whole.clone();
            damaged[byte] ^= 16;
            fs::write(&path, &damaged).expect("written");
            assert_eq!(cache.facts().records, 10);
            assert_eq!(cache.verify(), 1, "byte {byte}");
            assert_eq!((cache.verify(), cache.facts().records), (0, 9));
        }
        fs::write(&path, &whole).expect("written");
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![3; 1000]));
    }

    #[test]
    fn those_used_longest_ago_are_trimmed_first() {
        let (_folder, cache) = filled(CacheOptions::default());
        let all = cache.facts();
        assert_eq!((all.records, all.bytes), (10, 10_400));
        for number in 0..10u8 {
            let file = fs::File::options().write(true).open(cache.path("thing", &[number; 32])).expect("there");
            let age = Duration::from_secs(1000 * u64::from(number) + 1000);
            file.set_modified(SystemTime::now() - age).expect("set");
        }
        cache.get("thing", &[9; 32]).expect("used");
        assert_eq!(cache.trim(5_000), 6_240);
        let left: Vec<u8> = (0..10).filter(|&number| cache.path("thing", &[number; 32]).is_file()).collect();
        assert_eq!(left, [0, 1, 2, 9]);
        assert_eq!(cache.trim(5_000), 0);
        // Files of others stay, whatever they are called.
        let theirs = ["ab/notes.txt", "00/.new123", "00/.lprtrec-new", "src/main.rs", "00/00.leaf"]
            .map(|name| cache.folder.join(name));
        for path in &theirs {
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, "theirs").expect("written");
        }
        assert_eq!(cache.verify(), 0);
        cache.trim(0);
        assert!(cache.facts().records == 0 && theirs.iter().all(|path| path.exists()));
        // A record that was being written an hour ago never will be whole.
        let left = cache.folder.join("00/.lprtrec-new");
        let long_ago = SystemTime::now() - LONGEST_WRITE - Duration::from_secs(60);
        fs::File::options().write(true).open(&left).expect("there").set_modified(long_ago).expect("set");
        cache.trim(0);
        assert!(!left.exists() && theirs.iter().filter(|path| path.exists()).count() == 4);
    }

    #[test]
    fn what_is_only_read_stays_as_it_is() {
        let (_folder, cache) = filled(CacheOptions { read_only: true, ..CacheOptions::default() });
        cache.put("thing", &[50; 32], &[1]);
        let path = cache.path("thing", &[3; 32]);
        fs::write(&path, [1, 2, 3]).expect("written");
        assert_eq!((cache.get("thing", &[50; 32]), cache.get("thing", &[3; 32])), (None, None));
        assert!(path.exists() && cache.verify() == 1 && path.exists());
        // Nor does it have to be there.
        let nowhere = Path::new("/nowhere/at/all");
        let options = CacheOptions { read_only: true, ..CacheOptions::default() };
        assert_eq!(Cache::open(nowhere, options).expect("opens").facts(), CacheFacts::default());
        assert!(Cache::open(Path::new("/dev/null/cache"), CacheOptions::default()).is_err());
    }
}
