//! Receiver reconstruction: cluster lights to transported radiance coefficients, then to irradiance (sec. 4.2).
//!
//! In: cluster lights `[sum of n_coefficients]`. Out: `[n_receivers, n_k]` coefficients and `[n_receivers]` irradiance, RGB.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::ReceiverReconstructionPass;
pub use reference::{cosine_weights, receiver_irradiance, receiver_reconstruction};
