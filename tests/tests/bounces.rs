//! Gathers add up to the series: a unit sphere of albedo 0.5 around a light of intensity pi.

use localprt_scenes::Lighting;
use localprt_tests::{bake, irradiance, mean, scene, small_settings};
use std::f32::consts::PI;

#[test]
fn the_sphere_adds_half_of_each_bounce() {
    let baked = bake(scene("sphere"), &small_settings());
    let lighting = Lighting::of_scene(&baked.scene);
    // Direct irradiance is pi, outgoing radiance 0.5, so gather k brings pi (0.5 + 0.25 + ... + 0.5^k).
    for bounces in [1, 2, 8] {
        let found = mean(irradiance(&baked, &lighting, bounces));
        let expected = PI * (1.0 - 0.5f32.powi(bounces as i32)) * (1.0 - baked.report.unseen.mean as f32);
        // 5120 flat faces (0.3 %), 2000 relight rays (0.1 %), compression (0.3 %).
        assert!((found / expected - 1.0).abs() < 0.01, "{bounces} bounces: {found} {expected}");
    }
    assert_eq!(mean(irradiance(&baked, &lighting, 0)), 0.0);
}
