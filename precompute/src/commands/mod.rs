//! One plain function per subcommand, and what they share: reading inputs, writing data to standard output.

mod bake;
mod batch;
mod cache;
mod demo;
mod diff;
mod doctor;
mod help_files;
mod info;
mod lit_scene;
mod relight;
mod scene;
mod shards;
mod validate;

use crate::cli::{Cli, Command, Global};
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::output;
use localprt_precompute::progress::{Progress, Verbosity};
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

/// Runs a command line.
///
/// # Errors
/// What the user has to know, with its exit code.
pub fn run(cli: &Cli) -> Result<(), CommandError> {
    start_threads(&cli.global)?;
    let verbosity = match (cli.global.quiet, cli.global.verbose) {
        (true, _) => Verbosity::Quiet,
        (false, 0) => Verbosity::Normal,
        _ => Verbosity::Verbose,
    };
    let progress = Progress::on_stderr(verbosity);
    progress.watch_interrupt();
    match &cli.command {
        Command::Bake(command) => bake::run(command, &progress),
        Command::Relight(command) => relight::run(command, &progress),
        Command::Validate(command) => validate::run(command, &progress),
        Command::Info(command) => info::run(command),
        Command::Check(command) => info::check(command),
        Command::Plan(command) => shards::plan(command, &progress),
        Command::Merge(command) => shards::merge(command, &progress),
        Command::Cache(command) => cache::run(command),
        Command::Batch(command) => batch::run(command, &cli.global, &progress),
        Command::Diff(command) => diff::run(command, &progress),
        Command::Scene(command) => scene::run(command, &progress),
        Command::Demo(command) => demo::run(command, &progress),
        Command::Doctor(command) => doctor::run(command),
        Command::Completions(command) => help_files::completions(command),
        Command::Man(command) => help_files::man(command, &progress),
    }
}

fn start_threads(global: &Global) -> Result<(), CommandError> {
    let Some(threads) = global.threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global().map_err(|error| {
        CommandError::of(Exit::Internal, &error).help("give --threads a smaller number, or leave it out")
    })
}

/// Data for the user's next program. A reader that has gone away has read enough.
fn print_data(text: &str) -> Result<(), CommandError> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(output::OutputError::write(Path::new("standard output"), error).into())
        }
        _ => Ok(()),
    }
}

/// Writes text to a file, or to standard output if that is `-`.
fn write_text(path: &Path, text: &str) -> Result<(), CommandError> {
    if path == Path::new("-") {
        return print_data(text);
    }
    Ok(output::write_file(path, text.as_bytes())?)
}

/// Refuses an output before the work for it begins; `-` is always fine.
fn check_output(path: Option<&Path>) -> Result<(), CommandError> {
    match path {
        Some(path) if path != Path::new("-") => Ok(output::check_writable(path)?),
        _ => Ok(()),
    }
}

fn to_json(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).unwrap_or_default();
    text.push('\n');
    text
}

/// `1,234,567`
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `999 B`, `12.3 kB`, `1.2 GB`: powers of 1000.
fn size(bytes: u64) -> String {
    let units = ["kB", "MB", "GB", "TB"];
    if bytes < 1000 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1000.0;
    let mut unit = 0;
    while value >= 999.95 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    format!("{value:.1} {}", units[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_easy_to_read() {
        assert_eq!((grouped(0), grouped(999), grouped(1_234_567)), ("0".into(), "999".into(), "1,234,567".into()));
        assert_eq!((size(999), size(12_345), size(999_950)), ("999 B".into(), "12.3 kB".into(), "1.0 MB".into()));
        assert_eq!(size(u64::MAX), "18446744.1 TB");
    }
}
