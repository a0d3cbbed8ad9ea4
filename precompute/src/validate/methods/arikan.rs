//! The irradiance decomposition of Arikan et al. (2005) at its best, the second comparator of figure 8:
//! `E = sum w (L(Γ) where |Γ - x| < r, L̄(ω) elsewhere)`, r half of the radius of support.
//!
//! Distant light is interpolated between probes and blocked by near surfaces, near surfaces contribute their own light; which
//! surface is near is sampled by exact rays, and its radiance is exact, where they estimate both.

use super::{Method, Prepared};
use crate::validate::lit::{dot, positive};
use crate::validate::lobe::Lobe;
use glam::DVec3;

/// Surfaces nearer than this times the radius of support are near.
const NEAR: f32 = 0.5;

/// Irradiance decomposition, idealized.
pub static ARIKAN: Method = Method {
    name: "arikan",
    title: "irradiance decomposition (after Arikan et al.)",
    label: "arikan",
    caption: "probes interpolated, near surfaces exact",
    comparator: Some(
        "E = Σ w (L(Γ) where |Γ − x| < r, L̄ elsewhere), r half the radius of support: the irradiance decomposition of Arikan et \
         al. 2005 with sampled visibility and exact near light, its best case",
    ),
    prepare: |lit, _| {
        Ok(Prepared::at_receivers(|receiver| {
            let near_m = NEAR * lit.subject.radius_m(receiver.id);
            let mut near_light = DVec3::ZERO;
            let mut far = Lobe::new(&lit.basis);
            for ray in receiver.rays() {
                match &ray.hit {
                    Some(hit) if hit.t < near_m => near_light += (ray.weight * lit.outgoing(hit)).as_dvec3(),
                    _ => far.push(ray.dir, ray.weight),
                }
            }
            positive(near_light + dot(&far.finish(), receiver.blended()))
        }))
    },
};
