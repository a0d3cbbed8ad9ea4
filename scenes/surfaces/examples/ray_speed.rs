//! Times ray queries on the naive rays of a bake: 1,024 gather rays for each receiver, over the cosine, and from what each meets one ray
//! to each of seven places.
//!
//! Usage: `cargo run --release -p localprt-surfaces --example ray_speed -- SCENE [--receivers N] [--export DIR]`. Prints millions of rays
//! a second, with all threads of rayon, and with --export leaves triangles and rays in DIR for another program to trace the same:
//! little-endian f32, `triangles` `[n][3][3]`, `gather` `[n][6]` (origin, direction), `visibility` `[n][6]` (from, to).

use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, counter_uniform, fibonacci_square};
use localprt_surfaces::rays::{OccluderHint, RayCaster, frame};
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;

const GATHER_RAYS: u32 = 1024;
const PLACES: usize = 7;
const SEED: u64 = 1;
const RUNS: usize = 3;
const USAGE: &str = "usage: ray_speed SCENE [--receivers N] [--export DIR]";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or(USAGE)?;
    let (mut n_receivers, mut export) = (1000, None);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or(USAGE)?;
        match argument.as_str() {
            "--receivers" => n_receivers = value.parse()?,
            "--export" => export = Some(value),
            _ => return Err(USAGE.into()),
        }
    }
    let scene = match path.strip_prefix("builtin:") {
        Some(name) => localprt_scenes::builtin::scene(name).ok_or("no such built-in scene")?,
        None => localprt_scenes::load(&path)?,
    };
    let began = Instant::now();
    let caster = RayCaster::new(&scene)?;
    eprintln!("{} triangles, tree in {:.2} s", caster.triangle_count(), began.elapsed().as_secs_f64());

    let bounds = scene.bounds().ok_or("the scene has no triangles")?;
    let receivers = receivers(&caster, bounds, n_receivers);
    let places: Vec<Vec3> =
        (0..PLACES as u64).map(|place| within(bounds, place) * 0.4 + middle(bounds) * 0.6).collect();
    let gather: Vec<[Vec3; 2]> =
        receivers.iter().flat_map(|&receiver| gather_rays(receiver, caster.offset_m())).collect();

    let mut seconds = [Vec::new(), Vec::new()];
    let mut visibility = Vec::new();
    for _ in 0..RUNS {
        let began = Instant::now();
        let hits: Vec<Option<Vec3>> = gather
            .par_chunks(GATHER_RAYS as usize)
            .flat_map_iter(|rays| {
                let caster = &caster;
                rays.iter().map(move |&[origin, dir]| {
                    let hit = caster.closest_hit(origin, dir)?;
                    Some(hit.position + hit.normal * caster.offset_m())
                })
            })
            .collect();
        seconds[0].push(began.elapsed().as_secs_f64());
        let began = Instant::now();
        let n_visible: usize = hits
            .par_chunks(GATHER_RAYS as usize)
            .map(|hits| {
                let mut hints = [OccluderHint::default(); PLACES];
                let mut see = |hit: &Vec3| -> usize {
                    let ways = places.iter().zip(&mut hints);
                    ways.map(|(&place, hint)| usize::from(caster.visible_hinted(*hit, place, hint))).sum()
                };
                hits.iter().flatten().map(&mut see).sum::<usize>()
            })
            .sum();
        seconds[1].push(began.elapsed().as_secs_f64());
        std::hint::black_box(n_visible);
        visibility = hits.into_iter().flatten().flat_map(|hit| places.iter().map(move |&place| [hit, place])).collect();
    }
    let median = |seconds: &mut Vec<f64>| {
        seconds.sort_by(f64::total_cmp);
        seconds[seconds.len() / 2]
    };
    for (name, rays, kind) in [("gather", gather.len(), 0), ("visibility", visibility.len(), 1)] {
        let seconds = median(&mut seconds[kind]);
        println!("localprt {name} {rays} {seconds:.4} {:.2}", rays as f64 / seconds / 1e6);
    }
    if let Some(folder) = export {
        let folder = Path::new(&folder);
        std::fs::create_dir_all(folder)?;
        let triangles = scene.faces().flat_map(|(mesh, triangle)| scene.corners(mesh, triangle));
        write(&folder.join("triangles"), triangles)?;
        write(&folder.join("gather"), gather.into_iter().flatten())?;
        write(&folder.join("visibility"), visibility.into_iter().flatten())?;
    }
    Ok(())
}

/// Places with their normals on surfaces that rays from anywhere meet.
fn receivers(caster: &RayCaster<'_>, bounds: (Vec3, Vec3), count: usize) -> Vec<[Vec3; 2]> {
    let ray = |number: u64| {
        let random = |axis| counter_uniform(SEED + 1, number, axis) as f32 * 2.0 - 1.0;
        let dir = Vec3::new(random(0), random(1), random(2)).normalize_or(Vec3::Y);
        let hit = caster.closest_hit(within(bounds, number), dir)?;
        hit.point.map(|_| [hit.position, hit.normal])
    };
    // Fewer where most rays meet nothing.
    (0..100 * count as u64).filter_map(ray).take(count).collect()
}

fn within((low, high): (Vec3, Vec3), number: u64) -> Vec3 {
    low + (high - low) * Vec3::from([0, 1, 2].map(|axis| counter_uniform(SEED, number, axis) as f32))
}

fn middle((low, high): (Vec3, Vec3)) -> Vec3 {
    (low + high) * 0.5
}

/// Origins and directions, neighbors after each other.
fn gather_rays([position, normal]: [Vec3; 2], offset_m: f32) -> impl Iterator<Item = [Vec3; 2]> {
    let (tangent, bitangent) = frame(normal);
    let mut dirs: Vec<Vec3> = (0..GATHER_RAYS)
        .map(|ray| Vec3::from(cosine_hemisphere(fibonacci_square(ray, GATHER_RAYS, [0.0; 2]))))
        .collect();
    // Along rows of squares.
    let square = |value: f32| ((value + 1.0) * 8.0) as i32;
    dirs.sort_by_key(|dir| {
        let row = square(dir.y);
        let column = square(dir.x);
        (row, if row % 2 == 0 { column } else { -column })
    });
    dirs.into_iter()
        .map(move |dir| [position + normal * offset_m, tangent * dir.x + bitangent * dir.y + normal * dir.z])
}

fn write(path: &Path, points: impl Iterator<Item = Vec3>) -> std::io::Result<()> {
    std::fs::write(path, points.flat_map(|point| point.to_array()).flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}
