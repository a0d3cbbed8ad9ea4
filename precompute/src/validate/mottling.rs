//! Blotches on surfaces where light is smooth: the error less its local mean.

use super::surface_pixels::{DARK, SurfacePixel, SurfacePixels};
use rayon::prelude::*;
use serde::Serialize;

/// The local mean is over this share of the support radius: probes and their rows change from there on.
const RADIUS_SHARE: f32 = 0.25;
/// A mean over fewer pixels, the pixel itself among them, is none.
const FEWEST_AROUND: usize = 12;

/// Blotches on smooth surfaces; zeros where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Mottling {
    /// RMS over smooth pixels of the error less its mean around, over the mean of the reference around (at least 0.05 of that of the
    /// picture). The noise of the reference is not part of it.
    pub rms: f64,
    /// Smooth pixels with enough others around.
    pub pixels: usize,
}

/// A pixel's error less the mean around, over the mean of the reference around: by each half of the reference.
#[derive(Clone, Copy, Debug)]
struct Deviation {
    pixel: u32,
    halves: [f64; 2],
}

impl Mottling {
    /// Measures a picture. Also the deviation of each pixel of `n_pixels`, NaN where there is none; noise is part of it.
    pub fn of(pixels: &SurfacePixels, n_pixels: usize) -> (Self, Vec<f32>) {
        let mut shown = vec![f32::NAN; n_pixels];
        if pixels.mean <= 0.0 {
            return (Self::default(), shown);
        }
        let deviations: Vec<Deviation> =
            pixels.pixels.par_iter().filter_map(|pixel| deviation(pixels, pixel)).collect();
        for Deviation { pixel, halves: [first, second] } in &deviations {
            shown[*pixel as usize] = ((first + second) / 2.0) as f32;
        }
        // Noise of the two halves is independent, so it cancels in the mean of their products.
        let products: f64 = deviations.iter().map(|deviation| deviation.halves[0] * deviation.halves[1]).sum();
        let rms = (products / deviations.len().max(1) as f64).max(0.0).sqrt();
        (Self { rms, pixels: deviations.len() }, shown)
    }
}

fn deviation(pixels: &SurfacePixels, pixel: &SurfacePixel) -> Option<Deviation> {
    if !pixel.is_smooth() {
        return None;
    }
    let (mut count, mut area, mut reference) = (0, 0.0, 0.0);
    let mut errors = [0.0; 2];
    pixels.for_each_around(pixel, RADIUS_SHARE * pixel.radius_m, |other| {
        if other.is_smooth() {
            count += 1;
            area += other.area;
            reference += other.area * other.reference();
            for (sum, half) in errors.iter_mut().zip(other.halves) {
                *sum += other.area * (other.found - half);
            }
        }
    });
    let around = (reference / area).max(DARK * pixels.mean);
    let of_half = |half: usize| (pixel.found - pixel.halves[half] - errors[half] / area) / around;
    (count >= FEWEST_AROUND).then(|| Deviation { pixel: pixel.pixel, halves: [of_half(0), of_half(1)] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::surface_pixels::tests::plane;
    use localprt_formats::directions::counter_uniform;
    use std::f64::consts::TAU;

    const SIDE: u32 = 100;

    fn mottling(change: impl Fn(u32, u32, &mut SurfacePixel)) -> Mottling {
        Mottling::of(&plane(SIDE, change), (SIDE * SIDE) as usize).0
    }

    #[test]
    fn a_ripple_has_its_rms_and_what_changes_slowly_none() {
        let ripple = |wave_m: f64| {
            mottling(|x, _, pixel| pixel.found = 1.0 + 0.1 * (TAU * (f64::from(x) + 0.5) / 100.0 / wave_m).sin())
        };
        // The mean over a disc of radius r is 2 J1(kr) / kr times the ripple in its middle: r = 10 cm and waves of 4 cm give
        // kr = 15.71, where J1 = 0.144. Discs that the border cuts have other means, of a fifth of the pixels.
        let share = 1.0 - 2.0 * 0.144 / 15.71;
        let found = ripple(0.04);
        assert_eq!(found.pixels, (SIDE * SIDE) as usize);
        assert!((found.rms / (share * 0.1 / 2f64.sqrt()) - 1.0).abs() < 0.02, "{found:?}");
        // With waves of 4 m, kr = 0.157: 1 - 2 J1(kr) / kr = 0.0031; and a border has at most the slope over half a radius.
        assert!(ripple(4.0).rms < 0.1 * 0.157 / 2.0, "{:?}", ripple(4.0));
        // An error that is the same everywhere is none; twice the light makes half of it.
        assert!(mottling(|_, _, pixel| pixel.found = 1.5).rms < 1e-12);
        let bright = mottling(|x, z, pixel| {
            pixel.halves = [2.0; 2];
            pixel.found = if (x + z) % 2 == 0 { 2.1 } else { 1.9 };
        });
        // A checkerboard averages out but for the odd pixel of about 314.
        assert!((bright.rms / 0.05 - 1.0).abs() < 0.02, "{bright:?}");
    }

    #[test]
    fn noise_of_the_reference_and_edges_do_not_count() {
        let noise = |x: u32, z: u32, half: u64| 0.2 * (counter_uniform(1, half, u64::from(z * SIDE + x)) - 0.5);
        let noisy = mottling(|x, z, pixel| {
            pixel.found = if (x + z) % 2 == 0 { 1.02 } else { 0.98 };
            pixel.halves = [1.0 + noise(x, z, 0), 1.0 + noise(x, z, 1)];
        });
        // Noise has a variance s^2 = 0.2^2 / 12. The mean of 10,000 products of it is off by s^2 / 100 = 3.3e-5, and that of its
        // products with the ripple by 0.02 * sqrt(2) s / 100 = 1.6e-5: 3.7e-5 together, of 4e-4. Four times that is allowed.
        assert!((noisy.rms * noisy.rms / 4e-4 - 1.0).abs() < 0.5, "{noisy:?}");
        // The RMS of the noise itself is s / sqrt(2) = 0.041; what is left is at most the root of 4 * 3.3e-5.
        let still = mottling(|x, z, pixel| pixel.halves = [1.0 + noise(x, z, 0), 1.0 + noise(x, z, 1)]);
        assert!(still.rms < 0.0115, "{still:?}");
        let edges = mottling(|x, z, pixel| {
            if x < 20 {
                (pixel.edge_texels, pixel.found) = (2.5, f64::from(z));
            }
        });
        assert!(edges.rms < 1e-12 && edges.pixels == 8000, "{edges:?}");
        // No surface around is large enough.
        assert_eq!(mottling(|_, _, pixel| pixel.radius_m = 0.06), Mottling::default());
    }
}
