//! Addresses of places in buckets: `s3://BUCKET/FOLDER`, `gs://BUCKET/FOLDER`, `az://CONTAINER/FOLDER`.

use std::fmt;

/// Who keeps a bucket, or whose words its server speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provider {
    /// Amazon S3, MinIO, Ceph, R2, ...
    S3,
    /// Google Cloud Storage.
    Google,
    /// Azure Blob Storage.
    Azure,
}

/// A place in a bucket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BucketUrl {
    provider: Provider,
    bucket: String,
    place: String,
}

/// Why a text is no address of a place in a bucket.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UrlError {
    /// It begins with nothing that is known.
    #[error("a bucket begins with s3://, gs:// or az://")]
    Scheme,
    /// It does not name a bucket.
    #[error("the name of the bucket is missing, as in {scheme}://BUCKET/FOLDER")]
    NoBucket {
        /// What it begins with.
        scheme: &'static str,
    },
    /// It has more than bucket and folders: credentials and options come from the environment.
    #[error("`{letter}` is more than the name of a bucket and folders in it; credentials come from the environment")]
    Letter {
        /// The first that is too much.
        letter: char,
    },
    /// A folder has no name, or one that means another place.
    #[error("a folder in a bucket cannot be called `{part}`")]
    Folder {
        /// Its name.
        part: String,
    },
}

impl Provider {
    const ALL: [Self; 3] = [Self::S3, Self::Google, Self::Azure];

    /// What its addresses begin with.
    pub fn scheme(self) -> &'static str {
        match self {
            Self::S3 => "s3",
            Self::Google => "gs",
            Self::Azure => "az",
        }
    }
}

impl BucketUrl {
    /// Reads an address.
    ///
    /// # Errors
    /// [`UrlError`]: what is wrong with it.
    pub fn parse(url: &str) -> Result<Self, UrlError> {
        let (scheme, rest) = url.split_once("://").ok_or(UrlError::Scheme)?;
        let provider =
            Provider::ALL.into_iter().find(|provider| provider.scheme() == scheme).ok_or(UrlError::Scheme)?;
        let is_more = |letter: char| matches!(letter, '@' | '?' | '#' | ':' | '\\') || letter.is_control();
        if let Some(letter) = rest.chars().find(|letter| is_more(*letter)) {
            return Err(UrlError::Letter { letter });
        }
        let (bucket, place) = rest.split_once('/').unwrap_or((rest, ""));
        if bucket.is_empty() {
            return Err(UrlError::NoBucket { scheme: provider.scheme() });
        }
        let place = place.trim_end_matches('/');
        let is_named = |part: &&str| part.is_empty() || matches!(*part, "." | "..");
        if let Some(part) = place.split('/').find(is_named).filter(|_| !place.is_empty()) {
            return Err(UrlError::Folder { part: part.to_owned() });
        }
        Ok(Self { provider, bucket: bucket.to_owned(), place: place.to_owned() })
    }

    /// Who keeps it.
    pub fn provider(&self) -> Provider {
        self.provider
    }

    /// Name of the bucket.
    pub fn bucket(&self) -> &str {
        &self.bucket
    }

    /// Folders in it, with `/` between them; may be empty.
    pub fn place(&self) -> &str {
        &self.place
    }
}

impl fmt::Display for BucketUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}://{}", self.provider.scheme(), self.bucket)?;
        if self.place.is_empty() { Ok(()) } else { write!(formatter, "/{}", self.place) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_name_a_bucket_and_a_folder_and_nothing_more() {
        let url = BucketUrl::parse("s3://bakes/hall/v2/").expect("is one");
        assert_eq!((url.provider(), url.bucket(), url.place()), (Provider::S3, "bakes", "hall/v2"));
        assert_eq!(url.to_string(), "s3://bakes/hall/v2");
        assert_eq!(BucketUrl::parse("az://bakes").expect("is one").to_string(), "az://bakes");
        assert_eq!(BucketUrl::parse("gs://bakes/").expect("is one").place(), "");
        let refused = |url| BucketUrl::parse(url).expect_err("is none");
        assert_eq!(refused("s3://"), UrlError::NoBucket { scheme: "s3" });
        assert_eq!(refused("s3:///hall"), UrlError::NoBucket { scheme: "s3" });
        assert_eq!(refused("s3:/bakes"), UrlError::Scheme);
        assert_eq!(refused("ftp://bakes"), UrlError::Scheme);
        assert_eq!(refused("s3://name:key@bakes"), UrlError::Letter { letter: ':' });
        assert_eq!(refused("az://bakes?sig=key"), UrlError::Letter { letter: '?' });
        assert_eq!(refused("s3://bakes/a//b"), UrlError::Folder { part: String::new() });
        assert_eq!(refused("s3://bakes/../b"), UrlError::Folder { part: "..".into() });
    }
}
