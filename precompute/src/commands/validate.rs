//! `precompute validate`: a baked file against path tracing; pictures, figures and a page out.

use super::{to_json, write_text};
use crate::cli::Validate;
use localprt_formats::Baked;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::output::{self, OutputError};
use localprt_precompute::progress::Progress;
use localprt_precompute::rays::RayCaster;
use localprt_precompute::reference_file::ReferenceFile;
use localprt_precompute::validate::methods::COMPRESSED;
use localprt_precompute::validate::pages::{self, Context};
use localprt_precompute::validate::path_tracer::PathBudget;
use localprt_precompute::validate::report::Metrics;
use localprt_precompute::validate::seen::SeenError;
use localprt_precompute::validate::state::View;
use localprt_precompute::validate::systems::{Selection, SystemFindings};
use localprt_precompute::validate::viewpoints::viewpoints;
use localprt_precompute::validate::{self, Limits, MeasureSettings, State, StateFindings, Subject, Sweep};
use localprt_scenes::{Camera, Lighting, Scene, SurfaceShading};
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Cameras shown unless one is chosen.
const MOST_CAMERAS: usize = 3;

/// Runs the subcommand.
pub fn run(command: &Validate, progress: &Progress) -> Result<(), CommandError> {
    let baked = inputs::baked(&command.file)?;
    let scene = inputs::baked_scene(&command.file, baked.view().metadata, command.scene.as_deref())?;
    let scene = inputs::in_variant(scene, command.variant.as_deref())?;
    let caster = inputs::caster(&scene)?;
    let settings = MeasureSettings {
        receivers: command.receivers,
        bounces: command.bounces,
        budget: PathBudget { error: command.error, most_paths: command.paths },
        seed: command.seed,
        picture_width: command.width,
        picture_paths: command.picture_paths,
        flip_paths: command.flip_paths,
        points: command.points,
        ..MeasureSettings::default()
    };
    let job = Job {
        file: &command.file,
        output: &command.output,
        states: states(command, &scene)?,
        cameras: cameras(&caster, command.camera)?,
        settings,
        sweeps: &command.sweep,
        systems: Selection {
            systems: command.systems.clone().unwrap_or_default().0,
            budget: command.equal,
            moving_lamp: command.moving_lamp,
        },
        failure_case: command.failure_case,
        limits: Limits {
            nrmse: command.max_nrmse,
            view_nrmse: command.max_view_nrmse,
            leak: command.max_leak,
            mottling: command.max_mottling,
        },
    };
    job.run(&baked, &caster, progress)
}

/// What to validate, and how.
pub struct Job<'a> {
    /// The baked file.
    pub file: &'a Path,
    /// Folder to write into; made if missing.
    pub output: &'a Path,
    /// Lighting states; the first leads.
    pub states: Vec<State>,
    /// Views; with none some are chosen.
    pub cameras: Vec<Camera>,
    /// How much is measured.
    pub settings: MeasureSettings,
    /// Options and values to bake again with.
    pub sweeps: &'a [(String, Vec<String>)],
    /// Systems to compare.
    pub systems: Selection,
    /// Whether to add the failure case.
    pub failure_case: bool,
    /// Largest figures allowed.
    pub limits: Limits,
}

impl Job<'_> {
    /// Measures, writes the folder and the reference beside the baked file, and fails with exit code 7 above the limit.
    pub fn run(&self, baked: &Baked, caster: &RayCaster<'_>, progress: &Progress) -> Result<(), CommandError> {
        let started = Instant::now();
        let view = baked.view();
        fs::create_dir_all(self.output).map_err(|error| OutputError::write(self.output, error))?;
        output::check_writable(&self.output.join("index.html"))?;
        let about_file = |error| CommandError::from(error).in_file(self.file);
        let subject = Subject::new(inputs::checked(self.file, baked)?, caster, progress).map_err(about_file)?;
        let sweep = |(option, values): &(String, Vec<String>)| {
            Sweep::new(option, values, &subject.settings, view.metadata.lightmap_size)
        };
        let sweeps = self.sweeps.iter().map(sweep).collect::<Result<Vec<_>, _>>()?;
        let cameras = self.cameras(&subject)?;
        let findings = validate::validate(
            &subject,
            &self.states,
            self.failure_case,
            &sweeps,
            &self.systems,
            &cameras,
            &self.settings,
            progress,
        )
        .map_err(about_file)?;

        let stage = progress.stage("pictures and page", 0);
        let metrics = Metrics::of(&findings, &self.settings);
        write_text(&self.output.join("metrics.json"), &to_json(&metrics))?;
        let context = Context {
            subject: &subject,
            findings: &findings,
            settings: self.settings,
            file: self.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            limits: self.limits,
            file_bytes: fs::metadata(self.file).map_or(0, |data| data.len()),
            seconds: started.elapsed().as_secs_f64(),
        };
        pages::write(self.output, &context)?;
        drop(stage);
        for (state, figures) in findings.states.iter().zip(&metrics.states) {
            let ours = figures.methods.of(&COMPRESSED);
            let comparators = figures.methods.iter().filter(|(method, _)| method.comparator.is_some());
            let others = comparators.map(|(method, error)| format!("{} {:.4}", method.name, error.nrmse));
            progress.note(&format!(
                "{}: nrmse {:.4} ({}), median {:.4}, p95 {:.4}, bias {:+.4}, reference +-{:.4}",
                figures.name,
                ours.nrmse,
                others.collect::<Vec<_>>().join(", "),
                ours.median_relative,
                ours.p95_relative,
                ours.bias,
                figures.reference.standard_error
            ));
            for view in &state.views {
                progress.note(&match view.error.points {
                    0 => format!("  {} sees no indirect light on lightmap texels", view.camera),
                    _ => format!(
                        "  seen by {}: {}, FLIP {:.4} (halves of the reference {:.4}), leak {:.4}, edge ratio {:.2}, mottling {:.4}",
                        view.camera,
                        seen_figures(&view.error),
                        view.flip,
                        view.flip_noise,
                        view.edges.leak,
                        view.edges.ratio,
                        view.mottling.rms
                    ),
                });
            }
            if state.area.points > 0 {
                progress.note(&format!("  by area: {}", seen_figures(&state.area)));
            }
        }
        for SystemFindings { name, figures, .. } in &findings.systems.0 {
            progress.note(&format!(
                "{name}: nrmse {:.4}, as seen {:.4}, by area {:.4}, FLIP {:.4}, bias {:+.4}, {} probes, {:.1} MB, {:.0} rays an update, {} frames",
                figures.nrmse,
                figures.view_nrmse,
                figures.area_nrmse,
                figures.flip,
                figures.bias,
                figures.probes,
                figures.bytes as f64 / 1e6,
                figures.rays_per_update,
                figures.frames_to_90_percent
            ));
        }
        progress.note(&format!("wrote {}", self.output.join("index.html").display()));
        if let Some(state) = findings.states.first() {
            let bounces = self.settings.bounces;
            self.leave(&state.reference_file(baked.content_hash(), &view, &findings.sample, bounces), progress);
        }
        self.gate(&findings.states)?;
        self.view_gates().iter().try_for_each(|gate| self.gate_views(gate, &findings.states))
    }

    /// The given views, or those that show most from where probes stand, or one of the whole scene.
    fn cameras(&self, subject: &Subject<'_>) -> Result<Vec<Camera>, CommandError> {
        if !self.cameras.is_empty() {
            return Ok(self.cameras.clone());
        }
        let chosen = viewpoints(subject, MOST_CAMERAS);
        if chosen.is_empty() { Ok(vec![inputs::camera(subject.caster, None)?]) } else { Ok(chosen) }
    }

    /// Writes the reference beside the baked file. Where that cannot be, the validation is as good without.
    fn leave(&self, reference: &ReferenceFile, progress: &Progress) {
        let path = ReferenceFile::path_beside(self.file);
        match reference.write(&path) {
            Ok(()) => progress.note(&format!("wrote {}: irradiance under {}", path.display(), reference.state)),
            Err(error) => progress.warn(&format!("no reference for the viewer: {} {error}", path.display())),
        }
    }

    /// The limits of what views show.
    fn view_gates(&self) -> [ViewGate; 3] {
        [
            ViewGate {
                allowed: self.limits.view_nrmse,
                what: "nrmse of what",
                found: |view| (view.error.points > 0).then_some(view.error.nrmse),
                nothing: "no view shows indirect light",
                remedy: "more receivers or more probes lower it",
            },
            ViewGate {
                allowed: self.limits.leak,
                what: "leak at edges that",
                found: |view| (view.edges.pixels > 0).then_some(view.edges.leak),
                nothing: "no view shows edges in indirect light",
                remedy: "more receivers lower it",
            },
            ViewGate {
                allowed: self.limits.mottling,
                what: "mottling of surfaces that",
                found: |view| (view.mottling.pixels > 0).then_some(view.mottling.rms),
                nothing: "no view shows smooth surfaces in indirect light",
                remedy: "more probes or a higher --probe-degree lower it",
            },
        ]
    }

    /// Fails where a view is worse than the user allows, or no view shows anything to compare.
    fn gate_views(&self, gate: &ViewGate, states: &[StateFindings]) -> Result<(), CommandError> {
        let Some(allowed) = gate.allowed else { return Ok(()) };
        let page = self.output.join("index.html");
        for state in states.iter().filter(|state| state.state.counts) {
            let light = &state.state.name;
            let fails =
                |what: String, help: String| Err(CommandError::new(Exit::Quality, what).in_file(self.file).help(help));
            if state.views.iter().all(|view| (gate.found)(view).is_none()) {
                let what = format!("{} under {light}: nothing to compare", gate.nothing);
                return fails(what, "point a camera of the scene at lit surfaces, or choose one with --camera".into());
            }
            for view in &state.views {
                let Some(found) = (gate.found)(view) else { continue };
                // A figure that is not a number is not below any limit.
                if found > allowed || found.is_nan() {
                    let (what, camera) = (gate.what, &view.camera);
                    let what = format!("{what} {camera} sees under {light} is {found:.4}, allowed is {allowed:.4}");
                    return fails(what, format!("{} shows where; {}", page.display(), gate.remedy));
                }
            }
        }
        Ok(())
    }

    /// Fails above the limit that the user set.
    fn gate(&self, states: &[StateFindings]) -> Result<(), CommandError> {
        let Some(allowed) = self.limits.nrmse else { return Ok(()) };
        for state in states.iter().filter(|state| state.state.counts) {
            let nrmse = state.methods.of(&COMPRESSED).error.nrmse;
            // A figure that is not a number is not below any limit.
            if nrmse > allowed || nrmse.is_nan() {
                let what = format!("nrmse under {} is {nrmse:.4}, allowed is {allowed:.4}", state.state.name);
                let page = self.output.join("index.html");
                let help = format!("{} shows where; more probes or a higher --probe-degree lower it", page.display());
                return Err(CommandError::new(Exit::Quality, what).in_file(self.file).help(help));
            }
        }
        Ok(())
    }
}

/// A limit of a figure of every view.
struct ViewGate {
    allowed: Option<f64>,
    /// The figure, up to the name of the camera.
    what: &'static str,
    /// `None` where the view shows nothing to measure it by.
    found: fn(&View) -> Option<f64>,
    /// Said where no view does.
    nothing: &'static str,
    remedy: &'static str,
}

/// What a line on the console says of points.
fn seen_figures(error: &SeenError) -> String {
    format!(
        "nrmse {:.4} ({:.4} without the worst 1 %), median {:.4}, p95 {:.4}, bias {:+.4}, unseen {:.4}, reference +-{:.4}",
        error.nrmse,
        error.nrmse_99,
        error.median_relative,
        error.p95_relative,
        error.bias,
        error.unseen,
        error.standard_error
    )
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
    let mut cameras = match number {
        Some(_) => vec![inputs::camera(caster, number)?],
        None => caster.scene().cameras.iter().take(MOST_CAMERAS).cloned().collect(),
    };
    for (index, camera) in cameras.iter_mut().enumerate().filter(|(_, camera)| camera.name.is_empty()) {
        camera.name = format!("camera {}", number.unwrap_or(index));
    }
    Ok(cameras)
}
