//! An open plane under the sky: what it receives is the sky alone.

use super::shapes::Shape;
use super::{camera, matte};
use crate::scene::Scene;
use glam::Vec3;

/// 10 x 10 m at y = 0, facing up, albedo 0.5.
pub(super) fn build() -> Scene {
    let mut shape = Shape::default();
    shape.grid_box([&[-5.0, 5.0], &[0.0, 1.0], &[-5.0, 5.0]], true, |face| face.axis == 1 && !face.high);
    Scene {
        meshes: vec![shape.into_mesh("plane", 0, None)],
        materials: vec![matte("ground", [0.5; 3])],
        cameras: vec![camera("above", Vec3::new(0.0, 4.0, 9.0), Vec3::ZERO, 45.0)],
        ..Scene::default()
    }
}
