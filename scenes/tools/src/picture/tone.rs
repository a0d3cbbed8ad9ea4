//! From radiance to what a screen shows.

use glam::Vec3;
use localprt_scenes::{linear_to_srgb, luminance};

/// Exposed value that the tone curve maps to white.
pub const WHITE: f32 = 4.0;

/// How bright a picture is developed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// From the picture: the geometric mean of the luminances between their 10th and 90th percentile, black pixels left
    /// out, becomes 0.18; less where the 95th percentile would become brighter than [`WHITE`].
    #[default]
    Auto,
    /// Radiance times 2^EV.
    Ev(f32),
}

impl Exposure {
    /// The exposure value for pixels of linear radiance.
    pub fn ev(self, pixels: &[Vec3]) -> f32 {
        match self {
            Self::Ev(ev) => ev,
            Self::Auto => automatic(pixels),
        }
    }
}

fn automatic(pixels: &[Vec3]) -> f32 {
    let mut luminances: Vec<f32> =
        pixels.iter().map(|pixel| luminance(*pixel) as f32).filter(|value| *value > 0.0 && value.is_finite()).collect();
    if luminances.is_empty() {
        return 0.0;
    }
    luminances.sort_unstable_by(f32::total_cmp);
    let at = |percent: usize| luminances.len() * percent / 100;
    let middle = &luminances[at(10)..at(90).max(at(10) + 1)];
    let mean_log2 = middle.iter().map(|value| f64::from(value.log2())).sum::<f64>() / middle.len() as f64;
    let highlights = WHITE.log2() - luminances[at(95)].log2();
    (0.18f32.log2() - mean_log2 as f32).min(highlights)
}

/// Exposed linear value to display-linear 0..=1, each color band alone: x (1 + x / WHITE^2) / (1 + x), 1 from WHITE on.
///
/// Source: Reinhard et al. 2002, Photographic Tone Reproduction for Digital Images, Eq. (4).
pub fn tone_curve(value: f32) -> f32 {
    // NaN is not above 0 either.
    let value = if value > 0.0 { value.min(WHITE) } else { 0.0 };
    value * (1.0 + value / (WHITE * WHITE)) / (1.0 + value)
}

/// Tone curve, then sRGB (IEC 61966-2-1) in 8 bits.
pub(super) fn encode(color: Vec3) -> [u8; 3] {
    color.to_array().map(|value| linear_to_srgb(tone_curve(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_rises_from_black_to_white() {
        assert_eq!((tone_curve(0.0), tone_curve(WHITE), tone_curve(f32::INFINITY)), (0.0, 1.0, 1.0));
        assert_eq!((tone_curve(-1.0), tone_curve(f32::NAN)), (0.0, 0.0));
        let steps: Vec<f32> = (0..=100).map(|step| tone_curve(step as f32 * WHITE / 100.0)).collect();
        assert!(steps.is_sorted_by(|a, b| a < b));
        assert_eq!((encode(Vec3::ZERO), encode(Vec3::splat(WHITE))), ([0; 3], [255; 3]));
    }

    #[test]
    fn automatic_exposure_follows_the_light() {
        let pixels: Vec<Vec3> = (1..=1000).map(|value| Vec3::splat(value as f32)).collect();
        let dimmed: Vec<Vec3> = pixels.iter().map(|pixel| pixel / 16.0).collect();
        let (ev, dimmed_ev) = (Exposure::Auto.ev(&pixels), Exposure::Auto.ev(&dimmed));
        // log2 of a thousand f32 values: each within 2^-20 of its own.
        assert!((dimmed_ev - ev - 4.0).abs() < 1e-4);
        // Black pixels, as around a model, change nothing.
        let framed: Vec<Vec3> = pixels.iter().copied().chain(vec![Vec3::ZERO; 5000]).collect();
        assert_eq!(Exposure::Auto.ev(&framed), ev);
        assert_eq!(Exposure::Auto.ev(&[Vec3::splat(0.18)]), 0.0);
        assert_eq!(Exposure::Auto.ev(&[Vec3::ZERO, Vec3::NAN]), 0.0);
        assert_eq!(Exposure::Ev(1.5).ev(&pixels), 1.5);
    }

    #[test]
    fn a_bright_part_keeps_its_drawing() {
        // Nine tenths are nearly black; the tenth that is lit must not be white all over.
        let pixels: Vec<Vec3> = (0..1000).map(|value| Vec3::splat(if value < 900 { 1e-6 } else { 10.0 })).collect();
        let scale = Exposure::Auto.ev(&pixels).exp2();
        assert!(10.0 * scale <= WHITE * 1.0001);
    }
}
