//! What gets light: texels of surfaces, or points in the open.

use crate::lightmap::ReceiverSet;
use glam::Vec3;
use localprt_scenes::SurfacePoint;

/// Receivers of one kind.
#[derive(Clone, Copy, Debug)]
pub enum Receivers<'a> {
    /// Texels of the lightmap: half of all directions are below their surface.
    Surface(&'a ReceiverSet),
    /// Points in the open, to which all directions count.
    Open(&'a [Vec3]),
}

impl<'a> Receivers<'a> {
    /// `[n_receivers]` world position, metres.
    pub fn positions(self) -> &'a [Vec3] {
        match self {
            Self::Surface(receivers) => &receivers.position,
            Self::Open(points) => points,
        }
    }

    /// Shading normal of a receiver; none in the open.
    pub fn normal(self, receiver: usize) -> Option<Vec3> {
        match self {
            Self::Surface(receivers) => Some(receivers.normal[receiver]),
            Self::Open(_) => None,
        }
    }

    /// Where the rays of a receiver start.
    pub fn sites(self, receiver: usize) -> Sites<'a> {
        match self {
            Self::Surface(receivers) => Sites::Surface(receivers.sites(receiver)),
            Self::Open(points) => Sites::Open(points[receiver]),
        }
    }
}

/// Where the rays of a receiver start.
#[derive(Clone, Copy, Debug)]
pub enum Sites<'a> {
    /// From some points of its texel in turn; at least one.
    Surface(&'a [SurfacePoint]),
    /// From a point in the open.
    Open(Vec3),
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    /// World position, metres, off the surface.
    pub(super) origin: Vec3,
    /// Shading and geometric normal, if it is of a surface.
    pub(super) normals: Option<[Vec3; 2]>,
}

impl Sites<'_> {
    /// How many there are.
    pub(super) fn len(self) -> usize {
        match self {
            Self::Surface(points) => points.len(),
            Self::Open(_) => 1,
        }
    }

    /// The one whose turn it is.
    pub(super) fn start(self, turn: usize, offset_m: f32) -> Start {
        match self {
            Self::Open(origin) => Start { origin, normals: None },
            Self::Surface(points) => {
                let SurfacePoint { position, normal, geometric_normal } = points[turn % points.len()];
                Start { origin: position + geometric_normal * offset_m, normals: Some([normal, geometric_normal]) }
            }
        }
    }
}

impl Start {
    /// Cosine of a direction with the shading normal; 0 in the open, where none counts more than another.
    pub(super) fn cosine(&self, dir: Vec3) -> f32 {
        self.normals.map_or(0.0, |[shading, _]| dir.dot(shading))
    }

    /// Whether a direction leaves the surface; in the open there is no horizon.
    pub(super) fn is_above(&self, dir: Vec3) -> bool {
        self.normals.is_none_or(|[_, geometric]| dir.dot(geometric) > 0.0)
    }
}
