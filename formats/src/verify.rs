//! Full verification of a file: what opening checks, and all that reads every byte once more.

use std::path::Path;

use crate::error::{OpenError, Violation};
use crate::open;

/// Full verification of a file: structure, every checksum, the content hash and every invariant. Empty if all hold.
///
/// Damage to the structure hides what lies behind it, so it is reported alone; otherwise every section with a wrong
/// checksum is listed, and the first broken invariant.
///
/// # Errors
/// [`OpenError::Io`] if the file cannot be read; everything else is in the list.
pub fn check(path: impl AsRef<Path>) -> Result<Vec<Violation>, OpenError> {
    Ok(check_bytes(open::map(path.as_ref())?.as_slice()))
}

/// [`check`] of a file in memory.
pub fn check_bytes(file: &[u8]) -> Vec<Violation> {
    open::check_file(file).iter().filter_map(violation).collect()
}

fn violation(error: &OpenError) -> Option<Violation> {
    let message = match error {
        OpenError::Invalid(violation) => violation.message.clone(),
        other => other.to_string(),
    };
    error.rule().map(|rule| Violation { rule, message })
}
