//! Probes interpolated by distance alone, the first comparator of figure 8: `E = ∫ L̄(ω) max(n·ω, 0) dω` (Eq. 1).

use super::{Method, Prepared};
use crate::validate::lit::{dot, positive};
use crate::validate::lobe::cosine_lobe;

/// Spatial interpolation.
pub static SPATIAL: Method = Method {
    name: "spatial",
    title: "spatial interpolation (Eq. 1)",
    label: "spatial",
    caption: "probes interpolated by distance (Eq. 1)",
    comparator: Some("E = ∫ L̄ cos, L̄ = Σ wᵢ Lᵢ / Σ wᵢ (Eq. 1): probes blended by distance"),
    prepare: |lit, _| {
        Ok(Prepared::at_receivers(|receiver| {
            let normal = lit.subject.point(receiver.id).normal;
            positive(dot(&cosine_lobe(&lit.basis, normal), receiver.blended()))
        }))
    },
};
