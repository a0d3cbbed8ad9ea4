//! A sky as the passes want it.

use glam::{DVec3, Vec3};
use localprt_formats::sh::Basis;
use localprt_scenes::Sky;

/// `[(degree + 1)^2]` SH radiance of a sky, `∫ L Y`, for the sky columns of a file with that `sky_degree`; empty if it is
/// black.
pub fn sky_sh(sky: &Sky, degree: u32) -> Vec<Vec3> {
    if sky.is_black() {
        return Vec::new();
    }
    let basis = Basis::new(degree);
    let mut sums = vec![DVec3::ZERO; basis.len()];
    let mut values = vec![0.0; basis.len()];
    for (dir, solid_angle, radiance) in sky.quadrature() {
        basis.evaluate(dir.to_array(), &mut values);
        for (sum, value) in sums.iter_mut().zip(&values) {
            *sum += radiance.as_dvec3() * f64::from(solid_angle * value);
        }
    }
    sums.into_iter().map(|sum| sum.as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    #[test]
    fn skies_have_their_closed_forms() {
        assert!(sky_sh(&Sky::Black, 4).is_empty());
        let constant = sky_sh(&Sky::Constant(Vec3::new(1.0, 2.0, 3.0)), 2);
        let expected = (4.0 * PI).sqrt() * Vec3::new(1.0, 2.0, 3.0);
        assert!((constant[0] - expected).abs().max_element() < 1e-4 * expected.x, "{}", constant[0]);
        assert!(constant[1..].iter().all(|value| value.abs().max_element() < 1e-4), "{constant:?}");
        // mix(horizon, zenith, y) above and mix(horizon, ground, -y) below: 1 + y.
        let gradient = Sky::Gradient { zenith: Vec3::splat(2.0), horizon: Vec3::ONE, ground: Vec3::ZERO };
        let linear = sky_sh(&gradient, 1);
        for (found, expected) in linear.iter().zip([(4.0 * PI).sqrt(), (4.0 * PI / 3.0).sqrt(), 0.0, 0.0]) {
            assert!((found.x - expected).abs() < 1e-3, "{linear:?}");
        }
    }
}
