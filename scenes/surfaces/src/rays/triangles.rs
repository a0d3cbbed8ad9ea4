//! The watertight triangle test, of one triangle and of a block of them.
//!
//! After Woop, Benthin and Wald 2013: edge functions in f32, again in f64 where one vanishes. Blocks do the same arithmetic in every lane, so
//! that what they let through is what the test of one triangle decides, to the last bit, whatever the processor.

use super::TriangleHit;
use glam::Vec3;

/// Triangles of a block.
pub(super) const LANES: usize = 4;
/// In the number of a triangle of a block: hits must be confirmed by the caller (alpha masks).
const MASKED: u32 = 1 << 31;

/// A triangle as it is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corners: [Vec3; 3],
    /// Index given at the build, below 2^31.
    pub index: u32,
    /// Whether hits must be confirmed by the caller.
    pub masked: bool,
}

/// Up to [`LANES`] triangles side by side.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct TriangleBlock {
    /// `[corner][axis][lane]`.
    pub corners: [[[f32; LANES]; 3]; 3],
    /// Index and [`MASKED`].
    numbers: [u32; LANES],
}

impl TriangleBlock {
    /// No triangles: what is no number is met by nothing.
    pub const EMPTY: Self = Self { corners: [[[f32::NAN; LANES]; 3]; 3], numbers: [u32::MAX; LANES] };

    pub fn set(&mut self, lane: usize, triangle: &Triangle) {
        for (own, corner) in self.corners.iter_mut().zip(triangle.corners) {
            for (axis, value) in own.iter_mut().zip(corner.to_array()) {
                axis[lane] = value;
            }
        }
        self.numbers[lane] = triangle.index | if triangle.masked { MASKED } else { 0 };
    }

    /// Whether hits must be confirmed by the caller.
    pub fn is_masked(&self, lane: usize) -> bool {
        self.numbers[lane] & MASKED != 0
    }
}

/// Per-ray constants of the test: axes so that the ray's largest component is z, and the shear that turns it into the z axis.
pub(super) struct Shear {
    pub origin: Vec3,
    pub axes: [usize; 3],
    pub shear: [f32; 3],
}

impl Shear {
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        let size = dir.abs();
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if dir[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        Self { origin, axes: [x, y, z], shear: [dir[x] / dir[z], dir[y] / dir[z], 1.0 / dir[z]] }
    }

    /// Lanes of a block whose triangles the line of the ray may meet, a bit each: those with edge functions of one sign, zeros among
    /// them.
    #[inline(always)]
    pub fn candidates(&self, block: &TriangleBlock) -> u32 {
        let mut found = 0;
        for lane in 0..LANES {
            let [[ax, ay], [bx, by], [cx, cy]] = self.sheared(block, lane);
            let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
            let above = (u >= 0.0) & (v >= 0.0) & (w >= 0.0);
            let below = (u <= 0.0) & (v <= 0.0) & (w <= 0.0);
            found |= u32::from(above | below) << lane;
        }
        found
    }

    /// The corners of a lane's triangle across the ray.
    #[inline(always)]
    fn sheared(&self, block: &TriangleBlock, lane: usize) -> [[f32; 2]; 3] {
        let [x, y, z] = self.axes;
        let [shear_x, shear_y, _] = self.shear;
        let mut sheared = [[0.0; 2]; 3];
        for (corner, sheared) in block.corners.iter().zip(&mut sheared) {
            let along = corner[z][lane] - self.origin[z];
            sheared[0] = (corner[x][lane] - self.origin[x]) - shear_x * along;
            sheared[1] = (corner[y][lane] - self.origin[y]) - shear_y * along;
        }
        sheared
    }

    /// Hit of a lane's triangle with `0 < t < t_max`, from either side.
    #[inline]
    pub fn intersect(&self, block: &TriangleBlock, lane: usize, t_max: f32) -> Option<TriangleHit> {
        let [[ax, ay], [bx, by], [cx, cy]] = self.sheared(block, lane);
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let product = |a: f32, b: f32| f64::from(a) * f64::from(b);
            u = (product(cx, by) - product(cy, bx)) as f32;
            v = (product(ax, cy) - product(ay, cx)) as f32;
            w = (product(bx, ay) - product(by, ax)) as f32;
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let z = self.axes[2];
        let [a, b, c] = &block.corners;
        let (az, bz, cz) = (a[z][lane] - self.origin[z], b[z][lane] - self.origin[z], c[z][lane] - self.origin[z]);
        let distance = (u * az + v * bz + w * cz) * self.shear[2];
        let t = distance / determinant;
        if !(t > 0.0 && t < t_max) {
            return None;
        }
        let inverse = 1.0 / determinant;
        Some(TriangleHit {
            t,
            triangle: block.numbers[lane] & !MASKED,
            barycentrics: Vec3::new(u * inverse, v * inverse, w * inverse),
            front: determinant > 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(target_arch = "x86_64")]
    use crate::rays::wide::Tests;
    use localprt_formats::directions::{counter_uniform, spherical_fibonacci};

    /// Corners on a coarse lattice, so that edge functions vanish and cancel often.
    #[test]
    fn a_block_lets_through_what_the_test_of_one_meets() {
        let mut met = 0;
        for number in 0..20_000u64 {
            let random = |k| counter_uniform(3, number, k) as f32;
            let corner = |k: u64| Vec3::from([0, 1, 2].map(|axis| (random(3 * k + axis) * 5.0).floor()));
            let mut block = TriangleBlock::EMPTY;
            let triangles: [[Vec3; 3]; LANES] =
                std::array::from_fn(|lane| [0, 1, 2].map(|at| corner(3 * lane as u64 + at)));
            for (lane, corners) in triangles.into_iter().enumerate() {
                block.set(lane, &Triangle { corners, index: lane as u32, masked: lane == 1 });
            }
            let origin = corner(50) - 0.5;
            let dir = match number % 3 {
                0 => Vec3::AXES[(number / 3 % 3) as usize],
                1 => (triangles[0][0] - origin).normalize(),
                _ => Vec3::from(spherical_fibonacci((number % 997) as u32, 997)),
            };
            let shear = Shear::new(origin, dir);
            let candidates = shear.candidates(&block);
            #[cfg(target_arch = "x86_64")]
            if let Some(avx2) = crate::rays::avx2::Avx2::of_this_processor() {
                assert_eq!(avx2.candidates(&shear, &block), candidates, "{number}");
            }
            for lane in 0..LANES {
                if let Some(hit) = shear.intersect(&block, lane, f32::INFINITY) {
                    met += 1;
                    assert_ne!(candidates & 1 << lane, 0, "{number} {lane}");
                    assert_eq!((hit.triangle, block.is_masked(lane)), (lane as u32, lane == 1));
                }
            }
        }
        assert!(met > 1000, "{met}");
    }
}
