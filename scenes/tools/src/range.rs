//! Ranges of numbers that end at round ones.

/// The range from 0 to a percentile (0..=100) of the finite values, rounded up to 1, 2 or 5 times a power of ten; 0 to 1
/// if that is not positive.
pub fn nice_range(values: &[f32], percentile: f32) -> [f32; 2] {
    [0.0, top(values.iter().copied(), percentile)]
}

/// As [`nice_range`] of the magnitudes, to both sides of 0.
pub fn nice_signed_range(values: &[f32], percentile: f32) -> [f32; 2] {
    let top = top(values.iter().map(|value| value.abs()), percentile);
    [-top, top]
}

fn top(values: impl Iterator<Item = f32>, percentile: f32) -> f32 {
    let mut finite: Vec<f32> = values.filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return 1.0;
    }
    let rank = (percentile.clamp(0.0, 100.0) / 100.0 * (finite.len() - 1) as f32).ceil() as usize;
    let at = rank.min(finite.len() - 1);
    let (_, &mut value, _) = finite.select_nth_unstable_by(at, f32::total_cmp);
    // Smaller values cannot be told from zero by the eye that reads the number.
    if value > 1e-30 { (round_up(value.into()) as f32).min(f32::MAX) } else { 1.0 }
}

/// The next number of the form 1, 2 or 5 times a power of ten that is not smaller; `value` is positive.
pub fn round_up(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    // Narrower than any step, wider than the rounding of an f32: 0.2 stays 0.2.
    let slack = 1.0 + 1e-6;
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| value <= factor * power * slack).unwrap_or(10.0);
    let rounded = factor * power;
    // Through decimal digits, since a negative power of ten is seldom exact.
    format!("{rounded:.0e}").parse().unwrap_or(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_end_at_round_numbers() {
        let values: Vec<f32> = (0..=1000).map(|value| value as f32 / 1000.0).chain([f32::NAN, f32::INFINITY]).collect();
        assert_eq!(nice_range(&values, 99.0), [0.0, 1.0]);
        assert_eq!(nice_range(&values, 15.0), [0.0, 0.2]);
        assert_eq!(nice_range(&[0.02; 3], 100.0), [0.0, 0.02]);
        assert_eq!(nice_range(&[], 99.0), [0.0, 1.0]);
        assert_eq!(nice_range(&[0.0, -3.0], 99.0), [0.0, 1.0]);
        assert_eq!(nice_signed_range(&[0.1, -3.0], 100.0), [-5.0, 5.0]);
    }

    #[test]
    fn numbers_are_rounded_up_to_1_2_or_5() {
        assert_eq!([0.2, 0.21, 1.0, 7.3].map(round_up), [0.2, 0.5, 1.0, 10.0]);
        assert_eq!(round_up(f64::from(0.02_f32)), 0.02);
    }
}
