//! Bakes local-reconstruction precomputed radiance transfer (Silvennoinen and Lehtinen 2017).

pub mod clusters;
pub mod compress;
pub mod lightmap;
pub mod probes;
pub mod rays;
pub mod relight_rays;
pub mod settings;
pub mod transport;
pub mod voxels;
