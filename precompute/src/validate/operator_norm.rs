//! Reconstruction error without any lighting: the round trip of Eq. (12).
//!
//! Light that arrives at a receiver x is an SH field λ_x of degree 9. It is projected to the probes as the receiver sees it
//! (P*: each probe takes the part of a receiver, x that of the only probe, of infinite support), and gathered back by the
//! receiver's transport row α. What the cosine measures before and after is compared:
//!
//! ```text
//! e_m = <max(cos, 0), Y_m>  -  sum_i sum_rays  V_x(Γ(p_i, ω)) Y_m(ψ_x(ω))  4π/N sum_j α_ij Y_j(ω)
//! E(x; λ_x) = (e · λ_x)^2
//! ```
//!
//! The error e·λ_x has one output, so the L2 operator norm is its largest value over unit vectors λ_x, `|e|`; the RMS over
//! random unit vectors is `|e| / sqrt(100)`. The paper calls it an average and shows the norm.
//!
//! Directions in which the receiver sees sky or black backs are left out of the first term, and so are those whose light it
//! reads from the light map: the sky has exact columns of its own, backs send nothing, and the map is exact but for its texels.

use super::{lit::irradiance_weight, lobe::cosine_lobe, subject::Subject};
use crate::{
    error::BakeError,
    probe_views::ProbeDirections,
    progress::Progress,
    rays::OccluderHint,
    transport::{GatherRay, Sites, TransportLeaf},
};
use glam::Vec3;
use localprt_formats::sh::{self, Basis};
use rayon::prelude::*;

/// Degree of the receiver's field.
pub const FIELD_DEGREE: u32 = 9;
/// Rays per probe of the dual projection. The Gram matrix of degree 7 is off by 2e-3 at half as many.
const RAYS: u32 = 2000;

/// What is known of a receiver's error without any lighting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unlit {
    /// `|e|` of Eq. (12): worst irradiance error over unit fields. Divide by [`rms_share`] for the RMS.
    pub norm: f32,
    /// Standard deviation that the fit predicts of the irradiance error, for fields of its prior, whose variance is 1
    /// (F4 of [`crate::transport::fit`]); 0 for the paper's rows. At degree 1 errors of the outputs count as independent.
    pub predicted: f32,
}

/// Γ(p_i, ω) of every probe, traced once.
struct ProbeViews {
    /// `[n_rays][n_sh]` SH values times 4 pi / n_rays.
    table: Vec<f32>,
    /// `[n_probes][n_rays]`; `None` for sky and black backs. Empty for probes that support no receiver asked for.
    points: Vec<Vec<Option<SeenPoint>>>,
}

#[derive(Clone, Copy)]
struct SeenPoint {
    position: Vec3,
    normal: Vec3,
}

/// Both at some receivers, given in file order.
///
/// # Errors
/// Those of [`Subject::each`](super::subject::Subject::each).
pub fn operator_norm(subject: &Subject<'_>, receivers: &[u32], progress: &Progress) -> Result<Vec<Unlit>, BakeError> {
    let probe_basis = Basis::new(subject.view.metadata.probe_degree);
    let field_basis = Basis::new(FIELD_DEGREE);
    let views = ProbeViews::trace(subject, receivers, &probe_basis);
    progress.check()?;
    subject.each("operator norm", receivers, progress, |index, leaf| {
        at(subject, receivers[index], leaf, &views, &probe_basis, &field_basis)
    })
}

/// Square root of the number of functions of the field: worst case over RMS.
pub fn rms_share() -> f32 {
    (sh::function_count(FIELD_DEGREE) as f32).sqrt()
}

impl ProbeViews {
    fn trace(subject: &Subject<'_>, receivers: &[u32], basis: &Basis) -> Self {
        let directions = ProbeDirections::new(RAYS, basis);
        let mut is_needed = vec![false; subject.probe_positions().len()];
        for &probe in receivers.iter().flat_map(|&receiver| subject.supporting(receiver)) {
            is_needed[probe as usize] = true;
        }
        let see = |(&probe, &is_needed): (&Vec3, &bool)| {
            if !is_needed {
                return Vec::new();
            }
            let look = |&dir: &Vec3| {
                let hit = subject.caster.closest_hit(probe, dir)?;
                hit.point.map(|_| SeenPoint { position: hit.position, normal: hit.normal })
            };
            directions.dirs.iter().map(look).collect()
        };
        let points = subject.probe_positions().par_iter().zip(&is_needed).map(see).collect();
        Self { table: directions.sh, points }
    }
}

fn at(
    subject: &Subject<'_>,
    receiver: u32,
    leaf: &TransportLeaf,
    views: &ProbeViews,
    probe_basis: &Basis,
    field_basis: &Basis,
) -> Unlit {
    let caster = subject.caster;
    let transport = subject.transport();
    let point = subject.point(receiver);
    let sites = subject.sites(receiver);
    let mut error = vec![0.0f64; field_basis.len()];
    let mut values = vec![0.0f32; field_basis.len()];

    // The cosine over the directions in which there is a surface.
    let mut is_enclosed = sites.iter().all(|site| site.normal == point.geometric_normal);
    for GatherRay { origin, dir, cosine, .. } in transport.gather.rays(Sites::Surface(sites), caster.offset_m()) {
        if caster.closest_hit(origin, dir).is_none_or(|hit| hit.point.is_none()) {
            is_enclosed = false;
            continue;
        }
        field_basis.evaluate(dir.to_array(), &mut values);
        let weight = f64::from(irradiance_weight(transport.gather, cosine));
        for (error, &value) in error.iter_mut().zip(&values) {
            *error += weight * f64::from(value);
        }
    }
    if is_enclosed {
        // In closed form, without the noise of the rays.
        error = cosine_lobe(field_basis, point.normal).into_iter().map(f64::from).collect();
    }

    // What is read from the light map is as good as the map, and as the outputs.
    let functions = transport.gather.outputs(Some(point.normal));
    let mut outputs = vec![0.0; transport.gather.n_outputs()];
    for (dir, share) in transport.linked(subject.place(receiver)) {
        field_basis.evaluate(dir.to_array(), &mut values);
        transport.gather.all().weights(dir, &functions, &mut outputs);
        let weight = f64::from(share * measured_by_the_cosine(&outputs, 1, point.normal)[0]);
        for (error, &value) in error.iter_mut().zip(&values) {
            *error -= weight * f64::from(value);
        }
    }

    let rows = transport.rows_alone(leaf, &[subject.place(receiver)]);
    let weights = measured_by_the_cosine(&rows.rows, rows.n_columns, point.normal);
    let n_sh = probe_basis.len();
    for (slot, &id) in rows.probes.iter().enumerate() {
        let alpha = &weights[slot * n_sh..(slot + 1) * n_sh];
        if alpha.iter().all(|&value| value == 0.0) {
            continue;
        }
        let mut hint = OccluderHint::default();
        for (ray, seen) in views.points[id as usize].iter().enumerate() {
            let Some(seen) = seen else { continue };
            // V_x: the receiver sees that side of that point; its sites take turns.
            let site = sites[ray % sites.len()];
            let origin = site.position + site.geometric_normal * caster.offset_m();
            let way = seen.position - origin;
            if way.dot(site.geometric_normal) <= 0.0
                || -way.dot(seen.normal) <= caster.offset_m()
                || !caster.visible_hinted(seen.position + seen.normal * caster.offset_m(), origin, &mut hint)
            {
                continue;
            }
            let basis = &views.table[ray * n_sh..(ray + 1) * n_sh];
            let back: f32 = alpha.iter().zip(basis).map(|(alpha, value)| alpha * value).sum();
            field_basis.evaluate(way.normalize().to_array(), &mut values);
            for (error, &value) in error.iter_mut().zip(&values) {
                *error -= f64::from(back) * f64::from(value);
            }
        }
    }
    let variance: f32 = match rows.variance.as_slice() {
        [] => 0.0,
        [variance] => *variance,
        variances => {
            let weights = sh::irradiance_weights_degree_1(point.normal.to_array());
            variances.iter().zip(weights).map(|(variance, weight)| weight * weight * variance).sum()
        }
    };
    Unlit { norm: error.iter().map(|value| value * value).sum::<f64>().sqrt() as f32, predicted: variance.sqrt() }
}

/// The rows of a receiver as one row of irradiance.
fn measured_by_the_cosine(rows: &[f32], n_columns: usize, normal: Vec3) -> Vec<f32> {
    if rows.len() == n_columns {
        return rows.to_vec();
    }
    let weights = sh::irradiance_weights_degree_1(normal.to_array());
    let mut sum = vec![0.0; n_columns];
    for (row, weight) in rows.chunks_exact(n_columns).zip(weights) {
        for (sum, value) in sum.iter_mut().zip(row) {
            *sum += weight * value;
        }
    }
    sum
}
