//! Rays per second and thread, as a bake traces them: all gather rays of a receiver together, then visibility of what they
//! met.
//!
//! `cargo run --release --example ray_throughput -- hall.glb [RECEIVERS]`; without a scene the built-in atrium.

use glam::Vec3;
use localprt_formats::directions::counter_uniform;
use localprt_precompute::{
    rays::{OccluderHint, RayCaster, frame},
    transport::GatherSet,
};
use localprt_scenes::{builtin, load};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = match arguments.next() {
        Some(path) => load(path)?,
        None => builtin::scene("atrium").ok_or("no built-in atrium")?,
    };
    let n_receivers: u64 = arguments.next().map_or(Ok(1000), |text| text.parse())?;
    let start = Instant::now();
    let caster = RayCaster::new(&scene)?;
    println!("{} triangles, tree built in {:.2} s", caster.triangle_count(), start.elapsed().as_secs_f64());

    let faces: Vec<(usize, usize)> = scene.faces().collect();
    let gather = GatherSet::new(1024, 0, 0);
    let (mut closest, mut visibility) = ((0u64, 0.0), (0u64, 0.0));
    let mut met = Vec::new();
    for receiver in 0..n_receivers {
        let (mesh, triangle) = faces[(counter_uniform(1, receiver, 0) * faces.len() as f64) as usize];
        let normal = scene.geometric_normal(mesh, triangle);
        let center: Vec3 = scene.corners(mesh, triangle).iter().sum::<Vec3>() / 3.0;
        let origin = center + normal * caster.offset_m();
        let (tangent, bitangent) = frame(normal);
        met.clear();
        let start = Instant::now();
        for local in gather.directions() {
            met.extend(caster.closest_hit(origin, tangent * local.x + bitangent * local.y + normal * local.z));
        }
        closest = (closest.0 + gather.directions().len() as u64, closest.1 + start.elapsed().as_secs_f64());
        // A probe stands about here: 2 m off the surface.
        let probe = center + normal * 2.0;
        let mut hint = OccluderHint::default();
        let start = Instant::now();
        let seen = met
            .iter()
            .filter(|hit| caster.visible_hinted(hit.position + hit.normal * caster.offset_m(), probe, &mut hint))
            .count();
        visibility = (visibility.0 + met.len() as u64, visibility.1 + start.elapsed().as_secs_f64());
        std::hint::black_box(seen);
    }
    for (name, (rays, seconds)) in [("closest hit", closest), ("visibility", visibility)] {
        println!("{name}: {rays} rays, {:.2} Mrays/s on one thread", rays as f64 / seconds / 1e6);
    }
    Ok(())
}
