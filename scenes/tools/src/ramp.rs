//! Color ramps: from a number in 0..=1 to a color.

use plotters::style::{
    RGBColor,
    colors::colormaps::{ColorMap, DerivedColorMap, ViridisRGB},
};

/// A color ramp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// Dark to bright in even steps (viridis), for amounts.
    Sequential,
    /// Blue through white to red, for signed values: white is the middle of the range.
    Diverging,
}

/// Ends and waypoints of [`Ramp::Diverging`], evenly spaced and symmetric in lightness.
const DIVERGING: [[u8; 3]; 5] = [[33, 84, 166], [130, 173, 219], [247, 247, 247], [231, 150, 128], [178, 32, 46]];

impl Ramp {
    /// The color at `t`, unitless: below 0 as 0, above 1 as 1. NaN, which has no place on a ramp, is mid gray.
    pub fn color(self, t: f32) -> [u8; 3] {
        if t.is_nan() {
            return [128; 3];
        }
        let t = t.clamp(0.0, 1.0);
        let RGBColor(red, green, blue) = match self {
            Self::Sequential => ViridisRGB.get_color(t),
            Self::Diverging => {
                DerivedColorMap::new(&DIVERGING.map(|[red, green, blue]| RGBColor(red, green, blue))).get_color(t)
            }
        };
        [red, green, blue]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of an sRGB color.
    fn luminance(color: [u8; 3]) -> f32 {
        let linear = color.map(|value| (f32::from(value) / 255.0).powf(2.2));
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn the_sequential_ramp_gets_brighter_all_the_way() {
        let steps: Vec<f32> = (0..=32).map(|step| luminance(Ramp::Sequential.color(step as f32 / 32.0))).collect();
        assert!(steps.is_sorted_by(|a, b| a < b), "{steps:?}");
    }

    #[test]
    fn the_diverging_ramp_goes_from_blue_through_white_to_red() {
        let [low, middle, high] = [0.0, 0.5, 1.0].map(|t| Ramp::Diverging.color(t));
        assert!(low[2] > 2 * low[0] && high[0] > 2 * high[2]);
        assert!(middle.iter().all(|&value| value > 240));
    }

    #[test]
    fn values_off_the_ramp_take_its_ends() {
        for ramp in [Ramp::Sequential, Ramp::Diverging] {
            assert_eq!(ramp.color(-3.0), ramp.color(0.0));
            assert_eq!(ramp.color(f32::INFINITY), ramp.color(1.0));
            assert_ne!(ramp.color(0.0), ramp.color(1.0));
            assert_eq!(ramp.color(f32::NAN), [128; 3]);
        }
    }
}
