#![doc = include_str!("../README.md")]

pub mod coverage_map;
pub mod cpu_relighter;
pub mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod host_shading;
mod light_maps;
mod occluder;
pub mod passes;
#[cfg(feature = "gpu")]
mod relighter;
pub mod scene_light;
#[cfg(feature = "gpu")]
mod shaders;
mod sky;
pub mod surface;
mod surface_texels;
mod texel_sample;
#[cfg(feature = "gpu")]
mod transport_pages;
pub mod volume;

#[cfg(test)]
mod test_bake;
#[cfg(all(test, feature = "gpu"))]
mod test_gpu;

pub use coverage_map::CoverageMap;
pub use cpu_relighter::{CpuRelighter, DEFAULT_FEEDBACK_ALBEDO_CAP, RelightInputs, Relit};
pub use error::RelightError;
#[cfg(feature = "gpu")]
pub use gpu::PassTime;
pub use light_maps::LightMaps;
pub use localprt_scenes::SurfacePoint;
pub use occluder::{MAX_OCCLUDERS, Occluder, OccluderShape};
#[cfg(feature = "gpu")]
pub use passes::direct_irradiance::{DIRECT_LIGHT_WGSL, DirectOptions};
pub use passes::shadow_map::{AlphaImage, AlphaMask, CasterMasks, ShadowCasters};
pub use passes::volume_fill::VolumeSampler;
#[cfg(feature = "gpu")]
pub use relighter::{DirectLight, MapPrecision, Relighter, RelighterOptions, VolumeTextures};
pub use scene_light::SceneLight;
#[cfg(feature = "gpu")]
pub use shaders::HOST_WGSL;
pub use sky::sky_sh;
pub use surface::SceneTexels;
pub use surface_texels::SurfaceTexels;
pub use texel_sample::TexelSample;
pub use volume::{Validity, Volume};
