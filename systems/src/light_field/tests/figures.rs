//! What reports say of the Cornell box.

use super::{GATHERS, cornell, field, rays};
use crate::light_field::{Agreement, Gather, Settings, agreement};
use crate::test_worlds::settle;
use crate::{Feedback, Query, Shaded, System};
use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use std::f32::consts::PI;

/// Figures for reports: `cargo test --release -p localprt-systems figures -- --ignored --nocapture`.
#[test]
#[ignore = "prints figures, and takes half a minute"]
fn figures_of_rays_in_the_cornell_box() {
    cornell(|world| {
        for (probes, side) in [(8, 128), (27, 128), (64, 128), (64, 256), (8, 512)] {
            let start = std::time::Instant::now();
            let system = field(world, probes, Settings { side, ..Settings::COMPARED }, Gather::Exact);
            let made = start.elapsed();
            let shares: Agreement = agreement(&system, world, 100_000, 1);
            println!(
                "{} probes {side}^2, made in {made:?}, traced in {:?}: {shares:?}",
                system.probes(),
                start.elapsed() - made
            );
        }
        // Points on surfaces, and one gather by rays against the scene.
        let met = rays(2000).filter_map(|(origin, dir)| world.caster().closest_hit(origin, dir));
        let met: Vec<_> = met.filter(|hit| hit.point.is_some()).collect();
        let points: Vec<Shaded> =
            met.iter().map(|hit| Shaded::from_above(hit.surface_point(world.caster().scene()))).collect();
        let gathered = |shaded: &Shaded| {
            let (tangent, bitangent) = localprt_surfaces::rays::frame(shaded.point.normal);
            let sum: Vec3 = (0..256)
                .map(|ray| {
                    let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, 256, [0.3, 0.6]));
                    let dir = tangent * x + bitangent * y + shaded.point.normal * z;
                    let origin = shaded.point.position + shaded.point.normal * world.caster().offset_m();
                    let surfel = world.caster().closest_hit(origin, dir).and_then(|hit| world.surfel(&hit));
                    surfel.map_or(Vec3::ZERO, |surfel| surfel.sent(world.direct(&surfel.point).0))
                })
                .sum();
            sum * (PI / 256.0)
        };
        let truth: Vec<Vec3> = points.iter().map(gathered).collect();
        let mean = truth.iter().sum::<Vec3>().element_sum() / truth.len() as f32;
        for gather in GATHERS {
            let mut system = field(world, 64, Settings::COMPARED, gather);
            let start = std::time::Instant::now();
            let frames = if gather == Gather::Traced { 20 } else { 1 };
            let mut found = Vec::new();
            for _ in 0..frames {
                settle(&mut system, world, Feedback::Nothing, 1);
                found = system.irradiance(world, &Query::of(&points));
            }
            let per_frame = start.elapsed() / frames;
            let off = found.iter().zip(&truth).map(|(found, truth)| (*found - *truth).element_sum());
            let bias = off.clone().sum::<f32>() / truth.len() as f32 / mean;
            let rms = (off.map(|off| off * off).sum::<f32>() / truth.len() as f32).sqrt() / mean;
            println!(
                "{gather:?}: {per_frame:?} a frame and {} points, bias {bias}, RMS {rms} of the mean",
                points.len()
            );
        }
    });
}
