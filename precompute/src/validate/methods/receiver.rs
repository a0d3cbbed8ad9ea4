//! A receiver that all methods are evaluated at: what several of them need there is found once, when the first asks for it.

use crate::{
    transport::{GatherSet, TransportLeaf, TransportScene},
    validate::lit::{Lit, MetRay},
};
use glam::Vec3;
use std::{cell::OnceCell, f32::consts::PI};

/// A receiver under one lighting.
pub struct Receiver<'a> {
    /// Number in file order.
    pub id: u32,
    lit: &'a Lit<'a>,
    leaf: &'a TransportLeaf,
    gather: &'a GatherSet,
    rays: OnceCell<Vec<MetRay>>,
    blended: OnceCell<Vec<Vec3>>,
    /// By whether there are links, and a fit.
    transported: [[OnceCell<Vec3>; 2]; 2],
}

impl<'a> Receiver<'a> {
    pub(super) fn new(lit: &'a Lit<'a>, id: u32, leaf: &'a TransportLeaf, gather: &'a GatherSet) -> Self {
        let (rays, blended, transported) = Default::default();
        Self { id, lit, leaf, gather, rays, blended, transported }
    }

    /// Its cosine-weighted gather rays.
    pub fn rays(&self) -> &[MetRay] {
        self.rays.get_or_init(|| self.lit.rays(self.id, self.gather).collect())
    }

    /// Cosine-weighted share of directions in which a surface is nearer than a quarter of the radius of support: high in
    /// corners.
    pub fn near(&self) -> f32 {
        let near_m = 0.25 * self.lit.subject.radius_m(self.id);
        let is_near = |ray: &&MetRay| ray.hit.is_some_and(|hit| hit.t < near_m);
        self.rays().iter().filter(is_near).fold(0.0, |share, ray| share + ray.weight / PI)
    }

    /// Probe radiance blended by distance alone, `L̄ = sum_i w_i(x) L(p_i, ω) / sum_k w_k(x)` (Eq. 1): `[n_sh]`. Zero without
    /// a probe in reach.
    pub fn blended(&self) -> &[Vec3] {
        self.blended.get_or_init(|| {
            let probes = self.lit.probes(self.id);
            let n_sh = self.lit.basis.len();
            let mut blended = vec![Vec3::ZERO; n_sh];
            let sum: f32 = probes.iter().map(|probe| probe.1).sum();
            if sum > 0.0 {
                for (&id, &(_, weight)) in self.lit.subject.supporting(self.id).iter().zip(&probes) {
                    let radiance = &self.lit.probe_radiance_with_sky[id as usize * n_sh..][..n_sh];
                    for (blended, &radiance) in blended.iter_mut().zip(radiance) {
                        *blended += radiance * (weight / sum);
                    }
                }
            }
            blended
        })
    }

    /// Light of its transport rows before compression, with or without near light, fitted or the paper's, as far as the file
    /// has them: [`Lit::transported`].
    pub fn transported(&self, linked: bool, fitted: bool) -> Vec3 {
        let transport = self.lit.subject.transport();
        let near = transport.near.filter(|_| linked);
        let fit = transport.fit.filter(|_| fitted);
        let found = &self.transported[usize::from(near.is_some())][usize::from(fit.is_some())];
        let transport = TransportScene { near, fit, ..transport };
        *found.get_or_init(|| self.lit.transported(self.id, &transport, self.leaf))
    }
}
