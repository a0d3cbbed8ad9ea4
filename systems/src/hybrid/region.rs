//! Where what moves acts: boxes of what moves, the box around them, and the share of the change in it.

use crate::{Object, ProbeGrid};
use glam::Vec3;

/// The box in which the change is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    low: Vec3,
    high: Vec3,
    /// Lowest and highest corner of all that there is.
    bounds: (Vec3, Vec3),
    /// Size of a window around it, the same wherever it goes.
    pub extent: Vec3,
}

impl Region {
    /// Around objects, grown by a reach but not beyond the bounds of what stands still and of themselves; `None` without objects.
    pub fn around(objects: &[Object], (low, high): (Vec3, Vec3), reach_m: f32) -> Option<Self> {
        let first = *objects.first()?;
        let union = objects
            .iter()
            .fold(first, |all, object| Object { low: all.low.min(object.low), high: all.high.max(object.high) });
        let bounds = (low.min(union.low), high.max(union.high));
        Some(Self {
            low: (union.low - reach_m).max(bounds.0),
            high: (union.high + reach_m).min(bounds.1),
            bounds,
            extent: (union.high - union.low + 2.0 * reach_m).min(bounds.1 - bounds.0),
        })
    }

    /// Middle of the window: within the bounds as far as it fits.
    pub fn center(&self) -> Vec3 {
        let half = self.extent * 0.5;
        ((self.low + self.high) * 0.5).max(self.bounds.0 + half).min(self.bounds.1 - half)
    }

    /// Probes for it, not more than so many, in the middles of equal cells.
    pub fn grid(&self, probes: usize) -> ProbeGrid {
        let (center, half) = (self.center(), self.extent * 0.5);
        ProbeGrid::within((center - half, center + half), probes, 0.5)
    }

    /// Share of the change at a point: 1 inside, falling to 0 over the last cell before a side. Sides at the bounds have nothing
    /// beyond, and let it not fall.
    pub fn share(&self, point: Vec3, cell: Vec3, fades: bool) -> f32 {
        let mut share = 1.0f32;
        for axis in 0..3 {
            let sides = [
                (point[axis] - self.low[axis], self.low[axis] <= self.bounds.0[axis]),
                (self.high[axis] - point[axis], self.high[axis] >= self.bounds.1[axis]),
            ];
            for (within, is_bound) in sides {
                share *= match () {
                    () if is_bound => 1.0,
                    () if fades => (within / cell[axis]).clamp(0.0, 1.0),
                    () => f32::from(within > 0.0),
                };
            }
        }
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: (Vec3, Vec3) = (Vec3::ZERO, Vec3::new(20.0, 3.0, 20.0));

    fn region(x: f32) -> Region {
        let object = Object { low: Vec3::new(x, 0.0, 9.0), high: Vec3::new(x + 1.0, 2.0, 10.0) };
        Region::around(&[object], BOUNDS, 4.0).expect("an object")
    }

    #[test]
    fn the_change_falls_to_nothing_over_the_last_cell_but_not_at_walls() {
        let region = region(10.0);
        let share = |x: f32, y: f32| region.share(Vec3::new(x, y, 9.5), Vec3::splat(2.0), true);
        // From x = 6 to 15; floor and ceiling are bounds.
        assert_eq!([share(10.0, 0.0), share(10.0, 3.0), share(8.0, 1.0)], [1.0; 3]);
        assert_eq!([share(6.0, 1.0), share(7.0, 1.0), share(14.5, 1.0), share(19.0, 1.0)], [0.0, 0.5, 0.25, 0.0]);
        let step = |x: f32| region.share(Vec3::new(x, 1.0, 9.5), Vec3::splat(2.0), false);
        assert_eq!([step(5.999), step(6.001)], [0.0, 1.0]);
    }

    #[test]
    fn a_window_has_one_size_wherever_things_go() {
        for x in [0.0, 2.0, 10.0, 19.0] {
            let region = region(x);
            // 1 m and 4 m to both sides; the height is that of all there is.
            assert!((region.extent - Vec3::new(9.0, 3.0, 9.0)).abs().max_element() < 1e-5, "{region:?}");
            let (low, high) = (region.center() - region.extent * 0.5, region.center() + region.extent * 0.5);
            assert!(low.cmpge(BOUNDS.0 - 1e-5).all() && high.cmple(BOUNDS.1 + 1e-5).all());
        }
        assert_eq!(Region::around(&[], BOUNDS, 4.0), None);
    }
}
