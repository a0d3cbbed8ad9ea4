//! Scenes for tests, of this crate and of layouts in `localprt-precompute`, which includes this file.

use glam::{Vec2, Vec3};
use localprt_scenes::{Material, Mesh, Scene};

/// A scene of these meshes with one default material.
pub(crate) fn scene(meshes: Vec<Mesh>) -> Scene {
    Scene { name: "test".into(), meshes, materials: vec![Material::default()], ..Scene::default() }
}

/// A parallelogram of `columns` x `rows` quads; its front is along `along.cross(up)` reversed: for `along` = X and
/// `up` = Z it looks up (+Y).
pub(crate) fn plane(name: &str, corner: Vec3, along: Vec3, up: Vec3, columns: u32, rows: u32) -> Mesh {
    let mut mesh = Mesh { name: name.into(), ..Mesh::default() };
    let normal = up.cross(along).normalize();
    for row in 0..=rows {
        for column in 0..=columns {
            let (s, t) = (column as f32 / columns as f32, row as f32 / rows as f32);
            mesh.positions.push(corner + along * s + up * t);
            mesh.normals.push(normal);
        }
    }
    let stride = columns + 1;
    for row in 0..rows {
        for column in 0..columns {
            let a = row * stride + column;
            mesh.triangles.push([a, a + stride, a + stride + 1]);
            mesh.triangles.push([a, a + stride + 1, a + 1]);
        }
    }
    mesh
}

/// A closed box that looks outwards.
pub(crate) fn cuboid(name: &str, low: Vec3, high: Vec3) -> Mesh {
    let d = high - low;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    let sides = [
        plane(name, low, z, x, 1, 1),
        plane(name, low + y, x, z, 1, 1),
        plane(name, low, x, y, 1, 1),
        plane(name, low + z, y, x, 1, 1),
        plane(name, low, y, z, 1, 1),
        plane(name, low + x, z, y, 1, 1),
    ];
    merged(name, &sides)
}

/// The same surface seen from the other side.
pub(crate) fn inward(mut mesh: Mesh) -> Mesh {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    for normal in &mut mesh.normals {
        *normal = -*normal;
    }
    mesh
}

/// A sphere with smooth normals.
pub(crate) fn sphere(name: &str, center: Vec3, radius: f32, rings: u32) -> Mesh {
    let mut mesh = Mesh { name: name.into(), ..Mesh::default() };
    let segments = 2 * rings;
    for ring in 0..=rings {
        let theta = std::f32::consts::PI * ring as f32 / rings as f32;
        for segment in 0..segments {
            let phi = std::f32::consts::TAU * segment as f32 / segments as f32;
            let (sin, cos) = if ring == 0 || ring == rings { (0.0, theta.cos()) } else { theta.sin_cos() };
            let normal = Vec3::new(sin * phi.cos(), cos, sin * phi.sin());
            mesh.positions.push(center + normal * radius);
            mesh.normals.push(normal);
        }
    }
    for ring in 0..rings {
        for segment in 0..segments {
            let next = (segment + 1) % segments;
            let (a, b) = (ring * segments + segment, ring * segments + next);
            let (c, d) = (a + segments, b + segments);
            if ring > 0 {
                mesh.triangles.push([a, b, c]);
            }
            if ring + 1 < rings {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
    mesh
}

/// One mesh of several.
pub(crate) fn merged(name: &str, parts: &[Mesh]) -> Mesh {
    let mut mesh = Mesh { name: name.into(), ..Mesh::default() };
    for part in parts {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(&part.positions);
        mesh.normals.extend(&part.normals);
        mesh.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
    }
    mesh
}

/// Sets TEXCOORD_1 of every vertex.
pub(crate) fn with_uv(mut mesh: Mesh, uv: impl Fn(Vec3) -> Vec2) -> Mesh {
    mesh.uv_sets = vec![Vec::new(), mesh.positions.iter().map(|&position| uv(position)).collect()];
    mesh
}

/// An L-shaped floor of 3 x 1 m and 1 x 3 m arms, and a box of 2 m on it in a room of 6 m that looks inwards.
pub(crate) fn room() -> Scene {
    let floor = merged(
        "floor",
        &[
            plane("", Vec3::new(-3.0, 0.0, -3.0), Vec3::X * 6.0, Vec3::Z * 3.0, 3, 2),
            plane("", Vec3::new(-3.0, 0.0, 0.0), Vec3::X * 3.0, Vec3::Z * 3.0, 2, 2),
            plane("", Vec3::new(0.0, 0.0, 0.0), Vec3::X * 3.0, Vec3::Z * 3.0, 2, 2),
        ],
    );
    let ball = sphere("ball", Vec3::new(1.5, 2.0, 1.5), 0.8, 12);
    let block = cuboid("block", Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 1.5, 1.0));
    let lid = inward(cuboid("walls", Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 4.0, 3.0)));
    // The walls' own bottom would lie on the floor.
    let walls = Mesh { triangles: lid.triangles[2..].to_vec(), ..lid };
    scene(vec![floor, walls, block, ball])
}
