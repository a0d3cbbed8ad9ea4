//! CPU twin of the receiver reconstruction.

use crate::passes::split_ranges;
use glam::Vec3;
use half::slice::HalfFloatSliceExt;
use localprt_formats::{Checked, Transport, sh};
use rayon::prelude::*;

/// Sets `coefficients[receiver * n_k + k] = row of U times the lights of the receiver's cluster`, RGB.
///
/// With one output per receiver the coefficient is irradiance, W m^-2, before clamping; with four they are SH coefficients of
/// degree 1 in world axes, of which the convolution with the cosine makes irradiance. Sums of `n_coefficients` terms in f32.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn receiver_reconstruction(transport: &Transport<'_>, cluster_lights: &[Vec3], coefficients: &mut [Vec3]) {
    let n_k = transport.n_k;
    assert_eq!(cluster_lights.len(), transport.n_lights);
    assert_eq!(coefficients.len(), transport.n_receivers * n_k);
    coefficients.fill(Vec3::ZERO);
    let ranges = transport.clusters.iter().map(|cluster| cluster.receivers.start * n_k..cluster.receivers.end * n_k);
    let outputs = split_ranges(coefficients, ranges);
    outputs.into_par_iter().zip(&transport.clusters).for_each_init(Vec::new, |decoded, (outputs, cluster)| {
        let lights = &cluster_lights[cluster.lights.clone()];
        decoded.resize(cluster.reconstruction.len(), 0.0);
        cluster.reconstruction.convert_to_f32_slice(decoded);
        for (output, row) in outputs.iter_mut().zip(decoded.chunks_exact(lights.len().max(1))) {
            *output = row.iter().zip(lights).fold(Vec3::ZERO, |sum, (&weight, &light)| sum + weight * light);
        }
    });
}

/// `[n_receivers]` weights of the four coefficients in the irradiance about each receiver's shading normal: the convolution with the
/// cosine of Ramamoorthi and Hanrahan (2001). Empty for degree 0, whose coefficient is the irradiance.
pub fn cosine_weights(baked: &Checked<'_>) -> Vec<[f32; 4]> {
    match baked.view().metadata.receiver_degree {
        1 => baked.view().receiver_normal.par_iter().map(|&normal| sh::irradiance_weights_degree_1(normal)).collect(),
        _ => Vec::new(),
    }
}

/// Irradiance about every receiver's shading normal, W m^-2, from its coefficients; negative values become 0.
/// `weights` are those of [`cosine_weights`].
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn receiver_irradiance(weights: &[[f32; 4]], coefficients: &[Vec3], irradiance: &mut [Vec3]) {
    let n_k = if weights.is_empty() { 1 } else { 4 };
    assert_eq!(coefficients.len(), irradiance.len() * n_k);
    let per_receiver = irradiance.par_iter_mut().zip(coefficients.par_chunks_exact(n_k)).enumerate();
    per_receiver.for_each(|(receiver, (irradiance, coefficients))| {
        let sum = match weights.get(receiver) {
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
    use localprt_formats::{BakedArrays, BlockArrays, ClusterRecord, TransportBlock};
    use std::f32::consts::PI;

    fn reconstruct(arrays: &BakedArrays, lights: &[Vec3]) -> (Vec<Vec3>, Vec<Vec3>) {
        let baked = arrays.checked().unwrap();
        let mut coefficients = vec![Vec3::NAN; baked.n_receivers() * baked.n_k()];
        let mut irradiance = vec![Vec3::NAN; baked.n_receivers()];
        receiver_reconstruction(baked.transport(), lights, &mut coefficients);
        receiver_irradiance(&cosine_weights(&baked), &coefficients, &mut irradiance);
        (coefficients, irradiance)
    }

    #[test]
    fn agrees_with_the_dense_product_in_double_precision() {
        for receiver_degree in [0, 1] {
            let arrays = test_bake::random(2, receiver_degree, 2);
            let n_k = arrays.metadata.n_k();
            let lights = test_bake::random_colors(1, 6);
            let (found, _) = reconstruct(&arrays, &lights);
            assert_eq!(found.len(), 11 * n_k);
            let mut expected = vec![[0.0f64; 3]; found.len()];
            for cluster in &arrays.checked().unwrap().transport().clusters {
                let n_c = cluster.lights.len();
                for row in 0..cluster.receivers.len() * n_k {
                    for light in 0..n_c {
                        let u = cluster.reconstruction[row * n_c + light];
                        let value = lights[cluster.lights.start + light].to_array();
                        for channel in 0..3 {
                            expected[cluster.receivers.start * n_k + row][channel] +=
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
            // The cluster without coefficients is dark.
            assert!(found[3 * n_k..5 * n_k].iter().all(|value| *value == Vec3::ZERO));
        }
    }

    /// One receiver with this normal, whose four coefficients are four lights.
    fn pass_through(normal: Vec3) -> BakedArrays {
        let mut arrays = test_bake::rays(0, 0, 1, |_| [0.0, 0.0]);
        arrays.metadata.receiver_degree = 1;
        arrays.receiver_texel = vec![0];
        arrays.receiver_normal = vec![normal.to_array()];
        let identity: Vec<f16> = (0..16).map(|i| if i % 5 == 0 { f16::ONE } else { f16::ZERO }).collect();
        let mut block = TransportBlock::default();
        let record = ClusterRecord { n_receivers: 1, n_probes: 0, n_sky: 1, n_coefficients: 4 };
        block.push(record, &[], &[f16::ZERO; 4], &identity);
        arrays.receiver_position = vec![[0.0; 3]];
        arrays.receiver_unseen = vec![0.0];
        arrays.blocks = BlockArrays::of_one(&block, &arrays.receiver_position, 4);
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
