//! The command line: subcommands, flags, help. The only place that names clap, together with its folder.

mod bake_flags;
mod relight;
mod validate;

pub use bake_flags::BakeFlags;
pub use relight::{Backend, Direct, Relight, View};
pub use validate::Validate;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{ArgAction, Args, Parser, Subcommand};
use localprt_precompute::cache::Place;
use localprt_precompute::settings::Preset;
use localprt_precompute::shards::MOST_SHARDS;
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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
