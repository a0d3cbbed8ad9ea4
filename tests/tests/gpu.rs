//! Real bakes through the GPU passes: closed forms, sealed rooms, and the CPU relighter's light.

use glam::Vec3;
use localprt_precompute::settings::BakeSettings;
use localprt_scenes::{Lighting, MaterialOverride, Sky, builtin::furnace_irradiance};
use localprt_tests::{bake, irradiance, irradiance_on_gpu, mean, scene, small_settings};

/// Root mean square difference over the mean.
fn nrmse(found: &[Vec3], expected: &[Vec3]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let squares: f64 = found.iter().zip(expected).map(|(&a, &b)| f64::from((a - b).length_squared())).sum();
    let sum: f64 = expected.iter().map(|value| f64::from(value.element_sum())).sum();
    let n = 3.0 * expected.len() as f64;
    assert!(sum > 0.0, "nothing to compare with");
    (squares / n).sqrt() / (sum / n)
}

#[test]
fn the_furnace_settles_on_the_gpu_too() {
    let baked = bake(scene("furnace"), &small_settings());
    let lighting = Lighting::of_scene(&baked.scene);
    let test = "the_furnace_settles_on_the_gpu_too";
    let Some(values) = irradiance_on_gpu(test, &baked, &lighting, 20, true) else { return };
    let found = f64::from(mean(values));
    // As for the CPU relighter; maps in half precision may cut off 2^-10 per gather, amplified by 2.
    assert!((found / furnace_irradiance(None) - 1.0).abs() < 0.012, "{found}");
}

#[test]
fn a_sealed_room_stays_dark_on_the_gpu_too() {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), ..small_settings() };
    let baked = bake(scene("two-rooms"), &settings);
    let lighting = Lighting::of_scene(&baked.scene);
    for shadow_maps in [false, true] {
        let test = "a_sealed_room_stays_dark_on_the_gpu_too";
        let Some(values) = irradiance_on_gpu(test, &baked, &lighting, 3, shadow_maps) else { return };
        let side = |left: bool| {
            let positions = values.iter().zip(&baked.arrays.receiver_position);
            positions.filter(move |(_, position)| (position[0] < 0.0) == left).map(|(value, _)| *value)
        };
        let lit = mean(side(true));
        let brightest = side(false).map(|value| value.max_element()).fold(0.0f32, f32::max);
        assert!(lit > 0.0 && side(false).count() > 100);
        assert!(brightest <= 1e-6 * lit, "shadow maps {shadow_maps}: dark room {brightest}, lit room {lit}");
    }
}

#[test]
fn lights_sky_and_materials_give_the_same_light_as_on_the_cpu() {
    let settings = BakeSettings { receiver_degree: 1, probe_degree: 4, ..small_settings() };
    let baked = bake(scene("cornell"), &settings);
    let mut lighting = Lighting::of_scene(&baked.scene);
    lighting.sky = Sky::Gradient { zenith: Vec3::new(0.2, 0.3, 0.6), horizon: Vec3::ONE, ground: Vec3::splat(0.1) };
    let name = baked.scene.materials[0].name.clone();
    let glowing = MaterialOverride { albedo: Some(Vec3::splat(0.3)), emission: Some(Vec3::new(2.0, 1.0, 0.5)) };
    lighting.materials.insert(name, glowing);
    let test = "lights_sky_and_materials_give_the_same_light_as_on_the_cpu";
    let expected = irradiance(&baked, &lighting, 3);
    let Some(found) = irradiance_on_gpu(test, &baked, &lighting, 3, false) else { return };
    // The irradiance map in half precision, which the next gather reads, may cut off 2^-10 of it.
    let difference = nrmse(&found, &expected);
    assert!(difference < 1e-3, "{difference}");
    let Some(found) = irradiance_on_gpu(test, &baked, &lighting, 3, true) else { return };
    // Shadow edges differ within a texel of the 2048 of a shadow map.
    let difference = nrmse(&found, &expected);
    assert!(difference < 0.02, "{difference}");
}
