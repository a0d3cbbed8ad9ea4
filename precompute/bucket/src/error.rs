//! What a server refuses, as errors of input and output, in words that hold no address and no credential.

use object_store::Error;
use std::{error::Error as _, io};

/// What servers call buckets that do not exist: S3 and Google, and Azure.
const NO_BUCKET: [&str; 2] = ["NoSuchBucket", "ContainerNotFound"];
const NO_BUCKET_TEXT: &str = "there is no such bucket";

/// The same with a kind that says who can act.
pub(crate) fn as_io(error: &Error) -> io::Error {
    let is = |kind, text: &str| io::Error::new(kind, text);
    match error {
        Error::NotFound { .. } if NO_BUCKET.iter().any(|code| error.to_string().contains(code)) => {
            is(io::ErrorKind::NotFound, NO_BUCKET_TEXT)
        }
        Error::NotFound { .. } => is(io::ErrorKind::NotFound, "there is no such object"),
        Error::AlreadyExists { .. } | Error::Precondition { .. } => {
            is(io::ErrorKind::AlreadyExists, "the object exists already")
        }
        Error::PermissionDenied { .. } => is(io::ErrorKind::PermissionDenied, "access is denied"),
        Error::Unauthenticated { .. } => is(io::ErrorKind::PermissionDenied, "the credentials are not accepted"),
        Error::NotImplemented { .. } | Error::NotSupported { .. } => {
            is(io::ErrorKind::Unsupported, "the server does not do this")
        }
        _ => io::Error::other(cause(error)),
    }
}

/// Whether it says that the bucket, and not an object, is missing.
pub(crate) fn names_bucket(error: &io::Error) -> bool {
    error.to_string() == NO_BUCKET_TEXT
}

/// Whether no answer came, or none that means anything.
pub(crate) fn is_silence(error: &Error) -> bool {
    matches!(error, Error::Generic { .. })
}

/// The innermost reason: the outer ones repeat addresses, which may hold a signature.
fn cause(error: &Error) -> String {
    let mut innermost = error.to_string();
    let mut source = error.source();
    while let Some(inner) = source {
        innermost = inner.to_string();
        source = inner.source();
    }
    let line = innermost.lines().next().unwrap_or_default();
    // The body of an answer, and what follows the path of an address.
    let line = line.split(['<', '?']).next().unwrap_or_default();
    line.split(" (os error").next().unwrap_or_default().trim_end_matches([' ', ':']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn generic(text: &'static str) -> Error {
        Error::Generic { store: "S3", source: text.into() }
    }

    #[test]
    fn messages_hold_no_signature_and_no_answer_of_the_server() {
        let told = |text| as_io(&generic(text)).to_string();
        assert_eq!(told("error for url https://a.net/b?sig=secret"), "error for url https://a.net/b");
        assert_eq!(told("Server returned non-2xx status code: 400 Bad Request: <?xml <Key>secret"), {
            "Server returned non-2xx status code: 400 Bad Request"
        });
        assert_eq!(told("Connection refused (os error 111)"), "Connection refused");
    }

    #[test]
    fn a_missing_bucket_is_told_from_a_missing_object() {
        let missing = |text: &'static str| as_io(&Error::NotFound { path: "a".into(), source: text.into() });
        assert!(names_bucket(&missing("<Code>NoSuchBucket</Code>")));
        assert!(!names_bucket(&missing("<Code>NoSuchKey</Code>")));
        assert!(is_silence(&generic("x")) && !is_silence(&Error::NotModified { path: "a".into(), source: "x".into() }));
    }
}
