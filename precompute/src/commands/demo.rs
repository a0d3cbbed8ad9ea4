//! `precompute demo`: the whole way on the Cornell box: bake, relight, validate.

use super::relight::{How, light, take_picture, write_lightmap, write_picture};
use super::validate::Job;
use super::{bake, print_data, write_text};
use crate::cli::{Demo, LayoutFlags, View};
use localprt_precompute::error::CommandError;
use localprt_precompute::inputs;
use localprt_precompute::output::OutputError;
use localprt_precompute::picture::Exposure;
use localprt_precompute::progress::Progress;
use localprt_precompute::settings::Preset;
use localprt_precompute::validate::path_tracer::PathBudget;
use localprt_precompute::validate::systems::Selection;
use localprt_precompute::validate::{Limits, MeasureSettings, State};
use std::fmt::Write as _;
use std::fs;

/// Another light for the same bake: a warm spot on the left wall, a blue evening sky through the open front.
const EVENING: &str = r#"{
  "lights": [
    {"type": "spot", "position": [0.6, 1.6, 0.6], "direction": [-0.8, -0.4, -0.4], "color": [1.0, 0.7, 0.4],
     "intensity": 12, "inner_cone": 0.3, "outer_cone": 0.6}
  ],
  "sky": {"type": "gradient", "zenith": [0.05, 0.1, 0.3], "horizon": [0.3, 0.25, 0.35], "ground": [0.02, 0.02, 0.02]}
}
"#;

const PLAIN_VIEW: View = View { camera: None, size: Some((800, 800)), exposure: None, albedo_override: None };

/// Runs the subcommand.
pub fn run(command: &Demo, progress: &Progress) -> Result<(), CommandError> {
    let folder = &command.output;
    fs::create_dir_all(folder).map_err(|error| OutputError::write(folder, error))?;
    let baked_path = folder.join("cornell.lprt");
    let anew = LayoutFlags { new_layout: true, layout: None };
    let report = bake::bake("builtin:cornell", &baked_path, &Preset::Preview.settings(), None, &anew, progress)?;
    write_text(&folder.join("cornell.json"), &report.to_json())?;
    let evening_path = folder.join("evening.json");
    write_text(&evening_path, EVENING)?;

    let baked = inputs::baked(&baked_path)?;
    let scene = inputs::baked_scene(&baked_path, baked.metadata(), None)?;
    let checked = inputs::checked(&baked_path, &baked)?;
    let caster = inputs::caster(&scene)?;
    let mut found = String::new();
    // All at one exposure, that of the full light, so that they compare.
    let mut exposure = Exposure::Auto;
    let states = [
        ("cornell.png", "point light, all bounces", None, 8, None),
        ("cornell-direct.png", "the same light, no bounces", None, 0, None),
        ("cornell-light.png", "the same light alone, on surfaces of albedo 0.5", None, 8, Some(0.5)),
        ("evening.png", "another light and a sky, same bake: evening.json", Some(&evening_path), 8, None),
    ];
    for (name, what, lights, bounces, albedo_override) in states {
        let lighting = inputs::lighting(lights.map(|path| path.as_path()), &scene)?;
        let how = How { bounces, ..How::default() };
        let relit = light(&checked, &caster, &lighting, how, progress)?;
        let picture = take_picture(&caster, &lighting, &relit, &View { albedo_override, ..PLAIN_VIEW }, progress)?;
        let look = if lights.is_some() { Exposure::Auto } else { exposure };
        let ev = write_picture(&folder.join(name), &picture, look)?;
        if exposure == Exposure::Auto {
            exposure = Exposure::Ev(ev);
            write_lightmap(&folder.join("cornell.exr"), &relit, false)?;
        }
        let _ = writeln!(found, "{}  {what}", folder.join(name).display());
    }
    let own = State { name: "the lamp".into(), lighting: inputs::lighting(None, &scene)?, counts: true };
    let lighting = inputs::lighting(Some(&evening_path), &scene)?;
    let evening = State { name: "the evening".into(), lighting, counts: true };
    let quality = folder.join("quality");
    let job = Job {
        file: &baked_path,
        output: &quality,
        states: vec![own, evening],
        cameras: scene.cameras.clone(),
        settings: MeasureSettings {
            receivers: 1024,
            budget: PathBudget { error: 0.02, most_paths: 4096 },
            picture_paths: 64,
            flip_paths: 1024,
            points: 1000,
            ..MeasureSettings::default()
        },
        sweeps: &[],
        systems: Selection::default(),
        failure_case: false,
        limits: Limits::default(),
    };
    job.run(&baked, &caster, progress)?;
    let page = quality.join("index.html");
    let _ = writeln!(found, "{}  how good it is, against path tracing: open it in a browser", page.display());
    let _ = writeln!(found, "{}  indirect irradiance in lightmap coordinates", folder.join("cornell.exr").display());
    let _ =
        writeln!(found, "{}  what the bake made, how good it is, what it cost", folder.join("cornell.json").display());
    print_data(&found)
}
