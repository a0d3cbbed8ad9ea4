//! The default backend, and the packer of all layouts; the only file that names uvunwrap.

use super::{
    PADDING, Piece, Progress, UnwrapError, Unwrapped, Unwrapper,
    blocks::{Block, blocks},
};
use glam::Vec2;
use rayon::prelude::*;
use uvunwrap::{Density, Error, MeshInput, Options, Packing, Stage};

/// Faces that meet at less than this angle, degrees, may share a chart (uvunwrap's default).
const CHART_ANGLE: f32 = 70.0;
/// Charts are cut until no face's texels are this many times larger or smaller in area than the mean.
const AREA_DISTORTION: f32 = 2.0;
/// Zooms at which a page is packed: a third of this step apart, so many in a row, and how many rows are looked at before it is given up.
const STEP: f32 = 1.06;
const WINDOW: i32 = 18;
const MOST_WINDOWS: u32 = 4;

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
        let atlas = in_zeroed_memory(|| generate(&meshes, &options, progress)).map_err(failure)?;
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
/// their shapes; else they are packed by their outlines' rows and columns, which is faster and leaves more of the map empty.
///
/// # Errors
/// [`UnwrapError::TooManyCharts`] where they do not fit the page at any density.
pub(super) fn pack(
    charts: &[FlatChart],
    page: Option<u32>,
    tight: bool,
    progress: Progress,
) -> Result<Packed, UnwrapError> {
    let n_charts = charts.len() as u32;
    let by_rows = |density| {
        let atlas = generate_flat(charts, density, Packing::Fast, progress).map_err(failure)?;
        if atlas.page_count > 1 {
            let texels = page.unwrap_or(atlas.width.max(atlas.height));
            return Err(UnwrapError::TooManyCharts { charts: atlas.chart_count, texels });
        }
        Ok(Packed { corners: corners(&atlas), extent: [atlas.width, atlas.height] })
    };
    let nested = |zoom, page| match nested(charts, zoom, page, progress) {
        Err(Error::ChartTooLarge { .. } | Error::AtlasTooLarge { .. }) if page.is_some() => Ok(None),
        Err(error) => Err(failure(error)),
        Ok(packed) => Ok(packed),
    };
    let Some(page_size) = page else {
        return match tight {
            true => nested(1.0, None)?.ok_or(UnwrapError::TooManyCharts { charts: n_charts, texels: super::MAX_SIZE }),
            false => by_rows(Density::Fixed { texels_per_unit: 1.0, page_size: None }),
        };
    };
    if u64::from(n_charts) * u64::from(1 + 2 * PADDING).pow(2) > u64::from(page_size).pow(2) {
        return Err(UnwrapError::TooManyCharts { charts: n_charts, texels: page_size });
    }
    if tight && let Some(packed) = largest(|zoom| nested(zoom, page))? {
        return Ok(packed);
    }
    // Not wanted tight, or far from what was estimated, as for a map of one long chart.
    by_rows(Density::Auto { page_size })
}

/// Charts at `zoom` times their densities, nested into one page; `None` if they do not fit one.
fn nested(charts: &[FlatChart], zoom: f32, page: Option<u32>, progress: Progress) -> Result<Option<Packed>, Error> {
    let (large, blocks) = blocks(charts, zoom);
    let rectangle = |block: &Block| {
        // Whole texels, whatever rounding does to them.
        let [width, height] = block.size.map(|edge| edge as f32 - 1e-3);
        let [a, b, c, d] = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]].map(Vec2::from);
        FlatChart { corners: vec![[a, b, c], [a, c, d]], density: 1.0 / zoom }
    };
    let given: Vec<FlatChart> =
        large.iter().map(|&chart| charts[chart].clone()).chain(blocks.iter().map(rectangle)).collect();
    let density = Density::Fixed { texels_per_unit: zoom, page_size: page };
    let atlas = generate_flat(&given, density, Packing::Shape, progress)?;
    if atlas.page_count > 1 {
        return Ok(None);
    }
    let mut packed = vec![Vec::new(); charts.len()];
    let mut found = corners(&atlas).into_iter();
    for (chart, corners) in large.into_iter().zip(&mut found) {
        packed[chart] = corners;
    }
    for (block, corners) in blocks.into_iter().zip(found) {
        // A rectangle is turned by right angles and never left out.
        let Some([origin, along, across]) = corners[0] else { continue };
        let right = (along - origin).normalize().round();
        let up = (across - along).normalize().round();
        for (chart, triangles) in block.charts {
            let place = |at: Vec2| origin + right * at.x + up * at.y;
            packed[chart] = triangles.into_iter().map(|triangle| Some(triangle.map(place))).collect();
        }
    }
    Ok(Some(Packed { corners: packed, extent: [atlas.width, atlas.height] }))
}

/// Packs charts as they are.
fn generate_flat(
    charts: &[FlatChart],
    density: Density,
    packing: Packing,
    progress: Progress,
) -> Result<uvunwrap::Atlas, Error> {
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
    let options = Options { padding: PADDING, max_area_distortion: f32::MAX, density, packing, ..Options::default() };
    generate(&meshes, &options, progress)
}

/// About the largest of layouts by zoom: within a third of [`STEP`]. Two at once, and always the same ones, each pair leaving a third of
/// what is in question: the library looks for the largest too, but for one after the other, and more closely than it is worth.
fn largest<T: Send>(at: impl Fn(f32) -> Result<Option<T>, UnwrapError> + Sync) -> Result<Option<T>, UnwrapError> {
    let at = |third: i32| at(STEP.powf(third as f32 / 3.0));
    // Thirds of a step. The window moves up as long as all of it fits, and down as long as none of it does.
    let (mut low, mut best) = (-WINDOW / 3, None);
    for _ in 0..MOST_WINDOWS {
        let (mut from, mut to) = (low, low + WINDOW);
        while from < to {
            let [a, b] = [1, 2].map(|third| from + (to - from) * third / 3);
            let tried: Vec<Option<T>> = [a, b].par_iter().map(|&third| at(third)).collect::<Result<_, _>>()?;
            let mut tried = tried.into_iter();
            match (tried.next().flatten(), tried.next().flatten()) {
                (_, Some(layout)) => (best, from) = (Some(layout), b + 1),
                (Some(layout), None) => (best, from, to) = (Some(layout), a + 1, b),
                (None, None) => to = a,
            }
        }
        if best.is_none() {
            low -= WINDOW;
        } else if from == low + WINDOW && low >= -WINDOW / 3 {
            low = from;
        } else {
            break;
        }
    }
    Ok(best)
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

/// Runs with memory that is zero when it is allocated. The factorization by which charts are flattened (faer 0.22, its AMD ordering) reads
/// some that it has not written: what others have left there is another order of the unknowns, or an index out of bounds.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn in_zeroed_memory<T>(work: impl FnOnce() -> T) -> T {
    use nix::libc::{M_PERTURB, mallopt};
    let fill = |complement| {
        #[expect(unsafe_code, reason = "sets a byte of the allocator")]
        // SAFETY: mallopt takes no pointers; what other threads allocate meanwhile is filled too, or not.
        unsafe {
            mallopt(M_PERTURB, complement);
        }
    };
    fill(0xff);
    let done = work();
    fill(0);
    done
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn in_zeroed_memory<T>(work: impl FnOnce() -> T) -> T {
    work()
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
