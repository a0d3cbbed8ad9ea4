//! The sky's first arrival at receivers.

use glam::Vec3;
use localprt_scenes::{Lighting, Sky};
use localprt_tests::{bake, irradiance, scene, small_settings};
use std::f32::consts::PI;

#[test]
fn an_open_plane_receives_pi_times_a_constant_sky() {
    let baked = bake(scene("plane"), &small_settings());
    let sky = Vec3::new(0.5, 1.0, 2.0);
    let lighting = Lighting { sky: Sky::Constant(sky), ..Lighting::default() };
    for value in irradiance(&baked, &lighting, 2) {
        // Every receiver of a plane has the same row, so compression keeps it but for two f16 factors, 2^-11 each.
        assert!((value / (PI * sky) - Vec3::ONE).abs().max_element() < 0.002, "{value}");
    }
}

#[test]
fn a_gradient_sky_lights_the_plane_by_its_cosine_weighted_mean() {
    let baked = bake(scene("plane"), &small_settings());
    let (zenith, horizon) = (Vec3::splat(3.0), Vec3::splat(1.0));
    let lighting = Lighting { sky: Sky::Gradient { zenith, horizon, ground: horizon }, ..Lighting::default() };
    // Integral of (h + (z - h) y) y over the hemisphere: pi h + 2 pi/3 (z - h). What degree 4 cannot hold of the kink at
    // the horizon is of degree 6 and more, where the cosine lobe has 1/16 of its degree-2 weight: below 1 %.
    let expected = PI * 1.0 + 2.0 * PI / 3.0 * 2.0;
    for value in irradiance(&baked, &lighting, 1) {
        assert!((value.y / expected - 1.0).abs() < 0.01, "{value} {expected}");
    }
}
