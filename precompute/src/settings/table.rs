//! Every option of a bake, in the order of the keys: field, default, presets, range, key, flag and help. A new one is one
//! more entry.
//!
//! ```text
//! /// Text of `--help`
//! ///
//! /// What else the documentation of the field says.
//! key: type = default, preview: value, medium: value, absent: "default in words"
//!     => rule of its range, "VALUE" in "Heading of --help" after "key before it there", source: "where it is from";
//! ```
//!
//! What there is nothing to say about is left out. The rules stand in [`super::ranges`]; SL17 is Silvennoinen and Lehtinen
//! 2017.

use super::bake_option::bake_options;
use super::ranges::{MAX_PROBES, any, ball, each, given, length, place, power_of_two, rows_of_a_receiver_to, within};
use super::values::words;

bake_options! {
    /// Probe spacing in metres
    spacing: Option<f32> = None, absent: "from the scene box, for about 150 probes"
        => given(length), "M" in "Probes", source: "rho of SL17 4.1, value unstated";

    /// Number of probes
    ///
    /// Absent: points of a regular grid of that spacing over the scene box.
    probes: Option<u32> = None, absent: "from the spacing"
        => given(within(1..=MAX_PROBES)), "N" in "Probes", source: "SL17 4.1";

    /// Voxel size in metres
    ///
    /// Absent: larger than a sixth of the spacing where the grid would exceed its memory cap.
    voxel: Option<f32> = None, absent: "spacing / 6, capped by memory" => given(length), "M" in "Probes";

    /// A point in the space to light, metres; may be given several times
    interior: Vec<[f32; 3]> = Vec::new(), absent: "found by rays" => each(place), "X,Y,Z" in "Probes";

    /// Distance of the probes from surfaces as a share of their spacing; 0 is in the voxels beside surfaces
    standoff: f32 = 0.35 => within(0.0..=10.0), "SHARE" in "Probes", source: "SL17 4.1 for 0, voxel size unstated";

    /// Mean number of probes that support a receiver
    overlap: f32 = 10.0 => within(1.0..=1000.0), "N" in "Probes", source: "SL17 4.1";

    /// Least number of probes that support a receiver
    min_overlap: u32 = 3 => within(0..=1000), "N" in "Probes";

    /// Probes that may be added where coverage is poor, as a share of their number
    repair: f32 = 0.1 => within(0.0..=1.0), "SHARE" in "Probes";

    /// SH degree of the probes: l means (l+1)^2 functions
    probe_degree: u32 = 7 => within(0..=10), "L" in "Probes", source: "SL17 5";

    /// SH degree of the receivers: 0 irradiance, 1 for normal maps
    receiver_degree: u32 = 0 => within(0..=1), "L" in "Receivers" after "direct_map", source: "SL17 5.1";

    /// SH degree of the sky
    sky_degree: u32 = 4 => within(0..=10), "L" in "Receivers" after "direct_map";

    /// Receivers to spend: more cost time and bytes
    ///
    /// Fewer where the map or the finest texel does not allow as many, and where the scene's own TEXCOORD_1 is kept only
    /// about as many.
    receivers: u32 = 250_000, preview: 60_000, medium: 120_000 => within(1..=1 << 26), "N" in "Receivers";

    /// How receivers and probes are spread: by the scale of what is around them, or evenly
    density: Density = Density::Scale => any, "DENSITY" in "Receivers";

    /// A ball in which texels are finer and probes closer, metres; may be given several times
    focus: Vec<[f32; 4]> = Vec::new() => each(ball), "X,Y,Z,RADIUS" in "Receivers";

    /// Receiver map: texels per side
    lightmap: Option<u32> = None, absent: "as few as hold the receivers"
        => given(within(16..=8192)), "TEXELS" in "Receivers";

    /// Edge of the finest texel of the receiver map in metres
    ///
    /// Absent: the receivers have to allow it, too.
    texel: Option<f32> = None, absent: "what the scene's detail asks for" => given(length), "M" in "Receivers";

    /// Direct light map: texels per side
    direct_map: u32 = 2048, preview: 1024, medium: 2048
        => power_of_two(8..=16_384), "TEXELS" in "Receivers", source: "SL17 5";

    /// Gather rays per receiver
    gather_rays: u32 = 1024, preview: 512, medium: 768
        => within(1..=1 << 20), "N" in "Receivers", source: "SL17, value unstated";

    /// Relight rays per probe
    relight_rays: u32 = 8000, preview: 2000, medium: 4000 => within(1..=1 << 20), "N" in "Probes", source: "SL17 4.2";

    /// How transport rows are made
    transport: Transport = Transport::Fitted => any, "TRANSPORT" in "Receivers";

    /// Bytes a receiver, on average, for near light that it reads from the light map itself; 0: none
    ///
    /// 0 leaves all light to the probes. Paper rows read none.
    near_bytes: u32 = 32 => within(0..=1000), "BYTES" in "Receivers";

    /// Light for objects that move: spacing in metres of a grid over the scene box
    volume: Option<f32> = None, absent: "none" => given(length), "M" in "Volume";

    /// SH degree of the light in that grid: 1 or 2
    volume_degree: u32 = 1 => within(1..=2), "L" in "Volume";

    /// What light does with surfaces that let most of it through (KHR_materials_transmission)
    glass: Glass = Glass::Opaque => any, "GLASS" in "Receivers";

    /// A leaf holds fewer receivers than this
    leaf: u32 = 1024 => within(2..=8192), "N" in "Compression", source: "SL17 4.1";

    /// Largest RMS error of a transport row; of fitted rows, of what it does to irradiance in the light that the fit expects
    ///
    /// Over the rows of a leaf; of fitted ones, as a share of what is usual there. Below the range, rounding to f16 alone is
    /// more.
    threshold: f32 = 0.005 => within(0.001..=1.0), "RMS" in "Compression", source: "SL17 4.1";

    /// Most coefficients of a cluster
    ///
    /// They belong to the singular values that it keeps.
    coefficients: u32 = 32 => rows_of_a_receiver_to(255), "N" in "Compression", source: "SL17 4.1";

    /// Who makes lightmap coordinates where the scene has no usable TEXCOORD_1
    unwrap: UnwrapBackend = UnwrapBackend::Uvunwrap => any, "UNWRAP" in "Receivers";

    /// Seed of all random numbers
    ///
    /// A TOML integer is an i64.
    seed: u64 = 0 => within(0..=i64::MAX as u64), "N" in "Reproduction and quality";

    /// Fail with exit code 7 if the mean unseen share of the receivers exceeds this
    max_unseen: Option<f32> = None, absent: "no limit"
        => given(within(0.0..=1.0)), "SHARE" in "Reproduction and quality";
}

words! {
    /// How receivers and probes are spread: by the local scale, or evenly.
    Density {
        /// Many where surfaces are near each other, few in the open
        Scale = "scale",
        /// As the paper's scenes have them
        Uniform = "uniform",
    }

    /// What light does with clear surfaces.
    Glass {
        /// Stops there: they have a lightmap, and are lit as if they were painted
        Opaque = "opaque",
        /// Passes unbent: they are no part of the baked scene
        Clear = "clear",
    }

    /// How transport rows are made.
    Transport {
        /// Probes that see a point are blended by distance
        ///
        /// Source: SL17 Eq. 4.
        Paper = "paper",
        /// Fitted to smooth light on the surfaces around: rows of the same shape with less error, a longer bake
        Fitted = "fitted",
    }

    /// Who makes lightmap coordinates: the crate uvunwrap, or xatlas, which needs the build feature of its name.
    UnwrapBackend {
        /// Pure Rust, same result everywhere
        Uvunwrap = "uvunwrap",
        /// In a process of its own; if this build has it
        Xatlas = "xatlas",
    }

    /// Named sets of options: how much work a bake does.
    Preset {
        /// A tenth of the cost, for a first look
        ///
        /// A quarter of the receivers, half of the rays of each.
        Preview = "preview",
        /// A quarter of the cost
        Medium = "medium",
        /// The defaults
        Production = "production",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_is_within_its_range() {
        for option in OPTIONS {
            assert_eq!((option.check)(&BakeSettings::default()), Ok(()), "{}", option.key);
        }
        for preset in [Preset::Preview, Preset::Medium, Preset::Production] {
            assert_eq!(preset.settings().check(), Ok(()), "{preset:?}");
        }
    }

    #[test]
    fn gather_cost_rises_from_preset_to_preset() {
        let cost = |preset: Preset| {
            let settings = preset.settings();
            u64::from(settings.receivers) * u64::from(settings.gather_rays)
        };
        let costs = [Preset::Preview, Preset::Medium, Preset::Production].map(cost);
        assert!(costs[0] * 8 <= costs[2], "preview is to cost an eighth or less");
        assert!(costs[0] < costs[1] && costs[1] < costs[2]);
        assert_eq!(Preset::Production.settings(), BakeSettings::default());
    }

    #[test]
    fn values_outside_are_refused_by_name() {
        let refused = |settings: BakeSettings| settings.check().expect_err("to be refused").key;
        let settings = BakeSettings::default;
        assert_eq!(refused(BakeSettings { gather_rays: 0, ..settings() }), "gather_rays");
        assert_eq!(refused(BakeSettings { near_bytes: 1001, ..settings() }), "near_bytes");
        assert_eq!(refused(BakeSettings { spacing: Some(0.0), ..settings() }), "spacing");
        assert_eq!(refused(BakeSettings { texel: Some(f32::INFINITY), ..settings() }), "texel");
        assert_eq!(refused(BakeSettings { overlap: f32::NAN, ..settings() }), "overlap");
        assert_eq!(refused(BakeSettings { probe_degree: 11, ..settings() }), "probe_degree");
        assert_eq!(refused(BakeSettings { interior: vec![[0.0, f32::NAN, 0.0]], ..settings() }), "interior");
        assert_eq!(refused(BakeSettings { focus: vec![[0.0, 0.0, 0.0, 0.0]], ..settings() }), "focus");
        assert_eq!(refused(BakeSettings { lightmap: Some(8), ..settings() }), "lightmap");
        assert_eq!(refused(BakeSettings { receivers: 0, ..settings() }), "receivers");
        assert_eq!(refused(BakeSettings { seed: u64::MAX, ..settings() }), "seed");
        assert_eq!(refused(BakeSettings { volume: Some(-1.0), ..settings() }), "volume");
        assert_eq!(refused(BakeSettings { volume_degree: 3, ..settings() }), "volume_degree");
        let small = BakeSettings { coefficients: 8, volume_degree: 2, ..settings() };
        assert_eq!(small.check(), Ok(()), "no volume, no need for its rows");
        assert_eq!(refused(BakeSettings { volume: Some(1.0), ..small }), "coefficients");
        assert_eq!(refused(BakeSettings { max_unseen: Some(1.5), ..settings() }), "max_unseen");
    }

    #[test]
    fn what_is_allowed_is_said_in_words() {
        let said = |settings: BakeSettings| settings.check().expect_err("to be refused").to_string();
        let text = said(BakeSettings { direct_map: 12, ..BakeSettings::default() });
        assert_eq!(text, "direct_map = 12 is out of range; allowed: a power of two from 8 to 16384");
        let text = said(BakeSettings { coefficients: 3, receiver_degree: 1, ..BakeSettings::default() });
        assert_eq!(text, "coefficients = 3 is out of range; allowed: 4 to 255");
        let text = said(BakeSettings { threshold: 0.0005, ..BakeSettings::default() });
        assert_eq!(text, "threshold = 0.0005 is out of range; allowed: 0.001 to 1");
    }
}
