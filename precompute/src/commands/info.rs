//! `precompute info` and `precompute check`: what is inside a baked file, and whether it holds together.

use super::{grouped, print_data, size, to_json};
use crate::cli;
use localprt_formats::{Baked, Checked};
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs;
use localprt_precompute::report::{Bytes, LinkFacts, Unseen, VolumeFacts};
use localprt_precompute::settings::BakeSettings;
use localprt_tools::hex;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write as _;

/// Runs `info`.
pub fn run(command: &cli::Info) -> Result<(), CommandError> {
    let baked = inputs::baked(&command.file)?;
    let facts = Facts::of(&command.file.display().to_string(), &baked, &inputs::checked(&command.file, &baked)?);
    print_data(&if command.json { to_json(&facts) } else { facts.to_text() })
}

/// Runs `check`.
pub fn check(command: &cli::Check) -> Result<(), CommandError> {
    inputs::readable(&command.file)?;
    let broken = localprt_formats::check(&command.file).map_err(|error| inputs::refused(&command.file, &error))?;
    if broken.is_empty() {
        return print_data("OK\n");
    }
    print_data(&broken.iter().map(|violation| format!("{violation}\n")).collect::<String>())?;
    let what = match broken.len() {
        1 => "breaks a rule of the format".to_owned(),
        count => format!("breaks {count} rules of the format"),
    };
    let help = "copy the file again, or bake the scene again";
    Err(CommandError::new(Exit::InvalidInput, what).in_file(&command.file).help(help))
}

/// What `info --json` prints.
#[derive(Serialize)]
struct Facts {
    file: FileFacts,
    scene: SceneFacts,
    receivers: usize,
    probes: usize,
    radius: f32,
    clusters: usize,
    blocks: usize,
    lightmap: u32,
    direct_map: u32,
    probe_degree: u32,
    receiver_degree: u32,
    sky_degree: u32,
    relight_rays: u32,
    coefficients_per_receiver: f64,
    probes_per_cluster: f64,
    unseen: Unseen,
    links: LinkFacts,
    bytes: Bytes,
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<Volume>,
    sections: Vec<Section>,
    options: Value,
    report: Value,
}

#[derive(Serialize)]
struct FileFacts {
    path: String,
    version: String,
    tool_version: String,
    content_hash: String,
}

#[derive(Serialize)]
struct SceneFacts {
    path: String,
    hash: String,
    bounds: [[f32; 3]; 2],
}

#[derive(Serialize)]
struct Volume {
    origin: [f32; 3],
    spacing: f32,
    degree: u32,
    #[serde(flatten)]
    facts: VolumeFacts,
}

#[derive(Serialize)]
struct Section {
    kind: String,
    version: u16,
    required: bool,
    element: String,
    count: u64,
    bytes: u64,
}

/// In the order of the settings; of a file with options that this version does not know, by name.
fn options(text: &str) -> Value {
    let known = toml::from_str::<BakeSettings>(text).ok();
    // By way of the text, in which f32 values keep their short form.
    let known = known.and_then(|settings| serde_json::from_str(&to_json(&settings)).ok());
    let other = || serde_json::to_value(text.parse::<toml::Table>().ok()?).ok();
    known.or_else(other).unwrap_or(Value::Null)
}

impl Facts {
    fn of(path: &str, baked: &Baked, checked: &Checked<'_>) -> Self {
        let (view, transport) = (*checked.view(), checked.transport());
        let metadata = view.metadata;
        let (major, minor) = baked.version();
        let receivers = view.receiver_texel.len();
        let clusters = transport.clusters.len();
        let coefficients: usize =
            transport.clusters.iter().map(|cluster| cluster.receivers.len() * cluster.lights.len()).sum();
        Self {
            file: FileFacts {
                path: path.to_owned(),
                version: format!("{major}.{minor}"),
                tool_version: metadata.tool_version.clone(),
                content_hash: hex(&baked.content_hash()),
            },
            scene: SceneFacts {
                path: metadata.scene_path.clone(),
                hash: hex(&metadata.scene_hash),
                bounds: metadata.bounds,
            },
            receivers,
            probes: view.probes.len(),
            radius: view.probes.first().map_or(0.0, |probe| probe.support_radius_m),
            clusters,
            blocks: view.blocks.records.len(),
            lightmap: metadata.lightmap_size,
            direct_map: metadata.direct_size,
            probe_degree: metadata.probe_degree,
            receiver_degree: metadata.receiver_degree,
            sky_degree: metadata.sky_degree,
            relight_rays: metadata.n_rays,
            coefficients_per_receiver: coefficients as f64 / receivers.max(1) as f64,
            probes_per_cluster: view.blocks.total(|block| block.n_cluster_probes) as f64 / clusters.max(1) as f64,
            unseen: Unseen::of(view.receiver_unseen),
            links: LinkFacts::of(transport.tiles.iter().flat_map(|tile| tile.counts.iter().copied()), receivers),
            bytes: Bytes { file: baked.file_bytes(), ..Bytes::of(&view) },
            volume: view.volume.map(|volume| Volume {
                origin: volume.grid.origin,
                spacing: volume.grid.spacing_m,
                degree: volume.grid.degree,
                facts: VolumeFacts::of(&volume),
            }),
            sections: baked
                .sections()
                .iter()
                .map(|section| Section {
                    kind: section.kind.to_string(),
                    version: section.version,
                    required: section.required,
                    element: match section.components {
                        1 => section.scalar.to_string(),
                        components => format!("{components} x {}", section.scalar),
                    },
                    count: section.count,
                    bytes: section.length,
                })
                .collect(),
            options: options(&metadata.options),
            report: serde_json::from_str(view.report).unwrap_or(Value::Null),
        }
    }

    fn to_text(&self) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "{name:<13}{value}");
        };
        let [low, high] = self.scene.bounds;
        let box_m: Vec<String> = (0..3).map(|axis| format!("{:.2}", high[axis] - low[axis])).collect();
        let count = |value: usize| grouped(value as u64);
        line("file", format!("{}, {}", self.file.path, size(self.bytes.file)));
        line("format", format!("{}, by localprt {}", self.file.version, self.file.tool_version));
        line("scene", format!("{}, {} m", self.scene.path, box_m.join(" x ")));
        line("receivers", format!("{}, map of {1} x {1} texels", count(self.receivers), self.lightmap));
        line("direct light", format!("map of {0} x {0} texels", self.direct_map));
        let functions = (self.probe_degree + 1).pow(2);
        let rays = grouped(self.relight_rays.into());
        line("probes", format!("{}, radius {:.3} m", count(self.probes), self.radius));
        line("", format!("degree {} ({functions} functions), {rays} relight rays each", self.probe_degree));
        line(
            "clusters",
            format!(
                "{} in {} blocks, {:.1} coefficients per receiver, {:.1} probes per cluster",
                count(self.clusters),
                count(self.blocks),
                self.coefficients_per_receiver,
                self.probes_per_cluster
            ),
        );
        let percent = |share: f64| format!("{:.2} %", 100.0 * share);
        line(
            "unseen",
            format!(
                "mean {}, 95 % below {}, at most {}",
                percent(self.unseen.mean),
                percent(self.unseen.p95),
                percent(self.unseen.max)
            ),
        );
        line("near light", format!("{:.1} links per receiver, at most {}", self.links.mean, self.links.max));
        line(
            "sizes",
            format!(
                "projection {}, reconstruction {}, near light {}, relight rays {}",
                size(self.bytes.projection),
                size(self.bytes.reconstruction),
                size(self.bytes.near_light),
                size(self.bytes.relight)
            ),
        );
        if let Some(Volume { spacing, degree, facts, .. }) = &self.volume {
            let [x, y, z] = facts.dims;
            let (receivers, filled) = (grouped(facts.receivers), grouped(facts.filled));
            let (clusters, bytes) = (grouped(facts.clusters), size(facts.bytes));
            line("volume", format!("{x} x {y} x {z} cells, {spacing} m apart, degree {degree}"));
            line("", format!("{receivers} in the open, {filled} filled, {clusters} clusters, {bytes}"));
        }
        text.push_str("\nsection  element        count       size\n");
        for section in &self.sections {
            let (count, bytes) = (grouped(section.count), size(section.bytes));
            let _ = writeln!(text, "{:<9}{:<9}{count:>11}{bytes:>11}", section.kind, section.element);
        }
        if let Some(options) = self.options.as_object() {
            text.push_str("\noptions\n");
            for (name, value) in options {
                let _ = writeln!(text, "  {name} = {value}");
            }
        }
        text
    }
}
