//! Sums over a receiver's rays of the light that a fit expects, mode by mode: Bᵀ e and e_u of (F1), or what two sets of rays differ by.

use super::{CONSTANT, LeafFit, common, dot};
use crate::transport::found::{COMMON, Surface};
use glam::Vec3;

/// Sums over rays, each mode at one standard deviation.
pub(in crate::transport) struct ModeSums<'a> {
    fit: &'a LeafFit,
    /// `[n_k][n_modes + COMMON]`.
    sums: Vec<f32>,
}

impl LeafFit {
    /// Sums for so many outputs, of no rays yet.
    pub(in crate::transport) fn mode_sums(&self, n_k: usize) -> ModeSums<'_> {
        ModeSums { fit: self, sums: vec![0.0; n_k * (self.modes.len() + COMMON)] }
    }
}

impl ModeSums<'_> {
    /// Adds what a surface point sends, by the weights `[n_k]` of its ray.
    pub(in crate::transport) fn add(&mut self, position: Vec3, normal: Vec3, surface: Surface, weights: &[f32]) {
        let n_modes = self.fit.modes.len();
        let common = common(surface.scale, self.fit.usual_scale);
        let patch = self.fit.patches.find(position, normal, surface.glows);
        let modes = patch.map_or(&[][..], |patch| self.fit.modes.of_patch(patch as usize));
        for (sums, weight) in self.sums.chunks_exact_mut(n_modes + COMMON).zip(weights) {
            let (of_modes, of_common) = sums.split_at_mut(n_modes);
            let scaled = weight * surface.scale;
            of_modes.iter_mut().zip(modes).for_each(|(sum, mode)| *sum += scaled * mode);
            of_common.iter_mut().zip(common).for_each(|(sum, common)| *sum += weight * common);
        }
    }

    /// `[n_k]` variance of the sums, of a field of variance 1: what is common to all surfaces counts no more than the rest.
    pub(in crate::transport) fn variances(&self) -> impl Iterator<Item = f32> {
        let n_modes = self.fit.modes.len();
        self.sums.chunks_exact(n_modes + COMMON).map(move |sums| {
            let (modes, common) = sums.split_at(n_modes);
            dot(modes, modes) + common[0].powi(2) / CONSTANT
        })
    }

    /// `[n_k][n_modes + COMMON]`.
    pub(super) fn into_values(self) -> Vec<f32> {
        self.sums
    }
}
