//! Lightmap coordinates: the scene's own TEXCOORD_1 where it can be used, else an unwrap.
//!
//! The surface is cut into pieces, one per mesh, welded by position and normal, and given to an [`Unwrapper`], which flattens
//! it into charts; [`Charts`] then gives every chart its density and packs them into one square map. Triangles keep their
//! order; vertices are copied along chart borders.

mod authored;
mod beside;
mod blocks;
mod error;
mod islands;
mod joining;
mod layout;
mod pieces;
mod uv_unwrap;
pub mod xatlas;

pub use authored::usable_layout;
pub use error::UnwrapError;
pub use islands::Wanted;
pub use layout::{Beside, Charts, Fineness};
pub use pieces::on_another_map;
pub use uv_unwrap::UvUnwrap;
pub use xatlas::{XatlasChild, xatlas_child_main};

use super::Progress;
use crate::settings::UnwrapBackend;
use glam::Vec2;
use localprt_scenes::Scene;
use localprt_surfaces::atlas::raster::Footprint;

/// Largest map, texels per side.
pub const MAX_SIZE: u32 = 8192;
/// Smallest map, texels per side.
pub const MIN_SIZE: u32 = 16;
/// Empty texels around each chart, so that charts are twice this apart.
const PADDING: u32 = 1;
/// Texels along the side of a square as large as the surface, while charts are cut.
const CUTTING_TEXELS: f64 = 512.0;

/// How fine a layout is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LayoutSize {
    /// Texels that faces are to touch; fewer where the map or the finest texel does not allow as many.
    pub texels: u32,
    /// Texels per side of the map; absent: as few as hold the charts, in steps of 4, up to [`MAX_SIZE`].
    pub lightmap: Option<u32>,
    /// Edge of the finest texel, metres; the coarsest is [`crate::scale::RANGE`] times that. Absent: what the scale says.
    pub finest_m: Option<f32>,
}

/// A connected or unconnected part of the surface, to be cut into charts.
#[derive(Clone, Debug, Default)]
pub struct Piece {
    /// World positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

/// What an [`Unwrapper`] makes.
#[derive(Clone, Debug, Default)]
pub struct Unwrapped {
    /// `[pieces][triangles]` corner coordinates in texels; `None` for triangles left out.
    pub corners: Vec<Vec<Option<[Vec2; 3]>>>,
}

/// Cuts surfaces into charts and flattens them.
pub trait Unwrapper {
    /// Name for messages.
    fn name(&self) -> &'static str;

    /// Unwraps all pieces at a density, with no two charts in one place.
    fn unwrap(&self, pieces: &[Piece], texels_per_m: f32, progress: Progress) -> Result<Unwrapped, UnwrapError>;
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

/// Cuts the surface of a scene into charts, whatever TEXCOORD_1 it has.
///
/// # Errors
/// A vertex that is not finite, a failing backend, or [`UnwrapError::Cancelled`].
pub fn charts(
    scene: &Scene,
    wanted: Wanted<'_>,
    backend: &dyn Unwrapper,
    progress: Progress,
) -> Result<Charts, UnwrapError> {
    let (pieces, kept) = pieces::cut(scene)?;
    let side_m = area_m2(scene).sqrt();
    let density = if side_m > 0.0 { (CUTTING_TEXELS / side_m) as f32 } else { 1.0 };
    let flat = backend.unwrap(&pieces, density, progress)?;
    Ok(Charts::new(scene, pieces, kept, &flat, wanted))
}

/// Refuses sizes that cannot work, before any work.
///
/// # Errors
/// [`UnwrapError::SizeOutOfRange`], [`UnwrapError::BadTexel`].
pub fn check_size(size: LayoutSize) -> Result<(), UnwrapError> {
    if let Some(texels) = size.lightmap.filter(|texels| !(MIN_SIZE..=MAX_SIZE).contains(texels)) {
        return Err(UnwrapError::SizeOutOfRange { texels });
    }
    match size.finest_m {
        Some(texel_m) if !(texel_m > 0.0 && texel_m.is_finite()) => Err(UnwrapError::BadTexel { texel_m }),
        _ => Ok(()),
    }
}

/// Area of all faces, square metres.
fn area_m2(scene: &Scene) -> f64 {
    scene.faces().map(|(mesh, triangle)| scene.area_m2(mesh, triangle)).sum()
}
