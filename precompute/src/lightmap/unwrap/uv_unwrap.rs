//! The default backend, and the packer of all layouts; the only file that names uvunwrap.

use super::{PADDING, Piece, Progress, UnwrapError, Unwrapped, Unwrapper};
use glam::Vec2;
use rayon::prelude::*;
use uvunwrap::{Density, Error, MeshInput, Options, Packing, Stage};

/// Above this many charts they are packed by their outlines' rows and columns, which is tens of times faster than nesting
/// shapes into each other's holes, but leaves more of the map empty. 10,000 charts nest in 15 s or so.
const MANY_CHARTS: usize = 15_000;
/// Faces that meet at less than this angle, degrees, may share a chart (uvunwrap's default).
const CHART_ANGLE: f32 = 70.0;
/// Charts are cut until no face's texels are this many times larger or smaller in area than the mean.
const AREA_DISTORTION: f32 = 2.0;
/// Zooms at which a page is packed at once, how far apart, and how often before it is given up.
const STEPS: i32 = 4;
const STEP: f32 = 1.06;
const MOST_ROUNDS: u32 = 4;

/// The uvunwrap crate: pure Rust, the same layout on any number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct UvUnwrap;

impl Unwrapper for UvUnwrap {
    fn name(&self) -> &'static str {
        "uvunwrap"
    }

    fn unwrap(&self, pieces: &[Piece], texels_per_m: f32, progress: Progress) -> Result<Unwrapped, UnwrapError> {
        let indices: Vec<Vec<u32>> = pieces.iter().map(|piece| piece.triangles.concat()).collect();
        let meshes: Vec<MeshInput> =
            pieces.iter().zip(&indices).map(|(piece, indices)| MeshInput::new(&piece.positions, indices)).collect();
        let options = Options {
            max_chart_angle: CHART_ANGLE,
            max_area_distortion: AREA_DISTORTION,
            density: Density::Fixed { texels_per_unit: texels_per_m, page_size: None },
            // Where charts go is settled later.
            packing: Packing::Fast,
            ..Options::default()
        };
        let atlas = generate(&meshes, &options, progress).map_err(failure)?;
        Ok(Unwrapped { corners: corners(&atlas) })
    }
}

/// A flattened chart to be packed.
#[derive(Clone, Debug, Default)]
pub(super) struct FlatChart {
    /// `[n_triangles]` corners in the plane, metres.
    pub corners: Vec<[Vec2; 3]>,
    /// Texels per metre.
    pub density: f32,
}

/// Where packed charts went.
pub(super) struct Packed {
    /// `[n_charts][n_triangles]` corners in texels.
    pub corners: Vec<Vec<Option<[Vec2; 3]>>>,
    /// Texels that the charts take, `[width, height]`.
    pub extent: [u32; 2],
}

/// Packs charts into one map, at least two texels apart and one texel from its border: at their densities into a map that
/// grows, or, with `page`, all of them as much finer or coarser as fills a map of that many texels per side. `tight` nests
/// their shapes.
///
/// # Errors
/// [`UnwrapError::TooManyCharts`] where they do not fit the page at any density.
pub(super) fn pack(
    charts: &[FlatChart],
    page: Option<u32>,
    tight: bool,
    progress: Progress,
) -> Result<Packed, UnwrapError> {
    // Vertices apart are joined by their place, in space as in the plane.
    type Flat = (Vec<[f32; 3]>, Vec<[f32; 2]>, Vec<u32>);
    let flat: Vec<Flat> = charts
        .iter()
        .map(|chart| {
            let places = chart.corners.iter().flatten();
            let indices = (0..3 * chart.corners.len() as u32).collect();
            (places.clone().map(|uv| [uv.x, uv.y, 0.0]).collect(), places.map(|uv| uv.to_array()).collect(), indices)
        })
        .collect();
    let meshes: Vec<MeshInput> = charts
        .iter()
        .zip(&flat)
        .map(|(chart, (positions, uvs, indices))| MeshInput {
            scale: chart.density,
            existing_uvs: Some(uvs),
            ..MeshInput::new(positions, indices)
        })
        .collect();
    let packing = if tight && charts.len() < MANY_CHARTS { Packing::Shape } else { Packing::Fast };
    let at = |density| {
        let options =
            Options { padding: PADDING, max_area_distortion: f32::MAX, density, packing, ..Options::default() };
        generate(&meshes, &options, progress)
    };
    let too_many = |charts, texels| UnwrapError::TooManyCharts { charts, texels };
    let atlas = match page {
        None => at(Density::Fixed { texels_per_unit: 1.0, page_size: None }).map_err(failure)?,
        Some(page) if packing == Packing::Shape => {
            let least = charts.len() as u64 * u64::from(1 + 2 * PADDING).pow(2);
            let zoomed = |zoom| match at(Density::Fixed { texels_per_unit: zoom, page_size: Some(page) }) {
                Ok(atlas) => Ok((atlas.page_count <= 1).then_some(atlas)),
                Err(Error::ChartTooLarge { .. } | Error::AtlasTooLarge { .. }) => Ok(None),
                Err(error) => Err(failure(error)),
            };
            if least > u64::from(page).pow(2) {
                return Err(too_many(charts.len() as u32, page));
            }
            match largest(zoomed)? {
                Some(atlas) => atlas,
                // Far from what was estimated, as for a map of one long chart.
                None => at(Density::Auto { page_size: page }).map_err(failure)?,
            }
        }
        Some(page_size) => at(Density::Auto { page_size }).map_err(failure)?,
    };
    if atlas.page_count > 1 {
        return Err(too_many(atlas.chart_count, page.unwrap_or(atlas.width.max(atlas.height))));
    }
    Ok(Packed { corners: corners(&atlas), extent: [atlas.width, atlas.height] })
}

/// About the largest of layouts by zoom: of those within [`STEP`] of each other, then of two in between. Several at once, and always
/// the same ones: the library looks for the largest too, but for one after the other, and more closely than it is worth.
fn largest<T: Send>(at: impl Fn(f32) -> Result<Option<T>, UnwrapError> + Sync) -> Result<Option<T>, UnwrapError> {
    let best_of = |zooms: &[f32]| -> Result<Option<(f32, T)>, UnwrapError> {
        let tried: Vec<Option<T>> = zooms.par_iter().map(|&zoom| at(zoom)).collect::<Result<_, _>>()?;
        Ok(zooms.iter().zip(tried).filter_map(|(&zoom, layout)| Some((zoom, layout?))).next_back())
    };
    let (mut first, mut best) = (-STEPS / 2, None);
    for _ in 0..MOST_ROUNDS {
        let zooms: Vec<f32> = (first..first + STEPS).map(|step| STEP.powi(step)).collect();
        match (best_of(&zooms)?, &best) {
            (Some(found), _) => {
                let is_last = found.0 == zooms[STEPS as usize - 1];
                let was_too_large = first < -STEPS / 2;
                best = Some(found);
                if !is_last || was_too_large {
                    break;
                }
                first += STEPS;
            }
            (None, Some(_)) => break,
            (None, None) => first -= STEPS,
        }
    }
    let Some((zoom, layout)) = best else { return Ok(None) };
    let between = [1.0, 2.0].map(|third: f32| zoom * STEP.powf(third / 3.0));
    Ok(Some(best_of(&between)?.map_or(layout, |(_, layout)| layout)))
}

fn generate(meshes: &[MeshInput], options: &Options, progress: Progress) -> Result<uvunwrap::Atlas, Error> {
    let told = |state: uvunwrap::Progress| {
        let doing = match state.stage {
            Stage::Packing => "packing charts",
            Stage::Output => "writing coordinates",
            _ => "cutting charts",
        };
        progress(doing, state.done, state.total.unwrap_or(0))
    };
    uvunwrap::generate_with_progress(meshes, options, told)
}

fn failure(error: Error) -> UnwrapError {
    match error {
        Error::Cancelled => UnwrapError::Cancelled,
        error => UnwrapError::Backend { backend: "uvunwrap", reason: error.to_string() },
    }
}

/// Corner coordinates of each mesh's triangles in texels; `None` for triangles left out.
fn corners(atlas: &uvunwrap::Atlas) -> Vec<Vec<Option<[Vec2; 3]>>> {
    let texels = Vec2::new(atlas.width as f32, atlas.height as f32);
    atlas
        .meshes
        .iter()
        .map(|mesh| {
            let corner = |index: &u32| {
                let vertex = &mesh.vertices[*index as usize];
                vertex.chart.map(|_| Vec2::from(vertex.uv) * texels)
            };
            mesh.indices.chunks_exact(3).map(|t| Some([corner(&t[0])?, corner(&t[1])?, corner(&t[2])?])).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_zoom_is_found_within_a_third_of_a_step_or_not_at_all() {
        let found = |limit: f32| largest(|zoom| Ok((zoom <= limit).then_some(zoom))).expect("no error");
        for limit in [0.6, 0.88, 1.0, 1.13, 1.5, 2.0] {
            let zoom = found(limit).expect("one that fits");
            assert!(zoom <= limit && zoom * STEP.powf(1.0 / 3.0) * 1.0001 > limit, "{zoom} of {limit}");
        }
        assert_eq!(found(0.01), None);
    }

    #[test]
    fn one_long_chart_fits_a_page_that_no_estimate_by_area_allows() {
        // 1000 m by 1 cm at 100 texels per metre: 100,000 texels long.
        let corners = vec![
            [Vec2::ZERO, Vec2::new(1000.0, 0.0), Vec2::new(1000.0, 0.01)],
            [Vec2::ZERO, Vec2::new(1000.0, 0.01), Vec2::new(0.0, 0.01)],
        ];
        let packed = pack(&[FlatChart { corners, density: 100.0 }], Some(128), true, &|_, _, _| true).expect("fits");
        let reach = packed.corners[0].iter().flatten().flatten().map(|uv| uv.max_element()).fold(0.0, f32::max);
        assert!(reach > 64.0 && reach <= 127.0, "{reach}");
    }
}
