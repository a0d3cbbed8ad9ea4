//! The command from outside, as far as no bake is needed: help, flags, settings, refusals. What counts is the exit code,
//! which stream a text is on, and that errors name file and remedy.

use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the program starts")
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_precompute"));
    command.args(arguments).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("not killed by a signal")
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// Exit code as expected, nothing on standard output, and all of `parts` on standard error, without traces of a panic.
#[track_caller]
fn assert_refused(arguments: &[&str], expected: i32, parts: &[&str]) {
    let output = run(arguments);
    let text = stderr(&output);
    assert_eq!(code(&output), expected, "{text}");
    assert_eq!(stdout(&output), "", "data on standard output");
    assert!(text.contains("error: "), "{text}");
    assert!(!text.contains("panicked") && !text.contains("internal error"), "{text}");
    assert!(text.contains("\nhelp: ") || text.contains("--help"), "nothing to do: {text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("UTF-8").to_owned()
}

#[test]
fn help_leads_with_an_example_and_names_the_exit_codes() {
    let output = run(&["--help"]);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
    let text = stdout(&output);
    let example = text.find("precompute bake hall.glb -o hall.lprt").expect("an example");
    assert!(example < text.find("Usage:").expect("usage"));
    for part in ["7 a quality gate failed", "130 interrupted", "bake", "relight", "info", "check", "scene", "demo"] {
        assert!(text.contains(part), "{part}");
    }
    let text = stdout(&run(&["bake", "--help"]));
    for part in ["--gather-rays", "[default: 1024]", "[default: 0.005]", "--max-unseen", "preview", "--print-config"] {
        assert!(text.contains(part), "{part}");
    }
    assert!(stdout(&run(&["--version"])).starts_with("precompute "));
}

#[test]
fn a_wrong_command_line_is_bad_usage() {
    assert_refused(&["bake", "a.glb", "-o", "a.lprt", "--gather-ray", "5"], 2, &["--gather-rays"]);
    assert_refused(&["bake", "a.glb"], 2, &["--output"]);
    assert_refused(&["bake", "a.glb", "-o", "a.lprt", "--fill", "0.1"], 2, &["--fill", "--receivers"]);
    assert_refused(&["relight", "a.lprt"], 2, &["--picture"]);
    assert_refused(&["relight", "a.lprt", "--picture", "a.png", "--size", "12"], 2, &["1280x720"]);
    assert_refused(&["relight", "a.lprt", "-o", "a.exr", "--exposure", "1"], 2, &["--picture"]);
    assert_refused(&["--threads", "0", "info", "a.lprt"], 2, &["1..=1024"]);
    assert_refused(&["bakee"], 2, &["bake"]);
    assert_eq!(code(&run(&[])), 2);
}

#[test]
fn values_out_of_range_name_flag_value_and_range() {
    let refused = |flag: &str, value: &str, parts: &[&str]| {
        assert_refused(&["bake", "--print-config", flag, value], 2, parts);
    };
    refused("--gather-rays", "0", &["--gather-rays 0", "1 to 1048576", "help: "]);
    refused("--gather-rays", "-5", &["--gather-rays", "-5", "whole number"]);
    refused("--spacing", "-1", &["--spacing -1", "above 0"]);
    refused("--overlap", "nan", &["--overlap NaN"]);
    refused("--max-unseen", "1.5", &["--max-unseen 1.5", "0 to 1"]);
    refused("--interior", "1,2", &["three numbers"]);
    refused("--unwrap", "hands", &["uvunwrap"]);
}

#[test]
fn printed_settings_read_back_to_the_same() {
    let folder = tempfile::tempdir().expect("folder");
    let flags =
        ["--preset", "preview", "--spacing", "0.3", "--interior", "-1,2,0.5", "--seed", "42", "--unwrap", "xatlas"];
    let first = run(&[&["bake", "--print-config"], &flags[..]].concat());
    assert_eq!((code(&first), stderr(&first).as_str()), (0, ""));
    let text = stdout(&first);
    for line in ["gather_rays = 512", "spacing = 0.3", "threshold = 0.005", "seed = 42", "unwrap = \"xatlas\""] {
        assert!(text.lines().any(|held| held == line), "{line} is not in\n{text}");
    }
    let config = path(folder.path(), "bake.toml");
    std::fs::write(&config, &text).expect("written");
    assert_eq!(stdout(&run(&["bake", "--print-config", "--config", &config])), text);
    // Flags over file over preset.
    let mixed = run(&["bake", "--print-config", "--config", &config, "--preset", "medium", "--seed", "7"]);
    assert_eq!(stdout(&mixed), text.replace("seed = 42", "seed = 7"));
}

#[test]
fn a_configuration_file_is_refused_by_key_and_line() {
    let folder = tempfile::tempdir().expect("folder");
    let config = path(folder.path(), "bake.toml");
    let refused = |text: &str, expected: i32, parts: &[&str]| {
        std::fs::write(&config, text).expect("written");
        assert_refused(&["bake", "--print-config", "--config", &config], expected, &[parts, &["bake.toml"]].concat());
    };
    refused("gather_ray = 3", 2, &["unknown option `gather_ray`", "did you mean `gather_rays`?"]);
    refused("gather-rays = 3", 2, &["did you mean `gather_rays`?"]);
    refused("gather_rays = 0", 2, &["gather_rays = 0", "1 to 1048576"]);
    refused("gather_rays = \"many\"", 2, &["`gather_rays`", "invalid type"]);
    refused("seed = 1\nleaf = = 2", 2, &["line 2"]);
    let missing = path(folder.path(), "none.toml");
    assert_refused(&["bake", "--print-config", "--config", &missing], 6, &["none.toml", "no such file"]);
    std::fs::write(&config, [0xff, 0xfe]).expect("written");
    assert_refused(&["bake", "--print-config", "--config", &config], 3, &["UTF-8"]);
}

#[test]
fn what_cannot_be_read_is_io_and_what_is_no_baked_file_is_invalid() {
    let folder = tempfile::tempdir().expect("folder");
    let at = |name: &str| path(folder.path(), name);
    let here = folder.path().to_str().expect("UTF-8");
    let picture = at("a.png");
    for arguments in [
        vec!["info", "none"],
        vec!["check", "none"],
        vec!["relight", "none", "--picture", &picture],
        vec!["bake", "none", "-o", &picture],
    ] {
        let missing = at("none");
        let arguments: Vec<&str> = arguments.iter().map(|&word| if word == "none" { &missing } else { word }).collect();
        assert_refused(&arguments, 6, &["none: cannot be read: no such file", "help: check the path"]);
    }
    assert_refused(&["info", here], 6, &["directory"]);
    for (name, content) in
        [("empty.lprt", &b""[..]), ("text.lprt", b"not a baked file at all, but long enough for one")]
    {
        std::fs::write(at(name), content).expect("written");
        assert_refused(&["info", &at(name)], 3, &[name, "help: "]);
        let checked = run(&["check", &at(name)]);
        assert_eq!(code(&checked), 3);
        assert!(stdout(&checked).starts_with("rule "), "{}", stdout(&checked));
        assert!(stderr(&checked).contains(name));
    }
    std::fs::write(at("text.glb"), "not a scene").expect("written");
    assert_refused(&["bake", &at("text.glb"), "-o", &at("a.lprt")], 3, &["text.glb", "help: "]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("list").count(), 3, "no output of failed commands");
}

#[test]
fn outputs_are_refused_before_the_work_begins() {
    let folder = tempfile::tempdir().expect("folder");
    let at = |name: &str| path(folder.path(), name);
    let bake = |output: &str| ["bake", "builtin:cornell", "-o", output].map(str::to_owned);
    let refused = |output: &str, expected: i32, parts: &[&str]| {
        let arguments = bake(output);
        assert_refused(&arguments.each_ref().map(String::as_str), expected, parts);
    };
    refused(&at("no/a.lprt"), 6, &["does not exist", "mkdir -p"]);
    refused(folder.path().to_str().expect("UTF-8"), 6, &["folder"]);
    refused(&at("a.glb"), 2, &["a baked file is not a .glb file", ".lprt"]);
    if cfg!(target_os = "linux") {
        refused("/dev/full", 6, &["/dev/full"]);
    }
    let scene = at("b.gltf");
    assert_eq!(code(&run(&["scene", "cornell", "-o", &scene])), 0);
    assert_refused(&["bake", &scene, "-o", &scene], 2, &["the baked file would overwrite the input", ".lprt"]);
    #[cfg(unix)]
    {
        for link in ["c.glb", "c.lightmap.glb"] {
            std::os::unix::fs::symlink(&scene, at(link)).expect("linked");
        }
        let parts = ["c.lightmap.glb: the scene with lightmap coordinates would overwrite the input", "help: "];
        assert_refused(&["bake", &scene, "-o", &at("c.lprt")], 2, &parts);
    }
    assert_refused(&["scene", "cornell", "-o", &at("no/a.glb")], 6, &["does not exist"]);
}

#[test]
fn unknown_built_in_scenes_are_answered_with_the_known_ones() {
    let folder = tempfile::tempdir().expect("folder");
    let output = path(folder.path(), "a.lprt");
    assert_refused(&["scene", "cornel", "-o", &output], 2, &["`cornel`", "cornell"]);
    assert_refused(&["bake", "builtin:cornel", "-o", &output], 2, &["`cornel`", "cornell"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error_and_a_closed_one_is_not() {
    let full = std::fs::File::options().write(true).open("/dev/full").expect("a full device");
    let output = command(&["bake", "--print-config"]).stdout(full).output().expect("the program starts");
    assert_eq!(code(&output), 6);
    assert!(stderr(&output).contains("no space left"), "{}", stderr(&output));

    for arguments in [&["bake", "--print-config"][..], &["--help"]] {
        let mut child = command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("ends");
        assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
    }
}

#[test]
fn the_machine_is_described_and_completions_and_manual_pages_are_written() {
    let found = stdout(&run(&["doctor"]));
    for part in ["version", "threads", "memory", "disk", "missing"] {
        assert!(found.contains(part), "{part}: {found}");
    }
    let found: serde_json::Value = serde_json::from_slice(&run(&["doctor", "--json"]).stdout).expect("JSON");
    assert!(found["threads"].as_u64() > Some(0) && found["adapters"].is_array() && found["missing"].is_array());

    assert!(stdout(&run(&["completions", "bash"])).contains("--gather-rays"));
    assert!(stdout(&run(&["completions", "fish"])).contains("gather-rays"));
    assert_refused(&["completions", "abacus"], 2, &["abacus"]);

    let folder = tempfile::tempdir().expect("folder");
    let pages = path(folder.path(), "man1");
    assert_eq!(code(&run(&["man", "-o", &pages])), 0);
    let page = std::fs::read_to_string(Path::new(&pages).join("precompute-bake.1")).expect("a page");
    assert!(page.contains(".TH precompute-bake 1") && page.contains("gather\\-rays"), "{page}");
    assert!(Path::new(&pages).join("precompute.1").exists());
}
