//! The command line: what goes wrong is said with its exit code, and pictures agree with those of the bake library.

mod small_bake;

use glam::Vec3;
use localprt_precompute::picture::{Exposure, Picture, PictureSize, Surfaces, render};
use localprt_precompute::progress::Progress;
use localprt_precompute::rays::RayCaster;
use localprt_precompute::validate::flip::mean_flip;
use localprt_runtime::CpuRelighter;
use localprt_runtime::scene_light::{SceneLight, direct_irradiance, scene_texels};
use localprt_scenes::Lighting;
use small_bake::{SmallBake, headless, png, viewer};
use std::fs;

/// Exit code and standard error of the viewer.
fn refused(baked: &SmallBake, arguments: &[&str]) -> (Option<i32>, String) {
    let picture = ["--headless", "--screenshot", "refused.png"];
    let output = viewer(baked.folder(), &[arguments, &picture].concat()).output().expect("runs");
    assert!(!baked.folder().join("refused.png").exists(), "nothing is written");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn what_goes_wrong_is_said() {
    let Some(baked) = SmallBake::new("what_goes_wrong_is_said") else { return };
    let file = baked.file();
    let expect = |arguments: &[&str], code: i32, words: &str| {
        let (found, text) = refused(&baked, arguments);
        assert!(found == Some(code) && text.contains(words), "{arguments:?}: {found:?} {text}");
        assert!(!text.contains("panicked"), "{text}");
    };
    expect(&["missing.lprt"], 6, "missing.lprt");
    expect(&[file, "--camera", "7"], 2, "no camera 7");
    expect(&[file, "--probe", "999"], 2, "no probe 999");
    expect(&[file, "--pick", "0,0"], 2, "no receiver");
    expect(&[file, "--variant", "night"], 2, "leave it out: the scene has no variants");
    expect(&[file, "--view", "error"], 3, "precompute validate");
    expect(&[file, "--view", "nonsense"], 2, "final, lighting");
    expect(&[file, "--lights", "missing.json"], 6, "missing.json");
    fs::write(baked.folder().join("bad.json"), "{\"lamps\":[]}").expect("written");
    expect(&[file, "--lights", "bad.json"], 3, "lamps");

    fs::write(baked.folder().join("broken.lprt"), b"not a bake").expect("written");
    expect(&["broken.lprt"], 3, "broken.lprt");
    // A scene that is gone, and one that has changed since.
    let scene = baked.folder().join("cornell.glb");
    let whole = fs::read(&scene).expect("a scene");
    fs::remove_file(&scene).expect("removed");
    expect(&[file], 6, "--scene");
    let changed = localprt_scenes::builtin::scene("furnace").expect("a built-in scene");
    localprt_scenes::export_glb(&changed, &scene).expect("written");
    expect(&[file], 3, "not the scene");
    fs::write(&scene, whole).expect("written");
}

#[test]
fn without_an_adapter_nothing_is_drawn_and_it_says_so() {
    let Some(baked) = SmallBake::new("without_an_adapter_nothing_is_drawn_and_it_says_so") else { return };
    let arguments = [baked.file(), "--headless", "--screenshot", "none.png"];
    let output = viewer(baked.folder(), &arguments)
        // Neither driver nor another interface.
        .env("VK_DRIVER_FILES", "/nowhere.json")
        .env("VK_ICD_FILENAMES", "/nowhere.json")
        .env("WGPU_BACKEND", "vulkan")
        .output()
        .expect("runs");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(5) && text.contains("driver"), "{:?} {text}", output.status);
}

#[test]
fn pictures_agree_with_traced_ones() {
    let Some(baked) = SmallBake::new("pictures_agree_with_traced_ones") else { return };
    let (width, height) = (160, 160);
    let found = headless(&baked, "found.png", &["--size", "160x160", "--exposure", "1", "--frames", "3"]);
    let expected = traced_picture(&baked, width, height, 3);
    let developed = expected.develop(Exposure::Ev(1.0));
    // FLIP is taken of developed radiance.
    let flip = mean_flip(&undeveloped(&found, width, height), &undeveloped(&developed, width, height), 0.0);
    // Shadow edges by maps of 2048 texels instead of rays (also those on the 64 x 64 texels that indirect light starts
    // from), four samples of edges elsewhere in the pixel, half floats in the maps. Two stops differ by ten times that.
    assert!(flip < 0.05, "FLIP {flip}");
    let dark = headless(&baked, "dark.png", &["--size", "160x160", "--exposure", "-1", "--frames", "3"]);
    let far = mean_flip(&undeveloped(&dark, width, height), &undeveloped(&developed, width, height), 0.0);
    assert!(far > 0.2, "FLIP sees two stops: {far}");
    println!("FLIP mean {flip:.4}");
}

#[test]
fn overlays_leave_the_scene_as_bright_as_it_is() {
    let Some(baked) = SmallBake::new("overlays_leave_the_scene_as_bright_as_it_is") else { return };
    let look = ["--size", "160x160", "--frames", "3"];
    let plain = headless(&baked, "plain.png", &look);
    let over =
        headless(&baked, "over.png", &[look.as_slice(), &["--overlay", "lights", "--overlay", "receiver"]].concat());
    let again =
        headless(&baked, "again.png", &[look.as_slice(), &["--overlay", "lights", "--overlay", "receiver"]].concat());
    assert!(over == again, "the same twice");
    let changed = plain.chunks_exact(3).zip(over.chunks_exact(3)).filter(|(a, b)| a != b).count();
    assert!((10..2560).contains(&changed), "lines alone, not the whole picture: {changed} pixels");
}

#[test]
fn recordings_are_numbered_frames() {
    let Some(baked) = SmallBake::new("recordings_are_numbered_frames") else { return };
    let arguments = [
        baked.file(),
        "--headless",
        "--record",
        "flight",
        "--frames",
        "3",
        "--size",
        "64x48",
        "--with",
        "lamp",
        "--animate",
    ];
    let output = viewer(baked.folder(), &arguments).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let frame = |index: u32| png(&baked.folder().join(format!("flight/frame_{index:05}.png")));
    assert!(frame(0) != frame(1) && frame(1) != frame(2), "the camera moves");
    assert_eq!(fs::read_dir(baked.folder().join("flight")).expect("a folder").count(), 3);

    let still = ["--headless", "--record", "still", "--still", "--frames", "2", "--size", "64x48", "--bounces", "1"];
    let output = viewer(baked.folder(), &[&[baked.file()], still.as_slice()].concat()).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let frame = |index: u32| png(&baked.folder().join(format!("still/frame_{index:05}.png")));
    assert!(frame(0) == frame(1), "nothing moves");
}

/// What `precompute relight --picture` makes.
fn traced_picture(baked: &SmallBake, width: u32, height: u32, bounces: u32) -> Picture {
    let file = localprt_formats::Baked::open(baked.folder().join(baked.file())).expect("opens");
    let (scene, view) = (baked.scene(), file.view());
    let lighting = Lighting::of_scene(scene);
    let caster = RayCaster::new(scene).expect("a tree");
    let light = SceneLight::traced(&caster, &scene_texels(&caster, &view), &lighting, &view);
    let mut relighter = CpuRelighter::new(file.checked().expect("a sound file"));
    relighter.relight(&light.inputs(bounces)).expect("inputs that fit");
    let relit = relighter.relit();
    let surfaces = Surfaces::new(scene, &lighting, None);
    let size = PictureSize { width, height, rays_per_axis: 2 };
    let radiance = |hit: &localprt_precompute::rays::SurfaceHit| {
        surfaces.radiance(
            hit,
            |position, normal| direct_irradiance(&caster, &lighting.lights, position, normal, hit.normal),
            |uv, normal| relit.maps.irradiance_about(normal, |map| map.sample(uv)).unwrap_or(Vec3::ZERO),
        )
    };
    render(&caster, &scene.cameras[0], size, &Progress::silent(), radiance, |_| Vec3::ZERO).expect("not cancelled")
}

/// Radiance that the tone curve turns into these bytes: x of y = x (1 + x / w^2) / (1 + x).
fn undeveloped(bytes: &[u8], width: u32, height: u32) -> Picture {
    let white_2 = localprt_viewer::WHITE * localprt_viewer::WHITE;
    let band = |byte: u8| {
        let y = localprt_scenes::scene::srgb_to_linear(byte);
        let half = 0.5 * white_2 * (y - 1.0);
        half + (half * half + white_2 * y).sqrt()
    };
    let pixel = |bytes: &[u8]| Vec3::new(band(bytes[0]), band(bytes[1]), band(bytes[2]));
    Picture { width, height, pixels: bytes.chunks_exact(3).map(pixel).collect() }
}
