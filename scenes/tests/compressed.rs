//! Files packed as the web packs them: what they hold is what was packed. `compressed/README.md` says how they were made.
#![cfg(feature = "compressed")]

mod common;

use common::glb;
use glam::Vec3;
use localprt_scenes::{Limits, LoadErrorKind, Scene, builtin, load, load_bytes, load_bytes_within, load_within};
use serde_json::{Value, json};
use std::path::PathBuf;

fn path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "compressed", name].iter().collect()
}

fn loaded(name: &str) -> Scene {
    load(path(name)).unwrap_or_else(|error| panic!("{error}; {}", error.help))
}

/// Corners of all triangles of each mesh by its name, in an order of their own.
fn corners(scene: &Scene) -> Vec<(String, Vec<[Vec3; 3]>)> {
    let of_mesh = |mesh: &localprt_scenes::Mesh| {
        let mut triangles: Vec<[Vec3; 3]> = mesh
            .triangles
            .iter()
            .map(|triangle| {
                let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                // The least corner first: encoders turn triangles.
                let first = (0..3).min_by_key(|&at| order(corners[at])).expect("three");
                [0, 1, 2].map(|at| corners[(first + at) % 3])
            })
            .collect();
        triangles.sort_by_key(|corners| corners.map(order));
        (mesh.name.clone(), triangles)
    };
    let mut meshes: Vec<_> = scene.meshes.iter().map(of_mesh).collect();
    meshes.sort_by(|a, b| a.0.cmp(&b.0));
    meshes
}

/// By centimetres, which quantization leaves alone.
fn order(point: Vec3) -> [i32; 3] {
    (point * 100.0).round().to_array().map(|value| value as i32)
}

#[test]
fn meshes_are_those_that_were_packed() {
    let plain = corners(&builtin::scene("cornell").expect("a scene"));
    // 14 bits of a box of up to 2 m: half a step is 0.061 mm along each axis, and 0.106 mm along all three.
    for name in ["cornell-draco.glb", "cornell-meshopt.glb"] {
        let packed = loaded(name);
        let found = corners(&packed);
        assert_eq!(found.len(), plain.len(), "{name}");
        for ((own, expected), (other, triangles)) in plain.iter().zip(&found) {
            assert_eq!((own, expected.len()), (other, triangles.len()), "{name}");
            for (a, b) in expected.iter().flatten().zip(triangles.iter().flatten()) {
                assert!(a.distance(*b) < 1.1e-4, "{name}, {own}: {a} {b}");
            }
        }
        // Normals too: what is flat stays flat. 8 bits of octahedral coordinates and of components are off by 0.04 at most, as in the tests
        // of the filter: a cosine of 0.9992.
        for mesh in &packed.meshes {
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
                let flat = (b - a).cross(c - a).normalize();
                for vertex in triangle {
                    assert!(mesh.normals[*vertex as usize].dot(flat) > 0.999, "{name}, {}", mesh.name);
                }
            }
        }
        assert_eq!(packed.lights.len(), 1);
    }
}

#[test]
fn pictures_are_those_that_were_packed() {
    let gradient =
        (0..32u8).flat_map(|y| (0..32u8).flat_map(move |x| [8 * x, 8 * y, 128, if x < 16 { 255 } else { 127 }]));
    let of_reference = |name: &str| std::fs::read(path(name)).expect("a file");
    for (name, expected) in [
        ("picture-webp.glb", gradient.collect()),
        ("picture-uastc.glb", of_reference("picture-uastc.rgba")),
        ("picture-etc1s.glb", of_reference("picture-etc1s.rgba")),
    ] {
        let scene = loaded(name);
        let image = &scene.images[scene.textures[0].image];
        assert_eq!([image.width, image.height], [32, 32], "{name}");
        assert!(image.rgba == expected, "{name}: other pixels");
        // Written anew as a format that every reader has.
        assert!(image.encoded.is_none());
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("plain.glb");
        localprt_scenes::export_glb(&scene, &out).expect("writes");
        let again = load(&out).expect("reads");
        assert_eq!(again.images[0].rgba, image.rgba, "{name}");
    }
}

/// A .glb as JSON and bytes.
fn parts(bytes: &[u8]) -> (Value, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
    let json = serde_json::from_slice(&bytes[20..20 + word(12)]).expect("JSON");
    let bin = 20 + word(12);
    (json, bytes[bin + 8..bin + 8 + word(bin)].to_vec())
}

#[test]
fn damage_is_refused_or_loads() {
    for name in
        ["cornell-draco.glb", "cornell-meshopt.glb", "picture-webp.glb", "picture-etc1s.glb", "picture-uastc.glb"]
    {
        let bytes = std::fs::read(path(name)).expect("a file");
        let (json, bin) = parts(&bytes);
        let mut refused = 0;
        // Every byte of what is compressed, for a start one bit, then all, then only those before it.
        for at in 0..bin.len() {
            for change in [1, 0xff] {
                let mut damaged = bin.clone();
                damaged[at] ^= change;
                refused += usize::from(load_bytes(name, &glb(&json, &damaged)).is_err());
            }
        }
        assert!(refused > 0, "{name}");
        for at in (0..bin.len()).step_by(37) {
            let mut cut = bin.clone();
            cut[at..].fill(0);
            let _ = load_bytes(name, &glb(&json, &cut));
        }
    }
}

#[test]
fn fields_that_contradict_their_data_are_refused() {
    let refused = |name: &str, change: &dyn Fn(&mut Value)| {
        let (mut json, bin) = parts(&std::fs::read(path(name)).expect("a file"));
        change(&mut json);
        let error = load_bytes(name, &glb(&json, &bin)).expect_err(name);
        assert_eq!(error.kind, LoadErrorKind::Invalid, "{error}");
        error.to_string()
    };
    let view = "/bufferViews/0/extensions/EXT_meshopt_compression";
    for (field, value) in [
        ("buffer", json!(7)),
        ("byteOffset", json!(1u64 << 60)),
        ("byteLength", json!(u64::MAX)),
        ("byteStride", json!(3)),
        ("count", json!(1u64 << 62)),
        ("mode", json!("STRIPS")),
        ("filter", json!("OCTAHEDRAL")),
    ] {
        let error =
            refused("cornell-meshopt.glb", &|json| json.pointer_mut(view).expect("a view")[field] = value.clone());
        assert!(error.contains(view), "{field}: {error}");
    }
    let stream = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (field, value) in [("bufferView", json!(99)), ("attributes", json!({"POSITION": 77})), ("attributes", json!(3))]
    {
        refused("cornell-draco.glb", &|json| json.pointer_mut(stream).expect("a stream")[field] = value.clone());
    }
    let error = refused("cornell-draco.glb", &|json| json["accessors"][0]["count"] = json!(5));
    assert!(error.contains("in the stream, but its accessor has count 5"), "{error}");
    refused("picture-webp.glb", &|json| json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = json!(4));
}

#[test]
fn what_is_unpacked_is_held_to_the_limits() {
    for name in ["cornell-draco.glb", "cornell-meshopt.glb"] {
        let error = load_within(path(name), &Limits { buffer_bytes: 1000, ..Limits::default() }).expect_err(name);
        assert!(error.found.contains("the limit is 1000") || error.found.contains("limit"), "{error}");
    }
    for name in ["picture-webp.glb", "picture-uastc.glb"] {
        let error = load_within(path(name), &Limits { image_pixels: 1000, ..Limits::default() }).expect_err(name);
        assert!(error.found.contains("the limit is 1000"), "{error}");
    }
}

/// A square, drawn four times.
fn instances() -> (Value, Vec<u8>) {
    let (mut json, mut bin) = common::square();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let start = bin.len();
    bin.extend(common::floats(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0]));
    bin.extend(common::floats(&[1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0]));
    // Quarter turns about Z as words of 32767.
    for [x, y, z, w] in [[0, 0, 0, 32767i16], [0, 0, 23170, 23170], [0, 0, 0, 32767], [0, 0, 0, 32767]] {
        bin.extend([x, y, z, w].into_iter().flat_map(i16::to_le_bytes));
    }
    let (views, accessors) =
        (json["bufferViews"].as_array().expect("views").len(), json["accessors"].as_array().expect("accessors").len());
    for (offset, length) in [(0, 48), (48, 48), (96, 32)] {
        json["bufferViews"]
            .as_array_mut()
            .expect("views")
            .push(json!({"buffer": 0, "byteOffset": start + offset, "byteLength": length}));
    }
    for (view, component, shape) in [(0, 5126, "VEC3"), (1, 5126, "VEC3"), (2, 5122, "VEC4")] {
        let accessor = json!({"bufferView": views + view, "componentType": component, "count": 4, "type": shape, "normalized": component == 5122});
        json["accessors"].as_array_mut().expect("accessors").push(accessor);
    }
    json["buffers"][0]["byteLength"] = json!(bin.len());
    json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": accessors, "SCALE": accessors + 1, "ROTATION": accessors + 2, "_COLOR": 0,
    }}});
    json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    // What others call their own counts as well.
    json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
        .as_object_mut()
        .expect("attributes")
        .remove("_COLOR");
    (json, bin)
}

#[test]
fn instances_are_meshes_of_their_own() {
    let (json, bin) = instances();
    let scene = load_bytes("trees.glb", &glb(&json, &bin)).expect("loads");
    let one = {
        let mut json = json.clone();
        json["nodes"][0].as_object_mut().expect("a node").remove("extensions");
        load_bytes("tree.glb", &glb(&json, &bin)).expect("loads")
    };
    assert_eq!(scene.meshes.len(), 4 * one.meshes.len());
    let turned = |point: Vec3, copy: usize| match copy {
        0 => point,
        1 => Vec3::new(-point.y, point.x, point.z) * 2.0 + Vec3::X * 3.0,
        2 => point + Vec3::Y * 3.0,
        _ => point * Vec3::new(-1.0, 1.0, 1.0) + Vec3::Z * 3.0,
    };
    for (copy, mesh) in scene.meshes.iter().enumerate() {
        for (found, own) in mesh.positions.iter().zip(&one.meshes[0].positions) {
            // Words of 16 bits: 2^-15 of 2 m.
            assert!(found.distance(turned(*own, copy)) < 1e-4, "{copy}: {found}");
        }
    }
    // The mirrored one shows its front where the others do.
    let front = |scene: &Scene, mesh: usize| {
        let [a, b, c] = scene.corners(mesh, 0);
        (b - a).cross(c - a).normalize()
    };
    assert!(front(&scene, 3).distance(front(&one, 0)) < 1e-5);

    let error = load_bytes_within("trees.glb", &glb(&json, &bin), &Limits { instances: 3, ..Limits::default() });
    assert!(error.expect_err("too many").to_string().contains("4 instances, the limit is 3"));
    let mut none = json.clone();
    none["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({});
    assert!(load_bytes("trees.glb", &glb(&none, &bin)).expect_err("none").to_string().contains("without an attribute"));
    let mut uneven = json.clone();
    let first = uneven["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"]
        .as_u64()
        .expect("a number");
    uneven["accessors"][first as usize]["count"] = json!(3);
    assert!(load_bytes("trees.glb", &glb(&uneven, &bin)).expect_err("uneven").to_string().contains("different counts"));
}

#[test]
fn variants_and_transmission_come_through_a_bakes_file() {
    let (mut json, bin) = common::square();
    json["materials"] = json!([
        {"name": "beach"},
        {"name": "midnight", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.75}}},
    ]);
    json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    json["extensionsUsed"] = json!(["KHR_materials_variants", "KHR_materials_transmission"]);
    json["meshes"][0]["primitives"][0]["material"] = json!(0);
    json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": 0, "variants": [0]}, {"material": 1, "variants": [1]},
    ]}});
    let scene = load_bytes("shoe.glb", &glb(&json, &bin)).expect("loads");
    assert_eq!(
        (scene.variants.as_slice(), &scene.meshes[0].variants),
        (&["day".to_owned(), "night".into()][..], &vec![[0, 0], [1, 1]])
    );
    assert_eq!([0, 1].map(|material: usize| scene.materials[material].transmission), [0.0, 0.75]);
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("shoe.glb");
    localprt_scenes::export_glb(&scene, &out).expect("writes");
    let mut again = load(&out).expect("reads");
    assert_eq!((&again.variants, &again.meshes[0].variants), (&scene.variants, &scene.meshes[0].variants));
    assert_eq!(again.materials[1].transmission, 0.75);
    again.apply_variant("night").expect("a variant");
    assert_eq!(again.materials[again.meshes[0].material].name, "midnight");
    json["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"][0]["variants"][0] = json!(2);
    assert!(load_bytes("shoe.glb", &glb(&json, &bin)).is_err());
}
