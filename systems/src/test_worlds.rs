//! Scenes with light that is known in closed form, for the tests of all systems.

use glam::Vec3;
use localprt_scenes::{Lighting, Material, Mesh, Scene, Sky, SurfacePoint};
use localprt_surfaces::rays::RayCaster;

/// Runs a test in a world.
pub(crate) fn in_world<T>(scene: &Scene, lighting: &Lighting, test: impl FnOnce(&crate::World<'_>) -> T) -> T {
    let caster = RayCaster::new(scene).expect("a tree");
    test(&crate::World::new(&caster, lighting))
}

/// A box of 4 x 3 x 5 m that looks inwards, of one albedo and emission: irradiance of k gathers is everywhere
/// `pi Le (1 + albedo + ... + albedo^(k-1))`.
pub(crate) fn furnace(albedo: f32, emission: f32) -> Scene {
    let high = Vec3::new(4.0, 3.0, 5.0);
    let mut mesh = Mesh { name: "walls".into(), ..Mesh::default() };
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0f32)] {
        let normal = Vec3::AXES[axis] * sign;
        let (along, up) = (Vec3::AXES[(axis + 1) % 3] * high, Vec3::AXES[(axis + 2) % 3] * high);
        let corner = if sign > 0.0 { Vec3::ZERO } else { Vec3::AXES[axis] * high };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([corner, corner + along, corner + along + up, corner + up]);
        mesh.normals.extend([normal; 4]);
        let quad = [[0, 1, 2], [0, 2, 3]];
        let turned = |[a, b, c]: [u32; 3]| if sign > 0.0 { [a, b, c] } else { [a, c, b] };
        mesh.triangles.extend(quad.map(|triangle| turned(triangle).map(|vertex| first + vertex)));
    }
    let material = Material {
        base_color: Vec3::splat(albedo).extend(1.0),
        emission: Vec3::splat(emission),
        ..Material::default()
    };
    Scene { name: "furnace".into(), meshes: vec![mesh], materials: vec![material], ..Scene::default() }
}

/// Points on the walls of the furnace, looking in.
pub(crate) fn furnace_points() -> Vec<SurfacePoint> {
    let at = |position: [f32; 3], normal: Vec3| SurfacePoint {
        position: Vec3::from(position),
        normal,
        geometric_normal: normal,
    };
    vec![
        at([2.0, 0.0, 2.5], Vec3::Y),
        at([0.3, 0.0, 0.4], Vec3::Y),
        at([0.0, 1.2, 3.9], Vec3::X),
        at([4.0, 2.8, 1.0], Vec3::NEG_X),
        at([3.7, 3.0, 4.6], Vec3::NEG_Y),
        at([1.1, 0.7, 5.0], Vec3::NEG_Z),
    ]
}

/// A level square of 10 m at the origin that looks up, below a sky of radiance 1: irradiance above it is pi, and below a point in the
/// air that looks down it is that of a plane of radiance `albedo`.
pub(crate) fn lit_plane(albedo: f32) -> (Scene, Lighting) {
    let mesh = Mesh {
        name: "plane".into(),
        positions: [(-5.0, -5.0), (-5.0, 5.0), (5.0, 5.0), (5.0, -5.0)].map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec(),
        normals: vec![Vec3::Y; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let material = Material { base_color: Vec3::splat(albedo).extend(1.0), ..Material::default() };
    let scene = Scene { name: "plane".into(), meshes: vec![mesh], materials: vec![material], ..Scene::default() };
    (scene, Lighting { sky: Sky::Constant(Vec3::ONE), ..Lighting::default() })
}

/// Runs frames until a system has settled.
pub(crate) fn settle(
    system: &mut dyn crate::System,
    world: &crate::World<'_>,
    feedback: crate::Feedback<'_>,
    frames: u64,
) {
    for number in 0..frames {
        let frame = crate::Frame { world, number, camera: None, feedback, events: &[], still: false };
        system.update(&frame);
    }
}
