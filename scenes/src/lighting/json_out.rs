//! Writes a lighting state as the JSON that [`super::json`] reads.

use super::{Lighting, Sky};
use crate::light::{Light, LightKind};
use glam::Vec3;
use serde_json::{Map, Value, json};

impl Lighting {
    /// The state as lighting JSON, lights and all. A sky that is an image is left out: the state does not know its file.
    pub fn to_json(&self) -> Value {
        let mut root = Map::new();
        root.insert("lights".into(), self.lights.iter().map(light).collect());
        if let Some(sky) = sky(&self.sky) {
            root.insert("sky".into(), sky);
        }
        if !self.materials.is_empty() {
            let own = self.materials.iter().map(|(name, own)| {
                let mut entry = Map::new();
                for (key, color) in [("albedo", own.albedo), ("emission", own.emission)] {
                    if let Some(color) = color {
                        entry.insert(key.into(), vector(color));
                    }
                }
                (name.clone(), Value::Object(entry))
            });
            root.insert("materials".into(), Value::Object(own.collect()));
        }
        if let Some(albedo) = self.albedo_override {
            root.insert("albedo_override".into(), number(albedo));
        }
        Value::Object(root)
    }
}

fn light(light: &Light) -> Value {
    let mut entry = Map::new();
    let kind = match light.kind {
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional => "directional",
    };
    entry.insert("type".into(), kind.into());
    if light.kind != LightKind::Directional {
        entry.insert("position".into(), vector(light.position));
    }
    if light.kind != LightKind::Point {
        entry.insert("direction".into(), vector(light.direction));
    }
    entry.insert("color".into(), vector(light.color));
    entry.insert("intensity".into(), number(light.intensity));
    if let Some(range) = light.range {
        entry.insert("range".into(), number(range));
    }
    if let LightKind::Spot { inner_cone, outer_cone } = light.kind {
        entry.insert("inner_cone".into(), number(inner_cone));
        entry.insert("outer_cone".into(), number(outer_cone));
    }
    Value::Object(entry)
}

fn sky(sky: &Sky) -> Option<Value> {
    match sky {
        Sky::Black | Sky::Equirect { .. } => None,
        Sky::Constant(radiance) => Some(json!({ "type": "constant", "radiance": vector(*radiance) })),
        Sky::Gradient { zenith, horizon, ground } => Some(json!({
            "type": "gradient", "zenith": vector(*zenith), "horizon": vector(*horizon), "ground": vector(*ground)
        })),
    }
}

fn vector(vector: Vec3) -> Value {
    vector.to_array().into_iter().map(number).collect()
}

/// The shortest decimal that reads back as the same f32.
fn number(value: f32) -> Value {
    value.to_string().parse::<f64>().map_or(Value::Null, Value::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn what_is_written_reads_back_the_same() {
        let text = r#"{"lights":[
            {"type":"spot","position":[1,2.1,3],"direction":[0,-2,0],"color":[1,0.5,0.25],"intensity":20.3,"range":9,
             "inner_cone":0.1,"outer_cone":0.6},
            {"type":"point","position":[0.3,0,0]},
            {"type":"directional","direction":[3,0,4],"intensity":2}],
          "sky":{"type":"gradient","zenith":[1,2,3],"horizon":[4,5,6],"ground":[7,8,9]},
          "materials":{"a":{"albedo":[0.1,0.2,0.3]},"b":{"albedo":0.5,"emission":[1,2,3]}},"albedo_override":0.25}"#;
        let read = |text: &str| Lighting::from_json(text, Path::new("")).unwrap();
        let first = read(text);
        let again = read(&first.to_json().to_string());
        assert_eq!(again.lights, first.lights);
        assert_eq!((again.materials, again.albedo_override), (first.materials.clone(), first.albedo_override));
        for dir in [Vec3::X, Vec3::Y, Vec3::NEG_Y] {
            assert_eq!(again.sky.radiance(dir), first.sky.radiance(dir));
        }
        // Directions that are units already, but for rounding, are not turned.
        for (x, y) in [(1.0f32, 1.0), (0.3, 2.0), (-7.0, 0.1), (1e-3, 3.0)] {
            let text = format!(r#"{{"lights":[{{"type":"directional","direction":[{x},{y},0.075]}}]}}"#);
            let first = read(&text).lights[0].direction;
            let mut turned = read(&text);
            for _ in 0..3 {
                turned = read(&turned.to_json().to_string());
                assert_eq!(turned.lights[0].direction, first);
            }
        }
        // Nothing at all is nothing at all, and not the scene's own lights.
        assert_eq!(Lighting::default().to_json().to_string(), r#"{"lights":[]}"#);
    }
}
