//! What the child does; the only file that names xatlas.

use super::{ANSWER, parse_request, push};
use crate::lightmap::unwrap::{PADDING, Packing, Piece};
use std::io::{Read, Write};
use std::process::ExitCode;
use xatlas_rs::{ChartOptions, IndexData, MeshData, MeshDecl, PackOptions, Xatlas};

/// Packs while looking for the finest texels that fit.
const MOST_PACKS: usize = 8;
/// Good enough a fill of the map's side.
const TIGHT: f32 = 0.98;

/// Request in, answer out; 3 for a request that cannot be unwrapped.
pub(super) fn run() -> ExitCode {
    let mut bytes = Vec::new();
    if std::io::stdin().lock().read_to_end(&mut bytes).is_err() {
        return ExitCode::from(6);
    }
    let Some(answer) = parse_request(&bytes).and_then(|(pieces, packing)| unwrap(&pieces, packing)) else {
        return ExitCode::from(3);
    };
    match std::io::stdout().lock().write_all(&answer) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(6),
    }
}

fn unwrap(pieces: &[Piece], packing: Packing) -> Option<Vec<u8>> {
    let flat: Vec<(Vec<f32>, Vec<u32>)> =
        pieces.iter().map(|piece| (piece.positions.concat(), piece.triangles.concat())).collect();
    let declarations: Vec<MeshDecl> = flat
        .iter()
        .filter(|(_, indices)| !indices.is_empty())
        .map(|(positions, indices)| MeshDecl {
            vertex_position_data: MeshData::Contiguous(positions),
            index_data: Some(IndexData::U32(indices)),
            face_count: (indices.len() / 3) as u32,
            ..MeshDecl::default()
        })
        .collect();
    let mut answer = Vec::new();
    if declarations.is_empty() {
        push(&mut answer, &[ANSWER, 0, 0, 0]);
        return Some(answer);
    }
    let mut xatlas = Xatlas::new();
    for declaration in &declarations {
        xatlas.add_mesh(declaration).ok()?;
    }
    xatlas.add_mesh_join();
    xatlas.compute_charts(&ChartOptions { fix_winding: true, ..ChartOptions::default() });
    match packing {
        Packing::Density(texels_per_m) => pack(&mut xatlas, texels_per_m),
        Packing::Fit(texels) => fit(&mut xatlas, pieces, texels as f32),
    }
    push(&mut answer, &[ANSWER, xatlas.chart_count(), xatlas.width(), xatlas.height()]);
    let meshes = xatlas.meshes();
    let mut unwrapped = meshes.iter();
    for piece in pieces.iter().filter(|piece| !piece.triangles.is_empty()) {
        let mesh = unwrapped.next()?;
        if mesh.index_array.len() != piece.triangles.len() * 3 {
            return None;
        }
        for triangle in mesh.index_array.chunks_exact(3) {
            let corners: Option<Vec<[f32; 2]>> = triangle
                .iter()
                .map(|&index| mesh.vertex_array.get(index as usize).filter(|vertex| vertex.atlas_index == 0))
                .map(|vertex| vertex.map(|vertex| vertex.uv))
                .collect();
            for corner in corners.unwrap_or_else(|| vec![[f32::NAN; 2]; 3]) {
                push(&mut answer, &corner.map(f32::to_bits));
            }
        }
    }
    Some(answer)
}

fn pack(xatlas: &mut Xatlas, texels_per_unit: f32) {
    // xatlas keeps `padding` texels between charts; its charts also keep the texels of a bilinear tap.
    let padding = 2 * PADDING;
    xatlas.pack_charts(&PackOptions { padding, texels_per_unit, bilinear: true, ..PackOptions::default() });
}

/// The finest texels found whose charts fit; where none do, what was packed last.
fn fit(xatlas: &mut Xatlas, pieces: &[Piece], texels: f32) {
    let area: f32 = pieces.iter().map(area).sum();
    let (mut too_fine, mut fits, mut held) = (f32::INFINITY, 0.0f32, f32::NAN);
    let mut density = texels * (0.7 / area.max(f32::MIN_POSITIVE)).sqrt();
    for _ in 0..MOST_PACKS {
        pack(xatlas, density);
        held = density;
        let side = xatlas.width().max(xatlas.height()).max(1) as f32;
        if side <= texels {
            fits = density;
            if side >= TIGHT * texels {
                break;
            }
        } else {
            too_fine = density;
        }
        let next = density * texels / side;
        // The side grows in steps, so stay between what fits and what does not.
        density = if next > fits && next < too_fine { next * 0.998 } else { 0.5 * (fits + too_fine.min(2.0 * fits)) };
        if fits > 0.0 && density - fits < 0.005 * fits {
            break;
        }
    }
    if fits > 0.0 && held != fits {
        pack(xatlas, fits);
    }
}

fn area(piece: &Piece) -> f32 {
    let corner = |vertex: u32| glam::Vec3::from(piece.positions.get(vertex as usize).copied().unwrap_or_default());
    piece.triangles.iter().map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).length() * 0.5).sum()
}
