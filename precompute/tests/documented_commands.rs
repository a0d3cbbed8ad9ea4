//! Every `precompute` command line of the README, the guides and the help texts runs as it stands there, in their order, on
//! a small scene without lightmap coordinates. Options that make a command cheaper are appended; none is taken away but `--watch`,
//! with which a command does not end.
#![cfg(unix)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Instant;

const PROGRAM: &str = env!("CARGO_BIN_EXE_precompute");
const LEVELS: &str = r#"
[defaults]
receivers = 300
direct_map = 64
gather_rays = 16
relight_rays = 64
[[scene]]
scene = "hall.glb"
"#;
const LIGHTS: &str = r#"{
  "lights": [{"type": "point", "position": [0, 1.5, 0.3], "intensity": 3}],
  "sky": {"type": "gradient", "zenith": [0.4, 0.6, 1], "horizon": [0.7, 0.8, 0.9], "ground": [0.1, 0.1, 0.1]}
}"#;
/// What a command line has, and what is appended then, unless that option is there already.
const CHEAPER: [(&str, &str); 12] = [
    (" bake ", " --lightmap 64"),
    (" bake ", " --direct-map 128"),
    (" bake ", " --gather-rays 64"),
    (" bake ", " --relight-rays 512"),
    (" --picture ", " --size 64x48"),
    (" validate ", " --receivers 64"),
    (" validate ", " --paths 512"),
    (" validate ", " --width 24"),
    (" validate ", " --picture-paths 8"),
    (" validate ", " --flip-paths 16"),
    (" validate ", " --points 100"),
    (" validate ", " --bounces 1"),
];

/// Command lines of a text in Markdown: in fenced blocks, or indented by four spaces. A backslash at the end of a line
/// continues it.
fn commands_in_markdown(text: &str) -> Vec<String> {
    let mut fenced = false;
    let mut code = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if fenced || line.starts_with("    ") {
            code.push_str(line);
            code.push('\n');
        }
    }
    commands_in(&code)
}

fn commands_in(code: &str) -> Vec<String> {
    let code = code.replace("\\\n", " ");
    let lines = code.lines().map(|line| line.trim().trim_start_matches("$ "));
    let is_ours = |line: &&str| {
        let program = line.split_whitespace().next().unwrap_or_default();
        program == "precompute" || program.ends_with("/precompute")
    };
    lines.filter(is_ours).map(str::to_owned).collect()
}

/// The command line with what makes it cheaper, without its comment.
fn cheaper(line: &str) -> String {
    let line = line.split(" #").next().unwrap_or_default();
    let line = line.trim_end_matches(" --watch");
    let missing = |option: &str| option.split(' ').nth(1).is_some_and(|flag| !line.split(' ').any(|word| word == flag));
    let appended = CHEAPER.iter().filter(|(part, option)| line.contains(part) && missing(option));
    std::iter::once(line).chain(appended.map(|(_, option)| *option)).collect()
}

/// Runs a command line by the shell, where both ways to name the program lead to the one under test.
fn run(line: &str, folder: &Path) -> Output {
    let programs = folder.join("target/release");
    let path = std::env::var("PATH").unwrap_or_default();
    Command::new("sh")
        .args(["-c", line])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", programs.display()))
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .expect("a shell")
}

/// Exit code 0, that of files that differ, or a visible skip where there is no GPU.
#[track_caller]
fn assert_runs(line: &str, place: &str, folder: &Path) {
    // Buckets have a server in `scripts/test_bucket.sh`, shards a test of their own.
    if ["s3://", " plan ", "--plan"].iter().any(|part| line.contains(part)) {
        eprintln!("SKIPPED {line}: tested elsewhere");
        return;
    }
    let began = Instant::now();
    let output = run(&cheaper(line), folder);
    eprintln!("{:6.1} s  {line}", began.elapsed().as_secs_f64());
    let errors = String::from_utf8_lossy(&output.stderr);
    let no_gpu = output.status.code() == Some(5) && line.contains("--backend gpu") && errors.contains("GPU");
    if no_gpu && std::env::var_os("REQUIRE_GPU").is_none() {
        eprintln!("SKIPPED {line}: no GPU adapter");
        return;
    }
    let is_other = output.status.code() == Some(7) && line.contains(" diff ");
    assert!(output.status.success() || is_other, "{place}: {line}\n{}: {errors}", output.status);
}

/// The README first: what follows uses the files that it makes.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut guides: Vec<PathBuf> =
        fs::read_dir(root.join("docs")).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    guides.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    guides.sort();
    let named = ["README.md", "ARCHITECTURE.md", "runtime/README.md", "runtime/viewer/README.md", "scenes/README.md"];
    named.iter().chain(&["scripts/README.md", "formats/SPEC.md"]).map(|name| root.join(name)).chain(guides).collect()
}

#[test]
fn every_documented_command_line_runs_as_it_stands() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    fs::create_dir_all(folder.join("target/release")).expect("made");
    std::os::unix::fs::symlink(PROGRAM, folder.join("target/release/precompute")).expect("linked");
    for name in ["evening.json", "noon.json"] {
        fs::write(folder.join(name), LIGHTS).expect("written");
    }
    let written = run("precompute scene cornell -o hall.glb", folder);
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let scene = fs::read(folder.join("hall.glb")).expect("a scene");
    fs::write(folder.join("levels.toml"), LEVELS).expect("written");
    assert_runs("precompute bake hall.glb -o before.lprt", "here", folder);

    // The help texts repeat some of the README's lines, and one run of each is enough.
    let mut done = BTreeSet::new();
    let mut run_all = |commands: &[String], place: &str| {
        for line in commands {
            if done.insert(line.trim_start_matches("target/release/").to_owned()) {
                assert_runs(line, place, folder);
            }
        }
    };
    for (index, path) in documents().iter().enumerate() {
        let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let commands = commands_in_markdown(&text);
        assert!(index > 0 || !commands.is_empty(), "no command in {}", path.display());
        run_all(&commands, &path.display().to_string());
    }
    for subcommand in ["", "bake", "relight", "validate", "batch"] {
        let help = format!("precompute {subcommand} --help");
        let text = String::from_utf8(run(&help, folder).stdout).expect("UTF-8");
        let commands = commands_in(text.split("Usage:").next().unwrap_or_default());
        assert!(!commands.is_empty(), "no command in {help}");
        run_all(&commands, &help);
    }
    assert!(folder.join("hall.lightmap.glb").exists(), "the scene had to be unwrapped");
    assert_eq!(fs::read(folder.join("hall.glb")).expect("a scene"), scene, "the input stays as it was");
}

#[test]
fn command_lines_are_found_in_code_and_nowhere_else() {
    let text = "\
`precompute info a.lprt` says it, and\nprecompute is a word here.\n
    cargo build --release
    target/release/precompute bake a.glb \\
        -o a.lprt

```sh
$ precompute check a.lprt
viewer a.lprt
```
precompute info b.lprt
";
    assert_eq!(
        commands_in_markdown(text),
        ["target/release/precompute bake a.glb          -o a.lprt", "precompute check a.lprt"]
    );
    assert_eq!(
        cheaper("precompute relight a.lprt --picture a.png # look"),
        "precompute relight a.lprt --picture a.png --size 64x48"
    );
    assert_eq!(cheaper("precompute relight a.lprt -o a.exr"), "precompute relight a.lprt -o a.exr");
    let given = "precompute bake a.glb --lightmap 32 --gather-rays 8 --direct-map 32 --relight-rays 9";
    assert_eq!(cheaper(given), given);
}

#[test]
#[should_panic(expected = "unexpected argument")]
fn a_command_line_that_fails_is_noticed() {
    let folder = tempfile::tempdir().expect("folder");
    assert_runs(&format!("{PROGRAM} info hall.lprt --jsn"), "here", folder.path());
}
