//! `precompute validate`: a baked file against path tracing; pictures, figures and a page out.

use super::relight::{camera, caster};
use super::{inputs, to_json, write_text};
use crate::cli::Validate;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::output::OutputError;
use localprt_precompute::progress::Progress;
use localprt_precompute::rays::RayCaster;
use localprt_precompute::validate::path_tracer::PathBudget;
use localprt_precompute::validate::report::Metrics;
use localprt_precompute::validate::pages::{self, Context};
use localprt_precompute::validate::{self, MeasureSettings, State, Subject, Sweep};
use localprt_scenes::{Camera, Lighting, Scene, SurfaceShading};
use std::fs;
use std::time::Instant;

/// Cameras shown unless one is chosen.
const MOST_CAMERAS: usize = 3;

/// Runs the subcommand.
pub fn run(command: &Validate, progress: &Progress) -> Result<(), CommandError> {
    let started = Instant::now();
    let baked = inputs::baked(&command.file)?;
    let view = baked.view();
    let scene = inputs::baked_scene(&command.file, view.metadata, command.scene.as_deref())?;
    let states = states(command, &scene)?;
    let caster = caster(&scene)?;
    let cameras = cameras(&caster, command.camera)?;
    fs::create_dir_all(&command.output).map_err(|error| OutputError::write(&command.output, error))?;

    let settings = MeasureSettings {
        receivers: command.receivers,
        bounces: command.bounces,
        budget: PathBudget { error: command.error, most_paths: command.paths },
        seed: command.seed,
        picture_width: command.width,
        picture_paths: command.picture_paths,
        ..MeasureSettings::default()
    };
    let about_file = |error| CommandError::from(error).in_file(&command.file);
    let subject = Subject::new(view, &caster, progress).map_err(about_file)?;
    let sweeps = command
        .sweep
        .iter()
        .map(|(option, values)| Sweep::new(option, values, &subject.settings, view.metadata.lightmap_size))
        .collect::<Result<Vec<_>, _>>()?;
    let findings =
        validate::validate(&subject, &states, command.failure_case, &sweeps, &cameras, &settings, progress)
            .map_err(about_file)?;
    let metrics = Metrics::of(&findings, &settings);
    let stage = progress.stage("pictures and page", 0);
    write_text(&command.output.join("metrics.json"), &to_json(&metrics))?;
    let context = Context {
        subject: &subject,
        findings: &findings,
        settings,
        file: command.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        max_nrmse: command.max_nrmse,
        file_bytes: fs::metadata(&command.file).map_or(0, |data| data.len()),
        seconds: started.elapsed().as_secs_f64(),
    };
    pages::write(&command.output, &context)?;
    drop(stage);
    for (state, figures) in findings.states.iter().zip(&metrics.states) {
        let [ours, _, spatial, arikan] = state.methods;
        progress.note(&format!(
            "{}: nrmse {:.4} (spatial {:.4}, arikan {:.4}), median {:.4}, p95 {:.4}, bias {:+.4}, reference +-{:.4}",
            figures.name,
            ours.nrmse,
            spatial.nrmse,
            arikan.nrmse,
            ours.median_relative,
            ours.p95_relative,
            ours.bias,
            figures.reference.standard_error
        ));
    }
    progress.note(&format!("wrote {}", command.output.join("index.html").display()));
    gate(command, &findings.states)
}

/// The given lighting files; with none the scene's own light; with one both, if the scene has light of its own.
fn states(command: &Validate, scene: &Scene) -> Result<Vec<State>, CommandError> {
    let mut states = Vec::new();
    for path in &command.lights {
        let lighting = inputs::lighting(Some(path), scene)?;
        let name = path.file_stem().map_or_else(|| "lighting".into(), |name| name.to_string_lossy().into_owned());
        states.push(State { name, lighting, counts: true });
    }
    let own = Lighting::of_scene(scene);
    let shines = !own.lights.is_empty() || SurfaceShading::new(scene, &own).any_emission();
    if states.is_empty() || states.len() == 1 && shines {
        states.push(State { name: "the scene's own light".into(), lighting: own, counts: states.is_empty() });
    }
    Ok(states)
}

fn cameras(caster: &RayCaster<'_>, number: Option<usize>) -> Result<Vec<Camera>, CommandError> {
    let own = &caster.scene().cameras;
    if number.is_some() || own.is_empty() {
        return Ok(vec![camera(caster, number)?]);
    }
    Ok(own.iter().take(MOST_CAMERAS).cloned().collect())
}

/// Fails above the limit that the user set.
fn gate(command: &Validate, states: &[validate::StateFindings]) -> Result<(), CommandError> {
    let Some(allowed) = command.max_nrmse else { return Ok(()) };
    for state in states.iter().filter(|state| state.state.counts) {
        let nrmse = state.methods[0].nrmse;
        // A figure that is not a number is not below any limit.
        if !(nrmse <= allowed) {
            let what = format!("nrmse under {} is {nrmse:.4}, allowed is {allowed:.4}", state.state.name);
            let help = format!("{} shows where; more probes or a higher --probe-degree lower it", command.output.join("index.html").display());
            return Err(CommandError::new(Exit::Quality, what).in_file(&command.file).help(help));
        }
    }
    Ok(())
}
