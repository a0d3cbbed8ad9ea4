//! What each probe sees around it: distance, normal and which surface, at high resolution, and the least distance of squares of texels.
//!
//! It stays when light changes. Source: sec. 3; sec. 4.2 for the two levels.

use super::settings::Settings;
use crate::{ProbeGrid, Setup, World, octahedral::OctahedralMap};
use glam::{Vec2, Vec3};
use localprt_scenes::FaceId;
use localprt_surfaces::rays::{FacePoint, SurfaceHit};
use rayon::prelude::*;

/// Maps of all probes, each `side * side` texels, probe after probe.
pub struct Geometry {
    /// Where the probes stand.
    pub grid: ProbeGrid,
    /// Directions of a map's texels.
    pub(super) map: OctahedralMap,
    /// Distance to the first surface, metres; infinite where there is none.
    pub(super) distances: Vec<f32>,
    /// Unit normal of it, on the side of the probe.
    pub(super) normals: Vec<Vec3>,
    /// Where on the scene it is; nowhere for sky and for black backs.
    seen: Vec<Option<Seen>>,
    /// Least distance in squares of `coarse` texels per side: the second level of the min-mip.
    pub(super) least: Vec<f32>,
    /// Diagonal of the scene, metres.
    pub(super) extent_m: f32,
}

/// A point of a face, small.
#[derive(Clone, Copy)]
struct Seen {
    face: u32,
    mesh: u32,
    triangle: u32,
    barycentrics: Vec2,
}

impl Geometry {
    /// Casts a ray per texel from a regular grid inside of the scene's box, half a spacing from its sides.
    pub fn new(world: &World<'_>, setup: &Setup<'_>, settings: &Settings) -> Self {
        assert!(settings.side.is_multiple_of(settings.coarse), "the second level has whole texels");
        let bounds = world.bounds();
        let grid = ProbeGrid::within(bounds, setup.probes, 0.5);
        let map = OctahedralMap { side: settings.side };
        let side = settings.side;
        let hits: Vec<Option<SurfaceHit>> = (0..grid.len() * side)
            .into_par_iter()
            .flat_map_iter(|row| {
                let origin = grid.position(grid.at(row / side));
                (0..side).map(move |x| world.caster().closest_hit(origin, map.dir(x, row % side)))
            })
            .collect();
        let distances: Vec<f32> = hits.iter().map(|hit| hit.map_or(f32::INFINITY, |hit| hit.t)).collect();
        let normals = hits.iter().map(|hit| hit.map_or(Vec3::ZERO, |hit| hit.normal)).collect();
        let seen = hits.iter().map(|hit| hit.and_then(|hit| hit.point).map(Seen::of)).collect();
        let least = least(&distances, side, settings.coarse);
        Self { grid, map, distances, normals, seen, least, extent_m: (bounds.1 - bounds.0).length() }
    }

    /// Texels of one probe.
    pub fn texels(&self) -> usize {
        self.map.side * self.map.side
    }

    /// Unit direction of a texel of a probe.
    pub(super) fn dir(&self, texel: usize) -> Vec3 {
        self.map.dir(texel % self.map.side, texel / self.map.side)
    }

    /// The hit that was stored for a texel of a probe; `None` where it sees the sky.
    pub(super) fn hit(&self, probe: usize, texel: usize) -> Option<SurfaceHit> {
        let at = probe * self.texels() + texel;
        let t = self.distances[at];
        t.is_finite().then(|| SurfaceHit {
            t,
            position: self.grid.position(self.grid.at(probe)) + self.dir(texel) * t,
            normal: self.normals[at],
            point: self.seen[at].map(Seen::point),
        })
    }

    /// Whether a texel sees the black back of a surface.
    pub(super) fn is_back(&self, probe: usize, texel: usize) -> bool {
        let at = probe * self.texels() + texel;
        self.seen[at].is_none() && self.distances[at].is_finite()
    }
}

/// The least of squares of `coarse` texels per side.
fn least(distances: &[f32], side: usize, coarse: usize) -> Vec<f32> {
    let blocks = side / coarse;
    let mut least = vec![f32::INFINITY; distances.len() / (coarse * coarse)];
    for (at, &distance) in distances.iter().enumerate() {
        // Rows of squares follow each other from probe to probe.
        let (x, row) = (at % side / coarse, at / side / coarse);
        let held = &mut least[row * blocks + x];
        *held = held.min(distance);
    }
    least
}

impl Seen {
    fn of(point: FacePoint) -> Self {
        Self {
            face: point.face.0,
            mesh: point.mesh as u32,
            triangle: point.triangle as u32,
            barycentrics: point.barycentrics.truncate(),
        }
    }

    fn point(self) -> FacePoint {
        let [a, b] = self.barycentrics.to_array();
        FacePoint {
            face: FaceId(self.face),
            mesh: self.mesh as usize,
            triangle: self.triangle as usize,
            barycentrics: Vec3::new(a, b, 1.0 - a - b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{furnace, in_world};
    use localprt_scenes::Lighting;

    #[test]
    fn maps_hold_what_rays_from_the_probe_meet() {
        in_world(&furnace(0.5, 1.0), &Lighting::default(), |world| {
            let settings = Settings { side: 32, ..Settings::COMPARED };
            let setup = Setup { probes: 8, cameras: &[], seed: 0 };
            let geometry = Geometry::new(world, &setup, &settings);
            assert_eq!(geometry.grid.position(geometry.grid.at(0)), Vec3::new(1.0, 0.75, 1.25));
            for probe in 0..8 {
                for texel in 0..geometry.texels() {
                    let origin = geometry.grid.position(geometry.grid.at(probe));
                    let met = world.caster().closest_hit(origin, geometry.dir(texel)).expect("a wall");
                    let held = geometry.hit(probe, texel).expect("a wall");
                    assert_eq!((met.t, met.normal), (held.t, held.normal));
                    assert!(!geometry.is_back(probe, texel) && held.position.distance(met.position) < 1e-5);
                    let [met, held] = [met, held].map(|hit| hit.point.expect("a face"));
                    assert_eq!((met.face, met.mesh, met.triangle), (held.face, held.mesh, held.triangle));
                    let (x, y) = (texel % 32 / 16, texel / 32 / 16);
                    let distances = &geometry.distances[probe * 1024..][..1024];
                    let lowest = (0..1024)
                        .filter(|at| (at % 32 / 16, at / 32 / 16) == (x, y))
                        .map(|at| distances[at])
                        .fold(f32::INFINITY, f32::min);
                    assert_eq!(geometry.least[probe * 4 + y * 2 + x], lowest);
                }
            }
        });
    }
}
