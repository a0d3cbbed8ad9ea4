//! Lights, sky and materials as rows of numbers, which is how they come from a page.

use glam::Vec3;
use localprt_runtime::Relighter;
use localprt_scenes::{Light, LightKind, MaterialOverride, Sky};

/// Numbers of a light: kind, position, direction, color, intensity, range, inner and outer cone.
pub(crate) const LIGHT: usize = 14;
/// Numbers of a material: whether it has an emission of its own, emission.
pub(crate) const MATERIAL: usize = 4;
/// Numbers of a sky: radiance at the zenith, the horizon and the nadir.
pub(crate) const SKY: usize = 9;

/// Lights of rows of [`LIGHT`] numbers; `None` for a kind that is none.
pub(crate) fn lights(rows: &[f32]) -> Option<Vec<Light>> {
    rows.chunks_exact(LIGHT).map(light).collect()
}

fn light(row: &[f32]) -> Option<Light> {
    let vector = |at: usize| Vec3::from_slice(&row[at..at + 3]);
    let kind = match row[0] {
        0.0 => LightKind::Point,
        1.0 => LightKind::Spot { inner_cone: row[12], outer_cone: row[13] },
        2.0 => LightKind::Directional,
        _ => return None,
    };
    Some(Light {
        name: String::new(),
        kind,
        position: vector(1),
        direction: vector(4),
        color: vector(7),
        intensity: row[10],
        range: (row[11] > 0.0).then_some(row[11]),
    })
}

/// Overrides of rows of [`MATERIAL`] numbers.
pub(crate) fn materials(rows: &[f32]) -> Vec<MaterialOverride> {
    let of_row = |row: &[f32]| MaterialOverride {
        emission: (row[0] != 0.0).then(|| Vec3::from_slice(&row[1..4])),
        ..MaterialOverride::default()
    };
    rows.chunks_exact(MATERIAL).map(of_row).collect()
}

/// A sky of [`SKY`] numbers.
pub(crate) fn sky(row: &[f32]) -> Sky {
    let [zenith, horizon, ground] = [0, 3, 6].map(|at| Vec3::from_slice(&row[at..at + 3]));
    Sky::Gradient { zenith, horizon, ground }
}

/// Why numbers were refused.
pub(crate) fn wrong_length(what: &str, found: usize, row: usize) -> String {
    format!("{what}: {found} numbers are no whole rows of {row}")
}

/// Irradiance map of a relighter as the browser's own texture.
pub(crate) fn irradiance_texture(relighter: &Relighter) -> Option<wasm_bindgen::JsValue> {
    relighter.irradiance_view().texture().as_webgpu().map(|texture| texture.clone().into())
}
