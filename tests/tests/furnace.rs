//! A closed box that glows evenly: radiance is the same everywhere and in every direction.

use glam::Vec3;
use localprt_precompute::settings::{BakeSettings, Transport};
use localprt_scenes::{
    Lighting, MaterialOverride,
    builtin::{FURNACE_ALBEDO, FURNACE_EMISSION, furnace_irradiance},
};
use localprt_tests::{bake, irradiance, mean, scene, small_settings};
use std::f64::consts::PI;

#[test]
fn the_furnace_settles_at_pi_e_over_one_minus_a() {
    let baked = bake(scene("furnace"), &small_settings());
    let unseen = baked.report.unseen;
    assert!(unseen.mean < 1e-3, "an empty box hides nothing: {unseen:?}");
    let lighting = Lighting::of_scene(&baked.scene);
    // 0.5^20 = 1e-6 of the light is left out.
    let values = irradiance(&baked, &lighting, 20);
    let expected = furnace_irradiance(None);
    assert!((expected - PI * f64::from(FURNACE_EMISSION) / (1.0 - f64::from(FURNACE_ALBEDO))).abs() < 1e-6);
    let found = f64::from(mean(values.iter().copied()));
    // What no probe sees is lost in every bounce: e / (1 - a (1 - unseen)). The rest is the Gram error of 2000 relight
    // rays (1e-3) and the compression threshold of 0.005 on rows of norm about 1.5, both amplified by 1 / (1 - a) = 2.
    let lost = PI * (1.0 - unseen.mean) / (1.0 - 0.5 * (1.0 - unseen.mean));
    assert!((found / lost - 1.0).abs() < 0.01, "{found} {lost}");
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    // Every single receiver, too: the reconstruction of a constant does not depend on the place.
    let worst = values.iter().map(|value| (f64::from(value.y) / expected - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn fitted_rows_hold_constant_light_of_surfaces_that_were_not_known_to_glow() {
    // Baked dark, so that nothing is set apart as a lamp and the openness of the corners counts; lit as the furnace is.
    let mut dark = scene("furnace");
    dark.materials.iter_mut().for_each(|material| material.emission = Vec3::ZERO);
    let glow = MaterialOverride { albedo: None, emission: Some(Vec3::splat(FURNACE_EMISSION)) };
    let materials = dark.materials.iter().map(|material| (material.name.clone(), glow)).collect();
    let settings = BakeSettings { transport: Transport::Fitted, ..small_settings() };
    let baked = bake(dark, &settings);
    let values = irradiance(&baked, &Lighting { materials, ..Lighting::default() }, 1);
    let found = f64::from(mean(values)) / (PI * f64::from(FURNACE_EMISSION));
    assert!((found - 1.0).abs() < 0.01, "{found}");
}

#[test]
fn degree_1_receivers_agree_in_the_furnace() {
    let settings = BakeSettings { receiver_degree: 1, probe_degree: 4, ..small_settings() };
    let baked = bake(scene("furnace"), &settings);
    let values = irradiance(&baked, &Lighting::of_scene(&baked.scene), 20);
    let found = f64::from(mean(values));
    // As above, with 256 uniform directions instead of cosine-weighted ones.
    assert!((found / furnace_irradiance(None) - 1.0).abs() < 0.02, "{found}");
}
