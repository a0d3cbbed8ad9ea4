//! The light of one frame as a shader shades with it: all that [`System::irradiance`](crate::System::irradiance) of a system reads, and
//! nothing else.

use crate::ProbeGrid;
use crate::irradiance_probes::MapSizes;
use glam::{Vec2, Vec3};

/// What irradiance at a point is made of.
#[derive(Clone, Debug, PartialEq)]
pub enum ShaderLight {
    /// Octahedral irradiance and moments of distance of the eight probes around it.
    Octahedral(ShaderProbes),
    /// Spherical harmonics of nested grids.
    Harmonics(ShaderHarmonics),
}

/// Octahedral irradiance probes on one grid: irradiance is `pi (sum w stored^stored_power / sum w)^mean_power`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderProbes {
    /// Where probes stand if nothing moved them.
    pub grid: ProbeGrid,
    /// Where they stand, metres, `[n_probes]` in the order of the grid.
    pub positions: Vec<Vec3>,
    /// Whether a probe counts, `[n_probes]`.
    pub is_lit: Vec<bool>,
    /// What is blended, `[n_probes][(side + 2)^2]`, maps with their borders, row by row.
    pub irradiance: Vec<Vec3>,
    /// Mean distance and mean squared distance, m and m^2, in the same order.
    pub moments: Vec<Vec2>,
    /// Sides of the maps.
    pub sizes: MapSizes,
    /// The weights of the eight probes.
    pub weighting: Weighting,
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

/// How the eight probes around a point count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// By [`cage_weights`](crate::irradiance_probes::cage_weights), all of them on: those of DDGI.
    Wrapped,
    /// By the clamped cosine and Chebyshev, with the least weights of [`light_field::prefilter`](crate::light_field::prefilter).
    Facing,
}

/// Probes of [`ssgi_probes`](crate::ssgi_probes), read as [`Cascades::around`](crate::ssgi_probes::cascades::Cascades::around) does.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderHarmonics {
    /// Nested grids of as many probes each, finest first.
    pub grids: Vec<ProbeGrid>,
    /// SH radiance of three bands, W sr^-1 m^-2, `[n_grids][n_probes]`.
    pub coefficients: Vec<[Vec3; 9]>,
}

impl ShaderLight {
    /// Values of four numbers that a shader reads: positions, texels, grids, coefficients.
    pub fn len(&self) -> usize {
        match self {
            Self::Octahedral(probes) => probes.positions.len() + probes.irradiance.len() + probes.moments.len(),
            Self::Harmonics(probes) => 2 * probes.grids.len() + 9 * probes.coefficients.len(),
        }
    }

    /// True without any; there are always some.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
