//! Views of scenes without a camera.
//!
//! Probes stand in the open, so the eyes are probes, looking level in a few directions. The first view is the one whose rays
//! meet the most different receivers and charts; the next ones those that show most of what no view before has shown.

use super::{seen::of_hit, selection::thin, subject::Subject};
use crate::picture::camera_dir;
use glam::{Vec3, camera::rh::view::look_at_mat4};
use localprt_scenes::Camera;
use rayon::prelude::*;
use std::{collections::BTreeSet, f32::consts::TAU};

/// Width over height of a view.
const ASPECT: f32 = 4.0 / 3.0;
/// Half of the 60 degrees that a view is wide, as its tangent.
const HALF_WIDTH: f32 = 0.577_350_3;
/// Rays across and down a view.
const RAYS: [u32; 2] = [32, 24];
/// Probes that are tried, spread over all.
const MOST_EYES: usize = 64;
/// Level directions that are tried.
const TURNS: u32 = 8;
/// A view that shows less than this, times what the first one shows, tells nothing new.
const LEAST_NEWS: f32 = 0.25;

/// What a view shows: receivers with their clusters, and charts; each once.
struct Shown {
    camera: Camera,
    receivers: Vec<(u32, u32)>,
    charts: BTreeSet<u32>,
}

/// At most `most` views that differ from each other; none where no probe sees a receiver. The same on any number of
/// threads.
pub fn viewpoints(subject: &Subject<'_>, most: usize) -> Vec<Camera> {
    let eyes = thin(subject.probe_positions(), MOST_EYES);
    let tried: Vec<Shown> = (0..eyes.len() as u32 * TURNS)
        .into_par_iter()
        .filter_map(|index| shown(subject, eyes[(index / TURNS) as usize], index % TURNS))
        .collect();
    let (mut clusters, mut charts) = (BTreeSet::new(), BTreeSet::new());
    let mut chosen: Vec<Camera> = Vec::new();
    let mut first_news = 0;
    while chosen.len() < most {
        let news = |shown: &Shown| {
            let receivers = shown.receivers.iter().filter(|(_, cluster)| !clusters.contains(cluster)).count();
            receivers + shown.charts.difference(&charts).count()
        };
        // The first of equals.
        let Some((best, best_news)) =
            tried.iter().map(|shown| (shown, news(shown))).rev().max_by_key(|(_, news)| *news)
        else {
            break;
        };
        first_news = first_news.max(best_news);
        if best_news == 0 || (best_news as f32) < LEAST_NEWS * first_news as f32 {
            break;
        }
        clusters.extend(best.receivers.iter().map(|(_, cluster)| *cluster));
        charts.extend(&best.charts);
        chosen.push(Camera { name: format!("viewpoint {}", chosen.len()), ..best.camera.clone() });
    }
    chosen
}

/// `None` where something is so close that it hides the rest, or backs are seen, as from within a solid.
fn shown(subject: &Subject<'_>, eye: Vec3, turn: u32) -> Option<Shown> {
    let angle = turn as f32 / TURNS as f32 * TAU;
    let to_world = look_at_mat4(eye, eye + Vec3::new(angle.sin(), 0.0, angle.cos()), Vec3::Y).inverse();
    let fov_y = 2.0 * (HALF_WIDTH / ASPECT).atan();
    let camera = Camera { name: String::new(), to_world, fov_y, aspect: Some(ASPECT) };
    let [across, down] = RAYS;
    let (mut receivers, mut backs) = (Vec::new(), 0);
    let mut nearest = f32::INFINITY;
    for ray in 0..across * down {
        let [u, v] = [(ray % across) as f32 + 0.5, (ray / across) as f32 + 0.5];
        let dir = camera_dir(&camera, u / across as f32, v / down as f32, ASPECT);
        let Some(hit) = subject.caster.closest_hit(eye, dir) else { continue };
        nearest = nearest.min(hit.t);
        backs += u32::from(hit.point.is_none());
        receivers.extend(of_hit(subject, &hit).and_then(|seen| subject.receiver_at(seen.uv)));
    }
    if backs * 20 > across * down || nearest < 0.01 * subject.caster.scene().extent() {
        return None;
    }
    receivers.sort_unstable();
    receivers.dedup();
    let charts = receivers.iter().map(|&receiver| subject.chart(receiver)).collect();
    let receivers = receivers.iter().map(|&receiver| (receiver, subject.cluster[receiver as usize])).collect();
    Some(Shown { camera, receivers, charts })
}
