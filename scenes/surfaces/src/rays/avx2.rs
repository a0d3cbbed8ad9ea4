//! Tests of eight boxes and of a block of triangles with AVX2, and code compiled for it; this crate's only `unsafe`.

#![allow(unsafe_code)]

use super::triangles::{LANES, Shear, TriangleBlock};
use super::wide::{FAR_SIDE, Node, Slabs, Tests, WIDTH};
use std::arch::x86_64::{
    __m128, _CMP_GE_OQ, _CMP_LE_OQ, _mm_and_ps, _mm_cmp_ps, _mm_loadu_ps, _mm_movemask_ps, _mm_mul_ps, _mm_or_ps,
    _mm_set1_ps, _mm_setzero_ps, _mm_sub_ps, _mm256_cmp_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_min_ps,
    _mm256_movemask_ps, _mm256_mul_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps, _mm256_sub_ps,
};

/// Proof that this processor has AVX2 and what comes with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2(());

impl Avx2 {
    pub fn of_this_processor() -> Option<Self> {
        let has_all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        has_all.then_some(Self(()))
    }

    /// Runs what is inlined into it as code for such processors.
    #[inline]
    pub fn run<T>(self, work: impl FnOnce() -> T) -> T {
        // SAFETY: there is no `Avx2` where the processor lacks a feature of `compiled`.
        unsafe { compiled(work) }
    }
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn compiled<T>(work: impl FnOnce() -> T) -> T {
    work()
}

impl Tests for Avx2 {
    #[inline(always)]
    fn boxes(self, slabs: &Slabs, node: &Node, reach: f32) -> ([f32; WIDTH], u32) {
        // SAFETY: there is no `Avx2` on a processor without.
        unsafe { boxes(slabs, node, reach) }
    }

    #[inline(always)]
    fn candidates(self, shear: &Shear, block: &TriangleBlock) -> u32 {
        // SAFETY: as above.
        unsafe { candidates(shear, block) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn boxes(slabs: &Slabs, node: &Node, reach: f32) -> ([f32; WIDTH], u32) {
    // SAFETY: reads of whole arrays.
    let load = |values: &[f32; WIDTH]| unsafe { _mm256_loadu_ps(values.as_ptr()) };
    let mut near = _mm256_setzero_ps();
    let mut far = _mm256_set1_ps(f32::INFINITY);
    for axis in 0..3 {
        let origin = _mm256_set1_ps(slabs.origin[axis]);
        let inverse = _mm256_set1_ps(slabs.inverse[axis]);
        let first = load(&node.bounds[axis][slabs.first[axis]]);
        let last = load(&node.bounds[axis][1 - slabs.first[axis]]);
        near = _mm256_max_ps(_mm256_mul_ps(_mm256_sub_ps(first, origin), inverse), near);
        far = _mm256_min_ps(_mm256_mul_ps(_mm256_sub_ps(last, origin), inverse), far);
    }
    let far = _mm256_min_ps(_mm256_mul_ps(far, _mm256_set1_ps(FAR_SIDE)), _mm256_set1_ps(reach));
    let met = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32;
    let mut nears = [0.0; WIDTH];
    // SAFETY: writes a whole array.
    unsafe { _mm256_storeu_ps(nears.as_mut_ptr(), near) };
    (nears, met)
}

#[inline]
#[target_feature(enable = "avx2")]
fn candidates(shear: &Shear, block: &TriangleBlock) -> u32 {
    // SAFETY: reads of whole arrays.
    let load = |values: &[f32; LANES]| unsafe { _mm_loadu_ps(values.as_ptr()) };
    let [x, y, z] = shear.axes;
    let origin = [x, y, z].map(|axis| _mm_set1_ps(shear.origin[axis]));
    let (shear_x, shear_y) = (_mm_set1_ps(shear.shear[0]), _mm_set1_ps(shear.shear[1]));
    let sheared = |corner: &[[f32; LANES]; 3]| {
        let along = _mm_sub_ps(load(&corner[z]), origin[2]);
        let across = |axis: usize, origin: __m128, shear: __m128| {
            _mm_sub_ps(_mm_sub_ps(load(&corner[axis]), origin), _mm_mul_ps(shear, along))
        };
        [across(x, origin[0], shear_x), across(y, origin[1], shear_y)]
    };
    let [a, b, c] = &block.corners;
    let ([ax, ay], [bx, by], [cx, cy]) = (sheared(a), sheared(b), sheared(c));
    let edge = |px: __m128, qy: __m128, py: __m128, qx: __m128| _mm_sub_ps(_mm_mul_ps(px, qy), _mm_mul_ps(py, qx));
    let (u, v, w) = (edge(cx, by, cy, bx), edge(ax, cy, ay, cx), edge(bx, ay, by, ax));
    let zero = _mm_setzero_ps();
    let above = |value: __m128| _mm_cmp_ps::<_CMP_GE_OQ>(value, zero);
    let below = |value: __m128| _mm_cmp_ps::<_CMP_LE_OQ>(value, zero);
    let all_above = _mm_and_ps(_mm_and_ps(above(u), above(v)), above(w));
    let all_below = _mm_and_ps(_mm_and_ps(below(u), below(v)), below(w));
    _mm_movemask_ps(_mm_or_ps(all_above, all_below)) as u32
}
