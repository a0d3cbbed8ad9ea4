//! Small scenes for the tests of voxels and probes.

use glam::Vec3;
use localprt_scenes::{Material, Mesh, Scene};

/// A scene of one mesh per list of triangles, one-sided unless asked otherwise.
pub(crate) fn scene(parts: &[Vec<[Vec3; 3]>], double_sided: bool) -> Scene {
    let meshes = parts
        .iter()
        .map(|triangles| {
            let normal = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).normalize();
            Mesh {
                name: "part".into(),
                positions: triangles.iter().flatten().copied().collect(),
                normals: triangles.iter().flat_map(|triangle| [normal(triangle); 3]).collect(),
                triangles: (0..triangles.len() as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect(),
                ..Default::default()
            }
        })
        .collect();
    Scene {
        name: "test".into(),
        meshes,
        materials: vec![Material { double_sided, ..Default::default() }],
        ..Default::default()
    }
}

/// A rectangle at `corner` spanned by two edges; its front looks along `u x v`.
pub(crate) fn rectangle(corner: Vec3, u: Vec3, v: Vec3) -> Vec<[Vec3; 3]> {
    vec![[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]
}

/// A box whose fronts look outward: a solid block.
pub(crate) fn block(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
    let size = high - low;
    let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z);
    [
        rectangle(low, y, x),
        rectangle(low, z, y),
        rectangle(low, x, z),
        rectangle(high, -x, -y),
        rectangle(high, -y, -z),
        rectangle(high, -z, -x),
    ]
    .concat()
}

/// A box whose fronts look inward: a closed room.
pub(crate) fn room(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
    flipped(&block(low, high))
}

/// The same triangles with their fronts on the other side.
pub(crate) fn flipped(triangles: &[[Vec3; 3]]) -> Vec<[Vec3; 3]> {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// A sphere with fronts outward, from an octahedron split `level` times: 8 x 4^level triangles.
pub(crate) fn sphere(center: Vec3, radius: f32, level: u32) -> Vec<[Vec3; 3]> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut triangles: Vec<[Vec3; 3]> = (0..8)
        .map(|octant| {
            let [x, y, z] = [0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -axes[axis] } else { axes[axis] });
            if (octant as u32).count_ones().is_multiple_of(2) { [x, y, z] } else { [x, z, y] }
        })
        .collect();
    for _ in 0..level {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(Vec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    triangles.iter().map(|triangle| triangle.map(|point| center + radius * point)).collect()
}

/// Two arms of a corridor in an L, 1 m wide and high: `length` metres along +X and along +Z. Fronts inward.
pub(crate) fn corridor(length: f32) -> Vec<[Vec3; 3]> {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let long = length - 1.0;
    [
        // Floor and ceiling: the corner, the arm along X, the arm along Z.
        rectangle(Vec3::ZERO, z, x),
        rectangle(x, z, x * long),
        rectangle(z, z * long, x),
        rectangle(y, x, z),
        rectangle(y + x, x * long, z),
        rectangle(y + z, x, z * long),
        // Outer walls, inner walls, ends.
        rectangle(Vec3::ZERO, x * length, y),
        rectangle(Vec3::ZERO, y, z * length),
        rectangle(z + x, y, x * long),
        rectangle(x + z, z * long, y),
        rectangle(x * length, y, z).iter().map(|&[a, b, c]| [a, c, b]).collect(),
        rectangle(z * length, y, x),
    ]
    .concat()
}

/// The corridor of 12 m with blocks standing out of alternate walls, so that one sees few metres ahead.
pub(crate) fn labyrinth() -> Scene {
    let mut parts = vec![corridor(12.0)];
    for step in 0..9 {
        let (ahead, side) = (1.5 + 1.1 * step as f32, 0.35 * (step % 2) as f32);
        let (low, high) = (Vec3::new(ahead, 0.0, side), Vec3::new(ahead + 0.2, 1.0, side + 0.65));
        parts.push(block(low, high));
        parts.push(block(Vec3::new(low.z, low.y, low.x), Vec3::new(high.z, high.y, high.x)));
    }
    scene(&parts, false)
}

/// Points spread over the front of all triangles, about `count`, with normals; positions just off the surface.
pub(crate) fn surface_points(scene: &Scene, count: usize) -> (Vec<Vec3>, Vec<Vec3>) {
    let offset = scene.extent() * 1e-5;
    let triangles: Vec<[Vec3; 3]> = scene.faces().map(|(mesh, triangle)| scene.corners(mesh, triangle)).collect();
    let area = |[a, b, c]: &[Vec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
    let total: f32 = triangles.iter().map(area).sum();
    let mut points = (Vec::new(), Vec::new());
    for triangle in &triangles {
        let [a, b, c] = *triangle;
        let normal = (b - a).cross(c - a).normalize();
        // Rows of points: n^2 small triangles.
        let n = (count as f32 * area(triangle) / total).sqrt().ceil().max(1.0) as u32;
        for row in 0..n {
            for column in 0..n - row {
                let (u, v) = ((row as f32 + 0.33) / n as f32, (column as f32 + 0.33) / n as f32);
                points.0.push(a + (b - a) * u + (c - a) * v + normal * offset);
                points.1.push(normal);
            }
        }
    }
    points
}
