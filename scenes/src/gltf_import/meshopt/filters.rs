//! Filters: what the numbers of decoded attributes stand for. Appendix B.

/// Unit vectors by octahedral coordinates, of 8 or 16 bits.
pub(super) fn octahedral(bytes: &mut [u8], stride: usize) {
    each(bytes, stride, |[x, y, one, last], largest| {
        let (x, y) = (x as f32 / one as f32, y as f32 / one as f32);
        let z = 1.0 - x.abs() - y.abs();
        let fold = z.min(0.0);
        let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
        let length = (x * x + y * y + z * z).sqrt();
        let rounded = |value: f32| (value / length * largest as f32).round() as i32;
        [rounded(x), rounded(y), rounded(z), last]
    });
}

/// Unit quaternions by their three smaller components, of 16 bits.
pub(super) fn quaternion(bytes: &mut [u8]) {
    each(bytes, 8, |[x, y, z, last], largest| {
        let scale = std::f32::consts::FRAC_1_SQRT_2 / (last | 3) as f32;
        let [x, y, z] = [x, y, z].map(|value| value as f32 * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let mut turned = [0; 4];
        for (step, value) in [w, x, y, z].into_iter().enumerate() {
            turned[((last & 3) as usize + step) % 4] = (value * largest as f32).round() as i32;
        }
        turned
    });
}

/// Floats by a mantissa of 24 bits and an exponent of 8.
pub(super) fn exponential(bytes: &mut [u8]) {
    for word in bytes.chunks_exact_mut(4) {
        let packed = i32::from_le_bytes([word[0], word[1], word[2], word[3]]);
        let (exponent, mantissa) = (packed >> 24, packed << 8 >> 8);
        // Exact: 24 bits times a power of two that f64 holds.
        let value = (f64::from(mantissa) * 2f64.powi(exponent)) as f32;
        word.copy_from_slice(&value.to_le_bytes());
    }
}

/// Colors by YCoCg, of 8 or 16 bits.
pub(super) fn color(bytes: &mut [u8], stride: usize) {
    each(bytes, stride, |[y, co, cg, alpha], largest| {
        // As unsigned numbers luma and alpha reach twice what signed ones do.
        let whole = 2 * largest + 1;
        let (y, alpha) = (y & whole, alpha & whole);
        let scale = (2i32 << alpha.max(1).ilog2()) - 1;
        let opaque = alpha & scale >> 1;
        let values = [y + co - cg, y + cg, y - co - cg, opaque << 1 | opaque & 1];
        values.map(|value| (value as f32 * (whole as f32 / scale as f32)).round() as i32)
    });
}

/// Four signed numbers of each element, of 8 bits at a stride of 4 and of 16 at one of 8, with the largest that they can be.
fn each(bytes: &mut [u8], stride: usize, filter: impl Fn([i32; 4], i32) -> [i32; 4]) {
    for element in bytes.chunks_exact_mut(stride) {
        if stride == 4 {
            let values = filter(std::array::from_fn(|at| i32::from(element[at] as i8)), i32::from(i8::MAX));
            element.copy_from_slice(&values.map(|value| value as u8));
        } else {
            let number = |at: usize| i32::from(i16::from_le_bytes([element[2 * at], element[2 * at + 1]]));
            let values = filter(std::array::from_fn(number), i32::from(i16::MAX));
            for (place, value) in element.chunks_exact_mut(2).zip(values) {
                place.copy_from_slice(&(value as u16).to_le_bytes());
            }
        }
    }
}
