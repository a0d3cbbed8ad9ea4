//! `precompute validate` from outside: files, figures, exit codes.

use glam::Vec3;
use localprt_formats::Baked;
use localprt_precompute::metrics::MethodError;
use localprt_precompute::reference_file::ReferenceFile;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_precompute"))
        .args(arguments)
        .stdin(Stdio::null())
        .env("NO_COLOR", "1")
        .output()
        .expect("the program starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("not killed by a signal")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("UTF-8").to_owned()
}

/// Cornell in a second or two.
fn bake(folder: &Path) -> String {
    let file = path(folder, "c.lprt");
    let options = ["--probes", "12", "--lightmap", "48", "--direct-map", "64", "--gather-rays", "64"];
    let mut arguments =
        vec!["bake", "builtin:cornell", "-o", &file, "-q", "--relight-rays", "500", "--transport", "fitted"];
    arguments.extend(options);
    let output = run(&arguments);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    file
}

const QUICK: [&str; 15] = [
    "-q",
    "--receivers",
    "100",
    "--paths",
    "512",
    "--width",
    "24",
    "--picture-paths",
    "8",
    "--bounces",
    "1",
    "--points",
    "100",
    "--flip-paths",
    "256",
];

fn validate(file: &str, folder: &str, more: &[&str]) -> Output {
    run(&[&["validate", file, "-o", folder], &QUICK[..], more].concat())
}

#[test]
fn a_validation_leaves_a_page_figures_and_pictures() {
    let folder = tempfile::tempdir().expect("folder");
    let file = bake(folder.path());
    let lights = path(folder.path(), "spot.json");
    let spot = r#"{"lights":[{"type":"spot","position":[0,1.8,0.5],"direction":[-1,-1,-0.5],"intensity":9}]}"#;
    std::fs::write(&lights, spot).expect("written");
    let quality = path(folder.path(), "quality");
    let systems = "ssgi-probes,ddgi,file,hybrid,paper,ddgi-scaled";
    let more = ["--lights", &lights, "--sweep", "degree=1,4", "--failure-case", "--max-nrmse", "1000"];
    let more = [&more[..], &["--systems", systems, "--moving-lamp"]].concat();
    let output = validate(&file, &quality, &more);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""), "quiet and done");

    let text = std::fs::read_to_string(path(folder.path(), "quality/metrics.json")).expect("metrics");
    let metrics: Value = serde_json::from_str(&text).expect("JSON");
    let keys = |value: &Value| value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>().join(" ");
    let documented = "receivers bounces reference methods operator_norm seams coverage";
    assert!(keys(&metrics).starts_with(documented), "{}", keys(&metrics));
    assert_eq!(metrics["bounces"], 1);
    assert!(metrics["reference"]["rays"].as_u64() > Some(50_000));
    assert!(metrics["reference"]["standard_error"].as_f64() > Some(0.0));
    for method in ["compressed", "uncompressed", "spatial", "arikan", "paper"] {
        let errors = &metrics["methods"][method];
        assert!(keys(errors).starts_with("nrmse median_relative p95_relative bias flip"), "{}", keys(errors));
        for name in ["nrmse", "median_relative", "p95_relative", "flip"] {
            assert!(errors[name].as_f64() > Some(0.0), "{method} {name}: {errors}");
        }
    }
    let view = &metrics["views"][0];
    assert!(keys(view).starts_with("name nrmse median_relative p95_relative flip flip_noise unseen"), "{}", keys(view));
    assert_eq!(view["name"], "front");
    for figures in [view, &metrics["area"]] {
        for name in ["nrmse", "median_relative", "p95_relative", "p99_relative", "nrmse_99", "standard_error"] {
            assert!(figures[name].as_f64() > Some(0.0), "{name}: {figures}");
        }
        assert!(figures["nrmse_99"].as_f64() <= figures["nrmse"].as_f64(), "{figures}");
    }
    assert!(view["pixels"].as_u64() > Some(80), "{view}");
    for name in ["off_10", "edge_ratio", "mottling"] {
        assert!(view[name].as_f64() > Some(0.0), "{name}: {view}");
    }
    for figures in [view, &metrics["area"]] {
        assert!(figures["off_50"].as_f64() <= figures["off_10"].as_f64(), "{figures}");
    }
    assert!(view["leak"].as_f64() >= Some(0.0), "{view}");
    assert!(view["edge_pixels"].as_u64() > Some(0) && view["smooth_pixels"].as_u64() > Some(0), "{view}");
    assert_eq!(metrics["area"]["points"], 100);
    for name in ["mean", "p95", "max"] {
        assert!(metrics["operator_norm"][name].as_f64() > Some(0.0), "{name}");
    }
    assert!(metrics["predicted_error"]["mean"].as_f64() > Some(0.0), "rows are fitted");
    // The given lighting leads; the scene's own light and the failure case follow.
    let names: Vec<&str> = metrics["states"]
        .as_array()
        .expect("states")
        .iter()
        .map(|state| state["name"].as_str().expect("name"))
        .collect();
    assert_eq!(names.len(), 3);
    assert_eq!(names[..2], ["spot", "the scene's own light"]);
    assert!(names[2].starts_with("failure case"), "{}", names[2]);
    assert_eq!(metrics["sweeps"][0]["points"].as_array().expect("points").len(), 2);

    // What was measured under the first lighting lies beside the file, and names it.
    let reference = ReferenceFile::read(path(folder.path(), "c.reference.ply").as_ref()).expect("a reference");
    reference.matches(&Baked::open(&file).expect("a baked file")).expect("of this bake");
    assert_eq!((reference.state.as_str(), reference.bounces, reference.points.len()), ("spot", 1, 100));
    let (found, expected): (Vec<Vec3>, Vec<Vec3>) =
        reference.points.iter().map(|point| (Vec3::from(point.compressed), Vec3::from(point.reference))).unzip();
    let nrmse = MethodError::of(&found, &expected).expect("light").nrmse;
    assert_eq!(metrics["methods"]["compressed"]["nrmse"].as_f64(), Some(nrmse), "as the page has it");

    // Systems in the order of the table; the file's figures are those of the file.
    let systems = &metrics["systems"];
    assert_eq!(keys(systems), "file hybrid paper ddgi ddgi-scaled ssgi-probes");
    for (name, found) in systems.as_object().expect("an object") {
        let documented =
            "nrmse median_relative p95_relative bias view_nrmse area_nrmse flip leak bytes probes rays_per_update";
        assert!(keys(found).starts_with(documented), "{}", keys(found));
        for field in ["nrmse", "view_nrmse", "area_nrmse", "flip", "bytes", "probes", "frames_to_90_percent"] {
            assert!(found[field].as_f64() > Some(0.0), "{name} {field}: {found}");
        }
    }
    assert_eq!(systems["file"]["nrmse"].as_f64(), Some(nrmse));
    assert_eq!(systems["file"]["view_nrmse"], view["nrmse"]);
    // Nothing moves but the lamp.
    assert_eq!(systems["hybrid"], systems["file"]);
    assert_eq!(systems["paper"]["nrmse"], metrics["methods"]["paper"]["nrmse"]);
    // A lamp takes a system with hysteresis longer to follow than the file, which has one bounce in a frame.
    let behind = |name: &str| systems[name]["following"]["lag_frames"].as_f64().expect("it follows");
    assert!(behind("file") < 1.0 && behind("ddgi") > 5.0, "{} {}", behind("file"), behind("ddgi"));
    assert!(systems["ddgi"]["rays_per_update"].as_f64() > Some(1000.0));

    let page = std::fs::read_to_string(path(folder.path(), "quality/index.html")).expect("a page");
    assert!(page.contains("nrmse") && page.contains("Sweep of degree") && page.contains("<svg"));
    // Every picture that the page shows is there, and every picture that is there is shown.
    let mut shown = 0;
    for entry in std::fs::read_dir(path(folder.path(), "quality")).expect("a folder") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        if name.ends_with(".png") {
            assert!(page.contains(&name), "{name} is not on the page");
            shown += 1;
        }
    }
    assert!(shown > 30, "{shown}");
    for (place, _) in page.match_indices("src=\"./") {
        let name = page[place + 7..].split('"').next().expect("a name");
        assert!(Path::new(&path(folder.path(), "quality")).join(name).is_file(), "{name}");
    }
    for name in ["sweep0-error.svg", "sweep0-error.png", "sweep0-bytes.svg", "sweep0-seconds.png"] {
        assert!(Path::new(&path(folder.path(), "quality")).join(name).is_file(), "{name}");
    }
}

#[test]
fn limits_and_mistakes_have_their_exit_codes() {
    let folder = tempfile::tempdir().expect("folder");
    let file = bake(folder.path());
    let quality = path(folder.path(), "quality");
    // Where the reference should lie is a folder: less is left behind, and nothing fails for it.
    std::fs::create_dir(path(folder.path(), "c.reference.ply")).expect("made");
    let output = validate(&file, &quality, &["--max-nrmse", "0.0001"]);
    assert_eq!(code(&output), 7, "{}", stderr(&output));
    assert!(stderr(&output).contains("nrmse under the scene's own light is"), "{}", stderr(&output));
    // The page tells why, so it is there.
    assert!(Path::new(&path(folder.path(), "quality/index.html")).is_file());

    // A system that there is none of.
    let output = validate(&file, &quality, &["--systems", "file,dggi"]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(stderr(&output).contains("did you mean ddgi?"), "{}", stderr(&output));

    // A limit of its own for what is seen; the page holds both to theirs.
    let output = validate(&file, &quality, &["--max-nrmse", "1000", "--max-view-nrmse", "0.0001"]);
    assert_eq!(code(&output), 7, "{}", stderr(&output));
    assert!(stderr(&output).contains("what front sees under the scene's own light is"), "{}", stderr(&output));
    assert!(stderr(&output).contains("index.html"), "{}", stderr(&output));
    let page = std::fs::read_to_string(path(folder.path(), "quality/index.html")).expect("a page");
    assert!(page.contains("The views are above the limit") && page.contains("The receivers are within the limit"));
    assert_eq!(code(&validate(&file, &quality, &["--max-view-nrmse", "1000"])), 0);

    // And for what edges and walls look like.
    let both = ["--max-leak", "1000", "--max-mottling", "0.0001"];
    let output = validate(&file, &quality, &both);
    assert_eq!(code(&output), 7, "{}", stderr(&output));
    let mottling = "mottling of surfaces that front sees under the scene's own light is";
    assert!(stderr(&output).contains(mottling), "{}", stderr(&output));
    let page = std::fs::read_to_string(path(folder.path(), "quality/index.html")).expect("a page");
    assert!(
        page.contains("The edges are within the limit") && page.contains("The smooth surfaces are above the limit")
    );
    let output = validate(&file, &quality, &["--max-leak", "0.000001"]);
    assert_eq!(code(&output), 7, "{}", stderr(&output));
    assert!(stderr(&output).contains("leak at edges that front sees"), "{}", stderr(&output));

    let dark = path(folder.path(), "dark.json");
    std::fs::write(&dark, r#"{"lights":[]}"#).expect("written");
    let output = validate(&file, &quality, &["--lights", &dark]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("no indirect light") && stderr(&output).contains("--lights"),
        "{}",
        stderr(&output)
    );

    for (sweep, part) in [("quality=1", "unknown option"), ("lightmap=64", "cannot be swept"), ("degree=99", "0 to 10")]
    {
        let output = validate(&file, &quality, &["--sweep", sweep]);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    }
    for arguments in [
        ["--sweep", "degree"],
        ["--max-nrmse", "-1"],
        ["--max-view-nrmse", "0"],
        ["--max-leak", "-1"],
        ["--max-mottling", "0"],
        ["--bounces", "0"],
        ["--error", "nan"],
    ] {
        assert_eq!(code(&validate(&file, &quality, &arguments)), 2, "{arguments:?}");
    }
    assert_eq!(code(&validate(&path(folder.path(), "none.lprt"), &quality, &[])), 6);
    assert_eq!(code(&validate(&file, "/dev/null/quality", &[])), 6);
    assert_eq!(code(&validate(&file, &quality, &["--camera", "7"])), 2);
}
