//! Scenes in which something large has moved since they were baked, and their light by several means.

use crate::{bake, scene, small_settings};
use glam::Vec3;
use localprt_formats::directions::counter_uniform;
use localprt_precompute::{
    BakeOutput, BakeSettings, Progress,
    metrics::MethodError,
    rays::RayCaster,
    validate::path_tracer::{PathBudget, PathTracer},
};
use localprt_scenes::{Lighting, Material, Mesh, Scene, SurfacePoint};
use localprt_systems::{
    Feedback, Frame, Query, Shaded, System, World,
    ddgi_scaled::{self, ScaledDdgi},
    hybrid::{FileLight, Hybrid, Settings},
};
use std::{path::Path, sync::LazyLock};

/// Points at which light is compared.
const POINTS: u64 = 400;
/// Part of the last frame's light that probes keep. 0.97, which is for noise on a screen, takes 300 frames to bring all bounces in.
const HYSTERESIS: f32 = 0.9;
/// Frames until light rests. A bounce enters the fields by a tenth in each frame and waits for the one before it: a hundredth is left.
pub const FRAMES: u64 = 96;
/// Gathers that are as good as all: albedos of 0.7 leave 0.7^12, 1 %.
pub const ALL: u32 = 12;
/// Seed of all that is random.
pub const SEED: u64 = 7;

/// A scene that was baked, and what moves in it now.
pub struct Study {
    /// What stands still.
    pub baked: BakeOutput,
    /// The scene with what moves.
    pub changed: Scene,
    /// What shines.
    pub lighting: Lighting,
    /// Points by area over what stands still.
    pub points: Vec<Shaded>,
}

/// Two rooms, and a slab that closes the doorway between them.
pub static DOOR: LazyLock<Study> = LazyLock::new(Study::door);
/// A platform in a court below a sky.
pub static PLATFORM: LazyLock<Study> = LazyLock::new(Study::platform);
/// A room with a wall that was not baked.
pub static WALL: LazyLock<Study> = LazyLock::new(Study::wall);

/// Faces of a box, outwards or inwards.
pub fn block(low: Vec3, high: Vec3, inwards: bool, material: usize) -> Mesh {
    let mut mesh = Mesh { name: format!("block {low} {high}"), material, ..Mesh::default() };
    for axis in 0..3 {
        let (u_axis, v_axis) = ((axis + 1) % 3, (axis + 2) % 3);
        for (is_high, at) in [(false, low[axis]), (true, high[axis])] {
            let corner = |[u, v]: [Vec3; 2]| {
                let mut corner = Vec3::ZERO;
                (corner[axis], corner[u_axis], corner[v_axis]) = (at, u[u_axis], v[v_axis]);
                corner
            };
            let mut corners = [[low, low], [high, low], [high, high], [low, high]].map(corner);
            if is_high == inwards {
                corners.reverse();
            }
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.normals.extend([Vec3::AXES[axis] * if is_high == inwards { -1.0 } else { 1.0 }; 4]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

/// A material of one albedo.
fn matte(name: &str, albedo: Vec3) -> Material {
    Material { name: name.into(), base_color: albedo.extend(1.0), ..Material::default() }
}

/// A room in one color, from the origin.
fn room(high: Vec3, without_ceiling: bool) -> Scene {
    let mut mesh = block(Vec3::ZERO, high, true, 0);
    if without_ceiling {
        // The upper face of the vertical axis is the fourth quad.
        mesh.triangles.drain(6..8);
    }
    Scene { meshes: vec![mesh], materials: vec![matte("walls", Vec3::new(0.7, 0.6, 0.5))], ..Scene::default() }
}

fn lamp(position: [f32; 3]) -> Lighting {
    let [x, y, z] = position;
    lighting(&format!(
        r#"{{"lights": [{{"type": "point", "position": [{x}, {y}, {z}], "color": [1, 1, 1], "intensity": 6}}]}}"#
    ))
}

fn lighting(json: &str) -> Lighting {
    Lighting::from_json(json, Path::new("")).expect("lighting")
}

impl Study {
    fn new(still: Scene, moving: &[Mesh], color: Vec3, lighting: Lighting) -> Self {
        let baked = bake(still, &BakeSettings { probes: Some(24), ..small_settings() });
        let changed = with(&baked.scene, moving, color);
        let points = points(&baked.scene, moving);
        Self { baked, changed, lighting, points }
    }

    /// Two rooms, and a slab in the doorway between them.
    fn door() -> Self {
        let still = scene("two-rooms-door");
        let lighting = Lighting::of_scene(&still);
        let slab = block(Vec3::new(-0.04, 0.0, -0.6), Vec3::new(0.04, 2.2, 0.6), false, 0);
        Self::new(still, &[slab], Vec3::splat(0.6), lighting)
    }

    /// A platform in a court below a sky.
    fn platform() -> Self {
        let sky = lighting(r#"{"sky": {"type": "constant", "radiance": [0.8, 0.9, 1.2]}}"#);
        let slab = block(Vec3::new(1.0, 1.4, 2.0), Vec3::new(5.0, 1.7, 6.0), false, 0);
        Self::new(room(Vec3::new(8.0, 4.0, 8.0), true), &[slab], Vec3::new(0.8, 0.2, 0.1), sky)
    }

    /// A room whose wall, with an opening at its end, was not there when it was baked.
    fn wall() -> Self {
        let wall = block(Vec3::new(2.9, 0.0, -0.1), Vec3::new(3.1, 3.1, 3.0), false, 0);
        Self::new(room(Vec3::new(6.0, 3.0, 4.0), false), &[wall], Vec3::splat(0.6), lamp([1.2, 2.4, 1.5]))
    }

    /// Irradiance of `changed`, path traced.
    pub fn truth(&self, bounces: u32) -> Vec<Vec3> {
        let caster = RayCaster::new(&self.changed).expect("tree");
        let points: Vec<SurfacePoint> = self.points.iter().map(|shaded| shaded.point).collect();
        let budget = PathBudget { error: 0.02, most_paths: 4096 };
        let tracer = PathTracer::new(&caster, &self.lighting, bounces, SEED);
        tracer.estimate(&points, budget, &Progress::silent()).expect("not cancelled").irradiance
    }

    /// Light of a system at rest, that `make` makes of rays against what stands still and of the changed world.
    fn light<'s, S: System + 's>(
        &'s self,
        still: &'s RayCaster<'s>,
        bounces: u32,
        make: impl FnOnce(&'s RayCaster<'s>, &World<'_>) -> S,
    ) -> (Vec<Vec3>, S) {
        let caster = RayCaster::new(&self.changed).expect("tree");
        let world = World::new(&caster, &self.lighting);
        let mut system = make(still, &world);
        let feedback = if bounces == 1 { Feedback::Nothing } else { Feedback::Own };
        run(&mut system, &world, feedback);
        (system.irradiance(&world, &Query::of(&self.points)), system)
    }

    /// Light of the hybrid at rest.
    pub fn hybrid(&self, settings: Settings, bounces: u32) -> Vec<Vec3> {
        let still = RayCaster::new(&self.baked.scene).expect("tree");
        let make = |caster, _: &World<'_>| Hybrid::new(self.checked(), caster, settings, SEED);
        self.light(&still, bounces, make).0
    }

    /// Light of the file alone.
    pub fn file(&self, bounces: u32) -> Vec<Vec3> {
        let still = RayCaster::new(&self.baked.scene).expect("tree");
        self.light(&still, bounces, |caster, _| FileLight::new(self.checked(), caster)).0
    }

    /// Light of scaled DDGI alone.
    pub fn ddgi(&self, probes: usize, bounces: u32) -> Vec<Vec3> {
        let still = RayCaster::new(&self.baked.scene).expect("tree");
        let settings = ddgi_scaled::Settings { hysteresis: HYSTERESIS, ..ddgi_scaled::Settings::default() };
        let make = |_, world: &World<'_>| ScaledDdgi::over(world, probes, settings, SEED);
        self.light(&still, bounces, make).0
    }

    /// The file, checked.
    pub fn checked(&self) -> localprt_formats::Checked<'_> {
        self.baked.arrays.checked().expect("consistent arrays")
    }
}

/// A scene and what moves in it, of one color.
pub fn with(still: &Scene, moving: &[Mesh], color: Vec3) -> Scene {
    let mut changed = still.clone();
    let material = changed.materials.len();
    changed.materials.push(matte("moving", color));
    changed.meshes.extend(moving.iter().map(|mesh| Mesh { material, ..mesh.clone() }));
    changed
}

/// Points by area over what stands still, but not inside of what moves.
fn points(still: &Scene, moving: &[Mesh]) -> Vec<Shaded> {
    let faces: Vec<(usize, usize)> = still.faces().collect();
    let ends: Vec<f64> = faces
        .iter()
        .scan(0.0, |sum, &(mesh, triangle)| {
            *sum += still.area_m2(mesh, triangle);
            Some(*sum)
        })
        .collect();
    let all = ends.last().copied().unwrap_or_default();
    let random = |point: u64, counter: u64| counter_uniform(SEED, point, counter);
    let is_free = |position: Vec3| {
        moving.iter().all(|mesh| {
            let low = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min) - 1e-3;
            let high = mesh.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max) + 1e-3;
            !(position.cmpge(low).all() && position.cmple(high).all())
        })
    };
    let point = |number: u64| {
        let at = (number as f64 + random(number, 0)) / POINTS as f64 * all;
        let (mesh, triangle) = faces[ends.partition_point(|&end| end <= at).min(faces.len() - 1)];
        let (root, along) = (random(number, 1).sqrt() as f32, random(number, 2) as f32);
        let weights = Vec3::new(1.0 - root, root * (1.0 - along), root * along);
        Shaded::from_above(still.surface_point(mesh, triangle, weights))
    };
    (0..POINTS).map(point).filter(|shaded| is_free(shaded.point.position)).collect()
}

fn run(system: &mut dyn System, world: &World<'_>, feedback: Feedback<'_>) {
    for number in 0..FRAMES {
        let still = number > 0 && matches!(feedback, Feedback::Nothing);
        let frame = Frame { world, number, camera: None, feedback, events: &[], still };
        system.update(&frame);
    }
}

/// Error over points and color bands, over the mean of the truth.
pub fn nrmse(found: &[Vec3], truth: &[Vec3]) -> f64 {
    MethodError::of(found, truth).expect("there is light").nrmse
}

/// What tests run with: a few probes, 5 x 3 x 5 of each field in the court.
pub fn settings() -> Settings {
    let own = Settings::default();
    Settings { probes: 80, field: ddgi_scaled::Settings { hysteresis: HYSTERESIS, ..own.field }, ..own }
}
