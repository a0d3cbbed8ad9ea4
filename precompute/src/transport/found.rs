//! What the gather rays of a receiver brought: its rows, and what a fit needs to know beside them.

use crate::rays::SurfaceHit;
use glam::Vec3;

/// Modes of light that all surfaces have in common, beside those of the patches of a fit.
pub(super) const COMMON: usize = 2;

/// What the prior knows of a surface point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// s(y).
    pub scale: f32,
    /// Its material emits light.
    pub glows: bool,
}

/// What the rays of a receiver found, for the fit.
#[derive(Default)]
pub(super) struct Found {
    /// Surface points that a supporting probe sees.
    pub hits: Vec<SeenHit>,
    /// `[n_hits][n_k]` weights of their rays in each output.
    pub hit_weights: Vec<f32>,
    /// `[n_supporting]` weight kernel times the share of the surface points that the probe sees, cosine-weighted.
    pub seen_weights: Vec<f32>,
    /// `[n_k]` what surfaces that no supporting probe sees reflect, in the modes that all surfaces have in common.
    pub unseen_common: Vec<[f32; COMMON]>,
    /// Cosine-weighted share of the surface points that a supporting probe sees.
    pub seen_share: f32,
}

impl Found {
    /// Nothing yet; the share is set when all rays are through.
    pub(super) fn clear(&mut self, n_supporting: usize, n_k: usize) {
        self.hits.clear();
        self.hit_weights.clear();
        self.seen_weights.clear();
        self.seen_weights.resize(n_supporting, 0.0);
        self.unseen_common.clear();
        self.unseen_common.resize(n_k, [0.0; COMMON]);
    }

    /// Takes in a surface point that no probe sees, with what it has in common with all others.
    pub(super) fn add_unseen(&mut self, common: [f32; COMMON], weights: &[f32]) {
        for (sums, weight) in self.unseen_common.iter_mut().zip(weights) {
            sums.iter_mut().zip(common).for_each(|(sum, common)| *sum += weight * common);
        }
    }

    /// Takes in a surface point with `share` times the weights `[n_k]` of a gather ray.
    pub(super) fn add(&mut self, hit: &SurfaceHit, surface: Surface, weights: &[f32], share: f32) {
        self.hits.push(SeenHit { position: hit.position, normal: hit.normal, surface });
        self.hit_weights.extend(weights.iter().map(|weight| weight * share));
    }
}

/// A surface point that a receiver and a supporting probe see.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenHit {
    pub position: Vec3,
    pub normal: Vec3,
    pub surface: Surface,
}

/// One row of a receiver before it is spread over its leaf's columns.
#[derive(Clone, Default)]
pub(super) struct OutputSums {
    /// `[n_supporting][n_sh]`.
    pub probes: Vec<f32>,
    /// `[n_sky]`.
    pub sky: Vec<f32>,
}
