//! What the child does; the only file that names xatlas.

use super::{ANSWER, parse_request, push};
use crate::lightmap::unwrap::{PADDING, Piece};
use std::io::{Read, Write};
use std::process::ExitCode;
use xatlas_rs::{ChartOptions, IndexData, MeshData, MeshDecl, PackOptions, Xatlas};

/// Request in, answer out; 3 for a request that cannot be unwrapped.
pub(super) fn run() -> ExitCode {
    let mut bytes = Vec::new();
    if std::io::stdin().lock().read_to_end(&mut bytes).is_err() {
        return ExitCode::from(6);
    }
    let Some(answer) = parse_request(&bytes).and_then(|(pieces, texels_per_m)| unwrap(&pieces, texels_per_m)) else {
        return ExitCode::from(3);
    };
    match std::io::stdout().lock().write_all(&answer) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(6),
    }
}

fn unwrap(pieces: &[Piece], texels_per_m: f32) -> Option<Vec<u8>> {
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
        push(&mut answer, &[ANSWER, 0, 0]);
        return Some(answer);
    }
    let mut xatlas = Xatlas::new();
    for declaration in &declarations {
        xatlas.add_mesh(declaration).ok()?;
    }
    xatlas.add_mesh_join();
    xatlas.compute_charts(&ChartOptions { fix_winding: true, ..ChartOptions::default() });
    // xatlas keeps `padding` texels between charts; its charts also keep the texels of a bilinear tap.
    let padding = 2 * PADDING;
    xatlas.pack_charts(&PackOptions {
        padding,
        texels_per_unit: texels_per_m,
        bilinear: true,
        ..PackOptions::default()
    });
    push(&mut answer, &[ANSWER, xatlas.width(), xatlas.height()]);
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
