//! Ours among the systems: what the methods found, and what it takes.

use super::{
    Comparison, Light, SystemFigures, SystemFindings,
    moving::Course,
    selection::{Keeps, Ours},
};
use crate::{error::BakeError, progress::Progress, validate::seen::SeenPoint};
use glam::Vec3;
use localprt_systems::System;
use localprt_systems::hybrid::{FileLight, Hybrid, Settings};

/// Bytes of a number of a transport row, as files have them.
const ROW_BYTES: u64 = 2;
/// Gathers before a lamp is followed: the light of later ones is below 1 %.
const GATHERS_BEFORE: usize = 8;
/// Share of its light at which a system has reacted.
pub(super) const REACTED: f64 = 0.9;

pub(super) fn measure(
    comparison: &Comparison<'_>,
    ours: &'static Ours,
    course: Option<&Course>,
    progress: &Progress,
) -> Result<SystemFindings, BakeError> {
    let Comparison { subject, state, bounces, .. } = *comparison;
    let found = state.methods.of(ours.method);
    let read =
        |points: &[SeenPoint]| -> Vec<Vec3> { points.iter().map(|seen| seen.engine_read(&found.maps)).collect() };
    let light = Light {
        receivers: found.irradiance.clone(),
        views: state.views.iter().map(|view| read(&view.seen.points)).collect(),
        area: read(&state.area_seen.points),
        flip: found.error.flip,
    };
    let means = &state.gather_means;
    let last = means.last().copied().unwrap_or_default();
    let reacted = means.iter().position(|&mean| mean >= REACTED * last).map_or(bounces, |gather| gather as u32 + 1);
    // Rows that the file was made from follow as the file does.
    let system: Option<Box<dyn System + '_>> = course.and(match ours.keeps {
        Keeps::File => Some(Box::new(FileLight::new(subject.checked.clone(), subject.caster))),
        Keeps::Hybrid => {
            let (settings, seed) = (Settings::default(), subject.settings.seed);
            Some(Box::new(Hybrid::new(subject.checked.clone(), subject.caster, settings, seed)))
        }
        Keeps::Rows => None,
    });
    let following = match course.zip(system) {
        // One gather in a frame, from the light of the frame before.
        Some((course, mut system)) => Some(course.follow(comparison, system.as_mut(), GATHERS_BEFORE, progress)?),
        None => None,
    };
    let metadata = subject.view.metadata;
    let bytes = if ours.keeps == Keeps::Rows { row_bytes(comparison) } else { subject.view.transport_bytes().total() };
    let spent = SystemFigures {
        bytes,
        probes: subject.probe_positions().len(),
        // Relight rays were traced by the bake: an update reads the light map where they end.
        rays_per_update: 0.0,
        texels_per_update: subject.len() as f64
            + (subject.probe_positions().len() * (metadata.probe_degree as usize + 1).pow(2)) as f64,
        frames_to_90_percent: reacted,
        frames: bounces,
        following,
        ..SystemFigures::default()
    };
    let figures = comparison.figures(&light, spent);
    Ok(SystemFindings {
        name: ours.name,
        title: ours.title,
        method: Some(ours.method.name),
        figures,
        pictures: Vec::new(),
    })
}

/// Of uncompressed rows of all receivers: a number for every function of every supporting probe and of the sky, for every output.
fn row_bytes(comparison: &Comparison<'_>) -> u64 {
    let subject = comparison.subject;
    let functions = |degree: u32| (u64::from(degree) + 1).pow(2);
    let metadata = subject.view.metadata;
    let columns = |receiver: u32| {
        subject.supporting(receiver).len() as u64 * functions(metadata.probe_degree) + functions(metadata.sky_degree)
    };
    let numbers: u64 = (0..subject.len() as u32).map(columns).sum();
    numbers * functions(metadata.receiver_degree) * ROW_BYTES
}
