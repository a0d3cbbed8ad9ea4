//! Mip chain of the light map, aware of charts: every level is a mean over covered texels only.
//!
//! In: level 0. Out: all levels down to 1 x 1. Relight rays read the level that fits their footprint, so that small
//! lights moving over the surface do not flicker.

#[cfg(feature = "gpu")]
mod gpu;
mod reference;

#[cfg(feature = "gpu")]
pub(crate) use gpu::{LightMap, LightmapMipsPass};
pub use reference::{level_sizes, lightmap_mips};
