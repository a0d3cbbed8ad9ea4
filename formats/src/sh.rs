//! Real spherical harmonics: the one definition of index order, signs and norm.
//!
//! Index of degree l and order m: `l*l + l + m`. Orthonormal over the sphere, no Condon-Shortley phase, world axes with
//! z as the polar axis: `Y_1 = sqrt(3/4pi) * (y, z, x)`. Degree l of a set means all functions up to l, `(l+1)^2` of them.

use std::f32::consts::PI;

/// Highest degree this crate evaluates.
pub const MAX_DEGREE: u32 = 10;
/// Number of functions at [`MAX_DEGREE`].
pub const MAX_FUNCTIONS: usize = 121;
/// Directions evaluated together by [`Basis::accumulate`].
pub const LANES: usize = 8;

/// Number of functions up to and including `degree`.
pub const fn function_count(degree: u32) -> usize {
    ((degree + 1) * (degree + 1)) as usize
}

/// Index of degree `l`, order `m` (`-l..=l`).
pub const fn index(l: u32, m: i32) -> usize {
    ((l * l + l) as i32 + m) as usize
}

/// Factors that turn SH radiance into irradiance about the surface normal, by degree (0, 1, 2): pi, 2 pi/3, pi/4.
///
/// Source: Ramamoorthi and Hanrahan 2001.
pub const COSINE_LOBE: [f32; 3] = [PI, 2.0 * PI / 3.0, PI / 4.0];

/// `E = sum_k COSINE_LOBE[l(k)] * Y_k(normal) * radiance_k` for degree-1 receiver coefficients: the weights.
pub fn irradiance_weights_degree_1(normal: [f32; 3]) -> [f32; 4] {
    let mut weights = [0.0; 4];
    Basis::new(1).evaluate(normal, &mut weights);
    weights[0] *= COSINE_LOBE[0];
    for weight in &mut weights[1..] {
        *weight *= COSINE_LOBE[1];
    }
    weights
}

/// The same for degree 2.
pub fn irradiance_weights_degree_2(normal: [f32; 3]) -> [f32; 9] {
    let mut weights = [0.0; 9];
    Basis::new(2).evaluate(normal, &mut weights);
    for (index, weight) in weights.iter_mut().enumerate() {
        *weight *= COSINE_LOBE[index.isqrt()];
    }
    weights
}

/// Directions for [`Basis::accumulate`], one per lane; unit length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Directions {
    /// x of each lane.
    pub x: [f32; LANES],
    /// y of each lane.
    pub y: [f32; LANES],
    /// z of each lane.
    pub z: [f32; LANES],
}

/// The functions up to one degree, with their recurrence constants.
#[derive(Clone, Debug)]
pub struct Basis {
    degree: u32,
    /// `Q_m^m` by m, times sqrt(2) for m > 0.
    diagonal: Vec<f32>,
    /// `(a, a*b)` of `Q_l^m = a z Q_{l-1}^m - a b Q_{l-2}^m`, by m then l > m.
    steps: Vec<(f32, f32)>,
}

impl Basis {
    /// Constants for all functions up to `degree`.
    ///
    /// # Panics
    /// If `degree` exceeds [`MAX_DEGREE`].
    pub fn new(degree: u32) -> Self {
        assert!(degree <= MAX_DEGREE, "SH degree {degree} exceeds {MAX_DEGREE}");
        let mut diagonal = Vec::new();
        let mut steps = Vec::new();
        let mut value = (1.0 / (4.0 * std::f64::consts::PI)).sqrt();
        for m in 0..=degree {
            if m > 0 {
                value *= (f64::from(2 * m + 1) / f64::from(2 * m)).sqrt();
            }
            let norm = if m == 0 { 1.0 } else { std::f64::consts::SQRT_2 };
            diagonal.push((value * norm) as f32);
            let m = f64::from(m);
            for l in (m as u32 + 1)..=degree {
                let l = f64::from(l);
                let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
                let previous = l - 1.0;
                let b = ((previous * previous - m * m) / (4.0 * previous * previous - 1.0)).max(0.0).sqrt();
                steps.push((a as f32, (a * b) as f32));
            }
        }
        Self { degree, diagonal, steps }
    }

    /// Highest degree.
    pub fn degree(&self) -> u32 {
        self.degree
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        function_count(self.degree)
    }

    /// Always false: there is at least the constant function.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Values of all functions in one unit direction; `values` has [`Basis::len`] entries.
    pub fn evaluate(&self, direction: [f32; 3], values: &mut [f32]) {
        let mut lanes = [[0.0; LANES]; MAX_FUNCTIONS];
        let mut directions = Directions::default();
        directions.x[0] = direction[0];
        directions.y[0] = direction[1];
        directions.z[0] = direction[2];
        let mut weights = [0.0; LANES];
        weights[0] = 1.0;
        self.accumulate(&directions, &weights, &mut lanes[..self.len()]);
        for (value, lane) in values[..self.len()].iter_mut().zip(&lanes) {
            *value = lane[0];
        }
    }

    /// Adds `weights[lane] * Y_j(direction[lane])` to `sums[j][lane]` for every function j and every lane.
    ///
    /// Unused lanes take weight 0. The loops run over lanes innermost, so that compilers vectorize them.
    #[inline]
    pub fn accumulate(&self, directions: &Directions, weights: &[f32; LANES], sums: &mut [[f32; LANES]]) {
        let Directions { x, y, z } = directions;
        assert!(sums.len() >= self.len());
        // weights * Re and Im of (x + iy)^m.
        let mut cosine = *weights;
        let mut sine = [0.0; LANES];
        let mut steps = self.steps.iter();
        for m in 0..=self.degree as usize {
            let mut older = [0.0; LANES];
            let mut newer = [self.diagonal[m]; LANES];
            for l in m..=self.degree as usize {
                if l > m {
                    let &(a, ab) = steps.next().expect("one step per (m, l)");
                    for lane in 0..LANES {
                        let next = a * z[lane] * newer[lane] - ab * older[lane];
                        older[lane] = newer[lane];
                        newer[lane] = next;
                    }
                }
                let center = l * l + l;
                let positive = &mut sums[center + m];
                for lane in 0..LANES {
                    positive[lane] += newer[lane] * cosine[lane];
                }
                if m > 0 {
                    let negative = &mut sums[center - m];
                    for lane in 0..LANES {
                        negative[lane] += newer[lane] * sine[lane];
                    }
                }
            }
            for lane in 0..LANES {
                let real = x[lane] * cosine[lane] - y[lane] * sine[lane];
                sine[lane] = x[lane] * sine[lane] + y[lane] * cosine[lane];
                cosine[lane] = real;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::directions::spherical_fibonacci;

    fn evaluate(degree: u32, direction: [f32; 3]) -> Vec<f32> {
        let mut values = vec![0.0; function_count(degree)];
        Basis::new(degree).evaluate(direction, &mut values);
        values
    }

    fn factorial(n: u32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    /// `Y_lm` from its definition, f64: `N * d^m/dz^m P_l(z)` times the real or imaginary part of `(x + iy)^m`, with the
    /// Legendre polynomial as an explicit sum. `(1 - z^2)^(m/2)` of the associated function and the angle are one power.
    fn definition(l: u32, m: i32, [x, y, z]: [f64; 3]) -> f64 {
        let order = m.unsigned_abs();
        let binomial = |n: u32, k: u32| factorial(n) / (factorial(k) * factorial(n - k));
        let mut legendre = 0.0;
        for k in 0..=l / 2 {
            let power = l - 2 * k;
            if power >= order {
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                let term = sign * binomial(l, k) * binomial(2 * l - 2 * k, l) / 2f64.powi(l as i32);
                legendre += term * factorial(power) / factorial(power - order) * z.powi((power - order) as i32);
            }
        }
        let (mut real, mut imaginary) = (1.0, 0.0);
        for _ in 0..order {
            (real, imaginary) = (x * real - y * imaginary, x * imaginary + y * real);
        }
        let share = factorial(l - order) / factorial(l + order);
        let norm = (f64::from(2 * l + 1) / (4.0 * std::f64::consts::PI) * share).sqrt();
        match m {
            0 => norm * legendre,
            1.. => std::f64::consts::SQRT_2 * norm * legendre * real,
            _ => std::f64::consts::SQRT_2 * norm * legendre * imaginary,
        }
    }

    #[test]
    fn values_match_the_definition_up_to_the_highest_degree() {
        let n = 500;
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, -0.8]];
        let mut largest = 0.0f64;
        for direction in (0..n).map(|i| spherical_fibonacci(i, n)).chain(axes) {
            let values = evaluate(MAX_DEGREE, direction);
            for l in 0..=MAX_DEGREE {
                for m in -(l as i32)..=l as i32 {
                    let expected = definition(l, m, direction.map(f64::from));
                    largest = largest.max((f64::from(values[index(l, m)]) - expected).abs());
                }
            }
        }
        // Ten steps of the recurrence, some three roundings of 2^-24 each, on terms of up to 8 near the poles where the
        // two parts of a step nearly cancel: 10 * 3 * 8 * 6e-8 = 1.4e-5.
        assert!(largest < 1.4e-5, "{largest}");
        assert!(largest > 0.0);
    }

    #[test]
    fn degree_one_is_y_z_x_with_positive_signs() {
        let scale = (3.0 / (4.0 * PI)).sqrt();
        let [x, y, z] = [0.48, -0.6, 0.64];
        let values = evaluate(1, [x, y, z]);
        let expected = [(1.0 / (4.0 * PI)).sqrt(), scale * y, scale * z, scale * x];
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 2.0 * f32::EPSILON, "{values:?}");
        }
        // Second degree, m = -2, 0, 2: xy, 3z^2 - 1, x^2 - y^2 in their textbook form.
        let values = evaluate(2, [x, y, z]);
        let third = (15.0 / (4.0 * PI)).sqrt();
        assert!((values[index(2, -2)] - third * x * y).abs() < 1e-6);
        assert!((values[index(2, 0)] - (5.0 / (16.0 * PI)).sqrt() * (3.0 * z * z - 1.0)).abs() < 1e-6);
        assert!((values[index(2, 2)] - third / 2.0 * (x * x - y * y)).abs() < 1e-6);
    }

    #[test]
    fn addition_theorem_holds_per_degree() {
        // sum_m Y_lm(a) Y_lm(b) = (2l + 1) / 4pi * P_l(a . b), for every degree.
        let n = 40;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let (a, b) = (spherical_fibonacci(i, n), spherical_fibonacci(j, n));
            let cosine: f64 = (0..3).map(|axis| f64::from(a[axis]) * f64::from(b[axis])).sum();
            let (in_a, in_b) = (evaluate(MAX_DEGREE, a), evaluate(MAX_DEGREE, b));
            let (mut older, mut newer) = (0.0, 1.0);
            for l in 0..=MAX_DEGREE {
                if l > 0 {
                    let l = f64::from(l);
                    (older, newer) = (newer, ((2.0 * l - 1.0) * cosine * newer - (l - 1.0) * older) / l);
                }
                let band = index(l, -(l as i32))..=index(l, l as i32);
                let sum: f64 = band.map(|k| f64::from(in_a[k]) * f64::from(in_b[k])).sum();
                let expected = f64::from(2 * l + 1) / (4.0 * std::f64::consts::PI) * newer;
                // Values of norm sqrt((2l+1)/4pi) <= 1.3 with errors up to 1.4e-5 in each of 21 functions.
                assert!((sum - expected).abs() < 1e-4, "degree {l}, {a:?} {b:?}: {sum} {expected}");
            }
        }
    }

    /// Largest deviation from the identity of `sum_r 4pi/N Y_j Y_k` over spherical Fibonacci directions.
    fn gram_deviation(degree: u32, n: u32) -> f64 {
        let count = function_count(degree);
        let mut gram = vec![0.0f64; count * count];
        for i in 0..n {
            let values = evaluate(degree, spherical_fibonacci(i, n));
            for (row, a) in gram.chunks_mut(count).zip(&values) {
                for (sum, b) in row.iter_mut().zip(&values) {
                    *sum += f64::from(*a) * f64::from(*b);
                }
            }
        }
        let weight = 4.0 * std::f64::consts::PI / f64::from(n);
        let deviation = |(k, sum): (usize, &f64)| (sum * weight - f64::from(u8::from(k % (count + 1) == 0))).abs();
        gram.iter().enumerate().map(deviation).fold(0.0, f64::max)
    }

    #[test]
    fn basis_is_orthonormal_over_fibonacci_directions() {
        // Figures for degree 7, to one digit: 8e-5 at 8000 directions, 2e-3 at 1000. In f64 with the associated Legendre
        // recurrence they are 8.052e-5 and 2.139e-3; f32 may add 2^-24 per value, averaged.
        assert!((gram_deviation(7, 8000) - 8.052e-5).abs() < 1e-7, "{}", gram_deviation(7, 8000));
        assert!((gram_deviation(7, 1000) - 2.139e-3).abs() < 1e-6, "{}", gram_deviation(7, 1000));
    }

    #[test]
    fn lanes_add_weighted_values_and_leave_the_others_alone() {
        let basis = Basis::new(4);
        let mut directions = Directions::default();
        let mut weights = [0.0; LANES];
        for (lane, weight) in weights.iter_mut().enumerate().take(LANES - 1) {
            let [x, y, z] = spherical_fibonacci(lane as u32, 7);
            (directions.x[lane], directions.y[lane], directions.z[lane]) = (x, y, z);
            *weight = lane as f32 - 2.5;
        }
        let mut sums = vec![[1.0; LANES]; basis.len()];
        basis.accumulate(&directions, &weights, &mut sums);
        for lane in 0..LANES {
            let mut values = vec![0.0; basis.len()];
            basis.evaluate([directions.x[lane], directions.y[lane], directions.z[lane]], &mut values);
            for (sum, value) in sums.iter().zip(&values) {
                assert!((sum[lane] - 1.0 - weights[lane] * value).abs() < 2e-6);
            }
        }
        assert!(sums.iter().all(|sum| sum[LANES - 1] == 1.0));
    }

    #[test]
    fn constant_radiance_gives_pi_at_any_normal() {
        let normal = [0.48, -0.6, 0.64];
        let weights = irradiance_weights_degree_1(normal);
        // Radiance 1 is sqrt(4 pi) in the first function.
        assert!((weights[0] * (4.0 * PI).sqrt() - PI).abs() < 1e-6);
        // Radiance 1 + cos about the normal: pi + 2 pi / 3.
        let [y, z, x] = [1, 2, 0].map(|axis| normal[axis] * (4.0 * PI / 3.0).sqrt());
        let irradiance = weights[0] * (4.0 * PI).sqrt() + weights[1] * y + weights[2] * z + weights[3] * x;
        assert!((irradiance - (PI + 2.0 * PI / 3.0)).abs() < 2e-6, "{irradiance}");
    }

    #[test]
    fn degree_2_adds_a_quarter_pi_of_the_second_band() {
        let normal = [0.48, -0.6, 0.64];
        let weights = irradiance_weights_degree_2(normal);
        assert_eq!(weights[..4], irradiance_weights_degree_1(normal));
        // A field that is Y_20 along the normal has sqrt(4 pi / 5) Y_2m(normal) as coefficients, and sum Y_2m^2 = 5 / 4 pi:
        // the irradiance is pi/4 times the field there.
        let mut values = [0.0; 9];
        Basis::new(2).evaluate(normal, &mut values);
        let scale = (4.0 * PI / 5.0).sqrt();
        let irradiance: f32 = (4..9).map(|k| weights[k] * scale * values[k]).sum();
        assert!((irradiance - PI / 4.0 * (5.0 / (4.0 * PI)).sqrt()).abs() < 1e-6, "{irradiance}");
    }

    #[test]
    #[should_panic(expected = "SH degree 11 exceeds 10")]
    fn a_degree_above_the_highest_is_a_broken_invariant() {
        Basis::new(11);
    }
}
