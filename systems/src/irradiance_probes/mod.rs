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
use crate::probe_grid::Cage;
use glam::{UVec3, Vec3};
use localprt_scenes::SurfacePoint;

/// Distances beyond so many diagonals of a cell count as that far: the probe is not asked about points out there.
///
/// Source: the code of Majercik et al. 2019.
const FAR_DIAGONALS: f32 = 1.5;

/// Weights of the probes of a cage for a surface point, with their places in the list of probes; not normalized. `tested` is the point
/// whose visibility is asked for; `probe` gives place, position and maps of a probe of the grid, or nothing if it does not count.
pub fn cage_weights<'a>(
    weights: Weights,
    cage: Cage,
    point: &SurfacePoint,
    tested: Vec3,
    probe: impl Fn(UVec3) -> Option<(usize, Vec3, &'a ProbeMaps)>,
) -> impl Iterator<Item = (usize, f32)> {
    let surface = (point.position, point.normal);
    cage.probes().into_iter().filter_map(move |(at, trilinear)| {
        let (place, position, maps) = probe(at)?;
        let weight = weights.of_probe(position, surface, tested, |from_probe| maps.moments(from_probe), trilinear);
        (weight > 0.0).then_some((place, weight))
    })
}

/// The distance beyond which a probe of the grid does not look, metres.
pub fn far_m(grid: &ProbeGrid) -> f32 {
    FAR_DIAGONALS * grid.spacing.length()
}
