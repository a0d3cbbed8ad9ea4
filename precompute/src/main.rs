//! The `precompute` command: flags in, exit code out. All work is in the library and in [`commands`].

mod cli;
mod commands;

use localprt_precompute::error::Exit;
use localprt_precompute::lightmap::unwrap::xatlas::{CHILD_ARGUMENT, xatlas_child_main};
use localprt_tools::program::finish;
use std::process::ExitCode;

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|argument| argument == CHILD_ARGUMENT) {
        return xatlas_child_main();
    }
    match cli::Cli::read() {
        Ok(cli) => finish(|| commands::run(&cli)),
        Err(refused) => ExitCode::from(if refused.print() { Exit::Usage } else { Exit::Done }.code()),
    }
}
