//! From a scene to lightmap texels and receivers.
//!
//! [`sides`] gives each live side of double-sided surfaces a face of its own; [`cut`] cuts faces where charts have to end;
//! [`unwrap`] gives every face lightmap coordinates (TEXCOORD_1) unless the scene brings usable ones; [`Atlas::of`] reads
//! them; [`texels`] covers a map of any size with them; [`receivers`] turns covered texels into receivers; [`samples`]
//! spreads points over texels.

mod chart_pyramid;
mod charts;
pub mod cut;
mod gutters;
pub mod hidden;
mod pieces;
mod raster;
pub mod receivers;
pub mod samples;
mod seams;
mod shared;
pub mod sides;
#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;
pub mod texels;
pub mod unwrap;

pub use chart_pyramid::{ChartPyramid, as_stored};
pub use pieces::Pieces;

use crate::rays::FacePoint;
use glam::{Vec2, Vec3};
use localprt_scenes::{FaceId, SurfacePoint};

/// Told about the work: what is being done, steps done, steps in all (0 if unknown). Returning `false` cancels.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) -> bool + Sync);

/// TEXCOORD set of lightmap coordinates.
const LIGHTMAP_SET: usize = 1;

/// Marks texels without a receiver in maps from texel to receiver.
const NO_RECEIVER: u32 = u32::MAX;

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
    /// The face that covers the sample point (the texel centre, or the nearest covered point of the texel).
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

/// Receivers: surface points that get indirect light. Arrays of equal length.
#[derive(Clone, Debug, Default)]
pub struct ReceiverSet {
    /// Texels per side of the receiver map.
    pub size: u32,
    /// Texel index of each.
    pub texel: Vec<u32>,
    /// World position, metres.
    pub position: Vec<Vec3>,
    /// Unit shading normal.
    pub normal: Vec<Vec3>,
    /// Unit geometric normal.
    pub geometric_normal: Vec<Vec3>,
    /// Chart of each.
    pub chart: Vec<u32>,
    /// Points over which what a receiver gets is a mean, receiver by receiver: see [`ReceiverSet::sites`].
    sites: Vec<SurfacePoint>,
    /// End of each receiver's sites.
    site_end: Vec<u32>,
    /// Texels covered by a face whose every sample point is inside or behind geometry.
    pub invalid: Vec<u32>,
    /// Points moved out of the way of near geometry.
    pub pushed: usize,
    /// `(texel, receiver)`: texels without a receiver that bilinear taps of their chart touch (at least two texels
    /// around every chart), and invalid texels, with the nearest receiver of the same chart; just beyond a seam of a smooth
    /// surface, with the receiver on its other side. By rising texel.
    pub gutters: Vec<(u32, u32)>,
    /// Receiver pairs on the two sides of a chart seam at the same place; smaller index first, sorted, unique.
    pub seams: Vec<(u32, u32)>,
}

impl ReceiverSet {
    /// Receivers that are points: in space, or of a surface.
    pub fn of_points(points: &[SurfacePoint]) -> Self {
        let mut set = Self { chart: vec![0; points.len()], ..Self::default() };
        for (index, point) in points.iter().enumerate() {
            set.push(index as u32, *point, &[]);
        }
        set
    }

    /// One more receiver, in a texel of no lower index; a mean over `sites`, if there are any.
    fn push(&mut self, texel: u32, point: SurfacePoint, sites: &[SurfacePoint]) {
        self.texel.push(texel);
        self.position.push(point.position);
        self.normal.push(point.normal);
        self.geometric_normal.push(point.geometric_normal);
        match sites {
            [] => self.sites.push(point),
            sites => self.sites.extend(sites),
        }
        self.site_end.push(self.sites.len() as u32);
    }

    /// Points of a receiver's texel that its chart covers in the open: it gets the mean over them. At least one.
    pub fn sites(&self, receiver: usize) -> &[SurfacePoint] {
        let first = receiver.checked_sub(1).map_or(0, |before| self.site_end[before] as usize);
        &self.sites[first..self.site_end[receiver] as usize]
    }

    /// Number of receivers.
    pub fn len(&self) -> usize {
        self.texel.len()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.texel.is_empty()
    }
}

/// How a scene came by its layout.
#[derive(Clone, Debug, Default)]
pub struct LayoutReport {
    /// The scene's own TEXCOORD_1 was kept.
    pub kept: bool,
    /// Why it was not, in words.
    pub reason: Option<String>,
    /// Faces added for the back sides of double-sided surfaces.
    pub back_faces: usize,
    /// Texels per side of the receiver map.
    pub size: u32,
    /// Charts.
    pub charts: u32,
}
