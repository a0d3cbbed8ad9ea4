//! Objects that move: spheres and boxes with a color of their own. What lights them is in `object_light.rs`.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use localprt_runtime::ShadowCasters;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Shape of a [`MovingObject`] in its own axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectShape {
    /// Radius 1 about the origin.
    Sphere,
    /// From -1 to 1 along every axis.
    Box,
}

/// An object that is not part of the bake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingObject {
    /// Shape.
    pub shape: ObjectShape,
    /// From its own axes to the world's.
    pub to_world: Mat4,
    /// Diffuse albedo, 0..=1.
    pub albedo: Vec3,
    /// Emitted radiance, W sr^-1 m^-2.
    pub emission: Vec3,
}

/// `Object` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct ObjectRecord {
    to_world: [[f32; 4]; 4],
    albedo: [f32; 4],
    emission: [f32; 4],
}

impl From<&MovingObject> for ObjectRecord {
    fn from(object: &MovingObject) -> Self {
        let padded = |color: Vec3| color.extend(0.0).to_array();
        Self {
            to_world: object.to_world.to_cols_array_2d(),
            albedo: padded(object.albedo.clamp(Vec3::ZERO, Vec3::ONE)),
            emission: padded(object.emission),
        }
    }
}

/// Segments around a sphere, and half as many from pole to pole.
const SEGMENTS: u32 = 48;

pub(crate) struct Shape {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Of a shape in its own axes.
pub(crate) fn geometry(shape: ObjectShape) -> Shape {
    match shape {
        ObjectShape::Sphere => sphere(SEGMENTS),
        ObjectShape::Box => cube(),
    }
}

/// Of radius 1, with an even number of segments around it and half as many from pole to pole.
pub(crate) fn sphere(segments: u32) -> Shape {
    let rings = segments / 2;
    let point = |index: u32| {
        let (ring, segment) = (index / (segments + 1), index % (segments + 1));
        let polar = ring as f32 / rings as f32 * std::f32::consts::PI;
        let azimuth = segment as f32 / segments as f32 * std::f32::consts::TAU;
        Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), polar.sin() * azimuth.cos())
    };
    let positions: Vec<Vec3> = (0..(rings + 1) * (segments + 1)).map(point).collect();
    let cell = |index: u32| {
        let a = index / segments * (segments + 1) + index % segments;
        let below = a + segments + 1;
        [[a, below, below + 1], [a, below + 1, a + 1]]
    };
    Shape { normals: positions.clone(), positions, triangles: (0..rings * segments).flat_map(cell).collect() }
}

fn cube() -> Shape {
    let faces = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let corners = |normal: Vec3| {
        let right = Vec3::new(normal.y, normal.z, normal.x);
        let up = normal.cross(right);
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| normal + x * right + y * up)
    };
    Shape {
        positions: faces.into_iter().flat_map(corners).collect(),
        normals: faces.into_iter().flat_map(|normal| [normal; 4]).collect(),
        triangles: (0..6).map(|face| 4 * face).flat_map(|a| [[a, a + 1, a + 2], [a, a + 2, a + 3]]).collect(),
    }
}

/// What objects cast shadows with: for [`Relighter::set_moving_casters`](localprt_runtime::Relighter::set_moving_casters).
pub fn moving_casters(objects: &[MovingObject]) -> ShadowCasters {
    let mut casters = ShadowCasters::default();
    for object in objects {
        let first = casters.positions.len() as u32;
        let shape = geometry(object.shape);
        casters.positions.extend(shape.positions.iter().map(|&point| object.to_world.transform_point3(point)));
        casters.triangles.extend(shape.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
    }
    casters
}

/// Vertices (position, normal) and indices of both shapes.
pub(crate) struct ObjectGeometry {
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    sphere: std::ops::Range<u32>,
    cube: std::ops::Range<u32>,
    cube_base: i32,
}

impl ObjectGeometry {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let (sphere, cube) = (sphere(SEGMENTS), cube());
        let vertices: Vec<[Vec3; 2]> = [&sphere, &cube]
            .into_iter()
            .flat_map(|shape| shape.positions.iter().zip(&shape.normals).map(|(&position, &normal)| [position, normal]))
            .collect();
        let indices: Vec<[u32; 3]> = sphere.triangles.iter().chain(&cube.triangles).copied().collect();
        let filled = |label, contents, usage| {
            device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let n_sphere = 3 * sphere.triangles.len() as u32;
        Self {
            vertices: filled("viewer.object_vertices", bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
            indices: filled("viewer.object_indices", bytemuck::cast_slice(&indices), wgpu::BufferUsages::INDEX),
            sphere: 0..n_sphere,
            cube: n_sphere..3 * indices.len() as u32,
            cube_base: sphere.positions.len() as i32,
        }
    }

    /// Indices and base vertex.
    pub(crate) fn range(&self, shape: ObjectShape) -> (std::ops::Range<u32>, i32) {
        match shape {
            ObjectShape::Sphere => (self.sphere.clone(), 0),
            ObjectShape::Box => (self.cube.clone(), self.cube_base),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_closed_and_face_outwards() {
        for (kind, volume) in [(ObjectShape::Sphere, 4.0 / 3.0 * std::f32::consts::PI), (ObjectShape::Box, 8.0)] {
            let shape = geometry(kind);
            let corners = |triangle: &[u32; 3]| triangle.map(|vertex| shape.positions[vertex as usize]);
            let sixths: f32 = shape.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c))).sum();
            // A sphere of flat facets is about one per cent smaller.
            assert!((0.98..=1.001).contains(&(sixths / 6.0 / volume)), "{kind:?}: {}", sixths / 6.0);
            for triangle in &shape.triangles {
                // Triangles at the poles have no area but rounding's.
                let [a, b, c] = corners(triangle);
                let normal = (b - a).cross(c - a);
                assert!(triangle.iter().all(|&vertex| shape.normals[vertex as usize].dot(normal) >= -1e-6));
            }
        }
    }

    #[test]
    fn casters_are_where_the_object_is() {
        let object = MovingObject {
            shape: ObjectShape::Sphere,
            to_world: Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0)) * Mat4::from_scale(Vec3::splat(0.5)),
            albedo: Vec3::ZERO,
            emission: Vec3::ZERO,
        };
        let casters = moving_casters(&[object, object]);
        assert_eq!(casters.check(), Ok(()));
        let bounds = casters.bounds();
        assert!(bounds.low.abs_diff_eq(Vec3::new(0.5, 1.5, 2.5), 1e-5), "{bounds:?}");
        assert!(bounds.high.abs_diff_eq(Vec3::new(1.5, 2.5, 3.5), 1e-5), "{bounds:?}");
    }
}
