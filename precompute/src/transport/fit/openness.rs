//! The prior's scale of surfaces: openness, how much of the light around a surface point can reach it, and albedo, how much
//! of that is sent on.
//!
//! Surfaces in gaps and corners are dark more often than not, and a probe that sees the bright surface beside a gap says
//! nothing of the sort. The prior's scale s(y) tells the fit: the cosine-weighted mean of t / (t + t0) over the rays from y,
//! t their length and t0 some probe spacings. Without it, receivers a hand's breadth from a surface take over the light of
//! lit surfaces around (nrmse of 100 receivers of a staircase in a trial: 1.07, and 0.22 with it).

use super::Surface;
use crate::transport::digests::texels_around;
use crate::{
    digest::Digester,
    lightmap::{Atlas, ReceiverSet},
    rays::{FacePoint, RayCaster, frame},
};
use glam::{FloatExt, Vec2, Vec3};
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use localprt_scenes::{FaceId, Scene, luminance};
use localprt_surfaces::atlas::raster::in_texels;
use rayon::prelude::*;

/// Surfaces count as no darker than this.
const LEAST_ALBEDO: f32 = 0.05;
/// s where no receiver is near: the same in all scenes, so that no edit changes it.
const FAR_FROM_RECEIVERS: f32 = 0.5;
/// How far a lookup reaches, in texels: half of one, and a rounding.
const REACH: f32 = 0.51;
/// Rays of each receiver.
const RAYS: u32 = 64;

/// s(y) on the receiver map.
pub(super) struct Openness {
    size: u32,
    /// `[size * size]`.
    scale: Vec<f32>,
    /// Corner coordinates of each face, texels.
    corners: Vec<[Vec2; 3]>,
}

impl Openness {
    /// Measures every receiver; `half_m` is t0.
    pub(super) fn of(caster: &RayCaster<'_>, atlas: &Atlas, receivers: &ReceiverSet, half_m: f32) -> Self {
        let local: Vec<[f32; 3]> =
            (0..RAYS).map(|ray| cosine_hemisphere(fibonacci_square(ray, RAYS, [0.0, 0.0]))).collect();
        let scales: Vec<f32> = (0..receivers.len())
            .into_par_iter()
            .map(|receiver| {
                let normal = receivers.geometric_normal[receiver];
                let (tangent, bitangent) = frame(normal);
                let origin = receivers.position[receiver] + normal * caster.offset_m();
                let open: f32 = local
                    .iter()
                    .map(|&[x, y, z]| {
                        let dir = (tangent * x + bitangent * y + normal * z).normalize();
                        caster.closest_hit(origin, dir).map_or(1.0, |hit| hit.t / (hit.t + half_m))
                    })
                    .sum();
                open / RAYS as f32
            })
            .collect();
        let mut scale = vec![FAR_FROM_RECEIVERS; receivers.size as usize * receivers.size as usize];
        if receivers.size == 0 {
            return Self { size: 0, scale, corners: Vec::new() };
        }
        for (&texel, &value) in receivers.texel.iter().zip(&scales) {
            scale[texel as usize] = value;
        }
        for &(texel, receiver) in &receivers.gutters {
            scale[texel as usize] = scales[receiver as usize];
        }
        let corners = |uv: &[Vec2; 3]| uv.map(|uv| in_texels(uv, receivers.size).as_vec2());
        Self { size: receivers.size, scale, corners: atlas.corners.iter().map(corners).collect() }
    }

    /// s(y) of a surface point, and whether it emits; s = 1 where there is no map or it does, since what a surface emits
    /// does not depend on what is around it.
    pub(super) fn surface(&self, caster: &RayCaster<'_>, point: &FacePoint) -> Surface {
        let scene = caster.scene();
        let glows = scene.materials[scene.meshes[point.mesh].material].emission != Vec3::ZERO;
        let scale = if glows { 1.0 } else { self.scale(point) * albedo(scene, point) };
        Surface { scale, glows }
    }

    /// Takes in all that [`Openness::surface`] may read of a part of a face, but for its material: a convex part, given by the
    /// barycentrics of its corners.
    pub(super) fn digest(&self, face: FaceId, part: &[Vec3], digester: &mut Digester) {
        digester.one(u8::from(self.size == 0));
        if self.size == 0 {
            return;
        }
        // Where on the map a face lies counts, but not how large the map is.
        let corners = self.corners[face.0 as usize];
        digester.all(&corners);
        let on_map = corners.map(|corner| corner / self.size as f32);
        for row in texels_around(&on_map, part, self.size, REACH).rows(self.size) {
            digester.all(&self.scale[row]);
        }
    }

    /// Openness alone, bilinear between receivers.
    fn scale(&self, point: &FacePoint) -> f32 {
        if self.size == 0 {
            return 1.0;
        }
        let [a, b, c] = self.corners[point.face.0 as usize];
        let place = a * point.barycentrics.x + b * point.barycentrics.y + c * point.barycentrics.z - 0.5;
        let last = self.size as i32 - 1;
        let (low, t) = (place.floor().as_ivec2(), place - place.floor());
        let at = |x: i32, y: i32| self.scale[(y.clamp(0, last) * self.size as i32 + x.clamp(0, last)) as usize];
        let across = |y: i32| at(low.x, y).lerp(at(low.x + 1, y), t.x);
        across(low.y).lerp(across(low.y + 1), t.y)
    }
}

/// Brightness of the surface's own albedo; not less than what a change of material at run time may make of it.
fn albedo(scene: &Scene, point: &FacePoint) -> f32 {
    let color = scene.base_color(point.mesh, point.triangle, point.barycentrics).truncate();
    (luminance(color) as f32).clamp(LEAST_ALBEDO, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openness_is_that_of_a_receiver_and_between_receivers_in_between() {
        // A face whose coordinates are its barycentrics, on a map of 2 x 2 texels.
        let openness = Openness {
            size: 2,
            scale: vec![0.1, 0.3, 0.5, 0.9],
            corners: vec![[Vec2::ZERO, Vec2::X, Vec2::Y].map(|uv| 2.0 * uv)],
        };
        let at = |u: f32, v: f32| {
            let barycentrics = Vec3::new(1.0 - u - v, u, v);
            openness.scale(&FacePoint { face: FaceId(0), mesh: 0, triangle: 0, barycentrics })
        };
        let cases = [
            (0.25, 0.25, 0.1),
            (0.75, 0.25, 0.3),
            (0.5, 0.25, 0.2),
            (0.25, 0.5, 0.3),
            (0.5, 0.5, 0.45),
            (0.0, 0.0, 0.1),
        ];
        for (u, v, expected) in cases {
            assert!((at(u, v) - expected).abs() < 1e-6, "({u}, {v}): {} instead of {expected}", at(u, v));
        }
    }
}
