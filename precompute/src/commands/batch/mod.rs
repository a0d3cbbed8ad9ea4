//! `precompute batch`: the scenes of a list baked and validated, as many at a time as asked for; one table, one JSON file and
//! one page over all of them.
//!
//! [`plan`] reads the list and refuses what is wrong in it before any work. Every scene is a `bake`, and a `validate` if it is asked
//! for, each in a process of its own ([`child`] says why). What is up to date costs seconds: the bake finds itself in its cache,
//! [`validation`] by a stamp. [`outcome`] and [`page`] say what became of them, [`watch`] which files have changed since.

mod child;
mod outcome;
mod page;
mod plan;
mod validation;
mod watch;

use super::{print_data, to_json, write_text};
use crate::cli::{Batch, Global};
use child::Ended;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::output::{OutputError, write_file};
use localprt_precompute::progress::Progress;
use localprt_precompute::report::BakeReport;
use outcome::{Bake, Failure, Outcome, State, Summary};
use plan::{Job, Plan};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime};
use watch::Seen;

/// Runs the subcommand.
pub fn run(command: &Batch, global: &Global, progress: &Progress) -> Result<(), CommandError> {
    let plan = Plan::read(&command.list)?;
    let threads =
        global.threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let batch = Work { jobs: usize::from(command.jobs), threads, progress };
    if command.watch {
        return batch.watch(plan);
    }
    let scenes = batch.run(&plan, &plan.scenes.iter().collect::<Vec<_>>())?;
    batch.result(&plan, &scenes)
}

/// The exit code of a command's process.
fn exit_of(code: i32) -> Exit {
    use Exit::{Done, Incomplete, Internal, Interrupted, InvalidInput, Io, Quality, Unsupported, Usage};
    let all = [Done, Internal, Usage, InvalidInput, Incomplete, Unsupported, Io, Quality, Interrupted];
    all.into_iter().find(|exit| i32::from(exit.code()) == code).unwrap_or(Internal)
}

/// How scenes are worked off.
struct Work<'a> {
    /// Scenes at a time.
    jobs: usize,
    /// Threads of all of them together.
    threads: usize,
    progress: &'a Progress,
}

impl Work<'_> {
    /// All scenes, and again those that depend on a file that changes, until the work is to stop.
    fn watch(&self, mut plan: Plan) -> Result<(), CommandError> {
        // As files are before they are read: what changes meanwhile is done again.
        let mut seen = Seen::of(&plan);
        let mut outcomes = self.run(&plan, &plan.scenes.iter().collect::<Vec<_>>())?;
        loop {
            if !self.progress.is_cancelled() {
                self.progress.note("watching; Ctrl-C ends");
            }
            let changed = seen.wait(self.progress);
            if changed.is_empty() {
                return Err(CommandError::new(Exit::Interrupted, "interrupted; what was finished stays"));
            }
            let names: Vec<String> = changed.iter().map(|path| path.display().to_string()).collect();
            self.progress.note(&format!("changed: {}", names.join(", ")));
            let before = plan.scenes.clone();
            if changed.contains(&plan.list) {
                match Plan::read(&plan.list) {
                    Ok(read) => plan = read,
                    Err(error) => self.progress.warn(&format!("{error}; the list as it was goes on")),
                }
            }
            seen = Seen::of(&plan);
            let is_due = |job: &&Job| !before.contains(job) || is_any_of(&changed, job, &plan.root);
            let due: Vec<&Job> = plan.scenes.iter().filter(is_due).collect();
            let kept = outcomes;
            outcomes = self.run_over(&plan, &due, &kept)?;
        }
    }

    fn run(&self, plan: &Plan, due: &[&Job]) -> Result<Vec<Outcome>, CommandError> {
        self.run_over(plan, due, &[])
    }

    /// Works `due` off, and shows them together with what is known of the others.
    fn run_over(&self, plan: &Plan, due: &[&Job], known: &[Outcome]) -> Result<Vec<Outcome>, CommandError> {
        let started = Instant::now();
        let folder = plan.index_folder();
        for folder in plan.scenes.iter().map(|job| plan.root.join(&job.folder)).chain([folder.clone()]) {
            fs::create_dir_all(&folder).map_err(|error| OutputError::write(&folder, error))?;
        }
        let done = self.all(plan, due);
        let outcome = |job: &Job| {
            let is_its = |outcome: &&Outcome| outcome.name == job.name && outcome.output == shown(&job.baked());
            let found = done.iter().find(is_its).or_else(|| known.iter().find(is_its));
            found.cloned().unwrap_or_else(|| not_run(job))
        };
        let scenes: Vec<Outcome> = plan.scenes.iter().map(outcome).collect();
        let summary = Summary {
            list: shown(&plan.list),
            exit_code: Summary::worst(&scenes).code(),
            seconds: started.elapsed().as_secs_f64(),
            jobs: self.jobs,
            threads: self.threads,
            scenes,
        };
        write_text(&folder.join("batch.json"), &to_json(&summary))?;
        write_text(&folder.join("index.html"), &page::page(&summary, &plan.root, &folder).render())?;
        self.progress.note(&format!("wrote {} and batch.json there", folder.join("index.html").display()));
        print_data(&summary.to_text())?;
        Ok(summary.scenes)
    }

    /// In the order of `due`. Every worker has its share of the threads.
    fn all(&self, plan: &Plan, due: &[&Job]) -> Vec<Outcome> {
        let n_workers = self.jobs.min(due.len());
        let (next, done) = (AtomicUsize::new(0), Mutex::new(vec![None; due.len()]));
        std::thread::scope(|scope| {
            for worker in 0..n_workers {
                let threads = (self.threads + n_workers - 1 - worker) / n_workers;
                let (next, done) = (&next, &done);
                scope.spawn(move || {
                    loop {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(job) = due.get(index).filter(|_| !self.progress.is_cancelled()) else { return };
                        self.progress.detail(&format!("{}: started, {} tells more", job.name, job.log().display()));
                        let outcome = self.one(job, &plan.root, threads.max(1));
                        // No invariant that a panic elsewhere could break.
                        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
                        let line = outcome.line();
                        done[index] = Some(outcome);
                        let n_done = done.iter().flatten().count();
                        self.progress.note(&format!("[{n_done}/{}] {line}", due.len()));
                    }
                });
            }
        });
        let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        done.into_iter().zip(due).map(|(done, job)| done.unwrap_or_else(|| not_run(job))).collect()
    }

    /// A scene from its bake to its validation.
    fn one(&self, job: &Job, root: &Path, threads: usize) -> Outcome {
        let log = root.join(job.log());
        let mut outcome = Outcome { state: State::Failed, ..not_run(job) };
        let config = root.join(job.options());
        // The log is that of this run.
        let written = write_file(&log, b"").and_then(|()| write_file(&config, job.settings.to_toml().as_bytes()));
        if let Err(error) = written {
            return failed(outcome, Failure::from(&CommandError::from(error)));
        }
        let mut arguments = vec!["bake".to_owned(), job.source.clone(), "-o".to_owned(), shown(&job.baked())];
        arguments.push(format!("--config={}", job.options().display()));
        arguments.push(format!("--report={}", job.report().display()));
        arguments.extend(job.cache.iter().cloned());
        arguments.push(format!("--threads={threads}"));
        let baked = root.join(job.baked());
        let before = modified(&baked);
        let Ended { failure, peak_rss_bytes, seconds } = child::run(&arguments, root, &log, self.progress);
        (outcome.seconds, outcome.peak_rss_bytes) = (seconds, peak_rss_bytes);
        if let Some(failure) = failure {
            return failed(outcome, failure);
        }
        let report = fs::read(root.join(job.report())).ok();
        if let Some(report) = report.and_then(|report| serde_json::from_slice::<BakeReport>(&report).ok()) {
            outcome.peak_rss_bytes = peak_rss_bytes.max(report.peak_rss_bytes);
            outcome.bake = Some(Bake {
                bytes: report.bytes.file,
                receivers: report.receivers,
                probes: report.probes,
                clusters: report.clusters,
                unseen: report.unseen.mean,
                cache: report.cache,
                warnings: report.warnings,
            });
        }
        // A bake that has something to do writes another file in the place of the one that was there.
        outcome.up_to_date = before.is_some() && before == modified(&baked);
        outcome.state = if outcome.up_to_date { State::UpToDate } else { State::Baked };
        let Some(how) = &job.validation else { return outcome };
        let (validated, error, peak) = validation::run(job, how, root, threads, self.progress);
        outcome.peak_rss_bytes = outcome.peak_rss_bytes.max(peak);
        outcome.up_to_date &= validated.up_to_date;
        if !validated.up_to_date {
            outcome.seconds += validated.seconds;
        }
        outcome.validation = Some(validated);
        match error {
            Some(error) => Outcome { exit_code: error.exit.code(), error: Some(error), ..outcome },
            None => outcome,
        }
    }

    /// The end of a batch: the worst exit code.
    fn result(&self, plan: &Plan, scenes: &[Outcome]) -> Result<(), CommandError> {
        let count = |matches: fn(&Outcome) -> bool| scenes.iter().filter(|scene| matches(scene)).count();
        let exit = if self.progress.is_cancelled() { Exit::Interrupted } else { Summary::worst(scenes) };
        let what = match exit {
            Exit::Done => return Ok(()),
            Exit::Interrupted => {
                let done = count(|scene| matches!(scene.state, State::Baked | State::UpToDate));
                format!("interrupted; {done} of {} scenes are baked", scenes.len())
            }
            Exit::Quality => {
                format!("{} of {} scenes missed a limit", count(|scene| scene.exit_code != 0), scenes.len())
            }
            _ => format!("{} of {} scenes failed or missed a limit", count(|scene| scene.exit_code != 0), scenes.len()),
        };
        let help = match exit {
            Exit::Interrupted => "the same command goes on where this one was".to_owned(),
            _ => format!("{} has all of them", plan.index_folder().join("index.html").display()),
        };
        Err(CommandError::new(exit, what).in_file(&plan.list).help(help))
    }
}

fn not_run(job: &Job) -> Outcome {
    Outcome {
        name: job.name.clone(),
        scene: job.source.clone(),
        output: shown(&job.baked()),
        log: shown(&job.log()),
        report: shown(&job.report()),
        ..Outcome::default()
    }
}

fn failed(outcome: Outcome, failure: Failure) -> Outcome {
    Outcome { exit_code: failure.exit.code(), error: Some(failure), ..outcome }
}

fn is_any_of(changed: &BTreeSet<PathBuf>, job: &Job, root: &Path) -> bool {
    job.input_files(root).iter().any(|path| changed.contains(path))
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|data| data.modified()).ok()
}

/// With the system's separators, as messages have it.
fn shown(path: &Path) -> String {
    path.display().to_string()
}
