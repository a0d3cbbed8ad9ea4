//! `precompute completions` and `precompute man`: files that shells and `man` read.

use super::print_data;
use crate::cli::{Cli, Completions, Man};
use clap::CommandFactory;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::output::{OutputError, write_file};
use localprt_precompute::progress::Progress;

/// Runs `completions`.
pub fn completions(command: &Completions) -> Result<(), CommandError> {
    let mut text = Vec::new();
    clap_complete::generate(command.shell, &mut Cli::command(), "precompute", &mut text);
    print_data(&String::from_utf8_lossy(&text))
}

/// Runs `man`: a page for the command and one for each subcommand.
pub fn man(command: &Man, progress: &Progress) -> Result<(), CommandError> {
    let folder = &command.output;
    std::fs::create_dir_all(folder).map_err(|cause| OutputError::write(folder, cause))?;
    let mut whole = Cli::command();
    whole.build();
    let subcommands: Vec<clap::Command> =
        whole.get_subcommands().filter(|each| each.get_name() != "help").cloned().collect();
    let mut written = 0;
    for each in std::iter::once(whole).chain(subcommands) {
        // Of a subcommand "precompute bake" is what is typed, and "precompute-bake" what the page is called.
        let name = each.get_bin_name().unwrap_or("precompute").replace(' ', "-");
        let mut page = Vec::new();
        clap_mangen::Man::new(each.name(name.clone()))
            .render(&mut page)
            .map_err(|error| CommandError::of(Exit::Internal, &error))?;
        write_file(&folder.join(format!("{name}.1")), &page)?;
        written += 1;
    }
    progress.note(&format!("wrote {written} pages to {}", folder.display()));
    Ok(())
}
