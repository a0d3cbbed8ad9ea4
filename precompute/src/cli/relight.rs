//! Flags of `precompute relight`, and of pictures.

use clap::{Args, ValueEnum};
use localprt_tools::arguments::{parse_exposure, parse_size};
use std::path::PathBuf;

/// `precompute relight`
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("outputs").required(true).multiple(true))]
pub struct Relight {
    /// Baked file
    #[arg(value_name = "FILE.lprt")]
    pub file: PathBuf,
    /// Scene with the lightmap coordinates [default: the one named in the baked file]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Material variant of the scene (KHR_materials_variants) [default: none]
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
    /// Lighting file [default: the scene's own lights, black sky]
    #[arg(long, value_name = "L.json")]
    pub lights: Option<PathBuf>,
    /// Gathers: 1 is the first indirect bounce
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub bounces: u32,
    /// What computes
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// How direct light finds its shadows
    #[arg(long, value_enum, default_value_t)]
    pub direct: Direct,
    /// Indirect irradiance in lightmap coordinates, linear; row 0 is at v = 0
    #[arg(short, long, value_name = "LIGHTMAP.exr", group = "outputs")]
    pub output: Option<PathBuf>,
    /// Write 16-bit instead of 32-bit floats into the .exr
    #[arg(long, requires = "output")]
    pub half: bool,
    /// The same as a texture of 16-bit floats, for engines: irradiance, alpha 1 where there is light
    #[arg(long, value_name = "OUT.ktx2", group = "outputs")]
    pub ktx2: Option<PathBuf>,
    /// The scene with all of this light in it, for programs that know nothing of lightmaps: one texture of what surfaces send out
    #[arg(long, value_name = "OUT.glb", group = "outputs")]
    pub glb: Option<PathBuf>,
    /// Every valid receiver with its indirect irradiance, as binary PLY
    #[arg(long, value_name = "OUT.ply", group = "outputs")]
    pub receivers: Option<PathBuf>,
    /// Figures of this lighting state, as JSON (`-` is standard output)
    #[arg(long, value_name = "OUT.json", group = "outputs")]
    pub json: Option<PathBuf>,
    /// A picture of the lit scene
    #[arg(long, value_name = "OUT.png", group = "outputs")]
    pub picture: Option<PathBuf>,
    /// Look of the picture.
    #[command(flatten)]
    pub view: View,
}

/// How a picture is taken.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Picture")]
pub struct View {
    /// Camera of the scene, from 0 [default: the first; without any, one that shows the whole scene]
    #[arg(long, value_name = "N", requires = "picture")]
    pub camera: Option<usize>,
    /// Pixels [default: 960 wide, in the camera's shape]
    #[arg(long, value_name = "WxH", requires = "picture", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// Brightness: radiance times 2^EV [default: from the picture]
    #[arg(long, value_name = "EV", requires = "picture", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// Show light alone: surfaces in the picture reflect this share of it; the light itself stays as it is
    #[arg(long, value_name = "ALBEDO", requires = "picture", num_args = 0..=1, default_missing_value = "0.5",
          value_parser = parse_share)]
    pub albedo_override: Option<f32>,
}

/// What computes a lighting state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// The reference, on all cores
    #[default]
    Cpu,
    /// Compute shaders, with the same results up to rounding
    Gpu,
}

/// How direct light finds its shadows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Direct {
    /// Exact, by rays
    #[default]
    Traced,
    /// As real-time renderers do: maps of 2048 texels per side
    ShadowMap,
}

fn parse_share(text: &str) -> Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| "expected a number from 0 to 1".into())
}
