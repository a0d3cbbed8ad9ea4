//! Rays as they are traced: counted, and with the cells that they cross.

use super::RayCounts;
use crate::{
    cells::{CellGrid, Crossings},
    rays::{OccluderHint, RayCaster, SurfaceHit},
};
use glam::Vec3;

/// Rays traced so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Traced {
    pub counts: RayCounts,
    /// Cells that they crossed, if anybody wants to know.
    pub crossed: Option<Crossings>,
}

impl Traced {
    /// None yet; with the cells of a grid.
    pub fn new(cells: Option<CellGrid>) -> Self {
        Self { counts: RayCounts::default(), crossed: cells.map(Crossings::new) }
    }

    /// [`RayCaster::closest_hit`].
    pub fn closest_hit(&mut self, caster: &RayCaster<'_>, origin: Vec3, dir: Vec3) -> Option<SurfaceHit> {
        let hit = caster.closest_hit(origin, dir);
        self.gather(origin, dir, hit.map_or(f32::INFINITY, |hit| hit.t));
        hit
    }

    /// [`RayCaster::escapes_hinted`].
    pub fn escapes(&mut self, caster: &RayCaster<'_>, origin: Vec3, dir: Vec3, hint: &mut OccluderHint) -> bool {
        self.gather(origin, dir, f32::INFINITY);
        caster.escapes_hinted(origin, dir, hint)
    }

    /// [`RayCaster::visible_hinted`].
    pub fn visible(&mut self, caster: &RayCaster<'_>, from: Vec3, to: Vec3, hint: &mut OccluderHint) -> bool {
        self.counts.visibility += 1;
        if let Some(crossed) = &mut self.crossed {
            // Of its two ends the probe is the one that it shares with others.
            crossed.cross(to, from - to, 1.0);
        }
        caster.visible_hinted(from, to, hint)
    }

    /// A gather ray that was traced elsewhere and whose result depends on nothing beyond a length.
    pub fn gather(&mut self, origin: Vec3, dir: Vec3, t: f32) {
        self.counts.gather += 1;
        if let Some(crossed) = &mut self.crossed {
            crossed.cross(origin, dir, t);
        }
    }
}
