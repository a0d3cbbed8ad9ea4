//! Memory and time of bakes against their size, from their reports: a table, and two charts.
//!
//! `cargo run --release --example scaling -- FOLDER REPORT.json...` writes `memory.png` and `time.png` there; `scripts/scaling.sh` bakes
//! cities of growing size for it.

use localprt_precompute::{
    BakeReport,
    figures::{Chart, Series},
    output::write_png,
};
use std::path::Path;

/// Name of the stage that makes the leaves.
const LEAVES: &str = "transport and clusters";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("give a folder, and reports of bakes")?;
    let mut bakes = Vec::new();
    for path in arguments {
        let report: BakeReport = serde_json::from_str(&std::fs::read_to_string(&path)?)?;
        bakes.push(Bake::of(&report).ok_or(format!("{path} tells of no leaves"))?);
    }
    bakes.sort_by(|a, b| a.receivers.total_cmp(&b.receivers));

    println!(
        "| receivers | probes | triangles | file, MB | peak before leaves, MB | peak, MB | rays a receiver | leaves, s | µs a ray |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for bake in &bakes {
        let Bake { receivers, probes, triangles, file, before, peak, rays, seconds } = bake;
        let (of_receiver, us) = (rays / receivers, 1e6 * seconds / rays);
        print!("| {receivers} | {probes} | {triangles} | {file:.1} | {before:.0} | {peak:.0} | {of_receiver:.0} |");
        println!(" {seconds:.1} | {us:.2} |");
    }
    let series = |name: &str, value: &dyn Fn(&Bake) -> f64| Series {
        name: name.into(),
        points: bakes.iter().map(|bake| [bake.receivers, value(bake)]).collect(),
    };
    let memory = vec![
        series("peak", &|bake| bake.peak),
        series("peak before the leaves", &|bake| bake.before),
        series("baked file", &|bake| bake.file),
    ];
    let time = vec![series("leaves", &|bake| 1e3 * bake.seconds / bake.receivers)];
    for (name, y_label, y_log, series) in [("memory", "MB", true, memory), ("time", "ms a receiver", false, time)] {
        let chart = Chart {
            title: String::new(),
            x_label: "receivers".into(),
            y_label: y_label.into(),
            x_log: true,
            y_log,
            series,
        };
        let image = chart.to_image(720, 420);
        write_png(&Path::new(&folder).join(name).with_extension("png"), image.width, image.height, &image.pixels)?;
    }
    Ok(())
}

/// What is drawn of a bake; sizes in megabytes.
struct Bake {
    receivers: f64,
    probes: u64,
    triangles: u64,
    file: f64,
    before: f64,
    peak: f64,
    /// Gather and visibility rays.
    rays: f64,
    seconds: f64,
}

impl Bake {
    fn of(report: &BakeReport) -> Option<Self> {
        let place = report.stages.iter().position(|stage| stage.name == LEAVES)?;
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        Some(Self {
            receivers: report.receivers as f64,
            probes: report.probes,
            triangles: report.scene.triangles,
            file: megabytes(report.bytes.file),
            before: megabytes(report.stages[..place].last()?.peak_rss_bytes),
            peak: megabytes(report.peak_rss_bytes),
            rays: (report.gather_rays + report.visibility_rays) as f64,
            seconds: report.stages[place].seconds,
        })
    }
}
