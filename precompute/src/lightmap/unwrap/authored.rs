//! Whether the scene's own TEXCOORD_1 can hold a lightmap.

use super::{Footprint, LayoutSize, MAX_SIZE, MIN_SIZE, UnwrapError, area_m2, check_size};
use crate::lightmap::{Atlas, texels};
use glam::{DVec2, Vec2};
use localprt_scenes::Scene;
use rayon::prelude::*;

/// Coordinates may leave 0..=1 by this: exporters round.
const BORDER: f32 = 1e-5;
/// Faces whose share of the map is below this times their share of the surface have no usable coordinates...
const STARVED: f64 = 1e-3;
/// ...and may make up this share of the surface.
const MOST_STARVED: f64 = 0.01;
/// A texel center counts as covered when it is this deep inside a face, texels: neighbors share their border.
const DEPTH: f64 = 1e-3;
/// Map sizes that are tried for a number of texels.
const SIZES: usize = 3;
/// Rows that one task looks at.
const BAND: u32 = 32;

/// Whether TEXCOORD_1 gives every receiver a texel of its own at this size: every mesh has it, within 0..=1, no texel
/// center is covered by two faces (but neighbors in a chart), and hardly any surface is left without texels.
/// `Ok(Ok(texels))` is the size of the receiver map to use it at, `Ok(Err(reason))` says why it cannot be used.
///
/// Front and back of a double-sided face share their texel in such a layout.
///
/// # Errors
/// Map sizes out of range.
pub fn usable_layout(scene: &Scene, size: LayoutSize) -> Result<Result<u32, String>, UnwrapError> {
    check_size(size)?;
    for mesh in &scene.meshes {
        let at = || format!("mesh {} ({})", mesh.name, mesh.source);
        let Some(uv) = mesh.lightmap_uv() else {
            return Ok(Err(format!("{} has no TEXCOORD_1", at())));
        };
        let outside = |uv: &Vec2| !(uv.min_element() >= -BORDER && uv.max_element() <= 1.0 + BORDER);
        if mesh.triangles.iter().flatten().any(|&vertex| uv.get(vertex as usize).is_none_or(outside)) {
            return Ok(Err(format!("TEXCOORD_1 of {} leaves 0..1", at())));
        }
    }
    let atlas = Atlas::of(scene);
    let surface_m2 = area_m2(scene);
    let on_map: f64 = atlas.corners.iter().filter_map(|&uv| Footprint::new(uv, 1)).map(|face| face.area()).sum();
    let has_texels = atlas.faces_with_texels();
    let starved: f64 = scene
        .faces()
        .enumerate()
        .map(|(face, (mesh, triangle))| {
            let area = scene.area_m2(mesh, triangle);
            let held = Footprint::new(atlas.corners[face], 1).map_or(0.0, |face| face.area());
            // A face in one point of a chart shares its texels.
            let shares = held == 0.0 && has_texels[face];
            if !shares && held * surface_m2 < STARVED * on_map * area { area } else { 0.0 }
        })
        .sum();
    if on_map <= 0.0 && surface_m2 > 0.0 || starved > MOST_STARVED * surface_m2 {
        let share = if surface_m2 > 0.0 { 100.0 * starved / surface_m2 } else { 0.0 };
        return Ok(Err(format!("TEXCOORD_1 has no area for {share:.1} % of the surface")));
    }
    let texels = size.lightmap.unwrap_or_else(|| map_size(scene, &atlas, size, surface_m2, on_map));
    Ok(match overlap(scene, &atlas, texels) {
        None => Ok(texels),
        Some((first, second)) => {
            let names: Vec<&str> = scene
                .faces()
                .enumerate()
                .filter(|(face, _)| [first, second].contains(&(*face as u32)))
                .map(|(_, (mesh, _))| scene.meshes[mesh].name.as_str())
                .collect();
            let names = names.join(" and ");
            Err(format!("TEXCOORD_1 overlaps at {texels} texels per side (faces {first} and {second}: {names})"))
        }
    })
}

/// Texels per side with which faces touch as many texels as were asked for.
fn map_size(scene: &Scene, atlas: &Atlas, size: LayoutSize, surface_m2: f64, on_map: f64) -> u32 {
    let on_map = on_map.max(f64::MIN_POSITIVE);
    let rounded = |side: f64| (side.clamp(f64::from(MIN_SIZE), f64::from(MAX_SIZE)).round() as u32).div_ceil(4) * 4;
    let mut side = (f64::from(size.texels) / on_map).sqrt();
    for _ in 0..SIZES {
        let covered = texels::cover(scene, atlas, rounded(side)).texels.len().max(1);
        side = f64::from(rounded(side)) * (f64::from(size.texels) / covered as f64).sqrt();
    }
    let finest = size.finest_m.map_or(f64::INFINITY, |finest_m| (surface_m2 / on_map).sqrt() / f64::from(finest_m));
    rounded(side.min(finest))
}

/// The first two faces that hold the same texel center without being neighbors.
fn overlap(scene: &Scene, atlas: &Atlas, size: u32) -> Option<(u32, u32)> {
    let faces: Vec<(usize, usize)> = scene.faces().collect();
    let footprints: Vec<Option<Footprint>> = atlas.corners.par_iter().map(|&uv| Footprint::new(uv, size)).collect();
    (0..size.div_ceil(BAND)).into_par_iter().find_map_first(|band| {
        let first_row = band * BAND;
        let n_rows = BAND.min(size - first_row);
        let mut owner = vec![u32::MAX; (n_rows * size) as usize];
        for (face, footprint) in footprints.iter().enumerate() {
            let Some(footprint) = footprint else { continue };
            let rows = footprint.rows(size);
            for y in rows.start.max(first_row)..rows.end.min(first_row + n_rows) {
                for x in footprint.columns(y, size) {
                    if footprint.depth(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) < DEPTH {
                        continue;
                    }
                    let owner = &mut owner[((y - first_row) * size + x) as usize];
                    if *owner == u32::MAX {
                        *owner = face as u32;
                    } else if !are_neighbors(scene, atlas, &faces, *owner as usize, face) {
                        return Some((*owner, face as u32));
                    }
                }
            }
        }
        None
    })
}

/// Same chart, and a vertex in common.
fn are_neighbors(scene: &Scene, atlas: &Atlas, faces: &[(usize, usize)], a: usize, b: usize) -> bool {
    let corners = |face: usize| {
        let (mesh, triangle) = faces[face];
        let positions = scene.corners(mesh, triangle);
        [0, 1, 2].map(|corner| (positions[corner], atlas.corners[face][corner]))
    };
    let of_b = corners(b);
    atlas.chart[a] == atlas.chart[b] && corners(a).iter().any(|corner| of_b.contains(corner))
}
