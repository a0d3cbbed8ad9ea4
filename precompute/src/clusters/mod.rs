//! From the receivers of a leaf to compressed clusters: refined until the error threshold holds (section 4.1).

mod leaves;
mod refine;
#[cfg(test)]
mod tests;

pub use leaves::{LeafTree, leaves};
pub use refine::{RefineSettings, refine};

use crate::compress::CompressedRows;

/// A finished cluster.
#[derive(Clone, Debug)]
pub struct Cluster {
    /// Receivers, in stored order.
    pub members: Vec<u32>,
    /// Supporting probes with columns, rising.
    pub probes: Vec<u32>,
    /// Sky columns after the probe columns: all of them, or none where no member sees the sky.
    pub n_sky: usize,
    /// Unseen share of each member.
    pub unseen: Vec<f32>,
    /// Stored factors and their errors.
    pub rows: CompressedRows,
}
