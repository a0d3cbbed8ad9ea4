//! Hundreds of damaged files made from good ones: each loads or is refused, without a panic and in little time.

mod common;

use common::{glb, square};
use localprt_scenes::load;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A file may take this long, on a machine that does ten other things at once; most take well under a millisecond.
const PATIENCE: Duration = Duration::from_secs(5);

/// How what to do about a refused file begins; a cause would begin otherwise.
const ACTIONS: &[&str] = &[
    "break", "check", "choose", "convert", "copy", "correct", "decode", "export", "flatten", "give", "make", "name",
    "put", "remove", "save", "scale", "split", "store", "use", "write",
];

/// Good files that use different parts of the importer.
fn good_files() -> Vec<(Value, Vec<u8>)> {
    let (plain, bin) = square();
    let mut hierarchy = plain.clone();
    hierarchy["nodes"] = json!([
        {"children": [1, 2], "scale": [1, -1, 1]},
        {"mesh": 0, "translation": [0, 0, 1], "rotation": [0, 0, 0, 1]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 0, 0, 1], "camera": 0,
         "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    hierarchy["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}]);
    hierarchy["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"innerConeAngle": 0.1}}]}});

    let mut sparse = plain.clone();
    let mut sparse_bin = bin.clone();
    sparse_bin.extend([1, 0, 3, 0]);
    sparse_bin.extend(common::floats(&[1.5, 0.0, 0.0, 0.0, 1.5, 0.0]));
    let views = sparse["bufferViews"].as_array_mut().expect("an array");
    views.push(json!({"buffer": 0, "byteOffset": 140, "byteLength": 4}));
    views.push(json!({"buffer": 0, "byteOffset": 144, "byteLength": 24}));
    sparse["buffers"][0]["byteLength"] = json!(168);
    sparse["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": 4, "componentType": 5123}, "values": {"bufferView": 5},
    });

    let mut textured = plain.clone();
    textured["images"] = json!([{"uri": "picture.png"}, {"bufferView": 3, "mimeType": "image/png"}]);
    textured["textures"] = json!([{"source": 0, "sampler": 0}]);
    textured["samplers"] = json!([{"wrapS": 33071, "magFilter": 9728}]);
    textured["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({
        "index": 0, "extensions": {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1, "scale": [2, 2]}},
    });

    let mut strip = plain.clone();
    strip["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}, "mode": 5});
    vec![(plain, bin.clone()), (hierarchy, bin.clone()), (sparse, sparse_bin), (textured, bin.clone()), (strip, bin)]
}

/// What each number, string and list of a file is replaced by.
fn replacements(value: &Value) -> Vec<Value> {
    match value {
        Value::Number(_) => vec![
            json!(0),
            json!(1),
            json!(-1),
            json!(3),
            json!(255),
            json!(5121),
            json!(5125),
            json!(1u64 << 31),
            json!((1u64 << 32) + 1),
            json!(u64::MAX),
            json!(1e300),
            json!(0.5),
            json!("7"),
            Value::Null,
        ],
        Value::String(_) => vec![
            json!(""),
            json!("../secret"),
            json!("file:///dev/zero"),
            json!("%ff"),
            json!("data:;base64,AAAA"),
            json!("MAT4"),
            json!("SCALAR"),
            json!(7),
        ],
        Value::Array(values) => vec![
            json!([]),
            json!({}),
            json!([0, 0, 0, 0, 0, 0, 0, 0]),
            Value::Array(values.iter().chain(values).cloned().collect()),
            json!([[[[]]]]),
        ],
        Value::Object(_) => vec![json!({}), json!([]), json!("x"), Value::Null],
        Value::Bool(_) | Value::Null => vec![json!(1)],
    }
}

/// JSON pointers of every value in the file.
fn places(value: &Value, place: &str, found: &mut Vec<String>) {
    let children: Vec<(String, &Value)> = match value {
        Value::Array(values) => values.iter().enumerate().map(|(index, value)| (index.to_string(), value)).collect(),
        Value::Object(values) => values.iter().map(|(key, value)| (key.clone(), value)).collect(),
        _ => Vec::new(),
    };
    for (key, child) in children {
        let place = format!("{place}/{key}");
        places(child, &place, found);
        found.push(place);
    }
}

#[test]
fn damaged_files_load_or_are_refused() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut picture = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut picture);
    image::ImageEncoder::write_image(encoder, &[9; 16], 2, 2, image::ExtendedColorType::Rgba8).expect("an image");
    std::fs::write(folder.path().join("picture.png"), picture).expect("writable folder");
    let path = folder.path().join("scene.glb");
    let (mut tried, mut refused) = (0, 0);
    let mut attempt = |bytes: &[u8], what: &str| {
        std::fs::write(&path, bytes).expect("writable folder");
        let started = Instant::now();
        let result = std::panic::catch_unwind(|| load(&path));
        let result = result.unwrap_or_else(|_| panic!("{what}: a panic"));
        assert!(started.elapsed() < PATIENCE, "{what}: took {:?}", started.elapsed());
        tried += 1;
        match result {
            Ok(scene) => {
                let sound = |mesh: &localprt_scenes::Mesh| mesh.is_sound() && mesh.material < scene.materials.len();
                assert!(scene.meshes.iter().all(sound), "{what}: a broken scene");
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().contains("scene.glb"), "{what}: {error} does not name the file");
                let (first, _) = error.help.split_once(' ').expect("some words");
                assert!(ACTIONS.contains(&first), "{what}: {error}: `{}` is nothing to do", error.help);
            }
        }
    };
    for (number, (root, bin)) in good_files().into_iter().enumerate() {
        let whole = glb(&root, &bin);
        attempt(&whole, "a good file");
        let mut found = Vec::new();
        places(&root, "", &mut found);
        for place in &found {
            for replacement in replacements(root.pointer(place).expect("a place of the file")) {
                let mut damaged = root.clone();
                *damaged.pointer_mut(place).expect("a place of the file") = replacement.clone();
                attempt(&glb(&damaged, &bin), &format!("file {number}, {place} = {replacement}"));
            }
            let mut damaged = root.clone();
            let (parent, key) = place.rsplit_once('/').expect("a pointer");
            if let Some(Value::Object(entries)) = damaged.pointer_mut(parent) {
                entries.remove(key);
                attempt(&glb(&damaged, &bin), &format!("file {number} without {place}"));
            }
        }
        // Every byte of the container's frame, and the end cut off.
        for at in (0..24).chain(whole.len() - bin.len() - 8..whole.len() - bin.len()) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x81;
            attempt(&damaged, &format!("file {number}, byte {at} changed"));
        }
        for length in (0..whole.len()).step_by(97) {
            attempt(&whole[..length], &format!("file {number} cut to {length} bytes"));
        }
        // All bits of the binary chunk: numbers that are infinite, indices that are out of range.
        attempt(&glb(&root, &vec![0xff; bin.len()]), &format!("file {number} with ones for data"));
    }
    println!("{tried} files, {refused} refused");
    assert!(tried >= 300, "only {tried} files");
    assert!(refused * 2 > tried, "only {refused} of {tried} refused: is the damage noticed?");
}
