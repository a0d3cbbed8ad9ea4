//! Times the GPU passes: milliseconds, bytes that a pass has to move, GB/s, and its share of a plain copy on the same
//! device in the same run.
//!
//! Usage: `cargo run --release --example gpu_timing [-- FILE.lprt]`. Without a file, on synthetic bakes of the size of
//! the paper's Sponza and of ten times that, in the paper's clusters and in the smaller ones that this program makes.
//! Medians of the frames after the first three. Needs an adapter with timestamp queries.

use localprt_formats::{Baked, BakedView};
use localprt_runtime::gpu::{copy_bandwidth, headless};
use localprt_runtime::{DirectLight, PassTime, Relighter, RelighterOptions, SurfaceTexels};
use synthetic::Shape;

mod synthetic;

const WARM_UP: usize = 3;
const FRAMES: usize = 11;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (device, queue) = pollster::block_on(headless())?;
    println!("adapter: {}", device.adapter_info().name);
    let Some(copy) = copy_bandwidth(&device, &queue, 1 << 28)? else {
        return Err("this adapter has no timestamp queries".into());
    };
    println!("plain copy: {copy:.1} GB/s (read and written)\n");
    let surface = synthetic::surface();
    if let Some(path) = std::env::args().nth(1) {
        let baked = Baked::open(&path)?;
        return time(&device, &queue, &path, baked.view(), &surface, copy);
    }
    for (name, shape) in [
        ("Sponza as in the paper", Shape::PAPER),
        ("Sponza in small clusters", Shape::OURS),
        ("10 x Sponza as in the paper", Shape::PAPER.times(10)),
        ("10 x Sponza in small clusters", Shape::OURS.times(10)),
    ] {
        let arrays = synthetic::bake(shape, &surface);
        time(&device, &queue, name, arrays.view(), &surface, copy)?;
    }
    Ok(())
}

fn time(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    name: &str,
    view: BakedView<'_>,
    surface: &SurfaceTexels,
    copy: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut relighter = Relighter::new(device, queue, view, RelighterOptions::default())?;
    relighter.set_surface(surface)?;
    let mut frames: Vec<Vec<PassTime>> = Vec::new();
    for _ in 0..WARM_UP + FRAMES {
        let mut encoder = device.create_command_encoder(&Default::default());
        relighter.encode(&mut encoder, &DirectLight::Irradiance)?;
        queue.submit([encoder.finish()]);
        frames.push(relighter.wait_for_pass_times().ok_or("no times have arrived")?);
    }
    let frames = &frames[WARM_UP..];
    println!(
        "{name}: {} receivers, {} clusters, {} probes",
        view.receiver_texel.len(),
        view.clusters.len(),
        view.probes.len()
    );
    let mut total = 0.0;
    for (pass, bytes) in relighter.traffic() {
        let mut times: Vec<f64> = frames
            .iter()
            .filter_map(|frame| frame.iter().find(|time| time.name == pass).map(|time| time.milliseconds))
            .collect();
        times.sort_by(f64::total_cmp);
        let ms = times[times.len() / 2];
        total += ms;
        let gb_per_s = bytes as f64 / ms * 1e-6;
        println!(
            "  {pass:<24} {ms:9.3} ms {:9.2} MB {gb_per_s:8.2} GB/s {:5.0} % of copy",
            bytes as f64 * 1e-6,
            100.0 * gb_per_s / copy
        );
    }
    println!("  {:<24} {total:9.3} ms", "one gather");
    println!("  device memory");
    for (what, bytes) in relighter.memory() {
        println!("    {what:<38} {:9.2} MB", bytes as f64 * 1e-6);
    }
    let all: u64 = relighter.memory().iter().map(|(_, bytes)| bytes).sum();
    println!("    {:<38} {:9.2} MB\n", "all", all as f64 * 1e-6);
    Ok(())
}
