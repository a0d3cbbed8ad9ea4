//! The validation of a scene: measured, or found as it was measured before.
//!
//! Beside the page lies a stamp: a digest of all that the validation depends on, and how it ended. That is this program, the baked file
//! (which holds the hash of its scene), the lighting files with their images, and the options. The stamp is removed before anything
//! is measured and written after, so a validation that was stopped leaves none.

use super::child::{self, Ended};
use super::outcome::{Failure, Figure, Validated};
use super::plan::{Job, Validation};
use localprt_precompute::digest::Digester;
use localprt_precompute::error::Exit;
use localprt_precompute::output::write_file;
use localprt_precompute::progress::Progress;
use localprt_tools::hex;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// What is kept of a validation, as JSON.
#[derive(Serialize, Deserialize)]
struct Stamp {
    /// Of all that it depends on.
    inputs: String,
    /// BLAKE3 of `metrics.json` as it was written.
    metrics: String,
    validated: Validated,
    error: Option<Failure>,
}

/// Validates a job's baked file, unless that was done.
pub fn run(
    job: &Job,
    how: &Validation,
    root: &Path,
    threads: usize,
    progress: &Progress,
) -> (Validated, Option<Failure>, u64) {
    let folder = root.join(job.quality());
    let (stamp_file, metrics_file) = (folder.join("stamp.json"), folder.join("metrics.json"));
    let page = job.quality().join("index.html");
    let inputs = digest_of_inputs(job, how, root);
    if let (Some(inputs), Some(stamp)) = (&inputs, read(&stamp_file))
        && stamp.inputs == *inputs
        && digest_of_file(&metrics_file).is_some_and(|metrics| metrics == stamp.metrics)
        && root.join(&page).is_file()
    {
        let validated = Validated { up_to_date: true, ..stamp.validated };
        let error = stamp.error.map(|error| Failure { exit: super::exit_of(validated.exit_code.into()), ..error });
        return (validated, error, 0);
    }
    // Where it cannot be removed nothing else can be written either, which the command tells.
    let _ = fs::remove_file(&stamp_file);
    let file = |path: &Path| path.display().to_string();
    let mut arguments = vec!["validate".into(), file(&job.baked()), "-o".into(), file(&job.quality())];
    arguments.extend(how.lights.iter().map(|lights| format!("--lights={}", lights.display())));
    arguments.extend(how.flags.iter().cloned());
    arguments.push(format!("--threads={threads}"));
    let Ended { failure, peak_rss_bytes, seconds } = child::run(&arguments, root, &root.join(job.log()), progress);
    let exit = failure.as_ref().map_or(Exit::Done, |failure| failure.exit);
    let is_measured = matches!(exit, Exit::Done | Exit::Quality);
    let metrics = fs::read_to_string(&metrics_file).ok().filter(|_| is_measured);
    let figures: Option<Value> = metrics.and_then(|text| serde_json::from_str(&text).ok());
    let validated = Validated {
        page: file(&page),
        up_to_date: false,
        exit_code: exit.code(),
        seconds,
        figures: figures.map(|metrics| figures_of(&metrics, how)).unwrap_or_default(),
    };
    if let (true, Some(inputs), Some(metrics)) = (is_measured, inputs, digest_of_file(&metrics_file)) {
        let stamp = Stamp { inputs, metrics, validated: validated.clone(), error: failure.clone() };
        // Without it the next batch measures again.
        let _ = write_file(&stamp_file, super::super::to_json(&stamp).as_bytes());
    }
    (validated, failure, peak_rss_bytes)
}

fn read(path: &Path) -> Option<Stamp> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// `None` if a file cannot be read: the command will tell.
fn digest_of_inputs(job: &Job, how: &Validation, root: &Path) -> Option<String> {
    static PROGRAM: OnceLock<Option<String>> = OnceLock::new();
    let program = PROGRAM.get_or_init(|| digest_of_file(&std::env::current_exe().ok()?));
    let mut digester = Digester::new("validation");
    digester.all(program.as_ref()?.as_bytes()).all(digest_of_file(&root.join(job.baked()))?.as_bytes());
    for flag in &how.flags {
        digester.all(flag.as_bytes());
    }
    // By their names in the list, which are the same from every folder.
    for path in &how.lights {
        digester.all(path.as_os_str().as_encoded_bytes());
    }
    for path in job.lighting_files(root) {
        digester.all(digest_of_file(&path)?.as_bytes());
    }
    Some(hex(&digester.finish()))
}

fn digest_of_file(path: &Path) -> Option<String> {
    let mut digest = blake3::Hasher::new();
    digest.update_reader(fs::File::open(path).ok()?).ok()?;
    Some(hex(digest.finalize().as_bytes()))
}

/// The largest figures of `metrics.json` over the lightings that count: those given, or the scene's own where none is.
fn figures_of(metrics: &Value, how: &Validation) -> BTreeMap<String, Figure> {
    let states = metrics["states"].as_array().map_or(&[][..], Vec::as_slice);
    let states = &states[..states.len().min(how.lights.len().max(1))];
    let views = || states.iter().flat_map(|state| state["views"].as_array().into_iter().flatten());
    // Figures count where there is something to measure them by.
    let of_views = |name: &str, pixels: &str| {
        let shown = views().filter(|view| view[pixels].as_u64() > Some(0));
        shown.filter_map(|view| view[name].as_f64()).reduce(f64::max)
    };
    let nrmse = states.iter().filter_map(|state| state["methods"]["compressed"]["nrmse"].as_f64()).reduce(f64::max);
    let found = [
        ("nrmse", nrmse),
        ("view_nrmse", of_views("nrmse", "pixels")),
        ("leak", of_views("leak", "edge_pixels")),
        ("mottling", of_views("mottling", "smooth_pixels")),
    ];
    let figure = |(name, found): (&str, Option<f64>)| {
        (name.to_owned(), Figure { found, allowed: how.limits.get(name).copied() })
    };
    found.into_iter().map(figure).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn figures_are_the_largest_over_the_lightings_that_count() {
        let state = |nrmse: f64, pixels: u64| {
            let view = json!({"nrmse": 2.0 * nrmse, "pixels": pixels, "leak": 0.5, "edge_pixels": 0});
            json!({"methods": {"compressed": {"nrmse": nrmse}}, "views": [view]})
        };
        let metrics = json!({"states": [state(0.1, 9), state(0.3, 0), state(0.9, 9)]});
        let how = |n_lights: usize| Validation {
            lights: vec!["a.json".into(); n_lights],
            flags: Vec::new(),
            limits: BTreeMap::from([("nrmse".into(), 0.2)]),
        };
        let found = figures_of(&metrics, &how(2));
        assert_eq!(found["nrmse"], Figure { found: Some(0.3), allowed: Some(0.2) });
        assert_eq!(found["view_nrmse"], Figure { found: Some(0.2), allowed: None });
        assert_eq!((found["leak"].found, found["mottling"].found), (None, None));
        assert_eq!(figures_of(&metrics, &how(0))["nrmse"].found, Some(0.1), "the scene's own light");
        assert!(figures_of(&json!({}), &how(1))["nrmse"].found.is_none());
    }
}
