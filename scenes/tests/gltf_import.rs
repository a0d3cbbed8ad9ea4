//! What the importer makes of small files: geometry, materials, and the doors that stay shut.

mod common;

use common::{SQUARE, floats, glb, shorts, square};
use glam::{Vec2, Vec3, vec2, vec3};
use localprt_scenes::{LightKind, LoadError, LoadErrorKind, Mesh, Scene, load};
use serde_json::{Value, json};
use std::f32::consts::FRAC_PI_2;
use std::path::Path;
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().expect("temporary folder")
}

fn load_bytes(bytes: &[u8]) -> Result<Scene, LoadError> {
    let folder = folder();
    let path = folder.path().join("scene.bin");
    std::fs::write(&path, bytes).expect("writable folder");
    load(path)
}

fn load_glb(root: &Value, bin: &[u8]) -> Result<Scene, LoadError> {
    load_bytes(&glb(root, bin))
}

/// The error of a scene that must be refused as invalid at this place.
#[track_caller]
fn assert_invalid(result: Result<Scene, LoadError>, place: &str) {
    let error = result.expect_err("the scene must be refused");
    assert_eq!(error.kind, LoadErrorKind::Invalid, "{error}");
    assert!(error.to_string().contains(&format!("at {place}:")), "{error} does not name {place}");
}

fn area(mesh: &Mesh) -> f32 {
    let corners = mesh.triangles.iter().map(|triangle| triangle.map(|vertex| mesh.positions[vertex as usize]));
    corners.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
}

#[test]
fn a_plain_square_is_read_as_stored() {
    let (root, bin) = square();
    let scene = load_glb(&root, &bin).expect("a sound file");
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, SQUARE.chunks(3).map(Vec3::from_slice).collect::<Vec<_>>());
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!(mesh.uv_sets, [[Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO]]);
    assert_eq!(mesh.source, "/meshes/0/primitives/0");
    assert_eq!(scene.materials[0].name, "paint");
    assert_eq!(scene.hash, *blake3::hash(&glb(&root, &bin)).as_bytes());
}

#[test]
fn mirrored_nodes_keep_the_front_in_front() {
    let (mut root, bin) = square();
    root["nodes"][0]["scale"] = json!([-2.0, 3.0, 1.0]);
    let scene = load_glb(&root, &bin).expect("a sound file");
    for triangle in 0..2 {
        assert_eq!(scene.geometric_normal(0, triangle), Vec3::Z);
    }
    assert_eq!(scene.meshes[0].normals, [Vec3::Z; 4]);
    assert_eq!(scene.bounds(), Some((vec3(-2.0, 0.0, 0.0), vec3(0.0, 3.0, 0.0))));
}

#[test]
fn normals_follow_the_inverse_transpose_and_tangents_the_matrix() {
    let (mut root, mut bin) = square();
    let slanted = vec3(1.0, 0.0, 1.0).normalize();
    bin.splice(60..108, floats(&slanted.to_array().repeat(4)));
    bin.extend(floats(&[1.0, 0.0, -1.0, 1.0].repeat(4)));
    root["bufferViews"]
        .as_array_mut()
        .expect("an array")
        .push(json!({"buffer": 0, "byteOffset": 140, "byteLength": 64}));
    root["buffers"][0]["byteLength"] = json!(204);
    let accessors = root["accessors"].as_array_mut().expect("an array");
    accessors.push(json!({"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC4"}));
    root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(4);
    root["nodes"][0]["scale"] = json!([2.0, 1.0, -1.0]);
    let scene = load_glb(&root, &bin).expect("a sound file");
    // (1, 0, 1) over (2, 1, -1), and (1, 0, -1) times (2, 1, -1); one rounding to f32 each.
    let normal = vec3(0.5, 0.0, -1.0).normalize();
    assert!(scene.meshes[0].normals.iter().all(|each| each.abs_diff_eq(normal, 1e-6)));
    let tangent = vec3(2.0, 0.0, 1.0).normalize();
    for each in &scene.meshes[0].tangents {
        assert!(each.truncate().abs_diff_eq(tangent, 1e-6), "{each}");
        assert_eq!(each.w, -1.0, "mirroring changes the handedness");
    }
}

#[test]
fn missing_normals_are_flat_and_bad_ones_geometric() {
    let (mut root, mut bin) = square();
    let attributes = root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("an object");
    attributes.remove("NORMAL");
    let flat = load_glb(&root, &bin).expect("a sound file");
    assert_eq!(flat.meshes[0].positions.len(), 6, "flat triangles share no vertex");
    assert_eq!(flat.meshes[0].normals, [Vec3::Z; 6]);

    let (root, _) = square();
    bin.splice(60..108, floats(&[f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 1.0]));
    let repaired = load_glb(&root, &bin).expect("bad normals are replaced");
    assert_eq!(repaired.meshes[0].normals, [Vec3::Z; 4]);
}

#[test]
fn strips_and_fans_wind_alike() {
    // Four vertices in strip order, then in fan order, both without indices.
    for (mode, order) in [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let (mut root, mut bin) = square();
        let corners: Vec<f32> = order.iter().flat_map(|&at| SQUARE[3 * at..3 * at + 3].to_vec()).collect();
        bin.splice(0..48, floats(&corners));
        root["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        let scene = load_glb(&root, &bin).expect("a sound file");
        assert_eq!(scene.face_count(), 2);
        assert_eq!(area(&scene.meshes[0]), 1.0);
        assert_eq!([0, 1].map(|triangle| scene.geometric_normal(0, triangle)), [Vec3::Z; 2]);
    }
}

#[test]
fn points_and_lines_are_ignored_and_odd_counts_refused() {
    for mode in 0..4 {
        let (mut root, bin) = square();
        root["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        assert_eq!(load_glb(&root, &bin).expect("a sound file").face_count(), 0);
    }
    let (mut root, bin) = square();
    root["accessors"][1]["count"] = json!(5);
    assert_invalid(load_glb(&root, &bin), "/meshes/0/primitives/0");
}

#[test]
fn quantized_positions_are_scaled() {
    let (mut root, mut bin) = square();
    let corner = |value: i16| value as u16;
    let values = [[0, 0, 0, 0], [32767, 0, 0, 0], [32767, 32767, 0, 0], [-32768, 32767, 0, 0]].concat();
    bin.splice(0..48, shorts(&values.iter().map(|&value| corner(value)).collect::<Vec<_>>()));
    bin.resize(124, 0);
    let shifted = |offset: u64| json!(offset - 16);
    root["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    root["accessors"][0] =
        json!({"bufferView": 0, "componentType": 5122, "normalized": true, "count": 4, "type": "VEC3"});
    root["bufferViews"][0] = json!({"buffer": 0, "byteLength": 32, "byteStride": 8});
    for (view, offset) in [(1, 48), (2, 60), (3, 108)] {
        root["bufferViews"][view]["byteOffset"] = shifted(offset);
    }
    root["buffers"][0]["byteLength"] = json!(124);
    let scene = load_glb(&root, &bin).expect("a sound file");
    // -32768 is clamped to -1 (section 3.11).
    let expected = [Vec3::ZERO, Vec3::X, vec3(1.0, 1.0, 0.0), vec3(-1.0, 1.0, 0.0)];
    assert_eq!(scene.meshes[0].positions, expected);
}

#[test]
fn sparse_values_replace_stored_ones() {
    let (mut root, mut bin) = square();
    bin.extend(shorts(&[2, 0]));
    bin.extend(floats(&[5.0, 6.0, 0.0]));
    let views = root["bufferViews"].as_array_mut().expect("an array");
    views.push(json!({"buffer": 0, "byteOffset": 140, "byteLength": 2}));
    views.push(json!({"buffer": 0, "byteOffset": 144, "byteLength": 12}));
    root["buffers"][0]["byteLength"] = json!(156);
    let sparse = json!({
        "count": 1, "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5},
    });
    root["accessors"][0]["sparse"] = sparse;
    let scene = load_glb(&root, &bin).expect("a sound file");
    assert_eq!(scene.meshes[0].positions[2], vec3(5.0, 6.0, 0.0));
    assert_eq!(scene.meshes[0].positions[1], Vec3::X);

    bin[140] = 4;
    assert_invalid(load_glb(&root, &bin), "/accessors/0/sparse/indices");
}

#[test]
fn counts_offsets_and_strides_are_checked() {
    let huge = u64::MAX;
    for (pointer, value, place) in [
        ("/accessors/0/count", json!(huge), "/accessors/0"),
        ("/accessors/0/count", json!(0), "/accessors/0"),
        ("/accessors/0/count", json!(5), "/accessors/0"),
        ("/accessors/2/count", json!(3), "/accessors/2"),
        ("/accessors/0/byteOffset", json!(huge - 3), "/accessors/0"),
        ("/accessors/0/byteOffset", json!(2), "/accessors/0"),
        ("/accessors/0/componentType", json!(5123 + (1u64 << 32)), "/accessors/0/componentType"),
        ("/accessors/0/componentType", json!(5125), "/accessors/0"),
        ("/accessors/0/type", json!("VEC2"), "/accessors/0"),
        ("/accessors/1/componentType", json!(5122), "/accessors/1"),
        ("/accessors/1/bufferView", json!(1u64 << 32), "/accessors/1/bufferView"),
        ("/bufferViews/0/byteOffset", json!(huge), "/bufferViews/0"),
        ("/bufferViews/0/byteLength", json!(huge), "/bufferViews/0"),
        ("/bufferViews/0/byteStride", json!(8), "/accessors/0"),
        ("/bufferViews/0/byteStride", json!(3), "/bufferViews/0"),
        ("/bufferViews/0/byteStride", json!(256), "/bufferViews/0"),
        ("/buffers/0/byteLength", json!(huge), "/buffers/0"),
        ("/buffers/0/byteLength", json!(1000), "/buffers/0"),
        ("/nodes/0/mesh", json!(1), "/nodes/0/mesh"),
        ("/scene", json!(7), "/scene"),
        ("/nodes/0/scale", json!([1e39, 1, 1]), "/nodes/0/scale"),
        ("/nodes/0/scale", json!([3e38, 1, 1]), ""),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "/nodes/0/rotation"),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([2, 0, 0, 1]), "/materials/0"),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(9), "/meshes/0/primitives/0/attributes/TEXCOORD_0"),
    ] {
        let (mut root, bin) = square();
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        root.pointer_mut(parent).expect("a place")[key] = value;
        match place {
            "" => assert!(load_glb(&root, &bin).is_ok(), "{pointer}: large, but finite"),
            place => assert_invalid(load_glb(&root, &bin), place),
        }
    }
}

/// The typed model reads an array as the fields of an object, in their order: indices among them would be out of sight.
#[test]
fn an_array_in_the_place_of_an_object_is_refused() {
    let (root, bin) = square();
    for (place, array) in [("/bufferViews/0", json!([7, 48])), ("/nodes/0/extensions/KHR_lights_punctual", json!([7]))]
    {
        let mut damaged = root.clone();
        damaged["nodes"][0]["extensions"]["KHR_lights_punctual"] = json!({});
        *damaged.pointer_mut(place).expect("a place of the file") = array;
        assert_invalid(load_glb(&damaged, &bin), place);
    }
    let mut damaged = root.clone();
    let indices = json!({"bufferView": 1, "componentType": 5123});
    damaged["accessors"][0]["sparse"] = json!({"count": 1, "indices": indices, "values": [5125]});
    assert_invalid(load_glb(&damaged, &bin), "/accessors/0/sparse/values");
}

#[test]
fn positions_stored_nowhere_are_refused() {
    let (mut root, bin) = square();
    root["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert_invalid(load_glb(&root, &bin), "/accessors/0");
    root["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    // Without the decoder it is another error.
    let error = load_glb(&root, &bin).expect_err("no stream");
    assert!(error.help.contains("gltf-transform"), "{error}");
}

#[test]
fn cycles_shared_children_and_deep_chains_are_refused() {
    let (mut root, bin) = square();
    root["nodes"] = json!([{"mesh": 0}, {"children": [2]}, {"children": [1]}]);
    assert_invalid(load_glb(&root, &bin), "/nodes/1");
    root["nodes"] = json!([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}]);
    assert_invalid(load_glb(&root, &bin), "/nodes/1/children/0");
    let chain = |length: usize| -> Value {
        let link = |next: usize| if next < length { json!({"children": [next]}) } else { json!({"mesh": 0}) };
        (1..=length).map(link).collect()
    };
    root["nodes"] = chain(1000);
    assert_eq!(load_glb(&root, &bin).expect("not too deep").face_count(), 2);
    root["nodes"] = chain(100_000);
    assert_invalid(load_glb(&root, &bin), "/nodes/1001");
}

#[test]
fn without_a_default_scene_the_first_or_all_roots_are_read() {
    let (mut root, bin) = square();
    root["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]);
    root["scenes"] = json!([{"nodes": [1]}, {"nodes": [0]}]);
    root.as_object_mut().expect("an object").remove("scene");
    let first = load_glb(&root, &bin).expect("a sound file");
    assert_eq!(first.bounds().map(|(low, _)| low.x), Some(5.0));
    root.as_object_mut().expect("an object").remove("scenes");
    assert_eq!(load_glb(&root, &bin).expect("a sound file").face_count(), 4);
}

/// A .gltf beside the given folder's files whose buffer has this address.
fn load_with_buffer(folder: &Path, uri: &str) -> Result<Scene, LoadError> {
    let (mut root, _) = square();
    root["buffers"][0]["uri"] = json!(uri);
    let path = folder.join("scene.gltf");
    std::fs::write(&path, root.to_string()).expect("writable folder");
    load(path)
}

#[test]
fn only_regular_files_in_the_scenes_folder_are_read() {
    let outer = folder();
    let inner = outer.path().join("scene with space");
    std::fs::create_dir_all(inner.join("sub")).expect("writable folder");
    let (_, bin) = square();
    std::fs::write(outer.path().join("secret.bin"), &bin).expect("writable folder");
    std::fs::write(inner.join("a b%.bin"), &bin).expect("writable folder");
    std::fs::write(inner.join("sub/c.bin"), &bin).expect("writable folder");
    for sound in ["a%20b%25.bin", "sub/c.bin", "./sub//c.bin"] {
        assert_eq!(load_with_buffer(&inner, sound).expect("a sound address").face_count(), 2);
    }
    let absolute = outer.path().join("secret.bin").display().to_string();
    for refused in [
        "../secret.bin",
        "sub/../sub/c.bin",
        "%2e%2e/secret.bin",
        "..%2fsecret.bin",
        &absolute,
        &format!("file://{absolute}"),
        "file:///dev/zero",
        "http://localhost/c.bin",
        "sub",
        "sub/",
        "",
        ".",
        "%ff.bin",
        "a%00.bin",
        "sub\\c.bin",
        "absent.bin",
        "data:application/octet-stream;base64",
        "data:application/octet-stream;base64,!!!!",
        "data:,AAAA",
    ] {
        assert_invalid(load_with_buffer(&inner, refused), "/buffers/0/uri");
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_and_pipes_are_refused() {
    let outer = folder();
    let inner = outer.path().join("scene");
    std::fs::create_dir(&inner).expect("writable folder");
    let (_, bin) = square();
    std::fs::write(outer.path().join("secret.bin"), &bin).expect("writable folder");
    std::fs::write(inner.join("own.bin"), &bin).expect("writable folder");
    let link = |target: &str, name: &str| std::os::unix::fs::symlink(target, inner.join(name)).expect("a link");
    link("own.bin", "inside.bin");
    link("../secret.bin", "outside.bin");
    link("/dev/zero", "device.bin");
    link("..", "up");
    link("loop.bin", "loop.bin");
    assert!(load_with_buffer(&inner, "inside.bin").is_ok());
    for refused in ["outside.bin", "device.bin", "up/secret.bin", "loop.bin"] {
        assert_invalid(load_with_buffer(&inner, refused), "/buffers/0/uri");
    }
    let pipe = inner.join("pipe.bin");
    if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success()) {
        assert_invalid(load_with_buffer(&inner, "pipe.bin"), "/buffers/0/uri");
        assert_eq!(load(&pipe).expect_err("a pipe is no scene").kind, LoadErrorKind::Invalid);
    }
    assert_eq!(load("/dev/zero").expect_err("a device is no scene").kind, LoadErrorKind::Invalid);
    assert_eq!(load(inner.join("none.glb")).expect_err("no such file").kind, LoadErrorKind::Io);
}

#[test]
fn texture_transform_has_its_closed_form() {
    let (mut root, bin) = square();
    root["images"] = json!([{"uri": pixel()}]);
    root["textures"] = json!([{"source": 0}]);
    root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({
        "index": 0,
        "texCoord": 0,
        "extensions": {"KHR_texture_transform": {
            "offset": [0.25, 0.5], "rotation": FRAC_PI_2, "scale": [2.0, 4.0], "texCoord": 1,
        }},
    });
    let scene = load_glb(&root, &bin).expect("a sound file");
    let texture = scene.materials[0].base_color_texture.expect("a texture");
    assert_eq!(texture.uv_set, 1);
    // A quarter turn counter-clockwise on an image whose v points down takes v to u and u to -v, after the scale.
    // Tolerance: the angle is pi / 2 to 4.4e-8, times 4.
    let moved = texture.transform.transform_point2(vec2(0.5, 0.75));
    assert!(moved.abs_diff_eq(vec2(0.25 + 3.0, 0.5 - 1.0), 1e-6), "{moved}");
}

/// A data URI of a PNG of one pixel.
fn pixel() -> String {
    use base64::Engine;
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    image::ImageEncoder::write_image(encoder, &[10, 20, 30, 255], 1, 1, image::ExtendedColorType::Rgba8)
        .expect("a pixel can be encoded");
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

#[test]
fn images_are_decoded_and_bad_ones_named() {
    let (mut root, bin) = square();
    root["images"] = json!([{"name": "dot", "uri": pixel()}, {"name": "unused", "uri": "absent.png"}]);
    root["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    root["textures"] = json!([{"source": 1}, {"source": 0, "sampler": 0}]);
    root["materials"][0]["emissiveTexture"] = json!({"index": 1});
    let scene = load_glb(&root, &bin).expect("a sound file");
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 1), "what no material uses is not read");
    assert_eq!(scene.images[0].rgba, [10, 20, 30, 255]);
    assert!(scene.textures[0].nearest);

    root["images"][0] = json!({"name": "broken", "uri": "data:image/png;base64,iVBORw0KGgoAAAA="});
    let error = load_glb(&root, &bin).expect_err("a broken image");
    assert_eq!(error.kind, LoadErrorKind::Invalid);
    assert!(error.to_string().contains("broken"), "{error}");

    root["textures"][1] = json!({"extensions": {"EXT_texture_avif": {"source": 0}}});
    let error = load_glb(&root, &bin).expect_err("an image of another format");
    assert_eq!(error.kind, LoadErrorKind::Unsupported);
    assert!(error.to_string().contains("EXT_texture_avif"), "{error}");
}

#[test]
fn a_small_file_cannot_ask_for_a_huge_image() {
    use base64::Engine;
    // A PNG header that claims 2^31 - 1 squared pixels.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x06\0\0\0".to_vec();
    png.extend([0; 16]);
    let (mut root, bin) = square();
    let uri = format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png));
    root["images"] = json!([{ "uri": uri }]);
    root["textures"] = json!([{"source": 0}]);
    root["materials"][0]["emissiveTexture"] = json!({"index": 0});
    assert_invalid(load_glb(&root, &bin), "/images/0");
}

#[test]
fn materials_keep_what_a_bake_needs() {
    let (mut root, bin) = square();
    root["materials"] = json!([
        {"name": "paint", "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
         "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}, "KHR_materials_unlit": {}}},
        {},
        {"name": "paint", "alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.1, 0.2, 0.3, 1.0], "glossinessFactor": 0.25}}},
        {"name": "material_1"},
    ]);
    let scene = load_glb(&root, &bin).expect("a sound file");
    let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["paint", "material_1_2", "paint_2", "material_1"]);
    assert_eq!(scene.materials[0].emission, vec3(8.0, 4.0, 0.0));
    assert!(scene.materials[0].double_sided);
    assert_eq!(scene.materials[2].base_color, glam::vec4(0.1, 0.2, 0.3, 1.0));
    assert_eq!((scene.materials[2].metallic, scene.materials[2].roughness), (0.0, 0.75));
}

#[test]
fn lights_and_cameras_are_placed_in_the_world() {
    let (mut root, bin) = square();
    root["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 7, "color": [1, 0.5, 0.25], "range": 9, "spot": {"outerConeAngle": 0.5}},
        {"type": "directional"},
    ]}});
    let light = |index: u32| json!({"KHR_lights_punctual": {"light": index}});
    // Half a turn about x, and a scale that must not change directions.
    root["nodes"] = json!([
        {"scale": [2, 2, 2], "children": [1, 2, 3]},
        {"translation": [1, 2, 3], "rotation": [1, 0, 0, 0], "extensions": light(0)},
        {"extensions": light(1)},
        {"translation": [0, 0, 1], "camera": 0},
    ]);
    root["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.75, "znear": 0.1, "aspectRatio": 2}}]);
    let scene = load_glb(&root, &bin).expect("a sound file");
    let spot = &scene.lights[0];
    assert_eq!(spot.kind, LightKind::Spot { inner_cone: 0.0, outer_cone: 0.5 });
    assert_eq!((spot.position, spot.direction), (vec3(2.0, 4.0, 6.0), Vec3::Z));
    assert_eq!((spot.intensity, spot.range, spot.color), (7.0, Some(9.0), vec3(1.0, 0.5, 0.25)));
    assert_eq!(scene.lights[1].direction, Vec3::NEG_Z);
    let camera = &scene.cameras[0];
    assert_eq!(camera.to_world, glam::Mat4::from_translation(vec3(0.0, 0.0, 2.0)));
    assert_eq!((camera.fov_y, camera.aspect), (0.75, Some(2.0)));
}

#[test]
fn node_extras_say_how_fine_a_lightmap_is() {
    let (mut root, bin) = square();
    let mut wishes = |nodes: Value| {
        root["nodes"] = nodes;
        let scene = load_glb(&root, &bin)?;
        Ok::<_, LoadError>(scene.meshes.iter().map(|mesh| (mesh.lightmap.texel_scale, mesh.lightmap.bake)).collect())
    };
    let found: Vec<(f32, bool)> = wishes(json!([
        {"children": [1, 2, 3], "extras": {"localprt": {"texel_scale": 2.5}, "other": 7}},
        {"mesh": 0},
        {"mesh": 0, "translation": [2, 0, 0], "extras": {"localprt": {"bake": false}}},
        {"mesh": 0, "translation": [4, 0, 0], "extras": {"localprt": {"texel_scale": 0.5, "bake": 1}}},
    ]))
    .expect("a sound file");
    assert_eq!(found, [(2.5, true), (2.5, false), (0.5, true)]);
    assert_eq!(wishes(json!([{"mesh": 0, "extras": "a note"}])).expect("a sound file"), [(1.0, true)]);
    for (wrong, place) in [
        (json!({"texel_scale": 0}), "/nodes/0/extras/localprt/texel_scale"),
        (json!({"texel_scale": "fine"}), "/nodes/0/extras/localprt/texel_scale"),
        (json!({"bake": "no"}), "/nodes/0/extras/localprt/bake"),
        (json!({"texelscale": 2}), "/nodes/0/extras/localprt/texelscale"),
        (json!(2), "/nodes/0/extras/localprt"),
    ] {
        let error = wishes(json!([{"mesh": 0, "extras": {"localprt": wrong}}])).expect_err("refused");
        assert_eq!((error.kind, error.pointer.as_deref()), (LoadErrorKind::Invalid, Some(place)));
    }
}

#[test]
fn a_light_map_is_laid_out_by_a_set_that_all_meshes_have() {
    let (mut root, bin) = square();
    let mut named = |set: Value| {
        root["asset"]["extras"] = json!({"localprt": {"light_map_set": set}});
        load_glb(&root, &bin).map(|scene| scene.light_map_set)
    };
    assert_eq!(named(json!(0)).expect("a sound file"), Some(0));
    for wrong in [json!(2), json!(-1), json!("2")] {
        let error = named(wrong).expect_err("refused");
        let place = "/asset/extras/localprt/light_map_set";
        assert_eq!((error.kind, error.pointer.as_deref()), (LoadErrorKind::Invalid, Some(place)));
    }
}

#[test]
fn unusable_triangles_are_dropped_but_other_sides_stay() {
    let (mut root, mut bin) = square();
    // Twice the same, once turned, once flat, once from behind.
    bin.splice(48..60, shorts(&[0, 1, 2, 1, 2, 0, 0, 1, 1, 0, 2, 1]));
    for (view, offset) in [(2, 72), (3, 120)] {
        root["bufferViews"][view]["byteOffset"] = json!(offset);
    }
    root["bufferViews"][1]["byteLength"] = json!(24);
    root["accessors"][1]["count"] = json!(12);
    root["buffers"][0]["byteLength"] = json!(152);
    let scene = load_glb(&root, &bin).expect("a sound file");
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [0, 2, 1]]);
    assert_eq!((scene.dropped.degenerate, scene.dropped.duplicate), (1, 1));
    root["materials"][0]["doubleSided"] = json!(true);
    let scene = load_glb(&root, &bin).expect("a sound file");
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!((scene.dropped.degenerate, scene.dropped.duplicate), (1, 2));
}

#[test]
fn containers_are_told_apart_by_content() {
    let (root, bin) = square();
    let whole = glb(&root, &bin);
    for length in [0, 3, 4, 11, 12, 19, 20, 100, whole.len() - 1] {
        assert_eq!(load_bytes(&whole[..length]).expect_err("cut off").kind, LoadErrorKind::Invalid, "{length}");
    }
    assert_eq!(load_bytes(b"solid stl").expect_err("not glTF").kind, LoadErrorKind::Invalid);
    let old = br#"{"asset": {"version": "1.0"}}"#;
    assert_eq!(load_bytes(old).expect_err("glTF 1").kind, LoadErrorKind::Unsupported);
    let bomb = "[".repeat(1_000_000);
    assert!(load_bytes(format!("{{\"a\":{bomb}").as_bytes()).is_err());
}

#[test]
fn unknown_required_extensions_are_refused_by_name() {
    for name in ["EXT_texture_avif", "MSFT_texture_dds", "KHR_gaussian_splatting", "ACME_magic"] {
        let (mut root, bin) = square();
        root["extensionsRequired"] = json!([name]);
        let error = load_glb(&root, &bin).expect_err("not read");
        assert_eq!(error.kind, LoadErrorKind::Unsupported);
        assert!(error.to_string().contains(name) && error.help.contains("gltf-transform"), "{error}");
    }
}

#[test]
fn a_scene_in_memory_is_the_scene_in_the_file() {
    let (mut root, bin) = square();
    root["images"] = json!([{ "uri": pixel() }]);
    root["textures"] = json!([{ "source": 0 }]);
    root["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorTexture": { "index": 0 } });
    let bytes = glb(&root, &bin);
    let folder = folder();
    let path = folder.path().join("hall.glb");
    std::fs::write(&path, &bytes).expect("writable folder");
    let from_file = load(&path).expect("a sound file");
    let from_memory = localprt_scenes::load_bytes("hall.glb", &bytes).expect("the same bytes");
    assert_eq!(from_memory.hash, from_file.hash);
    assert_eq!(from_memory.name, "hall");
    assert_eq!(format!("{from_memory:?}"), format!("{from_file:?}"));
}

#[test]
fn a_scene_in_memory_reads_no_files() {
    let (mut root, bin) = square();
    root["images"] = json!([{ "uri": "wood.png" }]);
    root["textures"] = json!([{ "source": 0 }]);
    root["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorTexture": { "index": 0 } });
    let error = localprt_scenes::load_bytes("hall.glb", &glb(&root, &bin)).expect_err("must be refused");
    assert_eq!(error.kind, LoadErrorKind::Invalid);
    let text = error.to_string();
    assert!(text.contains("/images/0/uri") && text.contains("\"wood.png\"") && error.help.contains(".glb"), "{text}");
}

#[test]
fn files_that_a_scene_names_are_listed_be_they_there_or_not() {
    let folder = tempfile::tempdir().expect("folder");
    let at = |name: &str| folder.path().join(name);
    let scene = r#"{"asset": {"version": "2.0"}, "images": [{"uri": "maps/c.png"}],
        "buffers": [{"byteLength": 4, "uri": "a%20b.bin"}, {"byteLength": 1, "uri": "data:;base64,AA=="}]}"#;
    std::fs::write(at("hall.gltf"), scene).expect("written");
    assert_eq!(localprt_scenes::linked_files(at("hall.gltf")), [at("a b.bin"), at("maps/c.png")]);
    assert!(localprt_scenes::linked_files(at("none.gltf")).is_empty());
    let sky = r#"{"sky": {"type": "equirect", "file": "skies/noon.hdr"}}"#;
    std::fs::write(at("noon.json"), sky).expect("written");
    assert_eq!(localprt_scenes::Lighting::sky_image_of(&at("noon.json")), Some(at("skies/noon.hdr")));
}
