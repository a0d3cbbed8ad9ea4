//! The `precompute` command: flags in, exit code out. All work is in the library and in [`commands`].

mod cli;
mod commands;

use localprt_precompute::error::Exit;
use localprt_precompute::lightmap::unwrap::xatlas::{CHILD_ARGUMENT, xatlas_child_main};
use localprt_tools::program::finish;
use std::process::ExitCode;

fn main() -> ExitCode {
    return_large_arrays();
    if std::env::args_os().nth(1).is_some_and(|argument| argument == CHILD_ARGUMENT) {
        return xatlas_child_main();
    }
    match cli::Cli::read() {
        Ok(cli) => finish(|| commands::run(&cli)),
        Err(refused) => ExitCode::from(if refused.print() { Exit::Usage } else { Exit::Done }.code()),
    }
}

/// Large arrays get pages of their own, which go back to the system as they are freed. By default glibc takes the size of what was freed
/// for the size from which it does so, and the leaves of a bake, which come and go on all threads, leave holes that nothing fills:
/// the peak of a city of four blocks was 283 MB, and is 201. What the fit of each receiver takes and gives back, a quarter of a megabyte at a time, is
/// no large array: pages that come and go with it were a twentieth of a bake.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn return_large_arrays() {
    use nix::libc::{M_MMAP_THRESHOLD, M_TRIM_THRESHOLD, mallopt};
    const LARGE: i32 = 320 << 10;
    const FREE: i32 = 1 << 20;
    for (option, bytes) in [(M_MMAP_THRESHOLD, LARGE), (M_TRIM_THRESHOLD, FREE)] {
        #[expect(unsafe_code, reason = "sets a number of the allocator, before there is another thread")]
        // SAFETY: mallopt takes no pointers, and a value out of range changes nothing.
        unsafe {
            mallopt(option, bytes);
        }
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn return_large_arrays() {}
