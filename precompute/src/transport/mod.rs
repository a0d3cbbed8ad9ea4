//! Local transport: a leaf of receivers and the probes around it to transport rows.
//!
//! For every receiver the incident directions are sampled by gather rays. Each ray's surface point Γ is looked up in the
//! supporting probes that see that side of that point, by Eq. (2), and the contributions of all rays add up to the row
//! of weights from probe radiance to irradiance (Eq. 7) or to receiver radiance (Eqs. 8, 9). Rays that leave the scene
//! fill the sky columns, more of them where there are openings: the sky is a virtual probe of infinite support. Receivers of
//! a volume gather over the whole sphere.

mod digests;
pub mod fit;
mod found;
mod gather;
mod kernel;
mod near;
mod openings;
mod outputs;
mod receivers;
#[cfg(test)]
mod tests;
mod traced;

pub use digests::CellContents;
pub use fit::{FitConstants, FitPrior, FitScene, LeafFit};
pub use gather::{Domain, GatherPart, GatherRay, GatherSet};
pub use kernel::Links;
use kernel::{Enough, LookUps, Sampling};
pub use near::{NearField, Node};
use openings::Openings;
pub use outputs::OutputFunctions;
pub use receivers::{Receivers, Sites};

use crate::{
    cells::{CellGrid, CellSet},
    output::OutputError,
    probes::{ProbeSet, Support},
    rays::RayCaster,
};
use glam::Vec3;
use localprt_formats::{sh, weight::weight_kernel};
use traced::Traced;

/// What transport rows are made from; the same for all leaves of a bake.
pub struct TransportScene<'a> {
    /// Ray queries.
    pub caster: &'a RayCaster<'a>,
    /// All receivers; points in the open go with a gather set over the sphere.
    pub receivers: Receivers<'a>,
    /// All probes.
    pub probes: &'a ProbeSet,
    /// Supporting probes of each receiver.
    pub support: &'a Support,
    /// Gather directions, shared by all receivers.
    pub gather: &'a GatherSet,
    /// SH of the probes.
    pub probe_basis: &'a sh::Basis,
    /// SH of the sky columns.
    pub sky_basis: &'a sh::Basis,
    /// What rows are fitted with; `None` for the paper's rows.
    pub fit: Option<&'a FitScene>,
    /// What near light is read from; `None` leaves all light to the probes.
    pub near: Option<&'a NearField>,
    /// Which cells rays cross is noted in these.
    pub cells: Option<CellGrid>,
}

/// A leaf of receivers: the columns that their rows share, and what they are fitted with.
pub struct TransportLeaf {
    /// Union of the members' supporting probes, rising.
    probes: Vec<u32>,
    fit: Option<LeafFit>,
    /// Where more rays look for the sky; `None` for the paper's rows.
    openings: Option<Openings>,
    /// `[n_k]` what gather rays may be off by, squared, in the light that the fit expects; empty: all rays are traced.
    tolerance: Vec<f32>,
    /// Rays that looked for all this.
    traced: Traced,
}

/// Receivers of a leaf whose rows are fitted with all rays, to know what is left of errors there.
const PILOTS: usize = 8;
/// What too few gather rays may add to the variance that the fit leaves (F4), as a share of it.
const SAMPLING_SHARE: f32 = 0.5;

/// Transport rows of some receivers.
#[derive(Clone, Debug, Default)]
pub struct TransportRows {
    /// Union of the members' supporting probes, rising.
    pub probes: Vec<u32>,
    /// `n_probes * n_sh + n_sky`.
    pub n_columns: usize,
    /// Outputs per receiver, `(receiver_degree + 1)^2`.
    pub n_k: usize,
    /// `[n_members * n_k][n_columns]`, receiver by receiver.
    pub rows: Vec<f32>,
    /// `[n_members]` cosine-weighted share of directions whose surface neither a supporting probe sees nor a link reads.
    pub unseen: Vec<f32>,
    /// `[n_members * n_k]` predicted variance of what each row gets wrong of a field of variance 1 (F4); empty for the
    /// paper's rows.
    pub variance: Vec<f32>,
    /// How much an error of a column matters; `None` for the paper's rows, where all matter alike.
    pub metric: Option<Metric>,
    /// `[n_members]` nodes of the light map that each reads; empty without near light.
    pub links: Vec<Links>,
    /// Rays traced, those of the leaf itself counted.
    pub rays: RayCounts,
    /// Cells that they crossed, if the scene has cells.
    pub crossed: Option<CellSet>,
}

/// What an error of a row does to irradiance: `|δ W|` is the standard deviation of `δ·λ` over the light that a fit expects, as
/// a share of the irradiance that is usual there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metric {
    /// Columns of W.
    pub n: usize,
    /// W, `[n_columns][n]`.
    pub matrix: Vec<f32>,
}

/// Rays traced, by purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Closest-hit rays, and those that only look for the sky.
    pub gather: u64,
    /// Visibility rays.
    pub visibility: u64,
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.gather += other.gather;
        self.visibility += other.visibility;
    }
}

impl std::iter::Sum for RayCounts {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |mut sum, count| {
            sum += count;
            sum
        })
    }
}

impl TransportScene<'_> {
    /// The leaf of the receivers `members`. A pure function of its arguments.
    ///
    /// # Errors
    /// Those of the scratch that holds what the probes see.
    ///
    /// # Panics
    /// If the gather set is not one for receivers of this kind.
    pub fn leaf(&self, members: &[u32]) -> Result<TransportLeaf, OutputError> {
        let is_open = matches!(self.receivers, Receivers::Open(_));
        assert_eq!(
            is_open,
            self.gather.is_sphere(),
            "all directions count to points in the open, half of them to surfaces"
        );
        let probes = self.union_of_support(members);
        let leaf_fit = |fit: &FitScene| {
            let place = |&member: &u32| self.receivers.positions()[member as usize];
            let bounds = members
                .iter()
                .map(place)
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
            let mut weights = vec![0.0; probes.len()];
            for &member in members {
                let (position, radius) = (place(&member), self.support.radius_m[member as usize]);
                for id in self.support.of(member as usize) {
                    let probe = self.probes.positions[*id as usize];
                    let at = probes.binary_search(id).expect("probe is in the union");
                    weights[at] += weight_kernel(position.distance(probe) / radius) / members.len() as f32;
                }
            }
            fit.leaf(bounds, &probes, &weights, self.probe_basis.len())
        };
        let fit = self.fit.map(leaf_fit).transpose()?;
        let mut traced = Traced::new(self.cells);
        let openings = fit.as_ref().and_then(|_| Openings::of(self, members, &mut traced));
        let mut leaf = TransportLeaf { probes, fit, openings, tolerance: Vec::new(), traced };
        leaf.tolerance = self.tolerance(&mut leaf, members);
        Ok(leaf)
    }

    /// What gather rays of a leaf may be off by.
    fn tolerance(&self, leaf: &mut TransportLeaf, members: &[u32]) -> Vec<f32> {
        let Some(fit) = leaf.fit.as_ref().filter(|_| self.gather.n_levels() > 1) else { return Vec::new() };
        let mut workspace = kernel::Workspace::after(std::mem::take(&mut leaf.traced));
        let count = members.len().min(PILOTS);
        let mut found: Vec<Vec<f32>> = Vec::with_capacity(count);
        for index in 0..count {
            let member = members[(2 * index + 1) * members.len() / (2 * count)];
            kernel::receiver_rows(self, member as usize, LookUps::Few, leaf.sampling(), &mut workspace);
            let support = self.support.of(member as usize);
            let correction = fit.correct(support, &workspace.found, &mut workspace.outputs);
            if correction.is_made {
                found.push(correction.variance);
            }
        }
        leaf.traced = workspace.traced;
        let median = |k: usize| {
            let mut of_output: Vec<f32> = found.iter().map(|variance| variance[k]).collect();
            of_output.sort_unstable_by(f32::total_cmp);
            of_output[of_output.len() / 2]
        };
        match found.is_empty() {
            true => Vec::new(),
            false => (0..self.gather.n_outputs()).map(|k| SAMPLING_SHARE * median(k)).collect(),
        }
    }

    /// Directions of a receiver's gather rays whose light it reads from the light map, and the share of each that it does, were all of
    /// the rays traced.
    pub fn linked(&self, receiver: u32) -> Vec<(Vec3, f32)> {
        let mut workspace = kernel::Workspace::default();
        if self.near.is_some() {
            kernel::receiver_rows(self, receiver as usize, LookUps::Few, Sampling::default(), &mut workspace);
        }
        workspace.linked().collect()
    }

    /// Transport rows of the receivers `members` of a leaf, some or all of them, in that order, with the leaf's metric. A pure function
    /// of its arguments; the rows of a receiver do not depend on the other members asked for.
    pub fn rows(&self, leaf: &TransportLeaf, members: &[u32]) -> TransportRows {
        let metric = leaf.fit.as_ref().and_then(|fit| fit.metric(self.sky_basis.len()));
        TransportRows { metric, ..self.rows_alone(leaf, members) }
    }

    /// The same without the metric, which is large beside the rows of a few.
    pub fn rows_alone(&self, leaf: &TransportLeaf, members: &[u32]) -> TransportRows {
        let probes = leaf.probes.clone();
        let n_sh = self.probe_basis.len();
        let n_columns = probes.len() * n_sh + self.sky_basis.len();
        let n_k = self.gather.n_outputs();
        let mut rows = vec![0.0; members.len() * n_k * n_columns];
        let mut unseen = Vec::with_capacity(members.len());
        let mut variance = Vec::new();
        let mut links = Vec::new();
        let mut workspace = kernel::Workspace::after(leaf.traced.clone());
        let sampling = match self.fit {
            Some(_) => leaf.sampling(),
            // Nothing tells when there are enough.
            None => Sampling { enough: Enough::All, ..leaf.sampling() },
        };
        for (&member, rows) in members.iter().zip(rows.chunks_exact_mut(n_k * n_columns)) {
            let support = self.support.of(member as usize);
            let mut of_receiver = kernel::receiver_rows(self, member as usize, LookUps::Few, sampling, &mut workspace);
            if let (Some(fit), Some(_)) = (&leaf.fit, self.fit) {
                let mut correction = fit.correct(support, &workspace.found, &mut workspace.outputs);
                if !correction.is_made {
                    // Nothing takes out what few rays got wrong.
                    let sampling = Sampling { enough: Enough::All, ..sampling };
                    of_receiver = kernel::receiver_rows(self, member as usize, LookUps::All, sampling, &mut workspace);
                    correction = fit.correct(support, &workspace.found, &mut workspace.outputs);
                }
                variance.extend(correction.variance);
            }
            unseen.push(of_receiver);
            if self.near.is_some() {
                // Gains have done their work.
                links.push(Links { gains: Vec::new(), ..workspace.links.clone() });
            }
            for (row, sums) in rows.chunks_exact_mut(n_columns).zip(&workspace.outputs) {
                for (slot, id) in support.iter().enumerate() {
                    let at = probes.binary_search(id).expect("probe is in the union") * n_sh;
                    row[at..at + n_sh].copy_from_slice(&sums.probes[slot * n_sh..(slot + 1) * n_sh]);
                }
                row[probes.len() * n_sh..].copy_from_slice(&sums.sky);
            }
        }
        let Traced { counts: rays, crossed } = workspace.traced;
        let crossed = crossed.map(|crossed| crossed.cells());
        TransportRows { probes, n_columns, n_k, rows, unseen, variance, metric: None, links, rays, crossed }
    }
}

impl TransportLeaf {
    /// How the rays of its receivers are chosen.
    fn sampling(&self) -> Sampling<'_> {
        let enough = match &self.fit {
            Some(fit) if !self.tolerance.is_empty() => Enough::Within { fit, tolerance: &self.tolerance },
            _ => Enough::All,
        };
        Sampling { openings: self.openings.as_ref(), enough }
    }
}
