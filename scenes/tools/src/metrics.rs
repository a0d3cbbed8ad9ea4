//! Each metric beside its formula. All are over valid receivers, all finite.

use glam::{DVec3, Vec3};
use localprt_scenes::luminance;
use serde::Serialize;

/// Errors of one method against the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MethodError {
    /// `sqrt(mean((E - E_ref)^2)) / mean(E_ref)` over receivers and color bands.
    pub nrmse: f64,
    /// Median over receivers of `|E - E_ref| / max(E_ref, 0.05 mean E_ref)`, of luminance.
    pub median_relative: f64,
    /// 95th percentile of the same.
    pub p95_relative: f64,
    /// `mean(E - E_ref) / mean(E_ref)` over receivers and bands.
    pub bias: f64,
    /// Mean FLIP of the pictures taken with this indirect light, over the views.
    pub flip: f64,
    /// 99th percentile of the relative error.
    pub p99_relative: f64,
}

/// Luminance below this times the mean counts as this in relative errors.
const DARK: f64 = 0.05;

impl MethodError {
    /// Compares `[n_receivers]` irradiances; `flip` is left at 0. `None` where the reference is black altogether.
    pub fn of(found: &[Vec3], reference: &[Vec3]) -> Option<Self> {
        assert_eq!(found.len(), reference.len(), "as many values as references");
        let mean = mean(reference);
        let n = 3.0 * found.len() as f64;
        if mean <= 0.0 || mean.is_nan() {
            return None;
        }
        let pairs = || found.iter().zip(reference).map(|(found, reference)| found.as_dvec3() - reference.as_dvec3());
        let squares: f64 = pairs().map(|error| error.length_squared()).sum();
        let sum: f64 = pairs().map(|error| error.element_sum()).sum();
        let relative = relative_errors(found, reference);
        Some(Self {
            nrmse: (squares / n).sqrt() / mean,
            median_relative: percentile(&relative, 0.5),
            p95_relative: percentile(&relative, 0.95),
            p99_relative: percentile(&relative, 0.99),
            bias: sum / n / mean,
            flip: 0.0,
        })
    }
}

/// [`MethodError::nrmse`] without this share of the points, those of the largest squared error. The mean stays that of all
/// points. 0 where the reference is black altogether.
pub fn nrmse_without_worst(found: &[Vec3], reference: &[Vec3], share: f64) -> f64 {
    let pairs = found.iter().zip(reference);
    let mut squares: Vec<f64> =
        pairs.map(|(found, reference)| (found.as_dvec3() - reference.as_dvec3()).length_squared()).collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares.truncate(squares.len() - (share * squares.len() as f64) as usize);
    let mean = mean(reference);
    if mean <= 0.0 {
        return 0.0;
    }
    (squares.iter().sum::<f64>() / (3.0 * squares.len().max(1) as f64)).sqrt() / mean
}

/// Share of the points where `|E - E_ref|` is above this share of `mean(E_ref)`; luminance.
pub fn share_off(found: &[Vec3], reference: &[Vec3], share: f64) -> f64 {
    let n = reference.len().max(1) as f64;
    let mean = reference.iter().map(|&color| luminance(color)).sum::<f64>() / n;
    let error = |(found, reference): (&Vec3, &Vec3)| luminance(found.as_dvec3() - reference.as_dvec3()).abs();
    found.iter().zip(reference).filter(|&pair| error(pair) > share * mean).count() as f64 / n
}

/// `|E - E_ref| / max(E_ref, 0.05 mean E_ref)` of luminance, per receiver.
pub fn relative_errors(found: &[Vec3], reference: &[Vec3]) -> Vec<f64> {
    let brightness = |color: &Vec3| luminance(*color);
    let mean = reference.iter().map(brightness).sum::<f64>() / reference.len().max(1) as f64;
    found
        .iter()
        .zip(reference)
        .map(|(found, reference)| {
            let reference = brightness(reference);
            (brightness(found) - reference).abs() / reference.max(DARK * mean).max(f64::MIN_POSITIVE)
        })
        .collect()
}

/// Mean over receivers and bands.
pub fn mean(values: &[Vec3]) -> f64 {
    values.iter().map(|value| value.as_dvec3().element_sum()).sum::<f64>() / (3.0 * values.len().max(1) as f64)
}

/// `sqrt(mean of squares)` over receivers and bands.
pub fn rms(values: impl ExactSizeIterator<Item = DVec3>) -> f64 {
    let n = 3.0 * values.len().max(1) as f64;
    (values.map(|value| value.length_squared()).sum::<f64>() / n).sqrt()
}

/// Nearest rank: the smallest value that at least this share of all do not exceed. 0 of nothing.
pub fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Spearman's rank correlation, -1..=1; ties share their mean rank. `None` where one side is constant.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (a, b) = (ranks(a), ranks(b));
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(&b) {
        let (a, b) = (a - middle, b - middle);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    (aa > 0.0 && bb > 0.0).then(|| ab / (aa * bb).sqrt())
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for run in order.chunk_by(|&i, &j| values[i] == values[j]) {
        for &index in run {
            ranks[index] = before as f64 + (run.len() as f64 - 1.0) / 2.0;
        }
        before += run.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_follow_their_formulas() {
        let reference = [Vec3::splat(1.0), Vec3::splat(3.0)];
        let found = [Vec3::new(1.0, 1.0, 4.0), Vec3::splat(2.0)];
        let error = MethodError::of(&found, &reference).expect("light");
        // Errors 0 0 3, -1 -1 -1: squares sum to 12 over 6 values; mean 2.
        assert!((error.nrmse - 2.0f64.sqrt() / 2.0).abs() < 1e-12);
        assert!((error.bias - 0.0).abs() < 1e-12);
        // Luminances: 1 + 3 x 0.0722 against 1, and 2 against 3. Weights are f64, colors exact.
        assert!((error.median_relative - 3.0 * 0.0722).abs() < 1e-9);
        assert!((error.p95_relative - 1.0 / 3.0).abs() < 1e-9);
        assert_eq!(MethodError::of(&reference, &reference), Some(MethodError::default()));
        assert_eq!(MethodError::of(&found, &[Vec3::ZERO; 2]), None);
    }

    #[test]
    fn dark_receivers_are_measured_against_the_mean() {
        let reference = [Vec3::ZERO, Vec3::splat(2.0)];
        let found = [Vec3::splat(0.1), Vec3::splat(2.0)];
        // 0.1 / (0.05 x 1); f32 holds 0.1 to 2^-27.
        assert!((relative_errors(&found, &reference)[0] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_worst_percent_is_left_out_of_the_errors_but_not_of_the_mean() {
        // 200 points of mean 2, two of them off by 10, the others by 0.5.
        let reference = vec![Vec3::splat(2.0); 200];
        let found: Vec<Vec3> = (0..200).map(|i| Vec3::splat(if i % 100 == 7 { 12.0 } else { 2.5 })).collect();
        assert!((nrmse_without_worst(&found, &reference, 0.01) - 0.25).abs() < 1e-12);
        let all = MethodError::of(&found, &reference).expect("light").nrmse;
        assert!((nrmse_without_worst(&found, &reference, 0.0) - all).abs() < 1e-12 && all > 0.5, "{all}");
        // Less than a whole point is no point; the brightest points leave the errors and stay in the mean.
        assert_eq!(nrmse_without_worst(&found[..7], &reference[..7], 0.01), 0.25);
        let bright = [Vec3::splat(1.0), Vec3::splat(3.0)];
        assert!((nrmse_without_worst(&[Vec3::splat(1.5), Vec3::splat(9.0)], &bright, 0.5) - 0.25).abs() < 1e-12);
        assert_eq!(nrmse_without_worst(&found[..1], &[Vec3::ZERO], 0.01), 0.0);
    }

    #[test]
    fn points_are_off_by_shares_of_the_mean_and_not_of_their_own_light() {
        // The mean is 2: limits are 0.2 and 1.
        let reference = [Vec3::splat(0.25), Vec3::splat(3.75), Vec3::splat(2.0), Vec3::splat(2.0)];
        let found = [Vec3::splat(0.375), Vec3::splat(4.0), Vec3::splat(0.5), Vec3::splat(2.0)];
        assert_eq!([0.1, 0.5, 0.9].map(|share| share_off(&found, &reference, share)), [0.5, 0.25, 0.0]);
        assert_eq!(share_off(&[], &[], 0.1), 0.0);
    }

    #[test]
    fn percentiles_take_the_nearest_rank() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(
            (percentile(&values, 0.5), percentile(&values, 0.95), percentile(&values, 1.0)),
            (50.0, 95.0, 100.0)
        );
        assert_eq!((percentile(&[7.0], 0.0), percentile(&[], 0.5)), (7.0, 0.0));
    }

    #[test]
    fn rank_correlation_ignores_monotone_changes() {
        let values: Vec<f64> = (0..50).map(|i| f64::from(i * 37 % 50)).collect();
        let cubes: Vec<f64> = values.iter().map(|value| value.powi(3)).collect();
        let falling: Vec<f64> = values.iter().map(|value| -value).collect();
        assert!((rank_correlation(&values, &cubes).expect("varied") - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&values, &falling).expect("varied") + 1.0).abs() < 1e-12);
        assert_eq!(rank_correlation(&values, &[1.0; 50]), None);
        // Ties: ranks 0.5 0.5 2 against 0 1 2; covariance 1.5, variances 1.5 and 2.
        let tied = rank_correlation(&[1.0, 1.0, 2.0], &[1.0, 2.0, 3.0]).expect("varied");
        assert!((tied - 1.5 / 3.0f64.sqrt()).abs() < 1e-12, "{tied}");
    }
}
