//! How fast a probe's maps follow: perceptual encoding, thresholds of change, and what events do to hysteresis.

use super::Settings;
use crate::Event;
use glam::Vec3;

/// A texel that changes by more than this share of the greatest value lowers its hysteresis by [`SIGNIFICANT_DROP`] (Fig. 5).
const SIGNIFICANT: f32 = 0.25;
const SIGNIFICANT_DROP: f32 = 0.15;
/// A texel that changes by more than this share is new altogether: hysteresis 0 (Fig. 5).
const NEW_DISTRIBUTION: f32 = 0.8;

/// Frames for which hysteresis stays lowered, and by what share, after the last event of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reaction {
    small_light: u32,
    large_light: u32,
    large_object: u32,
    visibility: u32,
}

/// Hysteresis of a frame, for all probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteresis {
    /// Of irradiance.
    pub irradiance: f32,
    /// Of distances.
    pub visibility: f32,
}

impl Reaction {
    /// Takes in a frame's events and gives its hysteresis: lowered for this frame and those that follow.
    ///
    /// Differs from the paper, which does not say what two events do: the stronger one counts.
    ///
    /// Source: sec. 4.3. "By 15 %" is taken of the hysteresis, as a factor.
    pub fn frame(&mut self, events: &[Event], hysteresis: f32) -> Hysteresis {
        for event in events {
            match event {
                Event::SmallLight => self.small_light = 4,
                Event::LargeLight => self.large_light = 10,
                Event::LargeObject => (self.large_object, self.visibility) = (10, 7),
            }
        }
        let step = |frames: &mut u32, factor: f32| {
            let lowered = *frames > 0;
            *frames = frames.saturating_sub(1);
            if lowered { factor } else { 1.0 }
        };
        let irradiance = step(&mut self.small_light, 0.85)
            .min(step(&mut self.large_light, 0.5))
            .min(step(&mut self.large_object, 0.5));
        let visibility = step(&mut self.visibility, 0.5);
        Hysteresis { irradiance: hysteresis * irradiance, visibility: hysteresis * visibility }
    }
}

impl Settings {
    /// A texel's next value from its old one, as stored, and the mean radiance of a frame's rays.
    ///
    /// Differs from the paper: Fig. 5 takes the largest signed component of the change, and so does not see a texel that gets darker in
    /// one color alone; here it is the largest by magnitude.
    ///
    /// Source: Figs. 4 and 5, Eq. (1).
    pub(super) fn blended(&self, old: Vec3, mean: Vec3, hysteresis: f32) -> Vec3 {
        let fresh = self.encoded(mean);
        let mut hysteresis = hysteresis;
        if self.thresholds {
            let change = (fresh - old).abs().max_element() / self.encoded(Vec3::splat(self.white)).x;
            if change > SIGNIFICANT {
                hysteresis = (hysteresis - SIGNIFICANT_DROP).max(0.0);
            }
            if change > NEW_DISTRIBUTION {
                hysteresis = 0.0;
            }
        }
        fresh.lerp(old, hysteresis)
    }

    /// Radiance as the maps hold it.
    pub(super) fn encoded(&self, radiance: Vec3) -> Vec3 {
        radiance.powf(1.0 / self.exponent)
    }

    /// The square root of a stored radiance, in which probes are blended (Fig. 4: "a gamma = 2 curve to approximate sRGB").
    pub(super) fn root(&self, stored: Vec3) -> Vec3 {
        stored.max(Vec3::ZERO).powf(self.exponent * 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_lower_hysteresis_for_as_many_frames_as_the_paper_says() {
        let run = |event: Event| {
            let mut reaction = Reaction::default();
            let lowered = (0..15).map(|frame| {
                let events = [event];
                reaction.frame(if frame == 0 { &events } else { &[] }, 0.8)
            });
            let lowered: Vec<_> = lowered.collect();
            let count = |lower: &dyn Fn(&Hysteresis) -> f32| lowered.iter().take_while(|at| lower(at) < 0.8).count();
            // They come back for good.
            assert_eq!(lowered[14], Hysteresis { irradiance: 0.8, visibility: 0.8 });
            (lowered[0], count(&|at| at.irradiance), count(&|at| at.visibility))
        };
        assert_eq!(run(Event::SmallLight), (Hysteresis { irradiance: 0.8 * 0.85, visibility: 0.8 }, 4, 0));
        assert_eq!(run(Event::LargeLight), (Hysteresis { irradiance: 0.4, visibility: 0.8 }, 10, 0));
        assert_eq!(run(Event::LargeObject), (Hysteresis { irradiance: 0.4, visibility: 0.4 }, 10, 7));
    }

    #[test]
    fn the_stronger_of_two_events_counts() {
        let mut reaction = Reaction::default();
        assert_eq!(reaction.frame(&[Event::SmallLight, Event::LargeLight], 0.8).irradiance, 0.4);
    }

    #[test]
    fn large_changes_of_a_texel_are_taken_over_faster() {
        let settings = Settings { exponent: 1.0, ..Settings::default() };
        let off = Settings { thresholds: false, ..settings };
        let step = |settings: &Settings, to: f32| settings.blended(Vec3::ZERO, Vec3::splat(to), 0.95).x;
        // Rounding of three numbers.
        let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} {b}");
        close(step(&settings, 0.24), 0.05 * 0.24);
        close(step(&settings, 0.26), 0.2 * 0.26);
        close(step(&settings, 0.79), 0.2 * 0.79);
        close(step(&settings, 0.81), 0.81);
        close(step(&off, 0.81), 0.05 * 0.81);
        // One color alone is enough, and so is a lower hysteresis than what it drops by.
        close(settings.blended(Vec3::ONE, Vec3::new(0.1, 1.0, 1.0), 0.95).x, 0.1);
        close(settings.blended(Vec3::ZERO, Vec3::splat(0.5), 0.1).x, 0.5);
    }

    #[test]
    fn what_is_stored_comes_back() {
        let settings = Settings::default();
        let radiance = Vec3::new(1e-4, 0.7, 90.0);
        let root = settings.root(settings.encoded(radiance));
        // Some roundings, multiplied by the exponent.
        assert!((root * root / radiance - 1.0).abs().max_element() < 1e-5);
    }
}
