//! The whole method in small worlds.

mod elements;
mod limits;

use super::*;
use crate::{Feedback, Shaded};
use glam::Mat4;
use localprt_scenes::{Lighting, Material, Mesh, Scene, SurfacePoint};
use std::f32::consts::PI;
use std::ops::Range;

/// A camera, field of view in degrees.
pub(super) fn look(eye: Vec3, target: Vec3, fov_y: f32) -> Camera {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize_or(Vec3::X);
    let to_world = Mat4::from_cols(right.extend(0.0), back.cross(right).extend(0.0), back.extend(0.0), eye.extend(1.0));
    Camera { name: String::new(), to_world, fov_y: fov_y.to_radians(), aspect: None }
}

/// Six views that see everything around an eye.
fn all_around(eye: Vec3) -> [Camera; 6] {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
        .map(|dir| Camera { aspect: Some(1.0), ..look(eye, eye + dir, 90.0) })
}

/// The default with another filter.
fn by(rule: Rule, hysteresis: f32) -> Settings {
    Settings { filter: Filter { rule, hysteresis }, ..Settings::default() }
}

/// The same without what is injected.
fn screen_only(settings: Settings) -> Settings {
    Settings { sources: SourceSettings { light_samples: 0, sky_samples: 0, weight: 1.0 }, ..settings }
}

fn system(world: &World<'_>, cameras: &[Camera], probes: usize, settings: Settings) -> SsgiProbes {
    SsgiProbes::new(world, &Setup { probes, cameras, seed: 1 }, settings)
}

/// Frames as the setup's cameras see them.
fn run(system: &mut SsgiProbes, world: &World<'_>, feedback: Feedback<'_>, frames: Range<u64>) {
    for number in frames {
        system.update(&Frame { world, number, camera: None, feedback, events: &[], still: false });
    }
}

/// Frames of a camera of their own, first bounce.
fn watch(system: &mut SsgiProbes, world: &World<'_>, camera: &Camera, frames: Range<u64>) {
    for number in frames {
        let feedback = Feedback::Nothing;
        system.update(&Frame { world, number, camera: Some(camera), feedback, events: &[], still: false });
    }
}

/// Irradiance, red.
fn irradiance(system: &dyn System, world: &World<'_>, points: &[SurfacePoint]) -> Vec<f32> {
    let shaded: Vec<Shaded> = points.iter().map(|&point| Shaded::from_above(point)).collect();
    system.irradiance(world, &Query::of(&shaded)).iter().map(|light| light.x).collect()
}

fn at(position: [f32; 3], normal: Vec3) -> SurfacePoint {
    SurfacePoint { position: Vec3::from(position), normal, geometric_normal: normal }
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

/// Black, and shining.
fn shine(emission: f32) -> Material {
    Material { base_color: Vec3::ZERO.extend(1.0), emission: Vec3::splat(emission), ..Material::default() }
}

/// A level rectangle that looks up, from -`half` to `half` along z.
fn level(half: f32, along_x: Range<f32>, height: f32, material: usize) -> Mesh {
    let corners = [(along_x.start, -half), (along_x.start, half), (along_x.end, half), (along_x.end, -half)];
    Mesh {
        name: "level".into(),
        material,
        positions: corners.map(|(x, z)| Vec3::new(x, height, z)).to_vec(),
        normals: vec![Vec3::Y; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A one-sided square of 2 m, 3 m above the origin, that shines down.
pub(super) fn panel(emission: f32) -> Scene {
    let mut mesh = level(1.0, -1.0..1.0, 3.0, 0);
    mesh.normals = vec![Vec3::NEG_Y; 4];
    mesh.triangles = vec![[0, 2, 1], [0, 3, 2]];
    Scene { name: "panel".into(), meshes: vec![mesh], materials: vec![shine(emission)], ..Scene::default() }
}

/// The same over a black floor of 10 m.
fn panel_over_floor(emission: f32) -> Scene {
    let mut scene = panel(emission);
    scene.materials.push(shine(0.0));
    scene.meshes.push(level(5.0, -5.0..5.0, 0.0, 1));
    scene
}

/// Two sealed rooms, lit in the left one: `[..3]` of the points is there, `[3..]` next door.
fn two_rooms() -> (Scene, Lighting, Vec<SurfacePoint>) {
    let scene = localprt_scenes::builtin::scene("two-rooms").expect("built in");
    let lighting = Lighting { lights: scene.lights.clone(), ..Lighting::default() };
    let points = [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5].map(|x| at([x, 0.0, 0.0], Vec3::Y)).to_vec();
    (scene, lighting, points)
}

/// First bounce at a point, by cosine-weighted rays.
fn gathered(world: &World<'_>, point: &SurfacePoint) -> f32 {
    let (tangent, bitangent) = localprt_surfaces::rays::frame(point.normal);
    let origin = point.position + point.geometric_normal * world.caster().offset_m();
    let n = 2000;
    let sent = |i| {
        let place = localprt_formats::directions::fibonacci_square(i, n, [0.0, 0.0]);
        let local = Vec3::from(localprt_formats::directions::cosine_hemisphere(place));
        let dir = tangent * local.x + bitangent * local.y + point.normal * local.z;
        let Some(hit) = world.caster().closest_hit(origin, dir) else { return world.sky(dir).x };
        world.surfel(&hit).map_or(0.0, |surfel| surfel.sent(world.direct(&surfel.point).0).x)
    };
    (0..n).map(sent).sum::<f32>() / n as f32 * PI
}
