//! Records in a bucket, of the same names as in a folder.
//!
//! A bucket knows when a record was written, not when it was used; and it leaves nothing behind of writers that were killed.

use super::{
    TAG, TAG_TEXT,
    store::{Listed, Store},
};
use localprt_bucket::{Bucket, BucketUrl};
use std::io;

/// A place in a bucket.
pub(super) struct BucketStore {
    place: String,
    bucket: Bucket,
}

impl BucketStore {
    /// Asks for the mark of a place, and sets it unless the place is only read.
    pub(super) fn open(url: &BucketUrl, read_only: bool) -> io::Result<Self> {
        let store = Self { place: url.to_string(), bucket: Bucket::connect(url)? };
        if !store.is_marked()? && !read_only {
            store.bucket.create(TAG, TAG_TEXT.as_bytes())?;
        }
        Ok(store)
    }

    /// Whether a cache was opened there that was not only read.
    pub(super) fn is_marked(&self) -> io::Result<bool> {
        Ok(self.bucket.get(TAG)?.is_some_and(|text| text == TAG_TEXT.as_bytes()))
    }

    #[cfg(test)]
    pub(super) fn in_memory() -> Self {
        Self { place: "memory".into(), bucket: Bucket::in_memory().expect("a thread") }
    }
}

impl Store for BucketStore {
    fn place(&self) -> String {
        self.place.clone()
    }

    fn remedy(&self) -> &'static str {
        "check the server and what its credentials allow, or name another place with --cache"
    }

    fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>> {
        self.bucket.get(name)
    }

    fn put(&self, name: &str, record: &[u8], only_new: bool) -> io::Result<()> {
        if only_new { self.bucket.create(name, record).map(drop) } else { self.bucket.replace(name, record) }
    }

    fn list(&self) -> io::Result<Vec<Listed>> {
        let objects = self.bucket.list()?.into_iter();
        Ok(objects.map(|object| Listed { name: object.name, bytes: object.bytes, used: object.written }).collect())
    }

    fn remove(&self, names: &[&str]) -> Vec<bool> {
        self.bucket.remove(names)
    }

    fn touch(&self, _name: &str) {}

    fn sweep(&self) {}
}
