//! `precompute diff`: what differs between two baked files, by section and in the light that they give.

use super::relight::{How, light};
use super::{grouped, print_data, size, to_json};
use crate::cli::Diff;
use localprt_formats::Baked;
use localprt_precompute::diff::{Counts, FieldDiff, FileDiff, LightDiff, Lit};
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::progress::Progress;
use localprt_runtime::Relit;
use localprt_scenes::{Lighting, Scene};
use serde::Serialize;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Runs the subcommand. Files that differ are exit code 7.
pub fn run(command: &Diff, progress: &Progress) -> Result<(), CommandError> {
    let paths = [command.first.as_path(), command.second.as_path()];
    let [first, second] = [whole(paths[0])?, whole(paths[1])?];
    let files = FileDiff::of([&first.0, &second.0], [&first.1, &second.1]);
    let lights = if files.identical || command.sections {
        Vec::new()
    } else {
        lights(command, paths, [&first.0, &second.0], progress)?
    };
    let found = Found { files: paths.map(|path| path.display().to_string()), diff: files, lights };
    print_data(&if command.json { to_json(&found) } else { found.to_text() })?;
    if found.diff.identical {
        return Ok(());
    }
    let what = format!("differs from {} in {} sections", found.files[1], found.diff.sections.len());
    let help = "standard output says where; bakes of the same input and options are the same byte for byte";
    Err(CommandError::new(Exit::Quality, what).in_file(paths[0]).help(help))
}

/// A file of which every byte has been checked.
fn whole(path: &Path) -> Result<(Baked, Vec<u8>), CommandError> {
    let baked = inputs::baked(path)?;
    let bytes = fs::read(path).map_err(|error| CommandError::read(path, &error))?;
    match localprt_formats::check_bytes(&bytes).first() {
        None => Ok((baked, bytes)),
        Some(broken) => {
            let help = "copy the file again, or bake the scene again";
            Err(CommandError::new(Exit::InvalidInput, broken.to_string()).in_file(path).help(help))
        }
    }
}

/// Both files under each lighting, each in its own scene.
fn lights(
    command: &Diff,
    paths: [&Path; 2],
    files: [&Baked; 2],
    progress: &Progress,
) -> Result<Vec<LightDiff>, CommandError> {
    let scene = |index: usize| {
        inputs::baked_scene(paths[index], files[index].metadata(), None)
            .map_err(|error| error.help("put the scene back, or compare without light: --sections"))
    };
    let scenes = [scene(0)?, scene(1)?];
    let own = ("the lights of the first scene".to_owned(), None);
    let given = command.lights.iter().map(|path| {
        let name = path.file_stem().map_or_else(|| "lighting".into(), |name| name.to_string_lossy().into_owned());
        (name, Some(path.as_path()))
    });
    let states: Vec<(String, Option<&Path>)> = if command.lights.is_empty() { vec![own] } else { given.collect() };
    let mut found = Vec::new();
    for (name, path) in states {
        // Of the first scene for both, where no file says otherwise.
        let of = |scene: &Scene| match path {
            Some(_) => inputs::lighting(path, scene),
            None => Ok(Lighting::of_scene(&scenes[0])),
        };
        let relight = |index: usize| -> Result<Relit, CommandError> {
            let caster = inputs::caster(&scenes[index])?;
            let how = How { bounces: command.bounces, ..How::default() };
            let checked = inputs::checked(paths[index], files[index])?;
            light(&checked, &caster, &of(&scenes[index])?, how, progress)
        };
        let relit = [relight(0)?, relight(1)?];
        let lit = |index: usize| Lit { view: files[index].view(), irradiance: &relit[index].irradiance };
        found.push(LightDiff::of(&name, lit(0), lit(1)));
    }
    Ok(found)
}

/// What `diff --json` prints.
#[derive(Serialize)]
struct Found {
    files: [String; 2],
    #[serde(flatten)]
    diff: FileDiff,
    lights: Vec<LightDiff>,
}

impl Found {
    fn to_text(&self) -> String {
        let mut text = String::new();
        let [a, b] = &self.files;
        if self.diff.identical {
            let _ = writeln!(text, "{a} and {b} are the same");
            return text;
        }
        let _ = writeln!(text, "A  {a}\nB  {b}\n");
        self.write_counts(&mut text);
        write_fields(&mut text, "metadata", &self.diff.metadata);
        write_fields(&mut text, "options", &self.diff.options);
        self.write_sections(&mut text);
        for light in &self.lights {
            self.write_light(&mut text, light);
        }
        text
    }

    fn write_counts(&self, text: &mut String) {
        let row = |name: &str, value: &dyn Fn(&Counts) -> String| {
            let [a, b] = self.diff.counts.each_ref().map(value);
            let mark = if a == b { "" } else { "  *" };
            format!("{name:<13}{a:>12}{b:>12}{mark}")
        };
        let number = |value: usize| grouped(value as u64);
        let rows = [
            format!("{:<13}{:>12}{:>12}", "", "A", "B"),
            row("receivers", &|counts| number(counts.receivers)),
            row("probes", &|counts| number(counts.probes)),
            row("clusters", &|counts| grouped(counts.clusters)),
            row("coefficients", &|counts| grouped(counts.coefficients)),
            row("links", &|counts| grouped(counts.links)),
            row("blocks", &|counts| number(counts.blocks)),
            row("file", &|counts| size(counts.bytes)),
        ];
        for row in rows {
            let _ = writeln!(text, "{row}");
        }
        let blocks = self.diff.counts[1].blocks;
        let _ = writeln!(text, "{} of the {} blocks of B are in A", self.diff.same_blocks, number(blocks));
    }

    fn write_sections(&self, text: &mut String) {
        text.push_str("\nsection   elements A  elements B   differing  largest difference\n");
        for section in &self.diff.sections {
            let count = |count: Option<u64>| count.map_or_else(|| "-".into(), grouped);
            let [a, b] = section.counts.map(count);
            let differing = count(section.differing);
            let largest = section.max_difference.map_or_else(|| "-".into(), |value| format!("{value:.3e}"));
            let _ = writeln!(text, "{:<8}{a:>12}{b:>12}{differing:>12}{largest:>20}", section.section);
        }
    }

    fn write_light(&self, text: &mut String, light: &LightDiff) {
        let receivers = grouped(self.diff.counts[0].receivers as u64);
        let how = if light.same_layout { "of the same layout" } else { "the nearest within a texel" };
        let _ = writeln!(text, "\nlight: {}", light.name);
        let _ = writeln!(text, "  {} of {receivers} receivers of A pair up, {how}", grouped(light.pairs as u64));
        let _ = writeln!(text, "  mean irradiance {:.4} and {:.4} W/m^2", light.mean[0], light.mean[1]);
        let _ = match light.nrmse {
            Some(nrmse) => writeln!(
                text,
                "  nrmse {nrmse:.4}; relative difference: median {:.4}, 95 % {:.4}, 99 % {:.4}, largest {:.4}",
                light.median_relative, light.p95_relative, light.p99_relative, light.max_relative
            ),
            None => writeln!(text, "  A is black, so no difference is relative to it"),
        };
        let _ = writeln!(text, "  largest difference {:.4} W/m^2", light.max_difference);
        for place in &light.worst {
            let [x, y, z] = place.position;
            let [a, b] = place.irradiance.map(|[r, g, b]| format!("({r:.4}, {g:.4}, {b:.4})"));
            let _ = writeln!(text, "  at {x:.3}, {y:.3}, {z:.3}: {a} and {b}");
        }
    }
}

fn write_fields(text: &mut String, title: &str, fields: &[FieldDiff]) {
    if !fields.is_empty() {
        let _ = writeln!(text, "\n{title}");
    }
    for FieldDiff { name, values } in fields {
        let [a, b] = values.each_ref().map(|value| value.as_deref().unwrap_or("absent"));
        let _ = writeln!(text, "  {name}: {a} -> {b}");
    }
}
