//! From a scene to lightmap texels and receivers.
//!
//! [`sides`] gives each live side of double-sided surfaces a face of its own; [`cut`] cuts faces where charts have to end;
//! [`unwrap`] gives every face lightmap coordinates (TEXCOORD_1) unless the scene brings usable ones, which `localprt-surfaces` reads
//! and covers maps with; [`receivers`] turns covered texels into receivers.

mod chart_pyramid;
pub mod cut;
mod gutters;
pub mod hidden;
mod lent;
pub mod receivers;
mod seams;
pub mod sides;
#[cfg(test)]
#[path = "../../../scenes/surfaces/src/test_scenes.rs"]
mod test_scenes;
#[cfg(test)]
mod tests;
pub mod unwrap;

pub use chart_pyramid::{ChartPyramid, NEAREST_TEXEL, as_stored};

use glam::Vec3;
use localprt_scenes::SurfacePoint;
pub use localprt_surfaces::atlas::{Atlas, Pieces, Texel, TexelMap, samples, texels};

/// Told about the work: what is being done, steps done, steps in all (0 if unknown). Returning `false` cancels.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) -> bool + Sync);

/// Marks texels without a receiver in maps from texel to receiver.
const NO_RECEIVER: u32 = u32::MAX;

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
    /// around every chart), and invalid texels, with the nearest receiver of the same chart, or of another where theirs has none;
    /// just beyond a seam of a smooth surface, with the receiver on its other side. By rising texel.
    pub gutters: Vec<(u32, u32)>,
    /// Receiver pairs on the two sides of a chart seam at the same place; smaller index first, sorted, unique.
    pub seams: Vec<(u32, u32)>,
}

impl ReceiverSet {
    /// Receivers that are points of surfaces.
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
