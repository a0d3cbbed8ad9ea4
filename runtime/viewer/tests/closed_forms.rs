//! Pictures whose pixels are known: a floor under a directional light and nothing that light bounces off.

mod dark_file;

use dark_file::{dark_file, device, one_receiver};
use glam::{Affine2, Mat4, Vec2, Vec3, Vec4, camera::rh::view::look_at_mat4};
use half::f16;
use localprt_formats::sh::{Basis, function_count};
use localprt_formats::weight::weight_kernel;
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, LEVEL_BLACK, Metadata, Probe, TransportBlock, VolumeArrays, VolumeGrid,
};
use localprt_precompute::picture::tone_curve;
use localprt_runtime::{DirectLight, Relighter, RelighterOptions, SceneTexels, ShadowCasters};
use localprt_scenes::{Image, Light, LightKind, Material, Mesh, Scene, Sky, Texture, TextureRef, Wrap};
use localprt_viewer::{
    DrawOptions, MovingObject, ObjectShape, OffscreenTarget, SceneDraw, ToneMap, View, moving_casters,
};
use std::f32::consts::{FRAC_PI_2, PI};

const SIZE: u32 = 64;
const LUX: f32 = 5.0;
/// Bytes of the normal map: right, up and out.
const BUMP: [u8; 3] = [190, 175, 230];
/// f16 keeps 2^-11; lights and normals add f32 roundings.
const TOLERANCE: f32 = 1e-3;

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
    pictures_of(&dark_file(), Vec3::ZERO, (device, queue), scene, normal_maps, objects)
}

/// The same with another file, whose relight rays find surface that emits so much.
fn pictures_of(
    baked: &BakedArrays,
    emission: Vec3,
    (device, queue): (&wgpu::Device, &wgpu::Queue),
    scene: &Scene,
    normal_maps: bool,
    objects: &[MovingObject],
) -> Pictures {
    let mut gi = Relighter::new(device, queue, &baked.checked().expect("a sound file"), RelighterOptions::default())
        .expect("a relighter");
    let texels = SceneTexels {
        lightmap_uv: Vec::new(),
        size: 1,
        index: vec![0],
        position: vec![Vec3::ZERO],
        normal: vec![Vec3::Y],
        geometric_normal: vec![Vec3::Y],
        albedo: vec![Vec3::ZERO],
        emission: vec![emission],
        material: vec![0],
        ..SceneTexels::default()
    };
    gi.set_texels(&texels, &ShadowCasters::of_scene(scene)).expect("a scene");
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
    draw.encode(queue, &mut encoder, &gi, &view, &target, None, None).expect("a picture");
    target.tone_map(queue, &mut encoder, 0.5, ToneMap::Reinhard);
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

/// A box whose top is 0.8 m below the eye, where floor coordinates are 2 / 0.8 times as large.
fn object() -> MovingObject {
    MovingObject {
        shape: ObjectShape::Box,
        to_world: Mat4::from_translation(Vec3::new(-0.25, 1.0, 0.25)) * Mat4::from_scale(Vec3::splat(0.2)),
        albedo: Vec3::splat(0.5),
        emission: Vec3::new(0.0, 0.0, 0.25),
    }
}

/// The box's top in light of this irradiance and in the sun.
fn lit_top(irradiance: Vec3) -> Vec3 {
    Vec3::new(0.0, 0.0, 0.25) + 0.5 / PI * (irradiance + LUX * dir_to_sun().y)
}

const TOP: [f32; 2] = [-0.625, 0.625];

#[test]
fn objects_cast_shadows() {
    let Some(gpu) = device("objects_cast_shadows") else { return };
    let pictures = pictures(&gpu, &floor(true), false, &[object()]);
    close(pictures.radiance[pixel(TOP[0], TOP[1])], lit_top(Vec3::ZERO));
    // The shadow's middle is 1 m below the box, 0.3 and 0.2 m away from the sun.
    close(pictures.radiance[pixel(-0.55, -0.05)], Vec3::new(0.0, 0.125, 0.0));
    close(pictures.radiance[pixel(0.5, -0.5)], lit(Vec3::Y));
}

/// Probes of this degree with a ray along each half axis, so that SH up to degree 1 are summed exactly: the first sees light
/// along `lit` of them (+X, -X, +Y, ...), the second none.
fn lit_file(probe_degree: u32, lit: impl Fn(usize) -> bool) -> BakedArrays {
    let dirs = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let n_sh = function_count(probe_degree);
    let sh = |dir: Vec3| {
        let mut values = vec![0.0; n_sh];
        Basis::new(probe_degree).evaluate(dir.to_array(), &mut values);
        values.into_iter().map(|value| value * 4.0 * PI / 6.0)
    };
    BakedArrays {
        metadata: Metadata { n_rays: 6, probe_degree, ..dark_file().metadata },
        probes: vec![
            Probe { position: [-0.25, 1.0, 1.25], support_radius_m: 4.0 },
            Probe { position: [-0.25, 3.0, 0.25], support_radius_m: 4.0 },
        ],
        ray_dirs: dirs.iter().map(|dir| dir.extend(0.0).to_array()).collect(),
        ray_sh: dirs.into_iter().flat_map(sh).collect(),
        ray_uv: vec![0x8000_8000; 12],
        ray_level: (0..12).map(|ray| if ray < 6 && lit(ray) { 0 } else { LEVEL_BLACK }).collect(),
        blocks: one_receiver(1, 0, &vec![0.0; n_sh]),
        ..dark_file()
    }
}

const EMISSION: Vec3 = Vec3::new(2.0, 1.0, 0.5);

#[test]
fn objects_are_lit_by_the_probes_around_them() {
    let Some((device, queue)) = device("objects_are_lit_by_the_probes_around_them") else { return };
    let top = |file: &BakedArrays| {
        let pictures = pictures_of(file, EMISSION, (&device, &queue), &floor(true), false, &[object()]);
        pictures.radiance[pixel(TOP[0], TOP[1])]
    };
    for degree in 0..=2 {
        let mut file = lit_file(degree, |_| true);
        // The object's center is 1 m from the first probe and 2 m from the second.
        let weights = [0.25, 0.5].map(weight_kernel);
        close(top(&file), lit_top(PI * EMISSION * weights[0] / (weights[0] + weights[1])));
        // Out of the second one's support the first is all there is: constant radiance L gives pi L.
        file.probes[1].support_radius_m = 1.9;
        close(top(&file), lit_top(PI * EMISSION));
        // Out of both there is none.
        file.probes[0].support_radius_m = 0.9;
        close(top(&file), lit_top(Vec3::ZERO));
    }
    // Light from above alone, of a sixth of all directions: degree 0 keeps a quarter of it in the irradiance; from degree 1
    // on, the curve about the light's direction is exact head on.
    for (degree, share) in [(0, 0.25), (1, 1.0)] {
        let mut file = lit_file(degree, |ray| ray == 2);
        file.probes[1].support_radius_m = 1.0;
        close(top(&file), lit_top(4.0 * PI / 6.0 * share * EMISSION));
    }
}

#[test]
fn objects_are_lit_by_the_volume_where_there_is_one() {
    let Some((device, queue)) = device("objects_are_lit_by_the_volume_where_there_is_one") else { return };
    let mut file = lit_file(0, |_| true);
    // The first probe's radiance in the lower cells and twice that in the upper ones, 2 m above them.
    let mut reconstruction = vec![f16::ZERO; 8 * 4];
    for (cell, row) in reconstruction.chunks_exact_mut(4).enumerate() {
        row[0] = f16::from_f32(if cell & 2 == 0 { 1.0 } else { 2.0 });
    }
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 8, n_probes: 1, n_sky: 0, n_coefficients: 1 };
    block.push(record, &[0], &[f16::ONE], &reconstruction);
    let volume_from = |height: f32| {
        let grid = VolumeGrid { origin: [-1.0, height, -1.0], spacing_m: 2.0, dims: [2, 2, 2], degree: 1 };
        let positions: Vec<_> = (0..8).map(|cell| grid.position(cell)).collect();
        let blocks = BlockArrays::of_one(&block, &positions, grid.n_k());
        Some(VolumeArrays { grid, cells: (0..8).collect(), blocks, fill: Vec::new() })
    };
    file.volume = volume_from(0.0);
    let top = |file: &BakedArrays| {
        let pictures = pictures_of(file, EMISSION, (&device, &queue), &floor(true), false, &[object()]);
        pictures.radiance[pixel(TOP[0], TOP[1])]
    };
    // The top is at 1.2 m. Texture coordinates have 8 bits between texels in some hardware.
    let found = (top(&file) - lit_top(Vec3::ZERO)) / EMISSION / 0.5;
    assert!((found - 1.6).abs().max_element() < 1.0 / 256.0 + 2e-3, "{found}");
    // Above the grid its border goes on: constant radiance L gives pi L.
    file.volume = volume_from(5.0);
    close(top(&file), lit_top(PI * EMISSION));
}
