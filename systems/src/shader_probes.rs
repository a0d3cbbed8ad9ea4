//! Octahedral irradiance probes on one grid, as a shader shades with them: all that [`System::irradiance`](crate::System::irradiance) of
//! their system reads, and nothing else.

use crate::ProbeGrid;
use crate::irradiance_probes::{MapSizes, ProbeMaps};
use glam::{Vec2, Vec3};

/// Probes of one frame. The weights of the eight around a point are those of [`cage_weights`](crate::irradiance_probes::cage_weights),
/// all of them on; irradiance is `pi (sum w stored^stored_power / sum w)^mean_power`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderProbes {
    /// Where probes stand if nothing moved them.
    pub grid: ProbeGrid,
    /// Where they stand, metres, `[n_probes]` in the order of the grid.
    pub positions: Vec<Vec3>,
    /// Whether a probe counts, `[n_probes]`.
    pub is_lit: Vec<bool>,
    /// Their maps, `[n_probes]`.
    pub maps: Vec<ProbeMaps>,
    /// Sides of the maps.
    pub sizes: MapSizes,
    /// How far along the normal the point lies whose visibility is asked for, metres.
    pub normal_bias_m: f32,
    /// How far toward the eye, metres.
    pub eye_bias_m: f32,
    /// Whether the cage is that of this point too, and not of the surface's.
    pub is_cage_biased: bool,
    /// Exponent from what maps hold to what is blended.
    pub stored_power: f32,
    /// Exponent from what was blended to mean radiance by cosine, W sr^-1 m^-2.
    pub mean_power: f32,
}

impl ShaderProbes {
    /// What the maps of a probe hold, with their borders, row by row: `[(side + 2)^2]` of [`ShaderProbes::sizes`] each.
    pub fn texels(&self, probe: usize) -> (&[Vec3], &[Vec2]) {
        self.maps[probe].texels()
    }
}
