#![doc = include_str!("../README.md")]

pub mod checked_bake;
pub mod coverage_map;
pub mod cpu_relighter;
pub mod error;
pub mod passes;
pub mod surface;

#[cfg(test)]
mod test_bake;

pub use checked_bake::CheckedBake;
pub use coverage_map::CoverageMap;
pub use cpu_relighter::{CpuRelighter, DEFAULT_FEEDBACK_ALBEDO_CAP, RelightInputs, Relit};
pub use error::RelightError;
pub use passes::direct_lightmap::SurfaceTexels;
pub use passes::shadow_map::{AlphaImage, AlphaMask, CasterMasks, ShadowCasters};
pub use surface::SceneTexels;
