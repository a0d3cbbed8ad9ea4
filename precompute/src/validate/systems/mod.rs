//! Other real-time systems and ours, on one scene and light, against one reference.
//!
//! In: what was measured of the first lighting state, and the systems asked for. Out: errors of each by receiver, by view, by area and
//! in pictures, with the bytes, probes, rays and frames that it takes. `ours` reads what the methods found; `settled` runs the
//! others frame by frame until they rest, `moving` while a lamp moves.

mod moving;
mod ours;
mod selection;
mod settled;

pub use moving::Following;
pub use selection::{Budget, Selection, Systems, Wanted};

use super::{
    MeasureSettings, StateFindings,
    path_tracer::PathBudget,
    seen::SeenReference,
    state::{Leak, leak},
    subject::Subject,
};
use crate::{error::BakeError, metrics::MethodError, progress::Progress};
use glam::Vec3;
use localprt_scenes::Camera;
use moving::Course;
use serde::{Serialize, Serializer};

/// What was found of one system.
#[derive(Clone, Debug)]
pub struct SystemFindings {
    /// Its key in `metrics.json`.
    pub name: &'static str,
    /// Its row of the table.
    pub title: &'static str,
    /// Name of the method that it is, of ours.
    pub method: Option<&'static str>,
    /// The figures.
    pub figures: SystemFigures,
    /// `[n_views][n_rays]` irradiance, W m^-2, where each primary ray of [`super::state::View::smooth`] ends; empty for ours, whose maps
    /// are among the methods'.
    pub pictures: Vec<Vec<Vec3>>,
}

/// The figures of one system under the first lighting state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SystemFigures {
    /// As [`MethodError::nrmse`], over the measured receivers; so are those that follow.
    pub nrmse: f64,
    /// Median of the relative error.
    pub median_relative: f64,
    /// Its 95th percentile.
    pub p95_relative: f64,
    /// Bias.
    pub bias: f64,
    /// Mean over the views of the nrmse at the points that each sees.
    pub view_nrmse: f64,
    /// nrmse at points by area.
    pub area_nrmse: f64,
    /// Mean FLIP over the views.
    pub flip: f64,
    /// Mean light at receivers that get none, over the mean of all.
    pub leak: f64,
    /// Bytes that it keeps from frame to frame.
    pub bytes: u64,
    /// Probes.
    pub probes: usize,
    /// Rays of an update, shadow rays among them.
    pub rays_per_update: f64,
    /// Texels or coefficients that an update writes.
    pub texels_per_update: f64,
    /// Frames after the lights were switched on until the mean light is nine tenths of what it comes to.
    pub frames_to_90_percent: u32,
    /// Frames until it rested.
    pub frames: u32,
    /// How it follows a lamp, if that was asked for and there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub following: Option<Following>,
}

/// Systems by name, in the order of the table.
#[derive(Clone, Debug, Default)]
pub struct BySystem(pub Vec<SystemFindings>);

impl BySystem {
    /// True if none were asked for.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Serialize for BySystem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|found| (found.name, found.figures)))
    }
}

/// Measures the systems of a selection under a measured state.
///
/// # Errors
/// Those of a relight; [`BakeError::Cancelled`].
pub fn measure(
    subject: &Subject<'_>,
    state: &StateFindings,
    sample: &[u32],
    cameras: &[Camera],
    settings: &MeasureSettings,
    selection: &Selection,
    progress: &Progress,
) -> Result<BySystem, BakeError> {
    let comparison = Comparison {
        subject,
        state,
        sample,
        cameras,
        bounces: settings.bounces,
        path_budget: settings.budget,
        budget: selection.budget,
    };
    let course = if selection.moving_lamp { Course::of(&comparison, progress)? } else { None };
    let measured = selection.systems.iter().map(|system| match system {
        Wanted::Ours(ours) => ours::measure(&comparison, ours, course.as_ref(), progress),
        Wanted::Other(kind) => settled::measure(&comparison, kind, course.as_ref(), progress),
    });
    Ok(BySystem(measured.collect::<Result<_, _>>()?))
}

/// What systems are held against.
struct Comparison<'a> {
    subject: &'a Subject<'a>,
    state: &'a StateFindings,
    sample: &'a [u32],
    cameras: &'a [Camera],
    bounces: u32,
    path_budget: PathBudget,
    budget: Budget,
}

/// Light of a system wherever there is a reference.
struct Light {
    /// `[n_sample]`, W m^-2.
    receivers: Vec<Vec3>,
    /// `[n_views][n_points]`.
    views: Vec<Vec<Vec3>>,
    /// `[n_points]`.
    area: Vec<Vec3>,
    /// Mean FLIP over the views.
    flip: f64,
}

impl Comparison<'_> {
    /// What a system spent, and the errors of its light.
    fn figures(&self, light: &Light, spent: SystemFigures) -> SystemFigures {
        let state = self.state;
        let error = MethodError::of(&light.receivers, &state.reference.irradiance).unwrap_or_default();
        let nrmse = |found: &[Vec3], seen: &SeenReference| {
            MethodError::of(found, &seen.reference.irradiance).map(|error| error.nrmse)
        };
        let views: Vec<f64> =
            light.views.iter().zip(&state.views).filter_map(|(found, view)| nrmse(found, &view.seen)).collect();
        let Leak { mean: leak, .. } = leak(&light.receivers, &state.reference.irradiance, state.mean_luminance);
        SystemFigures {
            nrmse: error.nrmse,
            median_relative: error.median_relative,
            p95_relative: error.p95_relative,
            bias: error.bias,
            view_nrmse: views.iter().sum::<f64>() / views.len().max(1) as f64,
            area_nrmse: nrmse(&light.area, &state.area_seen).unwrap_or_default(),
            flip: light.flip,
            leak,
            ..spent
        }
    }
}
