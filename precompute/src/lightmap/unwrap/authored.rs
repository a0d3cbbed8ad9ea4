//! Whether the scene's own TEXCOORD_1 can hold a lightmap.

use super::{Atlas, Footprint, LayoutSize, MAX_SIZE, MIN_SIZE, UnwrapError, area_m2, check_size, face_area_m2};
use glam::{DVec2, Vec2};
use localprt_scenes::Scene;
use rayon::prelude::*;

/// Coordinates may leave 0..=1 by this: exporters round.
const BORDER: f32 = 1e-5;
/// Faces whose share of the map is below this times their share of the surface have no usable coordinates...
const STARVED: f64 = 1e-3;
/// ...and may make up this share of the surface.
const MOST_STARVED: f64 = 0.01;
/// A texel centre counts as covered when it is this deep inside a face, texels: neighbours share their border.
const DEPTH: f64 = 1e-3;
/// Rows that one task looks at.
const BAND: u32 = 32;

/// Whether TEXCOORD_1 gives every receiver a texel of its own at this size: every mesh has it, within 0..=1, no texel
/// centre is covered by two faces (but neighbours in a chart), and hardly any surface is left without texels.
/// `Ok(Ok(texels))` is the size of the receiver map to use it at, `Ok(Err(reason))` says why it cannot be used.
///
/// Front and back of a double-sided face share their texel in such a layout.
///
/// # Errors
/// Map sizes out of range.
pub fn usable_layout(scene: &Scene, size: LayoutSize) -> Result<Result<u32, String>, UnwrapError> {
    check_size(scene, size)?;
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
    let starved: f64 = scene
        .faces()
        .zip(&atlas.corners)
        .map(|((mesh, triangle), &uv)| {
            let area = face_area_m2(scene, mesh, triangle);
            let held = Footprint::new(uv, 1).map_or(0.0, |face| face.area());
            if held * surface_m2 < STARVED * on_map * area { area } else { 0.0 }
        })
        .sum();
    if on_map <= 0.0 && surface_m2 > 0.0 || starved > MOST_STARVED * surface_m2 {
        let share = if surface_m2 > 0.0 { 100.0 * starved / surface_m2 } else { 0.0 };
        return Ok(Err(format!("TEXCOORD_1 has no area for {share:.1} % of the surface")));
    }
    let texels = match size {
        LayoutSize::Lightmap { texels, .. } => texels,
        LayoutSize::Texel(texel_m) => {
            let needed = (surface_m2 / on_map.max(f64::MIN_POSITIVE)).sqrt() / f64::from(texel_m);
            if needed > f64::from(MAX_SIZE) {
                return Err(UnwrapError::texel_too_small(texel_m, needed.ceil() as u64));
            }
            (needed.ceil() as u32).max(MIN_SIZE).div_ceil(4) * 4
        }
    };
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

/// The first two faces that hold the same texel centre without being neighbours.
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
