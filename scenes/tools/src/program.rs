//! How a command ends: its exit code, one line for an error, one line for a panic.

use crate::error::{CommandError, Exit};
use std::io::{self, IsTerminal, Write};
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs a command, and tells standard error what went wrong. A panic is exit code 1.
pub fn finish(run: impl FnOnce() -> Result<(), CommandError>) -> ExitCode {
    panic::set_hook(Box::new(report_panic));
    // Nothing of what the command has touched is used again.
    let exit = match panic::catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => Exit::Done,
        Ok(Err(error)) => {
            print_error(&error);
            error.exit
        }
        Err(_) => Exit::Internal,
    };
    ExitCode::from(exit.code())
}

fn print_error(error: &CommandError) {
    let mut stderr = io::stderr();
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
        || std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    let label = if plain || !stderr.is_terminal() { "error:" } else { "\x1b[1;31merror:\x1b[0m" };
    // Nobody listens if this fails; the exit code still tells.
    let _ = writeln!(stderr, "{label} {error}");
}

/// One line for the first panic, whichever thread it is on; the others follow from it.
fn report_panic(panic: &PanicHookInfo<'_>) {
    // Of a file that a library could not read: the error says so.
    if localprt_scenes::is_guarded() {
        return;
    }
    static REPORTED: AtomicBool = AtomicBool::new(false);
    if REPORTED.swap(true, Ordering::Relaxed) {
        return;
    }
    let what = panic.payload_as_str().unwrap_or("no message").lines().collect::<Vec<_>>().join(" ");
    let place = panic.location().map_or_else(String::new, |place| format!(" ({}:{})", place.file(), place.line()));
    let help = "please report it with the command and its input";
    let _ = writeln!(io::stderr(), "internal error: {what}{place}; {help}");
}
