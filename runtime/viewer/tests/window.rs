//! The window on a virtual display: it shows what a headless picture shows, and a dragged light moves the light.

mod small_bake;

use glam::Vec3;
use localprt_scenes::{Lighting, Scene};
use localprt_viewer::Viewpoint;
use small_bake::{SmallBake, headless, png, viewer};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const SIZE: (u32, u32) = (320, 240);
/// Frames of a window on a software adapter take tenths of a second.
const PATIENCE: Duration = Duration::from_secs(60);
/// Columns and rows of the legend that a window paints over the map of clusters and a picture without a window has not.
const LEGEND: [std::ops::Range<usize>; 2] = [8..296, 8..54];

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A virtual display.
struct Display {
    number: u32,
    screen: PathBuf,
    _server: Running,
    _folder: tempfile::TempDir,
}

impl Display {
    /// `None`, with a line that says so, where there is none to be had.
    fn start(test: &str) -> Option<Self> {
        let is_there = |program: &str| Command::new(program).arg("-help").output().is_ok();
        if !is_there("Xvfb") || !is_there("xdotool") {
            assert!(std::env::var_os("REQUIRE_WINDOW").is_none(), "{test}: Xvfb or xdotool is missing");
            eprintln!("SKIPPED {test}: Xvfb or xdotool is missing (scripts/setup.sh installs them)");
            return None;
        }
        let folder = tempfile::tempdir().expect("folder");
        let (width, height) = SIZE;
        // Tests of one process start at the same time.
        static NEXT: AtomicU32 = AtomicU32::new(0);
        loop {
            let number = 100 + (std::process::id() * 7 + NEXT.fetch_add(1, Ordering::Relaxed)) % 900;
            let socket = PathBuf::from(format!("/tmp/.X11-unix/X{number}"));
            if socket.exists() {
                continue;
            }
            let server = Command::new("Xvfb")
                .args([&format!(":{number}"), "-screen", "0", &format!("{width}x{height}x24"), "-nolisten", "tcp"])
                .arg("-fbdir")
                .arg(folder.path())
                .stderr(Stdio::null())
                .spawn()
                .expect("starts");
            let mut server = Running(server);
            let screen = folder.path().join("Xvfb_screen0");
            let mut has_ended = || server.0.try_wait().expect("a process").is_some();
            // Somebody else may have taken the number meanwhile.
            let is_there = wait_for(|| has_ended() || socket.exists() && screen.exists()) && !has_ended();
            if is_there {
                return Some(Self { number, screen, _server: server, _folder: folder });
            }
            assert!(NEXT.load(Ordering::Relaxed) < 50, "{test}: no display could be started");
        }
    }

    fn viewer(&self, folder: &Path, arguments: &[&str]) -> Running {
        self.viewer_with(folder, arguments, Stdio::inherit())
    }

    fn viewer_with(&self, folder: &Path, arguments: &[&str], stderr: Stdio) -> Running {
        let mut command = viewer(folder, arguments);
        command.stderr(stderr);
        command.env("DISPLAY", format!(":{}", self.number)).env_remove("WAYLAND_DISPLAY");
        Running(command.spawn().expect("starts"))
    }

    fn mouse(&self, actions: &str) {
        let display = format!(":{}", self.number);
        let status = Command::new("xdotool").args(actions.split(' ')).env("DISPLAY", display).status();
        assert!(status.expect("runs").success(), "xdotool {actions}");
    }

    /// What is on the screen, three bytes a pixel, top row first: the server keeps it in a file of the format XWD.
    fn pixels(&self) -> Vec<u8> {
        let bytes = fs::read(&self.screen).expect("a screen");
        let field = |index: usize| {
            let start = 4 * index;
            u32::from_be_bytes([bytes[start], bytes[start + 1], bytes[start + 2], bytes[start + 3]]) as usize
        };
        let (header, width, height, row, n_colors) = (field(0), field(4), field(5), field(12), field(19));
        assert_eq!((width, height, field(11)), (SIZE.0 as usize, SIZE.1 as usize, 32), "of this size, 32 bits a pixel");
        let start = header + 12 * n_colors;
        (0..width * height)
            .flat_map(|pixel| {
                let at = start + pixel / width * row + pixel % width * 4;
                [bytes[at + 2], bytes[at + 1], bytes[at]]
            })
            .collect()
    }

    /// The screen once it shows something that `is_wanted`; the last one after a while.
    fn screen_when(&self, is_wanted: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        wait_for(|| is_wanted(&self.pixels()));
        self.pixels()
    }
}

fn wait_for(mut is_done: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if is_done() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    false
}

/// Pixels that differ in any band.
fn n_different(a: &[u8], b: &[u8]) -> usize {
    a.chunks_exact(3).zip(b.chunks_exact(3)).filter(|(a, b)| a != b).count()
}

/// Mean over all bytes.
fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs()).sum();
    sum / a.len() as f64
}

/// The same within the legend, and beside it.
fn different_by_legend(a: &[u8], b: &[u8]) -> [usize; 2] {
    let [columns, rows] = LEGEND;
    let legend = |pixels: &[u8]| -> Vec<u8> {
        let rows = pixels.chunks_exact(3 * SIZE.0 as usize).skip(rows.start).take(rows.len());
        rows.flat_map(|row| &row[3 * columns.start..3 * columns.end]).copied().collect()
    };
    let within = n_different(&legend(a), &legend(b));
    [within, n_different(a, b) - within]
}

fn size() -> String {
    format!("{}x{}", SIZE.0, SIZE.1)
}

/// Where a point is on the screen, seen by the scene's first camera.
fn on_screen(scene: &Scene, point: Vec3) -> (i32, i32) {
    let at = Viewpoint::of_camera(&scene.cameras[0], 1.0).project(point, SIZE.0 as f32 / SIZE.1 as f32);
    let (x, y) = at.expect("before the camera");
    ((x * SIZE.0 as f32) as i32, (y * SIZE.1 as f32) as i32)
}

#[test]
fn a_window_shows_what_a_headless_picture_shows() {
    let Some(baked) = SmallBake::new("a_window_shows_what_a_headless_picture_shows") else { return };
    let Some(display) = Display::start("a_window_shows_what_a_headless_picture_shows") else { return };
    for (view, has_legend) in [("final", false), ("indirect", false), ("clusters", true)] {
        let look = ["--size", &size(), "--bounces", "2", "--exposure", "1", "--view", view];
        let expected = headless(&baked, "expected.png", &look);
        let window = display.viewer(baked.folder(), &[&[baked.file(), "--no-panel"], look.as_slice()].concat());
        let is_right = |pixels: &[u8]| {
            let [legend, beside] = different_by_legend(pixels, &expected);
            beside == 0 && (legend > 0) == has_legend
        };
        let shown = display.screen_when(is_right);
        assert!(is_right(&shown), "pixels of the view {view}: {:?}", different_by_legend(&shown, &expected));
        drop(window);
    }
}

#[test]
fn a_window_shows_the_system_that_works_beneath_it() {
    let test = "a_window_shows_the_system_that_works_beneath_it";
    let Some(baked) = SmallBake::new(test) else { return };
    let Some(display) = Display::start(test) else { return };
    let look = ["--size", "320x240", "--system", "ddgi", "--split", "0.25", "--view", "indirect", "--exposure", "1"];
    let expected = headless(&baked, "expected.png", &[&look[..], &["--bounces", "8"]].concat());
    let arguments = [&[baked.file(), "--no-panel", "--bounces", "8"], &look[..]].concat();
    let _window = display.viewer(baked.folder(), &arguments);
    // The same but for the noise of other rays: at rest both are means over some 30 frames.
    let shown = display.screen_when(|screen| mean_difference(screen, &expected) < 1.0);
    eprintln!("a system's window differs by {} of 255", mean_difference(&shown, &expected));
    assert!(mean_difference(&shown, &expected) < 1.0, "{}", mean_difference(&shown, &expected));
    let own = headless(&baked, "own.png", &["--size", "320x240", "--view", "indirect", "--exposure", "1"]);
    eprintln!("and by {} from the file's light", mean_difference(&shown, &own));
    assert!(mean_difference(&shown, &own) > 3.0, "the file's light alone: {}", mean_difference(&shown, &own));
}

#[test]
fn a_dragged_light_takes_its_light_along() {
    let test = "a_dragged_light_takes_its_light_along";
    let Some(baked) = SmallBake::new(test) else { return };
    let Some(display) = Display::start(test) else { return };
    let size = size();
    let look = ["--size", &size, "--bounces", "2", "--exposure", "1"];
    let before = headless(&baked, "before.png", &look);
    let shows_lights = [&[baked.file(), "--no-panel"], look.as_slice()].concat();
    let _window = display.viewer(baked.folder(), &shows_lights);
    assert_eq!(display.screen_when(|pixels| pixels == before), before);

    // Nobody manages windows here, so nobody gives them the keys.
    display.mouse("search --name localprt windowfocus sleep 0.5");
    // Lights are taken hold of where they are shown.
    let (x, y) = on_screen(baked.scene(), baked.scene().lights[0].position);
    display.mouse("key l");
    let with_shapes = display.screen_when(|pixels| pixels != before);
    assert!(n_different(&with_shapes, &before) > 10, "the light is drawn");
    display.mouse(&format!("mousemove {x} {y} sleep 0.5 mousedown 1 sleep 0.5"));
    for step in 1..=6 {
        display.mouse(&format!("mousemove {} {} sleep 0.3", x - 8 * step, y + 4 * step));
    }
    display.mouse("sleep 0.5 mouseup 1 sleep 0.5");
    // The shapes away, nothing selected, and the light as it is now into a file.
    display.mouse("key l key Escape key F11");
    let written = baked.folder().join("lighting-001.json");
    assert!(wait_for(|| written.exists()), "F11 writes the lighting");
    let moved = Lighting::load_for(&written, baked.scene()).expect("reads back").lights[0].position;
    let first = baked.scene().lights[0].position;
    assert!(moved.x < first.x - 0.1 && moved.y < first.y - 0.05, "from {first} to {moved}");

    let after = headless(&baked, "after.png", &[look.as_slice(), &["--lights", "lighting-001.json"]].concat());
    let shown = display.screen_when(|pixels| pixels == after);
    assert_eq!(n_different(&shown, &after), 0, "pixels differ from the same light without a window");
    let changed = n_different(&after, &before);
    assert!(
        changed > (SIZE.0 * SIZE.1 / 4) as usize,
        "indirect light reaches everything; only {changed} pixels changed"
    );
}

#[test]
fn a_window_loads_a_file_that_was_replaced_and_keeps_its_light() {
    let test = "a_window_loads_a_file_that_was_replaced_and_keeps_its_light";
    let Some(baked) = SmallBake::new(test) else { return };
    let Some(display) = Display::start(test) else { return };
    let lights = r#"{"lights": [{"type": "point", "position": [0.4, 0.9, 0.5], "intensity": 3}]}"#;
    fs::write(baked.folder().join("lamp.json"), lights).expect("written");
    let size = size();
    let look = ["--size", &size, "--bounces", "2", "--exposure", "1", "--view", "indirect", "--lights", "lamp.json"];
    let before = headless(&baked, "before.png", &look);
    let _window = display.viewer(baked.folder(), &[&[baked.file(), "--no-panel"], look.as_slice()].concat());
    assert_eq!(display.screen_when(|pixels| pixels == before), before);

    // What is no file for it is told, and the picture stays.
    let file = baked.folder().join(baked.file());
    let first = fs::read(&file).expect("a file");
    let replace = |bytes: &[u8]| {
        fs::write(baked.folder().join("new"), bytes).expect("written");
        fs::rename(baked.folder().join("new"), &file).expect("moved");
    };
    replace(&first[..1000]);
    std::thread::sleep(Duration::from_millis(1500));
    baked.bake_again(5);
    let after = headless(&baked, "after.png", &look);
    assert!(n_different(&before, &after) > 1000, "another bake");
    assert_eq!(display.screen_when(|pixels| pixels == after), after);
}

#[test]
fn a_window_outlives_its_device() {
    let test = "a_window_outlives_its_device";
    let Some(baked) = SmallBake::new(test) else { return };
    let Some(display) = Display::start(test) else { return };
    let size = size();
    let look = ["--size", &size, "--bounces", "2", "--exposure", "1"];
    let expected = headless(&baked, "expected.png", &look);
    let arguments = [
        &[baked.file(), "--no-panel", "--lose-device", "2", "--screenshot", "later.png", "--frames", "8"],
        look.as_slice(),
    ]
    .concat();
    let mut window = display.viewer_with(baked.folder(), &arguments, Stdio::piped());
    assert!(wait_for(|| window.0.try_wait().expect("a process").is_some()), "ends by itself");
    let mut told = String::new();
    window.0.stderr.take().expect("piped").read_to_string(&mut told).expect("text");
    assert!(window.0.wait().expect("has ended").success(), "{told}");
    assert!(told.contains("was lost"), "{told}");
    assert_eq!(n_different(&png(&baked.folder().join("later.png")), &expected), 0);
}
