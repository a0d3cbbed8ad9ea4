//! `metrics.json`: what was found, as numbers.

use super::{
    Findings, MeasureSettings, NormFigures,
    coverage::Coverage,
    metrics::{MethodError, rms},
    parts::{ErrorParts, Worst},
    state::{Leak, StateFindings},
    steps::Steps,
    sweep::SweepFindings,
};
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
    pub methods: Methods,
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
    /// All lighting states.
    pub states: Vec<StateFigures>,
    /// Sweeps, under the first state.
    pub sweeps: Vec<SweepFindings>,
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
    pub methods: Methods,
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

/// Errors by method.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Methods {
    /// What the file gives.
    pub compressed: MethodError,
    /// Transport rows in full.
    pub uncompressed: MethodError,
    /// Eq. (1).
    pub spatial: MethodError,
    /// Irradiance decomposition, idealized.
    pub arikan: MethodError,
    /// The paper's rows, whatever the file's are.
    pub paper: MethodError,
}

impl StateFigures {
    /// Sums up a state.
    pub fn of(state: &StateFindings) -> Self {
        let reference = &state.reference;
        let errors = reference.standard_error.iter().map(|error| error.as_dvec3());
        let paths: u64 = reference.paths.iter().map(|&paths| u64::from(paths)).sum();
        let [compressed, uncompressed, paper, spatial, arikan] = state.methods;
        Self {
            name: state.state.name.clone(),
            mean_irradiance: state.mean,
            reference: ReferenceFigures {
                rays: reference.rays,
                standard_error: rms(errors) / state.mean,
                paths: paths as f64 / reference.paths.len().max(1) as f64,
            },
            methods: Methods { compressed, uncompressed, paper, spatial, arikan },
            seams: state.steps,
            leak: state.leak,
            errors: state.parts,
            worst: state.worst,
            flip_noise: state.flip_noise,
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
            states,
            sweeps: findings.sweeps.clone(),
        }
    }
}
