//! The default backend; the only file that names uvunwrap.

use super::pieces::patches;
use super::{PADDING, Packing, Piece, Progress, UnwrapError, Unwrapped, Unwrapper};
use glam::Vec2;
use rayon::prelude::*;
use uvunwrap::{Density, Error, MeshInput, Options, Stage};

/// Above this many smooth patches, charts are packed by their outlines' rows and columns, which is tens of times faster
/// than nesting shapes into each other's holes, but leaves more of the map empty. 10,000 charts nest in 15 s or so.
const MANY_PATCHES: usize = 15_000;
/// Faces that meet at less than this angle, degrees, may share a chart (uvunwrap's default).
const CHART_ANGLE: f32 = 70.0;
/// Charts are cut until no face's texels are this many times larger or smaller in area than the mean.
const AREA_DISTORTION: f32 = 2.0;

/// The uvunwrap crate: pure Rust, the same layout on any number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct UvUnwrap;

impl Unwrapper for UvUnwrap {
    fn name(&self) -> &'static str {
        "uvunwrap"
    }

    fn unwrap(&self, pieces: &[Piece], packing: Packing, progress: Progress) -> Result<Unwrapped, UnwrapError> {
        let indices: Vec<Vec<u32>> = pieces.iter().map(|piece| piece.triangles.concat()).collect();
        let meshes: Vec<MeshInput> =
            pieces.iter().zip(&indices).map(|(piece, indices)| MeshInput::new(&piece.positions, indices)).collect();
        let many = pieces.par_iter().map(|piece| patches(piece, CHART_ANGLE)).sum::<usize>() > MANY_PATCHES;
        let mut options = Options {
            padding: PADDING,
            max_chart_angle: CHART_ANGLE,
            max_area_distortion: AREA_DISTORTION,
            packing: if many { uvunwrap::Packing::Fast } else { uvunwrap::Packing::Shape },
            ..Options::default()
        };
        options.density = match packing {
            Packing::Fit(texels) => Density::Auto { page_size: texels },
            Packing::Density(texels_per_unit) => Density::Fixed { texels_per_unit, page_size: None },
        };
        let told = |state: uvunwrap::Progress| {
            let doing = match state.stage {
                Stage::Packing => "packing charts",
                Stage::Output => "writing coordinates",
                _ => "cutting charts",
            };
            progress(doing, state.done, state.total.unwrap_or(0))
        };
        let atlas = uvunwrap::generate_with_progress(&meshes, &options, told).map_err(|error| match error {
            Error::Cancelled => UnwrapError::Cancelled,
            error => UnwrapError::Backend { backend: self.name(), reason: error.to_string() },
        })?;
        if atlas.page_count > 1 {
            return Err(UnwrapError::TooManyCharts {
                charts: atlas.chart_count,
                texels: atlas.width.max(atlas.height),
            });
        }
        let texels = Vec2::new(atlas.width as f32, atlas.height as f32);
        let corners = atlas
            .meshes
            .iter()
            .map(|mesh| {
                let corner = |index: &u32| {
                    let vertex = &mesh.vertices[*index as usize];
                    vertex.chart.map(|_| Vec2::from(vertex.uv) * texels)
                };
                let triangles = mesh.indices.chunks_exact(3);
                triangles.map(|t| Some([corner(&t[0])?, corner(&t[1])?, corner(&t[2])?])).collect()
            })
            .collect();
        Ok(Unwrapped { corners, extent: [atlas.width, atlas.height] })
    }
}
