//! What comes and goes, and what a thousand frames leave behind.

use crate::stage::Stage;
use bevy::pbr::Lightmap;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::RenderDevice;
use bevy_localprt::{BakedLight, BakedLightError, RelitMaps};
use std::path::Path;

/// What is compiled and cached late is there after so many frames.
const WARM_UP: u32 = 100;
/// Bytes of the device that a frame may leave behind: less than any buffer that it could have lost takes.
const ALLOWED_OF_DEVICE: u64 = 4;
/// Bytes of the process that a frame may leave behind: an allocation of a few words would be seen, caches that still fill would not.
const ALLOWED_PER_FRAME: u64 = 4096;

/// Takes the scene away and spawns it anew, and loads one that is another one.
pub fn used(mut stage: Stage, file: &Path) -> Result<(), String> {
    stage.draw_anew(8)?;
    let first = stage.picture();
    let (lit, before) = (stage.count::<Lightmap>(), Memory::of(&stage));
    stage.app.world_mut().entity_mut(stage.root).despawn();
    for _ in 0..8 {
        stage.app.update();
    }
    let without = Memory::of(&stage);
    let left = stage.count::<Lightmap>() + stage.count::<RelitMaps>();
    println!("despawned: {lit} light maps, {before} before; {left} after, {without}");
    ensure(lit > 0, "there were light maps")?;
    ensure(left == 0, "no light map is left")?;
    let table: u64 = before.table.iter().map(|(_, bytes)| bytes).sum();
    ensure(without.device + table <= before.device, "the device has its memory back")?;

    stage.enter()?;
    stage.draw_anew(8)?;
    ensure(stage.picture().data == first.data, "spawned anew, it shows the same picture")?;
    println!("spawned anew: the same picture, {}", Memory::of(&stage));

    let read = |path: &Path| std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    let (bytes, mut scene) = (read(file)?, read(&file.with_extension("glb"))?);
    let whole = BakedLight::from_bytes(bytes.clone(), "whole", &scene).map_err(|error| error.to_string())?;
    ensure(whole.lightmap_size() > 0, "the scene as it was is taken")?;
    // Only the last bit of the first coordinate is another, behind both heads and the JSON.
    let json = u32::from_le_bytes(scene[12..16].try_into().map_err(|_| "no glTF")?) as usize;
    scene[20 + json + 8] ^= 1;
    match BakedLight::from_bytes(bytes, "changed.glb", &scene) {
        Err(error @ BakedLightError::OtherScene { .. }) => println!("refused: {error}"),
        Err(error) => return Err(format!("a changed scene is refused for another reason: {error}")),
        Ok(_) => return Err("a changed scene is taken".to_owned()),
    }
    Ok(())
}

/// Frames with a moving lamp and a changing emission.
pub fn frames(mut stage: Stage, n_frames: u32) -> Result<(), String> {
    let draw = |stage: &mut Stage, n_frames: u32| {
        for frame in 0..n_frames {
            let at = frame as f32;
            stage.change::<Transform>(stage.lamp, |place| {
                place.translation =
                    Vec3::new(0.5 * (0.1 * at).cos(), 0.3 * (0.07 * at).sin() - 0.3, 0.5 * (0.1 * at).sin());
            });
            let red = 0.2 + 0.2 * (0.1 * at).sin();
            stage.change_materials("red", |material| material.emissive = LinearRgba::rgb(red, 0.0, 0.0));
            stage.app.update();
        }
    };
    draw(&mut stage, WARM_UP);
    let (before, gathers) = (Memory::of(&stage), stage.status().gathers);
    let started = std::time::Instant::now();
    draw(&mut stage, n_frames);
    let seconds = started.elapsed().as_secs_f32();
    let after = Memory::of(&stage);
    println!("{n_frames} frames in {seconds:.0} s");
    println!("before: {before}");
    println!("after: {after}");
    for (name, bytes) in &after.table {
        println!("    {name}: {bytes} bytes");
    }
    ensure(stage.status().gathers == gathers + u64::from(n_frames), "every frame was one gather")?;
    ensure(!after.table.is_empty() && after.table == before.table, "the relighter's memory is the same")?;
    let grown = after.device.saturating_sub(before.device);
    ensure(grown <= ALLOWED_OF_DEVICE * u64::from(n_frames), "the device's memory does not grow")?;
    let grown = after.process.saturating_sub(before.process);
    ensure(grown <= ALLOWED_PER_FRAME * u64::from(n_frames), "the process does not grow")
}

/// Bytes.
struct Memory {
    /// Of the relighter, by purpose.
    table: Vec<(&'static str, u64)>,
    /// All that is allocated on the device, Bevy's own with it.
    device: u64,
    /// Resident memory of the process, which a software driver's device memory is part of.
    process: u64,
}

impl Memory {
    fn of(stage: &Stage) -> Self {
        let device = stage.app.sub_app(RenderApp).world().resource::<RenderDevice>().wgpu_device();
        // What was dropped is let go when the device is done with it.
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device is there");
        let device = device.generate_allocator_report().map_or(0, |report| report.total_allocated_bytes);
        Self { table: stage.status().memory, device, process: resident_bytes() }
    }
}

impl std::fmt::Display for Memory {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let table: u64 = self.table.iter().map(|(_, bytes)| bytes).sum();
        let Self { device, process, .. } = self;
        write!(out, "{table} bytes of the relighter, {device} of the device, {process} of the process")
    }
}

/// Of Linux; 0 elsewhere.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default();
    1024 * line.trim_end_matches("kB").trim().parse::<u64>().unwrap_or_default()
}

fn ensure(is_so: bool, what: &str) -> Result<(), String> {
    if is_so { Ok(()) } else { Err(format!("not so: {what}")) }
}
