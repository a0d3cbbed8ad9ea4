//! Tone curves: from exposed linear radiance to display-linear 0..=1, which the target encodes as sRGB.
//!
//! The CPU twins of `tone_map.wgsl`.

use glam::{Mat3, Vec3, vec3};
use localprt_tools::picture::tone_curve;

/// A tone curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ToneMap {
    /// Each band by itself, white at [`WHITE`](crate::WHITE). Source: Reinhard et al. 2002, Eq. (4).
    #[default]
    Reinhard,
    /// Colors below 0.8 as they are, brighter ones toward white. Source: Khronos PBR Neutral Tone Mapper, 2024.
    Neutral,
    /// Highlights lose their color as in film: the base look of AgX by Troy Sobotka, without a look on top. Source: the
    /// matrices and the polynomial of degree 6 (mean squared error 3.7e-6) of Benjamin Wrensch, "Minimal AgX
    /// Implementation", iolite-engine.com, 2023.
    Agx,
    /// No curve: above 1 is 1. For maps, whose colors stay as they are.
    Clamp,
}

impl ToneMap {
    /// All, in the order of menus.
    pub const ALL: [Self; 4] = [Self::Reinhard, Self::Neutral, Self::Agx, Self::Clamp];

    /// One word, as command lines have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reinhard => "reinhard",
            Self::Neutral => "neutral",
            Self::Agx => "agx",
            Self::Clamp => "clamp",
        }
    }

    /// The curve of a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|tone| tone.name() == name)
    }

    /// Exposed linear Rec. 709 to display-linear 0..=1. Negative values count as 0.
    pub fn apply(self, color: Vec3) -> Vec3 {
        let color = color.max(Vec3::ZERO);
        match self {
            Self::Reinhard => Vec3::from_array(color.to_array().map(tone_curve)),
            Self::Neutral => neutral(color),
            Self::Agx => agx(color),
            Self::Clamp => color.min(Vec3::ONE),
        }
    }

    /// `TONE_` of the shader.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Reinhard => 0,
            Self::Neutral => 1,
            Self::Agx => 2,
            Self::Clamp => 3,
        }
    }
}

/// Reflectance head on of dielectrics, which the curve takes away so that base colors come back.
const F0: f32 = 0.04;
/// Where compression begins.
const KNEE: f32 = 0.8 - F0;
const DESATURATION: f32 = 0.15;

fn neutral(color: Vec3) -> Vec3 {
    let least = color.min_element();
    let color = color - if least < 2.0 * F0 { least - least * least / (4.0 * F0) } else { F0 };
    let peak = color.max_element();
    if peak < KNEE {
        return color;
    }
    let room = 1.0 - KNEE;
    let new_peak = 1.0 - room * room / (peak + room - KNEE);
    let whiteness = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    (color * (new_peak / peak)).lerp(Vec3::splat(new_peak), whiteness)
}

/// Rec. 709 into the space of the curve, and back.
const INSET: Mat3 = Mat3::from_cols(
    vec3(0.842_479_06, 0.042_328_242, 0.042_375_655),
    vec3(0.078_433_6, 0.878_468_64, 0.078_433_6),
    vec3(0.079_223_745, 0.079_166_13, 0.879_143),
);
const OUTSET: Mat3 = Mat3::from_cols(
    vec3(1.196_879, -0.052_896_85, -0.052_971_635),
    vec3(-0.098_020_88, 1.151_903_1, -0.098_043_45),
    vec3(-0.099_029_74, -0.098_961_18, 1.151_073_7),
);
/// Range of the curve, powers of 2.
const LEAST_EV: f32 = -12.473_93;
const MOST_EV: f32 = 4.026_069;

fn agx(color: Vec3) -> Vec3 {
    // Zero has no logarithm; what is below the range counts as its end.
    let inset = (INSET * color).max(Vec3::splat(LEAST_EV.exp2()));
    let encoded = inset.to_array().map(|value| ((value.log2() - LEAST_EV) / (MOST_EV - LEAST_EV)).clamp(0.0, 1.0));
    let outset = OUTSET * Vec3::from_array(encoded.map(contrast));
    // Encoded for a display of gamma 2.2.
    Vec3::from_array(outset.to_array().map(|value| value.max(0.0).powf(2.2))).min(Vec3::ONE)
}

fn contrast(x: f32) -> f32 {
    let coefficients = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];
    coefficients.into_iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: Vec3, expected: Vec3, tolerance: f32) {
        assert!(found.abs_diff_eq(expected, tolerance), "{found} instead of {expected}");
    }

    #[test]
    fn names_lead_back_to_their_curves() {
        for tone in ToneMap::ALL {
            assert_eq!(ToneMap::of_name(tone.name()), Some(tone));
        }
        assert_eq!((ToneMap::of_name("aces"), ToneMap::ALL[0]), (None, ToneMap::default()));
    }

    #[test]
    fn grays_rise_from_black_to_white_and_stay_gray() {
        for tone in ToneMap::ALL {
            let mut last = -1e-6;
            for step in -60..=20 {
                let value = tone.apply(Vec3::splat((step as f32 / 4.0).exp2()));
                // The rows of AgX's matrices sum to 1 within 2e-4, which its curve magnifies a little.
                close(value, Vec3::splat(value.y), 1e-3);
                assert!(value.y >= last && value.max_element() <= 1.0, "{} {step}: {value} {last}", tone.name());
                last = value.y;
            }
            // Black within the polynomial's error, to the power of 2.2; white likewise. Neutral reaches 1 at infinity.
            close(tone.apply(Vec3::ZERO), Vec3::ZERO, 2e-6);
            close(tone.apply(Vec3::splat(1e4)), Vec3::ONE, 0.02);
            close(tone.apply(Vec3::splat(-1.0)), Vec3::ZERO, 2e-6);
        }
    }

    #[test]
    fn neutral_keeps_colors_and_compresses_peaks() {
        // Below the knee all that happens is that 0.04 goes.
        close(ToneMap::Neutral.apply(vec3(0.5, 0.3, 0.2)), vec3(0.46, 0.26, 0.16), 1e-6);
        // 0.04 - 6.25 x 0.04^2 = 0.03 of the least band.
        close(ToneMap::Neutral.apply(vec3(0.5, 0.3, 0.04)), vec3(0.47, 0.27, 0.01), 1e-6);
        // The least band takes 0.03 away, and the peak 3.97 becomes 1 - 0.24^2 / (3.97 + 0.24 - 0.76).
        let new_peak = 1.0 - 0.0576 / 3.45;
        let whiteness = 1.0 - 1.0 / (0.15 * (3.97 - new_peak) + 1.0);
        let scaled = vec3(3.97, 0.01, 0.01) * (new_peak / 3.97);
        close(ToneMap::Neutral.apply(vec3(4.0, 0.04, 0.04)), scaled.lerp(Vec3::splat(new_peak), whiteness), 1e-5);
    }

    #[test]
    fn agx_maps_middle_gray_and_desaturates() {
        assert!((INSET * OUTSET).abs_diff_eq(Mat3::IDENTITY, 1e-4), "one undoes the other");
        // 0.18 lies at (log2 0.18 + 12.47393) / 16.5 = 0.606061, where the polynomial has 0.49673: 0.21452 is shown.
        close(ToneMap::Agx.apply(Vec3::splat(0.18)), Vec3::splat(0.21452), 1e-3);
        let red = ToneMap::Agx.apply(vec3(16.0, 0.0, 0.0));
        assert!(red.x > 0.9 && red.y > 0.2, "{red}");
    }

    #[test]
    fn clamp_changes_nothing_below_one() {
        assert_eq!(ToneMap::Clamp.apply(vec3(0.25, 1.0, 7.0)), vec3(0.25, 1.0, 1.0));
        assert_eq!(ToneMap::Reinhard.apply(Vec3::splat(crate::WHITE)), Vec3::ONE);
    }
}
