//! Probe placement: candidates in open voxels beside solid ones, thinned to the target count, with one support radius.

use glam::Vec3;

/// Radiance probes.
#[derive(Clone, Debug, Default)]
pub struct ProbeSet {
    /// World positions, metres.
    pub positions: Vec<Vec3>,
    /// Support radius r of all probes, metres: mean overlap over the receivers as asked.
    pub radius_m: f32,
}

/// Supporting probes of every receiver, and the radius each receiver sees them with.
///
/// A receiver with too few probes within r uses `max(r, 1.05 x distance to its min_overlap-th nearest probe)`.
#[derive(Clone, Debug, Default)]
pub struct Support {
    /// `[n_receivers + 1]` start of each receiver's run in `probes`.
    pub start: Vec<u32>,
    /// Probe ids, rising within a run.
    pub probes: Vec<u32>,
    /// `[n_receivers]` radius used in the weight kernel, metres.
    pub radius_m: Vec<f32>,
}

impl Support {
    /// Probes that support a receiver.
    pub fn of(&self, receiver: usize) -> &[u32] {
        &self.probes[self.start[receiver] as usize..self.start[receiver + 1] as usize]
    }
}

/// What placement did, for the bake report.
#[derive(Clone, Debug, Default)]
pub struct PlacementReport {
    /// Candidates before thinning.
    pub candidates: usize,
    /// Candidates rejected for back faces or clearance.
    pub rejected: usize,
    /// Probes added by the coverage repair.
    pub repaired: usize,
    /// Overlap: mean, least, most over receivers.
    pub overlap: (f32, u32, u32),
}
