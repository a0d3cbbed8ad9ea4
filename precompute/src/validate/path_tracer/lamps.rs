//! Punctual lights: what they give directly, and the bright spots that they put on surfaces.
//!
//! A lamp close to a wall makes a small spot that lights the whole room and that few cosine-distributed rays find. So
//! surface points are sampled from the lamps as well: a ray leaves a lamp, and where it lands is joined to the point that
//! gathers. The light of each lamp is an integral of its own, found by both kinds of rays and combined by the balance
//! heuristic.

use super::{PathTracer, Random, SurfacePoint};
use crate::emitters::{SAME_POINT, distribution::Distribution};
use glam::Vec3;
use localprt_scenes::{Light, LightKind, Scene};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Up to this many lights are all asked, which leaves no noise; of more, a few are drawn.
const MOST_LIGHTS: usize = 8;
/// How many are drawn.
const DRAWN: usize = 4;
/// Spots with a smaller share of the sphere are left to the cosine: f32 cannot tell directions within them apart.
const LEAST_CONE: f32 = 1e-6;

/// The lights of a state as places that light is sent from.
pub(super) struct Lamps {
    lights: Vec<Light>,
    /// Of the lights; empty where none is sampled.
    choice: Distribution,
    /// Middle and radius of a ball around the scene, metres: where parallel light comes from.
    center: Vec3,
    radius: f32,
}

/// Light of one lamp at a point.
#[derive(Clone, Copy, Debug, Default)]
struct Direct {
    /// Irradiance, W m^-2.
    irradiance: Vec3,
    /// Density, per square metre, with which [`PathTracer::gather_lamps`] lands on the point from this lamp.
    density: f32,
}

/// How a point was found that gathers by the cosine: to weigh its direct light.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundByCosine {
    /// Density of the direction, per steradian.
    pub density: f32,
    /// Way to the point, metres.
    pub distance: f32,
    /// Cosine between the way and the point's normal.
    pub cosine: f32,
}

impl Lamps {
    pub(super) fn of(lights: &[Light], scene: &Scene) -> Self {
        let (low, high) = scene.bounds().unwrap_or_default();
        let mut lamps = Self {
            lights: lights.to_vec(),
            choice: Distribution::default(),
            center: (low + high) / 2.0,
            radius: (scene.extent() / 2.0).max(f32::MIN_POSITIVE),
        };
        let power = |light: &Light| match lamps.ray_density(light) {
            density if density > 0.0 => f64::from((light.color * light.intensity).max_element() / density),
            _ => 0.0,
        };
        lamps.choice = Distribution::of(lights.iter().map(power));
        lamps
    }

    /// Whether bright spots are sampled.
    pub(super) fn are_sampled(&self) -> bool {
        !self.choice.is_empty()
    }

    /// Density of the rays that are sent from a light: per steradian, or per square metre across parallel light. 0 for a
    /// light that is not sampled.
    fn ray_density(&self, light: &Light) -> f32 {
        match light.kind {
            LightKind::Point => 1.0 / (2.0 * TAU),
            LightKind::Spot { .. } if light.direction == Vec3::ZERO => 0.0,
            LightKind::Spot { outer_cone, .. } => match cone_height(outer_cone) {
                height if height >= LEAST_CONE => 1.0 / (TAU * height),
                _ => 0.0,
            },
            LightKind::Directional if light.direction == Vec3::ZERO => 0.0,
            LightKind::Directional => FRAC_1_PI / (self.radius * self.radius),
        }
    }

    /// A ray sent from a light: origin and direction.
    fn ray(&self, light: &Light, [u, v]: [f64; 2]) -> (Vec3, Vec3) {
        let (sin, cos) = (TAU * v as f32).sin_cos();
        let around = |axis: Vec3, drop: f32| {
            let (tangent, bitangent) = crate::rays::frame(axis);
            let across = (drop * (2.0 - drop)).max(0.0).sqrt();
            (tangent * cos + bitangent * sin) * across + axis * (1.0 - drop)
        };
        match light.kind {
            LightKind::Point => (light.position, around(Vec3::Y, 2.0 * u as f32)),
            LightKind::Spot { outer_cone, .. } => {
                (light.position, around(light.direction, u as f32 * cone_height(outer_cone)))
            }
            LightKind::Directional => {
                let (tangent, bitangent) = crate::rays::frame(light.direction);
                let across = (tangent * cos + bitangent * sin) * (u as f32).sqrt() * self.radius;
                (self.center + across - light.direction * self.radius, light.direction)
            }
        }
    }
}

/// `1 - cos` of a half angle, exact for small ones.
fn cone_height(half_angle: f32) -> f32 {
    let sine = (f64::from(half_angle) / 2.0).sin();
    (2.0 * sine * sine) as f32
}

impl PathTracer<'_> {
    /// Light straight from the lamps at a point, and the shadow rays it took. With `found` the light of each lamp is
    /// weighted against [`PathTracer::gather_lamps`].
    ///
    /// Of many lamps a few are drawn with probabilities proportional to the light they would give without shadows.
    pub(super) fn direct(&self, point: &SurfacePoint, found: FoundByCosine, random: &mut Random) -> (Vec3, u32) {
        let weighted = |index: usize| {
            let one = self.direct_of(index, point);
            let by_lamp = to_solid_angle(one.density, found.distance, found.cosine);
            one.irradiance * (found.density / (found.density + by_lamp))
        };
        let lights = &self.lamps.lights;
        if lights.len() <= MOST_LIGHTS {
            return ((0..lights.len()).map(weighted).sum(), lights.len() as u32);
        }
        let choice = Distribution::of(lights.iter().map(|light| {
            light.incident(point.position).map_or(0.0, |incident| {
                let cosine = point.normal.dot(incident.dir_to_light).max(0.0);
                f64::from(cosine * incident.irradiance.max_element())
            })
        }));
        if choice.is_empty() {
            return (Vec3::ZERO, 0);
        }
        let mut sum = Vec3::ZERO;
        for _ in 0..DRAWN {
            let chosen = choice.choose(random.next());
            let share = choice.probability(chosen);
            if share > 0.0 {
                sum += weighted(chosen) / (share as f32 * DRAWN as f32);
            }
        }
        (sum, DRAWN as u32)
    }

    fn direct_of(&self, index: usize, point: &SurfacePoint) -> Direct {
        let light = &self.lamps.lights[index];
        let Some(incident) = light.incident(point.position) else { return Direct::default() };
        let cosine = point.normal.dot(incident.dir_to_light);
        let across = point.geometric_normal.dot(incident.dir_to_light);
        if cosine <= 0.0 || across <= 0.0 {
            return Direct::default();
        }
        let offset_m = self.caster.offset_m();
        let origin = point.position + point.geometric_normal * offset_m;
        let (is_free, spread) = if incident.distance.is_finite() {
            let end = light.position - incident.dir_to_light * offset_m;
            (self.caster.visible(origin, end), across / (incident.distance * incident.distance))
        } else {
            (self.caster.escapes(origin, incident.dir_to_light), across)
        };
        if !is_free {
            return Direct::default();
        }
        let density = self.lamps.choice.probability(index) as f32 * self.lamps.ray_density(light) * spread;
        Direct { irradiance: incident.irradiance * cosine, density }
    }

    /// Irradiance at a point by way of one surface point that a lamp shines on, from that lamp, weighted against sampling
    /// by the cosine; and the rays it took.
    pub(super) fn gather_lamps(&self, point: &SurfacePoint, origin: Vec3, random: &mut Random) -> (Vec3, u32) {
        let index = self.lamps.choice.choose(random.next());
        let (start, sent) = self.lamps.ray(&self.lamps.lights[index], random.pair());
        let start = start + sent * self.caster.offset_m();
        let Some(landed) = self.caster.closest_hit(start, sent).filter(|hit| hit.point.is_some()) else {
            return (Vec3::ZERO, 1);
        };
        let dir = (landed.position - origin).normalize_or_zero();
        let cosine = point.normal.dot(dir);
        if cosine <= 0.0 || point.geometric_normal.dot(dir) <= 0.0 || landed.normal.dot(dir) >= 0.0 {
            return (Vec3::ZERO, 1);
        }
        let near = SAME_POINT * self.caster.offset_m();
        let joined = self.caster.closest_hit(origin, dir).filter(|hit| hit.position.distance(landed.position) <= near);
        let Some((hit, face)) = joined.and_then(|hit| Some((hit, hit.point?))) else { return (Vec3::ZERO, 2) };
        let direct = self.direct_of(index, &hit.surface_point(self.caster.scene()));
        // What the lamp itself does not light, by range or rounding, is left to the cosine.
        if direct.density <= 0.0 {
            return (Vec3::ZERO, 3);
        }
        let by_lamp = to_solid_angle(direct.density, hit.t, hit.normal.dot(dir));
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        (albedo / PI * direct.irradiance * cosine / (by_lamp + cosine * FRAC_1_PI), 3)
    }
}

/// Density per square metre of a surface to density per steradian seen from `distance` metres.
fn to_solid_angle(density: f32, distance: f32, cosine: f32) -> f32 {
    if density > 0.0 { density * distance * distance / cosine.abs().max(f32::MIN_POSITIVE) } else { 0.0 }
}
