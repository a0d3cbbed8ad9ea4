//! Code of others that reads files from anywhere, and may fail in its own ways.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What `work` returns; an error that says `failed` if it panics. It must leave nothing behind that is used again.
pub(crate) fn guarded<T>(failed: &str, work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    let before = IS_GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    IS_GUARDED.set(before);
    result.unwrap_or_else(|_| Err(failed.to_owned()))
}

/// Whether a panic on this thread would become the error of a file, and is nothing that a panic hook has to report.
pub fn is_guarded() -> bool {
    IS_GUARDED.get()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_of_others_are_errors_and_known_as_such() {
        assert!(!is_guarded());
        assert_eq!(guarded("failed", || Ok(is_guarded())), Ok(true));
        assert_eq!(guarded("failed", || Err::<(), _>("refused".into())), Err("refused".into()));
        let nested = guarded("outer", || {
            assert_eq!(guarded("inner", || -> Result<(), String> { panic!("its own way") }), Err("inner".into()));
            Ok(is_guarded())
        });
        assert_eq!((nested, is_guarded()), (Ok(true), false));
    }
}
