#![doc = include_str!("../README.md")]

pub mod checked_bake;
pub mod checked_volume;
pub mod coverage_map;
pub mod cpu_relighter;
pub mod error;
pub mod passes;

#[cfg(test)]
mod test_bake;

pub use checked_bake::CheckedBake;
pub use checked_volume::{CheckedVolume, Validity};
pub use coverage_map::CoverageMap;
pub use cpu_relighter::{CpuRelighter, DEFAULT_FEEDBACK_ALBEDO_CAP, RelightInputs, Relit};
pub use error::RelightError;
pub use passes::direct_lightmap::SurfaceTexels;
pub use passes::volume_fill::VolumeSampler;
