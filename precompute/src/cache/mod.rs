//! Results by the digest of their inputs, in a folder or a bucket that any number of bakes may share.
//!
//! In and out: bytes ([`Packer`], [`Unpacker`]) under a kind and a [`Digest`]. A record appears whole or not at all, and carries its
//! own checksum: one that does not match it counts as absent, and is made anew. What cannot be written is not kept, and that is all: a
//! cache never fails a bake. Where records lie is left to a store: a folder or a bucket.

#[cfg(feature = "bucket")]
mod bucket;
mod folder;
mod pack;
mod place;
mod store;

pub use pack::{Packer, Unpacker};
pub use place::{NoPlace, Place, PlaceError};

use crate::{
    digest::{Digest, Digester},
    output::OutputError,
    progress::Progress,
};
use folder::Folder;
use localprt_tools::{error::reason, hex};
use rayon::prelude::*;
use std::{
    io,
    path::Path,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::SystemTime,
};
use store::{Listed, Store};

/// First bytes of a record; the last one is the version of this layout.
const MAGIC: [u8; 8] = *b"lprtrec\x01";
/// Bytes before the content of a record: those, and the checksum.
pub(crate) const HEAD_BYTES: usize = MAGIC.len() + size_of::<Digest>();
/// Marks the place as one that backups may leave out (bford.info/cachedir).
const TAG: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Results of precompute that it can make again.\n";

/// Results that lie somewhere.
pub struct Cache {
    store: Box<dyn Store>,
    options: CacheOptions,
    /// Bytes written by this process, and records that could not be.
    written: AtomicU64,
    failed: AtomicU64,
    /// Records that may be there, but could not be asked for.
    unread: AtomicU64,
    /// Why, the last time.
    cause: Mutex<Option<io::Error>>,
}

/// What a cache may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CacheOptions {
    /// Nothing is written, trimmed or removed.
    pub read_only: bool,
    /// Bytes that records may have in all when a bake ends; those used longest ago go first. `u64::MAX` is no limit, and nothing is
    /// counted then.
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

struct Record {
    name: String,
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
        if folder.to_str().is_some_and(place::is_address) {
            let what = "this is an address: Place::parse reads it";
            return Err(OutputError::write(folder, io::Error::new(io::ErrorKind::InvalidInput, what)));
        }
        Ok(Self::over(Box::new(Folder::open(folder, options.read_only)?), options))
    }

    /// The cache at a place. A bucket has to be there, and to answer.
    ///
    /// # Errors
    /// [`PlaceError`] if it cannot be made, written into, or asked.
    pub fn open_place(place: &Place, options: CacheOptions) -> Result<Self, PlaceError> {
        match place {
            Place::Folder(folder) => Ok(Self::open(folder, options)?),
            #[cfg(feature = "bucket")]
            Place::Bucket(url) => {
                let store = bucket::BucketStore::open(url, options.read_only);
                store.map(|store| Self::over(Box::new(store), options)).map_err(|cause| PlaceError::bucket(url, cause))
            }
        }
    }

    /// Whether a place is one that a cache was opened at, and not only read.
    ///
    /// # Errors
    /// [`PlaceError`] if a bucket cannot be asked.
    pub fn is_at(place: &Place) -> Result<bool, PlaceError> {
        match place {
            Place::Folder(folder) => Ok(Folder::is_marked(folder)),
            #[cfg(feature = "bucket")]
            Place::Bucket(url) => {
                let store = bucket::BucketStore::open(url, true);
                store.and_then(|store| store.is_marked()).map_err(|cause| PlaceError::bucket(url, cause))
            }
        }
    }

    fn over(store: Box<dyn Store>, options: CacheOptions) -> Self {
        let [written, failed, unread] = [const { AtomicU64::new(0) }; 3];
        Self { store, options, written, failed, unread, cause: Mutex::new(None) }
    }

    /// What it may do.
    pub fn options(&self) -> CacheOptions {
        self.options
    }

    /// Content of a record; `None` if there is none that is whole.
    pub fn get(&self, kind: &str, digest: &Digest) -> Option<Vec<u8>> {
        let name = name(kind, digest);
        let mut record = self.read(&name)?;
        if !is_whole(&record, kind, digest) {
            if !self.options.read_only {
                self.store.remove(&[&name]);
            }
            return None;
        }
        // Time of its last use, for trimming; whoever may not set it trims nothing either.
        if !self.options.read_only {
            self.store.touch(&name);
        }
        record.drain(..HEAD_BYTES);
        Some(record)
    }

    /// Keeps a record whose content follows from its digest: of two that are whole either will do. What cannot be written is
    /// [noted](Cache::finish) at the end.
    pub fn put(&self, kind: &str, digest: &Digest, content: &[u8]) {
        self.write(kind, digest, content, true);
    }

    /// Keeps a record in place of an older one of its digest. Of two writers the last one wins.
    pub fn replace(&self, kind: &str, digest: &Digest, content: &[u8]) {
        self.write(kind, digest, content, false);
    }

    fn write(&self, kind: &str, digest: &Digest, content: &[u8], only_new: bool) {
        if self.options.read_only {
            return;
        }
        let record = sealed(kind, digest, content);
        match self.store.put(&name(kind, digest), &record, only_new) {
            Ok(()) => drop(self.written.fetch_add(record.len() as u64, Relaxed)),
            Err(cause) => self.note(&self.failed, cause),
        }
    }

    /// A record as it lies there.
    fn read(&self, name: &str) -> Option<Vec<u8>> {
        self.store.get(name).unwrap_or_else(|cause| {
            self.note(&self.unread, cause);
            None
        })
    }

    /// Records that could not be written, since this was last said.
    pub fn failed(&self) -> u64 {
        self.failed.load(Relaxed)
    }

    fn note(&self, count: &AtomicU64, cause: io::Error) {
        count.fetch_add(1, Relaxed);
        *self.cause.lock().unwrap_or_else(PoisonError::into_inner) = Some(cause);
    }

    /// Why the place could not be asked or written to since this was last called; `None` if it always could.
    pub fn failure(&self) -> Option<io::Error> {
        self.cause.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Ends the use of a bake: says what could not be kept or found, and trims.
    pub fn finish(&self, progress: &Progress) {
        let [failed, unread] = [&self.failed, &self.unread].map(|count| count.swap(0, Relaxed));
        let (place, remedy, written) = (self.store.place(), self.store.remedy(), self.written.load(Relaxed));
        let cause = self.failure().map(|cause| format!(" ({})", reason(&cause))).unwrap_or_default();
        if failed > 0 {
            progress.note(&format!(
                "{failed} results could not be kept in {place}, of {written} bytes in all so far{cause}: {remedy}"
            ));
        } else if unread > 0 {
            progress.note(&format!("{unread} times nothing could be looked up in {place}{cause}: {remedy}"));
        }
        if !self.options.read_only {
            self.trim(self.options.limit_bytes);
        }
    }

    /// Removes records until they have no more bytes than these in all: those used longest ago first, or written longest ago where
    /// the place keeps no more. Returns how many bytes went.
    pub fn trim(&self, most_bytes: u64) -> u64 {
        self.store.sweep();
        if most_bytes == u64::MAX {
            return 0;
        }
        let mut records = self.records();
        let mut left: u64 = records.iter().map(|record| record.bytes).sum();
        let before = left;
        records.sort_by(|a, b| (a.used, &a.name).cmp(&(b.used, &b.name)));
        let mut rest = records.as_slice();
        while left > most_bytes && !rest.is_empty() {
            // As many as would do; where some of them cannot be removed, the next ones have to.
            let mut after = left;
            let is_due = |record: &&Record| {
                let is_over = after > most_bytes;
                after = after.saturating_sub(record.bytes);
                is_over
            };
            let n_due = rest.iter().take_while(is_due).count();
            let (due, others) = rest.split_at(n_due);
            let removed = self.store.remove(&due.iter().map(|record| record.name.as_str()).collect::<Vec<_>>());
            left -=
                due.iter().zip(removed).filter(|(_, is_gone)| *is_gone).map(|(record, _)| record.bytes).sum::<u64>();
            rest = others;
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
        let is_damaged = |record: &Record| {
            // One that is gone was trimmed by somebody else.
            self.read(&record.name).is_some_and(|content| !is_whole(&content, &record.kind, &record.digest))
        };
        let damaged: Vec<Record> = self.records().into_par_iter().filter(is_damaged).collect();
        if !self.options.read_only {
            self.store.remove(&damaged.iter().map(|record| record.name.as_str()).collect::<Vec<_>>());
        }
        damaged.len() as u64
    }

    fn records(&self) -> Vec<Record> {
        let listed = self.store.list().unwrap_or_else(|cause| {
            self.note(&self.unread, cause);
            Vec::new()
        });
        let record = |Listed { name, bytes, used }: Listed| {
            // Whatever else lies there is not ours.
            let (kind, digest) = kind_and_digest(&name)?;
            Some(Record { name, kind, digest, bytes, used })
        };
        listed.into_iter().filter_map(record).collect()
    }
}

/// Name of a record in its store.
fn name(kind: &str, digest: &Digest) -> String {
    let digits = hex(digest);
    format!("{}/{}.{kind}", &digits[..2], &digits[2..])
}

/// Kind and digest of a record by its name; `None` of anything else.
fn kind_and_digest(found: &str) -> Option<(String, Digest)> {
    let (digits, kind) = found.rsplit_once('.').filter(|(_, kind)| !kind.contains('/'))?;
    let digits = digits.replacen('/', "", 1);
    let digits = digits.as_bytes().as_chunks::<2>().0;
    let bytes = digits.iter().map(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
    let digest: Digest = bytes.collect::<Option<Vec<u8>>>()?.try_into().ok()?;
    (name(kind, &digest) == found).then(|| (kind.to_owned(), digest))
}

/// A record of that kind and digest: its content behind its checksum.
pub(crate) fn sealed(kind: &str, digest: &Digest, content: &[u8]) -> Vec<u8> {
    [&MAGIC[..], &checksum(kind, digest, content), content].concat()
}

/// Whether it is such a record.
pub(crate) fn is_whole(record: &[u8], kind: &str, digest: &Digest) -> bool {
    let Some(rest) = record.strip_prefix(&MAGIC) else { return false };
    rest.split_first_chunk().is_some_and(|(stated, content)| checksum(kind, digest, content) == *stated)
}

fn checksum(kind: &str, digest: &Digest, content: &[u8]) -> Digest {
    Digester::new(kind).one(*digest).all(content).finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use folder::LONGEST_WRITE;
    use std::{fs, path::PathBuf, time::Duration};

    impl Cache {
        fn folder(&self) -> PathBuf {
            self.store.place().into()
        }

        fn path(&self, kind: &str, digest: &Digest) -> PathBuf {
            self.folder().join(name(kind, digest))
        }
    }

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
            .map(|name| cache.folder().join(name));
        for path in &theirs {
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, "theirs").expect("written");
        }
        assert_eq!(cache.verify(), 0);
        cache.trim(0);
        assert!(cache.facts().records == 0 && theirs.iter().all(|path| path.exists()));
        // A record that was being written an hour ago never will be whole.
        let left = cache.folder().join("00/.lprtrec-new");
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

    #[test]
    fn names_of_records_are_told_from_all_others() {
        let own = name("leaf", &[171; 32]);
        assert_eq!(kind_and_digest(&own), Some(("leaf".into(), [171; 32])));
        let plain = own.replace('/', "");
        let (longer, upper) = (own.replace('.', "00."), own.to_uppercase());
        for other in [&plain, &longer, &upper, TAG, "", ".", "ab/", &format!("{own}.bak"), &format!("{own}/more")] {
            assert_eq!(kind_and_digest(other), None, "{other}");
        }
    }

    #[test]
    fn an_address_never_becomes_a_folder() {
        let folder = tempfile::tempdir().expect("folder");
        assert!(Cache::open(Path::new("s3://bakes/hall"), CacheOptions::default()).is_err());
        assert!(!Path::new("s3:").exists() && Cache::open(folder.path(), CacheOptions::default()).is_ok());
    }

    /// A place that answers nothing.
    struct Silent;

    impl Store for Silent {
        fn place(&self) -> String {
            "nowhere".into()
        }

        fn remedy(&self) -> &'static str {
            "go elsewhere"
        }

        fn get(&self, _name: &str) -> io::Result<Option<Vec<u8>>> {
            Err(io::ErrorKind::TimedOut.into())
        }

        fn put(&self, _name: &str, _record: &[u8], _only_new: bool) -> io::Result<()> {
            Err(io::ErrorKind::TimedOut.into())
        }

        fn list(&self) -> io::Result<Vec<Listed>> {
            Err(io::ErrorKind::TimedOut.into())
        }

        fn remove(&self, names: &[&str]) -> Vec<bool> {
            vec![false; names.len()]
        }

        fn touch(&self, _name: &str) {}

        fn sweep(&self) {}
    }

    #[test]
    fn a_place_that_does_not_answer_holds_nothing_and_keeps_nothing() {
        let cache = Cache::over(Box::new(Silent), CacheOptions::default());
        cache.put("thing", &[1; 32], &[1]);
        assert_eq!(cache.get("thing", &[1; 32]), None);
        assert_eq!((cache.failed.load(Relaxed), cache.unread.load(Relaxed)), (1, 1));
        cache.finish(&Progress::silent());
        assert_eq!((cache.failed.load(Relaxed), cache.verify(), cache.trim(0)), (0, 0, 0));
        assert!(cache.failure().is_some() && cache.failure().is_none());
    }

    #[cfg(feature = "bucket")]
    #[test]
    fn a_bucket_keeps_records_as_a_folder_does() {
        let cache = Cache::over(Box::new(bucket::BucketStore::in_memory()), CacheOptions::default());
        rayon::scope(|scope| {
            for number in 0..10u8 {
                let cache = &cache;
                scope.spawn(move |_| cache.put("thing", &[number; 32], &vec![number; 1000]));
            }
        });
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![3; 1000]));
        assert_eq!((cache.get("other", &[3; 32]), cache.get("thing", &[77; 32])), (None, None));
        // What is there stays, unless it is damaged, or is to be replaced.
        cache.put("thing", &[3; 32], &[1, 2, 3]);
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![3; 1000]));
        cache.replace("thing", &[3; 32], &[1, 2, 3]);
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![1, 2, 3]));
        cache.store.put(&name("thing", &[3; 32]), &[9; 100], false).expect("damaged");
        cache.store.put(&name("thing", &[4; 32]), &[9; 100], false).expect("damaged");
        assert_eq!(cache.get("thing", &[3; 32]), None);
        cache.put("thing", &[3; 32], &vec![3; 1000]);
        assert_eq!(cache.get("thing", &[3; 32]), Some(vec![3; 1000]));
        assert_eq!((cache.verify(), cache.verify(), cache.facts().records), (1, 0, 9));
        // What others keep there is not counted, and stays.
        cache.store.put("ab/notes.txt", b"theirs", false).expect("written");
        assert_eq!(cache.facts(), CacheFacts { records: 9, bytes: 9 * 1040 });
        assert_eq!(cache.trim(5_000), 5 * 1040);
        cache.trim(0);
        assert!(cache.facts().records == 0 && cache.store.get("ab/notes.txt").expect("asked").is_some());
        assert!(cache.failure().is_none());
    }

    #[cfg(feature = "bucket")]
    #[test]
    fn a_bucket_that_is_only_read_stays_as_it_is() {
        let options = CacheOptions { read_only: true, ..CacheOptions::default() };
        let cache = Cache::over(Box::new(bucket::BucketStore::in_memory()), options);
        cache.put("thing", &[3; 32], &[1]);
        cache.store.put(&name("thing", &[4; 32]), &[9; 100], false).expect("damaged");
        assert_eq!((cache.get("thing", &[3; 32]), cache.get("thing", &[4; 32])), (None, None));
        assert_eq!((cache.verify(), cache.facts().records), (1, 1));
    }
}
