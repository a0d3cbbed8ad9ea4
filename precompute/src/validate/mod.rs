//! Where the reconstruction is wrong, and by how much: a baked file against path tracing at its own receivers.
//!
//! In: a [`Subject`] (a baked file with its scene) and lighting [`State`]s. Out: [`Findings`], from which
//! [`report`] makes `metrics.json` and [`pages`] the pictures and `index.html`.
//!
//! | file | what it measures |
//! |---|---|
//! | [`path_tracer`] | the reference: irradiance with standard errors, pictures |
//! | [`methods`] | irradiance by every method: compressed, uncompressed, the comparators of figure 8 |
//! | [`lit`], [`lobe`] | what methods start from: the file relit, light of surfaces and probes, cosine lobes |
//! | [`last_leg`] | the steps between truth and compressed result |
//! | [`seen`], [`viewpoints`] | the lightmap as an engine reads it, at points that a camera sees and at points by area |
//! | [`surface_pixels`], [`edges`], [`mottling`] | what a view shows beside edges, and blotches on smooth surfaces |
//! | [`metrics`](crate::metrics), [`flip`] | errors, each beside its formula |
//! | [`parts`] | what the error is made of, and why the worst receivers are wrong |
//! | [`steps`] | steps across chart seams and cluster borders |
//! | [`operator_norm`] | reconstruction error without lighting, Eq. (12) |
//! | [`coverage`] | unseen light, probes, clusters, coefficients |
//! | [`systems`] | other real-time systems on the same scene and light |
//! | [`sweep`], [`failure`] | the same scene baked with other options, and lit where it is worst |

pub mod coverage;
pub mod edges;
pub mod failure;
pub mod flip;
pub mod last_leg;
pub mod lit;
pub mod lobe;
pub mod methods;
pub mod mottling;
pub mod operator_norm;
pub mod pages;
pub mod parts;
pub mod path_tracer;
pub mod report;
pub mod seen;
pub mod selection;
pub mod state;
pub mod steps;
pub mod subject;
pub mod surface_pixels;
pub mod sweep;
pub mod systems;
pub mod viewpoints;

pub use state::{State, StateFindings};
pub use subject::Subject;
pub use sweep::Sweep;

use crate::metrics::{percentile, rank_correlation, relative_errors};
use crate::{error::BakeError, progress::Progress};
use coverage::Coverage;
use glam::Vec3;
use localprt_scenes::Camera;
use path_tracer::PathBudget;
use selection::{Pairs, sample};
use serde::Serialize;
use state::SeenPoints;
use sweep::SweepFindings;
use systems::{BySystem, Selection};

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasureSettings {
    /// Receivers to measure; all if the file has no more.
    pub receivers: u32,
    /// Gathers; 1 is the first indirect bounce.
    pub bounces: u32,
    /// When the reference is good enough.
    pub budget: PathBudget,
    /// Seed of the reference and of the choice of receivers.
    pub seed: u64,
    /// Pixels per row of the pictures.
    pub picture_width: u32,
    /// Paths per pixel of the pictures to look at.
    pub picture_paths: u32,
    /// Most paths per pixel of the smaller pictures that FLIP compares.
    pub flip_paths: u32,
    /// Points per view, and by area, at which the lightmap is compared as it is seen.
    pub points: u32,
    /// Receivers at which the pictures of uncompressed light and comparators are exact; they are interpolated between.
    pub picture_receivers: u32,
    /// Pairs of receivers per kind of border.
    pub pairs: u32,
}

impl Default for MeasureSettings {
    fn default() -> Self {
        Self {
            receivers: 4096,
            bounces: 8,
            budget: PathBudget::default(),
            seed: 1,
            picture_width: 480,
            picture_paths: 128,
            flip_paths: 8192,
            points: 1500,
            picture_receivers: 8192,
            pairs: 1000,
        }
    }
}

/// The largest figures allowed, where there is a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// nrmse over receivers.
    pub nrmse: Option<f64>,
    /// nrmse of what a view shows.
    pub view_nrmse: Option<f64>,
    /// Leak at the edges that a view shows.
    pub leak: Option<f64>,
    /// Mottling of the smooth surfaces that a view shows.
    pub mottling: Option<f64>,
}

/// Everything found about a baked file.
#[derive(Debug)]
pub struct Findings {
    /// Receivers measured, in file order.
    pub sample: Vec<u32>,
    /// `|e|` of Eq. (12) at the measured receivers.
    pub operator_norm: Vec<f32>,
    /// Deviation that the fit predicts there, [`operator_norm::Unlit::predicted`]; zeros for the paper's rows.
    pub predicted: Vec<f32>,
    /// What the file covers, without lighting.
    pub coverage: Coverage,
    /// One entry per lighting state.
    pub states: Vec<StateFindings>,
    /// One entry per sweep.
    pub sweeps: Vec<SweepFindings>,
    /// Systems that were asked for, under the first state.
    pub systems: BySystem,
}

/// Percentiles of an error without lighting, the operator norm or the fit's prediction, and whether it is high where the
/// error is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct NormFigures {
    /// Mean over receivers; of the norm, of the worst case.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Mean of the RMS over random unit fields: a tenth of the worst case.
    pub mean_rms: f64,
    /// Spearman's rank correlation of the norm with the relative error that it speaks of, that of the last leg (unseen light
    /// and band limit), in the first state.
    pub rank_correlation: Option<f64>,
    /// The same with the relative error of the compressed light, earlier bounces and noise included.
    pub rank_correlation_relative: Option<f64>,
    /// The same with its absolute error.
    pub rank_correlation_absolute: Option<f64>,
    /// Mean relative error of the last leg at the tenth of the receivers with the highest norm, in the first state.
    pub error_where_high: f64,
    /// The same at all others.
    pub error_elsewhere: f64,
}

/// Validates a baked file under one or more lighting states, and the sweeps and systems under the first of them. With `failure_case`
/// the lighting of [`failure::failure_case`] is added to the states.
///
/// # Errors
/// [`BakeError::Scene`] where no light reaches any receiver under a state that counts (one that does not is left out, with
/// a warning); those of [`state::measure`] and [`sweep::run`].
pub fn validate(
    subject: &Subject<'_>,
    states: &[State],
    failure_case: bool,
    sweeps: &[Sweep],
    systems: &Selection,
    cameras: &[Camera],
    settings: &MeasureSettings,
    progress: &Progress,
) -> Result<Findings, BakeError> {
    let sample = sample(subject.len(), settings.receivers as usize, settings.seed);
    let pairs = Pairs::of(subject, settings.pairs as usize);
    let seen_points = SeenPoints {
        views: cameras.iter().map(|camera| seen::of_view(subject, camera, settings.points, settings.seed)).collect(),
        area: seen::by_area(subject, settings.points, settings.seed),
    };
    let unlit = operator_norm::operator_norm(subject, &sample, progress)?;
    let operator_norm: Vec<f32> = unlit.iter().map(|unlit| unlit.norm).collect();
    let predicted = unlit.iter().map(|unlit| unlit.predicted).collect();
    let worst = if failure_case { failure::failure_case(subject, &sample, &operator_norm) } else { None };
    let mut measured: Vec<StateFindings> = Vec::new();
    for state in states.iter().chain(&worst) {
        match state::measure(subject, state, &sample, &pairs, cameras, &seen_points, settings, progress)? {
            Some(found) => measured.push(found),
            None if state.counts => {
                return Err(BakeError::Scene {
                    what: format!("no indirect light reaches any receiver under {}: nothing to compare", state.name),
                    place: None,
                    remedy: "give a lighting file that shines on the scene with --lights".into(),
                });
            }
            None => progress.warn(&format!("left out, as no light reaches any receiver: {}", state.name)),
        }
    }
    let sweeps = sweeps
        .iter()
        .filter_map(|sweep| {
            measured.first().map(|state| sweep::run(subject, sweep, state, &sample, settings, progress))
        })
        .collect::<Result<_, _>>()?;
    let systems = match measured.first() {
        Some(state) => systems::measure(subject, state, &sample, cameras, settings, systems, progress)?,
        None => BySystem::default(),
    };
    let coverage = Coverage::of(subject);
    Ok(Findings { sample, operator_norm, predicted, coverage, states: measured, sweeps, systems })
}

impl Findings {
    /// Sums up the operator norm.
    pub fn norm_figures(&self) -> NormFigures {
        self.figures_of(&self.operator_norm)
    }

    /// Sums up the fit's prediction, if rows are fitted.
    pub fn predicted_figures(&self) -> Option<NormFigures> {
        let is_fitted = self.predicted.iter().any(|&predicted| predicted > 0.0);
        // A deviation is an RMS already.
        let figures = |figures: NormFigures| NormFigures { mean_rms: figures.mean, ..figures };
        is_fitted.then(|| figures(self.figures_of(&self.predicted)))
    }

    /// Sums up an error that knows no lighting, at the measured receivers.
    fn figures_of(&self, unlit: &[f32]) -> NormFigures {
        let norms: Vec<f64> = unlit.iter().map(|&norm| f64::from(norm)).collect();
        let mean = mean_of(norms.iter().copied());
        let high = percentile(&norms, 0.9);
        let mut figures = NormFigures {
            mean,
            p95: percentile(&norms, 0.95),
            max: percentile(&norms, 1.0),
            mean_rms: mean / f64::from(operator_norm::rms_share()),
            ..NormFigures::default()
        };
        let Some(state) = self.states.first() else { return figures };
        let of = |value: fn(&last_leg::TruthLeg) -> Vec3| state.truths.iter().map(value).collect::<Vec<_>>();
        let last_leg = relative_errors(&of(|truth| truth.dense), &of(|truth| truth.all));
        let compressed = relative_errors(state.compressed(), &state.reference.irradiance);
        figures.rank_correlation = rank_correlation(&norms, &last_leg);
        figures.rank_correlation_relative = rank_correlation(&norms, &compressed);
        let absolute: Vec<f64> = state.luminance_errors().map(f64::abs).collect();
        figures.rank_correlation_absolute = rank_correlation(&norms, &absolute);
        let pairs = || norms.iter().zip(&last_leg);
        figures.error_where_high = mean_of(pairs().filter(|(norm, _)| **norm > high).map(|(_, &error)| error));
        figures.error_elsewhere = mean_of(pairs().filter(|(norm, _)| **norm <= high).map(|(_, &error)| error));
        figures
    }
}

/// 0 of nothing.
fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    if n > 0.0 { sum / n } else { 0.0 }
}
