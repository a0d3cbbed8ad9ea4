//! Volume fill: outputs of the volume receivers to the cells of the grid, cells inside geometry filled from near ones.
//!
//! In: coefficients `[n_volume_receivers, n_k]`. Out: coefficients `[n_cells, n_k]`, RGB, SH of the incident radiance in world
//! axes, so that a trilinear lookup beside a wall finds light. [`VolumeSampler`] is that lookup.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;
mod sampler;

#[cfg(feature = "gpu")]
pub(crate) use gpu::GpuVolume;
pub use reference::volume_fill;
pub use sampler::VolumeSampler;
