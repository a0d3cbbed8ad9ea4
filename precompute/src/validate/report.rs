//! `metrics.json`: what was found, as numbers.

use super::{
    Findings, MeasureSettings, NormFigures,
    coverage::Coverage,
    methods::ByMethod,
    parts::{ErrorParts, Worst},
    seen::SeenError,
    state::{Leak, StateFindings, View},
    steps::Steps,
    sweep::SweepFindings,
    systems::BySystem,
};
use crate::metrics::{MethodError, rms};
use serde::Serialize;

/// The whole of `metrics.json`. The first fields are those of the first lighting state.
#[derive(Debug, Serialize)]
pub struct Metrics {
    /// Receivers measured.
    pub receivers: usize,
    /// Gathers.
    pub bounces: u32,
    /// The reference of the first state.
    pub reference: ReferenceFigures,
    /// Errors of the methods in the first state.
    pub methods: ByMethod<MethodError>,
    /// Eq. (12), without lighting.
    pub operator_norm: NormFigures,
    /// Steps across borders in the first state.
    pub seams: Steps,
    /// What the file covers.
    pub coverage: Coverage,
    /// Light where there should be none, in the first state.
    pub leak: Leak,
    /// What the error is made of, in the first state.
    pub errors: ErrorParts,
    /// Why the worst receivers are wrong, in the first state.
    pub worst: Worst,
    /// Deviation that the fit predicts, without lighting; absent for the paper's rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_error: Option<NormFigures>,
    /// What the views show, in the first state.
    pub views: Vec<ViewFigures>,
    /// The lightmap at points drawn by area, in the first state.
    pub area: SeenError,
    /// All lighting states.
    pub states: Vec<StateFigures>,
    /// Sweeps, under the first state.
    pub sweeps: Vec<SweepFindings>,
    /// Systems, under the first state; absent if none were asked for.
    #[serde(skip_serializing_if = "BySystem::is_empty")]
    pub systems: BySystem,
}

/// Figures of one lighting state; fields as in [`Metrics`].
#[derive(Clone, Debug, Serialize)]
pub struct StateFigures {
    /// Name of the state.
    pub name: String,
    /// Mean indirect irradiance of the reference, W m^-2.
    pub mean_irradiance: f64,
    /// The reference.
    pub reference: ReferenceFigures,
    /// Errors of the methods.
    pub methods: ByMethod<MethodError>,
    /// Steps across borders.
    pub seams: Steps,
    /// Light where there should be none.
    pub leak: Leak,
    /// What the error is made of.
    pub errors: ErrorParts,
    /// Why the worst receivers are wrong.
    pub worst: Worst,
    /// FLIP between two halves of the reference pictures.
    pub flip_noise: f64,
    /// What the views show.
    pub views: Vec<ViewFigures>,
    /// The lightmap at points drawn by area.
    pub area: SeenError,
}

/// Errors of the lightmap where a camera sees it.
#[derive(Clone, Debug, Serialize)]
pub struct ViewFigures {
    /// Name of the camera.
    pub name: String,
    /// As in [`SeenError`], like all that follow but FLIP.
    pub nrmse: f64,
    /// Median relative error.
    pub median_relative: f64,
    /// Its 95th percentile.
    pub p95_relative: f64,
    /// Mean FLIP of the picture with the lightmap's light.
    pub flip: f64,
    /// FLIP between two halves of the reference picture.
    pub flip_noise: f64,
    /// Mean unseen share of the receivers that are read.
    pub unseen: f64,
    /// Share of the pixels where luminance is off by more than 10 % of the mean of the reference.
    pub off_10: f64,
    /// The same with 50 %.
    pub off_50: f64,
    /// Light above the reference at edges, over its mean: [`super::edges::Edges::leak`].
    pub leak: f64,
    /// How much brighter edges are than any surface around: [`super::edges::Edges::ratio`].
    pub edge_ratio: f64,
    /// Blotches on smooth surfaces, RMS over the light there: [`super::mottling::Mottling::rms`].
    pub mottling: f64,
    /// nrmse without the worst 1 % of the pixels.
    pub nrmse_99: f64,
    /// 99th percentile of the relative error.
    pub p99_relative: f64,
    /// Bias.
    pub bias: f64,
    /// Of the reference, over its mean.
    pub standard_error: f64,
    /// Pixels compared; 0 where the camera sees no lightmap texels, or no indirect light reaches those it sees.
    pub pixels: usize,
    /// Pixels at edges, of the smooth picture.
    pub edge_pixels: usize,
    /// Pixels on smooth surfaces, of the smooth picture.
    pub smooth_pixels: usize,
}

impl ViewFigures {
    fn of(view: &View) -> Self {
        let error = &view.error;
        Self {
            name: view.camera.clone(),
            nrmse: error.nrmse,
            median_relative: error.median_relative,
            p95_relative: error.p95_relative,
            flip: view.flip,
            flip_noise: view.flip_noise,
            unseen: error.unseen,
            off_10: error.off_10,
            off_50: error.off_50,
            leak: view.edges.leak,
            edge_ratio: view.edges.ratio,
            mottling: view.mottling.rms,
            nrmse_99: error.nrmse_99,
            p99_relative: error.p99_relative,
            bias: error.bias,
            standard_error: error.standard_error,
            pixels: error.points,
            edge_pixels: view.edges.pixels,
            smooth_pixels: view.mottling.pixels,
        }
    }
}

/// Work and noise of the reference.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ReferenceFigures {
    /// Rays traced at the receivers.
    pub rays: u64,
    /// RMS over receivers and bands of the standard error, as a share of the mean irradiance.
    pub standard_error: f64,
    /// Paths per receiver, mean.
    pub paths: f64,
}

impl StateFigures {
    /// Sums up a state.
    pub fn of(state: &StateFindings) -> Self {
        let reference = &state.reference;
        let errors = reference.standard_error.iter().map(|error| error.as_dvec3());
        let paths: u64 = reference.paths.iter().map(|&paths| u64::from(paths)).sum();
        Self {
            name: state.state.name.clone(),
            mean_irradiance: state.mean,
            reference: ReferenceFigures {
                rays: reference.rays,
                standard_error: rms(errors) / state.mean,
                paths: paths as f64 / reference.paths.len().max(1) as f64,
            },
            methods: state.methods.map(|found| found.error),
            seams: state.steps,
            leak: state.leak,
            errors: state.parts,
            worst: state.worst,
            flip_noise: state.flip_noise,
            views: state.views.iter().map(ViewFigures::of).collect(),
            area: state.area,
        }
    }
}

impl Metrics {
    /// Sums up findings with at least one state.
    ///
    /// # Panics
    /// Without a state.
    pub fn of(findings: &Findings, settings: &MeasureSettings) -> Self {
        let states: Vec<StateFigures> = findings.states.iter().map(StateFigures::of).collect();
        let first = states.first().expect("at least one lighting state is validated").clone();
        Self {
            receivers: findings.sample.len(),
            bounces: settings.bounces,
            reference: first.reference,
            methods: first.methods,
            operator_norm: findings.norm_figures(),
            predicted_error: findings.predicted_figures(),
            seams: first.seams,
            coverage: findings.coverage,
            leak: first.leak,
            errors: first.errors,
            worst: first.worst,
            views: first.views,
            area: first.area,
            states,
            sweeps: findings.sweeps.clone(),
            systems: findings.systems.clone(),
        }
    }
}
