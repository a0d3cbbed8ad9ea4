//! Directions weighed as SH: the cosine lobe in closed form, and sums over rays.

use glam::Vec3;
use localprt_formats::sh::{self, Basis, Directions, LANES};
use std::f32::consts::PI;

/// SH of the cosine lobe about a normal: `A_l Y_lm(n)`, A = pi, 2 pi/3, pi/4, 0, -pi/24, 0, ...
///
/// Source: Ramamoorthi and Hanrahan 2001, Eq. (8).
pub fn cosine_lobe(basis: &Basis, normal: Vec3) -> Vec<f32> {
    let mut lobe = vec![0.0; basis.len()];
    basis.evaluate(normal.to_array(), &mut lobe);
    for l in 0..=basis.degree() {
        for value in &mut lobe[sh::index(l, -(l as i32))..=sh::index(l, l as i32)] {
            *value *= cosine_lobe_factor(l);
        }
    }
    lobe
}

fn cosine_lobe_factor(l: u32) -> f32 {
    match l {
        1 => 2.0 * PI / 3.0,
        _ if l % 2 == 1 => 0.0,
        _ => {
            // 2 pi (-1)^(l/2 - 1) / ((l + 2)(l - 1)) * l! / (2^l ((l/2)!)^2): the last factor is a product of (2i - 1) / 2i.
            let central: f64 = (1..=l / 2).map(|i| f64::from(2 * i - 1) / f64::from(2 * i)).product();
            let sign = if (l / 2) % 2 == 1 { 1.0 } else { -1.0 };
            (2.0 * std::f64::consts::PI * sign * central / (f64::from(l + 2) * (f64::from(l) - 1.0))) as f32
        }
    }
}

/// SH sums over weighted directions, a set of lanes at a time.
pub struct Lobe<'a> {
    basis: &'a Basis,
    directions: Directions,
    weights: [f32; LANES],
    filled: usize,
    sums: Vec<[f32; LANES]>,
}

impl<'a> Lobe<'a> {
    /// Of no direction yet.
    pub fn new(basis: &'a Basis) -> Self {
        let sums = vec![[0.0; LANES]; basis.len()];
        Self { basis, directions: Directions::default(), weights: [0.0; LANES], filled: 0, sums }
    }

    /// Adds a direction with its weight.
    pub fn push(&mut self, dir: Vec3, weight: f32) {
        let lane = self.filled;
        (self.directions.x[lane], self.directions.y[lane], self.directions.z[lane]) = (dir.x, dir.y, dir.z);
        self.weights[lane] = weight;
        self.filled += 1;
        if self.filled == LANES {
            self.basis.accumulate(&self.directions, &self.weights, &mut self.sums);
            self.filled = 0;
        }
    }

    /// The sums: `[n_sh]`.
    pub fn finish(mut self) -> Vec<f32> {
        self.weights[self.filled..].fill(0.0);
        self.basis.accumulate(&self.directions, &self.weights, &mut self.sums);
        self.sums.iter().map(|lanes| lanes.iter().map(|&lane| f64::from(lane)).sum::<f64>() as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_lobe_has_its_known_factors() {
        let known = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0, PI / 64.0];
        for (l, known) in known.into_iter().enumerate() {
            assert!((cosine_lobe_factor(l as u32) - known).abs() < 1e-6, "{l}: {}", cosine_lobe_factor(l as u32));
        }
        // Against the integral of the clamped cosine times the Legendre polynomial, 2 pi ∫ z P_l(z) dz over 0..1, for all.
        for l in 0..=sh::MAX_DEGREE {
            let n = 200_000;
            let mut integral = 0.0;
            for i in 0..n {
                let z = (f64::from(i) + 0.5) / f64::from(n);
                let (mut older, mut newer) = (0.0, 1.0);
                for k in 1..=l {
                    let k = f64::from(k);
                    (older, newer) = (newer, ((2.0 * k - 1.0) * z * newer - (k - 1.0) * older) / k);
                }
                integral += z * newer / f64::from(n);
            }
            let expected = 2.0 * std::f64::consts::PI * integral;
            // Midpoint rule: 1 / 24 n^2 of a second derivative of a few thousand.
            assert!((f64::from(cosine_lobe_factor(l)) - expected).abs() < 1e-6, "{l}: {expected}");
        }
    }

    #[test]
    fn lobes_add_up_over_any_number_of_directions() {
        let basis = Basis::new(3);
        for n in [1, 8, 19] {
            let mut lobe = Lobe::new(&basis);
            let mut expected = vec![0.0f32; basis.len()];
            for i in 0..n {
                let dir = localprt_formats::directions::spherical_fibonacci(i, n);
                lobe.push(Vec3::from(dir), 0.5 + i as f32);
                let mut values = vec![0.0; basis.len()];
                basis.evaluate(dir, &mut values);
                for (sum, value) in expected.iter_mut().zip(values) {
                    *sum += (0.5 + i as f32) * value;
                }
            }
            for (found, expected) in lobe.finish().iter().zip(expected) {
                // 19 terms below 20.
                assert!((found - expected).abs() < 1e-4, "{found} {expected}");
            }
        }
    }
}
