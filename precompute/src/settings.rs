//! Options of a bake: unit, range, default and source of each.
//!
//! [`BakeSettings::resolve`] puts the layers together: flags over a configuration file over a [`Preset`] over the
//! defaults; [`BakeSettings::check`] holds the ranges.

mod layers;
mod preset;
mod ranges;

pub use layers::{FILL_IS_GONE, FLAG_LAYER, SettingsError};
pub use preset::Preset;
pub use ranges::{MAX_PROBES, OutOfRange};

use serde::{Deserialize, Serialize};

/// All options of a bake; the keys of a `--config` file and, with dashes, the flags of `precompute bake`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BakeSettings {
    /// Probe spacing rho in metres; absent: from the scene box, for about 150 probes (SL17 4.1, value unstated).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing: Option<f32>,
    /// Probe count; absent: points of a regular grid of that spacing over the scene box (SL17 4.1).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probes: Option<u32>,
    /// Voxel size in metres; absent: spacing / 6, larger where the grid would exceed its memory cap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel: Option<f32>,
    /// Points known to be inside the space to light, metres; absent: found by rays.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub interior: Vec<[f32; 3]>,
    /// Distance of the probes from surfaces, as a share of the probe spacing; 0 is beside them, in the voxels next to solid
    /// ones (SL17 4.1, whose voxel size is unstated).
    pub standoff: f32,
    /// Probes whose support holds a receiver, mean (SL17 4.1).
    pub overlap: f32,
    /// The same, least for every receiver.
    pub min_overlap: u32,
    /// Most probes the coverage repair may add, as a share of the probe count.
    pub repair: f32,
    /// SH degree of the probes, 0..=10 (SL17 5).
    pub probe_degree: u32,
    /// SH degree of the receivers: 0 irradiance, 1 for normal maps (SL17 5.1).
    pub receiver_degree: u32,
    /// SH degree of the sky columns, 0..=10.
    pub sky_degree: u32,
    /// Receivers to spend; fewer where the map or the finest texel does not allow as many, and where the scene's own
    /// TEXCOORD_1 is kept only about as many.
    pub receivers: u32,
    /// How receivers and probes are spread.
    pub density: Density,
    /// Balls that get finer texels and more probes: x, y, z and radius, metres.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub focus: Vec<[f32; 4]>,
    /// Receiver map, texels per side; absent: as few as hold the receivers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lightmap: Option<u32>,
    /// Edge of the finest texel of the receiver map, metres; absent: what the scene's detail and the receivers allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texel: Option<f32>,
    /// Direct light map, texels per side (SL17 5).
    pub direct_map: u32,
    /// Gather rays per receiver (SL17: unstated).
    pub gather_rays: u32,
    /// Relight rays per probe (SL17 4.2).
    pub relight_rays: u32,
    /// How transport rows are made.
    pub transport: Transport,
    /// Bytes a receiver for what it reads from the light map itself, on average; 0 leaves all light to the probes. Paper rows
    /// read none.
    pub near_bytes: u32,
    /// Spacing in metres of a volume for objects that move, over the scene box; absent: no volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f32>,
    /// SH degree of the volume, 1 or 2.
    pub volume_degree: u32,
    /// A leaf of the receiver tree holds fewer receivers than this (SL17 4.1).
    pub leaf: u32,
    /// Largest RMS error per transport row of a leaf (SL17 4.1); of fitted rows, of irradiance in the light that the
    /// fit expects, as a share of what is usual there.
    pub threshold: f32,
    /// Most singular values kept per cluster (SL17 4.1).
    pub coefficients: u32,
    /// Unwrap backend where the scene has no usable TEXCOORD_1.
    pub unwrap: UnwrapBackend,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The bake fails (exit code 7) when the mean unseen share exceeds this, 0..=1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_unseen: Option<f32>,
}

/// How receivers and probes are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Density {
    /// By the local scale: many where surfaces are near each other, few in the open.
    #[default]
    Scale,
    /// Evenly, as in the paper's scenes.
    Uniform,
}

/// How transport rows are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transport {
    /// Probes that see a point are blended by distance (SL17 Eq. 4).
    Paper,
    /// Fitted to smooth light on the surfaces around: rows of the same shape with less error.
    #[default]
    Fitted,
}

/// Who makes lightmap coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnwrapBackend {
    /// The uvunwrap crate: pure Rust, deterministic.
    #[default]
    Uvunwrap,
    /// xatlas, in a child process; needs the build feature `xatlas`.
    Xatlas,
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self {
            spacing: None,
            probes: None,
            voxel: None,
            interior: Vec::new(),
            standoff: 0.35,
            overlap: 10.0,
            min_overlap: 3,
            repair: 0.1,
            probe_degree: 7,
            receiver_degree: 0,
            sky_degree: 4,
            receivers: 250_000,
            density: Density::Scale,
            focus: Vec::new(),
            lightmap: None,
            texel: None,
            direct_map: 2048,
            gather_rays: 1024,
            relight_rays: 8000,
            transport: Transport::Fitted,
            near_bytes: 32,
            volume: None,
            volume_degree: 1,
            leaf: 1024,
            threshold: 0.005,
            coefficients: 32,
            unwrap: UnwrapBackend::Uvunwrap,
            seed: 0,
            max_unseen: None,
        }
    }
}

impl BakeSettings {
    /// Bytes of near light a receiver; `None` where it is off.
    pub fn near_bytes_in_force(&self) -> Option<f32> {
        (self.near_bytes > 0 && self.transport == Transport::Fitted).then_some(self.near_bytes as f32)
    }
}
