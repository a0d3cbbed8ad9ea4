//! Where a cache is, as it is written after `--cache`; and why none can be there.

use crate::{
    error::{CommandError, Exit},
    output::OutputError,
};
use std::{
    ffi::OsString,
    fmt, io,
    path::{Path, PathBuf},
};

#[cfg(feature = "bucket")]
pub(super) use localprt_bucket::BucketUrl;

/// What buckets begin with.
const SCHEMES: [&str; 3] = ["s3", "gs", "az"];

/// A folder, or a place in a bucket.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// A folder, there or not.
    Folder(PathBuf),
    /// A place in a bucket, with the feature `bucket`.
    #[cfg(feature = "bucket")]
    Bucket(BucketUrl),
}

/// Why a text names no place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPlace {
    /// It looks like an address, but not like one that is known.
    #[error("a cache is a folder, or a bucket: {reason}; a folder of this name is written ./{text}")]
    Address {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// It names a bucket, and this build knows none.
    #[error(
        "this build has no buckets; build it with: cargo build --release -p localprt-precompute --features bucket; a folder \
         of this name is written ./{text}"
    )]
    NoBuckets {
        /// What was given.
        text: String,
    },
}

/// Why a place cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// A folder cannot be made, or written into.
    #[error(transparent)]
    Folder(#[from] OutputError),
    /// A bucket is not there, does not answer, or refuses.
    #[error("the bucket cannot be used: {cause}")]
    Bucket {
        /// Its address.
        place: String,
        /// Why.
        cause: io::Error,
        /// What to do.
        remedy: String,
    },
}

impl Place {
    /// Reads what stands after `--cache`. What looks like the address of a bucket is never taken for a folder.
    ///
    /// # Errors
    /// [`NoPlace`]: it is no address of a bucket, or this build has none.
    pub fn parse(text: OsString) -> Result<Self, NoPlace> {
        match text.to_str().filter(|text| is_address(text)) {
            Some(text) => Self::of_address(text),
            None => Ok(Self::Folder(text.into())),
        }
    }

    #[cfg(feature = "bucket")]
    fn of_address(text: &str) -> Result<Self, NoPlace> {
        let url = BucketUrl::parse(text);
        url.map(Self::Bucket).map_err(|error| NoPlace::Address { text: text.into(), reason: error.to_string() })
    }

    #[cfg(not(feature = "bucket"))]
    fn of_address(text: &str) -> Result<Self, NoPlace> {
        if SCHEMES.iter().any(|scheme| text.starts_with(&format!("{scheme}://"))) {
            return Err(NoPlace::NoBuckets { text: text.into() });
        }
        Err(NoPlace::Address { text: text.into(), reason: "one begins with s3://, gs:// or az://".into() })
    }

    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        matches!(self, Self::Folder(_))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(path) => path.display().fmt(formatter),
            #[cfg(feature = "bucket")]
            Self::Bucket(url) => url.fmt(formatter),
        }
    }
}

/// Whether a text is meant as the address of something that is no folder: `word://...`, or a bucket with a mistake.
pub(super) fn is_address(text: &str) -> bool {
    let Some((word, rest)) = text.split_once(':') else { return false };
    let is_word =
        word.len() > 1 && word.bytes().all(|letter| letter.is_ascii_alphanumeric() || b"+-.".contains(&letter));
    is_word && (rest.starts_with("//") || SCHEMES.contains(&word.to_ascii_lowercase().as_str()))
}

impl PlaceError {
    #[cfg(feature = "bucket")]
    pub(super) fn bucket(url: &BucketUrl, cause: io::Error) -> Self {
        use localprt_bucket::Provider;
        let [server, credentials] = match url.provider() {
            Provider::S3 => [
                "AWS_ENDPOINT (with AWS_ALLOW_HTTP=true for http), AWS_REGION",
                "AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY",
            ],
            Provider::Google => ["the network", "GOOGLE_APPLICATION_CREDENTIALS"],
            Provider::Azure => ["AZURE_STORAGE_ACCOUNT_NAME", "AZURE_STORAGE_ACCOUNT_KEY"],
        };
        let remedy = match cause.kind() {
            io::ErrorKind::NotFound => "make the bucket first, or check its name".into(),
            io::ErrorKind::PermissionDenied => {
                format!("check the credentials ({credentials}) and what they allow, or bake with --no-cache")
            }
            _ => format!("check the server ({server}) and the credentials ({credentials}), or bake with --no-cache"),
        };
        Self::Bucket { place: url.to_string(), cause, remedy }
    }
}

impl From<PlaceError> for CommandError {
    fn from(error: PlaceError) -> Self {
        let shown = Self::of(Exit::Io, &error);
        match error {
            PlaceError::Folder(error) => error.into(),
            PlaceError::Bucket { place, remedy, .. } => shown.in_file(Path::new(&place)).help(remedy),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_looks_like_an_address_is_never_a_folder() {
        for folder in ["kept", "/srv/bakes", "../a:b", "./s3://x", "C:\\bakes", "C:/bakes", "a b://c", "s3", ""] {
            assert_eq!(Place::parse(folder.into()), Ok(Place::Folder(folder.into())));
        }
        for address in ["ftp://x", "http://x/y", "s3:", "s3:/x", "s3:x", "S3://x", "s3a://x", "file:///x"] {
            let refused = Place::parse(address.into()).expect_err(address);
            assert!(refused.to_string().contains("s3://, gs://"), "{refused}");
        }
    }

    #[test]
    fn buckets_come_with_their_feature() {
        for address in ["s3://bakes", "gs://bakes/hall", "az://bakes/hall/v2"] {
            let place = Place::parse(address.into());
            if cfg!(feature = "bucket") {
                let place = place.expect("is one");
                assert!(place.to_string() == address && !place.is_folder());
            } else {
                assert!(place.expect_err("not here").to_string().contains("--features bucket"));
            }
        }
    }
}
