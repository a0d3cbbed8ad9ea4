//! The command line: subcommands, flags, help. The only place that names clap, together with [`bake_flags`].

mod bake_flags;

pub use bake_flags::BakeFlags;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use localprt_precompute::cache::Place;
use localprt_precompute::settings::Preset;
use localprt_precompute::shards::MOST_SHARDS;
use localprt_precompute::validate::systems::{Budget, Systems};
use localprt_tools::arguments::{parse_exposure, parse_size};
use std::path::PathBuf;

const EXAMPLE: &str = "\
Bake a scene once, then light it as often as you like:

  precompute bake hall.glb -o hall.lprt
  precompute relight hall.lprt --lights evening.json --picture evening.png

No scene at hand? `precompute demo` shows everything on the Cornell box.";

const EXIT_CODES: &str = "\
Exit codes:
  0 done                      5 unsupported feature or adapter
  1 internal failure          6 I/O: missing file, permissions, disk full
  2 bad usage                 7 a quality gate failed
  3 invalid input           130 interrupted
  4 incomplete

Data goes to standard output, messages and progress to standard error.";

const BAKE_EXAMPLE: &str = "\
Examples:
  precompute bake hall.glb -o hall.lprt --preset preview
  precompute bake builtin:cornell -o cornell.lprt --report cornell.json
  precompute bake --preset medium --print-config > bake.toml";

const PLAN_EXAMPLE: &str = "\
Example:
  precompute plan hall.glb -o hall.plan --shards 16
  precompute bake --plan hall.plan --shard 0      # and 1 to 15, anywhere, in any order
  precompute merge --plan hall.plan -o hall.lprt";

const RELIGHT_EXAMPLE: &str = "\
Examples:
  precompute relight hall.lprt --picture hall.png
  precompute relight hall.lprt --lights evening.json -o evening.exr --receivers evening.ply";

const VALIDATE_EXAMPLE: &str = "\
Examples:
  precompute validate hall.lprt -o hall-quality
  precompute validate hall.lprt -o hall-quality --lights noon.json --max-nrmse 0.1
  precompute validate hall.lprt -o hall-quality --sweep probes=20,50,150 --sweep degree=2,4,7";

const BATCH_EXAMPLE: &str = "\
Examples:
  precompute batch levels.toml --jobs 2
  precompute batch levels.toml --watch

levels.toml:
  [defaults]
  preset = \"preview\"
  validate = { max_nrmse = 0.1 }

  [[scene]]
  scene = \"hall.glb\"
  receivers = 120000

Paths in it start at its folder. docs/batch.md has all keys.";

const DIFF_EXIT_CODES: &str = "\
Exit codes: 0 nothing differs, 7 something does, 3 a file is damaged, 5 it is of another version of the format, 6 it cannot
be read.";

/// Precomputed light transport: bake a scene once, relight it in real time.
#[derive(Debug, Parser)]
#[command(name = "precompute", version, before_help = EXAMPLE, after_help = EXIT_CODES)]
#[command(arg_required_else_help = true, subcommand_required = true, max_term_width = 120)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Flags of every subcommand.
    #[command(flatten)]
    pub global: Global,
}

/// Flags of every subcommand.
#[derive(Debug, Args)]
#[command(next_help_heading = "Messages and machine")]
pub struct Global {
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more about each stage
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// Threads to use; the results do not depend on it [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bake a scene into a .lprt file
    #[command(before_help = BAKE_EXAMPLE)]
    Bake(Box<Bake>),
    /// Light a baked scene: maps, point clouds, pictures
    #[command(before_help = RELIGHT_EXAMPLE)]
    Relight(Box<Relight>),
    /// Compare a baked scene with path tracing: pictures, heat maps, figures
    #[command(before_help = VALIDATE_EXAMPLE)]
    Validate(Box<Validate>),
    /// Say what is inside a baked file
    Info(Info),
    /// Verify every checksum and every invariant of a baked file
    Check(Check),
    /// Say which leaves of a bake are baked together, in shards that any machine can bake
    #[command(before_help = PLAN_EXAMPLE)]
    Plan(Box<Plan>),
    /// Make a baked file of the shards of a plan
    Merge(Merge),
    /// Say what a cache of bakes holds; trim or verify it
    Cache(CacheCommand),
    /// Bake and validate the scenes of a list
    #[command(before_help = BATCH_EXAMPLE)]
    Batch(Batch),
    /// Say what differs between two baked files: by section, and in the light that they give
    #[command(after_help = DIFF_EXIT_CODES)]
    Diff(Diff),
    /// Write a built-in scene as .glb
    Scene(Scene),
    /// Bake, relight and validate the Cornell box, and say where the pictures are
    Demo(Demo),
    /// Say what this machine and this build have for baking and relighting, what is missing, and how to get it
    Doctor(Doctor),
    /// Print what makes a shell complete this command
    Completions(Completions),
    /// Write the manual pages
    Man(Man),
}

/// `precompute bake`
#[derive(Debug, Args)]
pub struct Bake {
    /// Scene: .gltf, .glb or builtin:NAME
    #[arg(value_name = "SCENE", required_unless_present_any = ["print_config", "plan"])]
    pub scene: Option<String>,
    /// Baked file to write; if the scene has to be unwrapped, OUT.glb is written beside it, or OUT.lightmap.glb where
    /// OUT.glb is the scene
    #[arg(short, long, value_name = "OUT.lprt", required_unless_present_any = ["print_config", "plan"])]
    pub output: Option<PathBuf>,
    /// Bake one shard of a plan, whose scene and options these are; what is finished already is not made again
    #[arg(long, value_name = "PLAN", requires = "shard", conflicts_with_all = ["scene", "output", "config", "print_config"])]
    pub plan: Option<PathBuf>,
    /// Number of the shard, from 0
    #[arg(long, value_name = "I", requires = "plan")]
    pub shard: Option<u32>,
    /// Also write what was made, how good it is and what it cost, as JSON (`-` is standard output)
    #[arg(long, value_name = "OUT.json")]
    pub report: Option<PathBuf>,
    /// Read options from a TOML file; its keys are the flags below with underscores
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Options to start from: --config and flags overrule them
    #[arg(long, value_parser = bake_flags::preset(), default_value = Preset::Production.name())]
    pub preset: Preset,
    /// Print the options in force as TOML for --config, and stop
    #[arg(long)]
    pub print_config: bool,
    /// Where results are kept from bake to bake.
    #[command(flatten)]
    pub cache: CacheFlags,
    /// Where charts, probes and leaves go.
    #[command(flatten)]
    pub layout: LayoutFlags,
    /// Options of the bake.
    #[command(flatten)]
    pub flags: BakeFlags,
}

/// `precompute plan`
#[derive(Debug, Args)]
pub struct Plan {
    /// Scene: .gltf, .glb or builtin:NAME
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Plan to write; leaves are kept in PLAN.parts beside it
    #[arg(short, long, value_name = "PLAN")]
    pub output: PathBuf,
    /// Number of shards
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SHARDS)))]
    pub shards: u32,
    /// Keep leaves there instead: a folder, or a bucket, that all machines reach
    #[arg(long, value_name = "PLACE", value_parser = place())]
    pub cache: Option<Place>,
    /// Scene of an earlier bake, with its baked file beside it, whose layout is kept
    #[arg(long, value_name = "PREVIOUS.glb")]
    pub layout: Option<PathBuf>,
    /// Read options from a TOML file; its keys are the flags below with underscores
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Options to start from: --config and flags overrule them
    #[arg(long, value_parser = bake_flags::preset(), default_value = Preset::Production.name())]
    pub preset: Preset,
    /// Options of the bake.
    #[command(flatten)]
    pub flags: BakeFlags,
}

/// `precompute merge`
#[derive(Debug, Args)]
pub struct Merge {
    /// The plan, all shards of which are baked
    #[arg(long, value_name = "PLAN")]
    pub plan: PathBuf,
    /// Baked file to write, and the scene beside it, as by `bake`
    #[arg(short, long, value_name = "OUT.lprt")]
    pub output: PathBuf,
    /// Also write the report of the bake as JSON (`-` is standard output)
    #[arg(long, value_name = "OUT.json")]
    pub report: Option<PathBuf>,
}

/// Where charts, probes and leaves go.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Layout")]
pub struct LayoutFlags {
    /// Scene of an earlier bake, with its baked file beside it: charts, probes and leaves stay where they are there, but for what
    /// has changed [default: the output that is replaced, if its options were the same]
    #[arg(long, value_name = "PREVIOUS.glb", conflicts_with = "new_layout")]
    pub layout: Option<PathBuf>,
    /// Lay everything out anew
    #[arg(long)]
    pub new_layout: bool,
}

/// Which results a bake keeps, and where.
#[derive(Debug, Args)]
#[command(next_help_heading = "Cache")]
pub struct CacheFlags {
    /// Results that are used again while nothing that they depend on has changed: a folder, or a bucket as in
    /// s3://BUCKET/FOLDER (gs://, az://); bakes may share it [default: .localprt-cache beside OUT.lprt]
    #[arg(long, value_name = "PLACE", conflicts_with = "no_cache", value_parser = place())]
    pub cache: Option<Place>,
    /// Make everything anew, and keep nothing
    #[arg(long)]
    pub no_cache: bool,
    /// Use what is there, and write nothing into it
    #[arg(long, conflicts_with = "no_cache")]
    pub cache_read: bool,
    /// Bytes that may be kept; those used longest ago go first, in a bucket those written longest ago [default: 16 GiB in a
    /// folder, no limit in a bucket]
    #[arg(long, value_name = "BYTES", conflicts_with = "no_cache")]
    pub cache_limit: Option<u64>,
    /// Say of each leaf that is made why it was not in the cache
    #[arg(long, conflicts_with = "no_cache")]
    pub explain: bool,
}

/// `precompute cache`
#[derive(Debug, Args)]
pub struct CacheCommand {
    /// Folder or bucket that bakes keep results in
    #[arg(value_name = "PLACE", value_parser = place())]
    pub place: Place,
    /// Remove results, those used longest ago first, until the others have no more bytes than this
    #[arg(long, value_name = "BYTES")]
    pub trim: Option<u64>,
    /// Hold every result against its checksum, and remove damaged ones
    #[arg(long)]
    pub verify: bool,
    /// Print it as JSON
    #[arg(long)]
    pub json: bool,
}

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

/// `precompute validate`
#[derive(Debug, Args)]
pub struct Validate {
    /// Baked file
    #[arg(value_name = "FILE.lprt")]
    pub file: PathBuf,
    /// Folder to write into; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Scene with the lightmap coordinates [default: the one named in the baked file]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Material variant of the scene (KHR_materials_variants) [default: none]
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
    /// Lighting file; may be given several times, the first one leads. With one file, the scene's own light is shown as
    /// well, if it has any [default: the scene's own lights, black sky]
    #[arg(long, value_name = "L.json")]
    pub lights: Vec<PathBuf>,
    /// Gathers: 1 is the first indirect bounce
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub bounces: u32,
    /// End with exit code 7 if the nrmse under a given lighting is above this
    #[arg(long, value_name = "X", value_parser = parse_positive)]
    pub max_nrmse: Option<f64>,
    /// End with exit code 7 if the nrmse of what a camera sees, under a given lighting, is above this
    #[arg(long, value_name = "X", value_parser = parse_positive)]
    pub max_view_nrmse: Option<f64>,
    /// End with exit code 7 if the leak at the edges that a camera sees, under a given lighting, is above this
    #[arg(long, value_name = "X", value_parser = parse_positive)]
    pub max_leak: Option<f64>,
    /// End with exit code 7 if the mottling of the smooth surfaces that a camera sees, under a given lighting, is above this
    #[arg(long, value_name = "X", value_parser = parse_positive)]
    pub max_mottling: Option<f64>,
    /// Bake again with other values of an option and compare, such as probes=2,8,20,50,150 or degree=2,4,7,10; may be given
    /// several times
    #[arg(long, value_name = "OPTION=VALUES", help_heading = "Sweeps", value_parser = parse_sweep)]
    pub sweep: Vec<(String, Vec<String>)>,
    /// Also light the place that the file reconstructs worst by a small bright spot close by
    #[arg(long, help_heading = "Sweeps")]
    pub failure_case: bool,
    /// Also compare real-time systems on this scene and light, against the same reference: all, or some of file, hybrid, fitted, paper,
    /// spatial, arikan, ddgi, ddgi-scaled, light-field-irradiance, light-field-traced, light-field-exact, ssgi-probes, ssgi-probes-error,
    /// ssgi-probes-occlusion, with commas between them
    #[arg(long, value_name = "all|NAME,...", help_heading = "Systems")]
    pub systems: Option<Systems>,
    /// What systems that place their own probes may spend
    #[arg(long, value_name = "probes|bytes", default_value = "probes", help_heading = "Systems")]
    pub equal: Budget,
    /// Also let them follow a lamp that moves for 120 frames: lag and flicker
    #[arg(long, help_heading = "Systems", requires = "systems")]
    pub moving_lamp: bool,
    /// Receivers to measure, spread over the scene
    #[arg(long, value_name = "N", default_value_t = 4096, help_heading = "Reference",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub receivers: u32,
    /// Standard error of the reference to reach at a receiver, as a share of the mean irradiance
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, help_heading = "Reference", value_parser = parse_positive)]
    pub error: f64,
    /// Most paths per receiver
    #[arg(long, value_name = "N", default_value_t = 16_384, help_heading = "Reference",
          value_parser = clap::value_parser!(u32).range(512..=16_777_216))]
    pub paths: u32,
    /// Points at which the lightmap is compared as it is seen: per view, and spread over the scene by area
    #[arg(long, value_name = "N", default_value_t = 1500, help_heading = "Reference",
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub points: u32,
    /// Seed of the reference and of the choice of receivers and points
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Reference")]
    pub seed: u64,
    /// Camera of the scene, from 0 [default: up to three; without any, up to three probes that see most]
    #[arg(long, value_name = "N", help_heading = "Pictures")]
    pub camera: Option<usize>,
    /// Pixels per row
    #[arg(long, value_name = "N", default_value_t = 480, help_heading = "Pictures",
          value_parser = clap::value_parser!(u32).range(16..=2048))]
    pub width: u32,
    /// Paths per pixel of the reference
    #[arg(long, value_name = "N", default_value_t = 128, help_heading = "Pictures",
          value_parser = clap::value_parser!(u32).range(8..=65_536))]
    pub picture_paths: u32,
    /// Most paths per pixel of the smaller reference that FLIP compares with; fewer where FLIP between its halves is 0.01
    #[arg(long, value_name = "N", default_value_t = 8192, help_heading = "Pictures",
          value_parser = clap::value_parser!(u32).range(8..=1_048_576))]
    pub flip_paths: u32,
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

/// `precompute info`
#[derive(Debug, Args)]
pub struct Info {
    /// Baked file
    #[arg(value_name = "FILE.lprt")]
    pub file: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `precompute check`
#[derive(Debug, Args)]
pub struct Check {
    /// Baked file
    #[arg(value_name = "FILE.lprt")]
    pub file: PathBuf,
}

/// `precompute batch`
#[derive(Debug, Args)]
pub struct Batch {
    /// List of scenes and their options
    #[arg(value_name = "LEVELS.toml")]
    pub list: PathBuf,
    /// Scenes at a time; threads are divided between them, memory adds up
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: u16,
    /// Stay, and do again what depends on a file that changes, until Ctrl-C
    #[arg(long)]
    pub watch: bool,
}

/// `precompute diff`
#[derive(Debug, Args)]
pub struct Diff {
    /// Baked file
    #[arg(value_name = "A.lprt")]
    pub first: PathBuf,
    /// Baked file to hold against it
    #[arg(value_name = "B.lprt")]
    pub second: PathBuf,
    /// Lighting file that both are lit by; may be given several times [default: the lights of A's scene, black sky]
    #[arg(long, value_name = "L.json")]
    pub lights: Vec<PathBuf>,
    /// Gathers
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub bounces: u32,
    /// Compare what is in the files alone, and light nothing: needs no scenes
    #[arg(long, conflicts_with_all = ["lights", "bounces"])]
    pub sections: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `precompute scene`
#[derive(Debug, Args)]
pub struct Scene {
    /// Name of a built-in scene, such as cornell
    #[arg(value_name = "NAME")]
    pub name: String,
    /// File to write
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: PathBuf,
}

/// `precompute demo`
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder to write into; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "localprt-demo")]
    pub output: PathBuf,
}

/// `precompute doctor`
#[derive(Debug, Args)]
pub struct Doctor {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `precompute completions`
#[derive(Debug, Args)]
pub struct Completions {
    /// Which shell
    #[arg(value_name = "SHELL", value_enum)]
    pub shell: clap_complete::Shell,
}

/// `precompute man`
#[derive(Debug, Args)]
pub struct Man {
    /// Folder to write into, such as ~/.local/share/man/man1; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
}

impl Validate {
    /// Keys that a list of scenes has for the options: their flags with underscores, but for those that name files.
    pub fn keys() -> Vec<String> {
        let command = Self::augment_args(clap::Command::new("validate"));
        let keys = command.get_arguments().map(|argument| argument.get_id().to_string());
        keys.filter(|key| !["file", "output", "scene", "lights", "variant"].contains(&key.as_str())).collect()
    }

    /// Refuses flags as the command would, in its words.
    pub fn check(flags: &[String]) -> Result<(), String> {
        let command = Self::augment_args(clap::Command::new("validate").no_binary_name(true));
        let files = ["FILE", "--output", "DIR"].map(str::to_owned);
        command.try_get_matches_from(files.iter().chain(flags)).map(drop).map_err(|error| {
            let text = error.to_string();
            text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned()
        })
    }
}

impl Cli {
    /// Reads the command line.
    ///
    /// # Errors
    /// [`Refused`]: help and version as well as mistakes.
    pub fn read() -> Result<Self, Refused> {
        Self::try_parse().map_err(Refused)
    }
}

/// A command line that is not run: help, version, or a mistake.
pub struct Refused(clap::Error);

impl Refused {
    /// Prints help to standard output and mistakes to standard error; whether it was a mistake.
    pub fn print(&self) -> bool {
        // A reader that has gone away has read enough.
        let _ = self.0.print();
        self.0.use_stderr()
    }
}

/// Reads where a cache is, in letters of any kind.
fn place() -> impl TypedValueParser<Value = Place> {
    OsStringValueParser::new().try_map(Place::parse)
}

fn parse_share(text: &str) -> Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| "expected a number from 0 to 1".into())
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| "expected a number above 0".into())
}

fn parse_sweep(text: &str) -> Result<(String, Vec<String>), String> {
    let expected = "expected an option and its values, such as probes=2,8,20";
    let (option, values) = text.split_once('=').ok_or(expected)?;
    let values: Vec<String> = values.split(',').map(|value| value.trim().to_owned()).collect();
    if option.is_empty() || values.iter().any(String::is_empty) {
        return Err(expected.into());
    }
    Ok((option.trim().replace('-', "_"), values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_help_of_validate_names_every_system() {
        let mut command = Cli::command();
        let validate = command.find_subcommand_mut("validate").expect("a subcommand");
        let help = validate.render_long_help().to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        for system in localprt_precompute::validate::systems::Wanted::all() {
            assert!(help.contains(&format!(" {}", system.name())), "{system:?}");
        }
    }
}
