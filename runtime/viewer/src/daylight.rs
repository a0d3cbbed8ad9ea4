//! Light for scenes that have none.

use crate::state::BLUE_SKY;
use glam::Vec3;
use localprt_scenes::{Light, LightKind, Lighting, Scene, SurfaceShading};

/// Whether nothing shines.
pub fn is_dark(scene: &Scene, lighting: &Lighting) -> bool {
    let shines = |light: &Light| light.intensity > 0.0 && light.color.max_element() > 0.0;
    !lighting.lights.iter().any(shines)
        && lighting.sky.is_black()
        && !SurfaceShading::new(scene, lighting).any_emission()
}

/// A sun and a blue sky, for scenes without light of their own.
pub fn daylight() -> Lighting {
    let sun = Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        // Steep enough for courtyards.
        direction: Vec3::new(0.25, -1.0, 0.18).normalize(),
        color: Vec3::new(1.0, 0.95, 0.85),
        intensity: 60.0,
        range: None,
    };
    Lighting { lights: vec![sun], sky: BLUE_SKY, ..Lighting::default() }
}
