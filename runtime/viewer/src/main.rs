//! The `viewer` command: flags in, a window or pictures out.

use clap::Parser;
use localprt_tools::error::Exit;
use localprt_tools::program::finish;
use localprt_viewer::cli::Cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(refused) => {
            // A reader that has gone away has read enough.
            let _ = refused.print();
            let exit = if refused.use_stderr() { Exit::Usage } else { Exit::Done };
            return ExitCode::from(exit.code());
        }
    };
    finish(|| localprt_viewer::run(&cli))
}
