//! A grid of probes that can follow something: a circular buffer in three dimensions.
//!
//! Probes keep their slots in memory while the window moves by whole cells; only the plane that falls behind is given to the new one in
//! front (sec. 7.2, Fig. 14).

use crate::ProbeGrid;
use glam::{IVec3, UVec3, Vec3};

/// A grid whose probes have slots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The grid where it began.
    first: ProbeGrid,
    /// Cells by which it has moved. Its remainder by the size is the paper's phase offset.
    moved: IVec3,
}

impl Window {
    /// At the place of a grid.
    pub fn new(grid: ProbeGrid) -> Self {
        Self { first: grid, moved: IVec3::ZERO }
    }

    /// Around a point.
    pub fn around(center: Vec3, spacing: Vec3, size: UVec3) -> Self {
        Self::new(ProbeGrid { low: center - spacing * (size - 1).as_vec3() * 0.5, spacing, size })
    }

    /// The grid where it is now.
    pub fn grid(&self) -> ProbeGrid {
        ProbeGrid { low: self.position(UVec3::ZERO), ..self.first }
    }

    /// Where a probe of the grid stands, metres: to the last bit the same for as long as it keeps its slot.
    pub fn position(&self, at: UVec3) -> Vec3 {
        self.first.low + self.first.spacing * (at.as_ivec3() + self.moved).as_vec3()
    }

    /// Its middle, metres.
    pub fn center(&self) -> Vec3 {
        self.grid().low + self.first.width() * 0.5
    }

    /// Place in memory of a probe of the grid.
    pub fn slot(&self, at: UVec3) -> usize {
        let turned = (at.as_ivec3() + self.moved).rem_euclid(self.first.size.as_ivec3()).as_uvec3();
        self.grid().index(turned)
    }

    /// Probe of the grid at a place in memory.
    pub fn at(&self, slot: usize) -> UVec3 {
        let turned = self.grid().at(slot).as_ivec3();
        (turned - self.moved).rem_euclid(self.first.size.as_ivec3()).as_uvec3()
    }

    /// Follows a point: while it is farther from the middle than a spacing along an axis, the plane farthest behind leapfrogs to the
    /// front. Slots of the planes that are new, each once, in rising order.
    pub fn follow(&mut self, point: Vec3) -> Vec<usize> {
        let before = self.moved;
        for axis in 0..3 {
            // Cells beyond the first, rounded up to whole ones.
            let off = (point[axis] - self.center()[axis]) / self.first.spacing[axis];
            self.moved[axis] += (off.abs() - 1.0).max(0.0).ceil().copysign(off) as i32;
        }
        let by = self.moved - before;
        let is_new = |slot: &usize| {
            let old = self.at(*slot).as_ivec3() + by;
            old.cmplt(IVec3::ZERO).any() || old.cmpge(self.first.size.as_ivec3()).any()
        };
        if by == IVec3::ZERO { Vec::new() } else { (0..self.grid().len()).filter(is_new).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window() -> Window {
        Window::around(Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 0.5, 2.0), UVec3::new(5, 4, 3))
    }

    #[test]
    fn slots_and_probes_are_one_to_one_wherever_the_window_is() {
        let mut window = window();
        for point in [Vec3::ZERO, Vec3::splat(30.0), Vec3::new(-7.0, 2.0, 1.0)] {
            window.follow(point);
            for slot in 0..window.grid().len() {
                assert_eq!(window.slot(window.at(slot)), slot);
            }
            // The middle is within a spacing of what it follows.
            let off = ((point - window.center()) / window.first.spacing).abs().max_element();
            assert!(off <= 1.0 + 1e-4, "{off}");
        }
    }

    #[test]
    fn one_plane_leapfrogs_and_the_rest_stays_in_place() {
        let mut window = window();
        let places = |window: &Window| -> Vec<Vec3> { (0..60).map(|slot| window.position(window.at(slot))).collect() };
        let before = places(&window);
        // Within a spacing nothing moves.
        assert!(window.follow(window.center() + Vec3::new(0.9, -0.4, 1.9)).is_empty());
        assert_eq!(places(&window), before);
        let fresh = window.follow(window.center() + Vec3::new(1.1, 0.0, 0.0));
        assert_eq!(fresh.len(), 4 * 3);
        for (slot, (old, new)) in before.iter().zip(places(&window)).enumerate() {
            // What was farthest behind, at x = -1, is now in front, 5 cells on.
            let leaps = fresh.contains(&slot);
            assert_eq!(leaps, old.x == -1.0);
            assert_eq!(new - old, if leaps { Vec3::X * 5.0 } else { Vec3::ZERO });
        }
        // And back along it.
        assert_eq!(window.follow(window.center() - Vec3::new(1.1, 0.0, 0.0)), fresh);
        assert_eq!(places(&window), before);
    }

    #[test]
    fn a_jump_renews_all_probes_once() {
        let mut window = window();
        assert_eq!(window.follow(Vec3::splat(1e3)).len(), 60);
    }
}
