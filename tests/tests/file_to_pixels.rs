//! Scene to file to light: what is read back lights the scene like what was written.

use glam::Vec3;
use localprt_formats::{Baked, LEVEL_SKY, check, write};
use localprt_scenes::{Lighting, export_glb, load};
use localprt_tests::{bake, irradiance, mean, scene, small_settings};

#[test]
fn a_written_bake_opens_to_the_same_light() {
    let baked = bake(scene("cornell"), &small_settings());
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("cornell.lprt");
    write(&path, &baked.arrays).expect("written");
    assert_eq!(check(&path).expect("readable"), []);
    let opened = Baked::open(&path).expect("opens");
    assert_eq!(opened.view().receiver_texel, baked.arrays.receiver_texel);
    assert!(opened.checked().is_ok());
}

#[test]
fn the_exported_scene_lights_like_the_one_in_memory() {
    let mut baked = bake(scene("cornell"), &small_settings());
    let lighting = Lighting::of_scene(&baked.scene);
    let before = irradiance(&baked, &lighting, 2);
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("cornell.glb");
    export_glb(&baked.scene, &path).expect("written");
    baked.scene = load(&path).expect("reads");
    let after = irradiance(&baked, &lighting, 2);
    // Normals are normalized again on import: a few ulp of direct light.
    for (before, after) in before.iter().zip(&after) {
        assert!((*before - *after).abs().max_element() <= 1e-4 * mean([*before]).max(1e-3), "{before} {after}");
    }
}

#[test]
fn red_and_green_walls_color_their_sides_of_the_floor() {
    let baked = bake(scene("cornell"), &small_settings());
    let values = irradiance(&baked, &Lighting::of_scene(&baked.scene), 2);
    let band = |side: f32, band: usize| {
        let near_wall = values
            .iter()
            .zip(&baked.arrays.receiver_position)
            .filter(|(_, position)| position[1] < 0.01 && position[0] * side > 0.75);
        let (sum, n) = near_wall.fold((0.0, 0), |(sum, n), (value, _)| (sum + value[band], n + 1));
        assert!(n > 10);
        sum / n as f32
    };
    // Red at x = -1, green at x = +1.
    assert!(band(-1.0, 0) > 1.3 * band(-1.0, 1), "{} {}", band(-1.0, 0), band(-1.0, 1));
    assert!(band(1.0, 1) > 1.1 * band(1.0, 0), "{} {}", band(1.0, 1), band(1.0, 0));
}

#[test]
fn relight_rays_tell_how_far_they_go() {
    let baked = bake(scene("cornell"), &small_settings());
    let arrays = &baked.arrays;
    let n_rays = arrays.ray_dirs.len();
    assert_eq!(arrays.ray_distance.len(), arrays.probes.len() * n_rays);
    let (low, high) = baked.scene.bounds().expect("a box");
    for (ray, (distance, &level)) in arrays.ray_distance.iter().zip(&arrays.ray_level).enumerate() {
        assert_eq!(distance.is_finite(), level != LEVEL_SKY, "ray {ray}");
        if distance.is_finite() {
            let dir = Vec3::from_slice(&arrays.ray_dirs[ray % n_rays][..3]);
            let end = Vec3::from(arrays.probes[ray / n_rays].position) + dir * distance.to_f32();
            // f16 rounds by 2^-11; no way in the box is longer than 4 m.
            assert!(end.cmpge(low - 2e-3).all() && end.cmple(high + 2e-3).all(), "ray {ray} ends at {end}");
        }
    }
    assert!(arrays.ray_level.contains(&LEVEL_SKY) && arrays.ray_level.iter().any(|level| *level != LEVEL_SKY));
}
