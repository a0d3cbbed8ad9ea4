//! A lamp that moves: how far behind the light a system is, and how much it flickers.
//!
//! The first lamp of the lighting with a place goes to and fro along the axis on which it has most room, once; a sun swings about the
//! vertical. Truth is path traced every few frames at some receivers, and read between these along straight lines.

use super::Comparison;
use crate::{
    error::BakeError, metrics::MethodError, progress::Progress, rays::RayCaster, validate::path_tracer::PathTracer,
};
use glam::{Quat, Vec3};
use localprt_scenes::{Light, LightKind, Lighting, SurfacePoint, luminance};
use localprt_systems::{Feedback, Frame, Query, Shaded, System, World};
use serde::Serialize;

/// Frames of the way there and back.
pub(super) const FRAMES: usize = 120;
/// Frames from one that is path traced to the next.
const STEP: usize = 4;
/// Receivers that are watched.
const WATCHED: usize = 48;
/// Share of the free way to each side that a lamp goes...
const SHARE: f32 = 0.6;
/// ...but not farther than this share of the scene's extent.
const FARTHEST: f32 = 0.15;
/// A sun swings by this to each side, radians.
const SWING: f32 = 0.35;
/// Frames behind the light that are looked for.
const MOST_LAG: usize = 40;

/// How a system follows a lamp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Following {
    /// nrmse over the watched receivers, mean over the frames that were path traced.
    pub nrmse: f64,
    /// Frames by which its light is behind: the shift at which it goes with the truth best, mean over receivers, by the change of their light.
    pub lag_frames: f64,
    /// Flicker: RMS over receivers and frames of the second difference of luminance, half of it, over the mean.
    pub flicker: f64,
    /// Flicker of the truth, read along straight lines: what moving alone gives.
    pub truth_flicker: f64,
}

/// The lamp's way, and what it does to the light.
pub(super) struct Course {
    /// `[FRAMES]` the lighting.
    lightings: Vec<Lighting>,
    /// `[n_points]` receivers that are watched.
    points: Vec<SurfacePoint>,
    /// `[FRAMES][n_points]` W m^-2.
    truth: Vec<Vec<Vec3>>,
}

impl Course {
    /// `None` without a punctual light.
    ///
    /// # Errors
    /// [`BakeError::Cancelled`].
    pub(super) fn of(comparison: &Comparison<'_>, progress: &Progress) -> Result<Option<Self>, BakeError> {
        let Comparison { subject, state, sample, .. } = *comparison;
        let caster = subject.caster;
        let lighting = &state.state.lighting;
        let has_place = |light: &Light| !matches!(light.kind, LightKind::Directional);
        let Some(lamp) = lighting.lights.iter().position(has_place).or((!lighting.lights.is_empty()).then_some(0))
        else {
            return Ok(None);
        };
        let way = way(caster, &lighting.lights[lamp]);
        let lightings: Vec<Lighting> = (0..FRAMES)
            .map(|frame| {
                let mut moved = lighting.clone();
                let phase = (std::f32::consts::TAU * frame as f32 / FRAMES as f32).sin();
                let light = &mut moved.lights[lamp];
                match light.kind {
                    LightKind::Directional => light.direction = Quat::from_rotation_y(SWING * phase) * light.direction,
                    _ => light.position += way * phase,
                }
                moved
            })
            .collect();
        // Those of whole texels: there a receiver is a point.
        let whole: Vec<u32> = sample.iter().copied().filter(|&receiver| subject.sites(receiver).len() == 1).collect();
        let watched = whole.iter().step_by(whole.len().div_ceil(WATCHED).max(1));
        let points: Vec<SurfacePoint> = watched.map(|&receiver| subject.point(receiver)).collect();
        let mut traced = Vec::new();
        for frame in (0..FRAMES).step_by(STEP) {
            let tracer = PathTracer::new(caster, &lightings[frame], comparison.bounces, subject.settings.seed);
            traced.push(tracer.estimate(&points, comparison.path_budget, progress)?.irradiance);
        }
        // The course ends where it began.
        traced.push(traced[0].clone());
        let truth = (0..FRAMES)
            .map(|frame| {
                let (before, along) = (frame / STEP, (frame % STEP) as f32 / STEP as f32);
                traced[before].iter().zip(&traced[before + 1]).map(|(&a, &b)| a.lerp(b, along)).collect()
            })
            .collect();
        Ok(Some(Self { lightings, points, truth }))
    }

    /// Follows the lamp with a system, after so many frames of the same course, by which its light comes round as the lamp does.
    ///
    /// # Errors
    /// [`BakeError::Cancelled`].
    pub(super) fn follow(
        &self,
        comparison: &Comparison<'_>,
        system: &mut dyn System,
        before: usize,
        progress: &Progress,
    ) -> Result<Following, BakeError> {
        let caster = comparison.subject.caster;
        let camera = comparison.cameras.first();
        let feedback = if comparison.bounces == 1 { Feedback::Nothing } else { Feedback::Own };
        let points: Vec<Shaded> = self.points.iter().map(|&point| Shaded::from_above(point)).collect();
        let mut light = Vec::with_capacity(FRAMES);
        for number in 0..before + FRAMES {
            progress.check()?;
            let at = (number + FRAMES - before) % FRAMES;
            let world = World::new(caster, &self.lightings[at]);
            system.update(&Frame { world: &world, number: number as u64, camera, feedback, events: &[], still: false });
            if number >= before {
                light.push(system.irradiance(&world, &Query::of(&points)));
            }
        }
        Ok(self.compare(&light))
    }

    /// Compares `[FRAMES][n_points]` irradiances with the truth.
    fn compare(&self, light: &[Vec<Vec3>]) -> Following {
        let traced = || (0..FRAMES).step_by(STEP);
        let nrmse = |frame: usize| MethodError::of(&light[frame], &self.truth[frame]).map_or(0.0, |error| error.nrmse);
        let error = traced().map(nrmse).sum::<f64>();
        let series = |frames: &[Vec<Vec3>], point: usize| -> Vec<f64> {
            frames.iter().map(|frame| luminance(frame[point])).collect()
        };
        let n = self.points.len();
        let (mut lag, mut weights) = (0.0, 0.0);
        let (mut found, mut expected, mut sum) = (0.0, 0.0, 0.0);
        for point in 0..n {
            let (own, truth) = (series(light, point), series(&self.truth, point));
            let change = deviation(&truth);
            lag += change * lag_of(&own, &truth) as f64;
            weights += change;
            found += roughness(&own);
            expected += roughness(&truth);
            sum += truth.iter().sum::<f64>() / FRAMES as f64;
        }
        let mean = (sum / n.max(1) as f64).max(f64::MIN_POSITIVE);
        Following {
            nrmse: error / traced().count() as f64,
            lag_frames: if weights > 0.0 { lag / weights } else { 0.0 },
            flicker: (found / n.max(1) as f64).sqrt() / mean,
            truth_flicker: (expected / n.max(1) as f64).sqrt() / mean,
        }
    }
}

/// From the middle of the lamp's way to its end, metres.
fn way(caster: &RayCaster<'_>, lamp: &Light) -> Vec3 {
    let farthest = FARTHEST * caster.scene().extent();
    let free = |dir: Vec3| caster.closest_hit(lamp.position, dir).map_or(farthest, |hit| SHARE * hit.t).min(farthest);
    let room = |axis: &Vec3| free(*axis).min(free(-*axis));
    let best = [Vec3::X, Vec3::Z, Vec3::Y].into_iter().max_by(|a, b| room(a).total_cmp(&room(b))).unwrap_or(Vec3::X);
    best * room(&best)
}

/// Standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// Mean square of half of the second difference.
fn roughness(values: &[f64]) -> f64 {
    let square = |window: &[f64]| (0.5 * (window[0] - 2.0 * window[1] + window[2])).powi(2);
    values.windows(3).map(square).sum::<f64>() / (values.len() - 2) as f64
}

/// Frames by which one series that comes round is behind another: where they go together best.
fn lag_of(own: &[f64], truth: &[f64]) -> usize {
    let n = own.len();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n as f64;
    let (own_mean, truth_mean) = (mean(own), mean(truth));
    let together = |lag: usize| -> f64 {
        (0..n).map(|frame| (own[frame] - own_mean) * (truth[(frame + n - lag) % n] - truth_mean)).sum()
    };
    (0..=MOST_LAG).rev().max_by(|&a, &b| together(a).total_cmp(&together(b))).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_is_found_and_what_flickers_is_rough() {
        let wave = |lag: f64| -> Vec<f64> {
            (0..FRAMES)
                .map(|frame| 2.0 + (std::f64::consts::TAU * (frame as f64 - lag) / FRAMES as f64).sin())
                .collect()
        };
        for lag in [0, 7, 30] {
            assert_eq!(lag_of(&wave(lag as f64), &wave(0.0)), lag);
        }
        let flicker: Vec<f64> = (0..FRAMES).map(|frame| 1.0 + 0.1 * if frame % 2 == 0 { 1.0 } else { -1.0 }).collect();
        // Half of a second difference of 0.4.
        assert!((roughness(&flicker).sqrt() - 0.2).abs() < 1e-12);
        assert!(roughness(&wave(0.0)).sqrt() < 0.002);
    }
}
