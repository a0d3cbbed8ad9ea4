//! Closed forms, rays against rays, and each element against its lack.

mod light;
mod search;

use super::{Gather, LightField, Settings};
use crate::test_worlds::in_world;
use crate::{Setup, Shaded, World};
use glam::Vec3;
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_scenes::{Lighting, SurfacePoint, builtin};

const GATHERS: [Gather; 3] = [Gather::Exact, Gather::Traced, Gather::Prefiltered];
/// Small maps, for tests of light.
const SMALL: Settings = Settings { side: 64, prefiltered: 16, rays: 64, ..Settings::PAPER };

/// Smaller ones, for many frames.
const TINY: Settings = Settings { side: 32, prefiltered: 8, rays: 32, ..SMALL };

fn field(world: &World<'_>, probes: usize, settings: Settings, gather: Gather) -> LightField {
    LightField::new(world, &Setup { probes, cameras: &[], seed: 1 }, settings, gather)
}

fn from_above(points: &[SurfacePoint]) -> Vec<Shaded> {
    points.iter().copied().map(Shaded::from_above).collect()
}

fn level(position: Vec3, normal: Vec3) -> Shaded {
    Shaded::from_above(SurfacePoint { position, normal, geometric_normal: normal })
}

fn cornell(test: impl FnOnce(&World<'_>)) {
    let scene = builtin::scene("cornell").expect("a scene");
    let lighting = Lighting { lights: scene.lights.clone(), ..Lighting::default() };
    in_world(&scene, &lighting, test);
}

/// Rays from the free space of a box of 2 m.
fn rays(n: u64) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..n).map(move |ray| {
        let random = |k| counter_uniform(4, ray, k) as f32;
        let origin = Vec3::new(1.8 * random(0) - 0.9, 1.3 + 0.6 * random(1), 1.8 * random(2) - 0.9);
        (origin, Vec3::from(spherical_fibonacci(ray as u32, n as u32)))
    })
}
