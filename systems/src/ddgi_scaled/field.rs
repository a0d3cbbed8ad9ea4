//! All volumes together: the passes of a frame, and the query over volumes.

use super::Settings;
use super::convergence::Reaction;
use super::probe::State;
use super::volume::Volume;
use super::window::Window;
use crate::irradiance_probes::{BackFaces, ProbeRays, Weights, far_m, turned_directions};
use crate::{Frame, Object, ProbeGrid, Query, Shaded, ShaderLight, System, Work, World};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Bytes of a probe beside its maps: offset and state in four halves, as in RTXGI; the paper names no format.
pub(super) const STATE_BYTES: u64 = 8;
/// Patterns of directions that are not those of a frame's update: of the first look around, and of looks during frames.
const FIRST_LOOK: u64 = 1;
const LOOK: u64 = 2;

/// Volumes of irradiance probes with states.
pub struct ScaledDdgi {
    pub(super) settings: Settings,
    /// From the densest to the sparsest. The last one fills what the others leave.
    pub(super) volumes: Vec<Volume>,
    objects: Vec<Object>,
    reaction: Reaction,
    seed: u64,
}

impl ScaledDdgi {
    /// With volumes from the densest to the sparsest. Places and classifies their probes; `objects` are what may move in the scene.
    pub fn new(world: &World<'_>, volumes: Vec<Volume>, objects: Vec<Object>, settings: Settings, seed: u64) -> Self {
        let mut scaled = Self { settings, volumes, objects, reaction: Reaction::default(), seed };
        for look in 0..settings.moves.max(1) {
            let dirs = turned_directions(settings.rays, seed, u64::from(look), FIRST_LOOK);
            for volume in &mut scaled.volumes {
                volume.place_probes(world, &dirs, &scaled.objects, &settings);
            }
        }
        scaled
    }

    /// With one volume within the bounds of a scene, of not more than so many probes.
    pub fn over(world: &World<'_>, probes: usize, settings: Settings, seed: u64) -> Self {
        let window = Window::new(ProbeGrid::within(world.bounds(), probes, settings.inset));
        Self::new(world, vec![Volume::fixed(window, &settings)], Vec::new(), settings, seed)
    }

    /// States of all probes, volume by volume.
    pub fn states(&self) -> impl Iterator<Item = State> {
        self.volumes.iter().flat_map(|volume| volume.probes.iter().map(|probe| probe.state))
    }

    /// Mean radiance by cosine about a direction at a point, W sr^-1 m^-2. Volumes add up until their shares are 1.
    ///
    /// Source: sec. 7.3.
    pub(super) fn mean_radiance(&self, shaded: &Shaded, dir: Vec3) -> Vec3 {
        let (mut sum, mut shares) = (Vec3::ZERO, 0.0);
        for (number, volume) in self.volumes.iter().enumerate() {
            let left = 1.0 - shares;
            let is_last = number + 1 == self.volumes.len();
            let share = if is_last { left } else { volume.share(shaded.point.position, &self.settings).min(left) };
            if share <= 0.0 {
                continue;
            }
            if let Some(radiance) = volume.mean_radiance(shaded, dir, &self.settings) {
                sum += radiance * share;
                shares += share;
            }
        }
        if shares > 0.0 { sum / shares } else { Vec3::ZERO }
    }

    /// First pass of a frame: volumes follow a point, new probes find their places in a world, sleepers wake.
    pub(crate) fn arrange(&mut self, world: &World<'_>, followed: Option<Vec3>, number: u64) -> Work {
        let settings = self.settings;
        let looks = turned_directions(settings.rays, self.seed, number, LOOK);
        let mut work = Work::default();
        for volume in &mut self.volumes {
            volume.follow(followed);
            work += volume.place_probes(world, &looks, &self.objects, &settings);
            volume.wake(&self.objects, &settings);
        }
        work
    }

    /// Second pass: what the rays of all active probes bring back.
    pub(crate) fn trace(&self, frame: &Frame<'_>) -> Found {
        // All volumes are asked for feedback, so that none is written before all are traced.
        Found(self.volumes.iter().map(|volume| self.gathered(volume, frame)).collect())
    }

    /// Last pass: probes take over what their rays found.
    pub(crate) fn take(&mut self, frame: &Frame<'_>, found: Found) -> Work {
        let settings = self.settings;
        let events = if settings.events { frame.events } else { &[] };
        let hysteresis = self.reaction.frame(events, settings.hysteresis);
        let mut work = Work::default();
        for (volume, gathered) in self.volumes.iter_mut().zip(found.0) {
            let mut of_slot: Vec<Option<Gathered>> = volume.probes.iter().map(|_| None).collect();
            for (slot, rays) in gathered {
                work.probes += 1;
                work.texels += settings.sizes.texels() as u64;
                work += rays.1;
                of_slot[slot] = Some(rays);
            }
            let probes = volume.maps.par_iter_mut().zip(&mut volume.probes).zip(&of_slot);
            probes.for_each(|((maps, probe), gathered)| {
                let Some((rays, _)) = gathered else { return };
                let kept = |hysteresis: f32| if probe.state.is_new() { 0.0 } else { hysteresis };
                let (irradiance, visibility) = (kept(hysteresis.irradiance), kept(hysteresis.visibility));
                maps.blend_irradiance(rays, |old, mean| settings.blended(old, mean, irradiance));
                maps.blend_distance(rays, settings.distance_power, visibility);
                probe.state = probe.state.updated();
            });
        }
        work
    }

    /// Traces the active probes of a volume: slots with what their rays bring back.
    fn gathered(&self, volume: &Volume, frame: &Frame<'_>) -> Vec<(usize, Gathered)> {
        let settings = &self.settings;
        let [dirs, first_dirs] =
            [settings.rays, settings.first_rays].map(|rays| turned_directions(rays, self.seed, frame.number, 0));
        let backs = if settings.shortens_backs { BackFaces::Shortened } else { BackFaces::Black };
        let rays = ProbeRays { frame, own: self, backs, far_m: far_m(&volume.window.grid()) };
        let active = |slot: &usize| volume.probes[*slot].state.is_active();
        let slots: Vec<_> = (0..volume.probes.len()).filter(active).collect();
        let gather = |slot: usize| {
            let dirs = if volume.probes[slot].state.is_new() { &first_dirs } else { &dirs };
            (slot, rays.shaded(volume.position(slot), dirs))
        };
        slots.into_par_iter().map(gather).collect()
    }
}

/// What the rays of a frame found, by volume and slot.
pub(crate) struct Found(Vec<Vec<(usize, Gathered)>>);

type Gathered = (Vec<crate::irradiance_probes::ProbeRay>, Work);

impl System for ScaledDdgi {
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        let camera = frame.camera.map(|camera| camera.to_world.w_axis.truncate());
        let placing = self.arrange(frame.world, camera, frame.number);
        let found = self.trace(frame);
        let mut work = self.take(frame, found);
        work += placing;
        work
    }

    /// Probes near them wake up in the next frame.
    fn set_moving(&mut self, objects: &[Object]) {
        self.objects = objects.to_vec();
    }

    fn irradiance(&self, _: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        let at = |shaded: &Shaded| self.mean_radiance(shaded, shaded.point.normal) * PI;
        query.points.par_iter().with_min_len(256).map(at).collect()
    }

    fn shader_light(&self) -> Option<ShaderLight> {
        let [volume] = self.volumes.as_slice() else { return None };
        (self.settings.weights == Weights::default())
            .then(|| ShaderLight::Octahedral(volume.shader_probes(&self.settings)))
    }

    fn probes(&self) -> usize {
        self.volumes.iter().map(|volume| volume.probes.len()).sum()
    }

    fn bytes(&self) -> u64 {
        (self.settings.sizes.bytes() + STATE_BYTES) * self.probes() as u64
    }
}
