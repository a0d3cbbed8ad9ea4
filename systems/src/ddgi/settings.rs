//! What can be set, with the papers' numbers.

use crate::irradiance_probes::{BackFaces, MapSizes, Weights};

/// Settings of the evaluation's DDGI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rays of a probe in a frame. The evaluation measures 32 to 256, the original 64 to 256.
    pub rays: u32,
    /// Share of the old texel that stays in a frame, the `alpha` of Eqs. (1) and (2). The evaluation: close to 1 is stable, 0.9 and
    /// lower flickers; the original: 0.97.
    pub hysteresis: f32,
    /// Power of the cosine in the mean of distances. The original: 50.
    pub distance_power: i32,
    /// Sides of the maps.
    pub sizes: MapSizes,
    /// Weights of a query.
    pub weights: Weights,
    /// How far along its normal a point is moved before its visibility is asked for, in least spacings of the grid.
    pub normal_bias: f32,
    /// What rays make of black backs: they count for distance and are black, unless they are culled.
    pub backs: BackFaces,
    /// Rays are turned at random in every frame.
    pub turns: bool,
    /// How far the outermost probes stand within the bounds, in spacings.
    pub inset: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rays: 128,
            hysteresis: 0.97,
            distance_power: 50,
            sizes: MapSizes::PAPER,
            weights: Weights::default(),
            normal_bias: 0.25,
            backs: BackFaces::Black,
            turns: true,
            inset: 0.5,
        }
    }
}
