//! The scene's surface as an unwrapper takes it, and its answer as TEXCOORD_1.

use super::{Piece, UnwrapError, Unwrapped};
use glam::{Vec2, Vec3};
use localprt_scenes::{Mesh, Scene};
use localprt_surfaces::atlas::raster::{in_texels, on_map};
use rayon::prelude::*;
use std::collections::HashMap;

/// A face this much lower than long has no area worth a texel: its coordinates could not be told apart.
const NEEDLE: f64 = 1e-6;

/// One piece per mesh, with vertices of equal position and normal welded (texture coordinates do not cut charts), and
/// for each mesh the triangles in its piece; faces without area are left out.
pub(super) fn cut(scene: &Scene) -> Result<(Vec<Piece>, Vec<Vec<u32>>), UnwrapError> {
    let least_altitude = f64::from(scene.extent()) * NEEDLE;
    scene
        .meshes
        .par_iter()
        .map(|mesh| piece(mesh, least_altitude))
        .collect::<Result<Vec<_>, _>>()
        .map(|cut| cut.into_iter().unzip())
}

fn piece(mesh: &Mesh, least_altitude: f64) -> Result<(Piece, Vec<u32>), UnwrapError> {
    if let Some(vertex) = mesh.positions.iter().position(|position| !position.is_finite()) {
        let (mesh, source_path) = (mesh.name.clone(), mesh.source.clone());
        return Err(UnwrapError::NotFinite { mesh, source_path, vertex });
    }
    let mut known: HashMap<[u32; 6], u32> = HashMap::with_capacity(mesh.positions.len());
    let mut positions = Vec::new();
    let welded: Vec<u32> = mesh
        .positions
        .iter()
        .zip(&mesh.normals)
        .map(|(&position, &normal)| {
            *known.entry(key(position, normal)).or_insert_with(|| {
                positions.push(position.to_array());
                positions.len() as u32 - 1
            })
        })
        .collect();
    let has_area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        longest > 0.0 && (b - a).cross(c - a).length() / longest > least_altitude
    };
    let kept: Vec<u32> =
        (0..mesh.triangles.len() as u32).filter(|&face| has_area(&mesh.triangles[face as usize])).collect();
    let triangles =
        kept.iter().map(|&face| mesh.triangles[face as usize].map(|vertex| welded[vertex as usize])).collect();
    Ok((Piece { positions, triangles }, kept))
}

fn key(position: Vec3, normal: Vec3) -> [u32; 6] {
    [position.x, position.y, position.z, normal.x, normal.y, normal.z].map(|value| (value + 0.0).to_bits())
}

/// Writes the layout into a TEXCOORD set, copying vertices that charts share. Faces without area are pinned to one point of
/// a face that they touch.
pub(super) fn apply(mut scene: Scene, unwrapped: &Unwrapped, kept: &[Vec<u32>], texels: u32, set: usize) -> Scene {
    scene.meshes.par_iter_mut().zip(kept).zip(&unwrapped.corners).for_each(|((mesh, kept), corners)| {
        let mut layout: Vec<Option<[Vec2; 3]>> = vec![None; mesh.triangles.len()];
        for (&face, corners) in kept.iter().zip(corners) {
            layout[face as usize] = corners.map(|corners| corners.map(|uv| within(on_map(uv.as_dvec2(), texels))));
        }
        let mut at_position: HashMap<[u32; 3], Vec2> = HashMap::new();
        if layout.iter().any(Option::is_none) {
            for (triangle, corners) in mesh.triangles.iter().zip(&layout) {
                for (vertex, uv) in triangle.iter().zip(corners.iter().flatten()) {
                    at_position.entry(mesh.positions[*vertex as usize].to_array().map(f32::to_bits)).or_insert(*uv);
                }
            }
        }
        let layout: Vec<[Vec2; 3]> = mesh
            .triangles
            .iter()
            .zip(layout)
            .map(|(triangle, corners)| {
                corners.unwrap_or_else(|| {
                    let pin = triangle.iter().find_map(|&vertex| {
                        at_position.get(&mesh.positions[vertex as usize].to_array().map(f32::to_bits))
                    });
                    [pin.copied().unwrap_or_default(); 3]
                })
            })
            .collect();
        split_vertices(mesh, &layout, set);
    });
    scene
}

fn within(uv: Vec2) -> Vec2 {
    uv.clamp(Vec2::ZERO, Vec2::ONE)
}

/// The scene with coordinates of a set that were made for a map of another size.
pub fn on_another_map(mut mesh: Mesh, set: usize, [from, to]: [u32; 2]) -> Mesh {
    if let Some(uv) = mesh.uv_sets.get_mut(set).filter(|_| from != to) {
        uv.iter_mut().for_each(|uv| *uv = within(on_map(in_texels(*uv, from), to)));
    }
    mesh
}

/// Replaces vertices by one per (vertex, coordinate), in order of first use.
fn split_vertices(mesh: &mut Mesh, layout: &[[Vec2; 3]], set: usize) {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let (mut from, mut uv) = (Vec::new(), Vec::new());
    for (triangle, corners) in mesh.triangles.iter_mut().zip(layout) {
        for (vertex, &corner) in triangle.iter_mut().zip(corners) {
            *vertex = *known.entry([*vertex, corner.x.to_bits(), corner.y.to_bits()]).or_insert_with(|| {
                from.push(*vertex);
                uv.push(corner);
                from.len() as u32 - 1
            });
        }
    }
    fn taken<T: Copy>(values: &mut Vec<T>, from: &[u32]) {
        if !values.is_empty() {
            *values = from.iter().map(|&vertex| values[vertex as usize]).collect();
        }
    }
    taken(&mut mesh.positions, &from);
    taken(&mut mesh.normals, &from);
    taken(&mut mesh.tangents, &from);
    taken(&mut mesh.colors, &from);
    for set in &mut mesh.uv_sets {
        taken(set, &from);
    }
    if mesh.uv_sets.len() <= set {
        mesh.uv_sets.resize(set + 1, Vec::new());
    }
    mesh.uv_sets[set] = uv;
}
