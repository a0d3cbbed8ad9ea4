//! Scenes and measures for the tests of the systems of irradiance probes.

use crate::test_worlds::{furnace, lit_plane, settle};
use crate::{Feedback, ProbeGrid, Query, Shaded, System, World};
use glam::{UVec3, Vec3};
use localprt_formats::directions::{cosine_hemisphere, counter_uniform};
use localprt_scenes::{Lighting, MaterialOverride, Mesh, Scene, Sky, SurfacePoint};
use localprt_surfaces::rays::frame;
use rayon::prelude::*;

/// Mean red irradiance over points, W m^-2.
pub(crate) fn mean(system: &dyn System, world: &World<'_>, points: &[Shaded]) -> f32 {
    let irradiance = system.irradiance(world, &Query::of(points));
    irradiance.iter().map(|value| value.x).sum::<f32>() / points.len() as f32
}

/// Standard deviation over the mean.
pub(crate) fn unrest(values: &[f32]) -> f32 {
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / values.len() as f32;
    variance.sqrt() / mean
}

/// A box that looks outwards, of the material of the furnace.
pub(crate) fn solid(low: Vec3, high: Vec3) -> Mesh {
    let mut mesh = furnace(0.0, 0.0).meshes.swap_remove(0);
    for position in &mut mesh.positions {
        *position = low + *position / Vec3::new(4.0, 3.0, 5.0) * (high - low);
    }
    mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
    mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    mesh.name = "solid".into();
    mesh
}

/// Next to nothing below a sky of radiance `1 + 0.5 y`: irradiance about n is `pi (1 + n.y / 3)`, everywhere above the speck at
/// (0, -100, 0).
pub(crate) fn linear_sky() -> (Scene, Lighting) {
    let (mut scene, _) = lit_plane(0.0);
    scene.meshes[0].positions.iter_mut().for_each(|position| *position = *position * 1e-4 + Vec3::NEG_Y * 100.0);
    let sky = Sky::Gradient { zenith: Vec3::splat(1.5), horizon: Vec3::ONE, ground: Vec3::splat(0.5) };
    (scene, Lighting { sky, ..Lighting::default() })
}

/// Lighting in which every surface of the furnace emits so much.
pub(crate) fn furnace_emits(emission: f32) -> Lighting {
    let glow = MaterialOverride { emission: Some(Vec3::splat(emission)), ..Default::default() };
    Lighting { materials: [("default".to_string(), glow)].into(), ..Lighting::default() }
}

/// Points of a level floor between two corners, `side` x `side`, looking up.
pub(crate) fn floor_points(low: Vec3, high: Vec3, side: u32) -> Vec<Shaded> {
    let middle = |k: u32| (k as f32 + 0.5) / side as f32;
    let places = (0..side * side).map(|k| Vec3::new(middle(k % side), 0.0, middle(k / side)));
    let at =
        |place: Vec3| SurfacePoint { position: low + place * (high - low), normal: Vec3::Y, geometric_normal: Vec3::Y };
    places.map(|place| Shaded::from_above(at(place))).collect()
}

/// A room that reflects nothing, whose walls glow a little, with a small lamp: a square of 0.8 m below the ceiling, of radiance 20.
pub(crate) fn lamp(walls: f32) -> Scene {
    let mut scene = furnace(0.0, walls);
    let (mut glow, mut square) = (scene.materials[0].clone(), lit_plane(0.0).0.meshes.swap_remove(0));
    glow.emission = Vec3::splat(20.0);
    square.positions.iter_mut().for_each(|position| *position = *position * 0.08 + Vec3::new(2.0, 2.9, 2.5));
    square.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    square.normals.iter_mut().for_each(|normal| *normal = -*normal);
    square.material = 1;
    scene.materials.push(glow);
    scene.meshes.push(square);
    scene
}

/// Two sealed rooms, with a lamp in the left one.
pub(crate) fn two_rooms() -> (Scene, Lighting) {
    let scene = localprt_scenes::builtin::scene("two-rooms").expect("two rooms");
    let lighting = Lighting::of_scene(&scene);
    (scene, lighting)
}

/// Floors of the lit and of the dark room; in the dark one the party wall, too.
pub(crate) fn rooms() -> (Vec<Shaded>, Vec<Shaded>) {
    let lit = floor_points(Vec3::new(-3.0, 0.0, -2.0), Vec3::new(-0.01, 0.0, 2.0), 12);
    let mut dark = floor_points(Vec3::new(0.01, 0.0, -2.0), Vec3::new(3.0, 0.0, 2.0), 12);
    for shaded in floor_points(Vec3::new(0.1, 0.0, -1.9), Vec3::new(2.5, 0.0, 1.9), 12) {
        let position = Vec3::new(0.0025, shaded.point.position.x, shaded.point.position.z);
        dark.push(Shaded::from_above(SurfacePoint { position, normal: Vec3::X, geometric_normal: Vec3::X }));
    }
    (lit, dark)
}

/// Irradiance of the dark room as a share of the lit one's, after some frames of all bounces.
pub(crate) fn leak(system: &mut dyn System, world: &World<'_>) -> f32 {
    settle(system, world, Feedback::Own, 3);
    let (lit, dark) = rooms();
    mean(system, world, &dark) / mean(system, world, &lit)
}

/// Probes about 0.8 m apart, none of them in the plane of the wall: cages there have both rooms' probes.
pub(crate) fn rooms_grid() -> ProbeGrid {
    let size = UVec3::new(8, 3, 5);
    let extent = Vec3::new(6.0, 2.6, 4.0);
    let spacing = extent / size.as_vec3();
    ProbeGrid { low: Vec3::new(-3.0, 0.0, -2.0) + spacing * 0.5, spacing, size }
}

/// Indirect irradiance at points by path tracing, with a counter each, W m^-2: what every system is to give.
pub(crate) fn path_traced(world: &World<'_>, points: &[Shaded], paths: u64) -> Vec<Vec3> {
    const LONGEST: u64 = 16;
    let at = |(stream, shaded): (usize, &Shaded)| {
        let mut sum = Vec3::ZERO;
        for path in 0..paths {
            let (mut point, mut throughput) = (shaded.point, Vec3::splat(std::f32::consts::PI));
            for step in 0..LONGEST {
                let uniform = |k| counter_uniform(7, stream as u64, (path * LONGEST + step) * 2 + k);
                let local = Vec3::from(cosine_hemisphere([uniform(0), uniform(1)]));
                let (tangent, bitangent) = frame(point.normal);
                let dir = tangent * local.x + bitangent * local.y + point.normal * local.z;
                let origin = point.position + point.geometric_normal * world.caster().offset_m();
                let Some(hit) = world.caster().closest_hit(origin, dir) else {
                    sum += throughput * world.sky(dir);
                    break;
                };
                let Some(surfel) = world.surfel(&hit) else { break };
                sum += throughput * surfel.sent(world.direct(&surfel.point).0);
                throughput *= surfel.albedo;
                point = surfel.point;
            }
        }
        sum / paths as f32
    };
    points.par_iter().enumerate().map(at).collect()
}

/// What the Cornell box's camera sees through its opening, `side` x `side` points.
pub(crate) fn cornell_points(world: &World<'_>, side: u32) -> Vec<Shaded> {
    let eye = Vec3::new(0.0, 1.0, 3.9);
    let opening = floor_points(Vec3::new(-0.98, 0.0, -0.98), Vec3::new(0.98, 0.0, 0.98), side);
    let seen = |through: &Shaded| {
        let dir = (Vec3::new(through.point.position.x, 1.0 + through.point.position.z, 1.0) - eye).normalize();
        let hit = world.caster().closest_hit(eye, dir)?;
        Some(Shaded { point: world.surfel(&hit)?.point, to_eye: -dir })
    };
    opening.iter().filter_map(seen).collect()
}

/// Mean irradiance over the mean by path tracing, and the mean of absolute differences over it, of red, green and blue together.
pub(crate) fn against_paths(found: &[Vec3], paths: &[Vec3]) -> (f32, f32) {
    let sum = |values: &mut dyn Iterator<Item = Vec3>| values.map(Vec3::element_sum).sum::<f32>();
    let truth = sum(&mut paths.iter().copied());
    let off = sum(&mut found.iter().zip(paths).map(|(a, b)| (*a - *b).abs()));
    (sum(&mut found.iter().copied()) / truth, off / truth)
}
