//! What transport rows of a leaf depend on, as digests: what all leaves share, what a leaf has of its own, and what stands in the
//! coarse cells that its rays cross. A leaf for which all three are what they were has the rows that it had.

use super::{Receivers, Sites, TransportScene};
use crate::{
    cells::{CellGrid, CellSet, MARGIN},
    digest::{Digest, Digester},
    output::OutputError,
    scene_digests::digests_of_materials,
};
use glam::{IVec3, Vec2, Vec3};
use localprt_scenes::{FaceId, Scene};
use rayon::prelude::*;
use std::ops::Range;

/// Digest of all that rays may read in each cell of a grid.
pub struct CellContents {
    grid: CellGrid,
    /// `[n_cells]`; zeros of an empty one.
    contents: Vec<[u8; 16]>,
}

impl TransportScene<'_> {
    /// Of what all leaves share.
    pub fn digest(&self) -> Digest {
        let mut digester = Digester::new("transport");
        self.gather.digest(&mut digester);
        digester
            .one(self.probe_basis.len() as u64)
            .one(self.sky_basis.len() as u64)
            .one(self.caster.offset_m())
            .one([u8::from(self.fit.is_some()), u8::from(self.near.is_some())]);
        if let Some(cells) = &self.cells {
            cells.digest(&mut digester);
        }
        if let Some(fit) = self.fit {
            fit.digest(&mut digester);
        }
        if let Some(near) = self.near {
            near.digest(&mut digester);
        }
        digester.finish()
    }

    /// `[n_probes]` of each probe and what it sees.
    ///
    /// # Errors
    /// Those of the scratch that holds what they see.
    pub fn digests_of_probes(&self) -> Result<Vec<Digest>, OutputError> {
        let of_probe = |probe: u32| {
            let mut digester = Digester::new("probe");
            digester.one(self.probes.positions[probe as usize]);
            if let Some(fit) = self.fit {
                fit.digest_of_probe(probe, &mut digester)?;
            }
            Ok(digester.finish())
        };
        (0..self.probes.positions.len() as u32).into_par_iter().map(of_probe).collect()
    }

    /// Takes in a leaf: its receivers and the probes that support them, whose digests are given. Numbers of receivers and probes do
    /// not count, but their order does.
    pub fn digest_of_leaf(&self, members: &[u32], of_probes: &[Digest], digester: &mut Digester) {
        let probes = self.union_of_support(members);
        digester.all(&probes.iter().map(|&probe| of_probes[probe as usize]).collect::<Vec<_>>());
        // The order of their numbers breaks ties.
        let mut order: Vec<u32> = (0..members.len() as u32).collect();
        order.sort_unstable_by_key(|&place| members[place as usize]);
        digester.all(&order);
        for &member in members {
            digester.one(self.receivers.positions()[member as usize]);
            if let Receivers::Surface(receivers) = self.receivers {
                digester.one(receivers.normal[member as usize]).one(receivers.geometric_normal[member as usize]);
            }
            match self.receivers.sites(member as usize) {
                Sites::Surface(points) => {
                    digester.one(points.len() as u64);
                    for point in points {
                        digester.one(point.position).one(point.normal).one(point.geometric_normal);
                    }
                }
                Sites::Open(place) => {
                    digester.one(place);
                }
            }
            let support = self.support.of(member as usize);
            let places = support.iter().map(|probe| probes.partition_point(|other| other < probe) as u32);
            digester.all(&places.collect::<Vec<_>>()).one(self.support.radius_m[member as usize]);
            if let Some(near) = self.near {
                near.digest_of_receiver(member, digester);
            }
        }
    }

    /// Probes that support any of some receivers, rising.
    pub fn union_of_support(&self, members: &[u32]) -> Vec<u32> {
        let mut probes: Vec<u32> =
            members.iter().flat_map(|&member| self.support.of(member as usize)).copied().collect();
        probes.sort_unstable();
        probes.dedup();
        probes
    }
}

impl CellContents {
    /// Of all cells of the scene's grid; `None` if it has none.
    pub fn of(transport: &TransportScene<'_>) -> Option<Self> {
        let grid = transport.cells?;
        let scene = transport.caster.scene();
        let materials = digests_of_materials(scene);
        let faces: Vec<(usize, usize)> = scene.faces().collect();
        let of_face = |(face, &(mesh, triangle)): (usize, &(usize, usize))| {
            let corners = scene.corners(mesh, triangle);
            let whole = digest_of_face(scene, mesh, triangle, &materials);
            cut_by_cells(&grid, corners)
                .into_iter()
                .map(|(cell, part)| {
                    let mut digester = Digester::new("face");
                    digester.one(whole);
                    if let Some(fit) = transport.fit {
                        fit.digest_of_face(FaceId(face as u32), &part, &mut digester);
                    }
                    if let Some(near) = transport.near {
                        near.digest_of_face(FaceId(face as u32), &part, &mut digester);
                    }
                    (cell as u32, face as u32, digester.finish())
                })
                .collect::<Vec<_>>()
        };
        let mut parts: Vec<(u32, u32, Digest)> = faces.par_iter().enumerate().flat_map_iter(of_face).collect();
        parts.par_sort_unstable_by_key(|&(cell, face, _)| (cell, face));
        let mut contents = vec![[0; 16]; grid.n_cells()];
        for of_cell in parts.chunk_by(|a, b| a.0 == b.0) {
            let mut digester = Digester::new("cell");
            of_cell.iter().for_each(|(_, _, digest)| {
                digester.one(*digest);
            });
            contents[of_cell[0].0 as usize].copy_from_slice(&digester.finish()[..16]);
        }
        Some(Self { grid, contents })
    }

    /// The grid.
    pub fn grid(&self) -> CellGrid {
        self.grid
    }

    /// Of what is in some cells.
    pub fn digest(&self, cells: &CellSet) -> Digest {
        let mut digester = Digester::new("cells");
        cells.iter().for_each(|cell| {
            digester.one(cell as u64).one(self.contents[cell]);
        });
        digester.finish()
    }
}

/// Parts of a triangle by the cells that they are in, with a margin: barycentrics of the corners of a convex polygon.
fn cut_by_cells(grid: &CellGrid, corners: [Vec3; 3]) -> Vec<(usize, Vec<Vec3>)> {
    let [a, b, c] = corners;
    let (low, high) = grid.range(a.min(b).min(c), a.max(b).max(c));
    let corners = corners.map(|corner| grid.in_cells(corner));
    let mut parts = Vec::new();
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let cell = IVec3::new(x, y, z);
                let part = clip(corners.map(|corner| corner - cell.as_vec3()));
                if !part.is_empty() {
                    parts.push((grid.number(cell), part));
                }
            }
        }
    }
    parts
}

/// The part of a triangle within the unit cube and the margin around it, as barycentrics of its corners (Sutherland and Hodgman
/// 1974).
fn clip([a, b, c]: [Vec3; 3]) -> Vec<Vec3> {
    let mut part = vec![Vec3::X, Vec3::Y, Vec3::Z];
    let place = |weights: Vec3| a * weights.x + b * weights.y + c * weights.z;
    for axis in 0..3 {
        for (sign, limit) in [(1.0, -MARGIN), (-1.0, 1.0 + MARGIN)] {
            let inside = |weights: Vec3| sign * (place(weights)[axis] - limit);
            let mut kept = Vec::with_capacity(part.len() + 1);
            for (index, &to) in part.iter().enumerate() {
                let from = part[(index + part.len() - 1) % part.len()];
                let (before, after) = (inside(from), inside(to));
                if (before < 0.0) != (after < 0.0) {
                    kept.push(from.lerp(to, before / (before - after)));
                }
                if after >= 0.0 {
                    kept.push(to);
                }
            }
            part = kept;
            if part.is_empty() {
                return part;
            }
        }
    }
    part
}

/// Texels from one to another, both counted, by column and row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Texels {
    low: [u32; 2],
    high: [u32; 2],
}

/// Texels of a map of `size` within `reach` texels of a part of a face, which is given by the barycentrics of its corners. A bilinear
/// lookup reads those within half a texel.
pub(super) fn texels_around(corners: &[Vec2; 3], part: &[Vec3], size: u32, reach: f32) -> Texels {
    let places = part.iter().map(|weights| corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z);
    let (low, high) =
        places.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
    let texel = |place: f32, step: f32| ((place * size as f32 + step).floor().max(0.0) as u32).min(size - 1);
    Texels {
        low: low.to_array().map(|place| texel(place, -reach)),
        high: high.to_array().map(|place| texel(place, reach)),
    }
}

impl Texels {
    /// Those of a coarser level that hold them.
    pub(super) fn above(self, level: u32) -> Self {
        Self { low: self.low.map(|texel| texel >> level), high: self.high.map(|texel| texel >> level) }
    }

    /// Row by row, `y * size + x`.
    pub(super) fn rows(self, size: u32) -> impl Iterator<Item = Range<usize>> {
        let Self { low, high } = self;
        (low[1]..=high[1]).map(move |y| {
            let first = (y * size) as usize;
            first + low[0] as usize..first + high[0] as usize + 1
        })
    }
}

/// Of a face: its corners, its material and the coordinates that this is looked up with.
fn digest_of_face(scene: &Scene, mesh: usize, triangle: usize, materials: &[Digest]) -> Digest {
    let data = &scene.meshes[mesh];
    let mut digester = Digester::new("triangle");
    digester.all(&scene.corners(mesh, triangle)).one(materials[data.material]);
    let corners = data.triangles[triangle].map(|vertex| vertex as usize);
    let uv_set = scene.materials[data.material].base_color_texture.and_then(|texture| data.uv_set(texture.uv_set));
    if let Some(uv) = uv_set {
        digester.all(&corners.map(|corner| uv[corner]));
    }
    if !data.colors.is_empty() {
        digester.all(&corners.map(|corner| data.colors[corner].to_array()));
    }
    digester.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_uniform;

    #[test]
    fn every_point_of_a_triangle_is_in_a_part_of_its_cell_also_far_from_the_origin() {
        for far_m in [0.0, 3000.0] {
            let place = |i: u64, first: u64| {
                let random = |axis| counter_uniform(11, i, first + axis) as f32;
                Vec3::new(random(0) * 8.0, random(1) * 3.0, random(2) * 5.0) + far_m
            };
            let grid = CellGrid::of((Vec3::splat(far_m), Vec3::new(8.0, 3.0, 5.0) + far_m));
            for i in 0..30 {
                let corners = [place(i, 0), place(i, 3), place(i, 6)];
                let parts = cut_by_cells(&grid, corners);
                assert!(parts.iter().all(|(cell, part)| *cell < grid.n_cells() && part.len() >= 3));
                for k in 0..200 {
                    let (u, v) = (counter_uniform(12, i, 2 * k) as f32, counter_uniform(12, i, 2 * k + 1) as f32);
                    let root = u.sqrt();
                    let weights = Vec3::new(1.0 - root, root * (1.0 - v), root * v);
                    let point = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                    let cell = grid.number(grid.in_cells(point).floor().as_ivec3());
                    let (_, part) = parts.iter().find(|(of, _)| *of == cell).expect("the cell has a part");
                    // The box around the part's barycentrics holds the point's, but for rounding far from the origin.
                    let low = part.iter().copied().reduce(Vec3::min).expect("corners");
                    let high = part.iter().copied().reduce(Vec3::max).expect("corners");
                    assert!(weights.cmpge(low - 1e-3).all() && weights.cmple(high + 1e-3).all(), "{weights} {part:?}");
                }
            }
        }
    }

    #[test]
    fn texels_around_a_part_are_those_of_its_lookups_and_a_margin() {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y];
        let whole = texels_around(&corners, &[Vec3::X, Vec3::Y, Vec3::Z], 8, 1.0);
        assert_eq!(whole, Texels { low: [0, 0], high: [7, 7] });
        // A point at (0.5, 0.25): texel (4, 2), and two to each side.
        let point = texels_around(&corners, &[Vec3::new(0.25, 0.5, 0.25)], 8, 2.0);
        assert_eq!(point, Texels { low: [2, 0], high: [6, 4] });
        assert_eq!(point.above(1), Texels { low: [1, 0], high: [3, 2] });
        assert_eq!(point.above(1).rows(4).collect::<Vec<_>>(), [1..4, 5..8, 9..12]);
    }
}
