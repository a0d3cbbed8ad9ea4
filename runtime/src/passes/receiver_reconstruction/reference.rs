//! CPU twin of the receiver reconstruction.

use crate::checked_bake::{CheckedBake, Transport};
use crate::passes::split_ranges;
use glam::Vec3;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Sets `coefficients[receiver * n_k + k] = row of U times the lights of the receiver's cluster`, RGB.
///
/// With one output per receiver the coefficient is irradiance, W m^-2, before clamping; with four it is SH radiance of
/// degree 1 in world axes. Sums of `n_coefficients` terms in f32. Receivers without cluster get 0.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn receiver_reconstruction(transport: &Transport<'_>, cluster_lights: &[Vec3], coefficients: &mut [Vec3]) {
    let n_k = transport.n_k;
    assert_eq!(cluster_lights.len(), transport.n_cluster_lights);
    assert_eq!(coefficients.len(), transport.n_receivers * n_k);
    coefficients.fill(Vec3::ZERO);
    let ranges = (0..transport.clusters.len()).map(|cluster| {
        let receivers = transport.receiver_range(cluster);
        receivers.start * n_k..receivers.end * n_k
    });
    let outputs = split_ranges(coefficients, ranges);
    outputs.into_par_iter().enumerate().for_each_init(Vec::new, |decoded, (cluster, outputs)| {
        let lights = &cluster_lights[transport.light_range(cluster)];
        let rows = &transport.reconstruction[transport.reconstruction_range(cluster)];
        decoded.resize(rows.len(), 0.0);
        rows.convert_to_f32_slice(decoded);
        for (output, row) in outputs.iter_mut().zip(decoded.chunks_exact(lights.len().max(1))) {
            *output = row.iter().zip(lights).fold(Vec3::ZERO, |sum, (&weight, &light)| sum + weight * light);
        }
    });
}

/// Irradiance about every receiver's shading normal, W m^-2, from its coefficients; negative values become 0.
///
/// Degree 0: the coefficient itself. Degree 1: the convolution with the cosine of Ramamoorthi and Hanrahan (2001).
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn receiver_irradiance(baked: &CheckedBake<'_>, coefficients: &[Vec3], irradiance: &mut [Vec3]) {
    let n_k = baked.n_k();
    assert_eq!(coefficients.len(), baked.n_receivers() * n_k);
    assert_eq!(irradiance.len(), baked.n_receivers());
    let per_receiver = irradiance.par_iter_mut().zip(coefficients.par_chunks_exact(n_k)).enumerate();
    per_receiver.for_each(|(receiver, (irradiance, coefficients))| {
        let sum = match baked.cosine_weights().get(receiver) {
            None => coefficients[0],
            Some(weights) => {
                weights.iter().zip(coefficients).fold(Vec3::ZERO, |sum, (&weight, &value)| sum + weight * value)
            }
        };
        *irradiance = sum.max(Vec3::ZERO);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;
    use half::f16;
    use localprt_formats::{BakedArrays, ClusterRecord, sh};
    use std::f32::consts::PI;

    fn reconstruct(arrays: &BakedArrays, lights: &[Vec3]) -> (Vec<Vec3>, Vec<Vec3>) {
        let baked = CheckedBake::new(arrays.view()).unwrap();
        let mut coefficients = vec![Vec3::NAN; baked.n_receivers() * baked.n_k()];
        let mut irradiance = vec![Vec3::NAN; baked.n_receivers()];
        receiver_reconstruction(baked.transport(), lights, &mut coefficients);
        receiver_irradiance(&baked, &coefficients, &mut irradiance);
        (coefficients, irradiance)
    }

    #[test]
    fn agrees_with_the_dense_product_in_double_precision() {
        for receiver_degree in [0, 1] {
            let arrays = test_bake::random(2, receiver_degree, 2);
            let n_k = arrays.metadata.n_k();
            let lights = test_bake::random_colors(1, 6);
            let (found, _) = reconstruct(&arrays, &lights);
            assert_eq!(found.len(), 12 * n_k);
            let mut expected = vec![[0.0f64; 3]; found.len()];
            for ClusterRecord {
                first_receiver, n_receivers, n_coefficients, first_light, reconstruction_pair, ..
            } in &arrays.clusters
            {
                for row in 0..*n_receivers as usize * n_k {
                    for light in 0..*n_coefficients as usize {
                        let u = arrays.reconstruction
                            [2 * *reconstruction_pair as usize + row * *n_coefficients as usize + light];
                        let value = lights[*first_light as usize + light].to_array();
                        for channel in 0..3 {
                            expected[*first_receiver as usize * n_k + row][channel] +=
                                f64::from(u) * f64::from(value[channel]);
                        }
                    }
                }
            }
            for (value, expected) in found.iter().zip(expected) {
                for (channel, expected) in value.to_array().into_iter().zip(expected) {
                    // Three products below 0.25, each rounded twice at 2^-25.
                    assert!((f64::from(channel) - expected).abs() < 6.0 * 2f64.powi(-25), "{channel}, {expected}");
                }
            }
            // The cluster without coefficients and the receiver without cluster are dark.
            assert!(found[3 * n_k..5 * n_k].iter().chain(&found[11 * n_k..]).all(|value| *value == Vec3::ZERO));
        }
    }

    /// One receiver with this normal, whose four coefficients are four lights.
    fn pass_through(normal: Vec3) -> BakedArrays {
        let mut arrays = test_bake::rays(0, 0, 1, |_| [0.0, 0.0]);
        arrays.metadata.receiver_degree = 1;
        arrays.receiver_texel = vec![0];
        arrays.receiver_normal = vec![normal.to_array()];
        arrays.clusters =
            vec![ClusterRecord { n_receivers: 1, n_sky: 1, n_coefficients: 4, ..ClusterRecord::default() }];
        arrays.projection = vec![f16::ZERO; 4];
        arrays.reconstruction = (0..16).map(|i| if i % 5 == 0 { f16::ONE } else { f16::ZERO }).collect();
        arrays
    }

    #[test]
    fn degree_one_is_convolved_with_the_cosine_about_the_normal() {
        // Radiance 1 + a.w has irradiance pi + 2 pi / 3 a.n; its SH: sqrt(4 pi), sqrt(4 pi / 3) (a_y, a_z, a_x).
        let a = Vec3::new(0.2, -0.5, 0.7);
        let linear = (4.0 * PI / 3.0).sqrt();
        let lights = [(4.0 * PI).sqrt(), linear * a.y, linear * a.z, linear * a.x].map(Vec3::splat);
        for normal in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, -2.0, 3.0).normalize()] {
            let (coefficients, irradiance) = reconstruct(&pass_through(normal), &lights);
            assert_eq!(coefficients, lights);
            let expected = PI + 2.0 * PI / 3.0 * a.dot(normal);
            // A dozen f32 roundings of numbers up to 5.
            assert!((irradiance[0].x - expected).abs() < 12.0 * 5.0 * 2f32.powi(-24), "{normal}: {}", irradiance[0]);
        }
        assert_eq!(sh::function_count(1), 4);
    }

    #[test]
    fn negative_irradiance_is_clamped_and_coefficients_are_kept() {
        let mut lights = [Vec3::ZERO; 4];
        lights[1] = Vec3::new(1.0, -1.0, 0.0);
        let (coefficients, irradiance) = reconstruct(&pass_through(Vec3::NEG_Y), &lights);
        assert_eq!(coefficients, lights);
        assert!(irradiance[0].x == 0.0 && irradiance[0].y > 0.9, "{}", irradiance[0]);

        let arrays = test_bake::furnace(0);
        let (coefficients, irradiance) = reconstruct(&arrays, &[Vec3::new(-1.0, 2.0, -0.0)]);
        assert_eq!((coefficients[3], irradiance[3]), (Vec3::new(-1.0, 2.0, 0.0), Vec3::new(0.0, 2.0, 0.0)));
    }
}
