//! Glossy reflections: the first by a ray, those after it from the probes (sec. 4.4).
//!
//! What a probe stores is light filtered by a cosine. About a mirror direction that is radiance of a rough reflection, without a ray.

use super::ScaledDdgi;
use crate::{Shaded, System, World};
use glam::Vec3;

impl ScaledDdgi {
    /// Radiance that arrives about the mirror direction of the eye, filtered by a cosine: second-order glossy light, W sr^-1 m^-2.
    ///
    /// Differs from the paper, which speaks of a factor of 2 pi between what it stores and radiance: of its sums by weight. The maps
    /// here hold the mean itself.
    pub fn second_order(&self, shaded: &Shaded) -> Vec3 {
        self.mean_radiance(shaded, mirror(shaded))
    }

    /// Radiance along the mirror direction of a polished surface: what the ray meets, with its diffuse light and a share `gloss` of
    /// second-order glossy light.
    ///
    /// Differs from the paper: no blur by roughness and distance, which needs a picture; scenes here have no glossy term, hence `gloss`.
    pub fn reflection(&self, world: &World<'_>, shaded: &Shaded, gloss: f32) -> Vec3 {
        let dir = mirror(shaded);
        let origin = shaded.point.position + shaded.point.geometric_normal * world.caster().offset_m();
        let Some(hit) = world.caster().closest_hit(origin, dir) else { return world.sky(dir) };
        let Some(surfel) = world.surfel(&hit) else { return Vec3::ZERO };
        let met = Shaded { point: surfel.point, to_eye: -dir };
        let indirect = self.irradiance(world, &crate::Query::of(&[met]))[0];
        surfel.sent(world.direct(&surfel.point).0 + indirect) + self.second_order(&met) * gloss
    }
}

/// Where light comes from that a mirror sends to the eye; unit length, away from the surface.
fn mirror(shaded: &Shaded) -> Vec3 {
    let normal = shaded.point.normal;
    (normal * (2.0 * normal.dot(shaded.to_eye)) - shaded.to_eye).normalize_or(normal)
}
