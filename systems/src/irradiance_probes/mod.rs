//! What the systems of octahedral irradiance probes share: where probes stand, a probe's rays and their shading, its two maps, and the
//! weights of the eight probes around a point.
//!
//! When a probe is updated, how its maps follow, and how what they hold is read, is left to the systems.
//!
//! | file | holds |
//! |---|---|
//! | `rays` | turned Fibonacci directions, what a probe's rays meet, the light that they bring back |
//! | `maps` | irradiance and distance moments of one probe, their means and reads |
//! | `weights` | wrap, Chebyshev, crush, trilinear |
//!
//! Source: Majercik et al. 2019, Dynamic Diffuse Global Illumination with Ray-Traced Irradiance Fields.

mod maps;
mod rays;
#[cfg(test)]
pub(crate) mod test_scenes;
mod weights;

pub use maps::{MapSizes, ProbeMaps};
pub use rays::{BackFaces, ProbeRay, ProbeRays, first_hit, turned_directions};
pub use weights::{Weights, chebyshev, crush, wrap};

use crate::ProbeGrid;
use glam::Vec3;

/// Distances beyond so many diagonals of a cell count as that far: the probe is not asked about points out there.
///
/// Source: the code of Majercik et al. 2019.
const FAR_DIAGONALS: f32 = 1.5;

/// A grid of not more than so many probes (but 8) whose outermost stand `inset` spacings within a box. With 0 they stand on its faces.
pub fn grid_within((low, high): (Vec3, Vec3), probes: usize, inset: f32) -> ProbeGrid {
    let on_faces = ProbeGrid::over((low, high), probes);
    let steps = (on_faces.size - 1).as_vec3();
    let spacing = on_faces.spacing * steps / (steps + 2.0 * inset);
    ProbeGrid { low: low + spacing * inset, spacing, size: on_faces.size }
}

/// The distance beyond which a probe of the grid does not look, metres.
pub fn far_m(grid: &ProbeGrid) -> f32 {
    FAR_DIAGONALS * grid.spacing.length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_probe_of_an_inset_grid_stands_for_an_equal_cell() {
        let (low, high) = (Vec3::new(-1.0, 0.0, 2.0), Vec3::new(7.0, 3.0, 6.0));
        for inset in [0.0, 0.5] {
            let grid = grid_within((low, high), 300, inset);
            assert!(grid.len() <= 300);
            // A few roundings of coordinates up to 7.
            assert!((grid.low - low - grid.spacing * inset).length() < 1e-5);
            assert!((high - grid.position(grid.size - 1) - grid.spacing * inset).length() < 1e-5);
        }
    }
}
