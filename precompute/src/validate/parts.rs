//! What the error is made of: shares that add up to it receiver by receiver, and the reasons of the worst ones.

use super::last_leg::TruthLeg;
use crate::metrics::{percentile, rms};
use glam::{DVec3, Vec3};
use localprt_scenes::luminance;
use serde::Serialize;

/// Receivers looked at as the worst ones.
const WORST_SHARE: f64 = 0.01;
/// A receiver is in a corner when surfaces within a quarter of the radius of support fill more than this share of what
/// it sees.
const CORNER: f32 = 0.25;

/// RMS of each part over receivers and bands, as a share of the mean irradiance, as in nrmse. See
/// [`super::last_leg`] for the parts; squares add up to that of the whole where parts are not correlated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ErrorParts {
    /// Earlier bounces, with the noise of two references; 0 with one bounce.
    pub input: f64,
    /// Light from surfaces that no supporting probe sees and no link reads.
    pub unseen: f64,
    /// Band limit of the probes, with relight rays and light map.
    pub band_limit: f64,
    /// Number of gather rays.
    pub gather_rays: f64,
    /// Compression and storage.
    pub compression: f64,
    /// Noise of the reference alone: its standard error.
    pub reference_noise: f64,
}

/// Why the worst one percent of the receivers are wrong. Shares of their number, but for `of_squared_error`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Worst {
    /// Receivers looked at.
    pub receivers: usize,
    /// Their share of the squared error of all.
    pub of_squared_error: f64,
    /// Largest part is unseen light.
    pub unseen: f64,
    /// Largest part is the band limit.
    pub band_limit: f64,
    /// Largest part is the number of gather rays.
    pub gather_rays: f64,
    /// Largest part is the input: earlier bounces.
    pub input: f64,
    /// Largest part is compression.
    pub compression: f64,
    /// Stand in corners, whatever the part.
    pub in_corners: f64,
    /// Share of all measured receivers that stand in corners, to compare with.
    pub corners_of_all: f64,
}

/// The parts of one receiver's error.
#[derive(Clone, Copy, Debug)]
struct Parts {
    input: DVec3,
    unseen: DVec3,
    band_limit: DVec3,
    gather_rays: DVec3,
    compression: DVec3,
}

impl Parts {
    fn of(truth: &TruthLeg, uncompressed: Vec3, compressed: Vec3, reference: Vec3) -> Self {
        let step = |from: Vec3, to: Vec3| to.as_dvec3() - from.as_dvec3();
        Self {
            input: step(reference, truth.all),
            unseen: step(truth.all, truth.seen),
            band_limit: step(truth.seen, truth.dense),
            gather_rays: step(truth.dense, uncompressed),
            compression: step(uncompressed, compressed),
        }
    }

    fn whole(&self) -> DVec3 {
        self.input + self.unseen + self.band_limit + self.gather_rays + self.compression
    }
}

/// Splits the error of the compressed light at `[n_measured]` receivers; `near` is the share of near surfaces around each,
/// `mean` that of the reference.
pub fn parts(
    truths: &[TruthLeg],
    near: &[f32],
    uncompressed: &[Vec3],
    compressed: &[Vec3],
    reference: &[Vec3],
    standard_error: &[Vec3],
    mean: f64,
) -> (ErrorParts, Worst) {
    let parts: Vec<Parts> = (0..truths.len())
        .map(|index| Parts::of(&truths[index], uncompressed[index], compressed[index], reference[index]))
        .collect();
    let share = |part: fn(&Parts) -> DVec3| rms(parts.iter().map(part)) / mean;
    let errors = ErrorParts {
        input: share(|parts| parts.input),
        unseen: share(|parts| parts.unseen),
        band_limit: share(|parts| parts.band_limit),
        gather_rays: share(|parts| parts.gather_rays),
        compression: share(|parts| parts.compression),
        reference_noise: rms(standard_error.iter().map(|error| error.as_dvec3())) / mean,
    };
    (errors, worst(&parts, near))
}

fn worst(parts: &[Parts], near: &[f32]) -> Worst {
    let size = |error: DVec3| luminance(error.abs());
    let whole: Vec<f64> = parts.iter().map(|parts| size(parts.whole())).collect();
    let limit = percentile(&whole, 1.0 - WORST_SHARE);
    let chosen: Vec<usize> = (0..parts.len()).filter(|&index| whole[index] >= limit && whole[index] > 0.0).collect();
    let n = chosen.len().max(1) as f64;
    let mut largest = [0usize; 5];
    for &index in &chosen {
        let parts = &parts[index];
        let sizes = [parts.unseen, parts.band_limit, parts.gather_rays, parts.input, parts.compression].map(size);
        let (kind, _) = sizes.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap_or((0, &0.0));
        largest[kind] += 1;
    }
    let is_corner = |near: f32| near > CORNER;
    let squares = |index: usize| parts[index].whole().length_squared();
    let total: f64 = (0..parts.len()).map(squares).sum();
    let [unseen, band_limit, gather_rays, input, compression] = largest.map(|count| count as f64 / n);
    Worst {
        receivers: chosen.len(),
        of_squared_error: if total > 0.0 {
            chosen.iter().map(|&index| squares(index)).sum::<f64>() / total
        } else {
            0.0
        },
        unseen,
        band_limit,
        gather_rays,
        input,
        compression,
        in_corners: chosen.iter().filter(|&&index| is_corner(near[index])).count() as f64 / n,
        corners_of_all: near.iter().filter(|&&near| is_corner(near)).count() as f64 / near.len().max(1) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_name_their_worst() {
        let gray = Vec3::splat;
        // 200 receivers without error but for two: one unseen and in a corner, one out of band.
        let mut truths = vec![TruthLeg { all: gray(1.0), seen: gray(1.0), dense: gray(1.0) }; 200];
        let (mut near, mut uncompressed) = (vec![0.0; 200], vec![gray(1.0); 200]);
        let mut compressed = vec![gray(1.0); 200];
        truths[3] = TruthLeg { seen: gray(0.0), dense: gray(0.25), ..truths[3] };
        (near[3], uncompressed[3]) = (0.9, gray(0.25));
        compressed[3] = gray(0.25);
        truths[70] = TruthLeg { dense: gray(1.5), ..truths[70] };
        uncompressed[70] = gray(1.75);
        compressed[70] = gray(1.875);
        let (errors, worst) =
            parts(&truths, &near, &uncompressed, &compressed, &[gray(1.0); 200], &[gray(0.01); 200], 1.0);
        let rms = |squares: f64| (squares / 200.0).sqrt();
        assert!((errors.unseen - rms(1.0)).abs() < 1e-12);
        assert!((errors.band_limit - rms(0.25 * 0.25 + 0.5 * 0.5)).abs() < 1e-12);
        assert!((errors.compression - rms(0.125 * 0.125)).abs() < 1e-12);
        assert!((errors.gather_rays - rms(0.25 * 0.25)).abs() < 1e-12);
        assert_eq!(errors.input, 0.0);
        assert!((errors.reference_noise - 0.01).abs() < 1e-9);
        assert_eq!((worst.receivers, worst.of_squared_error), (2, 1.0));
        assert_eq!((worst.unseen, worst.band_limit), (0.5, 0.5));
        assert_eq!((worst.gather_rays, worst.input, worst.compression), (0.0, 0.0, 0.0));
        assert_eq!((worst.in_corners, worst.corners_of_all), (0.5, 1.0 / 200.0));
    }
}
