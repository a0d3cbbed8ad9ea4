//! Named bytes in a bucket: S3 and what speaks like it, Google Cloud Storage, Azure Blob Storage.
//!
//! In and out: whole objects of bytes by name, below one place of a bucket. The interface is blocking and may be called from many threads at
//! once; the connections are driven by one thread of its own. It must not be called from within a `tokio` runtime. What the bytes are is
//! left to others.
//!
//! ```no_run
//! use localprt_bucket::{Bucket, BucketUrl};
//!
//! let bucket = Bucket::connect(&BucketUrl::parse("s3://bakes/hall")?)?;
//! assert!(bucket.create("ab/cd", b"bytes")?, "nothing was there");
//! assert_eq!(bucket.get("ab/cd")?.as_deref(), Some(&b"bytes"[..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A server that does not answer holds nobody up for long: a request has half a minute, and is repeated for ten seconds at most; then
//! the server is not asked again for a minute, and whatever is asked of it fails at once.

mod connect;
mod error;
mod url;

pub use url::{BucketUrl, Provider, UrlError};

use error::{as_io, is_silence};
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::{ObjectMeta, ObjectStore, ObjectStoreExt, PutMode, PutPayload, path::Path};
use std::{
    io,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant, SystemTime},
};
use tokio::runtime::{Builder, Runtime};

/// How long a server that did not answer is left alone.
const PAUSE: Duration = Duration::from_secs(60);

/// A place in a bucket.
pub struct Bucket {
    objects: Arc<dyn ObjectStore>,
    /// All names are below it.
    place: Path,
    runtime: Runtime,
    /// Until when nothing is asked.
    paused: Mutex<Option<Instant>>,
}

/// An object in a bucket.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// Its name below the place.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// When it was written last, by the clock of the server.
    pub written: SystemTime,
}

impl Bucket {
    /// The place that a URL names, with credentials from the environment. Nothing is asked of the server yet.
    ///
    /// # Errors
    /// What of the environment does not fit together; or the system has no thread to give.
    pub fn connect(url: &BucketUrl) -> io::Result<Self> {
        let objects = connect::to(url).map_err(|error| as_io(&error))?;
        Self::over(objects, url.place())
    }

    /// A bucket in memory that is gone with this value: for tests.
    ///
    /// # Errors
    /// The system has no thread to give.
    pub fn in_memory() -> io::Result<Self> {
        Self::over(Arc::new(object_store::memory::InMemory::new()), "in/memory")
    }

    fn over(objects: Arc<dyn ObjectStore>, place: &str) -> io::Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(1).thread_name("bucket").enable_all().build()?;
        Ok(Self { objects, place: Path::from(place), runtime, paused: Mutex::new(None) })
    }

    /// Content of an object; `None` if there is none.
    ///
    /// # Errors
    /// The server does not answer, or refuses; or there is no such bucket.
    pub fn get(&self, name: &str) -> io::Result<Option<Vec<u8>>> {
        let path = self.path(name);
        let found = self.wait(async { self.objects.get(&path).await?.bytes().await });
        match found {
            Ok(content) => Ok(Some(content.into())),
            // A server says "not found" of a bucket, too.
            Err(error) if error.kind() == io::ErrorKind::NotFound && !error::names_bucket(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Writes an object unless there is one of its name; whether it did. Of several writers at once one does.
    ///
    /// # Errors
    /// As [`Bucket::get`].
    pub fn create(&self, name: &str, content: &[u8]) -> io::Result<bool> {
        match self.put(name, content, PutMode::Create) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            // Conditions can be switched off for servers that know none.
            Err(error) if error.kind() == io::ErrorKind::Unsupported => self.replace(name, content).map(|()| true),
            Err(error) => Err(error),
        }
    }

    /// Writes an object, in place of another of its name if there is one. Of several writers the last one wins.
    ///
    /// # Errors
    /// As [`Bucket::get`].
    pub fn replace(&self, name: &str, content: &[u8]) -> io::Result<()> {
        self.put(name, content, PutMode::Overwrite)
    }

    /// All objects below the place, in no order. A request for each thousand of them.
    ///
    /// # Errors
    /// As [`Bucket::get`].
    pub fn list(&self) -> io::Result<Vec<Listed>> {
        let found: Vec<ObjectMeta> = self.wait(self.objects.list(Some(&self.place)).try_collect())?;
        let listed = |object: ObjectMeta| {
            let parts: Vec<_> =
                object.location.prefix_match(&self.place)?.map(|part| part.as_ref().to_owned()).collect();
            Some(Listed { name: parts.join("/"), bytes: object.size, written: object.last_modified.into() })
        };
        Ok(found.into_iter().filter_map(listed).collect())
    }

    /// Removes objects, many with one request where the server knows how to. Says of each whether it is gone.
    pub fn remove(&self, names: &[&str]) -> Vec<bool> {
        let paths: Vec<Path> = names.iter().map(|name| self.path(name)).collect();
        let removed = async {
            let wanted = stream::iter(paths.clone()).map(Ok).boxed();
            let gone = |removed: object_store::Result<Path>| async move {
                match removed {
                    Ok(path) => Some(path),
                    Err(object_store::Error::NotFound { path, .. }) => Some(Path::from(path)),
                    Err(_) => None,
                }
            };
            Ok(self.objects.delete_stream(wanted).filter_map(gone).collect::<std::collections::HashSet<Path>>().await)
        };
        let removed = self.wait(removed).unwrap_or_default();
        paths.iter().map(|path| removed.contains(path)).collect()
    }

    fn put(&self, name: &str, content: &[u8], mode: PutMode) -> io::Result<()> {
        let path = self.path(name);
        let payload = PutPayload::from(content.to_vec());
        self.wait(async { self.objects.put_opts(&path, payload, mode.into()).await.map(drop) })
    }

    fn path(&self, name: &str) -> Path {
        self.place.parts().chain(Path::from(name).parts()).collect()
    }

    /// Waits for a request, unless the server did not answer a moment ago.
    fn wait<T>(&self, request: impl Future<Output = object_store::Result<T>>) -> io::Result<T> {
        let paused = || self.paused.lock().unwrap_or_else(PoisonError::into_inner);
        if paused().is_some_and(|end| Instant::now() < end) {
            return Err(io::Error::new(io::ErrorKind::TimedOut, "the server did not answer a moment ago"));
        }
        self.runtime.block_on(request).map_err(|error| {
            if is_silence(&error) {
                *paused() = Some(Instant::now() + PAUSE);
            }
            as_io(&error)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io::ErrorKind, net::TcpListener, thread};

    #[test]
    fn what_is_there_is_left_alone_unless_it_is_replaced() {
        let bucket = Bucket::in_memory().expect("opens");
        assert_eq!(bucket.get("ab/one.leaf").expect("asked"), None);
        assert!(bucket.create("ab/one.leaf", b"first").expect("made"));
        assert!(!bucket.create("ab/one.leaf", b"second").expect("asked"));
        assert_eq!(bucket.get("ab/one.leaf").expect("asked").as_deref(), Some(&b"first"[..]));
        bucket.replace("ab/one.leaf", b"third").expect("replaced");
        bucket.replace("cd/two.leaf", b"new").expect("made");
        assert_eq!(bucket.get("ab/one.leaf").expect("asked").as_deref(), Some(&b"third"[..]));
        let mut names: Vec<(String, u64)> =
            bucket.list().expect("listed").into_iter().map(|object| (object.name, object.bytes)).collect();
        names.sort();
        assert_eq!(names, [("ab/one.leaf".into(), 5), ("cd/two.leaf".into(), 3)]);
        assert_eq!(bucket.remove(&["ab/one.leaf", "cd/two.leaf"]), [true, true]);
        assert!(bucket.list().expect("listed").is_empty());
    }

    #[test]
    fn of_many_writers_at_once_one_creates() {
        let bucket = Bucket::in_memory().expect("opens");
        let created = thread::scope(|scope| {
            let writer = |number: u8| {
                let bucket = &bucket;
                scope.spawn(move || bucket.create("name", &[number; 1000]).expect("asked"))
            };
            let writers: Vec<_> = (0..32).map(writer).collect();
            writers.into_iter().map(|writer| u32::from(writer.join().expect("ends"))).sum::<u32>()
        });
        assert_eq!(created, 1);
        let content = bucket.get("name").expect("asked").expect("there");
        assert!(content.len() == 1000 && content.iter().all(|byte| *byte == content[0]), "one of them, whole");
    }

    #[test]
    fn a_server_that_is_not_there_is_asked_once_a_minute() {
        // A port that was free a moment ago.
        let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port").port();
        let objects = object_store::aws::AmazonS3Builder::new()
            .with_bucket_name("bakes")
            .with_endpoint(format!("http://127.0.0.1:{port}"))
            .with_allow_http(true)
            .with_access_key_id("name")
            .with_secret_access_key("never-told")
            .with_retry(connect::few_retries())
            .build()
            .expect("described");
        let bucket = Bucket::over(Arc::new(objects), "").expect("opens");
        let begun = Instant::now();
        let refused = bucket.get("name").expect_err("nobody is there");
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
        assert!(!refused.to_string().contains("never-told"), "{refused}");
        let begun = Instant::now();
        for _ in 0..100 {
            assert_eq!(bucket.create("name", b"x").expect_err("left alone").kind(), ErrorKind::TimedOut);
        }
        assert!(begun.elapsed() < Duration::from_secs(1) && bucket.remove(&["name"]) == [false]);
    }
}
