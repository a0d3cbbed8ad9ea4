//! `precompute batch` from outside: what is baked, what is up to date, what one broken scene does to the others, and what watching
//! notices.

use serde_json::Value;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Options of a bake in tenths of a second, and of a validation likewise.
const SMALL: &str = r#"
[defaults]
receivers = 400
probes = 8
gather_rays = 16
relight_rays = 64
direct_map = 64
probe_degree = 3
output = "out"
[defaults.validate]
receivers = 40
paths = 512
points = 40
width = 24
picture_paths = 8
flip_paths = 16
bounces = 1
"#;

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_precompute"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

fn write_list(folder: &Path, scenes: &str) {
    fs::write(folder.join("levels.toml"), format!("{SMALL}{scenes}")).expect("written");
}

/// Runs the list and returns `batch.json`.
#[track_caller]
fn batch(folder: &Path, expected: i32, more: &[&str]) -> (Value, Output) {
    let output = run(folder, &[&["batch", "levels.toml"], more].concat());
    assert_eq!(output.status.code(), Some(expected), "{}", text(&output.stderr));
    (summary(folder).expect("batch.json"), output)
}

fn summary(folder: &Path) -> Option<Value> {
    serde_json::from_slice(&fs::read(folder.join("out/batch.json")).ok()?).ok()
}

#[test]
fn scenes_are_done_with_their_own_options_and_are_up_to_date_then() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    fs::write(folder.join("lamp.json"), r#"{"lights":[{"type":"point","position":[0,1.2,0.4],"intensity":3}]}"#)
        .expect("written");
    write_list(
        folder,
        "[[scene]]\nscene = 'builtin:cornell'\nlights = 'lamp.json'\nvalidate = { max_nrmse = 1000 }\n\
         [[scene]]\nname = 'box'\nscene = 'builtin:furnace'\nprobes = 4\nvalidate = false\n",
    );
    let (json, output) = batch(folder, 0, &["--jobs", "2", "--threads", "2"]);
    let scenes = json["scenes"].as_array().expect("scenes");
    let keys: Vec<&str> = scenes[0].as_object().expect("an object").keys().map(String::as_str).collect();
    let documented = "name scene output state up_to_date exit_code seconds peak_rss_bytes bytes receivers probes clusters \
        unseen cache warnings validation log report";
    assert_eq!(keys.join(" "), documented);
    assert_eq!((&scenes[0]["state"], &scenes[0]["output"]), (&"baked".into(), &"out/cornell.lprt".into()));
    assert!(scenes[0]["probes"].as_u64() > scenes[1]["probes"].as_u64(), "{json:#}");
    assert!(scenes[0]["cache"]["baked"].as_u64() > Some(0) && scenes[0]["seconds"].as_f64() > Some(0.0));
    let figures = &scenes[0]["validation"]["figures"];
    assert_eq!(figures["nrmse"]["allowed"], 1000.0);
    assert!(figures["nrmse"]["found"].as_f64() > Some(0.0) && figures["leak"]["allowed"].is_null(), "{figures}");
    assert!(scenes[1].get("validation").is_none());
    // One table, one line a scene elsewhere, one page over all.
    let table = text(&output.stdout);
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(table.lines().nth(2).is_some_and(|row| row.starts_with("box")), "{table}");
    let lines = text(&output.stderr);
    assert!(lines.contains("[1/2] ") && lines.contains("[2/2] ") && lines.lines().count() == 3, "{lines}");
    let page = fs::read_to_string(folder.join("out/index.html")).expect("a page");
    assert!(page.contains("href=\"./cornell-quality/index.html\""));
    for name in ["cornell.lprt", "cornell.glb", "cornell.log", "cornell.report.json", "cornell-quality/index.html"] {
        assert!(folder.join("out").join(name).is_file(), "{name}");
    }
    assert!(fs::read_to_string(folder.join("out/cornell.log")).expect("a log").contains("$ precompute bake"));
    // What it wrote does the same by itself.
    let options = fs::read_to_string(folder.join("out/box.options.toml")).expect("options");
    assert!(options.contains("probes = 4\n"), "{options}");

    // From elsewhere: the list says where its paths start.
    let list = folder.join("levels.toml");
    let elsewhere = tempfile::tempdir().expect("folder");
    let again = run(elsewhere.path(), &["batch", list.to_str().expect("UTF-8")]);
    assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
    let json = summary(folder).expect("batch.json");
    for scene in json["scenes"].as_array().expect("scenes") {
        assert_eq!((&scene["state"], &scene["up_to_date"]), (&"up_to_date".into(), &true.into()), "{json:#}");
    }
    assert_eq!(json["scenes"][0]["validation"]["figures"], *figures, "as it was measured");

    // Another light is another validation, and no other bake.
    fs::write(folder.join("lamp.json"), r#"{"lights":[{"type":"point","position":[0,1.5,0.4],"intensity":3}]}"#)
        .expect("written");
    let (json, _) = batch(folder, 0, &[]);
    let cornell = &json["scenes"][0];
    assert_eq!((&cornell["state"], &cornell["up_to_date"]), (&"up_to_date".into(), &false.into()));
    assert_eq!(cornell["validation"]["up_to_date"], false);
    assert_ne!(cornell["validation"]["figures"]["nrmse"]["found"], figures["nrmse"]["found"]);
}

#[test]
fn a_broken_scene_and_a_missed_limit_stop_nobody_and_the_worst_exit_code_is_the_batchs() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    fs::write(folder.join("broken.glb"), "not a scene").expect("written");
    let cornell = "[[scene]]\nscene = 'builtin:cornell'\nvalidate = { max_nrmse = 0.00001 }\n";
    write_list(folder, cornell);
    let (json, output) = batch(folder, 7, &[]);
    assert_eq!((&json["exit_code"], &json["scenes"][0]["exit_code"]), (&7.into(), &7.into()));
    let table = text(&output.stdout);
    assert!(table.contains("cornell: out/cornell.lprt: nrmse under the scene's own light is"), "{table}");
    assert!(table.contains("  help: out/cornell-quality/index.html shows where"), "{table}");
    assert!(text(&output.stderr).contains("1 of 1 scenes missed a limit"));

    write_list(folder, &format!("[[scene]]\nscene = 'broken.glb'\n{cornell}"));
    let (json, output) = batch(folder, 3, &[]);
    let scenes = &json["scenes"];
    assert_eq!((&scenes[0]["state"], &scenes[0]["exit_code"]), (&"failed".into(), &3.into()));
    let error = &scenes[0]["error"];
    assert!(error["what"].as_str().is_some_and(|what| what.starts_with("broken.glb: ")), "{error}");
    assert!(error["help"].is_string(), "{error}");
    assert!(scenes[0].get("bytes").is_none());
    // The other one is as it was, its limit is still missed, and it was not measured again.
    assert_eq!((&scenes[1]["state"], &scenes[1]["exit_code"]), (&"up_to_date".into(), &7.into()));
    assert_eq!(scenes[1]["validation"]["up_to_date"], true);
    assert!(text(&output.stdout).contains("cornell: out/cornell.lprt: nrmse"), "{}", text(&output.stdout));
    assert!(text(&output.stderr).contains("2 of 2 scenes failed"), "{}", text(&output.stderr));
}

#[test]
fn a_list_with_a_mistake_is_refused_before_any_work() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    for (scenes, expected) in [
        ("[[scene]]\nscene = 'builtin:cornell'\nrecievers = 5\n", "did you mean `receivers`?"),
        ("[[scene]]\nscene = 'a/x.glb'\n[[scene]]\nscene = 'b/x.glb'\n", "is also an output of scene `x`"),
        ("[[scene]]\nscene = 'a.glb'\nvalidate = { max_leek = 1 }\n", "did you mean `max_leak`?"),
    ] {
        write_list(folder, scenes);
        let output = run(folder, &["batch", "levels.toml"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: levels.toml: scene `") && said.contains(expected), "{said}");
        assert!(!folder.join("out").exists() && output.stdout.is_empty());
    }
    assert_eq!(run(folder, &["batch", "none.toml"]).status.code(), Some(6));
}

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[track_caller]
fn wait_for(what: &str, mut is_there: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_there() {
        assert!(started.elapsed() < Duration::from_secs(20), "{what}");
        sleep(Duration::from_millis(20));
    }
}

#[cfg(unix)]
fn terminate(child: &Child) {
    let status = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
    assert!(status.expect("a kill command").success());
}

#[cfg(unix)]
#[test]
fn watching_bakes_what_changes_and_ends_when_asked() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    for (scene, name) in [("cornell", "a.glb"), ("furnace", "b.glb")] {
        assert!(run(folder, &["scene", scene, "-o", name]).status.success());
    }
    let list = "[[scene]]\nscene = 'a.glb'\nvalidate = false\n[[scene]]\nscene = 'b.glb'\nvalidate = false\n";
    write_list(folder, list);
    let mut child = command(folder, &["batch", "levels.toml", "--watch"]);
    let child = child.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
    let mut child = Running(child);
    let state = |index: usize| summary(folder).map(|json| json["scenes"][index]["state"].clone());
    wait_for("both are baked", || state(1).is_some_and(|state| state == "baked"));
    let changed = |name: &str| fs::metadata(folder.join("out").join(name)).and_then(|data| data.modified()).ok();
    let (a, b) = (changed("a.lprt"), changed("b.lprt"));

    // The other scene in its place; whoever writes it takes a moment.
    let bytes = fs::read(folder.join("b.glb")).expect("a scene");
    fs::write(folder.join("a.glb"), &bytes[..bytes.len() / 2]).expect("written");
    fs::write(folder.join("a.glb"), &bytes).expect("written");
    wait_for("a is baked again", || changed("a.lprt") != a);
    assert_eq!(changed("b.lprt"), b, "b is as it was");

    // A mistake in the list is told, and the list as it was goes on; then one with another option.
    write_list(folder, "[[scene]]\nscnee = 'a.glb'\n");
    sleep(Duration::from_millis(1200));
    assert!(child.0.try_wait().expect("a process").is_none(), "it goes on");
    write_list(folder, &format!("{list}probes = 4\n"));
    wait_for("b is baked with the list's new options", || changed("b.lprt") != b);

    terminate(&child.0);
    assert_eq!(child.0.wait().expect("ends").code(), Some(130));
}

#[cfg(unix)]
#[test]
fn a_batch_that_is_stopped_stops_its_commands_and_says_what_is_done() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    write_list(
        folder,
        "[[scene]]\nscene = 'builtin:cornell'\ngather_rays = 20000\nleaf = 16\nvalidate = false\n\
         [[scene]]\nscene = 'builtin:furnace'\nvalidate = false\n",
    );
    let mut child = command(folder, &["batch", "levels.toml"]);
    let mut child = Running(child.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts"));
    wait_for("it bakes", || {
        let log = fs::read_to_string(folder.join("out/cornell.log")).unwrap_or_default();
        log.lines().any(|line| line.contains("transport"))
    });
    terminate(&child.0);
    let mut said = String::new();
    child.0.stderr.take().expect("piped").read_to_string(&mut said).expect("text");
    assert_eq!(child.0.wait().expect("ends").code(), Some(130), "{said}");
    assert!(said.contains("interrupted; 0 of 2 scenes are baked"), "{said}");
    let json = summary(folder).expect("batch.json");
    assert_eq!((&json["scenes"][0]["exit_code"], &json["scenes"][1]["state"]), (&130.into(), &"not_run".into()));
    assert!(!folder.join("out/cornell.lprt").exists());
    let log = fs::read_to_string(folder.join("out/cornell.log")).expect("a log");
    assert!(log.contains("stopping"), "it was asked: {log}");
}
