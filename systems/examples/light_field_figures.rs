//! Figures of light field probes in the Cornell box: how many rays through their maps end where rays against the scene do, and how near
//! the irradiance of one gather comes.
//!
//!     cargo run --release -p localprt-systems --example light_field_figures

use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, counter_uniform, fibonacci_square, spherical_fibonacci};
use localprt_scenes::{Lighting, builtin};
use localprt_surfaces::rays::{RayCaster, frame};
use localprt_systems::{
    Feedback, Frame, Query, Setup, Shaded, System, World,
    light_field::{Gather, LightField, Settings, agreement},
};
use std::{f32::consts::PI, time::Instant};

/// Rays that are compared.
const RAYS: u64 = 100_000;
/// Rays against the scene for the truth of a point.
const TRUTH: u32 = 256;

fn main() {
    let scene = builtin::scene("cornell").expect("a built-in scene");
    let lighting = Lighting { lights: scene.lights.clone(), ..Lighting::default() };
    let caster = RayCaster::new(&scene).expect("a tree");
    let world = World::new(&caster, &lighting);
    let field = |probes: usize, side: usize, gather: Gather| {
        let settings = Settings { side, ..Settings::COMPARED };
        LightField::new(&world, &Setup { probes, cameras: &[], seed: 1 }, settings, gather)
    };
    println!(
        "| probes, maps | hit, % | miss, % | unknown, % | wrong, % | median error, mm | 95 % below, mm | texels a ray | probes a ray |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (probes, side) in [(8, 128), (27, 128), (64, 128), (64, 256), (8, 512)] {
        let start = Instant::now();
        let system = field(probes, side, Gather::Exact);
        let made = start.elapsed();
        let shares = agreement(&system, &world, RAYS, 1);
        let percent = |share: f64| format!("{:.2}", 100.0 * share);
        let shares_of_rays = [shares.hit, shares.miss, shares.unknown, shares.wrong].map(percent).join(" | ");
        println!(
            "| {}, {side}^2 | {shares_of_rays} | {:.1} | {:.1} | {:.1} | {:.1} |",
            system.probes(),
            1e3 * shares.median_error_m,
            1e3 * shares.error_95_m,
            shares.steps,
            shares.probes
        );
        eprintln!("made in {made:?}, traced in {:?}: {shares:?}", start.elapsed() - made);
    }

    let points = points(&world);
    let truth: Vec<Vec3> = points.iter().map(|shaded| gathered(&world, shaded)).collect();
    let mean = truth.iter().sum::<Vec3>().element_sum() / truth.len() as f32;
    for (gather, frames) in [(Gather::Exact, 1), (Gather::Traced, 20), (Gather::Prefiltered, 1)] {
        let mut system = field(64, Settings::COMPARED.side, gather);
        let start = Instant::now();
        let mut found = Vec::new();
        for number in 0..frames {
            let still = number > 0;
            system.update(&Frame {
                world: &world,
                number,
                camera: None,
                feedback: Feedback::Nothing,
                events: &[],
                still,
            });
            found = system.irradiance(&world, &Query::of(&points));
        }
        let off = found.iter().zip(&truth).map(|(found, truth)| (*found - *truth).element_sum());
        let bias = off.clone().sum::<f32>() / truth.len() as f32 / mean;
        let rms = (off.map(|off| off * off).sum::<f32>() / truth.len() as f32).sqrt() / mean;
        println!(
            "{gather:?}, {frames} frames: {:?}, {} points, bias {bias:+.3}, RMS {rms:.3} of the mean",
            start.elapsed(),
            points.len()
        );
    }
}

/// Points of surfaces that rays from the free space of the box of 2 m meet.
fn points(world: &World<'_>) -> Vec<Shaded> {
    const N: u32 = 2000;
    let ray = |ray: u32| {
        let random = |k| counter_uniform(4, u64::from(ray), k) as f32;
        let origin = Vec3::new(1.8 * random(0) - 0.9, 1.3 + 0.6 * random(1), 1.8 * random(2) - 0.9);
        let hit = world.caster().closest_hit(origin, Vec3::from(spherical_fibonacci(ray, N)))?;
        hit.point?;
        Some(Shaded::from_above(hit.surface_point(world.caster().scene())))
    };
    (0..N).filter_map(ray).collect()
}

/// Irradiance of one gather by rays against the scene, W m^-2.
fn gathered(world: &World<'_>, shaded: &Shaded) -> Vec3 {
    let (tangent, bitangent) = frame(shaded.point.normal);
    let sent = |ray: u32| {
        let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, TRUTH, [0.3, 0.6]));
        let dir = tangent * x + bitangent * y + shaded.point.normal * z;
        let origin = shaded.point.position + shaded.point.normal * world.caster().offset_m();
        let surfel = world.caster().closest_hit(origin, dir).and_then(|hit| world.surfel(&hit));
        surfel.map_or(Vec3::ZERO, |surfel| surfel.sent(world.direct(&surfel.point).0))
    };
    (0..TRUTH).map(sent).sum::<Vec3>() * (PI / TRUTH as f32)
}
