//! Field modes: what radiance fields on the surfaces around a leaf look like by the prior, and what probes see of them.
//!
//! The field is a zero-mean Gaussian random field. Two patches are the more alike the nearer they are and the more they face
//! the same way; what surfaces emit has nothing to do with what others reflect, and is much brighter:
//!
//! ```text
//! K[p, q] = exp(-|c_p - c_q| / ℓ) ((1 + n_p·n_q) / 2)²     + ν if p = q                            (F5)
//! K[p, q] = σ² exp(-|c_p - c_q| / ℓ)                        where both emit, + σ² ν if p = q
//! K[p, q] = 0                                               where one does
//! ```
//!
//! All factors are positive definite, and so are their products. Of the modes of K those are kept that the leaf's probes see
//! with more than a share of the penalty's variance: the fit could not use the others.

use super::{
    patches::{Patches, Place},
    solve,
};
use crate::compress::svd::transposed_product;

/// Field modes of a leaf, at most.
const MOST_MODES: usize = 256;
/// Variance of what surfaces emit, σ².
const GLOW: f32 = 100.0;
/// Share of the variance that a patch has to itself, ν.
pub(super) const OWN: f32 = 0.02;

/// B of K ≈ B Bᵀ.
pub(super) struct Modes {
    n_modes: usize,
    /// `[n_patches][n_modes]`.
    matrix: Vec<f32>,
}

impl Modes {
    /// Modes that probes see: `views` are Λ_iᵀ `[n_patches][n_sh]`, weighted with `weights`. `correlation_m` is ℓ; modes with
    /// less than `least` times the mean variance of a probe's coefficient are left out.
    pub(super) fn of(
        patches: &Patches,
        correlation_m: f32,
        views: &[Vec<f32>],
        weights: &[f32],
        n_sh: usize,
        least: f64,
    ) -> Self {
        let places = patches.places();
        let n = places.len();
        let mut matrix = vec![0.0; n * n];
        for p in 0..n {
            for q in 0..p {
                let value = covariance(&places[p], &places[q], correlation_m);
                matrix[p * n + q] = value;
                matrix[q * n + p] = value;
            }
            matrix[p * n + p] = (1.0 + OWN) * covariance(&places[p], &places[p], correlation_m);
        }
        let (matrix, n_modes) = solve::leading_modes(&matrix, views, weights, n_sh, MOST_MODES, least);
        Self { n_modes, matrix }
    }

    pub(super) fn len(&self) -> usize {
        self.n_modes
    }

    /// `[n_modes]` of one patch.
    pub(super) fn of_patch(&self, patch: usize) -> &[f32] {
        &self.matrix[patch * self.n_modes..][..self.n_modes]
    }

    /// M_i `[n_sh][n_modes]` of a probe whose Λ_iᵀ is `[n_patches][n_sh]`.
    pub(super) fn project(&self, lambda: &[f32], n_sh: usize) -> Vec<f32> {
        transposed_product(lambda, n_sh, &self.matrix, self.n_modes)
    }
}

/// (F5) without ν.
pub(super) fn covariance(a: &Place, b: &Place, correlation_m: f32) -> f32 {
    let near = (-a.position.distance(b.position) / correlation_m).exp();
    match (a.glows, b.glows) {
        (true, true) => GLOW * near,
        (false, false) => {
            let facing = 0.5 * (1.0 + a.normal.dot(b.normal));
            near * facing * facing
        }
        _ => 0.0,
    }
}
