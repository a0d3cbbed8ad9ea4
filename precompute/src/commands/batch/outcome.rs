//! What became of the scenes: `batch.json`, the table on standard output, and which exit code is the worst.

use super::super::{grouped, size};
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::report::CacheUse;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// `batch.json`. Paths in it start at the folder of the list.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The list.
    pub list: String,
    /// The worst of all scenes, and of the batch.
    pub exit_code: u8,
    /// Wall time.
    pub seconds: f64,
    /// Scenes at a time.
    pub jobs: usize,
    /// Threads of all of them together.
    pub threads: usize,
    /// In the order of the list.
    pub scenes: Vec<Outcome>,
}

/// What became of a scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Name of its outputs.
    pub name: String,
    /// Where it was read from.
    pub scene: String,
    /// The baked file.
    pub output: String,
    /// What was done.
    pub state: State,
    /// Nothing had to be done: neither the bake nor the validation.
    pub up_to_date: bool,
    /// Of the bake, or else of the validation.
    pub exit_code: u8,
    /// What went wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Failure>,
    /// Wall time of bake and validation.
    pub seconds: f64,
    /// Largest resident size of either process; 0 where the system does not say.
    pub peak_rss_bytes: u64,
    /// The bake's report in short; absent if there is none.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub bake: Option<Bake>,
    /// Absent if it was not asked for, or not come to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validated>,
    /// Messages of the commands.
    pub log: String,
    /// The bake's report.
    pub report: String,
}

/// What was done for a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Nothing: the batch was stopped before.
    #[default]
    NotRun,
    /// The bake failed.
    Failed,
    /// The bake found its file as it would write it.
    UpToDate,
    /// It was baked.
    Baked,
}

/// Figures of a bake, from its report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bake {
    /// Of the file.
    pub bytes: u64,
    /// Receivers.
    pub receivers: u64,
    /// Probes.
    pub probes: u64,
    /// Clusters.
    pub clusters: u64,
    /// Mean unseen share.
    pub unseen: f64,
    /// Leaves by where they came from; absent without a cache.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cache: Option<CacheUse>,
    /// Warnings of the bake.
    pub warnings: Vec<String>,
}

/// A validation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Validated {
    /// Its page.
    pub page: String,
    /// It was not measured again, because nothing that it depends on has changed.
    pub up_to_date: bool,
    /// 0, or 7 if a limit is exceeded; others if it failed.
    pub exit_code: u8,
    /// Wall time of the measurement.
    pub seconds: f64,
    /// The largest over the lightings that count, by `nrmse`, `view_nrmse`, `leak` and `mottling`.
    pub figures: BTreeMap<String, Figure>,
}

/// A figure of error and its limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// `null` where no view shows anything to measure it by.
    pub found: Option<f64>,
    /// Largest allowed; `null` without a limit.
    pub allowed: Option<f64>,
}

/// An error, as the command printed it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// Exit code.
    #[serde(skip, default = "internal")]
    pub exit: Exit,
    /// File, what happened, place.
    pub what: String,
    /// What to do.
    pub help: Option<String>,
}

fn internal() -> Exit {
    Exit::Internal
}

impl Failure {
    /// An error without help.
    pub fn new(exit: Exit, what: impl Into<String>) -> Self {
        Self { exit, what: what.into(), help: None }
    }
}

impl From<&CommandError> for Failure {
    fn from(error: &CommandError) -> Self {
        let what = CommandError { help: None, ..error.clone() }.to_string();
        Self { exit: error.exit, what, help: error.help.clone() }
    }
}

/// How bad an exit code is. With a missed limit there is a file; what the list or a scene can mend comes before what the
/// machine is short of, a defect before neither, and a batch that was stopped says so.
pub fn severity(exit: Exit) -> u8 {
    match exit {
        Exit::Done => 0,
        Exit::Quality => 1,
        Exit::Incomplete => 2,
        Exit::Unsupported => 3,
        Exit::InvalidInput => 4,
        Exit::Usage => 5,
        Exit::Io => 6,
        Exit::Internal => 7,
        Exit::Interrupted => 8,
    }
}

impl Outcome {
    /// Its exit code.
    pub fn exit(&self) -> Exit {
        super::exit_of(self.exit_code.into())
    }

    /// What was done, in a word or two.
    pub fn said(&self) -> &'static str {
        match self.state {
            State::NotRun => "not run",
            State::Failed => "failed",
            State::UpToDate => "up to date",
            State::Baked => "baked",
        }
    }

    /// A figure of its validation, as `0.0412 (0.1)` with its limit.
    pub fn figure(&self, name: &str) -> String {
        let figure = self.validation.as_ref().and_then(|validation| validation.figures.get(name));
        let found = figure.and_then(|figure| figure.found).map(|found| format!("{found:.4}"));
        let allowed = figure.and_then(|figure| figure.allowed).map(|allowed| format!(" ({allowed})"));
        found.map_or_else(|| "-".into(), |found| found + &allowed.unwrap_or_default())
    }

    /// One line for the console.
    pub fn line(&self) -> String {
        let mut text = format!("{}: {}, {:.1} s", self.name, self.said(), self.seconds);
        if let Some(bake) = &self.bake {
            let _ = write!(text, ", {}", size(bake.bytes));
        }
        if self.validation.is_some() {
            let _ = write!(text, ", nrmse {}", self.figure("nrmse"));
        }
        if self.exit_code != 0 {
            let _ = write!(text, "; exit code {}, {} tells why", self.exit_code, self.log);
        }
        text
    }
}

/// Columns of the tables.
pub const HEAD: [&str; 10] =
    ["scene", "state", "size", "receivers", "probes", "nrmse", "seen nrmse", "seconds", "memory", "exit"];

/// A row of the tables.
pub fn row(outcome: &Outcome) -> [String; 10] {
    let bake = |show: &dyn Fn(&Bake) -> String| outcome.bake.as_ref().map_or_else(|| "-".into(), show);
    let memory = if outcome.peak_rss_bytes == 0 { "-".into() } else { size(outcome.peak_rss_bytes) };
    [
        outcome.name.clone(),
        outcome.said().into(),
        bake(&|bake| size(bake.bytes)),
        bake(&|bake| grouped(bake.receivers)),
        bake(&|bake| grouped(bake.probes)),
        outcome.figure("nrmse"),
        outcome.figure("view_nrmse"),
        format!("{:.1}", outcome.seconds),
        memory,
        outcome.exit_code.to_string(),
    ]
}

impl Summary {
    /// The worst exit code of the scenes.
    pub fn worst(scenes: &[Outcome]) -> Exit {
        scenes.iter().map(Outcome::exit).max_by_key(|&exit| severity(exit)).unwrap_or(Exit::Done)
    }

    /// Scenes that did not end well.
    pub fn n_failed(&self) -> usize {
        self.scenes.iter().filter(|scene| scene.exit_code != 0).count()
    }

    /// The table, and below it what went wrong and what to do.
    pub fn to_text(&self) -> String {
        let head = HEAD.map(str::to_owned);
        let rows: Vec<[String; 10]> = [head].into_iter().chain(self.scenes.iter().map(row)).collect();
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..HEAD.len()).map(width).collect();
        let mut text = String::new();
        for row in &rows {
            let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
                0 | 1 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join("  "));
        }
        for scene in &self.scenes {
            let Some(Failure { what, help, .. }) = &scene.error else { continue };
            let _ = write!(text, "\n{}: {what}\n", scene.name);
            if let Some(help) = help {
                let _ = writeln!(text, "  help: {help}");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(name: &str, exit: Exit) -> Outcome {
        Outcome { name: name.into(), exit_code: exit.code(), ..Outcome::default() }
    }

    #[test]
    fn the_worst_exit_code_is_that_of_the_batch() {
        let worst = |exits: &[Exit]| Summary::worst(&exits.iter().map(|&exit| outcome("a", exit)).collect::<Vec<_>>());
        assert_eq!(worst(&[]), Exit::Done);
        assert_eq!(worst(&[Exit::Done, Exit::Quality, Exit::Done]), Exit::Quality);
        assert_eq!(worst(&[Exit::InvalidInput, Exit::Quality]), Exit::InvalidInput);
        assert_eq!(worst(&[Exit::Internal, Exit::Io]), Exit::Internal);
        assert_eq!(worst(&[Exit::Interrupted, Exit::Internal]), Exit::Interrupted);
    }

    #[test]
    fn the_table_is_lined_up_and_says_what_went_wrong() {
        let figures = BTreeMap::from([("nrmse".into(), Figure { found: Some(0.04123), allowed: Some(0.1) })]);
        let good = Outcome {
            state: State::Baked,
            seconds: 12.34,
            bake: Some(Bake { bytes: 1_234_567, receivers: 4000, probes: 50, ..Bake::default() }),
            validation: Some(Validated { figures, ..Validated::default() }),
            ..outcome("hall", Exit::Done)
        };
        let failure = Failure { help: Some("copy it".into()), ..Failure::new(Exit::Io, "a.glb: is gone") };
        let bad = Outcome { state: State::Failed, error: Some(failure), ..outcome("a", Exit::Io) };
        let summary = Summary {
            list: "levels.toml".into(),
            exit_code: 6,
            seconds: 1.0,
            jobs: 1,
            threads: 2,
            scenes: vec![good, bad],
        };
        let expected = "\
scene  state     size  receivers  probes         nrmse  seen nrmse  seconds  memory  exit
hall   baked   1.2 MB      4,000      50  0.0412 (0.1)           -     12.3       -     0
a      failed       -          -       -             -           -      0.0       -     6

a: a.glb: is gone
  help: copy it
";
        assert_eq!(summary.to_text(), expected);
    }
}
