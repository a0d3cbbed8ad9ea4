//! Lightmap coordinates: the scene's own TEXCOORD_1 where it can be used, else an unwrap.
//!
//! The surface is cut into pieces, one per mesh, welded by position and normal, and given to an [`Unwrapper`]; all pieces
//! share one square map. Triangles keep their order; vertices are copied along chart borders.

mod authored;
mod error;
mod pieces;
mod uv_unwrap;
pub mod xatlas;

pub use authored::usable_layout;
pub use error::UnwrapError;
pub use uv_unwrap::UvUnwrap;
pub use xatlas::{XatlasChild, xatlas_child_main};

use super::{Atlas, LayoutReport, Progress, raster::Footprint, texels};
use crate::settings::UnwrapBackend;
use glam::Vec2;
use localprt_scenes::Scene;

/// Largest map, texels per side.
pub const MAX_SIZE: u32 = 8192;
/// Smallest map, texels per side.
pub const MIN_SIZE: u32 = 16;
/// Empty texels around each chart, so that charts are twice this apart.
const PADDING: u32 = 1;

/// How fine a layout is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LayoutSize {
    /// Texels per side of the receiver map, and the most of it that surfaces may take, 0..=1; texels as small as fit
    /// that.
    Lightmap {
        /// Texels per side.
        texels: u32,
        /// Largest share of the map.
        fill: f32,
    },
    /// Edge of a texel on the surface, metres; the map is the smallest multiple of 4 that holds the charts.
    Texel(f32),
}

/// A connected or unconnected part of the surface, to be cut into charts.
#[derive(Clone, Debug, Default)]
pub struct Piece {
    /// World positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

/// How charts are packed into one map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Packing {
    /// The finest texels with which everything fits this many texels per side.
    Fit(u32),
    /// Texels per metre.
    Density(f32),
}

/// What an [`Unwrapper`] makes.
#[derive(Clone, Debug, Default)]
pub struct Unwrapped {
    /// `[pieces][triangles]` corner coordinates in texels; `None` for triangles left out.
    pub corners: Vec<Vec<Option<[Vec2; 3]>>>,
    /// Texels that the charts take, `[width, height]`.
    pub extent: [u32; 2],
}

/// Cuts surfaces into charts, flattens them and packs them.
pub trait Unwrapper {
    /// Name for messages.
    fn name(&self) -> &'static str;

    /// Unwraps all pieces into one map, with charts at least two texels apart and one texel from the map's border.
    fn unwrap(&self, pieces: &[Piece], packing: Packing, progress: Progress) -> Result<Unwrapped, UnwrapError>;
}

/// The backend of that name.
///
/// # Errors
/// [`UnwrapError::NotBuilt`] for xatlas in a build without it, [`UnwrapError::Child`] where the running program cannot
/// be found.
pub fn backend(choice: UnwrapBackend) -> Result<Box<dyn Unwrapper>, UnwrapError> {
    Ok(match choice {
        UnwrapBackend::Uvunwrap => Box::new(UvUnwrap),
        UnwrapBackend::Xatlas => Box::new(XatlasChild::new()?),
    })
}

/// Gives the scene a layout: its TEXCOORD_1 where [`usable_layout`] accepts it, else an unwrap by `choice`.
///
/// # Errors
/// Too small a texel or a map size out of range (found before any work), too many charts for the map, a failing backend,
/// or [`UnwrapError::Cancelled`].
pub fn ensure_layout(
    scene: Scene,
    choice: UnwrapBackend,
    size: LayoutSize,
    progress: Progress,
) -> Result<(Scene, LayoutReport), UnwrapError> {
    match usable_layout(&scene, size)? {
        Ok(texels) => {
            let report = report(&scene, texels, None);
            Ok((scene, report))
        }
        Err(reason) => unwrap_with(scene, backend(choice)?.as_ref(), size, progress)
            .map(|(scene, report)| (scene, LayoutReport { reason: Some(reason), ..report })),
    }
}

/// Unwraps whatever TEXCOORD_1 the scene has; see [`ensure_layout`].
///
/// # Errors
/// As [`ensure_layout`].
pub fn unwrap_with(
    scene: Scene,
    backend: &dyn Unwrapper,
    size: LayoutSize,
    progress: Progress,
) -> Result<(Scene, LayoutReport), UnwrapError> {
    check_size(&scene, size)?;
    let (pieces, kept) = pieces::cut(&scene)?;
    let unwrapped = match size {
        LayoutSize::Lightmap { texels, fill } => {
            let side_m = area_m2(&scene).sqrt();
            let filling =
                backend.unwrap(&pieces, Packing::Density(fill.sqrt() * texels as f32 / side_m as f32), progress)?;
            if filling.extent[0].max(filling.extent[1]) <= texels {
                filling
            } else {
                backend.unwrap(&pieces, Packing::Fit(texels), progress)?
            }
        }
        LayoutSize::Texel(texel_m) => backend.unwrap(&pieces, Packing::Density(1.0 / texel_m), progress)?,
    };
    let needed = unwrapped.extent[0].max(unwrapped.extent[1]).max(MIN_SIZE).div_ceil(4) * 4;
    let texels = match size {
        LayoutSize::Lightmap { texels, .. } => texels,
        LayoutSize::Texel(texel_m) if needed > MAX_SIZE => {
            return Err(UnwrapError::texel_too_small(texel_m, needed.into()));
        }
        LayoutSize::Texel(_) => needed,
    };
    let scene = pieces::apply(scene, &unwrapped, &kept, texels);
    let report = report(&scene, texels, Some("unwrapped anew".into()));
    Ok((scene, report))
}

/// Refuses sizes that cannot work, before any work.
fn check_size(scene: &Scene, size: LayoutSize) -> Result<(), UnwrapError> {
    match size {
        LayoutSize::Lightmap { texels, .. } if !(MIN_SIZE..=MAX_SIZE).contains(&texels) => {
            Err(UnwrapError::SizeOutOfRange { texels })
        }
        LayoutSize::Texel(texel_m) if !(texel_m > 0.0 && texel_m.is_finite()) => Err(UnwrapError::BadTexel { texel_m }),
        LayoutSize::Texel(texel_m) => {
            let needed = (area_m2(scene).sqrt() / f64::from(texel_m)).ceil();
            if needed > f64::from(MAX_SIZE) {
                return Err(UnwrapError::texel_too_small(texel_m, needed as u64));
            }
            Ok(())
        }
        LayoutSize::Lightmap { .. } => Ok(()),
    }
}

/// Area of all faces, square metres.
fn area_m2(scene: &Scene) -> f64 {
    scene.faces().map(|(mesh, triangle)| face_area_m2(scene, mesh, triangle)).sum()
}

fn face_area_m2(scene: &Scene, mesh: usize, triangle: usize) -> f64 {
    let [a, b, c] = scene.corners(mesh, triangle).map(glam::Vec3::as_dvec3);
    (b - a).cross(c - a).length() * 0.5
}

fn report(scene: &Scene, texels: u32, reason: Option<String>) -> LayoutReport {
    let atlas = Atlas::of(scene);
    let on_map: f64 = atlas.corners.iter().filter_map(|&uv| Footprint::new(uv, texels)).map(|f| f.area()).sum();
    let covered = texels::cover(scene, &atlas, texels).texels.len();
    LayoutReport {
        kept: reason.is_none(),
        reason,
        back_faces: 0,
        size: texels,
        charts: atlas.n_charts,
        used: (covered as f64 / f64::from(texels).powi(2)) as f32,
        texel_m: if on_map > 0.0 { (area_m2(scene) / on_map).sqrt() as f32 } else { 0.0 },
    }
}
