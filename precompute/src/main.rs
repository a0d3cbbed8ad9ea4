//! The `precompute` command: flags in, exit code out. All work is in the library and in [`commands`].

mod cli;
mod commands;

use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::lightmap::unwrap::xatlas::{CHILD_ARGUMENT, xatlas_child_main};
use std::io::{self, IsTerminal, Write};
use std::panic::{self, PanicHookInfo};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|argument| argument == CHILD_ARGUMENT) {
        return xatlas_child_main();
    }
    panic::set_hook(Box::new(report_panic));
    let exit = panic::catch_unwind(run).unwrap_or(Exit::Internal);
    ExitCode::from(exit.code())
}

fn run() -> Exit {
    let cli = match cli::Cli::read() {
        Ok(cli) => cli,
        Err(refused) => return if refused.print() { Exit::Usage } else { Exit::Done },
    };
    match commands::run(&cli) {
        Ok(()) => Exit::Done,
        Err(error) => {
            print_error(&error);
            error.exit
        }
    }
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
    static REPORTED: AtomicBool = AtomicBool::new(false);
    if REPORTED.swap(true, Ordering::Relaxed) {
        return;
    }
    let what = panic.payload_as_str().unwrap_or("no message").lines().collect::<Vec<_>>().join(" ");
    let place = panic.location().map_or_else(String::new, |place| format!(" ({}:{})", place.file(), place.line()));
    let help = "please report it with the command and its input";
    let _ = writeln!(io::stderr(), "internal error: {what}{place}; {help}");
}
