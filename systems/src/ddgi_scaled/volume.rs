//! One volume of probes: placing and waking them, asking the eight around a point, and its share among other volumes.

use super::Settings;
use super::optimizer::Sight;
use super::probe::{Probe, State};
use super::window::Window;
use crate::irradiance_probes::{ProbeMaps, cage_weights};
use crate::{Object, Shaded, ShaderProbes, Weighting, Work, World};
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Shares of the self-shadow bias along the normal and toward the eye: Eq. (2).
const BIAS_SHARES: [f32; 2] = [0.2, 0.8];

/// Probes of one spacing. Lists are by slot of the window.
pub struct Volume {
    pub(super) window: Window,
    /// It follows the camera.
    pub(super) follows: bool,
    /// The camera of the last frame.
    pub(super) camera: Option<Vec3>,
    pub(super) probes: Vec<Probe>,
    pub(super) maps: Vec<ProbeMaps>,
}

impl Volume {
    /// One that stays.
    pub fn fixed(window: Window, settings: &Settings) -> Self {
        let count = window.grid().len();
        let maps = vec![ProbeMaps::new(settings.sizes); count];
        Self { window, follows: false, camera: None, probes: vec![Probe::NEW; count], maps }
    }

    /// One that follows the camera. Blended around it, it has points of its own alone with 5 probes along each axis at least.
    pub fn following(window: Window, settings: &Settings) -> Self {
        Self { follows: true, ..Self::fixed(window, settings) }
    }

    /// Where a probe stands, metres.
    pub fn position(&self, slot: usize) -> Vec3 {
        self.place(slot) + self.probes[slot].offset
    }

    fn place(&self, slot: usize) -> Vec3 {
        self.window.position(self.window.at(slot))
    }

    /// Moves with the camera; planes that leapfrog begin anew.
    pub fn follow(&mut self, camera: Option<Vec3>) {
        let Some(camera) = camera.filter(|_| self.follows) else { return };
        self.camera = Some(camera);
        for slot in self.window.follow(camera) {
            self.probes[slot] = Probe::NEW;
        }
    }

    /// One iteration of the optimizer for every probe that is not placed; after the last one it has its state.
    ///
    /// Source: Fig. 11, first pass. The state is found from the last place, by a look more than the paper has.
    pub fn place_probes(&mut self, world: &World<'_>, dirs: &[Vec3], objects: &[Object], settings: &Settings) -> Work {
        let (window, spacing) = (self.window, self.window.grid().spacing);
        let looks = |(slot, probe): (usize, &mut Probe)| {
            if probe.state != State::Uninitialized {
                return 0;
            }
            let place = window.position(window.at(slot));
            let look = |probe: &Probe| Sight::of(world, (place, probe.offset), spacing, dirs, objects);
            let mut looks = 0;
            if probe.moves < settings.moves {
                probe.offset = look(probe).moved(probe.offset, spacing);
                probe.moves += 1;
                looks += 1;
            }
            if probe.moves >= settings.moves {
                probe.classify(&look(probe), settings.sleeps);
                looks += 1;
            }
            looks
        };
        let looks: u64 = self.probes.par_iter_mut().enumerate().map(looks).sum();
        Work { rays: looks * dirs.len() as u64, ..Work::default() }
    }

    /// Wakes probes near objects and lets others sleep (Fig. 11, second pass).
    pub fn wake(&mut self, objects: &[Object], settings: &Settings) {
        let reach = self.window.grid().spacing + settings.bias_m(self.window.grid().spacing);
        for slot in 0..self.probes.len() {
            let place = self.place(slot);
            self.probes[slot].meet(objects, place, reach);
        }
    }

    /// Mean radiance by cosine about a direction, as the probes around a point have it; `None` where none of them is lit.
    ///
    /// Source: sec. 2.2, Fig. 4.
    pub fn mean_radiance(&self, shaded: &Shaded, dir: Vec3, settings: &Settings) -> Option<Vec3> {
        let grid = self.window.grid();
        let tested = settings.tested_point(shaded, grid.spacing);
        let cage = grid.cage(if settings.biased_cage { tested } else { shaded.point.position });
        let probe = |at: UVec3| {
            let slot = self.window.slot(at);
            let probe = &self.probes[slot];
            probe.state.is_lit().then(|| (slot, self.window.position(at) + probe.offset, &self.maps[slot]))
        };
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (slot, weight) in cage_weights(settings.weights, cage, &shaded.point, tested, probe) {
            sum += settings.root(self.maps[slot].irradiance(dir)) * weight;
            weights += weight;
        }
        (weights > 0.0).then(|| {
            let root = sum / weights;
            root * root
        })
    }

    /// As a shader shades with it, the only volume there is.
    pub(super) fn shader_probes(&self, settings: &Settings) -> ShaderProbes {
        let grid = self.window.grid();
        let slots: Vec<usize> = (0..grid.len()).map(|probe| self.window.slot(grid.at(probe))).collect();
        let [normal_bias_m, eye_bias_m] = BIAS_SHARES.map(|share| share * settings.bias_m(grid.spacing));
        let (irradiance, moments) = ProbeMaps::concat(slots.iter().map(|&slot| &self.maps[slot]));
        ShaderProbes {
            grid,
            positions: slots.iter().map(|&slot| self.position(slot)).collect(),
            is_lit: slots.iter().map(|&slot| self.probes[slot].state.is_lit()).collect(),
            irradiance,
            moments,
            sizes: settings.sizes,
            weighting: Weighting::Wrapped,
            normal_bias_m,
            eye_bias_m,
            is_cage_biased: settings.biased_cage,
            stored_power: settings.exponent * 0.5,
            mean_power: 2.0,
        }
    }

    /// Its share of the light at a point: 1 inside, falling to 0 over the last cell along each axis. Of a volume that follows the camera
    /// the fall is a cell further in and around the camera, so that nothing jumps when a plane leapfrogs (sec. 7.3, Fig. 17).
    pub fn share(&self, point: Vec3, settings: &Settings) -> f32 {
        let grid = self.window.grid();
        let half = (grid.size - 1).as_vec3() * 0.5;
        let (center, reach) = match self.camera.filter(|_| settings.blends_at_camera) {
            Some(camera) => (camera, half - 1.0),
            None => (self.window.center(), half),
        };
        let within = reach - ((point - center) / grid.spacing).abs();
        within.clamp(Vec3::ZERO, Vec3::ONE).element_product()
    }
}

impl Settings {
    /// The point whose visibility is asked for, out of the surface's own shadow.
    ///
    /// Source: Eq. (2).
    fn tested_point(&self, shaded: &Shaded, spacing: Vec3) -> Vec3 {
        let [along_normal, to_eye] = BIAS_SHARES;
        shaded.point.position + (shaded.point.normal * along_normal + shaded.to_eye * to_eye) * self.bias_m(spacing)
    }

    /// Length of the self-shadow bias for a unit vector, metres: `0.75 D B` of Eq. (2).
    pub(super) fn bias_m(&self, spacing: Vec3) -> f32 {
        0.75 * spacing.min_element() * self.self_shadow_bias
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_scenes::SurfacePoint;

    #[test]
    fn the_self_shadow_bias_goes_to_the_eye_more_than_along_the_normal() {
        let point = SurfacePoint { position: Vec3::ONE, normal: Vec3::Y, geometric_normal: Vec3::Y };
        let shaded = Shaded { point, to_eye: Vec3::X };
        let bias = Settings::default().tested_point(&shaded, Vec3::new(3.0, 2.0, 4.0)) - Vec3::ONE;
        // 0.75 x 2 m x 0.3 = 0.45 m, and some roundings.
        assert!(bias.distance(Vec3::new(0.8, 0.2, 0.0) * 0.45) < 1e-6, "{bias}");
    }
}
