//! Flags of `precompute validate`, and what a list of scenes has for them.

use clap::Args;
use localprt_precompute::validate::systems::{Budget, Systems};
use std::path::PathBuf;

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

impl Validate {
    /// Keys that a list of scenes has for the options: their flags with underscores, but for those that name files.
    pub fn keys() -> Vec<String> {
        let command = Self::augment_args(clap::Command::new("validate"));
        let keys = command.get_arguments().map(|argument| argument.get_id().to_string());
        keys.filter(|key| !["file", "output", "scene", "lights"].contains(&key.as_str())).collect()
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
    use super::super::Cli;
    use clap::CommandFactory;

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
