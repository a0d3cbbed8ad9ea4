//! Progressive projection onto spherical harmonics: coefficients that follow a function while it is sampled.
//!
//! The static projection (Eq. 3) takes all its samples at once. The progressive one corrects what it has by a few samples at a time:
//! [`Rule::Error`] by the projected error (Eqs. 6 and 8), [`Rule::Filter`] by the recursive filter into which the paper simplifies it
//! (last lines of Eqs. 7 and 9), with two sums over the samples.

#[cfg(test)]
mod tests;

use glam::Vec3;
use localprt_formats::sh::{Basis, Directions, LANES, irradiance_weights_degree_2};
use std::f32::consts::PI;

/// Highest degree of three bands.
pub const DEGREE: u32 = 2;
/// Functions of three bands.
pub const FUNCTIONS: usize = 9;
/// Solid angle of all directions, sr.
pub const SPHERE_SR: f32 = 4.0 * PI;

/// SH radiance of three bands, W sr^-1 m^-2, in the order of [`localprt_formats::sh`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coefficients(pub [Vec3; FUNCTIONS]);

/// A sample of light that arrives at a probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arriving {
    /// Unit direction from the probe to where the light comes from.
    pub dir: Vec3,
    /// Solid angle that the sample stands for, sr.
    pub solid_angle_sr: f32,
    /// Radiance, W sr^-1 m^-2.
    pub radiance: Vec3,
}

/// What a step does with its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// `c' = (1 - w / 4 pi) c + w f y`, the last line of Eq. (7): what the paper runs. At rest it is the mean of `4 pi f y` over what is
    /// sampled, as if all directions looked like these.
    ///
    /// Differs from the paper: w of the first term is a share of the sphere. As printed, with w in steradians in both terms, a constant
    /// comes out `4 pi` too dark, because the mean over the sphere of `y y^T` is `1 / 4 pi`, and Eq. (7) takes it for 1.
    Filter,
    /// `c' = c - w (c y - f) y`, Eqs. (6) and (8): the error, not simplified. At rest it is the least-squares fit to what is sampled.
    Error,
}

/// How coefficients follow their samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// The step.
    pub rule: Rule,
    /// Factor on all solid angles, above 0: small is slow and smooth. The user's parameter below Eq. (9).
    pub hysteresis: f32,
}

/// The two sums over the samples of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Of the solid angles, sr.
    pub solid_angle_sr: f32,
    /// Of solid angle times radiance times basis functions.
    pub projected: Coefficients,
}

impl Sums {
    /// Of some samples. With `known`, of the error instead of the radiance: less what `known` has in each direction.
    pub fn of(basis: &Basis, samples: impl Iterator<Item = Arriving>, known: Option<&Coefficients>) -> Self {
        let mut sums = Self::default();
        let (mut lanes, mut used) = (Lanes::default(), 0);
        for sample in samples {
            lanes.put(used, &sample);
            used += 1;
            if used == LANES {
                sums.add(basis, &lanes, known);
                (lanes, used) = (Lanes::default(), 0);
            }
        }
        if used > 0 {
            sums.add(basis, &lanes, known);
        }
        sums
    }

    fn add(&mut self, basis: &Basis, lanes: &Lanes, known: Option<&Coefficients>) {
        let mut values = [[0.0; LANES]; FUNCTIONS];
        basis.accumulate(&lanes.dirs, &[1.0; LANES], &mut values);
        for (lane, (&solid_angle_sr, &radiance)) in lanes.solid_angle_sr.iter().zip(&lanes.radiance).enumerate() {
            let values = values.map(|value| value[lane]);
            let error = radiance - known.map_or(Vec3::ZERO, |known| known.radiance(&values));
            self.solid_angle_sr += solid_angle_sr;
            for (sum, value) in self.projected.0.iter_mut().zip(values) {
                *sum += error * (solid_angle_sr * value);
            }
        }
    }
}

/// Samples that are evaluated together; unused ones have no solid angle.
#[derive(Default)]
struct Lanes {
    dirs: Directions,
    solid_angle_sr: [f32; LANES],
    radiance: [Vec3; LANES],
}

impl Lanes {
    fn put(&mut self, lane: usize, sample: &Arriving) {
        (self.dirs.x[lane], self.dirs.y[lane], self.dirs.z[lane]) = sample.dir.into();
        self.solid_angle_sr[lane] = sample.solid_angle_sr;
        self.radiance[lane] = sample.radiance;
    }
}

impl Coefficients {
    /// Radiance in the direction in which the basis functions have these values; Eq. (4).
    pub fn radiance(&self, values: &[f32; FUNCTIONS]) -> Vec3 {
        self.0.iter().zip(values).map(|(&coefficient, &value)| coefficient * value).sum()
    }

    /// Irradiance about a unit normal, W m^-2, not negative.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        self.radiance(&irradiance_weights_degree_2(normal.to_array())).max(Vec3::ZERO)
    }

    /// One step with the samples of a frame, or with a single one.
    ///
    /// Differs from the paper: steps end where they would overshoot, as samples very near to a probe make them. The filter replaces at
    /// most all that there is; the error is corrected at most once over, which `9 / 4 pi`, the square of the basis functions' length,
    /// bounds. Neither is reached where the samples cover the sphere once and the hysteresis is below 1, or below 1/9 for the error.
    pub fn step(&mut self, basis: &Basis, samples: impl Iterator<Item = Arriving>, filter: &Filter) {
        match filter.rule {
            Rule::Filter => {
                let sums = Sums::of(basis, samples, None);
                let share = (filter.hysteresis * sums.solid_angle_sr / SPHERE_SR).min(1.0);
                if share > 0.0 {
                    // Eq. (7), last line, hysteresis and limit included: w f y = share (4 pi / sum w) (w f y).
                    let gain = share * SPHERE_SR / sums.solid_angle_sr;
                    self.change(|own, projected| own * (1.0 - share) + projected * gain, &sums.projected);
                }
            }
            Rule::Error => {
                let error = Sums::of(basis, samples, Some(self));
                let most = SPHERE_SR / FUNCTIONS as f32 / error.solid_angle_sr;
                if error.solid_angle_sr > 0.0 {
                    // Eqs. (6) and (8).
                    let gain = filter.hysteresis.min(most);
                    self.change(|own, projected| own + projected * gain, &error.projected);
                }
            }
        }
    }

    fn change(&mut self, step: impl Fn(Vec3, Vec3) -> Vec3, projected: &Self) {
        for (own, &projected) in self.0.iter_mut().zip(&projected.0) {
            *own = step(*own, projected);
        }
    }
}
