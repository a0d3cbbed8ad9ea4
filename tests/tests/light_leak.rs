//! Light in a sealed room stays there.

use localprt_precompute::settings::{BakeSettings, Transport};
use localprt_scenes::Lighting;
use localprt_tests::{TRANSPORTS, bake, irradiance, mean, scene, small_settings};

#[test]
fn light_in_a_sealed_room_stays_there() {
    TRANSPORTS.into_iter().for_each(stays_there);
}

fn stays_there(transport: Transport) {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), transport, ..small_settings() };
    let baked = bake(scene("two-rooms"), &settings);
    let lighting = Lighting::of_scene(&baked.scene);
    // The lamp is in the left room, the wall between the rooms stands at x = 0.
    assert!(lighting.lights[0].position.x < 0.0);
    let values = irradiance(&baked, &lighting, 3);
    let side = |left: bool| {
        values
            .iter()
            .zip(&baked.arrays.receiver_position)
            .filter(move |(_, position)| (position[0] < 0.0) == left)
            .map(|(value, _)| *value)
    };
    let lit = mean(side(true));
    assert!(lit > 0.0);
    let brightest = side(false).map(|value| value.max_element()).fold(0.0f32, f32::max);
    assert!(side(false).count() > 100);
    assert!(brightest <= 1e-6 * lit, "{transport:?}: dark room: {brightest}, lit room: {lit}");
}

#[test]
fn a_doorway_lets_light_through() {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), ..small_settings() };
    let baked = bake(scene("two-rooms-door"), &settings);
    let values = irradiance(&baked, &Lighting::of_scene(&baked.scene), 3);
    let dark = values.iter().zip(&baked.arrays.receiver_position).filter(|(_, position)| position[0] > 0.1);
    assert!(mean(dark.map(|(value, _)| *value)) > 0.0);
}
