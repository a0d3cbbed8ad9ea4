//! Vertices of a scene as one buffer, and one draw per mesh.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec4};
use localprt_scenes::{Mesh, Scene, TextureRef};
use std::ops::Range;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// A vertex with the coordinates of each texture of its material, transforms applied.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    /// Zero where the scene has none.
    tangent: [f32; 4],
    base_uv: [f32; 2],
    emission_uv: [f32; 2],
    normal_uv: [f32; 2],
    lightmap_uv: [f32; 2],
    color: [f32; 4],
}

/// Attributes of [`Vertex`] in its order.
pub(crate) const ATTRIBUTES: [wgpu::VertexAttribute; 8] = wgpu::vertex_attr_array![
    0 => Float32x3, 1 => Float32x3, 2 => Float32x4, 3 => Float32x2, 4 => Float32x2, 5 => Float32x2, 6 => Float32x2,
    7 => Float32x4
];
pub(crate) const STRIDE: u64 = size_of::<Vertex>() as u64;

/// Lightmap coordinate of meshes without.
const NOWHERE: Vec2 = Vec2::splat(-1.0);

pub(crate) struct Geometry {
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    /// Indices and material of each mesh, by material.
    pub(crate) draws: Vec<(Range<u32>, usize)>,
}

impl Geometry {
    pub(crate) fn new(device: &wgpu::Device, scene: &Scene) -> Self {
        let mut order: Vec<&Mesh> = scene.meshes.iter().filter(|mesh| !mesh.triangles.is_empty()).collect();
        order.sort_by_key(|mesh| mesh.material);
        let (mut vertices, mut indices, mut draws) = (Vec::new(), Vec::new(), Vec::<(Range<u32>, usize)>::new());
        for mesh in order {
            let (first_vertex, first_index) = (vertices.len() as u32, indices.len() as u32);
            push_vertices(scene, mesh, &mut vertices);
            indices.extend(mesh.triangles.iter().flatten().map(|vertex| first_vertex + vertex));
            let end = indices.len() as u32;
            match draws.last_mut() {
                Some((range, material)) if *material == mesh.material => range.end = end,
                _ => draws.push((first_index..end, mesh.material)),
            }
        }
        let filled = |label, contents: &[u8], usage| {
            let contents = if contents.is_empty() { &[0; 16] } else { contents };
            device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        Self {
            vertices: filled("viewer.vertices", bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
            indices: filled("viewer.indices", bytemuck::cast_slice(&indices), wgpu::BufferUsages::INDEX),
            draws,
        }
    }
}

fn push_vertices(scene: &Scene, mesh: &Mesh, vertices: &mut Vec<Vertex>) {
    let material = &scene.materials[mesh.material];
    let uv = |reference: Option<TextureRef>, vertex: usize| {
        let Some(reference) = reference else { return Vec2::ZERO };
        match mesh.uv_sets.get(reference.uv_set).filter(|set| !set.is_empty()) {
            Some(set) => reference.transform.transform_point2(set[vertex]),
            None => reference.transform.translation,
        }
    };
    let lightmap = mesh.lightmap_uv();
    vertices.extend((0..mesh.positions.len()).map(|vertex| Vertex {
        position: mesh.positions[vertex].to_array(),
        normal: mesh.normals[vertex].to_array(),
        tangent: mesh.tangents.get(vertex).copied().unwrap_or(Vec4::ZERO).to_array(),
        base_uv: uv(material.base_color_texture, vertex).to_array(),
        emission_uv: uv(material.emission_texture, vertex).to_array(),
        normal_uv: uv(material.normal_texture, vertex).to_array(),
        lightmap_uv: lightmap.map_or(NOWHERE, |set| set[vertex]).to_array(),
        color: mesh.colors.get(vertex).copied().unwrap_or(Vec4::ONE).to_array(),
    }));
}
