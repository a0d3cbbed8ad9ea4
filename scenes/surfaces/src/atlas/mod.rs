//! Layouts of a scene's surface, the texels that they cover, and points spread over these.

mod charts;
pub mod pieces;
pub mod raster;
pub mod samples;
mod shared;
pub mod texels;

pub use pieces::Pieces;

use crate::rays::FacePoint;
use glam::{Vec2, Vec3};
use localprt_scenes::FaceId;

/// TEXCOORD set of lightmap coordinates.
pub const LIGHTMAP_SET: usize = 1;

/// A layout of a scene's surface: of the receiver map, or of the direct light map.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// `[n_faces]` corner coordinates in 0..=1, in `FaceId` order; row 0 of a map is at v = 0.
    pub corners: Vec<[Vec2; 3]>,
    /// `[n_faces]` chart of each face: faces joined by edges that are joined in uv.
    pub chart: Vec<u32>,
    /// Number of charts.
    pub n_charts: u32,
}

/// A texel of a map that a face covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texel {
    /// `y * size + x`.
    pub index: u32,
    /// The face that covers the sample point (the texel center, or the nearest covered point of the texel).
    pub face: FaceId,
    /// Its mesh.
    pub mesh: u32,
    /// Its triangle within the mesh.
    pub triangle: u32,
    /// Where on the face.
    pub barycentrics: Vec3,
    /// Chart of the face.
    pub chart: u32,
}

impl Texel {
    /// Its own point.
    pub fn point(&self) -> FacePoint {
        let Self { face, mesh, triangle, barycentrics, .. } = *self;
        FacePoint { face, mesh: mesh as usize, triangle: triangle as usize, barycentrics }
    }
}

/// All covered texels of a map, by rising index.
#[derive(Clone, Debug, Default)]
pub struct TexelMap {
    /// Texels per side.
    pub size: u32,
    /// Covered texels.
    pub texels: Vec<Texel>,
}
