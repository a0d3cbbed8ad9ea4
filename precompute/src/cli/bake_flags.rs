//! One flag per option of a bake.

use clap::{Args, ValueEnum};
use localprt_precompute::settings::{Density, FILL_IS_GONE, Preset, Transport, UnwrapBackend};
use serde::Serialize;
use toml::{Table, Value};

/// Options of a bake as given on the command line; field names are the keys of a configuration file.
#[derive(Debug, Default, Args, Serialize)]
pub struct BakeFlags {
    /// Probe spacing in metres [default: from the scene box, for about 150 probes]
    #[arg(long, value_name = "M", help_heading = "Probes", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    spacing: Option<f32>,
    /// Number of probes [default: from the spacing]
    #[arg(long, value_name = "N", help_heading = "Probes", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    probes: Option<u32>,
    /// Voxel size in metres [default: spacing / 6, capped by memory]
    #[arg(long, value_name = "M", help_heading = "Probes", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    voxel: Option<f32>,
    /// A point in the space to light, metres; may be given several times [default: found by rays]
    #[arg(long, value_name = "X,Y,Z", help_heading = "Probes", value_parser = point, allow_hyphen_values = true)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    interior: Vec<[f32; 3]>,
    /// Distance of the probes from surfaces as a share of their spacing; 0 is in the voxels beside surfaces
    #[arg(long, value_name = "SHARE", help_heading = "Probes", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    standoff: Option<f32>,
    /// Mean number of probes that support a receiver
    #[arg(long, value_name = "N", help_heading = "Probes", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    overlap: Option<f32>,
    /// Least number of probes that support a receiver
    #[arg(long, value_name = "N", help_heading = "Probes", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    min_overlap: Option<u32>,
    /// Probes that may be added where coverage is poor, as a share of their number
    #[arg(long, value_name = "SHARE", help_heading = "Probes", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    repair: Option<f32>,
    /// SH degree of the probes: l means (l+1)^2 functions
    #[arg(long, value_name = "L", help_heading = "Probes", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    probe_degree: Option<u32>,
    /// Relight rays per probe
    #[arg(long, value_name = "N", help_heading = "Probes", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    relight_rays: Option<u32>,

    /// Receivers to spend: more cost time and bytes
    #[arg(long, value_name = "N", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    receivers: Option<u32>,
    /// How receivers and probes are spread: by the scale of what is around them, or evenly
    #[arg(long, value_enum, help_heading = "Receivers")]
    #[serde(skip_serializing_if = "Option::is_none")]
    density: Option<DensityName>,
    /// A ball in which texels are finer and probes closer, metres; may be given several times
    #[arg(long, value_name = "X,Y,Z,RADIUS", help_heading = "Receivers", value_parser = ball, allow_hyphen_values = true)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    focus: Vec<[f32; 4]>,
    /// Receiver map: texels per side [default: as few as hold the receivers]
    #[arg(long, value_name = "TEXELS", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    lightmap: Option<u32>,
    /// Gone: see --receivers
    #[arg(long, value_name = "SHARE", hide = true, value_parser = gone, allow_negative_numbers = true)]
    #[serde(skip)]
    fill: Option<f32>,
    /// Edge of the finest texel of the receiver map in metres [default: what the scene's detail asks for]
    #[arg(long, value_name = "M", help_heading = "Receivers", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    texel: Option<f32>,
    /// Direct light map: texels per side
    #[arg(long, value_name = "TEXELS", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    direct_map: Option<u32>,
    /// SH degree of the receivers: 0 irradiance, 1 for normal maps
    #[arg(long, value_name = "L", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    receiver_degree: Option<u32>,
    /// SH degree of the sky
    #[arg(long, value_name = "L", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    sky_degree: Option<u32>,
    /// Gather rays per receiver
    #[arg(long, value_name = "N", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    gather_rays: Option<u32>,
    /// How transport rows are made
    #[arg(long, value_enum, help_heading = "Receivers")]
    #[serde(skip_serializing_if = "Option::is_none")]
    transport: Option<TransportName>,
    /// Bytes a receiver, on average, for near light that it reads from the light map itself; 0: none
    #[arg(long, value_name = "BYTES", help_heading = "Receivers", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    near_bytes: Option<u32>,
    /// Who makes lightmap coordinates where the scene has no usable TEXCOORD_1
    #[arg(long, value_enum, help_heading = "Receivers")]
    #[serde(skip_serializing_if = "Option::is_none")]
    unwrap: Option<UnwrapName>,

    /// Light for objects that move: spacing in metres of a grid over the scene box [default: none]
    #[arg(long, value_name = "M", help_heading = "Volume", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<f32>,
    /// SH degree of the light in that grid: 1 or 2
    #[arg(long, value_name = "L", help_heading = "Volume", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    volume_degree: Option<u32>,

    /// A leaf holds fewer receivers than this
    #[arg(long, value_name = "N", help_heading = "Compression", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    leaf: Option<u32>,
    /// Largest RMS error of a transport row; of fitted rows, of what it does to irradiance in the light that the fit expects
    #[arg(long, value_name = "RMS", help_heading = "Compression", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    threshold: Option<f32>,
    /// Most coefficients of a cluster
    #[arg(long, value_name = "N", help_heading = "Compression", value_parser = whole, allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    coefficients: Option<u32>,

    /// Seed of all random numbers
    #[arg(long, value_name = "N", help_heading = "Reproduction and quality", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    /// Fail with exit code 7 if the mean unseen share of the receivers exceeds this [default: no limit]
    #[arg(long, value_name = "SHARE", help_heading = "Reproduction and quality", allow_negative_numbers = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    max_unseen: Option<f32>,
}

impl BakeFlags {
    /// The given ones by key.
    pub fn to_table(&self) -> Table {
        Table::try_from(self).unwrap_or_default()
    }
}

/// `--preset`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PresetName {
    /// A tenth of the cost, for a first look
    Preview,
    /// A quarter of the cost
    Medium,
    /// The defaults
    #[default]
    Production,
}

impl From<PresetName> for Preset {
    fn from(name: PresetName) -> Self {
        match name {
            PresetName::Preview => Self::Preview,
            PresetName::Medium => Self::Medium,
            PresetName::Production => Self::Production,
        }
    }
}

/// `--density`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum DensityName {
    /// Many where surfaces are near each other, few in the open
    Scale,
    /// As the paper's scenes have them
    Uniform,
}

impl Serialize for DensityName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Scale => Density::Scale,
            Self::Uniform => Density::Uniform,
        }
        .serialize(serializer)
    }
}

/// `--transport`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TransportName {
    /// Probes that see a point are blended by distance
    Paper,
    /// Fitted to smooth light on the surfaces around: rows of the same shape with less error, a longer bake
    Fitted,
}

impl Serialize for TransportName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Paper => Transport::Paper,
            Self::Fitted => Transport::Fitted,
        }
        .serialize(serializer)
    }
}

/// `--unwrap`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum UnwrapName {
    /// Pure Rust, same result everywhere
    Uvunwrap,
    /// In a process of its own; if this build has it
    Xatlas,
}

impl Serialize for UnwrapName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Uvunwrap => UnwrapBackend::Uvunwrap,
            Self::Xatlas => UnwrapBackend::Xatlas,
        }
        .serialize(serializer)
    }
}

/// Shows the default of every flag that has one, as the settings have it.
pub fn with_defaults(command: clap::Command, defaults: &Table) -> clap::Command {
    command.mut_args(|flag| {
        let Some(value) = defaults.get(flag.get_id().as_str()) else { return flag };
        let value = match value {
            Value::String(text) => text.clone(),
            // Settings are f32: no more digits than those.
            Value::Float(wide) => (*wide as f32).to_string(),
            value => value.to_string(),
        };
        let help = flag.get_help().map(ToString::to_string).unwrap_or_default();
        flag.help(format!("{help} [default: {value}]"))
    })
}

fn whole(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| "expected a whole number, such as 512".into())
}

/// Exactly `N` numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let numbers: Vec<f32> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    <[f32; N]>::try_from(numbers).ok().filter(|_| text.split(',').count() == N)
}

fn point(text: &str) -> Result<[f32; 3], String> {
    numbers(text).ok_or_else(|| "expected three numbers in metres, such as 0,1.5,-2".into())
}

fn ball(text: &str) -> Result<[f32; 4], String> {
    numbers(text).ok_or_else(|| "expected a place and a radius in metres, such as 0,1.5,-2,3".into())
}

fn gone(_: &str) -> Result<f32, String> {
    Err(FILL_IS_GONE.replace('`', "").replace("receivers;", "--receivers;"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::FromArgMatches;
    use localprt_precompute::settings::BakeSettings;

    fn read(words: &[&str]) -> Table {
        let command = BakeFlags::augment_args(clap::Command::new("bake").no_binary_name(true));
        let matches = command.try_get_matches_from(words).expect("valid flags");
        BakeFlags::from_arg_matches(&matches).expect("valid flags").to_table()
    }

    #[test]
    fn every_option_has_a_flag_of_its_name() {
        let command = BakeFlags::augment_args(clap::Command::new("bake"));
        let options = serde_json::to_value(BakeSettings {
            spacing: Some(1.0),
            probes: Some(1),
            voxel: Some(1.0),
            interior: vec![[0.0; 3]],
            focus: vec![[1.0; 4]],
            lightmap: Some(64),
            texel: Some(1.0),
            volume: Some(1.0),
            max_unseen: Some(1.0),
            ..BakeSettings::default()
        });
        let options = options.expect("plain data");
        let mut keys: Vec<&str> = options.as_object().expect("a struct").keys().map(String::as_str).collect();
        let shown = command.get_arguments().filter(|flag| !flag.is_hide_set());
        let mut flags: Vec<&str> = shown.map(|flag| flag.get_id().as_str()).collect();
        keys.sort_unstable();
        flags.sort_unstable();
        assert_eq!(flags, keys);
        for flag in command.get_arguments() {
            assert_eq!(flag.get_long(), Some(flag.get_id().as_str().replace('_', "-").as_str()));
        }
    }

    #[test]
    fn given_flags_reach_the_settings_and_no_others() {
        assert!(read(&[]).is_empty());
        let words = ["--interior", "-1,2,0.5", "--interior=0,0,0", "--unwrap", "xatlas", "--threshold", "0.01"];
        let flags = read(&words);
        assert_eq!(flags.len(), 3);
        let settings = BakeSettings::resolve(Preset::Production, None, &flags).expect("valid");
        assert_eq!(settings.interior, [[-1.0, 2.0, 0.5], [0.0; 3]]);
        assert_eq!((settings.unwrap, settings.threshold), (UnwrapBackend::Xatlas, 0.01));
    }

    #[test]
    fn points_are_three_numbers() {
        assert_eq!(point("1, 2,3"), Ok([1.0, 2.0, 3.0]));
        for text in ["1,2", "1,2,3,4", "1,2,x", "", "1,2,3,"] {
            assert!(point(text).is_err(), "{text}");
        }
        assert_eq!(ball("1,2,3,0.5"), Ok([1.0, 2.0, 3.0, 0.5]));
        assert!(ball("1,2,3").is_err());
    }
}
