//! FLIP: how different two pictures look when one flips between them; the only file that names nv-flip.
//!
//! Source: Andersson et al. 2020, FLIP: A Difference Evaluator for Alternating Images.

use crate::picture::Picture;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

/// FLIP of every pixel, 0..=1, `[height][width]`: pictures developed at one exposure, seen at 67 pixels per degree, as on a
/// 0.7 m wide screen of 3840 pixels from 0.7 m.
///
/// # Panics
/// If the pictures differ in size.
pub fn flip(picture: &Picture, reference: &Picture, ev: f32) -> Vec<f32> {
    assert_eq!((picture.width, picture.height), (reference.width, reference.height), "pictures of one size");
    let image = |picture: &Picture| {
        let pixels = picture.develop(crate::picture::Exposure::Ev(ev));
        FlipImageRgb8::with_data(picture.width, picture.height, &pixels)
    };
    nv_flip::flip(image(reference), image(picture), DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

/// Mean of [`flip`] over the pixels.
pub fn mean_flip(picture: &Picture, reference: &Picture, ev: f32) -> f64 {
    let values = flip(picture, reference, ev);
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn picture(pixel: impl Fn(u32, u32) -> f32) -> Picture {
        let (width, height) = (40, 30);
        let pixels = (0..width * height).map(|i| Vec3::splat(pixel(i % width, i / width))).collect();
        Picture { width, height, pixels }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_black_and_white_do() {
        let gray = picture(|x, y| 0.01 * (x + y) as f32);
        assert_eq!(mean_flip(&gray, &gray, 0.0), 0.0);
        let (black, white) = (picture(|_, _| 0.0), picture(|_, _| 100.0));
        assert!(mean_flip(&black, &white, 0.0) > 0.9);
        // A spot differs where it is and not far from it.
        let spot = picture(|x, y| 0.01 * (x + y) as f32 + if x < 4 && y < 4 { 0.5 } else { 0.0 });
        let values = flip(&spot, &gray, 0.0);
        assert!(values[0] > 0.2 && values[20 * 40 + 30] == 0.0, "{} {}", values[0], values[20 * 40 + 30]);
    }
}
