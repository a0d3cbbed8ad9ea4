//! CPU twin of the receiver reconstruction.

use crate::checked_bake::CheckedBake;
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
pub fn receiver_reconstruction(baked: &CheckedBake<'_>, cluster_lights: &[Vec3], coefficients: &mut [Vec3]) {
    let view = baked.view();
    let n_k = baked.n_k();
    assert_eq!(cluster_lights.len(), baked.n_cluster_lights());
    assert_eq!(coefficients.len(), baked.n_receivers() * n_k);
    coefficients.fill(Vec3::ZERO);
    let ranges = (0..view.clusters.len()).map(|cluster| {
        let receivers = baked.receiver_range(cluster);
        receivers.start * n_k..receivers.end * n_k
    });
    let outputs = split_ranges(coefficients, ranges);
    outputs.into_par_iter().enumerate().for_each_init(Vec::new, |decoded, (cluster, outputs)| {
        let lights = &cluster_lights[baked.light_range(cluster)];
        let rows = &view.reconstruction[baked.reconstruction_range(cluster)];
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
