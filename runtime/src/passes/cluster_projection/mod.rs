//! Cluster projection: probe radiance and sky to the few numbers that light a cluster, `S V^T lambda` (sec. 4.2).
//!
//! In: probe radiance `[n_probes, n_sh]` and SH of the sky. Out: cluster lights `[sum of n_coefficients]`, RGB.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::ClusterProjectionPass;
pub use reference::cluster_projection;
