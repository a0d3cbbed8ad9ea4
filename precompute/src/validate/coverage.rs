//! What a baked file covers, whatever the lighting: unseen light, probes per receiver, clusters, coefficients.

use super::subject::Subject;
use crate::report::Unseen;
use serde::Serialize;

/// Mean and range of a count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Count {
    /// Arithmetic mean.
    pub mean: f64,
    /// Least.
    pub min: u32,
    /// Most.
    pub max: u32,
}

impl Count {
    fn of(values: impl Iterator<Item = u32> + Clone) -> Self {
        let n = values.clone().count().max(1) as f64;
        Self {
            mean: values.clone().map(f64::from).sum::<f64>() / n,
            min: values.clone().min().unwrap_or(0),
            max: values.max().unwrap_or(0),
        }
    }
}

/// Coverage of a baked file, over all its receivers and clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Cosine-weighted share of directions whose surface neither a supporting probe sees nor a link reads.
    pub unseen: Unseen,
    /// Supporting probes per receiver.
    pub probes_per_receiver: Count,
    /// Receivers per cluster.
    pub receivers_per_cluster: Count,
    /// Coefficients per cluster.
    pub coefficients_per_cluster: Count,
    /// Clusters.
    pub clusters: usize,
}

impl Coverage {
    /// Counts.
    pub fn of(subject: &Subject<'_>) -> Self {
        let clusters = &subject.checked.transport().clusters;
        Self {
            unseen: Unseen::of(subject.view.receiver_unseen),
            probes_per_receiver: Count::of(
                (0..subject.len() as u32).map(|receiver| subject.supporting(receiver).len() as u32),
            ),
            receivers_per_cluster: Count::of(clusters.iter().map(|cluster| cluster.receivers.len() as u32)),
            coefficients_per_cluster: Count::of(clusters.iter().map(|cluster| cluster.lights.len() as u32)),
            clusters: clusters.len(),
        }
    }
}
