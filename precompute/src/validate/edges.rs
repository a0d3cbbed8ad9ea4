//! What the lightmap shows beside edges: light that has come through a wall, and light that is brighter than any around.

use super::{
    metrics::percentile,
    surface_pixels::{DARK, SMOOTH_TEXELS, SurfacePixel, SurfacePixels},
};
use rayon::prelude::*;
use serde::Serialize;

/// A pixel is at an edge where another surface stands on its own, or crosses it, within so many texels.
pub const EDGE_TEXELS: f32 = 2.0;
/// The share of the edge pixels whose ratio is at most [`Edges::ratio`].
const RATIO_SHARE: f64 = 0.999;

/// Light at edge pixels; zeros where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Edges {
    /// Mean over edge pixels of `max(0, E - E_ref)`, over the mean of `E_ref` over all pixels. The sign is that by one half of the
    /// reference and the amount that by the other, so that noise adds nothing; excess smaller than the noise counts for less.
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
        let excess: f64 = at_edge.iter().map(|pixel| excess(pixel)).sum();
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
fn excess(pixel: &SurfacePixel) -> f64 {
    let [first, second] = pixel.halves.map(|half| pixel.found - half);
    let of = |sign: f64, amount: f64| if sign > 0.0 { amount } else { 0.0 };
    (of(first, second) + of(second, first)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::surface_pixels::tests::plane;

    #[test]
    fn a_bright_line_along_a_wall_is_a_leak_of_its_share() {
        // A wall at x = 0: 10 columns are within two texels. 2 of them are brighter by 3, 1 is black.
        let line = |x: u32, _: u32, pixel: &mut SurfacePixel| {
            pixel.edge_texels = if x < 15 { (x as f32 + 0.5) / 5.0 } else { f32::INFINITY };
            pixel.found = [4.0, 4.0, 0.0].get(x as usize).copied().unwrap_or(1.0);
        };
        let edges = Edges::of(&plane(40, line), |_, _| true);
        assert_eq!(edges.pixels, 400);
        assert!((edges.leak - 0.2 * 3.0).abs() < 1e-12 && (edges.ratio - 4.0).abs() < 1e-12, "{edges:?}");
        // The reference has as much light two texels away, or a wall between: then it is no light of this side.
        let lit = plane(40, |x, z, pixel| {
            line(x, z, pixel);
            if x == 12 {
                pixel.halves = [8.0; 2];
            }
        });
        assert!((Edges::of(&lit, |_, _| true).ratio - 0.5).abs() < 1e-12);
        let walled = Edges::of(&lit, |a, b| (a.position.x < 0.12) == (b.position.x < 0.12));
        assert!((walled.ratio - 4.0).abs() < 1e-12, "{walled:?}");
        // In the dark a ratio is over a twentieth of the mean, which is that of the 30 lit columns.
        let dark = plane(40, |x, z, pixel| {
            line(x, z, pixel);
            if x < 10 {
                (pixel.found, pixel.halves) = (0.03, [0.0; 2]);
            } else if x < 26 {
                pixel.halves = [0.0; 2];
            }
        });
        let (mean, edges) = (14.0 / 40.0, Edges::of(&dark, |_, _| true));
        assert!((edges.ratio - 0.03 / (0.05 * mean)).abs() < 1e-12, "{edges:?}");
        assert!((edges.leak - 0.03 / mean).abs() < 1e-12, "{edges:?}");
    }

    #[test]
    fn noise_of_the_reference_is_no_leak() {
        // All four pairs of noise by 0.2 in the two halves, as often as each other.
        let noisy = plane(40, |x, z, pixel| {
            pixel.edge_texels = 1.0;
            pixel.halves = [x, z].map(|odd| if odd % 2 == 0 { 0.8 } else { 1.2 });
        });
        let edges = Edges::of(&noisy, |_, _| true);
        assert!(edges.leak < 1e-12 && edges.pixels == 1600, "{edges:?}");
        assert_eq!(Edges::of(&plane(40, |_, _, _| {}), |_, _| true), Edges::default());
    }
}
