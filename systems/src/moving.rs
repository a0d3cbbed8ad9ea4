//! Things that move, as systems are told of them.

use glam::Vec3;
use localprt_scenes::Scene;

/// A box that holds something that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// Lowest corner, metres.
    pub low: Vec3,
    /// Highest corner, metres.
    pub high: Vec3,
}

/// Boxes of what moves: the meshes after the first `n_static`, metres.
pub fn moved(scene: &Scene, n_static: usize) -> Vec<Object> {
    let of_mesh = |mesh: &localprt_scenes::Mesh| {
        let corners = || mesh.positions.iter().copied();
        Some(Object { low: corners().reduce(Vec3::min)?, high: corners().reduce(Vec3::max)? })
    };
    scene.meshes.iter().skip(n_static).filter_map(of_mesh).collect()
}

impl Object {
    /// Whether a point is in the box when it is larger by a margin on every side.
    pub fn holds(&self, point: Vec3, margin: Vec3) -> bool {
        (self.low - margin).cmple(point).all() && point.cmple(self.high + margin).all()
    }

    /// Whether two boxes have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}
