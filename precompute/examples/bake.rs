//! Bakes a scene as `precompute bake SCENE -o OUT.lprt --preset preview` does.
//!
//! Usage: `cargo run --release --example bake -- SCENE.glb OUT.lprt`. The scene with its lightmap coordinates goes to OUT.lightmap.glb,
//! unless SCENE.glb brings usable ones.

use localprt_precompute::{Preset, Progress, bake};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, source, output] = arguments.as_slice() else {
        return Err("usage: bake SCENE.glb OUT.lprt".into());
    };
    let (source, output) = (Path::new(source), Path::new(output));
    let progress = Progress::silent();
    let baked = bake(localprt_scenes::load(source)?, &Preset::Preview.settings(), &progress)?;
    let written = baked.write(output, &output.with_extension("lightmap.glb"), Some(source), &progress)?;
    let report = written.report;
    println!(
        "{} receivers, {} probes, {:.1} MB in {:.0} s; lightmap coordinates in {}",
        report.receivers,
        report.probes,
        report.bytes.file as f64 / 1e6,
        report.seconds,
        written.scene.display()
    );
    Ok(())
}
