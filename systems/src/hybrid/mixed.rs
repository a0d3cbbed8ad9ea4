//! The hybrid: the order of a frame, and how the change joins the file's light.

use super::file_light::FileLight;
use super::pair::Pair;
use super::region::Region;
use super::{Joining, Settings};
use crate::{Feedback, Frame, Query, Shaded, System, Work, World, moved};
use glam::Vec3;
use localprt_formats::Checked;
use localprt_scenes::SurfacePoint;
use localprt_surfaces::rays::RayCaster;

/// A file for what stands still, and a window of traced probes around what moves.
pub struct Hybrid<'a> {
    file: FileLight<'a>,
    settings: Settings,
    seed: u64,
    /// `None` while nothing moves.
    pair: Option<Pair>,
}

impl<'a> Hybrid<'a> {
    /// Of a file and rays against the scene that was baked, with its lightmap coordinates. The scene of a frame's world is that scene,
    /// mesh by mesh, and after these the meshes of what moves.
    pub fn new(baked: Checked<'a>, caster: &'a RayCaster<'a>, settings: Settings, seed: u64) -> Self {
        Self { file: FileLight::new(baked, caster), settings, seed, pair: None }
    }

    /// The file's own light in this frame.
    pub fn file(&self) -> &FileLight<'a> {
        &self.file
    }

    /// Where the change is found; `None` while nothing moves.
    pub fn region(&self) -> Option<Region> {
        self.pair.as_ref().map(|pair| pair.region)
    }

    /// Places the window.
    fn follow(&mut self, frame: &Frame<'_>, still: &World<'_>) -> Work {
        let scene = self.file.caster().scene();
        let objects = moved(frame.world.caster().scene(), scene.meshes.len());
        let bounds = scene.bounds().unwrap_or_default();
        let Some(region) = Region::around(&objects, bounds, self.settings.reach_m) else {
            self.pair = None;
            return Work::default();
        };
        if !self.pair.as_ref().is_some_and(|pair| pair.fits(&region)) {
            self.pair = Some(Pair::new(still, region, &objects, &self.settings, self.seed));
        }
        self.pair.as_mut().map_or_else(Work::default, |pair| pair.follow(still, region, &objects, frame.number))
    }

    /// What enters the file's gather beside lamps and its own light, by texel.
    fn added(&self, frame: &Frame<'_>) -> Option<Vec<Vec3>> {
        let shaded = |&(point, _): &(SurfacePoint, Vec3)| Shaded::from_above(point);
        match frame.feedback {
            Feedback::Nothing => None,
            Feedback::Of(other) => {
                let points: Vec<Shaded> = self.file.texel_lights().iter().map(shaded).collect();
                Some(other.feedback(frame.world, &points))
            }
            Feedback::Own => {
                let pair = self.pair.as_ref().filter(|_| self.settings.passes_on)?;
                let texels = self.file.texel_lights();
                let share = |point: &SurfacePoint| pair.region.share(point.position, pair.cell, self.settings.fades);
                let near: Vec<usize> = (0..texels.len()).filter(|&texel| share(&texels[texel].0) > 0.0).collect();
                let points: Vec<Shaded> = near.iter().map(|&texel| shaded(&texels[texel])).collect();
                let (with, without) = pair.lights(frame.world, &points);
                let mut added = vec![Vec3::ZERO; texels.len()];
                for (number, &texel) in near.iter().enumerate() {
                    let (point, file) = &texels[texel];
                    let light = self.settings.joined(*file, with[number], without[number], share(point));
                    added[texel] = light - *file;
                }
                Some(added)
            }
        }
    }

    /// What the rays of both fields find by the light of the last frame, for both to take over.
    fn trace(&mut self, frame: &Frame<'_>, still: &World<'_>) -> Work {
        let Some(pair) = &self.pair else { return Work::default() };
        let (all, file_alone) = match frame.feedback {
            Feedback::Own => (Feedback::Of(self), Feedback::Of(&self.file)),
            given => (given, given),
        };
        // The light that bounces is the same for both where the file's gather knows the change, too.
        let of_still = if self.settings.passes_on { all } else { file_alone };
        let frames = [Frame { feedback: all, ..*frame }, Frame { world: still, feedback: of_still, ..*frame }];
        let [with, without] = [pair.with.trace(&frames[0]), pair.without.trace(&frames[1])];
        let mut work = Work::default();
        if let Some(pair) = &mut self.pair {
            work += pair.with.take(frame, with);
            work += pair.without.take(frame, without);
        }
        work
    }
}

impl System for Hybrid<'_> {
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        let caster = self.file.caster();
        let mut still = World::new(caster, frame.world.lighting());
        let mut shadows = caster;
        if self.settings.shadows {
            still = still.with_shadows_of(frame.world.caster());
            shadows = frame.world.caster();
        }
        let mut work = self.follow(frame, &still);
        // Everything is read before anything is written: all light is that of the last frame.
        let added = self.added(frame);
        work += self.trace(frame, &still);
        work += self.file.gather(frame, shadows, added.as_deref(), matches!(frame.feedback, Feedback::Own));
        work
    }

    fn irradiance(&self, world: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        let files = self.file.lights(query.points);
        let Some(pair) = &self.pair else {
            return files.into_iter().map(Option::unwrap_or_default).collect();
        };
        let share = |shaded: &Shaded| pair.region.share(shaded.point.position, pair.cell, self.settings.fades);
        // What stands still and is in the window, and what moves.
        let asked: Vec<usize> =
            (0..files.len()).filter(|&at| files[at].is_none() || share(&query.points[at]) > 0.0).collect();
        let points: Vec<Shaded> = asked.iter().map(|&at| query.points[at]).collect();
        let (with, without) = pair.lights(world, &points);
        let mut light: Vec<Vec3> = files.iter().map(|file| file.unwrap_or_default()).collect();
        for (number, &at) in asked.iter().enumerate() {
            light[at] = match files[at] {
                Some(file) => self.settings.joined(file, with[number], without[number], share(&points[number])),
                None => with[number],
            };
        }
        light
    }

    fn probes(&self) -> usize {
        self.file.probes() + self.pair.as_ref().map_or(0, |pair| pair.with.probes() + pair.without.probes())
    }

    fn bytes(&self) -> u64 {
        self.file.bytes() + self.pair.as_ref().map_or(0, |pair| pair.with.bytes() + pair.without.bytes())
    }
}

impl Settings {
    /// The file's light with a share of the change. To the last bit the file's where both fields say the same.
    pub(super) fn joined(&self, file: Vec3, with: Vec3, without: Vec3, share: f32) -> Vec3 {
        let without = if self.takes_off { without } else { Vec3::ZERO };
        let changed = match self.joining {
            Joining::Sum => (file + (with - without)).max(Vec3::ZERO),
            Joining::Share => {
                let kept = |axis: usize| if with[axis] < without[axis] { with[axis] / without[axis] } else { 1.0 };
                file * Vec3::new(kept(0), kept(1), kept(2)) + (with - without).max(Vec3::ZERO)
            }
        };
        file + (changed - file) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_fields_leave_the_files_light_to_the_last_bit() {
        let (file, light) = (Vec3::new(0.1, 1.7, 0.3), Vec3::new(0.7, 0.01, 0.0));
        for joining in [Joining::Sum, Joining::Share] {
            let settings = Settings { joining, ..Settings::default() };
            for share in [0.0, 0.3, 1.0] {
                assert_eq!(settings.joined(file, light, light, share), file);
            }
        }
    }

    #[test]
    fn light_that_is_gone_is_gone_by_its_share_whatever_the_bias() {
        // The fields say a tenth less than the file: the sum leaves that tenth behind a closed door.
        let (file, without) = (Vec3::ONE, Vec3::splat(0.9));
        let joined = |joining, with| Settings { joining, ..Settings::default() }.joined(file, with, without, 1.0);
        assert!((joined(Joining::Sum, Vec3::ZERO) - 0.1).abs().max_element() < 1e-6);
        assert_eq!(joined(Joining::Share, Vec3::ZERO), Vec3::ZERO);
        assert_eq!(joined(Joining::Sum, Vec3::splat(-5.0)), Vec3::ZERO);
        // More light is added by both.
        for joining in [Joining::Sum, Joining::Share] {
            assert!((joined(joining, Vec3::splat(1.4)) - 1.5).abs().max_element() < 1e-6);
        }
    }
}
