//! Faces are cut so that charts can end where they have to: between very different densities, and where another surface stands
//! on them.
//!
//! Whoever shares a cut edge is cut at the same point, over all meshes: the surface that is drawn has no T-junctions where it had
//! none. `docs/edges.md` has method, figures and limits.

mod by_scale;
mod by_surfaces;
mod crossings;
mod split;
#[cfg(test)]
mod tests;

pub use by_scale::by_scale;
pub use by_surfaces::by_surfaces;

use glam::Vec3;
use localprt_scenes::Mesh;
use std::collections::HashSet;

/// An edge by the places of its ends, lower first.
pub type EdgeKey = [[u32; 3]; 2];

/// Edges of each mesh on whose two sides surfaces do not go on into each other, as another surface stands on them: charts
/// end there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Walls {
    /// `[meshes]`; empty without any.
    edges: Vec<HashSet<EdgeKey>>,
}

impl Walls {
    /// Nothing stands on anything.
    pub const NONE: Self = Self { edges: Vec::new() };

    /// Whether something stands on that edge of a mesh.
    pub fn stand_on(&self, mesh: usize, ends: [Vec3; 2]) -> bool {
        self.edges.get(mesh).is_some_and(|edges| !edges.is_empty() && edges.contains(&key(ends)))
    }

    /// Those of some of the meshes, in their order.
    pub fn of_meshes(self, is_one: &[bool]) -> Self {
        let of_one = self.edges.into_iter().zip(is_one).filter(|(_, is_one)| **is_one);
        Self { edges: of_one.map(|(edges, _)| edges).collect() }
    }

    /// Number of such edges.
    pub fn len(&self) -> usize {
        self.edges.iter().map(HashSet::len).sum()
    }

    /// True without any.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An edge by its ends.
fn key(ends: [Vec3; 2]) -> EdgeKey {
    let [a, b] = ends.map(place);
    if a <= b { [a, b] } else { [b, a] }
}

fn place(position: Vec3) -> [u32; 3] {
    position.to_array().map(|value| (value + 0.0).to_bits())
}

/// Corners by their places: the same for both sides of a triangle, so that both are cut into the same parts.
fn sorted(mut corners: [Vec3; 3]) -> [Vec3; 3] {
    corners.sort_by_key(|&corner| place(corner));
    corners
}

/// Adds a vertex to a mesh at these weights of three others, and its number. Sums do not depend on the order of two: meshes that
/// share an edge get the same place.
fn add_vertex(mesh: &mut Mesh, corners: [u32; 3], weights: Vec3) -> u32 {
    let [a, b, c] = corners.map(|corner| corner as usize);
    let vertex = mesh.positions.len() as u32;
    let of = |values: &[Vec3]| values[a] * weights.x + values[b] * weights.y + values[c] * weights.z;
    mesh.positions.push(of(&mesh.positions));
    if !mesh.normals.is_empty() {
        mesh.normals.push(of(&mesh.normals).normalize_or(mesh.normals[a]));
    }
    if !mesh.tangents.is_empty() {
        let along = [a, b, c].map(|corner| mesh.tangents[corner].truncate());
        let along = along[0] * weights.x + along[1] * weights.y + along[2] * weights.z;
        let first = mesh.tangents[a];
        mesh.tangents.push(along.normalize_or(first.truncate()).extend(first.w));
    }
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.push(set[a] * weights.x + set[b] * weights.y + set[c] * weights.z);
    }
    if !mesh.colors.is_empty() {
        mesh.colors.push(mesh.colors[a] * weights.x + mesh.colors[b] * weights.y + mesh.colors[c] * weights.z);
    }
    vertex
}
