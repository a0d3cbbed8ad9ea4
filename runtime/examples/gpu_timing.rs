//! Times the GPU passes: milliseconds, bytes that a pass has to move, GB/s, and its share of a plain copy on the same
//! device in the same run.
//!
//! Usage: `cargo run --release --example gpu_timing [-- FILE.lprt]`. Without a file, on synthetic bakes of the size of
//! the paper's Sponza and of ten times that, in the paper's clusters and in the smaller ones that this program makes.
//! Medians of the frames after the first three: by timestamps, or, on an adapter in software, by the clock with every
//! pass submitted alone.

use localprt_formats::{Baked, Checked};
use localprt_runtime::gpu::{Clock, copy_bandwidth, headless};
use localprt_runtime::{DirectLight, Relighter, RelighterOptions, SurfaceTexels};
use synthetic::Shape;

mod synthetic;

const WARM_UP: usize = 3;
const FRAMES: usize = 11;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (device, queue) = pollster::block_on(headless())?;
    let adapter = device.adapter_info();
    // Drivers in software finish a pass long after they have written its timestamps.
    let clock = if adapter.device_type == wgpu::DeviceType::Cpu { Clock::Wall } else { Clock::Timestamps };
    println!("adapter: {} ({:?}), times by {clock:?}", adapter.name, adapter.device_type);
    let copy = copy_bandwidth(&device, &queue, 1 << 28, clock)?;
    println!("plain copy: {copy:.1} GB/s (read and written)\n");
    let surface = synthetic::surface(synthetic::DIRECT_SIZE);
    if let Some(path) = std::env::args().nth(1) {
        let baked = Baked::open(&path)?;
        let surface = synthetic::surface(baked.view().metadata.direct_size);
        return time(&device, &queue, &path, &baked.checked()?, &surface, (clock, copy));
    }
    for (name, shape) in [
        ("Sponza as in the paper", Shape::PAPER),
        ("Sponza in small clusters", Shape::OURS),
        ("10 x Sponza as in the paper", Shape::PAPER.times(10)),
        ("10 x Sponza in small clusters", Shape::OURS.times(10)),
    ] {
        let arrays = synthetic::bake(shape, &surface);
        time(&device, &queue, name, &arrays.checked()?, &surface, (clock, copy))?;
    }
    Ok(())
}

fn time(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    name: &str,
    baked: &Checked<'_>,
    surface: &SurfaceTexels,
    (clock, copy): (Clock, f64),
) -> Result<(), Box<dyn std::error::Error>> {
    let mut relighter = Relighter::new(device, queue, baked, RelighterOptions::default())?;
    relighter.set_surface(surface)?;
    // (pass, milliseconds) of all frames.
    let mut times: Vec<(&'static str, f64)> = Vec::new();
    for frame in 0..WARM_UP + FRAMES {
        let mut encoder = device.create_command_encoder(&Default::default());
        relighter.encode(&mut encoder, &DirectLight::Irradiance)?;
        queue.submit([encoder.finish()]);
        let of_frame = relighter.wait_for_pass_times();
        if frame < WARM_UP {
            continue;
        }
        match clock {
            Clock::Timestamps => {
                let of_frame = of_frame.ok_or("this adapter has no timestamp queries")?;
                times.extend(of_frame.iter().map(|time| (time.name, time.milliseconds)));
            }
            Clock::Wall => {
                for (pass, _) in relighter.traffic() {
                    let mut encoder = device.create_command_encoder(&Default::default());
                    relighter.encode_pass(&mut encoder, pass);
                    let start = std::time::Instant::now();
                    queue.submit([encoder.finish()]);
                    device.poll(wgpu::PollType::wait_indefinitely())?;
                    times.push((pass, start.elapsed().as_secs_f64() * 1e3));
                }
            }
        }
    }
    println!(
        "{name}: {} receivers, {} clusters, {} probes",
        baked.n_receivers(),
        baked.transport().clusters.len(),
        baked.n_probes()
    );
    let mut total = 0.0;
    for (pass, bytes) in relighter.traffic() {
        let mut of_pass: Vec<f64> = times.iter().filter(|(name, _)| *name == pass).map(|(_, ms)| *ms).collect();
        of_pass.sort_by(f64::total_cmp);
        let ms = of_pass[of_pass.len() / 2];
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
