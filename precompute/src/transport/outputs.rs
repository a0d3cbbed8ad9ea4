//! What the outputs of a receiver weigh light by, as functions of its direction.

use crate::transport::Domain;
use glam::Vec3;
use localprt_formats::sh;
use std::{f64::consts::PI, sync::LazyLock};

/// Normal maps bend a normal by up to so much: outputs of degree 1 are fitted to normals that far from the shading normal.
const WIDEST_BEND: f64 = PI / 3.0;
/// Entries of the table over the cosine with the shading normal, -1 to 1.
const ENTRIES: usize = 257;
/// Normals per angle over which the fit is taken.
const STEPS: usize = 64;

/// Weights of light from a direction in all outputs of a receiver.
#[derive(Clone, Debug)]
pub enum OutputFunctions {
    /// Degree 0: irradiance about the shading normal, by rays that are dense as its cosine.
    Irradiance,
    /// Degree 1 on a surface: a + b·n, which is the irradiance about the shading normal and nearest to it about the normals around; as SH
    /// coefficients, world axes, of which the convolution with the cosine makes a + b·n again.
    AboutNormals(Vec3),
    /// In the open: SH radiance of some degree, world axes.
    Radiance(sh::Basis),
}

impl OutputFunctions {
    /// Of rays over a domain, for a receiver with this shading normal; none in the open.
    pub(super) fn of(domain: Domain, degree: u32, normal: Option<Vec3>) -> Self {
        match (domain, normal) {
            (Domain::Cosine, _) => Self::Irradiance,
            (Domain::Hemisphere, Some(normal)) => Self::AboutNormals(normal),
            _ => Self::Radiance(sh::Basis::new(degree)),
        }
    }

    /// Their values in a direction, per steradian; of [`OutputFunctions::Irradiance`] over the cosine.
    pub(super) fn evaluate(&self, dir: Vec3, values: &mut [f32]) {
        match self {
            Self::Irradiance => values[0] = 1.0,
            Self::AboutNormals(normal) => values.copy_from_slice(&about_normals(*normal, dir)),
            Self::Radiance(basis) => basis.evaluate(dir.to_array(), values),
        }
    }
}

/// max(n·ω, 0) as a function a + b·n of the normals n around a shading normal, as SH coefficients.
///
/// The paper projects radiance to SH of degree 1 and convolves it with the cosine (5.1). That leaves degree 2 of the cosine out, a quarter
/// of the light from straight ahead: a room lit from one side is a tenth too dark. For directions that no normal within
/// [`WIDEST_BEND`] turns away from, max(n·ω, 0) is n·ω, so that a + b·n is exact.
fn about_normals(normal: Vec3, dir: Vec3) -> [f32; 4] {
    let cosine = dir.dot(normal).clamp(-1.0, 1.0);
    let place = (cosine + 1.0) / 2.0 * (ENTRIES - 1) as f32;
    let first = (place as usize).min(ENTRIES - 2);
    let [along, across] = FIT[first].lerp(FIT[first + 1], place - first as f32).to_array();
    let constant = cosine.max(0.0) - along;
    let linear = normal * along + (dir - normal * cosine) * across;
    let weights = *WEIGHTS;
    [constant / weights[0], linear.y / weights[1], linear.z / weights[2], linear.x / weights[3]]
}

/// What the convolution with the cosine makes of a coefficient of each function, about the axis that it points along.
static WEIGHTS: LazyLock<[f32; 4]> = LazyLock::new(|| {
    let about = |axis: Vec3, function: usize| sh::irradiance_weights_degree_1(axis.to_array())[function];
    [about(Vec3::X, 0), about(Vec3::Y, 1), about(Vec3::Z, 2), about(Vec3::X, 3)]
});

/// By the cosine z of ω with the shading normal s: B and C of b = B s + C (ω - z s), for a = max(z, 0) - B, so that a + b·s is exact.
///
/// Least squares over normals cos α s + sin α t, α up to [`WIDEST_BEND`], uniform over their solid angle: cos α - 1 and sin α cos φ are
/// orthogonal over the angle φ of t with ω.
static FIT: LazyLock<Vec<glam::Vec2>> = LazyLock::new(|| {
    (0..ENTRIES)
        .map(|entry| {
            let z = 2.0 * entry as f64 / (ENTRIES - 1) as f64 - 1.0;
            // The limit where the sine vanishes.
            let sine = (1.0 - z * z).sqrt().max(1e-4);
            let [mut along, mut across] = [[0.0; 2]; 2];
            for step in 0..STEPS {
                let alpha = WIDEST_BEND * (step as f64 + 0.5) / STEPS as f64;
                let (sin, cos) = alpha.sin_cos();
                for turn in 0..STEPS {
                    let phi = 2.0 * PI * (turn as f64 + 0.5) / STEPS as f64;
                    let light = (z * cos + sine * sin * phi.cos()).max(0.0);
                    for (sums, function, value) in
                        [(&mut along, cos - 1.0, light - z.max(0.0)), (&mut across, sin * phi.cos(), light)]
                    {
                        sums[0] += sin * function * value;
                        sums[1] += sin * function * function;
                    }
                }
            }
            glam::DVec2::new(along[0] / along[1], across[0] / across[1] / sine).as_vec2()
        })
        .collect()
});

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::{fibonacci_square, uniform_sphere};

    fn irradiance(coefficients: &[f32], normal: Vec3) -> f32 {
        let weights = sh::irradiance_weights_degree_1(normal.to_array());
        coefficients.iter().zip(weights).map(|(value, weight)| value * weight).sum()
    }

    fn directions(n: u32) -> Vec<Vec3> {
        (0..n).map(|i| Vec3::from(uniform_sphere(fibonacci_square(i, n, [0.0; 2])))).collect()
    }

    #[test]
    fn light_about_the_shading_normal_is_exact() {
        for normal in directions(20) {
            for dir in directions(300) {
                let found = irradiance(&about_normals(normal, dir), normal);
                assert!((found - dir.dot(normal).max(0.0)).abs() < 2e-3, "{normal} {dir}: {found}");
            }
        }
    }

    /// No normal within 60 degrees turns away from light within 30 degrees of the shading normal.
    #[test]
    fn light_from_ahead_is_exact_about_all_normals() {
        let normal = Vec3::new(0.6, 0.64, -0.48);
        for dir in directions(400).into_iter().filter(|dir| dir.dot(normal) > 0.88) {
            for other in directions(400).into_iter().filter(|other| other.dot(normal) > 0.5) {
                let found = irradiance(&about_normals(normal, dir), other);
                assert!((found - dir.dot(other)).abs() < 5e-3, "{dir} {other}: {found}, not {}", dir.dot(other));
            }
        }
    }

    /// Against the paper's projection, over light from all of the hemisphere and normals within 60, 45 and 30 degrees: RMS over the mean.
    #[test]
    fn a_fit_is_nearer_than_a_projection() {
        let basis = sh::Basis::new(1);
        for bend in [0.5, 0.707, 0.866] {
            let (mut sums, mut mean, mut count) = ([0.0; 2], 0.0, 0.0);
            for dir in directions(500).into_iter().filter(|dir| dir.z > 0.0) {
                let mut projected = [0.0; 4];
                basis.evaluate(dir.to_array(), &mut projected);
                for normal in directions(500).into_iter().filter(|normal| normal.z > bend) {
                    let truth = normal.dot(dir).max(0.0);
                    let found = [about_normals(Vec3::Z, dir), projected].map(|light| irradiance(&light, normal));
                    for (sum, found) in sums.iter_mut().zip(found) {
                        *sum += (found - truth).powi(2);
                    }
                    (mean, count) = (mean + truth, count + 1.0);
                }
            }
            let [fitted, projected] = sums.map(|sum| (sum / count).sqrt() / (mean / count));
            assert!(fitted < 0.5 * projected, "normals above {bend}: {fitted} {projected}");
        }
    }

    /// Constant light over the hemisphere is a + b·n, and the projection is exact too.
    #[test]
    fn constant_light_is_as_projected() {
        let basis = sh::Basis::new(1);
        let mut sums = [[0.0f64; 4]; 2];
        let all = directions(20_000);
        for dir in all.iter().filter(|dir| dir.z > 0.0) {
            let mut projected = [0.0; 4];
            basis.evaluate(dir.to_array(), &mut projected);
            for (sums, values) in sums.iter_mut().zip([about_normals(Vec3::Z, *dir), projected]) {
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
            }
        }
        for (fitted, projected) in sums[0].iter().zip(sums[1]) {
            let difference = (fitted - projected) * 4.0 * PI / all.len() as f64;
            assert!(difference.abs() < 5e-3, "{sums:?}");
        }
    }
}
