//! Views and tone curves whose pixels are known: a floor under a directional light and a constant sky.

mod dark_file;

use dark_file::{dark_file, device, one_receiver};
use glam::{Mat4, Vec2, Vec3, Vec4, camera::rh::view::look_at_mat4};
use localprt_formats::BakedArrays;
use localprt_runtime::{DirectLight, Relighter, RelighterOptions, SceneTexels, ShadowCasters};
use localprt_scenes::{Light, LightKind, Material, Mesh, Scene, Sky};
use localprt_viewer::{
    DrawOptions, GRAY_ALBEDO, Legend, MovingObject, ObjectShape, OffscreenTarget, ReceiverMap, SceneDraw, Specular,
    ToneMap, View, ViewKind,
};
use std::f32::consts::{FRAC_PI_2, PI};

const SIZE: u32 = 64;
const LUX: f32 = 5.0;
/// Indirect irradiance of every receiver, from the sky.
const INDIRECT: Vec3 = Vec3::new(0.5, 1.0, 2.0);
const EMISSION: Vec3 = Vec3::new(0.0, 0.125, 0.0);
const SKY: Vec3 = Vec3::new(1.0, 2.0, 3.0);
/// f16 keeps 2^-11; lights add f32 roundings, and parts one rounding each.
const TOLERANCE: f32 = 1e-3;

/// A file whose one receiver has as its irradiance the sky's first coefficient.
fn file() -> BakedArrays {
    BakedArrays { blocks: one_receiver(1, 1, &[0.0, 1.0]), ..dark_file() }
}

/// A floor from -1 to 1 with u along x and v along z.
fn floor() -> Scene {
    let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let uv: Vec<Vec2> = positions.iter().map(|point| Vec2::new(point.x + 1.0, point.z + 1.0) * 0.5).collect();
    Scene {
        meshes: vec![Mesh {
            normals: vec![Vec3::Y; 4],
            uv_sets: vec![uv.clone(), uv],
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            positions: positions.to_vec(),
            ..Mesh::default()
        }],
        materials: vec![Material {
            base_color: Vec4::new(0.8, 0.25, 1.0, 1.0),
            emission: EMISSION,
            ..Material::default()
        }],
        ..Scene::default()
    }
}

fn sun() -> Light {
    Light {
        name: String::new(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::NEG_Y,
        color: Vec3::ONE,
        intensity: LUX,
        range: None,
    }
}

struct Stage {
    device: wgpu::Device,
    queue: wgpu::Queue,
    relighter: Relighter,
    draw: SceneDraw,
    target: OffscreenTarget,
}

impl Stage {
    fn new((device, queue): (wgpu::Device, wgpu::Queue)) -> Self {
        let (baked, scene) = (file(), floor());
        let mut relighter =
            Relighter::new(&device, &queue, &baked.checked().expect("a sound file"), RelighterOptions::default())
                .expect("a relighter");
        let texels = SceneTexels {
            lightmap_uv: Vec::new(),
            size: 1,
            index: vec![0],
            position: vec![Vec3::ZERO],
            normal: vec![Vec3::Y],
            geometric_normal: vec![Vec3::Y],
            albedo: vec![Vec3::ZERO],
            emission: vec![Vec3::ZERO],
            material: vec![0],
            ..SceneTexels::default()
        };
        relighter.set_texels(&texels, &ShadowCasters::of_scene(&scene)).expect("a scene");
        relighter.set_lights(&[sun()]);
        relighter.set_sky(&[INDIRECT], &[]).expect("a sky");
        let mut draw =
            SceneDraw::new(&device, &queue, &scene, &relighter, DrawOptions::default()).expect("a scene to draw");
        draw.set_sky(&device, &queue, &Sky::Constant(SKY));
        let target = OffscreenTarget::new(&device, SIZE, SIZE);
        Self { device, queue, relighter, draw, target }
    }

    /// Radiance and bytes of a view, from two metres above the floor, which fills the middle half; up in the picture is -Z.
    fn picture(&mut self, view: ViewKind, scale: f32, tone: ToneMap) -> (Vec<Vec3>, Vec<u8>) {
        let specular = Some(Specular { f0: 0.5, roughness: Some(0.5) });
        self.draw.set_options(DrawOptions { view, specular, ..DrawOptions::default() });
        let to_world = look_at_mat4(Vec3::Y * 2.0, Vec3::ZERO, Vec3::NEG_Z).inverse();
        let view = View { to_world, fov_y: FRAC_PI_2, near_m: 0.01 };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        self.relighter.encode(&mut encoder, &DirectLight::Lights).expect("light");
        self.draw
            .encode(&self.queue, &mut encoder, &self.relighter, &view, &self.target, None, None)
            .expect("a picture");
        self.target.tone_map(&self.queue, &mut encoder, scale, tone);
        self.queue.submit([encoder.finish()]);
        let radiance = self.target.read_radiance(&self.device, &self.queue).expect("radiance");
        (radiance, self.target.read_srgb(&self.device, &self.queue).expect("a picture"))
    }
}

fn close(found: Vec3, expected: Vec3) {
    assert!((found - expected).abs().max_element() <= TOLERANCE * expected.max_element(), "{found}, not {expected}");
}

/// sRGB bytes of display-linear values, not rounded.
fn encoded(linear: Vec3) -> Vec3 {
    let encode = |linear: f32| match linear <= 0.003_130_8 {
        true => linear * 12.92,
        false => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
    };
    255.0 * Vec3::from_array(linear.to_array().map(encode))
}

/// In the middle of the floor, and in the sky's corner.
const MIDDLE: usize = (SIZE * SIZE / 2 + SIZE / 2) as usize;
const CORNER: usize = 0;

#[test]
fn direct_and_indirect_light_add_up_to_lighting() {
    let Some(gpu) = device("direct_and_indirect_light_add_up_to_lighting") else { return };
    let mut stage = Stage::new(gpu);
    let object = MovingObject {
        shape: ObjectShape::Box,
        to_world: Mat4::from_translation(Vec3::new(-0.5, 1.0, 0.0)) * Mat4::from_scale(Vec3::splat(0.1)),
        albedo: Vec3::splat(0.1),
        emission: Vec3::ZERO,
    };
    stage.draw.set_objects(&stage.device, &stage.queue, &[object]);
    let mut radiance = |view| stage.picture(view, 1.0, ToneMap::Clamp).0;
    let (all, lighting) = (radiance(ViewKind::Final), radiance(ViewKind::Lighting));
    let (direct, indirect) = (radiance(ViewKind::Direct), radiance(ViewKind::Indirect));
    let gray = GRAY_ALBEDO / PI;
    close(direct[MIDDLE], Vec3::splat(gray * LUX));
    close(indirect[MIDDLE], gray * INDIRECT);
    close(lighting[MIDDLE], EMISSION + gray * (INDIRECT + LUX));
    // Mirrored light is in the final picture alone.
    let diffuse = EMISSION + Vec3::new(0.8, 0.25, 1.0) / PI * (INDIRECT + LUX);
    assert!(all[MIDDLE].cmpgt(1.01 * diffuse).all(), "{}", all[MIDDLE]);
    let object_at = MIDDLE - (SIZE / 4) as usize;
    assert!(lighting[object_at].x > 2.0 * all[object_at].x, "it is gray in the view, and darker than that itself");
    for index in 0..all.len() {
        let glow = if index == object_at { Vec3::ZERO } else { EMISSION };
        let is_floor = indirect[index] == indirect[MIDDLE];
        if is_floor || index == object_at {
            close(direct[index] + indirect[index] + glow, lighting[index]);
        }
    }
    close(all[CORNER], SKY);
    close(lighting[CORNER], SKY);
    assert_eq!((direct[CORNER], indirect[CORNER]), (Vec3::ZERO, Vec3::ZERO));
}

/// Each band has every byte; every sixteenth texel has nothing.
fn all_bytes() -> ReceiverMap {
    let texel = |index: u32| [index as u8, 255 - index as u8, (7 * index) as u8, if index % 16 == 5 { 0 } else { 255 }];
    ReceiverMap { size: 16, rgba: (0..256).flat_map(texel).collect(), legend: Legend::default() }
}

#[test]
fn maps_reach_the_picture_byte_for_byte() {
    let Some(gpu) = device("maps_reach_the_picture_byte_for_byte") else { return };
    let mut stage = Stage::new(gpu);
    let byte = |bytes: &[u8], index: usize| [bytes[3 * index], bytes[3 * index + 1], bytes[3 * index + 2]];
    let (_, without) = stage.picture(ViewKind::Unseen, 1.0, ToneMap::Clamp);
    assert_eq!((byte(&without, MIDDLE), byte(&without, CORNER)), ([128; 3], [40; 3]), "nothing set, backdrop");
    let map = all_bytes();
    stage.draw.set_receiver_map(&stage.device, &stage.queue, &map);
    for view in ViewKind::ALL.into_iter().filter(|view| view.is_map()) {
        let (_, bytes) = stage.picture(view, 1.0, ToneMap::Clamp);
        // The floor fills columns and rows 16 to 47, two to a texel.
        for (row, column) in (0..SIZE as usize).flat_map(|row| (0..SIZE as usize).map(move |column| (row, column))) {
            let is_floor = [row, column].iter().all(|at| (16..48).contains(at));
            let texel = 4 * (row.saturating_sub(16) / 2 * 16 + column.saturating_sub(16) / 2);
            let expected = match is_floor {
                true if map.rgba[texel + 3] == 0 => [128; 3],
                true => [map.rgba[texel], map.rgba[texel + 1], map.rgba[texel + 2]],
                false => [40; 3],
            };
            assert_eq!(byte(&bytes, row * SIZE as usize + column), expected, "{} {row} {column}", view.name());
        }
    }
}

#[test]
fn meshes_without_lightmap_coordinates_show_no_map() {
    let Some(gpu) = device("meshes_without_lightmap_coordinates_show_no_map") else { return };
    let mut stage = Stage::new(gpu);
    let mut scene = floor();
    scene.meshes[0].uv_sets.clear();
    stage.draw = SceneDraw::new(&stage.device, &stage.queue, &scene, &stage.relighter, DrawOptions::default())
        .expect("a scene to draw");
    stage.draw.set_receiver_map(&stage.device, &stage.queue, &all_bytes());
    let (_, bytes) = stage.picture(ViewKind::Clusters, 1.0, ToneMap::Clamp);
    assert_eq!(bytes[3 * MIDDLE..][..3], [128; 3]);
}

#[test]
fn every_tone_curve_is_its_twin() {
    let Some(gpu) = device("every_tone_curve_is_its_twin") else { return };
    let mut stage = Stage::new(gpu);
    assert_eq!(stage.target.size(), (SIZE, SIZE));
    for tone in ToneMap::ALL {
        for ev in [-9, -3, -1, 0, 1, 3, 6] {
            let scale = f32::powi(2.0, ev);
            let (radiance, bytes) = stage.picture(ViewKind::Final, scale, tone);
            for index in [MIDDLE, CORNER] {
                let expected = encoded(tone.apply(scale * radiance[index]));
                let found = Vec3::from_array([0, 1, 2].map(|band| f32::from(bytes[3 * index + band])));
                // Half a step of rounding, and a little for the hardware's encoding, logarithms and powers.
                let difference = (found - expected).abs().max_element();
                assert!(difference <= 0.7, "{} {ev}: {found} instead of {expected}", tone.name());
            }
        }
    }
}

#[test]
fn the_picture_can_be_read_as_bytes() {
    let Some(gpu) = device("the_picture_can_be_read_as_bytes") else { return };
    let stage = Stage::new(gpu);
    let view = stage.target.srgb_bytes_view();
    assert_eq!(view.texture().size(), stage.target.radiance_texture().size());
    let layout = stage.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: true },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            count: None,
        }],
    });
    // A user interface binds it like this; what it must not do is an error, which panics.
    let _ = stage.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
    });
}
