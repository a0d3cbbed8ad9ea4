//! What shines: punctual lights, sky, material overrides.
//!
//! A [`Lighting`] comes from a JSON file ([`Lighting::load_for`]) or from the scene's own lights
//! ([`Lighting::of_scene`]). It is evaluated at points ([`Light::incident`]), in directions ([`Sky::radiance`]) and on
//! surfaces ([`SurfaceShading`]). Visibility and everything that bounces is left to the callers.

mod equirect;
mod error;

mod json;
mod json_out;
mod place;
mod shading;
mod sky;

pub use error::LightingError;
pub(crate) use json::near_names;
pub use shading::SurfaceShading;

use crate::light::Light;
use glam::Vec3;
use std::collections::BTreeMap;

/// One lighting state. Colors are linear Rec. 709.
#[derive(Clone, Debug, Default)]
pub struct Lighting {
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// Radiance arriving where rays leave the scene.
    pub sky: Sky,
    /// Overrides by material name; each replaces factor and texture.
    pub materials: BTreeMap<String, MaterialOverride>,
    /// One albedo for every surface, to look at lighting only.
    pub albedo_override: Option<f32>,
}

/// Radiance from outside of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Sky {
    /// No light.
    #[default]
    Black,
    /// The same radiance from everywhere.
    Constant(Vec3),
    /// mix(horizon, zenith, y) for y >= 0 and mix(horizon, ground, -y) below.
    Gradient {
        /// At y = 1.
        zenith: Vec3,
        /// At y = 0.
        horizon: Vec3,
        /// At y = -1.
        ground: Vec3,
    },
    /// A latitude-longitude image, +Y up, u = atan2(x, -z) / 2 pi growing to the right, v = 0 at the top.
    Equirect {
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// `width * height` linear radiances, top row first.
        pixels: Vec<Vec3>,
        /// Factor on all pixels.
        scale: f32,
        /// Degrees about +Y by the right-hand rule: positive turns the picture counter-clockwise seen from above.
        rotation: f32,
    },
}

/// Replaces a material's albedo or emission, factor and texture alike.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaterialOverride {
    /// New albedo.
    pub albedo: Option<Vec3>,
    /// New emitted radiance.
    pub emission: Option<Vec3>,
}
