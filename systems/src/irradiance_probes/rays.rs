//! A probe's rays: where they go, what they meet, and the light that they bring back.

use crate::{Frame, Shaded, System, Work, World};
use glam::{Quat, Vec3};
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_surfaces::rays::SurfaceHit;
use std::f64::consts::TAU;

/// Black backs that a ray passes before it counts as lost: a guard against surfaces that lie in one another.
const MOST_PASSED: usize = 64;
/// The share of its distance that is left of a ray that meets a black back (the scaling paper, sec. 4.1: shortened by 80 %).
const SHORTENED: f32 = 0.2;

/// What one ray of a probe brings back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeRay {
    /// Unit direction, away from the probe.
    pub dir: Vec3,
    /// To what it met, metres; not beyond what the probe looks at.
    pub distance: f32,
    /// Radiance along it, W sr^-1 m^-2.
    pub radiance: Vec3,
}

/// What a ray makes of the black back of a one-sided surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackFaces {
    /// It passes, as with back face culling.
    Culled,
    /// It ends there and is black.
    Black,
    /// The same, with its distance shortened by 80 %.
    Shortened,
}

/// How the rays of all probes are traced and shaded in a frame.
#[derive(Clone, Copy)]
pub struct ProbeRays<'a> {
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// The system that the probes belong to, as its last frame left it.
    pub own: &'a dyn System,
    /// What becomes of black backs.
    pub backs: BackFaces,
    /// What counts as the distance of a miss, and the most that any ray has, metres.
    pub far_m: f32,
}

impl ProbeRays<'_> {
    /// Traces rays from a probe and shades what they meet: emission, direct light with shadows, and the indirect light of earlier
    /// frames. Also the rays that it took.
    pub fn shaded(&self, origin: Vec3, dirs: &[Vec3]) -> (Vec<ProbeRay>, Work) {
        let world = self.frame.world;
        let mut work = Work { rays: dirs.len() as u64, ..Work::default() };
        let mut rays = Vec::with_capacity(dirs.len());
        let (mut met, mut points) = (Vec::new(), Vec::new());
        for &dir in dirs {
            let passes = |hit: &SurfaceHit| self.backs == BackFaces::Culled && hit.point.is_none();
            let Some(hit) = first_hit(world, origin, dir, passes) else {
                rays.push(ProbeRay { dir, distance: self.far_m, radiance: world.sky(dir) });
                continue;
            };
            let mut ray = ProbeRay { dir, distance: hit.t.min(self.far_m), radiance: Vec3::ZERO };
            match world.surfel(&hit) {
                Some(surfel) => {
                    met.push((rays.len(), surfel));
                    points.push(Shaded { point: surfel.point, to_eye: -dir });
                }
                None if self.backs == BackFaces::Shortened => ray.distance *= SHORTENED,
                None => (),
            }
            rays.push(ray);
        }
        let indirect = self.frame.feedback.irradiance(self.own, world, &points);
        for ((ray, surfel), indirect) in met.into_iter().zip(indirect) {
            let (direct, shadow_rays) = world.direct(&surfel.point);
            work.shadow_rays += shadow_rays;
            rays[ray].radiance = surfel.sent(direct + indirect);
        }
        (rays, work)
    }
}

/// The first surface along a ray that does not let it pass; its distance is from the ray's origin, metres.
pub fn first_hit(
    world: &World<'_>,
    origin: Vec3,
    dir: Vec3,
    passes: impl Fn(&SurfaceHit) -> bool,
) -> Option<SurfaceHit> {
    let mut gone = 0.0;
    for _ in 0..MOST_PASSED {
        let hit = world.caster().closest_hit(origin + dir * gone, dir)?;
        let hit = SurfaceHit { t: gone + hit.t, ..hit };
        if !passes(&hit) {
            return Some(hit);
        }
        gone = hit.t + world.caster().offset_m();
    }
    None
}

/// Spherical Fibonacci directions, all turned by one random rotation that depends on nothing but its three counters. `pattern` keeps the
/// rotations of one frame apart.
pub fn turned_directions(rays: u32, seed: u64, frame: u64, pattern: u64) -> Vec<Vec3> {
    let turn = rotation([0, 1, 2].map(|k| counter_uniform(seed, frame, 3 * pattern + k)));
    (0..rays).map(|ray| turn * Vec3::from(spherical_fibonacci(ray, rays))).collect()
}

/// The rotation of three uniform numbers; uniform over all rotations.
///
/// Source: Shoemake 1992, Uniform Random Rotations.
fn rotation([radius, first, second]: [f64; 3]) -> Quat {
    let (low, high) = ((1.0 - radius).sqrt(), radius.sqrt());
    let ((sin1, cos1), (sin2, cos2)) = ((TAU * first).sin_cos(), (TAU * second).sin_cos());
    Quat::from_xyzw((low * sin1) as f32, (low * cos1) as f32, (high * sin2) as f32, (high * cos2) as f32).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{furnace, in_world};
    use localprt_scenes::Lighting;

    #[test]
    fn directions_are_turned_anew_in_every_frame_and_all_alike() {
        let frames: Vec<_> = (0..2000).map(|frame| turned_directions(16, 5, frame, 0)).collect();
        for dirs in &frames {
            // Angles between rays stay: a rotation, up to roundings of unit vectors.
            let plain = Vec3::from(spherical_fibonacci(3, 16)).dot(Vec3::from(spherical_fibonacci(9, 16)));
            assert!((dirs[3].dot(dirs[9]) - plain).abs() < 1e-6);
        }
        // Each ray is uniform over the sphere in time: components have mean 0 and variance 1/3, so that the mean over 2000 frames has a
        // deviation of 0.0129; four of them.
        let mean = frames.iter().map(|dirs| dirs[3]).sum::<Vec3>() / 2000.0;
        assert!(mean.abs().max_element() < 0.052, "{mean}");
        assert_ne!(turned_directions(16, 5, 1, 0), turned_directions(16, 6, 1, 0));
        assert_ne!(turned_directions(16, 5, 1, 0), turned_directions(16, 5, 1, 1));
        assert_eq!(turned_directions(16, 5, 1, 0), frames[1]);
    }

    #[test]
    fn a_ray_passes_what_it_is_let_through() {
        in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
            // From 1 m outside: the black back of the wall at x = 0, then the room of 4 m.
            let origin = Vec3::new(-1.0, 1.5, 2.5);
            let back = first_hit(world, origin, Vec3::X, |_| false).unwrap();
            let front = first_hit(world, origin, Vec3::X, |hit| hit.point.is_none()).unwrap();
            // Two roundings and a ray offset of 2e-6 times some 13 m.
            assert!(back.point.is_none() && (back.t - 1.0).abs() < 1e-4);
            assert!(front.point.is_some() && (front.t - 5.0).abs() < 1e-4);
            assert!(first_hit(world, origin, Vec3::X, |_| true).is_none());
        });
    }
}
