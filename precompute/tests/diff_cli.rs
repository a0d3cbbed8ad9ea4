//! `precompute diff` from outside: files that are the same, that differ, and that are damaged.

use glam::Vec4;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_precompute"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .env("NO_COLOR", "1")
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

#[track_caller]
fn bake(folder: &Path, scene: &str, output: &str, more: &[&str]) {
    let few: &[&str] = if more.contains(&"--receivers") { &[] } else { &["--receivers", "400"] };
    let small = ["--probes", "8", "--relight-rays", "64", "--direct-map", "64", "--no-cache"];
    let rays = ["--probe-degree", "3", "--gather-rays", "16"];
    let baked = run(folder, &[&["bake", scene, "-o", output, "-q"], few, &small[..], &rays, more].concat());
    assert!(baked.status.success(), "{}", text(&baked.stderr));
}

#[track_caller]
fn diff(folder: &Path, expected: i32, arguments: &[&str]) -> (String, String) {
    let output = run(folder, &[&["diff"], arguments].concat());
    let (out, errors) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(expected), "{out}{errors}");
    (out, errors)
}

#[test]
fn files_that_are_the_same_say_so() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, "builtin:cornell", "a.lprt", &[]);
    assert_eq!(diff(folder, 0, &["a.lprt", "a.lprt"]).0, "a.lprt and a.lprt are the same\n");
    let (json, _) = diff(folder, 0, &["a.lprt", "a.lprt", "--json"]);
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(
        (&json["identical"], &json["sections"], &json["lights"]),
        (&true.into(), &Value::Array(vec![]), &Value::Array(vec![]))
    );
}

#[test]
fn another_albedo_and_other_options_are_told_by_section_and_by_light() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let mut scene = localprt_scenes::builtin::scene("cornell").expect("a scene");
    for (name, albedo) in [("white", 0.8), ("gray", 0.3)] {
        scene.materials.iter_mut().for_each(|material| material.base_color = Vec4::new(albedo, albedo, albedo, 1.0));
        localprt_scenes::export_glb(&scene, folder.join(format!("{name}-box.glb"))).expect("written");
    }
    bake(folder, "white-box.glb", "white.lprt", &[]);
    bake(folder, "gray-box.glb", "gray.lprt", &[]);
    bake(folder, "white-box.glb", "more.lprt", &["--receivers", "700"]);

    let (json, errors) = diff(folder, 7, &["white.lprt", "gray.lprt", "--json"]);
    assert!(errors.contains("error: white.lprt: differs from gray.lprt in "), "{errors}");
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["identical"], false);
    let light = &json["lights"][0];
    assert_eq!((&light["same_layout"], &light["pairs"]), (&true.into(), &json["counts"][0]["receivers"]));
    // A white box gathers more than one of albedo 0.3.
    assert!(light["mean"][0].as_f64() > light["mean"][1].as_f64().map(|mean| 1.5 * mean), "{light}");
    assert!(light["nrmse"].as_f64() > Some(0.2), "{light}");
    let largest = light["max_relative"].as_f64();
    assert!(
        largest >= light["p99_relative"].as_f64() && light["p99_relative"].as_f64() >= light["p95_relative"].as_f64()
    );
    assert_eq!(light["worst"].as_array().map(Vec::len), Some(5));
    let named = |name: &str, list: &str| json[list].as_array().expect("a list").iter().any(|one| one["name"] == name);
    assert!(named("scene_hash", "metadata") && json["options"].as_array().is_some_and(Vec::is_empty), "{json:#}");

    // Other options lay out other receivers, which pair by place; a given light is the light of both.
    fs::write(folder.join("lamp.json"), r#"{"lights":[{"type":"point","position":[0,1.2,0.4],"intensity":3}]}"#)
        .expect("written");
    let (told, _) = diff(folder, 7, &["white.lprt", "more.lprt", "--lights", "lamp.json", "--bounces", "2"]);
    for part in ["  receivers: 400 -> 700\n", "\nRPOS ", "light: lamp\n", "the nearest within a texel", "  at "] {
        assert!(told.contains(part), "`{part}` is not in\n{told}");
    }
    // Without scenes there is no light, but still a difference.
    for name in ["white.glb", "more.glb"] {
        fs::remove_file(folder.join(name)).expect("removed");
    }
    assert!(diff(folder, 6, &["white.lprt", "more.lprt"]).1.contains("--sections"));
    let (told, _) = diff(folder, 7, &["white.lprt", "more.lprt", "--sections"]);
    assert!(told.contains("\nRPOS ") && !told.contains("light:"), "{told}");
}

#[test]
fn damaged_and_missing_files_have_the_exit_codes_of_other_commands() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, "builtin:cornell", "a.lprt", &[]);
    let mut bytes = fs::read(folder.join("a.lprt")).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(folder.join("damaged.lprt"), &bytes).expect("written");
    for pair in [["a.lprt", "damaged.lprt"], ["damaged.lprt", "a.lprt"]] {
        let (out, errors) = diff(folder, 3, &pair);
        assert!(
            out.is_empty() && errors.starts_with("error: damaged.lprt: ") && errors.contains("\nhelp: "),
            "{errors}"
        );
    }
    fs::write(folder.join("short.lprt"), &bytes[..100]).expect("written");
    assert!(diff(folder, 3, &["a.lprt", "short.lprt"]).1.contains("short.lprt"));
    assert!(diff(folder, 6, &["a.lprt", "none.lprt"]).1.contains("none.lprt: cannot be read"));
}
