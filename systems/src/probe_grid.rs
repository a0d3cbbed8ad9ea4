//! Probes at the vertices of a regular grid, and the cage of eight around a point.

use glam::{UVec3, Vec3};

/// A regular grid of probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeGrid {
    /// The first probe, metres.
    pub low: Vec3,
    /// From a probe to the next along each axis, metres.
    pub spacing: Vec3,
    /// Probes along each axis, at least 2.
    pub size: UVec3,
}

/// The eight probes around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cage {
    /// The probe at its lowest corner.
    pub base: UVec3,
    /// How far the point is on the way to the next probe along each axis, 0 to 1.
    pub along: Vec3,
}

impl ProbeGrid {
    /// Over a box, with not more than so many probes (but 8), about as far apart along each axis; the outermost stand on its faces.
    pub fn over(bounds: (Vec3, Vec3), probes: usize) -> Self {
        Self::within(bounds, probes, 0.0)
    }

    /// The same with the outermost probes `inset` spacings within the box: at 0.5 each stands in the middle of its part. On the faces of a
    /// box probes stand in the walls of a room.
    pub fn within((low, high): (Vec3, Vec3), probes: usize, inset: f32) -> Self {
        let extent = (high - low).max(Vec3::splat(1e-3 * (high - low).max_element().max(1e-3)));
        // n probes and what is left beside them take n - 1 + 2 inset spacings.
        let beside = 2.0 * inset - 1.0;
        let count = |spacing: f32| (extent / spacing - beside).round().max(Vec3::splat(2.0)).as_uvec3();
        let total = |size: UVec3| size.as_u64vec3().element_product();
        // From the volume of a probe up, until they are few enough.
        let mut spacing = (extent.element_product() / probes.max(8) as f32).cbrt().min(extent.max_element()) * 0.5;
        while total(count(spacing)) > probes.max(8) as u64 {
            spacing *= 1.01;
        }
        let size = count(spacing);
        let spacing = extent / (size.as_vec3() + beside);
        Self { low: low + spacing * inset, spacing, size }
    }

    /// From the first probe to the last along each axis, metres.
    pub fn width(&self) -> Vec3 {
        self.spacing * (self.size - 1).as_vec3()
    }

    /// Number of probes.
    pub fn len(&self) -> usize {
        self.size.as_u64vec3().element_product() as usize
    }

    /// True without probes; there are always some.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of a probe; x runs fastest.
    pub fn index(&self, at: UVec3) -> usize {
        ((at.z * self.size.y + at.y) * self.size.x + at.x) as usize
    }

    /// The probe of a number.
    pub fn at(&self, index: usize) -> UVec3 {
        let index = index as u32;
        UVec3::new(index % self.size.x, index / self.size.x % self.size.y, index / (self.size.x * self.size.y))
    }

    /// Where a probe of the regular grid stands, metres.
    pub fn position(&self, at: UVec3) -> Vec3 {
        self.low + self.spacing * at.as_vec3()
    }

    /// The cage of a point; of one outside, that at the border.
    pub fn cage(&self, point: Vec3) -> Cage {
        let place = (point - self.low) / self.spacing;
        let last = (self.size - 2).as_vec3();
        let base = place.floor().clamp(Vec3::ZERO, last);
        Cage { base: base.as_uvec3(), along: (place - base).clamp(Vec3::ZERO, Vec3::ONE) }
    }
}

impl Cage {
    /// Its probes and their trilinear weights, bit k of the number being a step along axis k.
    pub fn probes(&self) -> [(UVec3, f32); 8] {
        std::array::from_fn(|corner| {
            let step = UVec3::new(corner as u32 & 1, corner as u32 >> 1 & 1, corner as u32 >> 2 & 1);
            let weights = self.along * step.as_vec3() + (1.0 - self.along) * (1.0 - step.as_vec3());
            (self.base + step, weights.element_product())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_fills_its_box_with_not_more_probes_than_allowed() {
        for (high, probes) in [(Vec3::ONE, 8), (Vec3::new(30.0, 12.0, 18.0), 600), (Vec3::new(100.0, 1.0, 1.0), 64)] {
            let grid = ProbeGrid::over((Vec3::ZERO, high), probes);
            // One more along each axis would be too many: of two they are 8/27 of that many then, of more a larger share.
            assert!(grid.len() <= probes && grid.len() * 27 >= probes * 8, "{grid:?}");
            assert!((grid.position(grid.size - 1) - high).abs().max_element() < 1e-4);
            for index in 0..grid.len() {
                assert_eq!(grid.index(grid.at(index)), index);
            }
        }
        // Flat and empty boxes have a grid.
        for high in [Vec3::new(1.0, 0.0, 1.0), Vec3::ZERO] {
            let grid = ProbeGrid::over((Vec3::ZERO, high), 100);
            assert!(grid.len() >= 8 && grid.spacing.min_element() > 0.0);
        }
    }

    #[test]
    fn every_probe_of_an_inset_grid_stands_for_an_equal_cell() {
        let (low, high) = (Vec3::new(-1.0, 0.0, 2.0), Vec3::new(7.0, 3.0, 6.0));
        for inset in [0.0, 0.5] {
            let grid = ProbeGrid::within((low, high), 300, inset);
            assert!(grid.len() <= 300);
            // As far apart along each axis as whole numbers allow: 8 by 3 by 4 m are 15 by 5 or 6 by 7 or 8 probes.
            assert!(grid.spacing.max_element() < 1.5 * grid.spacing.min_element(), "{grid:?}");
            // A few roundings of coordinates up to 7.
            assert!((grid.low - low - grid.spacing * inset).length() < 1e-5);
            assert!((high - grid.low - grid.width() - grid.spacing * inset).length() < 1e-5);
        }
    }

    #[test]
    fn weights_of_a_cage_bring_back_the_point() {
        let grid = ProbeGrid::over((Vec3::new(-1.0, 2.0, 0.5), Vec3::new(3.0, 5.0, 4.0)), 200);
        for point in [Vec3::new(0.1, 3.3, 1.7), Vec3::new(-1.0, 2.0, 0.5), Vec3::new(3.0, 5.0, 4.0)] {
            let probes = grid.cage(point).probes();
            let sum: Vec3 = probes.iter().map(|&(at, weight)| grid.position(at) * weight).sum();
            assert!((sum - point).length() < 1e-5, "{sum} {point}");
        }
        // Outside: the nearest of the border.
        let probes = grid.cage(Vec3::splat(-9.0)).probes();
        assert_eq!(probes.iter().map(|probe| probe.1).fold(0.0, f32::max), 1.0);
    }
}
