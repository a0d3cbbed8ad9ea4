//! How a relighter is set up, where its direct light comes from, and what it hands out of a volume.

use crate::passes::direct_irradiance::DirectOptions;
use localprt_formats::VolumeGrid;

/// Precision in which a map is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapPrecision {
    /// `Rgba16Float`: half the memory, filterable everywhere, values up to 65504.
    #[default]
    Half,
    /// `Rgba32Float`: filterable only with `Features::FLOAT32_FILTERABLE`.
    Single,
}

impl MapPrecision {
    pub(super) fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Half => wgpu::TextureFormat::Rgba16Float,
            Self::Single => wgpu::TextureFormat::Rgba32Float,
        }
    }
}

/// How a [`Relighter`](super::Relighter) is set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelighterOptions {
    /// Of the light map, which only the relight rays read. Single by default: texels beside a lamp are brighter than 65504.
    pub light_map: MapPrecision,
    /// Of the irradiance map, which the host samples and the next gather reads. Half by default.
    pub irradiance_map: MapPrecision,
    /// Gathers per [`Relighter::encode`](super::Relighter::encode), at least 1; more follow quick changes within one frame.
    pub bounces: u32,
    /// Limit of the albedo that multiplies the previous gather's irradiance, 0..=1.
    pub feedback_albedo_cap: f32,
    /// Of the shadow maps.
    pub direct: DirectOptions,
}

impl Default for RelighterOptions {
    fn default() -> Self {
        Self {
            light_map: MapPrecision::Single,
            irradiance_map: MapPrecision::Half,
            bounces: 1,
            feedback_albedo_cap: crate::DEFAULT_FEEDBACK_ALBEDO_CAP,
            direct: DirectOptions::default(),
        }
    }
}

/// Where the light map of a frame comes from.
#[derive(Clone, Copy, Debug)]
pub enum DirectLight<'a> {
    /// The lights of [`Relighter::set_lights`](super::Relighter::set_lights), shadows by shadow maps, over the scene of
    /// [`Relighter::set_scene`](super::Relighter::set_scene). Shadow maps are drawn again only after lights or scene have
    /// changed.
    Lights,
    /// Irradiance as last given to [`Relighter::set_direct`](super::Relighter::set_direct) or [`Relighter::set_surface`](super::Relighter::set_surface).
    Irradiance,
    /// A map of the host: `direct_size` texels per side in the light map's layout, outgoing radiance
    /// `Le + albedo/pi (D + E)` in rgb, where E is the irradiance map of the last frame, and coverage in alpha.
    /// One gather per frame, whatever `bounces` is.
    Texture(&'a wgpu::TextureView),
}

/// Textures of a volume, for trilinear reads at `(position - origin) / spacing + 0.5` texels.
#[derive(Clone, Copy, Debug)]
pub struct VolumeTextures<'a> {
    /// Where the cells lie.
    pub grid: &'a VolumeGrid,
    /// A 3D texture per SH coefficient of the incident radiance, world axes, 4 of degree 1 or 9 of degree 2: coefficient
    /// times weight in rgb, weight in alpha. Divide after filtering; alpha 0 is a place without light.
    pub coefficients: &'a [wgpu::TextureView],
}
