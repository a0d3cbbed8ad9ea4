//! Near light: what receivers read from the light map itself, beside their probes.
//!
//! In: the light map's levels. Out: `[n_receivers, n_k]` coefficients, to which it is added (N1): see
//! `docs/near-light.md`.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::NearLightPass;
pub use reference::near_light;
