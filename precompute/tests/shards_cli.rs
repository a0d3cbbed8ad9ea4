//! Bakes in shards, from outside: any number of shards, in any order, killed or not, gives the file of a bake in one piece.

use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    thread::sleep,
    time::Duration,
};

/// A bake of many small leaves, with a volume.
const SMALL: &str =
    "--receivers 1500 --direct-map 128 --relight-rays 128 --probe-degree 3 --probes 20 --leaf 64 --volume 0.3";

fn command(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_precompute"));
    command.args(line.split_whitespace()).current_dir(folder).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

#[track_caller]
fn run(folder: &Path, line: &str, code: i32) -> Output {
    let output = command(folder, line).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(code), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn files(folder: &Path, name: &str) -> [Vec<u8>; 2] {
    ["lprt", "glb"].map(|kind| fs::read(folder.join(format!("{name}.{kind}"))).expect("there"))
}

/// What a bake in one piece writes under a name, which the file knows.
fn whole(folder: &Path, name: &str, gather_rays: u32) -> [Vec<u8>; 2] {
    let inner = folder.join("whole");
    fs::create_dir(&inner).expect("is new");
    let line = format!("bake builtin:cornell -o {name}.lprt --no-cache --gather-rays {gather_rays} {SMALL}");
    run(&inner, &line, 0);
    files(&inner, name)
}

#[track_caller]
fn shard(folder: &Path, plan: &str, number: usize) -> [u64; 2] {
    let output = run(folder, &format!("bake --plan {plan} --shard {number} --report -"), 0);
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    ["reused", "baked"].map(|name| report[name].as_u64().expect("a number"))
}

#[test]
fn shards_of_any_number_make_the_file_of_one_bake() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let whole = whole(folder, "out", 64);
    for n_shards in [1, 4, 16] {
        let plan = format!("{n_shards}.plan");
        run(folder, &format!("plan builtin:cornell -o {plan} --shards {n_shards} --gather-rays 64 {SMALL}"), 0);
        let output = run(folder, &format!("merge --plan {plan} -o out.lprt"), 4);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(text.contains(&format!("{n_shards} of {n_shards} shards are not baked: 0")), "{text}");
        assert!(!folder.join("out.lprt").exists());
        // The last one first.
        let made: u64 = (0..n_shards).rev().map(|number| shard(folder, &plan, number)[1]).sum();
        let [reused, baked] = shard(folder, &plan, 0);
        assert!(made > 30 && reused > 0 && baked == 0, "{made} {reused} {baked}");
        run(folder, &format!("merge --plan {plan} -o out.lprt"), 0);
        assert!(files(folder, "out") == whole, "{n_shards} shards");
        fs::remove_file(folder.join("out.lprt")).expect("there");
    }
}

#[test]
fn a_killed_shard_goes_on_and_one_that_is_missing_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    run(folder, &format!("plan builtin:cornell -o a.plan --shards 3 --gather-rays 1024 {SMALL}"), 0);
    for number in [0, 1] {
        let mut child = command(folder, &format!("bake --plan a.plan --shard {number} --threads 1"))
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        sleep(Duration::from_millis(700));
        child.kill().expect("is killed or done");
        child.wait().expect("ends");
        shard(folder, "a.plan", number);
    }
    let text = String::from_utf8_lossy(&run(folder, "merge --plan a.plan -o a.lprt", 4).stderr).into_owned();
    assert!(text.contains("1 of 3 shards are not baked: 2 "), "{text}");
    shard(folder, "a.plan", 2);
    run(folder, "merge --plan a.plan -o a.lprt", 0);
    assert!(files(folder, "a") == whole(folder, "a", 1024));
}

#[test]
fn what_does_not_fit_a_plan_is_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    run(folder, "scene cornell -o box.glb", 0);
    run(folder, &format!("plan box.glb -o a.plan --shards 2 --gather-rays 16 {SMALL}"), 0);
    run(folder, "bake --plan a.plan --shard 2", 2);
    run(folder, "bake --plan a.plan --shard 0 --probes 9", 2);
    run(folder, "bake --plan a.plan", 2);
    run(folder, "bake box.glb -o b.lprt --shard 0", 2);
    run(folder, "plan box.glb -o b.plan --shards 0", 2);
    run(folder, "merge --plan none.plan -o b.lprt", 6);
    run(folder, "scene two-rooms -o box.glb", 0);
    let text = String::from_utf8_lossy(&run(folder, "bake --plan a.plan --shard 0", 3).stderr).into_owned();
    assert!(text.contains("another than when the bake was planned"), "{text}");
    fs::write(folder.join("a.plan"), "{}").expect("writes");
    run(folder, "bake --plan a.plan --shard 0", 3);
}
