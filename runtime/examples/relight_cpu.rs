//! Relights a baked file without a GPU, in the scene's own light.
//!
//! Usage: `cargo run --release --example relight_cpu -- FILE.lprt SCENE.glb [BOUNCES]`. The scene is the one with lightmap coordinates
//! that the bake wrote beside the file, or the one that was baked if it brought its own.

use localprt_formats::Baked;
use localprt_runtime::CpuRelighter;
use localprt_scenes::{Lighting, luminance};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, file, scene, rest @ ..] = arguments.as_slice() else {
        return Err("usage: relight_cpu FILE.lprt SCENE.glb [BOUNCES]".into());
    };
    let bounces: u32 = rest.first().map_or(Ok(3), |bounces| bounces.parse())?;

    let baked = Baked::open(file)?;
    let scene = localprt_scenes::load(scene)?;
    let mut relighter = CpuRelighter::new(baked.checked()?);
    relighter.set_scene(&scene)?;
    relighter.set_lighting(&Lighting::of_scene(&scene))?;
    for bounce in 1..=bounces {
        let irradiance = &relighter.bounce()?.irradiance;
        let sum: f64 = irradiance.iter().map(|&irradiance| luminance(irradiance)).sum();
        println!("after bounce {bounce}: {:.4} W m^-2 on average", sum / irradiance.len().max(1) as f64);
    }
    Ok(())
}
