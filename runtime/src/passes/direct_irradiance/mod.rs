//! Direct irradiance: what punctual lights send straight to every covered texel of the direct light map, shadowed by
//! shadow maps.
//!
//! In: [`SceneTexels`](crate::SceneTexels), [`ShadowCasters`](crate::ShadowCasters), lights. Out: irradiance per covered
//! texel, the mean over its samples, W m^-2, in the order of the texels: the `direct` of [`SurfaceTexels`](crate::SurfaceTexels).

#[cfg(feature = "gpu")]
pub(crate) mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub use gpu::{DIRECT_LIGHT_WGSL, DirectOptions, DirectPass, DirectTimestamps};
pub use reference::{add_light, direct_irradiance};
