//! Direct irradiance: what punctual lights send straight to every covered texel of the direct light map, shadowed by
//! shadow maps.
//!
//! In: [`SceneTexels`](crate::SceneTexels), [`ShadowCasters`](crate::ShadowCasters), lights. Out: irradiance per covered
//! texel, W m^-2, in the order of the texels: the `direct` of [`SurfaceTexels`](crate::SurfaceTexels).

mod reference;

pub use reference::{add_light, direct_irradiance};
