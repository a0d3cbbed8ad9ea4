//! Direct light map: light, emission and the previous gather's irradiance to outgoing radiance (sec. 4.2).
//!
//! In: [`SurfaceTexels`] and the previous irradiance map. Out: level 0 of the light map, coverage 1 where a surface is.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::{DirectLightmapPass, Maps, Surface};
pub use reference::direct_lightmap;

pub use crate::surface_texels::SurfaceTexels;
