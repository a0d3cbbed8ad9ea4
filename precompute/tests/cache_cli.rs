//! Bakes that go on where others stopped, from outside: what is used again, what a cache may do, and what kills leave behind.

use serde_json::Value;
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread::sleep,
    time::Duration,
};

/// A bake of many small leaves, of a layout that is the same however often it was baked before.
const SMALL: [&str; 15] = [
    "--new-layout",
    "--receivers",
    "1500",
    "--direct-map",
    "128",
    "--relight-rays",
    "128",
    "--probe-degree",
    "3",
    "--probes",
    "20",
    "--leaf",
    "64",
    "--report",
    "-",
];

fn command(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_precompute"));
    command.args(more).current_dir(folder).stdin(Stdio::null()).env("NO_COLOR", "1");
    command
}

fn bake_command(folder: &Path, more: &[&str]) -> Command {
    let few: &[&str] = if more.contains(&"--gather-rays") { &[] } else { &["--gather-rays", "64"] };
    command(folder, &[&["bake", "builtin:cornell", "-o", "a.lprt"], &SMALL[..], few, more].concat())
}

#[track_caller]
fn done(mut command: Command) -> Output {
    let output = command.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Leaves that were used again, and those that were made.
#[track_caller]
fn bake(folder: &Path, more: &[&str]) -> [u64; 2] {
    let report: Value = serde_json::from_slice(&done(bake_command(folder, more)).stdout).expect("JSON");
    ["reused", "baked"].map(|name| report["cache"][name].as_u64().unwrap_or_default())
}

fn files(folder: &Path) -> [Vec<u8>; 2] {
    ["a.lprt", "a.glb"].map(|name| fs::read(folder.join(name)).expect("there"))
}

/// What a bake without a cache writes.
fn clean(more: &[&str]) -> [Vec<u8>; 2] {
    let folder = tempfile::tempdir().expect("folder");
    bake(folder.path(), &[&["--no-cache"], more].concat());
    assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 2, "nothing is kept");
    files(folder.path())
}

/// Files below a folder, by path.
fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { below(&path) } else { vec![path] }).collect();
    files.sort();
    files
}

#[test]
fn a_bake_is_up_to_date_until_something_changes() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let [none, all] = bake(folder, &[]);
    assert!(none == 0 && all > 20, "{all}");
    let expected = clean(&[]);
    assert!(files(folder) == expected);
    let again = done(bake_command(folder, &[]));
    assert!(String::from_utf8_lossy(&again.stderr).contains("a.lprt is up to date"));
    assert_eq!(bake(folder, &[]), [all, 0]);
    assert!(files(folder) == expected);

    // Whoever loses or damages a file gets it back.
    for name in ["a.lprt", "a.glb"] {
        fs::write(folder.join(name), "something else").expect("written");
        assert_eq!(bake(folder, &[]), [all, 0]);
        assert!(files(folder) == expected);
    }
    // Options that leaves depend on, and one that they do not.
    let explained = done(bake_command(folder, &["--threshold", "0.02", "--explain"]));
    let told = String::from_utf8_lossy(&explained.stderr).matches("options or code are new").count();
    assert_eq!(told as u64, all);
    assert!(files(folder) == clean(&["--threshold", "0.02"]));
    assert_eq!(bake(folder, &["--max-unseen", "0.9"]), [all, 0]);
    assert!(files(folder) == clean(&["--max-unseen", "0.9"]));

    let facts = |more: &[&str]| -> Value {
        let arguments = [&["cache", ".localprt-cache", "--json"], more].concat();
        serde_json::from_slice(&done(command(folder, &arguments)).stdout).expect("JSON")
    };
    let whole = facts(&["--verify"]);
    // By two thresholds: cells and a leaf of each key; and the layout, and the bakes.
    assert!(whole["records"].as_u64() > Some(2 * all) && whole["damaged"] == 0, "{whole}");
    let left = facts(&["--trim", "100000"]);
    assert!(left["bytes"].as_u64() <= Some(100_000) && left["trimmed_bytes"].as_u64() > Some(0), "{left}");
    fs::remove_file(folder.join("a.lprt")).expect("removed");
    bake(folder, &[]);
    assert!(files(folder) == expected);
}

#[test]
fn a_cache_is_where_it_is_asked_for_and_only_read_if_asked() {
    let [first, second] = [(); 2].map(|()| tempfile::tempdir().expect("folder"));
    let shared = first.path().join("kept/here");
    let place = shared.to_str().expect("UTF-8");
    let [_, all] = bake(first.path(), &["--cache", place]);
    let before = below(&shared);
    assert!(before.len() as u64 > all && !first.path().join(".localprt-cache").exists());
    assert_eq!(bake(second.path(), &["--cache", place, "--cache-read"]), [all, 0]);
    assert!(files(first.path()) == files(second.path()));
    assert!(bake(second.path(), &["--cache", place, "--cache-read", "--threshold", "0.02"])[1] > 0);
    assert_eq!(below(&shared), before, "nothing was written");
    // No more than it may have.
    bake(second.path(), &["--cache", place, "--cache-limit", "50000", "--threshold", "0.02"]);
    let bytes: u64 = below(&shared).iter().map(|path| fs::metadata(path).expect("there").len()).sum();
    assert!(bytes < 51_000, "{bytes}");

    fs::write(first.path().join("file"), "").expect("written");
    let refused = bake_command(first.path(), &["--cache", "file/cache"]).output().expect("the program starts");
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(6) && message.contains("file/cache") && message.contains("help: "),
        "{message}"
    );
    let both = bake_command(first.path(), &["--cache", "x", "--no-cache"]).output().expect("the program starts");
    assert_eq!(both.status.code(), Some(2));
    let nowhere = command(first.path(), &["cache", "nowhere"]).output().expect("the program starts");
    assert_eq!(nowhere.status.code(), Some(6));
}

#[test]
fn an_address_is_a_bucket_or_refused_and_never_a_folder() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let refused = |arguments: &[&str]| {
        let mut command = command(folder, arguments);
        // A port that nobody listens on, in builds that know buckets.
        command.env("AWS_ENDPOINT", "http://127.0.0.1:9").env("AWS_ALLOW_HTTP", "true");
        command.env("AWS_ACCESS_KEY_ID", "name").env("AWS_SECRET_ACCESS_KEY", "never-told");
        let output = command.output().expect("the program starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let [code, words] = if cfg!(feature = "bucket") { ["6", "s3://bakes/hall: "] } else { ["2", "--features bucket"] };
    for arguments in
        [&["bake", "builtin:cornell", "-o", "a.lprt", "--cache", "s3://bakes/hall"][..], &["cache", "s3://bakes/hall"]]
    {
        let (found, message) = refused(arguments);
        assert!(found.map(|found| found.to_string()).as_deref() == Some(code) && message.contains(words), "{message}");
        assert!(!message.contains("never-told"), "{message}");
    }
    for address in ["s3:/bakes", "ftp://bakes", "s3://"] {
        let (found, message) = refused(&["bake", "builtin:cornell", "-o", "a.lprt", "--cache", address]);
        assert!(found == Some(2) && message.contains(address), "{message}");
    }
    assert_eq!(fs::read_dir(folder).expect("list").count(), 0, "nothing is left behind");
}

#[test]
fn after_kills_the_next_bake_goes_on_and_the_file_is_the_same() {
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path();
    let long = ["--gather-rays", "4096"];
    let expected = clean(&long);
    fs::write(folder.join("a.lprt"), "old").expect("written");
    let kept = || {
        let is_leaf = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "leaf");
        below(folder).iter().filter(|path| is_leaf(path)).count()
    };
    for attempt in 0..6 {
        let before = kept();
        let mut child =
            bake_command(folder, &long).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
        // Before any leaf, and after some more each time.
        sleep(Duration::from_millis(100));
        while attempt > 0 && kept() < before + attempt && child.try_wait().expect("asked").is_none() {
            sleep(Duration::from_millis(5));
        }
        child.kill().expect("killed, or at its end");
        let is_done = child.wait().expect("ends").success();
        let found = fs::read(folder.join("a.lprt")).expect("there");
        assert!(found == expected[0] || !is_done && found == b"old");
    }
    let at_least = kept() as u64;
    let [reused, _] = bake(folder, &long);
    assert!(at_least >= 10 && reused >= at_least, "{reused} of {at_least}: what was finished is not made again");
    assert!(files(folder) == expected);
}
