//! Where records lie, by name: a folder, or a bucket.

use std::{io, time::SystemTime};

/// Names and bytes. What a record is, and which names are of records, is left to the [cache](super::Cache).
///
/// Called from many threads at once, and by several processes. A record appears whole or not at all.
pub(super) trait Store: Send + Sync {
    /// The place, as messages call it.
    fn place(&self) -> String;

    /// What to do when records cannot be kept or found there.
    fn remedy(&self) -> &'static str;

    /// Content of a record; `None` if there is none.
    fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>>;

    /// Writes a record. `only_new` leaves alone what is there, where the place can tell without being asked first.
    fn put(&self, name: &str, record: &[u8], only_new: bool) -> io::Result<()>;

    /// All that lies where records do, that of others too.
    fn list(&self) -> io::Result<Vec<Listed>>;

    /// Removes records. Says of each whether this did.
    fn remove(&self, names: &[&str]) -> Vec<bool>;

    /// Notes that a record was used, where the place keeps that.
    fn touch(&self, name: &str);

    /// Removes what killed writers left behind.
    fn sweep(&self);
}

/// One of what lies in a store.
pub(super) struct Listed {
    pub(super) name: String,
    pub(super) bytes: u64,
    /// When it was used last, or written where the place keeps no more.
    pub(super) used: SystemTime,
}
