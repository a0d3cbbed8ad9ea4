//! Pictures whose pixels are known: a floor under a directional light and nothing that light bounces off.

use glam::{Affine2, Mat4, Vec2, Vec3, Vec4, camera::rh::view::look_at_mat4};
use half::f16;
use localprt_formats::{BakedArrays, ClusterRecord, Metadata, Probe, directions::spherical_fibonacci};
use localprt_precompute::picture::tone_curve;
use localprt_runtime::{DirectLight, Relighter, RelighterOptions, SceneTexels, ShadowCasters, gpu::headless};
use localprt_scenes::{Image, Light, LightKind, Material, Mesh, Scene, Sky, Texture, TextureRef, Wrap};
use localprt_viewer::{DrawOptions, MovingObject, ObjectShape, OffscreenTarget, SceneDraw, View, moving_casters};
use std::f32::consts::{FRAC_PI_2, PI};

const SIZE: u32 = 64;
const LUX: f32 = 5.0;
/// Bytes of the normal map: right, up and out.
const BUMP: [u8; 3] = [190, 175, 230];
/// f16 keeps 2^-11; lights and normals add f32 roundings.
const TOLERANCE: f32 = 1e-3;

/// A device, or `None` with a line that says so; a failure if `REQUIRE_GPU` is set.
fn device(test: &str) -> Option<(wgpu::Device, wgpu::Queue)> {
    match pollster::block_on(headless()) {
        Ok(found) => Some(found),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some() => panic!("{test}: {error}"),
        Err(error) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
    }
}

/// A file whose transport is zero.
fn dark_file() -> BakedArrays {
    let n_rays = 64;
    BakedArrays {
        metadata: Metadata { lightmap_size: 1, direct_size: 1, n_rays, ..Metadata::default() },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }],
        ray_dirs: (0..n_rays).map(|i| spherical_fibonacci(i, n_rays)).map(|[x, y, z]| [x, y, z, 0.0]).collect(),
        ray_sh: vec![0.0; 64],
        ray_uv: vec![0x8000_8000; 64],
        ray_level: vec![0; 64],
        receiver_texel: vec![0],
        receiver_position: vec![[0.0; 3]],
        receiver_normal: vec![[0.0, 1.0, 0.0]],
        receiver_unseen: vec![0.0],
        clusters: vec![ClusterRecord { n_receivers: 1, n_probes: 1, n_coefficients: 1, ..Default::default() }],
        cluster_probes: vec![0],
        projection: vec![f16::ZERO; 2],
        reconstruction: vec![f16::ZERO; 2],
        ..BakedArrays::default()
    }
}

/// A floor from -1 to 1 with u along x and v along z, so that the normal map's right is +X and its up is -Z.
fn floor(with_tangents: bool) -> Scene {
    let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let uv: Vec<Vec2> = positions.iter().map(|point| Vec2::new(point.x + 1.0, point.z + 1.0) * 0.5).collect();
    let reference = TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    Scene {
        meshes: vec![Mesh {
            normals: vec![Vec3::Y; 4],
            tangents: if with_tangents { vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4] } else { Vec::new() },
            uv_sets: vec![uv.clone(), uv],
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            positions: positions.to_vec(),
            ..Mesh::default()
        }],
        materials: vec![Material {
            base_color: Vec4::new(0.5, 0.25, 1.0, 1.0),
            emission: Vec3::new(0.0, 0.125, 0.0),
            normal_texture: Some(reference),
            ..Material::default()
        }],
        textures: vec![Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false }],
        images: vec![Image {
            name: String::new(),
            width: 4,
            height: 4,
            rgba: [[BUMP[0], BUMP[1], BUMP[2], 255]; 16].concat(),
            encoded: None,
        }],
        ..Scene::default()
    }
}

fn sun() -> Light {
    Light {
        name: String::new(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: -dir_to_sun(),
        color: Vec3::ONE,
        intensity: LUX,
        range: None,
    }
}

fn dir_to_sun() -> Vec3 {
    Vec3::new(0.3, 1.0, 0.2).normalize()
}

const SKY: Sky = Sky::Gradient {
    zenith: Vec3::new(1.0, 2.0, 3.0),
    horizon: Vec3::new(5.0, 5.0, 1.0),
    ground: Vec3::new(0.5, 0.25, 0.0),
};

struct Pictures {
    radiance: Vec<Vec3>,
    srgb: Vec<u8>,
}

/// From two metres above the floor, which fills the middle half; up in the picture is -Z.
fn pictures(
    (device, queue): &(wgpu::Device, wgpu::Queue),
    scene: &Scene,
    normal_maps: bool,
    objects: &[MovingObject],
) -> Pictures {
    let baked = dark_file();
    let mut gi = Relighter::new(device, queue, baked.view(), RelighterOptions::default()).expect("a relighter");
    let texels = SceneTexels {
        size: 1,
        index: vec![0],
        position: vec![Vec3::ZERO],
        normal: vec![Vec3::Y],
        geometric_normal: vec![Vec3::Y],
        albedo: vec![Vec3::ZERO],
        emission: vec![Vec3::ZERO],
        material: vec![0],
    };
    gi.set_scene(&texels, &ShadowCasters::of_scene(scene)).expect("a scene");
    gi.set_moving_casters(&moving_casters(objects)).expect("casters");
    gi.set_lights(&[sun()]);
    let options = DrawOptions { normal_maps, ..DrawOptions::default() };
    let mut draw = SceneDraw::new(device, queue, scene, &gi, options).expect("a scene to draw");
    draw.set_sky(device, queue, &SKY);
    draw.set_objects(device, queue, objects);
    let target = OffscreenTarget::new(device, SIZE, SIZE);
    let to_world = look_at_mat4(Vec3::Y * 2.0, Vec3::ZERO, Vec3::NEG_Z).inverse();
    let view = View { to_world, fov_y: FRAC_PI_2, near_m: 0.01 };
    let mut encoder = device.create_command_encoder(&Default::default());
    gi.encode(&mut encoder, &DirectLight::Lights).expect("light");
    draw.encode(queue, &mut encoder, &gi, &view, &target).expect("a picture");
    target.tone_map(queue, &mut encoder, 0.5);
    queue.submit([encoder.finish()]);
    Pictures {
        radiance: target.read_radiance(device, queue).expect("radiance"),
        srgb: target.read_srgb(device, queue).expect("a picture"),
    }
}

/// Pixel that shows a point, and the point that its center shows on the floor.
fn pixel(x: f32, z: f32) -> usize {
    let half = SIZE as f32 / 2.0;
    let (column, row) = ((half + half * x / 2.0) as usize, (half + half * z / 2.0) as usize);
    row * SIZE as usize + column
}

fn close(found: Vec3, expected: Vec3) {
    assert!((found - expected).abs().max_element() <= TOLERANCE * expected.max_element(), "{found}, not {expected}");
}

fn lit(normal: Vec3) -> Vec3 {
    let irradiance = LUX * normal.dot(dir_to_sun()).max(0.0);
    Vec3::new(0.0, 0.125, 0.0) + Vec3::new(0.5, 0.25, 1.0) / PI * irradiance
}

#[test]
fn normal_maps_bend_to_the_right_and_up() {
    let Some(gpu) = device("normal_maps_bend_to_the_right_and_up") else { return };
    let [right, up, out] = BUMP.map(|byte| f32::from(byte) / 255.0 * 2.0 - 1.0);
    let bent = Vec3::new(right, out, -up).normalize();
    for with_tangents in [true, false] {
        let scene = floor(with_tangents);
        close(pictures(&gpu, &scene, true, &[]).radiance[pixel(0.4, -0.3)], lit(bent));
        close(pictures(&gpu, &scene, false, &[]).radiance[pixel(0.4, -0.3)], lit(Vec3::Y));
    }
}

#[test]
fn the_sky_is_seen_beside_the_floor_and_tone_mapped() {
    let Some(gpu) = device("the_sky_is_seen_beside_the_floor_and_tone_mapped") else { return };
    let pictures = pictures(&gpu, &floor(true), true, &[]);
    // The middle of the leftmost pixel of a row in the middle.
    let (index, step) = (SIZE as usize * (SIZE as usize / 2), 1.0 / SIZE as f32);
    let dir = Vec3::new(-1.0 + step, -1.0, step).normalize();
    close(pictures.radiance[index], SKY.radiance(dir));
    for index in [index, pixel(0.0, 0.0)] {
        for (band, value) in pictures.radiance[index].to_array().into_iter().enumerate() {
            let linear = tone_curve(0.5 * value);
            let encoded = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            let found = f32::from(pictures.srgb[3 * index + band]);
            // Half a step of rounding, and a little for the hardware's encoding.
            assert!((found - encoded * 255.0).abs() <= 0.7, "{found} instead of {}", encoded * 255.0);
        }
    }
}

#[test]
fn objects_are_lit_by_their_own_light_and_cast_shadows() {
    let Some(gpu) = device("objects_are_lit_by_their_own_light_and_cast_shadows") else { return };
    let ambient = Vec3::new(2.0, 1.0, 0.5);
    let object = MovingObject {
        shape: ObjectShape::Box,
        to_world: Mat4::from_translation(Vec3::new(-0.25, 1.0, 0.25)) * Mat4::from_scale(Vec3::splat(0.2)),
        albedo: Vec3::splat(0.5),
        emission: Vec3::new(0.0, 0.0, 0.25),
        light: [ambient * (4.0 * PI).sqrt(), Vec3::ZERO, Vec3::ZERO, Vec3::ZERO],
    };
    let pictures = pictures(&gpu, &floor(true), false, &[object]);
    // The top is 0.8 m below the eye, where floor coordinates are 2 / 0.8 times as large.
    let direct = Vec3::splat(0.5 / PI * LUX * dir_to_sun().y);
    close(pictures.radiance[pixel(-0.625, 0.625)], Vec3::new(0.0, 0.0, 0.25) + 0.5 * ambient + direct);
    // The shadow's middle is 1 m below the box, 0.3 and 0.2 m away from the sun.
    close(pictures.radiance[pixel(-0.55, -0.05)], Vec3::new(0.0, 0.125, 0.0));
    close(pictures.radiance[pixel(0.5, -0.5)], lit(Vec3::Y));
}
