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
    /// Unused lanes take weight 0. The loops run over lanes innermost, so that compilers vectorise them.
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
