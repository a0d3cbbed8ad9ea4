//! A small bake on disk, and the viewer run on it.

use localprt_precompute::{pipeline::bake, progress::Progress, settings::BakeSettings};
use localprt_scenes::{Scene, builtin};
use std::path::Path;
use std::process::{Command, Stdio};

/// The Cornell box in a folder of its own.
pub struct SmallBake {
    folder: tempfile::TempDir,
    scene: Scene,
}

impl SmallBake {
    /// Bakes it; `None`, with a line that says so, without an adapter.
    pub fn new(test: &str) -> Option<Self> {
        if let Err(error) = pollster::block_on(localprt_runtime::gpu::headless()) {
            assert!(std::env::var_os("REQUIRE_GPU").is_none(), "{test}: {error}");
            eprintln!("SKIPPED {test}: {error}");
            return None;
        }
        let folder = tempfile::tempdir().expect("folder");
        write_bake(folder.path(), 12);
        let scene = localprt_scenes::load(folder.path().join("cornell.glb")).expect("reads");
        Some(Self { folder, scene })
    }

    /// Another bake in the place of the first.
    #[allow(dead_code, reason = "not every test that has a small bake")]
    pub fn bake_again(&self, probes: u32) {
        write_bake(self.folder(), probes);
    }

    /// Where everything lies.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Name of the baked file in that folder.
    pub fn file(&self) -> &'static str {
        "cornell.lprt"
    }

    /// The scene as it was written.
    #[allow(dead_code, reason = "not every test that has a small bake")]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }
}

fn write_bake(folder: &Path, probes: u32) {
    let settings = BakeSettings {
        probes: Some(probes),
        lightmap: Some(40),
        direct_map: 64,
        gather_rays: 128,
        relight_rays: 1000,
        receiver_degree: 1,
        ..BakeSettings::default()
    };
    let progress = Progress::silent();
    let baked = bake(builtin::scene("cornell").expect("a built-in scene"), &settings, &progress).expect("bakes");
    baked.write(&folder.join("cornell.lprt"), &folder.join("cornell.glb"), None, &progress).expect("written");
}

/// The viewer, in this folder.
pub fn viewer(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewer"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

/// A picture without a window, three bytes a pixel.
pub fn headless(baked: &SmallBake, name: &str, look: &[&str]) -> Vec<u8> {
    let arguments = [&[baked.file(), "--headless", "--screenshot", name], look].concat();
    let output = viewer(baked.folder(), &arguments).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    png(&baked.folder().join(name))
}

/// A picture's bytes, three a pixel.
pub fn png(path: &Path) -> Vec<u8> {
    image::open(path).expect("a picture").to_rgb8().into_raw()
}
