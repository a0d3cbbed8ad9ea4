//! Reference light by path tracing: plain, slow, and independent of transport, probes and spherical harmonics.
//!
//! In: a scene's rays, a [`Lighting`], points with normals. Out: irradiance that arrives after so many gathers, with the
//! standard error of every estimate. The quantity is that of the relighter:
//!
//! ```text
//! E_0 = 0,   E_k(x) = ∫ L_(k-1)(Γ(x, ω)) max(n·ω, 0) dω,   L_k = Le + albedo/pi (D + E_k),   sky where rays leave
//! ```
//!
//! with D the irradiance straight from punctual lights. Directions are sampled by the cosine; emissive triangles and the
//! surfaces that lamps shine on are sampled as well, and all are combined by multiple importance sampling (balance
//! heuristic, Veach and Guibas 1995). Paths end by Russian roulette, so a large number of gathers costs little and is the
//! converged solution.

mod estimate;
mod lamps;
mod picture;
mod sky;
#[cfg(test)]
mod tests;

pub use estimate::{Estimates, PathBudget};
pub use picture::{GRAY, PixelLight, ViewLight, ViewSettings};

use crate::{
    emitters::Emitters,
    rays::{RayCaster, frame},
};
use glam::Vec3;
use lamps::{FoundByCosine, Lamps};
use localprt_formats::directions::{cosine_hemisphere, counter_uniform};
use localprt_scenes::{Lighting, SurfacePoint, SurfaceShading};
use sky::SkySampler;
use std::f32::consts::{FRAC_1_PI, PI};

/// A path tracer for one lighting state.
pub struct PathTracer<'a> {
    caster: &'a RayCaster<'a>,
    lighting: &'a Lighting,
    shading: SurfaceShading<'a>,
    emitters: Emitters,
    lamps: Lamps,
    sky: SkySampler,
    bounces: u32,
    seed: u64,
}

/// Random numbers of one path: counters, so that a path depends on nothing but its own numbers.
struct Random {
    seed: u64,
    stream: u64,
    counter: u64,
}

impl Random {
    fn next(&mut self) -> f64 {
        self.counter += 1;
        counter_uniform(self.seed, self.stream, self.counter)
    }

    fn pair(&mut self) -> [f64; 2] {
        [self.next(), self.next()]
    }
}

impl<'a> PathTracer<'a> {
    /// `bounces` counts gathers; 1 is the first indirect bounce. Different seeds give independent estimates.
    pub fn new(caster: &'a RayCaster<'a>, lighting: &'a Lighting, bounces: u32, seed: u64) -> Self {
        let shading = SurfaceShading::new(caster.scene(), lighting);
        let emitters = Emitters::of(caster.scene(), &shading);
        let lamps = Lamps::of(&lighting.lights, caster.scene());
        let sky = SkySampler::of(&lighting.sky);
        Self { caster, lighting, shading, emitters, lamps, sky, bounces, seed }
    }

    /// One estimate of E_k at a point, W m^-2, and the rays it took. `first` chooses the first direction on the unit
    /// square, everything else is drawn from `random`.
    fn path(&self, receiver: SurfacePoint, first: [f64; 2], random: &mut Random) -> (Vec3, u32) {
        let mut point = receiver;
        let mut square = first;
        // What a unit of irradiance at `point` adds to the estimate.
        let mut weight = Vec3::ONE;
        let mut sum = Vec3::ZERO;
        let mut rays = 0;
        for gather in 1..=self.bounces {
            let origin = point.position + point.geometric_normal * self.caster.offset_m();
            if !self.emitters.is_empty() {
                sum += weight * self.gather_emitters(&point, origin, random);
                rays += 1;
            }
            if self.sky.is_sampled() {
                sum += weight * self.gather_sky(&point, origin, random);
                rays += 1;
            }
            if self.lamps.are_sampled() {
                let (light, traced) = self.gather_lamps(&point, origin, random);
                sum += weight * light;
                rays += traced;
            }
            let local = Vec3::from(cosine_hemisphere(square));
            let by_cosine = local.z * FRAC_1_PI;
            let (tangent, bitangent) = frame(point.normal);
            let dir = tangent * local.x + bitangent * local.y + point.normal * local.z;
            if local.z <= 0.0 || dir.dot(point.geometric_normal) <= 0.0 {
                break;
            }
            rays += 1;
            let Some(hit) = self.caster.closest_hit(origin, dir) else {
                // Density cos/pi, measured by cos: a factor of pi.
                let by_sky = self.sky.density(dir);
                sum += weight * PI * self.lighting.sky.radiance(dir) * (by_cosine / (by_cosine + by_sky));
                break;
            };
            let Some(face) = hit.point else { break };
            let emission = self.shading.emission(face.mesh, face.triangle, face.barycentrics);
            if emission != Vec3::ZERO {
                let by_emitter = self.emitters.density(&hit, dir);
                sum += weight * PI * emission * (by_cosine / (by_cosine + by_emitter));
            }
            // pi from the density, albedo / pi from the reflection.
            weight *= self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
            point = hit.surface_point(self.caster.scene());
            let found = FoundByCosine { density: by_cosine, distance: hit.t, cosine: hit.normal.dot(dir) };
            let (direct, shadow_rays) = self.direct(&point, found, random);
            sum += weight * direct;
            rays += shadow_rays;
            if gather == self.bounces {
                break;
            }
            // Russian roulette.
            let survival = weight.max_element().min(1.0);
            if survival <= 0.0 || random.next() >= f64::from(survival) {
                break;
            }
            weight /= survival;
            square = random.pair();
        }
        (sum, rays)
    }

    /// Irradiance from one point of an emissive triangle, weighted against sampling by the cosine.
    fn gather_emitters(&self, point: &SurfacePoint, origin: Vec3, random: &mut Random) -> Vec3 {
        let (face, target) = self.emitters.sample(random.next(), random.pair());
        let dir = (target - origin).normalize_or_zero();
        let cosine = point.normal.dot(dir);
        if cosine <= 0.0 || point.geometric_normal.dot(dir) <= 0.0 {
            return Vec3::ZERO;
        }
        let met = self.emitters.meet(self.caster, origin, dir, (face, target));
        let Some((hit, by_emitter)) = met else { return Vec3::ZERO };
        let Some(seen) = hit.point else { return Vec3::ZERO };
        let emission = self.shading.emission(seen.mesh, seen.triangle, seen.barycentrics);
        emission * cosine / (by_emitter + cosine * FRAC_1_PI)
    }
}

impl PathTracer<'_> {
    /// Irradiance from one direction of the sky, weighted against sampling by the cosine.
    fn gather_sky(&self, point: &SurfacePoint, origin: Vec3, random: &mut Random) -> Vec3 {
        let dir = self.sky.sample(random.next(), random.pair());
        let cosine = point.normal.dot(dir);
        let by_sky = self.sky.density(dir);
        if cosine <= 0.0 || point.geometric_normal.dot(dir) <= 0.0 || by_sky <= 0.0 || !self.caster.escapes(origin, dir)
        {
            return Vec3::ZERO;
        }
        self.lighting.sky.radiance(dir) * cosine / (by_sky + cosine * FRAC_1_PI)
    }
}
