//! The command line of the viewer.

use crate::other_system::names;
use crate::tone::ToneMap;
use crate::views::ViewKind;
use clap::{Parser, ValueEnum};
use localprt_tools::arguments::{parse_exposure, parse_size};
use std::path::PathBuf;

/// Shows a baked scene relit in real time.
#[derive(Clone, Debug, Parser)]
#[command(
    name = "viewer",
    version,
    about = "Shows a baked scene relit in real time",
    override_usage = "viewer FILE.lprt\n       viewer FILE.lprt --headless --screenshot OUT.png",
    after_help = "Exit codes: 0 done, 1 internal failure, 2 bad usage, 3 invalid input, 5 no adapter or one that is too \
                  small, 6 I/O.\nKeys of the window: F1."
)]
#[command(group = clap::ArgGroup::new("pictures").multiple(true))]
pub struct Cli {
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
    /// Camera of the scene, from 0 [default: the first; without any, one that shows the whole scene]
    #[arg(long, value_name = "N")]
    pub camera: Option<usize>,
    /// What surfaces show
    #[arg(long, value_name = "NAME", default_value = "final", value_parser = parse_view)]
    pub view: ViewKind,
    /// Another system's light beside the file's, on the same scene and light [with --headless at rest, after 320 updates at most; with --frames after so many]
    #[arg(long, value_name = "NAME", value_parser = parse_system)]
    pub system: Option<&'static str>,
    /// Share of the picture's width, from the left, that stays the file's
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = parse_share, requires = "system")]
    pub split: f32,
    /// Draw over the scene; may be given several times
    #[arg(long, value_name = "NAME", value_enum)]
    pub overlay: Vec<OverlayName>,
    /// Probe for the overlays support and rays
    #[arg(long, value_name = "N")]
    pub probe: Option<u32>,
    /// Pick the receiver at this place of the picture, in shares of its width and height
    #[arg(long, value_name = "X,Y", value_parser = parse_pair)]
    pub pick: Option<(f32, f32)>,
    /// Pixels [default: 960 wide, in the camera's shape; a window: 1280x720]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// Brightness: radiance times 2^EV [default: from the picture]
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// From radiance to the screen
    #[arg(long, value_name = "NAME", default_value = "reinhard", value_parser = parse_tone_map)]
    pub tone_map: ToneMap,
    /// Exactly so many gathers per frame, from darkness [default: one per frame on top of all earlier ones]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub bounces: Option<u32>,
    /// Mirror reflection of direct and, where the file has directions, indirect light
    #[arg(long)]
    pub specular: bool,
    /// Surfaces keep their own normals
    #[arg(long)]
    pub no_normal_maps: bool,
    /// Leave backs of one-sided surfaces out
    #[arg(long)]
    pub cull_backs: bool,
    /// Put something before the camera; may be given several times
    #[arg(long = "with", value_name = "THING", value_enum)]
    pub things: Vec<Thing>,
    /// Start with lights and things in motion
    #[arg(long)]
    pub animate: bool,
    /// No window: needs no display
    #[arg(long, requires = "pictures")]
    pub headless: bool,
    /// Picture to write; with a window, of the window's picture, which then closes
    #[arg(long, value_name = "OUT.png", group = "pictures")]
    pub screenshot: Option<PathBuf>,
    /// Folder for the frames of a flight along the scene's cameras, or around the first; made if missing
    #[arg(long, value_name = "DIR", group = "pictures", conflicts_with = "screenshot", requires = "headless")]
    pub record: Option<PathBuf>,
    /// The camera of a recording stays where it is
    #[arg(long, requires = "record")]
    pub still: bool,
    /// Frames before the screenshot, each with a gather; of a recording [default: 8; of a recording 120]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,
    /// Start without the panel
    #[arg(long)]
    pub no_panel: bool,
    /// Loses the device after so many frames of the window, to try how that ends.
    #[arg(long, hide = true, value_name = "K")]
    pub lose_device: Option<u64>,
}

/// What the viewer can bring along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Thing {
    /// A black ball that blocks light
    Ball,
    /// A door
    Door,
    /// A white ball in the light of the place
    LitBall,
    /// A torch in the hand
    Torch,
    /// A point light that goes around
    Lamp,
}

/// What can be drawn over the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OverlayName {
    /// All probes, as balls that show their radiance
    Probes,
    /// The support radius of a probe
    Support,
    /// The relight rays of a probe
    Rays,
    /// A receiver with its supporting probes: that of --pick, or in the middle of the picture
    Receiver,
    /// Lights
    Lights,
}

fn parse_view(text: &str) -> Result<ViewKind, String> {
    ViewKind::of_name(text).ok_or_else(|| one_of(ViewKind::ALL.map(ViewKind::name)))
}

fn parse_tone_map(text: &str) -> Result<ToneMap, String> {
    ToneMap::of_name(text).ok_or_else(|| one_of(ToneMap::ALL.map(ToneMap::name)))
}

fn one_of<const N: usize>(names: [&str; N]) -> String {
    format!("expected one of {}", names.join(", "))
}

fn parse_system(text: &str) -> Result<&'static str, String> {
    let all: Vec<&str> = names().collect();
    if all.is_empty() {
        return Err("this viewer was built without the feature systems".into());
    }
    names().find(|name| *name == text).ok_or_else(|| format!("expected one of {}", all.join(", ")))
}

fn parse_share(text: &str) -> Result<f32, String> {
    let share = text.parse::<f32>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a number from 0 to 1".into())
}

fn parse_pair(text: &str) -> Result<(f32, f32), String> {
    let share = |text: &str| text.trim().parse::<f32>().ok().filter(|share| (0.0..=1.0).contains(share));
    let pair = text.split_once(',').and_then(|(x, y)| Some((share(x)?, share(y)?)));
    pair.ok_or_else(|| "expected two numbers from 0 to 1, such as 0.5,0.5".into())
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
    fn pictures_without_a_window_are_asked_for() {
        let parse = |line: &str| Cli::try_parse_from(line.split(' '));
        assert!(parse("viewer a.lprt").is_ok());
        assert!(parse("viewer a.lprt --headless").is_err(), "nothing to do");
        assert!(parse("viewer a.lprt --headless --screenshot a.png --view clusters").is_ok());
        assert!(parse("viewer a.lprt --headless --record frames --frames 10").is_ok());
        assert!(parse("viewer a.lprt --view nonsense").is_err());
        assert!(parse("viewer a.lprt --pick 0.5,2").is_err());
        for name in names() {
            assert!(parse(&format!("viewer a.lprt --system {name} --split 0.3")).is_ok());
        }
        assert!(parse("viewer a.lprt --system nonsense").is_err());
        assert!(parse("viewer a.lprt --split 0.3").is_err(), "nothing to split");
    }
}
