//! Drops triangles that a bake cannot use, and completes normals and tangents.

use crate::scene::{AlphaMode, DroppedTriangles, Material, Mesh, Scene};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Triangles with less area than this times the squared scene extent are dropped.
const SMALLEST_AREA: f64 = 1e-12;

/// Drops degenerate and duplicate triangles, the vertices only they used and the meshes they empty, then replaces
/// normals and tangents of length zero. Doing it again changes nothing.
pub(super) fn sanitize(scene: &mut Scene) {
    let extent = f64_extent(&scene.meshes);
    let smallest_area = SMALLEST_AREA * extent * extent;
    let mut covered = Covered::default();
    let mut dropped = DroppedTriangles::default();
    for mesh in &mut scene.meshes {
        let material = &scene.materials[mesh.material];
        let before = mesh.triangles.len();
        let (positions, material_index) = (&mesh.positions, mesh.material);
        mesh.triangles.retain(|triangle| {
            let corners = triangle.map(|vertex| positions[vertex as usize]);
            if is_degenerate(corners, smallest_area) {
                dropped.degenerate += 1;
                return false;
            }
            let is_new = covered.add(corners, material_index, material);
            dropped.duplicate += usize::from(!is_new);
            is_new
        });
        if mesh.triangles.len() < before {
            drop_unused_vertices(mesh);
        }
        complete_normals(mesh);
        complete_tangents(mesh);
    }
    scene.meshes.retain(|mesh| !mesh.triangles.is_empty());
    scene.dropped = dropped;
}

/// Diagonal of the box around all triangles; in f64 because an f32 length overflows beyond 1e19.
fn f64_extent(meshes: &[Mesh]) -> f64 {
    let corners = |mesh: &Mesh| -> Option<(Vec3, Vec3)> {
        let mut points = mesh.triangles.iter().flatten().map(|&vertex| mesh.positions[vertex as usize]);
        let first = points.next()?;
        Some(points.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
    };
    let boxes = meshes.iter().filter_map(corners);
    let all = boxes.reduce(|(low, high), (other_low, other_high)| (low.min(other_low), high.max(other_high)));
    all.map_or(0.0, |(low, high)| (high.as_dvec3() - low.as_dvec3()).length())
}

fn is_degenerate([a, b, c]: [Vec3; 3], smallest_area: f64) -> bool {
    // Not (area >= smallest): an area of zero is degenerate even in a scene without extent.
    let area = doubled_area_normal([a, b, c]).length() / 2.0;
    a == b || b == c || c == a || area == 0.0 || area < smallest_area
}

fn doubled_area_normal([a, b, c]: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

/// Which sides of which triples of positions have a surface already.
#[derive(Default)]
struct Covered {
    /// Only looked up, never iterated. The key's material is `None` for surfaces without holes.
    sides: HashMap<([[u32; 3]; 3], Option<usize>), u8>,
}

const FRONT: u8 = 1;
const BACK: u8 = 2;

impl Covered {
    /// Adds a triangle; false if earlier triangles cover all of its sides. A surface with holes covers only others of
    /// its own material, because something else may show through.
    fn add(&mut self, corners: [Vec3; 3], material_index: usize, material: &Material) -> bool {
        // Adding zero turns -0 into 0, which compares equal but has other bits.
        let bits = corners.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
        let mut sorted = bits;
        sorted.sort_unstable();
        let is_even = (0..3).any(|turn| [0, 1, 2].map(|corner| bits[(corner + turn) % 3]) == sorted);
        let own_side = if is_even { FRONT } else { BACK };
        let sides = if material.double_sided { FRONT | BACK } else { own_side };
        let solid = self.sides.get(&(sorted, None)).copied().unwrap_or(0);
        let alike = self.sides.get(&(sorted, Some(material_index))).copied().unwrap_or(0);
        if sides & !(solid | alike) == 0 {
            return false;
        }
        let key = (material.alpha != AlphaMode::Opaque).then_some(material_index);
        *self.sides.entry((sorted, key)).or_default() |= sides;
        true
    }
}

fn drop_unused_vertices(mesh: &mut Mesh) {
    let mut is_used = vec![false; mesh.positions.len()];
    for &vertex in mesh.triangles.iter().flatten() {
        is_used[vertex as usize] = true;
    }
    let mut next = 0;
    let renumbered: Vec<u32> = is_used
        .iter()
        .map(|&used| {
            let number = next;
            next += u32::from(used);
            number
        })
        .collect();
    keep_used(&mut mesh.positions, &is_used);
    keep_used(&mut mesh.normals, &is_used);
    keep_used(&mut mesh.tangents, &is_used);
    keep_used(&mut mesh.colors, &is_used);
    mesh.uv_sets.iter_mut().for_each(|set| keep_used(set, &is_used));
    for vertex in mesh.triangles.iter_mut().flatten() {
        *vertex = renumbered[*vertex as usize];
    }
}

/// Empty lists stay empty.
fn keep_used<T: Copy>(values: &mut Vec<T>, is_used: &[bool]) {
    let mut used = is_used.iter();
    values.retain(|_| used.next().copied().unwrap_or(false));
}

/// Replaces normals of length zero by those of the surrounding triangles, weighted by area.
fn complete_normals(mesh: &mut Mesh) {
    if mesh.normals.iter().all(|&normal| normal != Vec3::ZERO) {
        return;
    }
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    let mut first = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let normal = doubled_area_normal(triangle.map(|vertex| mesh.positions[vertex as usize]));
        for vertex in triangle.map(|vertex| vertex as usize) {
            sums[vertex] += normal;
            if first[vertex] == DVec3::ZERO {
                first[vertex] = normal;
            }
        }
    }
    for (vertex, normal) in mesh.normals.iter_mut().enumerate().filter(|(_, normal)| **normal == Vec3::ZERO) {
        // Where the two sides of a sheet cancel out, one of them is as good as the other.
        let single = first[vertex].normalize_or(DVec3::Y);
        *normal = sums[vertex].try_normalize().unwrap_or(single).as_vec3();
    }
}

/// Replaces tangents of length zero by some direction along the surface.
fn complete_tangents(mesh: &mut Mesh) {
    for (tangent, normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        if tangent.truncate() == Vec3::ZERO {
            *tangent = normal.any_orthonormal_vector().extend(1.0);
        } else {
            tangent.w = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        }
    }
}
