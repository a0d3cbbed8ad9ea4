//! What is written loads as what it was, byte for byte the same every time.

mod common;

use common::{assert_same, square};
use glam::{Affine2, Mat4, Vec2, Vec3, Vec4, vec2, vec3};
use localprt_scenes::{
    AlphaMode, Camera, ExportError, Image, Light, LightKind, LightmapWish, Material, Mesh, Scene, Texture, TextureRef,
    Wrap, export_glb, load,
};

/// A scene that uses everything the exporter writes.
fn everything() -> Scene {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("square.glb");
    let (root, bin) = square();
    std::fs::write(&path, common::glb(&root, &bin)).expect("writable folder");
    let mut scene = load(&path).expect("a sound file");
    let mesh = &mut scene.meshes[0];
    mesh.tangents = vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 4];
    mesh.colors = vec![Vec4::new(0.1, 0.2, 0.3, 0.4); 4];
    // A gap at set 1, and the lightmap's set after it.
    mesh.uv_sets = vec![mesh.uv_sets[0].clone(), Vec::new(), vec![vec2(0.1, 0.7); 4]];
    mesh.name = "wall \"1\"".into();
    mesh.lightmap = LightmapWish { texel_scale: 2.5, bake: false };
    let mut lower =
        Mesh { uv_sets: vec![Vec::new(), Vec::new(), vec![Vec2::splat(0.3); 4]], material: 1, ..mesh.clone() };
    lower.positions.iter_mut().for_each(|position| position.z = -0.0137);
    scene.meshes.push(lower);

    scene.light_map_set = Some(2);

    let pixels = (0..2 * 3 * 4).map(|value| value * 10).collect();
    scene.images.push(Image { name: "stripes".into(), width: 2, height: 3, rgba: pixels, encoded: None });
    let texture = Texture { image: 0, wrap_u: Wrap::ClampToEdge, wrap_v: Wrap::MirroredRepeat, nearest: true };
    scene.textures = vec![texture, Texture { nearest: false, wrap_u: Wrap::Repeat, ..texture }];
    let reference = |texture, uv_set, transform| Some(TextureRef { texture, uv_set, transform });
    scene.materials[0].base_color_texture = reference(0, 0, Affine2::IDENTITY);
    scene.materials[0].emission = vec3(123.4, 0.07, 5.5);
    scene.materials[0].emission_texture = reference(1, 2, Affine2::from_translation(vec2(0.3, -0.7)));
    scene.materials[0].double_sided = true;
    scene.materials.push(Material {
        name: "second".into(),
        normal_texture: reference(1, 0, Affine2::from_scale(vec2(3.3, -0.1))),
        normal_scale: 0.3,
        alpha: AlphaMode::Mask { cutoff: 0.3 },
        emission: vec3(0.3, 0.2, 0.1),
        metallic: 0.1,
        roughness: 0.7,
        ..Material::default()
    });
    scene.materials.push(Material { name: "third".into(), alpha: AlphaMode::Blend, ..Material::default() });
    let light = |name: &str, kind| Light {
        name: name.into(),
        kind,
        position: vec3(0.1, 0.2, 0.3),
        direction: vec3(0.3, -0.5, 0.7).normalize(),
        color: vec3(1.0, 0.9, 0.8),
        intensity: 12.3,
        range: Some(4.5),
    };
    scene.lights = vec![
        light("spot", LightKind::Spot { inner_cone: 0.1, outer_cone: 0.4 }),
        Light { range: None, ..light("sun", LightKind::Directional) },
        Light { direction: Vec3::NEG_Z, ..light("bulb", LightKind::Point) },
    ];
    scene.cameras = vec![
        Camera {
            name: "eye".into(),
            to_world: Mat4::from_rotation_translation(
                glam::Quat::from_rotation_y(0.4) * glam::Quat::from_rotation_x(-0.3),
                vec3(1.0, 2.0, 3.0),
            ),
            fov_y: 0.7,
            aspect: Some(1.5),
        },
        Camera { name: "other".into(), to_world: Mat4::IDENTITY, fov_y: 1.0, aspect: None },
    ];
    scene
}

#[test]
fn no_accessor_is_without_data() {
    // Common readers refuse what glTF has for zeros.
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.glb");
    export_glb(&everything(), &path).expect("written");
    let bytes = std::fs::read(&path).expect("readable");
    let length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let root: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
    let accessors = root["accessors"].as_array().expect("accessors");
    assert!(accessors.iter().all(|accessor| accessor.get("bufferView").or(accessor.get("sparse")).is_some()));
    assert!(accessors.iter().any(|accessor| accessor.get("sparse").is_some()), "sets 0 and 1 of a mesh are absent");
}

#[test]
fn everything_survives_a_round_trip() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (first, second) = (folder.path().join("first.glb"), folder.path().join("second.glb"));
    let mut scene = everything();
    export_glb(&scene, &first).expect("writable folder");
    let again = load(&first).expect("what was written can be read");
    // The export encoded the image; from now on it keeps those bytes.
    scene.images[0].encoded = again.images[0].encoded.clone();
    assert_same(&scene, &again);
    assert_eq!(again.dropped, Default::default());
    export_glb(&again, &second).expect("writable folder");
    assert_same(&again, &load(&second).expect("what was written can be read"));
}

#[test]
fn the_same_scene_gives_the_same_bytes_and_replaces_the_old_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, "old").expect("writable folder");
    export_glb(&everything(), &path).expect("writable folder");
    let bytes = std::fs::read(&path).expect("the new file");
    export_glb(&everything(), &path).expect("writable folder");
    assert_eq!(bytes, std::fs::read(&path).expect("the new file"));
    let names: Vec<_> = std::fs::read_dir(folder.path()).expect("readable folder").collect();
    assert_eq!(names.len(), 1, "no temporary file is left");
    if let Some(copy) = std::env::var_os("LOCALPRT_KEEP_EXPORT") {
        std::fs::copy(&path, copy).expect("a place for the copy");
    }
}

#[test]
fn texture_transforms_of_any_angle_are_read_back_exactly() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.glb");
    let mut scene = everything();
    // Angles over a full turn and scales of both signs, as an importer would have read them.
    for step in 0..200 {
        let rotation = -3.1 + 0.031 * step as f32;
        let scale = vec2(0.1 + 0.37 * step as f32, if step % 3 == 0 { -1.7 } else { 0.9 });
        let (sin, cos) = f64::from(rotation).sin_cos();
        let column = |a: f64, b: f64| vec2(a as f32, b as f32);
        let (x, y) = (f64::from(scale.x), f64::from(scale.y));
        let matrix = glam::Mat2::from_cols(column(cos * x, -sin * x), column(sin * y, cos * y));
        let transform = Affine2::from_mat2_translation(matrix, vec2(0.1, 0.01 * step as f32));
        let reference = TextureRef { texture: 0, uv_set: 0, transform };
        scene.materials.push(Material {
            name: format!("turned {step}"),
            base_color_texture: Some(reference),
            ..Material::default()
        });
    }
    export_glb(&scene, &path).expect("writable folder");
    let again = load(&path).expect("what was written can be read");
    for (a, b) in scene.materials.iter().zip(&again.materials) {
        assert!(common::same_material(a, b), "{a:?} became {b:?}");
    }
}

#[test]
fn an_empty_scene_and_an_unwritable_place() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("empty.glb");
    export_glb(&Scene::default(), &path).expect("writable folder");
    assert_eq!(load(&path).expect("what was written can be read").face_count(), 0);
    let nowhere = folder.path().join("absent/scene.glb");
    let error = export_glb(&Scene::default(), &nowhere).expect_err("no such folder");
    assert!(matches!(error, ExportError::Write { .. }), "{error}");
    assert!(error.to_string().contains("absent"), "{error}");
}

#[test]
fn comparing_scenes_notices_a_change() {
    let scene = everything();
    let mut changed = scene.clone();
    changed.meshes[1].positions[2].x += 1e-6;
    let result = std::panic::catch_unwind(|| assert_same(&scene, &changed));
    assert!(result.is_err(), "the comparison must be able to fail");
}
