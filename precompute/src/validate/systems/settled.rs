//! Other systems: run frame by frame from darkness until their light rests, then read wherever there is a reference.

use super::{
    Budget, Comparison, Light, SystemFigures, SystemFindings,
    moving::{Course, FRAMES},
    ours::REACTED,
};
use crate::{
    error::BakeError,
    metrics::mean,
    progress::Progress,
    validate::{flip::mean_flip, path_tracer::PixelLight, seen::SeenPoint, state::View},
};
use glam::Vec3;
use localprt_scenes::{Camera, Lighting, MaterialOverride, SurfacePoint};
use localprt_systems::{Event, Feedback, Frame, Kind, Query, Setup, Shaded, System, Work, World};

/// Gathers that are made one upon the other, each from the last at rest; beyond, a system feeds itself.
const MOST_CHAINED: u32 = 3;
/// Frames in the dark before the lights go on.
const DARK_FRAMES: u64 = 2;
/// Frames that are looked at together...
const WINDOW: usize = 16;
/// ...and differ by less than this from as many before, where a system rests.
const AT_REST: f64 = 0.002;
/// Frames that are equal, where nothing changes with time.
const EQUAL: usize = 4;
/// Frames with light, at least, where something does: four times the memory of a hysteresis of 0.97, so that frames after an event, which
/// count for more, are forgotten.
const LEAST_FRAMES: usize = 132;
/// Frames with light, at most.
const MOST_FRAMES: usize = 320;
/// Points at which its light is watched.
const WATCHED: usize = 128;

/// A system at rest.
struct Rested {
    system: Box<dyn System>,
    work: Work,
    frames: u32,
    reacted: u32,
}

pub(super) fn measure(
    comparison: &Comparison<'_>,
    kind: &'static Kind,
    course: Option<&Course>,
    progress: &Progress,
) -> Result<SystemFindings, BakeError> {
    let Comparison { subject, state, cameras, .. } = *comparison;
    let stage = progress.stage(kind.title, 0);
    let world = World::new(subject.caster, &state.state.lighting);
    let probes = subject.probe_positions().len();
    let setup = Setup {
        probes: match comparison.budget {
            Budget::Probes => probes,
            Budget::Bytes => (subject.view.transport_bytes().total() / kind.probe_bytes.max(1)).max(8) as usize,
        },
        cameras,
        seed: subject.settings.seed,
    };
    let runner = Runner { kind, world: &world, dark: &dark(comparison), setup, watched: &watched(comparison) };

    // One run for all views, or one for each, where probes follow the camera.
    let n_runs = if kind.follows_camera { cameras.len().max(1) } else { 1 };
    let mut light = Light { receivers: Vec::new(), views: Vec::new(), area: Vec::new(), flip: 0.0 };
    let mut pictures = Vec::new();
    let mut figures = SystemFigures::default();
    for run in 0..n_runs {
        let mut rested = runner.run(cameras.get(run), comparison.bounces, progress)?;
        let own = if kind.follows_camera { run..run + 1 } else { 0..cameras.len() };
        let asked = Asked {
            of_all: (run == 0).then_some(comparison),
            views: own.filter_map(|view| Some((cameras.get(view)?, state.views.get(view)?))).collect(),
        };
        let mut answers = asked.of(rested.system.as_ref(), &world);
        for _ in 0..kind.averaged_frames {
            progress.check()?;
            rested.update_still(&world, cameras.get(run));
            answers = asked.of(rested.system.as_ref(), &world);
        }
        if let Some((receivers, area)) = answers.of_all {
            (light.receivers, light.area) = (receivers, area);
            figures = SystemFigures {
                bytes: rested.system.bytes(),
                probes: rested.system.probes(),
                rays_per_update: (rested.work.rays + rested.work.shadow_rays) as f64 / f64::from(rested.frames),
                texels_per_update: rested.work.texels as f64 / f64::from(rested.frames),
                frames_to_90_percent: rested.reacted,
                frames: rested.frames,
                ..figures
            };
        }
        for ((_, view), (points, picture)) in asked.views.iter().zip(answers.views) {
            light.flip += flip_of(view, &picture) / state.views.len() as f64;
            light.views.push(points);
            pictures.push(picture);
        }
    }
    let following = match course {
        Some(course) => Some(course.follow(comparison, runner.system().as_mut(), FRAMES, progress)?),
        None => None,
    };
    drop(stage);
    let figures = comparison.figures(&light, SystemFigures { following, ..figures });
    Ok(SystemFindings { name: kind.name, title: kind.title, method: None, figures, pictures })
}

/// Where a system's light is read.
struct Asked<'a> {
    /// Receivers and points by area, if they are asked for.
    of_all: Option<&'a Comparison<'a>>,
    views: Vec<(&'a Camera, &'a View)>,
}

/// What it says.
struct Answers {
    /// At the receivers, and at the points by area.
    of_all: Option<(Vec<Vec3>, Vec<Vec3>)>,
    /// By view: at the points, and at every pixel of the smooth picture.
    views: Vec<(Vec<Vec3>, Vec<Vec3>)>,
}

impl Asked<'_> {
    fn of(&self, system: &dyn System, world: &World<'_>) -> Answers {
        let of_all = self.of_all.map(|comparison| {
            let area = at_points(system, world, &comparison.state.area_seen.points, None);
            (at_receivers(comparison, system, world), area)
        });
        let of_view = |(camera, view): &(&Camera, &View)| {
            let eye = camera.to_world.w_axis.truncate();
            (at_points(system, world, &view.seen.points, Some(eye)), picture(system, world, view, eye))
        };
        Answers { of_all, views: self.views.iter().map(of_view).collect() }
    }
}

impl Rested {
    /// One more frame of the same light.
    fn update_still(&mut self, world: &World<'_>, camera: Option<&Camera>) {
        let number = DARK_FRAMES + u64::from(self.frames);
        self.frames += 1;
        let frame = Frame { world, number, camera, feedback: Feedback::Nothing, events: &[], still: true };
        self.work += self.system.update(&frame);
    }
}

/// Nothing shines.
fn dark(comparison: &Comparison<'_>) -> Lighting {
    let materials = &comparison.subject.caster.scene().materials;
    let black = |name: &String| {
        let own = comparison.state.state.lighting.materials.get(name).copied().unwrap_or_default();
        (name.clone(), MaterialOverride { emission: Some(Vec3::ZERO), ..own })
    };
    Lighting { materials: materials.iter().map(|material| black(&material.name)).collect(), ..Lighting::default() }
}

/// Points at which light is watched while it comes to rest: some of the measured receivers.
fn watched(comparison: &Comparison<'_>) -> Vec<Shaded> {
    let step = comparison.sample.len().div_ceil(WATCHED).max(1);
    comparison
        .sample
        .iter()
        .step_by(step)
        .map(|&receiver| Shaded::from_above(comparison.subject.point(receiver)))
        .collect()
}

/// Makes systems and runs them.
struct Runner<'a> {
    kind: &'static Kind,
    world: &'a World<'a>,
    dark: &'a Lighting,
    setup: Setup<'a>,
    watched: &'a [Shaded],
}

impl Runner<'_> {
    /// After so many gathers.
    fn run(&self, camera: Option<&Camera>, bounces: u32, progress: &Progress) -> Result<Rested, BakeError> {
        if bounces > MOST_CHAINED {
            return self.rest(camera, Feedback::Own, progress);
        }
        let mut rested = self.rest(camera, Feedback::Nothing, progress)?;
        for _ in 1..bounces {
            rested = self.rest(camera, Feedback::Of(rested.system.as_ref()), progress)?;
        }
        Ok(rested)
    }

    /// A new one.
    fn system(&self) -> Box<dyn System> {
        (self.kind.prepare)(self.world, &self.setup)
    }

    /// From darkness until it rests.
    fn rest(&self, camera: Option<&Camera>, feedback: Feedback<'_>, progress: &Progress) -> Result<Rested, BakeError> {
        let mut system = self.system();
        let dark = World::new(self.world.caster(), self.dark);
        for number in 0..DARK_FRAMES {
            progress.check()?;
            // What was there before the lights went on sends nothing back, whatever feeds the system later.
            let frame = Frame { world: &dark, number, camera, feedback: Feedback::Nothing, events: &[], still: false };
            system.update(&frame);
        }
        let mut means = Vec::new();
        let mut work = Work::default();
        while means.len() < MOST_FRAMES && !is_at_rest(&means) {
            progress.check()?;
            let events: &[Event] = if means.is_empty() { &[Event::LargeLight] } else { &[] };
            let number = DARK_FRAMES + means.len() as u64;
            // Light that feeds a system from itself changes as long as it does.
            let still = !means.is_empty() && !matches!(feedback, Feedback::Own);
            work += system.update(&Frame { world: self.world, number, camera, feedback, events, still });
            means.push(mean(&system.irradiance(self.world, &Query::of(self.watched))));
        }
        let last = &means[means.len().saturating_sub(WINDOW)..];
        let final_mean = last.iter().sum::<f64>() / last.len() as f64;
        let reacted =
            means.iter().position(|&mean| mean >= REACTED * final_mean).map_or(means.len(), |frame| frame + 1);
        Ok(Rested { system, work, frames: means.len() as u32, reacted: reacted as u32 })
    }
}

/// Whether the last frames are as those before them.
fn is_at_rest(means: &[f64]) -> bool {
    // To the last bit: a function of the light alone.
    if means.len() >= EQUAL && means[means.len() - EQUAL..].windows(2).all(|pair| pair[0] == pair[1]) {
        return true;
    }
    if means.len() < LEAST_FRAMES {
        return false;
    }
    let of = |means: &[f64]| means.iter().sum::<f64>() / means.len() as f64;
    let (last, before) = (of(&means[means.len() - WINDOW..]), of(&means[means.len() - 2 * WINDOW..][..WINDOW]));
    (last - before).abs() <= AT_REST * last.abs()
}

/// Means over the sites of the measured receivers.
fn at_receivers(comparison: &Comparison<'_>, system: &dyn System, world: &World<'_>) -> Vec<Vec3> {
    let sites: Vec<&[SurfacePoint]> =
        comparison.sample.iter().map(|&receiver| comparison.subject.sites(receiver)).collect();
    let points: Vec<Shaded> =
        sites.iter().flat_map(|sites| sites.iter().map(|&site| Shaded::from_above(site))).collect();
    let found = system.irradiance(world, &Query::of(&points));
    let mut rest = found.as_slice();
    sites
        .iter()
        .map(|sites| {
            let (own, others) = rest.split_at(sites.len());
            rest = others;
            own.iter().sum::<Vec3>() / own.len() as f32
        })
        .collect()
}

fn at_points(system: &dyn System, world: &World<'_>, points: &[SeenPoint], eye: Option<Vec3>) -> Vec<Vec3> {
    let points: Vec<Shaded> = points.iter().map(|seen| shaded(seen.point, eye)).collect();
    system.irradiance(world, &Query::of(&points))
}

fn shaded(point: SurfacePoint, eye: Option<Vec3>) -> Shaded {
    let to_eye = eye.map_or(point.normal, |eye| (eye - point.position).normalize_or(point.normal));
    Shaded { point, to_eye }
}

/// Irradiance at every pixel of a view's smooth picture; pixels without a surface have a normal of zero.
fn picture(system: &dyn System, world: &World<'_>, view: &View, eye: Vec3) -> Vec<Vec3> {
    let nowhere = SurfacePoint { position: eye, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO };
    let points: Vec<Shaded> =
        view.smooth.rays.iter().map(|light| shaded(light.point.unwrap_or(nowhere), Some(eye))).collect();
    let width = view.smooth.width as usize * view.smooth.per_pixel;
    let found = system.irradiance(world, &Query { points: &points, width: Some(width) });
    found.into_iter().zip(&view.smooth.rays).map(|(light, ray)| ray.point.map_or(Vec3::ZERO, |_| light)).collect()
}

/// Mean FLIP of a picture with this light against the reference.
fn flip_of(view: &View, light: &[Vec3]) -> f64 {
    let of = |light: &PixelLight| light.radiance(light.reference());
    mean_flip(&view.smooth.lit_by(light).picture(of), &view.smooth.picture(of), view.ev)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_rests_when_two_windows_of_frames_are_alike() {
        // Toward 1 with a time constant of 20 frames: what is missing in a window is e^(16/20) = 2.23 times what is missing in the next, so
        // that two which differ by 0.2 % have 0.2 % / 1.23 = 0.163 % missing in the later one on average, less at its end.
        let means: Vec<f64> = (0..300).map(|frame| 1.0 - (-f64::from(frame) / 20.0).exp()).collect();
        let frames = (0..300).find(|&frames| is_at_rest(&means[..frames])).expect("it rests");
        assert!((1.0 - means[frames - 1]) < 0.00164 && frames > 100, "{frames}: {}", means[frames - 1]);
        assert!(!is_at_rest(&means[..LEAST_FRAMES - 1]));
        // Darkness rests at once.
        assert!(is_at_rest(&[0.0; 4]) && !is_at_rest(&[0.0; 3]));
    }
}
