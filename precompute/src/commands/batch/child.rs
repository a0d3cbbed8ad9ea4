//! One command of a batch, in a process of its own.
//!
//! A panic, a want of memory or a killed process ends one scene and not the others; each has its exit code, its largest size
//! and its messages for itself; and no library keeps anything from one scene to the next.

use super::outcome::Failure;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::memory::peak_rss_bytes;
use localprt_precompute::progress::Progress;
use localprt_tools::error::reason;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How often a child is looked after.
const LOOK: Duration = Duration::from_millis(20);
/// How long a child that was asked to stop may take: between two leaves of a bake there may be minutes. Then it is killed, which harms
/// no file: they are written whole or not at all.
const GRACE: Duration = Duration::from_secs(5);

/// How a command ended.
pub struct Ended {
    /// What went wrong.
    pub failure: Option<Failure>,
    /// Largest resident size seen; 0 where the system does not say.
    pub peak_rss_bytes: u64,
    /// Wall time.
    pub seconds: f64,
}

/// Runs this program with other arguments in `folder` and appends what it says to `log`. If the batch is to stop, so is the child,
/// and this waits for it.
pub fn run(arguments: &[String], folder: &Path, log: &Path, progress: &Progress) -> Ended {
    let started = Instant::now();
    let (failure, peak_rss_bytes) = match start(arguments, folder, log) {
        Err(failure) => (Some(failure), 0),
        Ok((mut child, log_start)) => {
            let (status, peak) = watch(&mut child, progress);
            let failure = match status {
                Ok(status) if status.success() => None,
                Ok(status) if status.code().is_none() && progress.is_cancelled() => {
                    Some(Failure::new(Exit::Interrupted, "interrupted; nothing was written"))
                }
                Ok(status) => Some(failure_of(status, &said(log, log_start))),
                Err(error) => Some(Failure::new(Exit::Internal, format!("the command was lost: {}", reason(&error)))),
            };
            (failure, peak)
        }
    };
    Ended { failure, peak_rss_bytes, seconds: started.elapsed().as_secs_f64() }
}

/// The running command, and where in its log its messages begin.
fn start(arguments: &[String], folder: &Path, log: &Path) -> Result<(Child, usize), Failure> {
    let open = || File::options().create(true).append(true).open(log);
    let refused = |error: io::Error| {
        let error = CommandError::new(Exit::Io, format!("cannot be written: {}", reason(&error))).in_file(log);
        Failure::from(&error.help("choose a folder that this user may write to"))
    };
    let mut file = open().map_err(refused)?;
    writeln!(file, "$ precompute {}", arguments.join(" ")).map_err(refused)?;
    let log_start = file.metadata().map_err(refused)?.len() as usize;
    let not_started = |error: io::Error| {
        Failure::new(Exit::Internal, format!("the command could not be started: {}", reason(&error)))
    };
    let mut command = Command::new(std::env::current_exe().map_err(not_started)?);
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1");
    command.stdin(Stdio::null()).stdout(file.try_clone().map_err(refused)?).stderr(file);
    // Ctrl-C of the terminal is for the batch, which passes it on once: a second one would not let the child clean up.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    Ok((command.spawn().map_err(not_started)?, log_start))
}

/// Waits for the end; the largest size seen on the way.
fn watch(child: &mut Child, progress: &Progress) -> (io::Result<ExitStatus>, u64) {
    let number = child.id().to_string();
    let (mut peak, mut told) = (0, None);
    loop {
        peak = peak.max(peak_rss_bytes(&number).unwrap_or(0));
        match child.try_wait() {
            Ok(None) => {}
            Ok(Some(status)) => return (Ok(status), peak),
            Err(error) => return (Err(error), peak),
        }
        match told {
            None if progress.is_cancelled() => {
                stop(child);
                told = Some(Instant::now());
            }
            Some(at) if at.elapsed() > GRACE => {
                // It may have ended by itself.
                let _ = child.kill();
            }
            _ => {}
        }
        sleep(LOOK);
    }
}

/// Asks a command to stop.
#[cfg(unix)]
fn stop(child: &mut Child) {
    use nix::sys::signal::{Signal, kill};
    // It may have ended by itself.
    let _ = kill(nix::unistd::Pid::from_raw(child.id() as i32), Signal::SIGTERM);
}

/// Elsewhere a console tells all its programs.
#[cfg(not(unix))]
fn stop(_: &mut Child) {}

/// What the command said.
fn said(log: &Path, start: usize) -> String {
    let bytes = std::fs::read(log).unwrap_or_default();
    String::from_utf8_lossy(bytes.get(start..).unwrap_or_default()).into_owned()
}

/// The error that the command printed, with its exit code.
fn failure_of(status: ExitStatus, said: &str) -> Failure {
    let Some(code) = status.code() else {
        let what = format!("the command was killed ({status})");
        let help = "if memory ran out, give --jobs a smaller number or the scene fewer receivers";
        return Failure { help: Some(help.into()), ..Failure::new(Exit::Internal, what) };
    };
    let exit = super::exit_of(code);
    let lines: Vec<&str> = said.lines().collect();
    let error = lines.iter().rposition(|line| line.starts_with("error: ") || line.starts_with("internal error: "));
    let Some(error) = error else {
        return Failure::new(exit, format!("the command ended with exit code {code} and said nothing"));
    };
    let help = lines[error..].iter().find_map(|line| line.strip_prefix("help: ")).map(str::to_owned);
    Failure { help, ..Failure::new(exit, lines[error].trim_start_matches("error: ")) }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn the_last_error_that_a_command_printed_is_the_scenes() {
        let status = ExitStatus::from_raw(3 << 8);
        let found =
            failure_of(status, "load ...\nerror: a\nhelp: b\nerror: hall.glb: is cut off\nhelp: copy it again\n");
        assert_eq!((found.exit, found.what.as_str()), (Exit::InvalidInput, "hall.glb: is cut off"));
        assert_eq!(found.help.as_deref(), Some("copy it again"));
        assert!(failure_of(status, "load ...\n").what.contains("exit code 3"));
        let panicked = failure_of(ExitStatus::from_raw(1 << 8), "internal error: index (a.rs:3); please report it\n");
        assert_eq!((panicked.exit, panicked.what.starts_with("internal error: index")), (Exit::Internal, true));
        let killed = failure_of(ExitStatus::from_raw(9), "");
        assert_eq!(killed.exit, Exit::Internal);
        assert!(killed.what.contains("signal: 9") && killed.help.is_some_and(|help| help.contains("--jobs")));
    }
}
