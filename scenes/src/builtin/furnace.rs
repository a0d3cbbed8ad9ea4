//! A closed box that glows everywhere alike: every quantity has a closed form.

use super::shapes::Shape;
use super::{camera, matte};
use crate::scene::Scene;
use glam::Vec3;

/// Radiance emitted by every surface of the scene `furnace`, W sr^-1 m^-2.
pub const FURNACE_EMISSION: f32 = 1.0;
/// Albedo of every surface of the scene `furnace`.
pub const FURNACE_ALBEDO: f32 = 0.5;

/// Indirect irradiance on every surface after `bounces` gathers, or in equilibrium: pi times the outgoing radiance
/// `e (1 + a + a^2 + ...)`, which settles at `pi e / (1 - a)`.
pub fn furnace_irradiance(bounces: Option<u32>) -> f64 {
    let (emission, albedo) = (f64::from(FURNACE_EMISSION), f64::from(FURNACE_ALBEDO));
    let remaining = bounces.map_or(0.0, |bounces| albedo.powf(f64::from(bounces)));
    std::f64::consts::PI * emission * (1.0 - remaining) / (1.0 - albedo)
}

/// 2 x 2 x 2 m, inward faces.
pub(super) fn build() -> Scene {
    let mut shape = Shape::default();
    shape.grid_box([&[-1.0, 1.0], &[0.0, 2.0], &[-1.0, 1.0]], true, |_| true);
    let mut material = matte("glow", [FURNACE_ALBEDO; 3]);
    material.emission = Vec3::splat(FURNACE_EMISSION);
    Scene {
        meshes: vec![shape.into_mesh("box", 0, None)],
        materials: vec![material],
        cameras: vec![camera("inside", Vec3::new(0.0, 1.0, 0.9), Vec3::new(0.0, 0.9, 0.0), 75.0)],
        ..Scene::default()
    }
}
