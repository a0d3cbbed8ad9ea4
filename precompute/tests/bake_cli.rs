//! The command from outside with real, small bakes: files, streams, determinism, interruption.

use localprt_precompute::rays::RayCaster;
use localprt_scenes::load;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Seconds at most on a slow machine; what is tested here does not depend on quality.
const SMALL: [&str; 12] = [
    "--lightmap",
    "32",
    "--direct-map",
    "64",
    "--gather-rays",
    "16",
    "--relight-rays",
    "128",
    "--probe-degree",
    "2",
    "--spacing",
    "0.7",
];

fn command(arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_precompute"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

fn run(arguments: &[&str], folder: &Path) -> Output {
    command(arguments, folder).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

#[track_caller]
fn assert_exit(output: &Output, expected: i32) {
    assert_eq!(output.status.code(), Some(expected), "{}", text(&output.stderr));
    assert!(!text(&output.stderr).contains("panicked"), "{}", text(&output.stderr));
}

/// Bakes the Cornell box into `a.lprt`, anew each time.
#[track_caller]
fn bake(folder: &Path, more: &[&str]) -> Output {
    let output = run(&[&["bake", "builtin:cornell", "-o", "a.lprt", "--no-cache"], &SMALL[..], more].concat(), folder);
    assert_exit(&output, 0);
    output
}

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

#[test]
fn a_scene_becomes_a_file_and_the_file_becomes_pictures() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let baked = bake(folder, &["--report", "-"]);
    let report = json(&baked.stdout);
    assert!(text(&baked.stderr).contains("wrote a.lprt"));
    let receivers = report["receivers"].as_u64().expect("a count");
    assert!(receivers > 0 && report["probes"].as_u64() > Some(0) && report["clusters"].as_u64() > Some(0));
    assert_eq!(report["options"]["gather_rays"], 16);
    assert!(report["scene"]["hash"].as_str().is_some_and(|hash| hash.len() == 64));
    let file_bytes = std::fs::metadata(folder.join("a.lprt")).expect("a file").len();
    assert_eq!(report["bytes"]["file"], file_bytes);
    assert!(folder.join("a.glb").exists());

    let checked = run(&["check", "a.lprt"], folder);
    assert_exit(&checked, 0);
    assert_eq!(text(&checked.stdout), "OK\n");
    let info = run(&["info", "a.lprt", "--json"], folder);
    assert_exit(&info, 0);
    let info = json(&info.stdout);
    for key in ["receivers", "probes", "clusters", "radius", "coefficients_per_receiver", "probes_per_cluster"] {
        assert_eq!(info[key], report[key], "{key}");
    }
    assert_eq!(info["scene"]["path"], "a.glb");
    assert_eq!(info["options"], report["options"]);
    assert!(info["report"].get("seconds").is_none() && info["report"]["receivers"] == receivers);
    assert_exit(&run(&["info", "a.lprt"], folder), 0);

    let arguments = ["relight", "a.lprt", "-q", "-o", "a.exr", "--receivers", "a.ply", "--json", "a.json"];
    let relit = run(&[&arguments[..], &["--picture", "a.png", "--size", "32x24"]].concat(), folder);
    assert_exit(&relit, 0);
    assert_eq!((text(&relit.stdout), text(&relit.stderr)), ("", ""), "quiet");
    let ply = std::fs::read(folder.join("a.ply")).expect("a file");
    let header = String::from_utf8_lossy(&ply[..400]);
    assert!(header.contains(&format!("element vertex {receivers}\n")), "{header}");
    let figures = json(&std::fs::read(folder.join("a.json")).expect("a file"));
    assert!(figures["irradiance"]["mean"][0].as_f64() > Some(0.0), "light reaches the receivers");
    assert_eq!(&std::fs::read(folder.join("a.png")).expect("a file")[1..4], b"PNG");
    assert_eq!(std::fs::read(folder.join("a.exr")).expect("a file")[..4], [0x76, 0x2f, 0x31, 0x01]);
}

#[test]
fn programs_without_a_runtime_get_a_texture_and_a_lit_scene() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, &[]);
    let arguments = ["relight", "a.lprt", "-q", "--ktx2", "a.ktx2", "--glb", "lit.glb", "--json", "-"];
    let relit = json(&run(&arguments, folder).stdout);
    let texture = std::fs::read(folder.join("a.ktx2")).expect("a texture");
    assert!(texture.starts_with(b"\xabKTX 20\xbb") && texture.len() > 32 * 32 * 8);

    // As a reader of glTF sees it: what is sent out in each direction, without lights.
    let (plain, lit) = (load(folder.join("a.glb")).expect("reads"), load(folder.join("lit.glb")).expect("reads"));
    assert_eq!((lit.lights.len(), lit.face_count()), (0, plain.face_count()));
    assert_eq!(lit.images.len(), plain.images.len() + 1);
    assert!(lit.materials.iter().all(|material| material.base_color.truncate() == glam::Vec3::ZERO));
    let mesh = plain.meshes.iter().position(|mesh| mesh.name == "floor").expect("a floor");
    let middle = glam::Vec3::splat(1.0 / 3.0);
    let caster = RayCaster::new(&plain).expect("a tree");
    let (lamp, up) = (&plain.lights[0], glam::Vec3::Y);
    let is_lit = |position: glam::Vec3| {
        let incident = lamp.incident(position).expect("the lamp");
        let met = caster.closest_hit(position + 1e-3 * up, incident.dir_to_light);
        met.is_none_or(|hit| hit.t > incident.distance - 2e-3)
    };
    let mean: [f32; 3] = serde_json::from_value(relit["irradiance"]["mean"].clone()).expect("three numbers");
    let mut compared = 0;
    for triangle in 0..plain.meshes[mesh].triangles.len() {
        let position = plain.position(mesh, triangle, middle);
        // Texels are 8 cm wide: far from shadows, and from the blocks, below which other charts lie.
        let around =
            [-1, 0, 1].into_iter().flat_map(|x| [-1, 0, 1].map(|z| 0.2 * glam::Vec3::new(x as f32, 0.0, z as f32)));
        if !around.map(|step| (position + step).clamp(glam::Vec3::splat(-0.99), glam::Vec3::splat(0.99))).all(is_lit) {
            continue;
        }
        compared += 1;
        let incident = lamp.incident(position).expect("the lamp");
        let direct = incident.irradiance * incident.dir_to_light.dot(up);
        let albedo = plain.base_color(mesh, triangle, middle).truncate();
        let sent = lit.emission(mesh, triangle, middle).element_sum();
        let by = |arriving: glam::Vec3| (albedo / std::f32::consts::PI * arriving).element_sum();
        // An open floor has indirect light, and not more than twice the mean. Over half a texel, 4 cm, direct light changes by at most
        // 3 x / (x^2 + h^2) a metre, 4 % at a metre beside the lamp; 8 bits of sRGB round by less than 1 %.
        let [least, most] = [by(direct), by(direct + 2.0 * glam::Vec3::from(mean))];
        assert!((0.95 * least..1.05 * most).contains(&sent), "{position}: {sent} is not from {least} to {most}");
    }
    assert!(compared > 5, "{compared}");
}

#[test]
fn clear_glass_is_left_out_and_variants_change_materials_alone() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let mut scene = localprt_scenes::builtin::scene("cornell").expect("a scene");
    let [red, green] = ["red", "green"].map(|name| {
        scene.materials.iter().position(|material| material.name == name).expect("a material of this name")
    });
    scene.materials[green].transmission = 1.0;
    scene.variants = vec!["blue hour".into()];
    scene.meshes.iter_mut().filter(|mesh| mesh.material == red).for_each(|mesh| mesh.variants = vec![[0, green]]);
    localprt_scenes::export_glb(&scene, folder.join("hall.glb")).expect("writes");
    let bake = |glass: &str| {
        let arguments = [&["bake", "hall.glb", "-o", "a.lprt", "--no-cache", "--glass", glass][..], &SMALL].concat();
        let output = run(&arguments, folder);
        assert_exit(&output, 0);
        text(&output.stderr).to_owned()
    };
    let has_wall = || {
        let scene = load(folder.join("a.glb")).expect("reads");
        scene.meshes.iter().any(|mesh| scene.materials[mesh.material].name == "green")
    };
    assert!(bake("opaque").contains("--glass clear"));
    assert!(has_wall());
    let figures = |variant: &[&str]| run(&[&["relight", "a.lprt", "--json", "-"][..], variant].concat(), folder);
    let [plain, varied] = [figures(&[]), figures(&["--variant", "blue hour"])];
    assert_exit(&varied, 0);
    let band =
        |output: &Output, band: usize| json(&output.stdout)["irradiance"]["mean"][band].as_f64().expect("a number");
    // The red wall is green now.
    assert!(band(&varied, 0) < 0.95 * band(&plain, 0) && band(&varied, 1) > 1.05 * band(&plain, 1));
    let unknown = figures(&["--variant", "night"]);
    assert_exit(&unknown, 2);
    assert!(text(&unknown.stderr).contains("help: choose one of the scene's, such as \"blue hour\""));
    assert_exit(&run(&["validate", "a.lprt", "-o", "v", "--variant", "night"], folder), 2);
    assert!(bake("clear").contains("are left out"));
    assert!(!has_wall());
}

#[test]
fn a_volume_is_baked_reported_and_shown() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let baked = bake(folder, &["--report", "-", "--volume", "0.5", "--volume-degree", "2"]);
    let volume = json(&baked.stdout)["volume"].clone();
    assert_eq!(volume["dims"], serde_json::json!([5, 5, 5]));
    let count = |key: &str| volume[key].as_u64().expect("a count");
    assert!(count("receivers") > 0 && count("clusters") > 0 && count("bytes") > 0, "{volume}");
    assert_eq!(count("receivers") + count("invalid"), 125);
    assert!(count("filled") <= count("invalid"));
    assert_exit(&run(&["check", "a.lprt"], folder), 0);
    let info = json(&run(&["info", "a.lprt", "--json"], folder).stdout);
    assert_eq!(info["volume"]["degree"], 2);
    for key in ["dims", "receivers", "invalid", "filled", "clusters", "bytes"] {
        assert_eq!(info["volume"][key], volume[key], "{key}");
    }
    let shown = run(&["info", "a.lprt"], folder);
    assert!(text(&shown.stdout).contains("5 x 5 x 5 cells, 0.5 m apart, degree 2"), "{}", text(&shown.stdout));

    let fine = run(&[&["bake", "builtin:cornell", "-o", "b.lprt", "--volume", "0.001"], &SMALL[..]].concat(), folder);
    assert_exit(&fine, 2);
    assert!(text(&fine.stderr).contains("allowed is 4194304 cells"), "{}", text(&fine.stderr));
    assert!(!folder.join("b.lprt").exists());
}

#[test]
fn threads_do_not_change_a_byte() {
    let folders = [tempfile::tempdir().expect("folder"), tempfile::tempdir().expect("folder")];
    let files = [(&folders[0], "1"), (&folders[1], "3")].map(|(folder, threads)| {
        bake(folder.path(), &["--threads", threads]);
        let relit = run(&["--threads", threads, "relight", "a.lprt", "--receivers", "a.ply"], folder.path());
        assert_exit(&relit, 0);
        ["a.lprt", "a.glb", "a.ply"].map(|name| std::fs::read(folder.path().join(name)).expect("a file"))
    });
    assert!(files[0] == files[1]);
}

#[test]
fn a_baked_file_insists_on_its_scene() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, &["-q"]);
    std::fs::rename(folder.join("a.glb"), folder.join("moved.glb")).expect("renamed");
    let missing = run(&["relight", "a.lprt", "--json", "-"], folder);
    assert_exit(&missing, 6);
    assert!(text(&missing.stderr).contains("a.glb") && text(&missing.stderr).contains("--scene"));
    assert_exit(&run(&["relight", "a.lprt", "--json", "-", "--scene", "moved.glb"], folder), 0);
    assert_exit(&run(&["scene", "furnace", "-o", "a.glb"], folder), 0);
    let other = run(&["relight", "a.lprt", "--json", "-"], folder);
    assert_exit(&other, 3);
    assert!(text(&other.stderr).contains("hash"), "{}", text(&other.stderr));
}

/// Path of the scene as a baked file has it.
fn scene_path(folder: &Path, file: &str) -> String {
    let info = run(&["info", file, "--json"], folder);
    assert_exit(&info, 0);
    json(&info.stdout)["scene"]["path"].as_str().expect("a path").to_owned()
}

#[test]
fn a_scene_file_is_baked_to_its_own_name_and_stays_as_it_is() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let bake = |scene: &str, output: &str| {
        assert_exit(&run(&[&["bake", scene, "-o", output], &SMALL[..]].concat(), folder), 0);
    };
    assert_exit(&run(&["scene", "cornell", "-o", "hall.glb"], folder), 0);
    std::fs::create_dir(folder.join("inner")).expect("made");
    let original = std::fs::read(folder.join("hall.glb")).expect("a file");
    let mut spellings = vec!["hall.glb".to_owned(), "inner/../hall.glb".into()];
    spellings.push(folder.join("hall.glb").to_str().expect("UTF-8").into());
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../hall.glb", folder.join("inner/link.glb")).expect("linked");
        spellings.push("inner/link.glb".into());
    }
    for scene in spellings {
        let _ = std::fs::remove_file(folder.join("hall.lightmap.glb"));
        bake(&scene, "hall.lprt");
        assert_eq!(scene_path(folder, "hall.lprt"), "hall.lightmap.glb", "{scene}");
        assert!(std::fs::read(folder.join("hall.glb")).expect("a file") == original, "{scene}");
        assert_exit(&run(&["relight", "hall.lprt", "--json", "-"], folder), 0);
    }
    // Another folder has the name free.
    bake("hall.glb", "inner/hall.lprt");
    assert_eq!(scene_path(folder, "inner/hall.lprt"), "hall.glb");
    assert!(folder.join("inner/hall.glb").exists() && !folder.join("inner/hall.lightmap.glb").exists());

    // Lightmap coordinates are kept, so nothing is written beside; without them one more part of the name is.
    bake("hall.lightmap.glb", "hall.lightmap.lprt");
    assert_eq!(scene_path(folder, "hall.lightmap.lprt"), "hall.lightmap.glb");
    assert!(!folder.join("hall.lightmap.lightmap.glb").exists());
    assert_exit(&run(&["scene", "cornell", "-o", "bare.lightmap.glb"], folder), 0);
    bake("bare.lightmap.glb", "bare.lightmap.lprt");
    assert_eq!(scene_path(folder, "bare.lightmap.lprt"), "bare.lightmap.lightmap.glb");
    assert_exit(&run(&["relight", "bare.lightmap.lprt", "--json", "-"], folder), 0);
}

#[test]
fn lighting_files_are_obeyed_or_refused_by_place() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, &["-q"]);
    let mean = |lights: &str| {
        std::fs::write(folder.join("l.json"), lights).expect("written");
        let output = run(&["relight", "a.lprt", "-q", "--json", "-", "--lights", "l.json"], folder);
        assert_exit(&output, 0);
        json(&output.stdout)["irradiance"]["mean"][1].as_f64().expect("a number")
    };
    assert_eq!(mean(r#"{"lights": []}"#), 0.0, "no light, no irradiance");
    assert!(mean(r#"{"sky": {"type": "constant", "radiance": [1, 1, 1]}, "lights": []}"#) > 0.0);
    std::fs::write(folder.join("l.json"), r#"{"ligths": []}"#).expect("written");
    let output = run(&["relight", "a.lprt", "--json", "-", "--lights", "l.json"], folder);
    assert_exit(&output, 3);
    assert!(text(&output.stderr).contains("l.json") && text(&output.stderr).contains("ligths"));
    assert_exit(&run(&["relight", "a.lprt", "--json", "-", "--lights", "none.json"], folder), 6);
}

#[test]
fn a_failed_quality_gate_leaves_an_older_file_as_it_is() {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("a.lprt"), "old").expect("written");
    let gate = ["bake", "builtin:cornell", "-o", "a.lprt", "--max-unseen", "0", "--probes", "2"];
    let output = run(&[&gate[..], &SMALL[..10]].concat(), folder.path());
    assert_exit(&output, 7);
    assert!(text(&output.stderr).contains("unseen") && text(&output.stderr).contains("help: "));
    assert_eq!(std::fs::read(folder.path().join("a.lprt")).expect("there"), b"old");
}

#[cfg(unix)]
#[test]
fn an_interrupt_stops_cleanly() {
    let folder = tempfile::tempdir().expect("folder");
    // Long enough to be interrupted anywhere.
    let long = ["bake", "builtin:cornell", "-o", "a.lprt", "--gather-rays", "1000000"];
    let mut child = command(&long, folder.path()).stderr(Stdio::piped()).spawn().expect("the program starts");
    // The first stage is announced after the handler is in place.
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().expect("piped")));
    lines.next().expect("a line").expect("UTF-8");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill starts");
    assert!(killed.success());
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    assert_eq!(child.wait().expect("ends").code(), Some(130), "{rest:?}");
    assert!(rest.iter().any(|line| line.starts_with("error: interrupted")), "{rest:?}");
    assert!(!folder.path().join("a.lprt").exists());
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).expect("list").flatten().map(|entry| entry.file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().contains(".tmp")), "{left:?}");
}

/// Mean irradiance of a lighting state, or the exit code where it is refused.
fn mean_irradiance(folder: &Path, more: &[&str], hide_gpus: bool) -> Result<f64, i32> {
    let mut command = command(&[&["relight", "a.lprt", "--bounces", "2", "--json", "-"], more].concat(), folder);
    if hide_gpus {
        // A list of drivers without one: no Vulkan adapter. Other platforms have other ways to find theirs.
        command.env("VK_DRIVER_FILES", "none.json").env("VK_ICD_FILENAMES", "none.json");
    }
    let output = command.output().expect("the program starts");
    match output.status.code() {
        Some(0) => Ok(json(&output.stdout)["irradiance"]["mean"][0].as_f64().expect("a mean")),
        code => {
            assert!(text(&output.stderr).contains("GPU"), "{}", text(&output.stderr));
            Err(code.expect("an exit code"))
        }
    }
}

#[test]
fn the_gpu_and_shadow_maps_give_the_same_light() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    bake(folder, &[]);
    let traced = mean_irradiance(folder, &[], false).expect("the CPU is always there");
    let close = |found: f64, tolerance: f64| assert!((found / traced - 1.0).abs() < tolerance, "{found} for {traced}");
    // Shadow edges are one of 2048 texels wide, and few of the 64 x 64 texels of the direct map lie on one.
    close(mean_irradiance(folder, &["--direct", "shadow-map"], false).expect("on the CPU"), 0.02);
    match mean_irradiance(folder, &["--backend", "gpu"], false) {
        Ok(mean) => {
            close(mean, 1e-4);
            let both = &["--backend", "gpu", "--direct", "shadow-map"];
            close(mean_irradiance(folder, both, false).expect("an adapter as before"), 0.02);
        }
        Err(code) => {
            assert!(std::env::var_os("REQUIRE_GPU").is_none(), "no GPU adapter");
            eprintln!("SKIPPED the_gpu_and_shadow_maps_give_the_same_light: no GPU adapter");
            assert_eq!(code, 5);
        }
    }
    if cfg!(target_os = "linux") {
        assert_eq!(mean_irradiance(folder, &["--backend", "gpu"], true), Err(5));
        assert!(mean_irradiance(folder, &[], true).is_ok());
    }
}
