//! Light straight from punctual lights at the points of a path.

use super::{PathTracer, Random, SurfacePoint};
use crate::relight::direct_irradiance;
use glam::Vec3;

/// Up to this many lights are all asked, which leaves no noise; of more, a few are drawn.
const MOST_LIGHTS: usize = 8;
/// How many are drawn.
const DRAWN: usize = 4;

impl PathTracer<'_> {
    /// Irradiance straight from punctual lights, W m^-2, and the shadow rays it took.
    ///
    /// Of many lights a few are drawn with probabilities proportional to the light they would give without shadows.
    pub(super) fn direct(&self, point: &SurfacePoint, random: &mut Random) -> (Vec3, u32) {
        let lights = &self.lighting.lights;
        if lights.len() <= MOST_LIGHTS {
            return (self.direct_of(lights, point), lights.len() as u32);
        }
        let mut total = 0.0;
        let rising: Vec<f64> = lights
            .iter()
            .map(|light| {
                total += light.incident(point.position).map_or(0.0, |incident| {
                    let cosine = point.normal.dot(incident.dir_to_light).max(0.0);
                    f64::from(cosine * incident.irradiance.max_element())
                });
                total
            })
            .collect();
        if total <= 0.0 {
            return (Vec3::ZERO, 0);
        }
        let mut sum = Vec3::ZERO;
        for _ in 0..DRAWN {
            let at = random.next() * total;
            let chosen = rising.partition_point(|&end| end <= at).min(lights.len() - 1);
            let share = (rising[chosen] - if chosen > 0 { rising[chosen - 1] } else { 0.0 }) / total;
            if share > 0.0 {
                sum += self.direct_of(&lights[chosen..=chosen], point) / (share as f32 * DRAWN as f32);
            }
        }
        (sum, DRAWN as u32)
    }

    fn direct_of(&self, lights: &[localprt_scenes::Light], point: &SurfacePoint) -> Vec3 {
        direct_irradiance(self.caster, lights, point.position, point.normal, point.geometric_normal)
    }
}
