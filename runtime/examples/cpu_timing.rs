//! Times the CPU passes: milliseconds, bytes that a pass has to move, and its share of a plain copy.
//!
//! Usage: `cargo run --release --example cpu_timing [-- FILE.lprt]`. Without a file, on a synthetic bake of the size of
//! the paper's Sponza. Medians of eleven runs.

use glam::Vec3;
use localprt_formats::{Baked, BlockRecord};
use localprt_runtime::CoverageMap;
use localprt_runtime::passes::{
    cluster_projection::cluster_projection,
    direct_lightmap::direct_lightmap,
    gutter_dilation::gutter_dilation,
    lightmap_mips::{level_sizes, lightmap_mips},
    probe_relight::probe_relight,
    receiver_reconstruction::{cosine_weights, receiver_irradiance, receiver_reconstruction},
};
use rayon::prelude::*;
use std::time::Instant;
use synthetic::{DIRECT_SIZE, Shape};

mod synthetic;

const RUNS: usize = 11;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let opened = std::env::args().nth(1).map(Baked::open).transpose()?;
    let direct_size = opened.as_ref().map_or(DIRECT_SIZE, |baked| baked.view().metadata.direct_size);
    let surface = synthetic::surface(direct_size);
    let made;
    let baked = match &opened {
        Some(baked) => baked.checked()?,
        None => {
            made = synthetic::bake(Shape::PAPER, &surface);
            made.checked()?
        }
    };
    let view = baked.view();
    surface.check(direct_size)?;
    let mut light_map: Vec<_> = level_sizes(direct_size).into_iter().map(CoverageMap::uncovered).collect();
    let mut probe_radiance = vec![Vec3::ZERO; baked.n_probes() * baked.n_sh()];
    let mut cluster_lights = vec![Vec3::ZERO; baked.n_cluster_lights()];
    let mut coefficients = vec![Vec3::ZERO; baked.n_receivers() * baked.n_k()];
    let mut irradiance = vec![Vec3::ZERO; baked.n_receivers()];
    let mut map = CoverageMap::uncovered(view.metadata.lightmap_size);

    let copy = copy_gb_per_s();
    println!(
        "{} threads, {} covered texels, {} receivers, {} clusters; plain copy {copy:.1} GB/s (read and written)",
        rayon::current_num_threads(),
        surface.len(),
        baked.n_receivers(),
        baked.transport().clusters.len()
    );
    let report = |name: &str, milliseconds: f64, bytes: usize| {
        let gb_per_s = bytes as f64 / milliseconds * 1e-6;
        println!(
            "{name:<24} {milliseconds:8.2} ms {:9.2} MB {gb_per_s:7.2} GB/s {:5.0} % of copy",
            bytes as f64 * 1e-6,
            100.0 * gb_per_s / copy
        );
    };
    let bytes = |pairs: fn(&BlockRecord) -> u32| 4 * view.blocks.total(pairs) as usize;
    let weights = cosine_weights(&baked);
    let texels = direct_size as usize * direct_size as usize * 16;
    let lights = cluster_lights.len() * 12;
    let ms = time(|| direct_lightmap(&surface, Some(&map), 0.95, &mut light_map[0]));
    report("direct_lightmap", ms, surface.len() * 40 + texels);
    let ms = time(|| lightmap_mips(&mut light_map));
    report("lightmap_mips", ms, texels * 5 / 3);
    let ms = time(|| probe_relight(&baked, &light_map, &[], &[], &mut probe_radiance));
    report("probe_relight", ms, view.ray_uv.len() * (5 + 64) + view.ray_sh.len() * 4);
    let ms = time(|| cluster_projection(baked.transport(), &probe_radiance, &[], &mut cluster_lights));
    report("cluster_projection", ms, bytes(|block| block.projection_pairs) + lights + probe_radiance.len() * 12);
    let ms = time(|| {
        receiver_reconstruction(baked.transport(), &cluster_lights, &mut coefficients);
        receiver_irradiance(&weights, &coefficients, &mut irradiance);
    });
    report("receiver_reconstruction", ms, bytes(|block| block.reconstruction_pairs) + lights + coefficients.len() * 24);
    let ms = time(|| gutter_dilation(&baked, &irradiance, &mut map));
    report("gutter_dilation", ms, (irradiance.len() + view.gutters.len()) * 28);
    Ok(())
}

/// Median milliseconds.
fn time(mut pass: impl FnMut()) -> f64 {
    let mut milliseconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            pass();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    milliseconds.sort_by(f64::total_cmp);
    milliseconds[RUNS / 2]
}

/// All threads copying 256 MB.
fn copy_gb_per_s() -> f64 {
    const CHUNK: usize = 1 << 22;
    let source = vec![1u8; 1 << 28];
    let mut target = vec![0u8; 1 << 28];
    let ms = time(|| {
        target.par_chunks_mut(CHUNK).zip(source.par_chunks(CHUNK)).for_each(|(target, source)| {
            target.copy_from_slice(source);
        });
    });
    2.0 * source.len() as f64 / ms * 1e-6
}
