//! From the atlas to the texels of a map that faces cover.

use super::raster::Footprint;
use super::{Atlas, Texel, TexelMap};
use crate::rays::FacePoint;
use glam::{DVec2, DVec3, Vec2, Vec3};
use localprt_scenes::{FaceId, Scene};
use rayon::prelude::*;

/// Rows that one task covers.
pub(super) const BAND: u32 = 32;
/// No face, and no texel.
pub(super) const NOBODY: u32 = u32::MAX;

/// Covers a map of `size` texels per side. Every texel that a face touches is listed once. A texel whose center lies on
/// a face belongs to it, to the lowest of several; any other to the touching face with the point nearest to the center.
pub fn cover(scene: &Scene, atlas: &Atlas, size: u32) -> TexelMap {
    let faces: Vec<(u32, u32)> = scene.faces().map(|(mesh, triangle)| (mesh as u32, triangle as u32)).collect();
    let bands = bands(atlas, size);
    let texels: Vec<Vec<Texel>> = bands
        .par_iter()
        .enumerate()
        .map(|(band, members)| cover_band(atlas, &faces, size, band as u32 * BAND, members))
        .collect();
    TexelMap { size, texels: texels.into_iter().flatten().collect() }
}

/// The receiver map: which surface can send light.
#[derive(Clone, Copy)]
pub struct ReceiverMap<'a> {
    /// Its layout.
    pub atlas: &'a Atlas,
    /// Texels per side.
    pub size: u32,
    /// `[size * size]` whether a texel has a receiver.
    pub has_receiver: &'a [bool],
}

impl ReceiverMap<'_> {
    /// Whether a point of a face has a receiver at its place, and lies in no hole of an alpha mask.
    pub fn sends_light(&self, scene: &Scene, point: &FacePoint) -> bool {
        let Vec2 { x, y } = self.atlas.at(point);
        let at = |place: f32| ((place * self.size as f32).max(0.0) as u32).min(self.size - 1);
        self.has_receiver[(at(y) * self.size + at(x)) as usize]
            && scene.is_present(point.mesh, point.triangle, point.barycentrics)
    }
}

/// Texels of the direct light map that can send light: those of [`cover`] but for the holes of alpha masks and for texels
/// inside or behind geometry, where the receiver map has no receiver; and where each lies in the receiver map, in 0..=1.
///
/// Dark texels under a crate would darken the mips beside it.
pub fn cover_visible(
    scene: &Scene,
    light_map: &Atlas,
    size: u32,
    receivers: &ReceiverMap<'_>,
) -> (TexelMap, Vec<Vec2>) {
    let (texels, places) = cover(scene, light_map, size)
        .texels
        .into_par_iter()
        .filter(|texel| receivers.sends_light(scene, &texel.point()))
        .map(|texel| (texel, receivers.atlas.at(&texel.point())))
        .unzip();
    (TexelMap { size, texels }, places)
}

/// For each band of [`BAND`] rows the faces that touch it, by rising number.
pub(super) fn bands(atlas: &Atlas, size: u32) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); size.div_ceil(BAND) as usize];
    for (face, &uv) in atlas.corners.iter().enumerate() {
        let Some(footprint) = Footprint::new(uv, size) else { continue };
        let rows = footprint.rows(size);
        if !rows.is_empty() {
            for band in &mut bands[(rows.start / BAND) as usize..=((rows.end - 1) / BAND) as usize] {
                band.push(face as u32);
            }
        }
    }
    bands
}

#[derive(Clone, Copy)]
struct Cell {
    face: u32,
    /// From the texel center to the face, texels; 0 if the face holds it.
    distance: f32,
    sample: [f32; 2],
}

fn cover_band(atlas: &Atlas, faces: &[(u32, u32)], size: u32, first_row: u32, members: &[u32]) -> Vec<Texel> {
    let n_rows = BAND.min(size - first_row);
    let nothing = Cell { face: NOBODY, distance: f32::INFINITY, sample: [0.0; 2] };
    let mut cells = vec![nothing; (n_rows * size) as usize];
    // Centers first: most texels are settled by them, and cutting faces to texels is the dear part.
    for_each_touch(atlas, size, first_row, members, |face, footprint, x, y| {
        let cell = &mut cells[((y - first_row) * size + x) as usize];
        if cell.face == NOBODY && footprint.contains(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) {
            *cell = Cell { face, distance: 0.0, sample: [0.5; 2] };
        }
    });
    for_each_touch(atlas, size, first_row, members, |face, footprint, x, y| {
        let cell = &mut cells[((y - first_row) * size + x) as usize];
        if cell.distance == 0.0 {
            return;
        }
        if let Some((distance, sample)) = footprint.sample_in(x, y) {
            // Never 0: that marks a held center.
            let distance = (distance as f32).max(f32::MIN_POSITIVE);
            if distance < cell.distance {
                let within = sample - DVec2::new(f64::from(x), f64::from(y));
                *cell = Cell { face, distance, sample: within.as_vec2().to_array() };
            }
        }
    });
    let mut texels = Vec::new();
    for (place, cell) in cells.iter().enumerate() {
        if cell.face == NOBODY {
            continue;
        }
        let (x, y) = (place as u32 % size, first_row + place as u32 / size);
        let Some(footprint) = Footprint::new(atlas.corners[cell.face as usize], size) else { continue };
        let point = DVec2::new(f64::from(x) + f64::from(cell.sample[0]), f64::from(y) + f64::from(cell.sample[1]));
        let (mesh, triangle) = faces[cell.face as usize];
        texels.push(Texel {
            index: y * size + x,
            face: FaceId(cell.face),
            mesh,
            triangle,
            barycentrics: weights(&footprint, point),
            chart: atlas.chart[cell.face as usize],
        });
    }
    texels
}

/// Visits face, footprint, x and y of all touches in a band, by rising face.
pub(super) fn for_each_touch(
    atlas: &Atlas,
    size: u32,
    first_row: u32,
    members: &[u32],
    mut visit: impl FnMut(u32, &Footprint, u32, u32),
) {
    for &face in members {
        let Some(footprint) = Footprint::new(atlas.corners[face as usize], size) else { continue };
        let rows = footprint.rows(size);
        for y in rows.start.max(first_row)..rows.end.min(first_row + BAND) {
            for x in footprint.columns(y, size) {
                visit(face, &footprint, x, y);
            }
        }
    }
}

/// Corner weights of a point of the face: not negative, summing to 1 although the point is rounded.
pub fn weights(footprint: &Footprint, point: DVec2) -> Vec3 {
    let weights = footprint.barycentrics(point).max(DVec3::ZERO);
    (weights / weights.element_sum()).as_vec3()
}
