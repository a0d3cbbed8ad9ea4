//! Progress, messages and interruption of long work.
//!
//! One [`Progress`] is shared by all threads of a command. Stages show a bar with a time estimate on a terminal and plain
//! lines otherwise, on standard error. What was done, how long it took and what was warned of is kept for the report.
//! Libraries take `&Progress` too; [`Progress::silent`] shows nothing. Stages, notes and warnings are events of `tracing` as well,
//! with the target `localprt`: a program that bakes has them in its own log.

use crate::memory::peak_rss_bytes;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Target of all events.
const TARGET: &str = "localprt";

/// How much to say on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only.
    Quiet,
    /// Stages, results and warnings.
    #[default]
    Normal,
    /// Details of each stage too.
    Verbose,
}

/// The work was stopped on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; nothing was written")]
pub struct Cancelled;

/// What a stage took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Name as shown.
    pub name: String,
    /// Wall time.
    pub seconds: f64,
    /// Largest resident size of the process until its end; 0 where the system does not say.
    #[serde(default)]
    pub peak_rss_bytes: u64,
}

/// Shows stages, counts work, and knows whether to stop.
pub struct Progress {
    verbosity: Verbosity,
    /// Bars; without, plain lines.
    bars: Option<MultiProgress>,
    cancelled: Arc<AtomicBool>,
    record: Mutex<Record>,
    started: Instant,
}

#[derive(Default)]
struct Record {
    stages: Vec<StageTime>,
    warnings: Vec<String>,
}

impl Progress {
    /// Shows nothing; still records.
    pub fn silent() -> Self {
        Self::new(Verbosity::Quiet, None)
    }

    /// Shows bars on standard error if that is a terminal, plain lines otherwise.
    pub fn on_stderr(verbosity: Verbosity) -> Self {
        let terminal = io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb");
        Self::new(verbosity, (terminal && verbosity > Verbosity::Quiet).then(MultiProgress::new))
    }

    fn new(verbosity: Verbosity, bars: Option<MultiProgress>) -> Self {
        Self { verbosity, bars, cancelled: Arc::default(), record: Mutex::default(), started: Instant::now() }
    }

    /// Lets Ctrl-C and SIGTERM cancel: the first time politely ([`Progress::is_cancelled`]), the second time by leaving
    /// with exit code 130 at once. One progress of a process can watch; later ones are left as they are.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn watch_interrupt(&self) {
        let cancelled = Arc::clone(&self.cancelled);
        let bars = self.bars.clone();
        let quiet = self.verbosity == Verbosity::Quiet;
        let watched = ctrlc::set_handler(move || {
            if cancelled.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            if !quiet {
                line(bars.as_ref(), "stopping; once more stops at once");
            }
        });
        if let Err(error) = watched {
            self.detail(&format!("Ctrl-C stops without cleaning up: {error}"));
        }
    }

    /// Whether to stop. Loops ask often; it costs one relaxed load.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// For use with `?` between and within stages.
    ///
    /// # Errors
    /// [`Cancelled`] once the work is to stop.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// Starts a stage of `total` steps (0 if not known); it ends when the guard is dropped.
    pub fn stage(&self, name: &str, total: u64) -> StageGuard<'_> {
        tracing::debug!(target: TARGET, stage = name, total, "started");
        let mut record = self.record();
        record.stages.push(StageTime { name: name.to_owned(), ..StageTime::default() });
        let index = record.stages.len() - 1;
        drop(record);
        let bar = self.bars.as_ref().map(|bars| bars.add(new_bar(name, total)));
        if bar.is_none() {
            self.show(&format!("{name} ..."));
        }
        let now = Instant::now();
        let shown = Mutex::new(Shown { at: now, done: 0 });
        StageGuard {
            progress: self,
            index,
            name: name.to_owned(),
            total,
            done: AtomicU64::new(0),
            started: now,
            bar,
            shown,
        }
    }

    /// A line for the user, unless quiet.
    pub fn note(&self, text: &str) {
        tracing::info!(target: TARGET, "{text}");
        self.show(text);
    }

    fn show(&self, text: &str) {
        if self.verbosity > Verbosity::Quiet {
            line(self.bars.as_ref(), text);
        }
    }

    /// A line for the curious: shown with `-v`.
    pub fn detail(&self, text: &str) {
        tracing::debug!(target: TARGET, "{text}");
        if self.verbosity > Verbosity::Normal {
            line(self.bars.as_ref(), text);
        }
    }

    /// Something the user should know although the work goes on. Goes into the report as well.
    pub fn warn(&self, text: &str) {
        tracing::warn!(target: TARGET, "{text}");
        self.record().warnings.push(text.to_owned());
        self.show(&format!("warning: {text}"));
    }

    /// Seconds since this was made.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Stages so far in the order of their starts; running ones have 0 seconds.
    pub fn stages(&self) -> Vec<StageTime> {
        self.record().stages.clone()
    }

    /// Warnings so far.
    pub fn warnings(&self) -> Vec<String> {
        self.record().warnings.clone()
    }

    fn record(&self) -> MutexGuard<'_, Record> {
        // The record holds no invariant that a panic elsewhere could break.
        self.record.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A running stage.
pub struct StageGuard<'a> {
    progress: &'a Progress,
    index: usize,
    name: String,
    total: u64,
    done: AtomicU64,
    started: Instant,
    bar: Option<ProgressBar>,
    shown: Mutex<Shown>,
}

/// The last plain line.
struct Shown {
    at: Instant,
    done: u64,
}

impl StageGuard<'_> {
    /// Adds finished steps; from any thread.
    pub fn inc(&self, steps: u64) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        if let Some(bar) = &self.bar {
            bar.inc(steps);
        } else if self.total > 0 && self.progress.verbosity > Verbosity::Quiet {
            self.show(done);
        }
    }

    /// Steps so far.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    fn show(&self, done: u64) {
        // A thread that finds another one at it has nothing to add.
        let Ok(mut shown) = self.shown.try_lock() else { return };
        let now = Instant::now();
        if !line_is_due(now.duration_since(shown.at), done.saturating_sub(shown.done), self.total) {
            return;
        }
        *shown = Shown { at: now, done };
        let left = time_left(self.started.elapsed(), done, self.total);
        let percent = 100 * done.min(self.total) / self.total;
        self.progress.show(&format!("{}: {percent} %, about {} left", self.name, duration(left)));
    }
}

impl Drop for StageGuard<'_> {
    fn drop(&mut self) {
        let seconds = self.started.elapsed().as_secs_f64();
        let peak_rss_bytes = peak_rss_bytes("self").unwrap_or(0);
        let stage = &mut self.progress.record().stages[self.index];
        (stage.seconds, stage.peak_rss_bytes) = (seconds, peak_rss_bytes);
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
            if let Some(bars) = &self.progress.bars {
                bars.remove(bar);
            }
        }
        if !std::thread::panicking() && !self.progress.is_cancelled() {
            tracing::info!(target: TARGET, stage = self.name, seconds, "done");
            self.progress.show(&format!("{}: {seconds:.1} s", self.name));
        }
    }
}

/// Plain lines come every 10 s while each brings a tenth, and once a minute if not: logs stay short, and no watchdog
/// takes the work for dead.
fn line_is_due(since: Duration, steps: u64, total: u64) -> bool {
    since >= Duration::from_secs(60) || (since >= Duration::from_secs(10) && steps * 10 >= total)
}

fn time_left(elapsed: Duration, done: u64, total: u64) -> Duration {
    elapsed.mul_f64(total.saturating_sub(done) as f64 / done.max(1) as f64)
}

/// `48 s`, `12 min`, `3 h 05 min`.
fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64().round() as u64;
    match seconds {
        0..100 => format!("{seconds} s"),
        100..6000 => format!("{} min", (seconds + 30) / 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60),
    }
}

fn new_bar(name: &str, total: u64) -> ProgressBar {
    let (bar, template) = if total > 0 {
        (ProgressBar::new(total), "{msg:<20} [{bar:32}] {percent:>3} %  {elapsed}, {eta} left")
    } else {
        (ProgressBar::new_spinner(), "{msg:<20} {spinner} {elapsed}")
    };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = bar.with_style(style.progress_chars("=> ")).with_message(name.to_owned());
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A line on standard error, above any bars. A closed standard error is no reason to stop.
fn line(bars: Option<&MultiProgress>, text: &str) {
    let _ = match bars {
        Some(bars) => bars.println(text),
        None => writeln!(io::stderr(), "{text}"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_recorded_in_the_order_of_their_starts() {
        let progress = Progress::silent();
        {
            let outer = progress.stage("outer", 2);
            progress.stage("inner", 0);
            outer.inc(1);
            outer.inc(1);
            assert_eq!(outer.done(), 2);
        }
        let stages = progress.stages();
        let names: Vec<&str> = stages.iter().map(|stage| stage.name.as_str()).collect();
        assert_eq!(names, ["outer", "inner"]);
        assert!(stages[0].seconds >= stages[1].seconds);
    }

    /// What a program's log gets: level and fields of each event.
    #[derive(Clone, Default)]
    struct Log(Arc<Mutex<Vec<String>>>);

    impl tracing::Subscriber for Log {
        fn enabled(&self, metadata: &tracing::Metadata<'_>) -> bool {
            metadata.target() == TARGET
        }
        fn new_span(&self, _: &tracing::span::Attributes<'_>) -> tracing::span::Id {
            tracing::span::Id::from_u64(1)
        }
        fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}
        fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}
        fn event(&self, event: &tracing::Event<'_>) {
            let mut text = event.metadata().level().to_string();
            event.record(&mut |field: &tracing::field::Field, value: &dyn std::fmt::Debug| {
                if field.name() != "seconds" {
                    text.push_str(&format!(" {field}={value:?}"));
                }
            });
            self.0.lock().expect("no panic elsewhere").push(text);
        }
        fn enter(&self, _: &tracing::span::Id) {}
        fn exit(&self, _: &tracing::span::Id) {}
    }

    #[test]
    fn a_program_has_stages_and_warnings_in_its_own_log() {
        let log = Log::default();
        tracing::subscriber::with_default(log.clone(), || {
            let progress = Progress::silent();
            drop(progress.stage("voxelize", 3));
            progress.warn("much of it is unseen");
        });
        let found = log.0.lock().expect("no panic elsewhere").clone();
        let expected = [
            r#"DEBUG message=started stage="voxelize" total=3"#,
            r#"INFO message=done stage="voxelize""#,
            "WARN message=much of it is unseen",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn a_cancelled_work_stops_at_the_next_check() {
        let progress = Progress::silent();
        assert_eq!(progress.check(), Ok(()));
        progress.cancel();
        assert_eq!(progress.check(), Err(Cancelled));
    }

    #[test]
    fn lines_are_rare_and_never_stop_for_long() {
        let seconds = Duration::from_secs;
        assert!(!line_is_due(seconds(9), 90, 100));
        assert!(line_is_due(seconds(10), 10, 100));
        assert!(!line_is_due(seconds(59), 9, 100));
        assert!(line_is_due(seconds(60), 0, 100));
    }

    #[test]
    fn time_left_is_what_the_rest_would_take_at_the_same_pace() {
        assert_eq!(time_left(Duration::from_secs(10), 25, 100), Duration::from_secs(30));
        assert_eq!(duration(Duration::from_secs(48)), "48 s");
        assert_eq!(duration(Duration::from_secs(725)), "12 min");
        assert_eq!(duration(Duration::from_secs(11_100)), "3 h 05 min");
    }
}
