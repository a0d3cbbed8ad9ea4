//! Names the code that results depend on: a change to any source of the baker, or to what it is built from, is a new name.

use std::{
    collections::hash_map::DefaultHasher,
    env, fs,
    hash::{Hash, Hasher},
    path::{Path, PathBuf},
    process::Command,
};

/// Beside this crate. One that is built from a registry finds none but its own: there its version names the others, which it
/// takes by exactly that version.
const SOURCES: [&str; 12] = [
    "src",
    "Cargo.toml",
    "../formats/src",
    "../scenes/src",
    "../scenes/surfaces/src",
    "../scenes/tools/src",
    "../Cargo.lock",
    "../Cargo.toml",
    "../formats/Cargo.toml",
    "../scenes/Cargo.toml",
    "../scenes/surfaces/Cargo.toml",
    "../scenes/tools/Cargo.toml",
];

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut code = DefaultHasher::new();
    env!("CARGO_PKG_VERSION").hash(&mut code);
    env::var_os("TARGET").hash(&mut code);
    // Cargo would run this again at every build for one that is not there.
    for source in SOURCES.map(|source| root.join(source)).into_iter().filter(|source| source.exists()) {
        println!("cargo::rerun-if-changed={}", source.display());
        take_in(&source, &mut code);
    }
    let compiler = env::var_os("RUSTC").and_then(|rustc| Command::new(rustc).arg("-V").output().ok());
    compiler.map(|output| output.stdout).hash(&mut code);
    println!("cargo::rustc-env=LOCALPRT_CODE={:016x}", code.finish());
}

fn take_in(path: &Path, code: &mut DefaultHasher) {
    if let Ok(entries) = fs::read_dir(path) {
        let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        paths.sort();
        paths.iter().for_each(|path| take_in(path, code));
    } else if let Ok(text) = fs::read(path) {
        (path.file_name(), text).hash(code);
    }
}
