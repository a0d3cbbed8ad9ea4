//! The last leg of our own method, from the light of one gather to the receivers, step by step from the truth to the
//! compressed result.
//!
//! Per receiver, with L(Γ) the outgoing radiance of what a ray meets:
//!
//! ```text
//! all           E_1 + sum w albedo/pi I(Γ)   path traced first bounce, and the earlier bounces I that the file's light holds
//! seen          all - sum w L(Γ)             over the dense rays whose surface no supporting probe sees and no link reads
//! dense         the transport row of that dense set times the probe radiance (Eq. 7)
//! uncompressed  the transport row of the bake's own gather rays times the probe radiance, and its links times the light map
//! compressed    U S V^T times the probe radiance, from the file in f16
//!
//! compressed - reference = (all - reference)            input: earlier bounces; with one bounce there are none
//!                        + (seen - all)                 unseen light
//!                        + (dense - seen)               band limit: SH, relight rays, light map
//!                        + (uncompressed - dense)       gather rays: their number
//!                        + (compressed - uncompressed)  compression
//! ```

use super::lit::{Lit, MetRay, positive};
use crate::{
    error::BakeError,
    progress::Progress,
    rays::SurfaceHit,
    transport::{GatherSet, TransportScene},
};
use glam::{DVec3, Vec3};
use std::collections::HashSet;

/// Rays of the dense set.
const DENSE_RAYS: u32 = 4096;

/// Irradiance at one receiver, W m^-2, not negative, on the way from the truth to the transport row. See the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruthLeg {
    /// All light.
    pub all: Vec3,
    /// All but that from surfaces that no supporting probe sees and no link reads.
    pub seen: Vec3,
    /// Transport row of the dense rays times probe radiance.
    pub dense: Vec3,
}

/// Walks from the truth to the transport row at some receivers, given in file order, with their path traced first bounce.
///
/// # Errors
/// Those of [`Subject::each`](super::subject::Subject::each).
pub fn truth_leg(
    lit: &Lit<'_>,
    receivers: &[u32],
    first_bounce: &[Vec3],
    progress: &Progress,
) -> Result<Vec<TruthLeg>, BakeError> {
    let subject = lit.subject;
    let cosine = GatherSet::new(DENSE_RAYS, 0, subject.settings.seed);
    let of_bake = GatherSet::new(DENSE_RAYS, subject.settings.receiver_degree, subject.settings.seed).in_one_level();
    subject.each("parts of the error", receivers, progress, |index, leaf| {
        let receiver = receivers[index];
        let probes = lit.probes(receiver);
        let (mut all, mut unseen) = (first_bounce[index].as_dvec3(), DVec3::ZERO);
        // Of the same directions as the rays below.
        let transport = TransportScene { gather: &cosine, ..subject.transport() };
        let bits = |dir: Vec3| dir.to_array().map(f32::to_bits);
        let linked: HashSet<[u32; 3]> =
            transport.linked(subject.place(receiver)).into_iter().map(|(dir, _)| bits(dir)).collect();
        for MetRay { dir, weight, hit } in lit.rays(receiver, &cosine) {
            let Some(hit) = &hit else { continue };
            let earlier = lit.reflected_earlier(hit);
            all += (weight * earlier).as_dvec3();
            if !is_seen(lit, hit, &probes) && !linked.contains(&bits(dir)) {
                unseen += (weight * (lit.sent_first(hit) + earlier)).as_dvec3();
            }
        }
        let transport = TransportScene { gather: &of_bake, ..subject.transport() };
        TruthLeg {
            all: positive(all),
            seen: positive(all - unseen),
            dense: lit.transported(receiver, &transport, leaf),
        }
    })
}

/// Whether any supporting probe sees that side of that point: V_i of Eq. (2).
fn is_seen(lit: &Lit<'_>, hit: &SurfaceHit, probes: &[(Vec3, f32)]) -> bool {
    let caster = lit.subject.caster;
    let seen_point = hit.position + hit.normal * caster.offset_m();
    probes.iter().any(|&(probe, weight)| {
        weight > 0.0 && (probe - hit.position).dot(hit.normal) > caster.offset_m() && caster.visible(seen_point, probe)
    })
}
