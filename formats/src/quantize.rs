//! Narrowing of numbers for storage. Each function states its error bound.

use half::f16;

/// A number that f16 cannot hold.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("value {value} at {index} does not fit f16 (largest magnitude {largest}); look for a degenerate cluster", largest = f16::MAX)]
pub struct OutOfRange {
    /// Place in the slice; 0 for a single value.
    pub index: usize,
    /// The value.
    pub value: f32,
}

/// Nearest f16, ties to even. For a finite result `|q - v| <= max(2^-11 |v|, 2^-25)`.
///
/// # Errors
/// If the value is not finite or rounds beyond 65504. Nothing is clamped: a clamped transport weight would lose light
/// without anyone noticing.
pub fn to_f16(value: f32) -> Result<f16, OutOfRange> {
    let rounded = f16::from_f32(value);
    if rounded.is_finite() { Ok(rounded) } else { Err(OutOfRange { index: 0, value }) }
}

/// [`to_f16`] of every value, in order.
///
/// # Errors
/// As [`to_f16`], with the place of the first value that does not fit.
pub fn to_f16_block(values: &[f32]) -> Result<Vec<f16>, OutOfRange> {
    let convert = |(index, value): (usize, &f32)| to_f16(*value).map_err(|error| OutOfRange { index, ..error });
    values.iter().enumerate().map(convert).collect()
}

/// Nearest f16 of a distance in metres; what is beyond its range, 65520 m and more, becomes infinity. Below that the error
/// is at most `max(2^-11 d, 2^-25)`. NaN and negative distances become 0.
pub fn distance_to_f16(distance_m: f32) -> f16 {
    f16::from_f32(distance_m.max(0.0) + 0.0)
}

/// A lightmap position as two unorm16, u in the low half. In 0..=1 the error is at most 2^-17 per axis (half of 1/65535,
/// and f32 rounding); values outside are clamped, because interpolation leaves 0..=1 by rounding; NaN becomes 0.
pub fn pack_uv(uv: [f32; 2]) -> u32 {
    // f64 makes the product exact enough to round once; `as` saturates and maps NaN to 0.
    let [u, v] = uv.map(|value| (f64::from(value) * 65535.0).round().clamp(0.0, 65535.0) as u32);
    u | v << 16
}

/// The position that [`pack_uv`] stored: each half over 65535, error at most 2^-24 relative.
pub fn unpack_uv(packed: u32) -> [f32; 2] {
    [(packed & 0xffff) as f32 / 65535.0, (packed >> 16) as f32 / 65535.0]
}

/// Weight of a link of near light by its code, two's complement: `scale (code / 127)^2`, with the sign of the code.
///
/// For a weight of size `|w| <= scale` the nearest code is off by at most `sqrt(scale |w|) / 127 + scale / 254^2`.
pub fn near_weight(code: i8, scale: f32) -> f32 {
    let root = f32::from(code) / 127.0;
    scale * root * root.abs()
}

/// The code of a weight of at most `scale`: 0 where that is 0.
pub fn near_code(weight: f32, scale: f32) -> i8 {
    if scale <= 0.0 {
        return 0;
    }
    let root = (weight.abs() / scale).sqrt().min(1.0);
    (127.0 * root).round().copysign(weight) as i8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f16_error_stays_within_its_bound() {
        let mut value = 1e-9f32;
        while value < 65000.0 {
            for signed in [value, -value] {
                let error = (to_f16(signed).unwrap().to_f32() - signed).abs();
                assert!(error <= (value * 2f32.powi(-11)).max(2f32.powi(-25)), "{signed}: {error}");
            }
            value *= 1.00037;
        }
        assert_eq!(to_f16(0.0).unwrap().to_bits(), 0);
    }

    #[test]
    fn f16_refuses_what_it_cannot_hold_instead_of_clamping() {
        assert_eq!(to_f16(65504.0).unwrap(), f16::MAX);
        // 65520 is the first number that rounds to infinity.
        assert!(to_f16(65519.0).is_ok());
        for value in [65520.0, -65520.0, f32::MAX, f32::INFINITY, f32::NAN] {
            assert!(to_f16(value).is_err(), "{value}");
        }
        let error = to_f16_block(&[1.0, 2.0, 1e6]).unwrap_err();
        assert_eq!((error.index, error.value), (2, 1e6));
        assert_eq!(to_f16_block(&[0.5, -2.0]).unwrap(), [f16::from_f32(0.5), f16::from_f32(-2.0)]);
    }

    #[test]
    fn distances_beyond_the_range_are_infinite() {
        let stored = |distance_m| distance_to_f16(distance_m).to_bits();
        assert_eq!([65520.0, f32::MAX, f32::INFINITY].map(stored), [f16::INFINITY.to_bits(); 3]);
        assert_eq!([65519.0, 2.5].map(stored), [f16::MAX.to_bits(), f16::from_f32(2.5).to_bits()]);
        assert_eq!([0.0, -0.0, -1.0, f32::NAN].map(stored), [0; 4]);
    }

    #[test]
    fn packed_positions_return_within_half_a_step() {
        for i in 0..=20_000u32 {
            let uv = [i as f32 / 20_000.0, 1.0 - i as f32 / 30_000.0];
            let back = unpack_uv(pack_uv(uv));
            for axis in 0..2 {
                assert!((back[axis] - uv[axis]).abs() <= 2f32.powi(-17), "{uv:?} {back:?}");
            }
        }
        assert_eq!(pack_uv([1.0, 0.0]), 0xffff);
        assert_eq!(pack_uv([0.0, 1.0]), 0xffff_0000);
        assert_eq!(pack_uv([-1e-6, 1.000_001]), 0xffff_0000);
        assert_eq!(pack_uv([f32::NAN, f32::INFINITY]), 0xffff_0000);
        assert_eq!(unpack_uv(u32::MAX), [1.0, 1.0]);
    }
}
