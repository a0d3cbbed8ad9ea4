//! Bakes local-reconstruction precomputed radiance transfer (Silvennoinen and Lehtinen 2017).

pub mod clusters;
pub mod compress;
pub mod error;
pub mod lightmap;
pub mod output;
pub mod picture;
pub mod pipeline;
pub mod probes;
pub mod progress;
pub mod rays;
pub mod relight;
pub mod relight_rays;
pub mod report;
pub mod settings;
pub mod transport;
pub mod voxels;
