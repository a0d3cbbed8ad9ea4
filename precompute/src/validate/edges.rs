//! What the lightmap shows beside edges: light that has come through a wall, and light that is brighter than any around.

use super::surface_pixels::{DARK, SMOOTH_TEXELS, SurfacePixel, SurfacePixels};
use crate::metrics::percentile;
use rayon::prelude::*;
use serde::Serialize;

/// A pixel is at an edge where another surface stands on its own, or crosses it, within so many texels.
pub const EDGE_TEXELS: f32 = 2.0;
/// The share of the edge pixels whose ratio is at most [`Edges::ratio`].
const RATIO_SHARE: f64 = 0.999;
/// Errors are averaged over edge pixels within so many texels: a lightmap tells no more, and noise would hide small leaks.
const LEAK_TEXELS: f32 = 0.5;

/// Light at edge pixels; zeros where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Edges {
    /// Mean over edge pixels of `max(0, E - E_ref)`, over the mean of `E_ref` over all pixels; `E - E_ref` is averaged over about a
    /// texel. The sign is that by one half of the reference and the amount that by the other, so that noise adds nothing;
    /// excess smaller than the noise counts for less.
    pub leak: f64,
    /// 99.9th percentile over edge pixels of `E` over the largest `E_ref` within three texels on the same surface, as far as it is
    /// in sight from the pixel; at least 0.05 of the mean.
    pub ratio: f64,
    /// Edge pixels.
    pub pixels: usize,
}

/// Whether a pixel is at an edge.
pub fn is_at_edge(pixel: &SurfacePixel) -> bool {
    pixel.edge_texels <= EDGE_TEXELS
}

impl Edges {
    /// Measures a picture; `is_in_sight` tells whether nothing is between two pixels.
    pub fn of(pixels: &SurfacePixels, is_in_sight: impl Fn(&SurfacePixel, &SurfacePixel) -> bool + Sync) -> Self {
        let at_edge: Vec<&SurfacePixel> = pixels.pixels.iter().filter(|pixel| is_at_edge(pixel)).collect();
        if at_edge.is_empty() || pixels.mean <= 0.0 {
            return Self::default();
        }
        let excesses: Vec<f64> = at_edge.par_iter().map(|pixel| excess(pixels, pixel)).collect();
        let excess: f64 = excesses.iter().sum();
        let ratio = |pixel: &&SurfacePixel| {
            let mut largest = DARK * pixels.mean;
            pixels.for_each_around(pixel, SMOOTH_TEXELS * pixel.texel_m, |other| {
                if other.reference() > largest && is_in_sight(pixel, other) {
                    largest = other.reference();
                }
            });
            pixel.found / largest
        };
        let ratios: Vec<f64> = at_edge.par_iter().map(ratio).collect();
        Self {
            // A sum of many halves can end just below 0.
            leak: (excess / at_edge.len() as f64 / pixels.mean).max(0.0),
            ratio: percentile(&ratios, RATIO_SHARE),
            pixels: at_edge.len(),
        }
    }
}

/// Light above the reference. Where there is none, the mean over the noise of both halves is 0.
fn excess(pixels: &SurfacePixels, pixel: &SurfacePixel) -> f64 {
    let (mut area, mut errors) = (0.0, [0.0; 2]);
    pixels.for_each_around(pixel, LEAK_TEXELS * pixel.texel_m, |other| {
        if is_at_edge(other) {
            area += other.area;
            for (sum, half) in errors.iter_mut().zip(other.halves) {
                *sum += other.area * (other.found - half);
            }
        }
    });
    let [first, second] = errors.map(|sum| sum / area);
    let of = |sign: f64, amount: f64| if sign > 0.0 { amount } else { 0.0 };
    (of(first, second) + of(second, first)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::surface_pixels::tests::plane;

    #[test]
    fn a_bright_line_along_a_wall_is_a_leak_of_its_share() {
        // A wall at x = 0: 10 columns are within two texels. Half of the wall is 1 m higher; there the edge is brighter by 3, else
        // it is black.
        let line = |x: u32, z: u32, pixel: &mut SurfacePixel| {
            pixel.edge_texels = if x < 15 { (x as f32 + 0.5) / 5.0 } else { f32::INFINITY };
            pixel.position.y = if z < 20 { 1.0 } else { 0.0 };
            if x < 10 {
                pixel.found = if z < 20 { 4.0 } else { 0.0 };
            }
        };
        let edges = Edges::of(&plane(40, line), |_, _| true);
        assert_eq!(edges.pixels, 400);
        assert!((edges.leak - 3.0 / 2.0).abs() < 1e-12 && (edges.ratio - 4.0).abs() < 1e-12, "{edges:?}");
        // The reference has as much light three texels away at most, or a wall is between: then it is no light of this side.
        let lit = plane(40, |x, z, pixel| {
            line(x, z, pixel);
            if x == 12 {
                pixel.halves = [8.0; 2];
            }
        });
        assert!((Edges::of(&lit, |_, _| true).ratio - 0.5).abs() < 1e-12);
        let walled = Edges::of(&lit, |a, b| (a.position.x < 0.12) == (b.position.x < 0.12));
        assert!((walled.ratio - 4.0).abs() < 1e-12, "{walled:?}");
        // In the dark a ratio is over a twentieth of the mean, which is that of the 14 lit columns.
        let dark = plane(40, |x, z, pixel| {
            line(x, z, pixel);
            if x < 26 {
                (pixel.found, pixel.halves) = (0.03, [0.0; 2]);
            }
        });
        let (mean, edges) = (14.0 / 40.0, Edges::of(&dark, |_, _| true));
        assert!((edges.ratio - 0.03 / (0.05 * mean)).abs() < 1e-12, "{edges:?}");
        assert!((edges.leak - 0.03 / mean).abs() < 1e-12, "{edges:?}");
    }

    #[test]
    fn noise_of_the_reference_is_no_leak() {
        // Columns and rows of noise by 0.2 in the two halves: all four pairs as often as each other.
        let noisy = |texel_m: f32| {
            plane(40, |x, z, pixel| {
                pixel.edge_texels = 1.0;
                pixel.texel_m = texel_m;
                pixel.halves = [x, z].map(|odd| if odd % 2 == 0 { 0.8 } else { 1.2 });
            })
        };
        // Each pixel by itself; max(0, E - E_ref) would have a mean of 0.05.
        let edges = Edges::of(&noisy(0.01), |_, _| true);
        assert!(edges.leak < 1e-12 && edges.pixels == 1600, "{edges:?}");
        // Averages over 21 pixels, of which 11 have the sign of the middle: 0.2 / 21 is left, and more at the border.
        assert!(Edges::of(&noisy(0.05), |_, _| true).leak < 0.002);
        assert_eq!(Edges::of(&plane(40, |_, _, _| {}), |_, _| true), Edges::default());
    }
}
