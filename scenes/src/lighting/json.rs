//! Reads the lighting JSON: which keys there are, what they mean and what they may hold.

use super::place::Place;
use super::{Lighting, LightingError, MaterialOverride, Sky, equirect};
use crate::light::{Light, LightKind};
use crate::scene::Scene;
use crate::unit::unit_or_keep;
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::{Path, PathBuf};

impl Lighting {
    /// The scene's own lights under a black sky, materials as they are.
    pub fn of_scene(scene: &Scene) -> Self {
        Self { lights: scene.lights.clone(), ..Self::default() }
    }

    /// Reads lighting JSON by itself: without the key `lights` there are no lights, and material names are not checked.
    /// `base_dir` is the folder that a relative `sky.file` starts from.
    ///
    /// # Errors
    /// Any [`LightingError`] but `Read` and `UnknownMaterial`.
    pub fn from_json(text: &str, base_dir: &Path) -> Result<Self, LightingError> {
        parse(text, base_dir).map(|(lighting, _)| lighting)
    }

    /// Reads lighting JSON for a scene: without the key `lights` the scene's own lights shine, and every material named
    /// must be one of the scene's.
    ///
    /// # Errors
    /// Any [`LightingError`] but `Read`.
    pub fn from_json_for(text: &str, base_dir: &Path, scene: &Scene) -> Result<Self, LightingError> {
        let (mut lighting, has_lights) = parse(text, base_dir)?;
        if !has_lights {
            lighting.lights = scene.lights.clone();
        }
        lighting.check_materials(scene)?;
        Ok(lighting)
    }

    /// [`Lighting::from_json`] of a file; its folder is the base for the sky's image.
    ///
    /// # Errors
    /// Any [`LightingError`] but `UnknownMaterial`.
    pub fn load(path: &Path) -> Result<Self, LightingError> {
        Self::from_json(&read(path)?, folder_of(path))
    }

    /// [`Lighting::from_json_for`] of a file; its folder is the base for the sky's image.
    ///
    /// # Errors
    /// Any [`LightingError`].
    pub fn load_for(path: &Path, scene: &Scene) -> Result<Self, LightingError> {
        Self::from_json_for(&read(path)?, folder_of(path), scene)
    }

    /// The image that the sky of a lighting file is read from, be it there or not. None of a file that cannot be read.
    pub fn sky_image_of(path: &Path) -> Option<PathBuf> {
        let json: Value = serde_json::from_str(&read(path).ok()?).ok()?;
        Some(folder_of(path).join(json["sky"]["file"].as_str()?))
    }

    /// Checks that the scene has every material that the overrides name.
    ///
    /// # Errors
    /// [`LightingError::UnknownMaterial`] with the nearest names.
    pub fn check_materials(&self, scene: &Scene) -> Result<(), LightingError> {
        let known: BTreeSet<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        match self.materials.keys().find(|name| !known.contains(name.as_str())) {
            None => Ok(()),
            Some(name) => Err(LightingError::UnknownMaterial { name: name.clone(), near: near_names(name, &known) }),
        }
    }
}

fn read(path: &Path) -> Result<String, LightingError> {
    std::fs::read_to_string(path).map_err(|source| LightingError::Read { path: path.to_owned(), source })
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

fn parse(text: &str, base_dir: &Path) -> Result<(Lighting, bool), LightingError> {
    // Windows editors like to begin with a byte order mark, which JSON does not allow.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let value: Value = serde_json::from_str(text).map_err(|source| LightingError::Syntax { source })?;
    let root = Place { pointer: String::new(), value: &value };
    let root = root.object(&["lights", "sky", "materials", "albedo_override"])?;
    let mut lighting = Lighting::default();
    let lights = root.get("lights");
    if let Some(lights) = &lights {
        for light in lights.items()? {
            lighting.lights.push(parse_light(&light)?);
        }
    }
    if let Some(sky) = root.get("sky") {
        lighting.sky = parse_sky(&sky, base_dir)?;
    }
    if let Some(materials) = root.get("materials") {
        lighting.materials = parse_materials(&materials)?;
    }
    lighting.albedo_override = match root.get("albedo_override") {
        Some(value) => Some(value.number_within("a number from 0 to 1", |albedo| (0.0..=1.0).contains(&albedo))?),
        None => None,
    };
    Ok((lighting, lights.is_some()))
}

/// Defaults are those of KHR_lights_punctual. Keys that do not concern the light's type are checked and not used, as
/// they are in glTF, where every light has a node with position and direction.
fn parse_light(place: &Place) -> Result<Light, LightingError> {
    let object =
        place.object(&["type", "position", "direction", "color", "intensity", "range", "inner_cone", "outer_cone"])?;
    let kind = object.require("type", "every light needs one: point, spot or directional")?;
    let inner_cone = object.number_or("inner_cone", 0.0, "an angle of at least 0", |angle| angle >= 0.0)?;
    let outer_cone =
        object.number_or("outer_cone", FRAC_PI_4, "a half angle in radians, above 0 and at most pi / 2", |angle| {
            angle > 0.0 && angle <= FRAC_PI_2
        })?;
    let kind = match kind.text()? {
        "point" => LightKind::Point,
        "directional" => LightKind::Directional,
        "spot" if inner_cone < outer_cone => LightKind::Spot { inner_cone, outer_cone },
        "spot" => {
            return Err(LightingError::OutOfRange {
                place: format!("{}/inner_cone", object.pointer),
                allowed: "smaller than outer_cone (pi / 4 unless given)",
                found: inner_cone.to_string(),
            });
        }
        other => return Err(kind.unknown_choice("point, spot, directional", other)),
    };
    if kind != LightKind::Directional {
        object.require("position", "point and spot lights need one, in metres")?;
    }
    if kind != LightKind::Point {
        object.require("direction", "spot and directional lights need one: where the light goes")?;
    }
    let direction = match object.get("direction") {
        Some(place) => {
            let direction = place.vector()?.as_dvec3();
            if direction == DVec3::ZERO {
                return Err(place.out_of_range("a vector other than zero"));
            }
            unit_or_keep(direction)
        }
        None => Vec3::NEG_Z,
    };
    Ok(Light {
        name: object.pointer.to_owned(),
        kind,
        position: object.get("position").map_or(Ok(Vec3::ZERO), |place| place.vector())?,
        direction,
        color: object.get("color").map_or(Ok(Vec3::ONE), |place| place.radiance())?,
        intensity: object.number_or("intensity", 1.0, "a number of at least 0", |intensity| intensity >= 0.0)?,
        range: match object.get("range") {
            Some(place) => Some(place.number_within("a distance above 0 in metres", |range| range > 0.0)?),
            None => None,
        },
    })
}

fn parse_sky(place: &Place, base_dir: &Path) -> Result<Sky, LightingError> {
    const TYPES: &str = "constant, gradient, equirect";
    let any = place.object(&["type", "radiance", "zenith", "horizon", "ground", "file", "scale", "rotation"])?;
    let kind = any.require("type", "one of constant, gradient, equirect")?;
    match kind.text()? {
        "constant" => {
            let object = place.object(&["type", "radiance"])?;
            Ok(Sky::Constant(object.require("radiance", "[r, g, b] of a constant sky")?.radiance()?))
        }
        "gradient" => {
            let object = place.object(&["type", "zenith", "horizon", "ground"])?;
            let color = |key| object.require(key, "a gradient sky needs zenith, horizon and ground")?.radiance();
            Ok(Sky::Gradient { zenith: color("zenith")?, horizon: color("horizon")?, ground: color("ground")? })
        }
        "equirect" => {
            let object = place.object(&["type", "file", "scale", "rotation"])?;
            let file = object.require("file", "an .exr or .hdr image, relative to the lighting file")?;
            let scale = object.number_or("scale", 1.0, "a number of at least 0", |scale| scale >= 0.0)?;
            let rotation = object.number_or("rotation", 0.0, "an angle in degrees", |_| true)?;
            let (width, height, pixels) = equirect::read(&base_dir.join(file.text()?))?;
            Ok(Sky::Equirect { width, height, pixels, scale, rotation })
        }
        other => Err(kind.unknown_choice(TYPES, other)),
    }
}

fn parse_materials(place: &Place) -> Result<BTreeMap<String, MaterialOverride>, LightingError> {
    let Value::Object(entries) = place.value else {
        return Err(place.wrong_type("an object of material names"));
    };
    let mut overrides = BTreeMap::new();
    for (name, value) in entries {
        let object = Place { pointer: place.child(name), value }.object(&["albedo", "emission"])?;
        let albedo = match object.get("albedo") {
            None => None,
            Some(albedo) => {
                let color = if albedo.value.is_number() { Vec3::splat(albedo.number()?) } else { albedo.vector()? };
                if color.min_element() < 0.0 || color.max_element() > 1.0 {
                    return Err(albedo.out_of_range("from 0 to 1"));
                }
                Some(color)
            }
        };
        let emission = match object.get("emission") {
            None => None,
            Some(emission) => Some(emission.radiance()?),
        };
        overrides.insert(name.clone(), MaterialOverride { albedo, emission });
    }
    Ok(overrides)
}

/// The three names that differ least from the one asked for, quoted.
pub(crate) fn near_names(name: &str, known: &BTreeSet<&str>) -> String {
    let mut near: Vec<&str> = known.iter().copied().collect();
    near.sort_by_key(|candidate| strsim::levenshtein(&name.to_lowercase(), &candidate.to_lowercase()));
    let quoted: Vec<String> = near.iter().take(3).map(|name| format!("\"{name}\"")).collect();
    quoted.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    fn parsed(text: &str) -> Lighting {
        Lighting::from_json(text, Path::new("")).unwrap()
    }

    fn scene() -> Scene {
        let material = |name: &str| Material { name: name.into(), ..Material::default() };
        Scene {
            materials: vec![material("floor"), material("red wall"), material("green wall")],
            lights: parsed(r#"{"lights":[{"type":"point","position":[1,2,3]}]}"#).lights,
            ..Scene::default()
        }
    }

    #[test]
    fn every_key_arrives() {
        let lighting = parsed(
            r#"{"lights":[
                {"type":"spot","position":[1,2,3],"direction":[0,-2,0],"color":[1,0.5,0.25],"intensity":20,"range":9,
                 "inner_cone":0.1,"outer_cone":0.6},
                {"type":"directional","direction":[3,0,4],"intensity":2}],
              "sky":{"type":"gradient","zenith":[1,2,3],"horizon":[4,5,6],"ground":[7,8,9]},
              "materials":{"a":{"albedo":[0.1,0.2,0.3]},"b":{"albedo":0.5,"emission":[1,2,3]}},
              "albedo_override":0.25}"#,
        );
        assert_eq!(
            lighting.lights[0],
            Light {
                name: "/lights/0".into(),
                kind: LightKind::Spot { inner_cone: 0.1, outer_cone: 0.6 },
                position: Vec3::new(1.0, 2.0, 3.0),
                direction: Vec3::NEG_Y,
                color: Vec3::new(1.0, 0.5, 0.25),
                intensity: 20.0,
                range: Some(9.0),
            }
        );
        assert_eq!(lighting.lights[1].kind, LightKind::Directional);
        assert_eq!(lighting.lights[1].direction, Vec3::new(0.6, 0.0, 0.8));
        assert!(matches!(lighting.sky, Sky::Gradient { ground, .. } if ground == Vec3::new(7.0, 8.0, 9.0)));
        assert_eq!(lighting.materials["a"].albedo, Some(Vec3::new(0.1, 0.2, 0.3)));
        assert_eq!(lighting.materials["a"].emission, None);
        assert_eq!(lighting.materials["b"].albedo, Some(Vec3::splat(0.5)));
        assert_eq!(lighting.materials["b"].emission, Some(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(lighting.albedo_override, Some(0.25));
    }

    #[test]
    fn defaults_are_those_of_khr_lights_punctual() {
        let light = &parsed(r#"{"lights":[{"type":"spot","position":[0,0,0],"direction":[0,0,-1]}]}"#).lights[0];
        assert_eq!(light.kind, LightKind::Spot { inner_cone: 0.0, outer_cone: FRAC_PI_4 });
        assert_eq!((light.color, light.intensity, light.range), (Vec3::ONE, 1.0, None));
    }

    #[test]
    fn lights_replace_the_scenes_only_when_the_key_is_there() {
        let scene = scene();
        let for_scene = |text| Lighting::from_json_for(text, Path::new(""), &scene).unwrap();
        assert_eq!(for_scene("{}").lights, scene.lights);
        assert!(for_scene("{}").sky.is_black());
        assert_eq!(for_scene(r#"{"lights":[]}"#).lights, vec![]);
        assert_eq!(for_scene(r#"{"lights":[{"type":"point","position":[0,0,0]}]}"#).lights.len(), 1);
        assert_eq!(Lighting::of_scene(&scene).lights, scene.lights);
    }

    #[test]
    fn unknown_material_lists_near_names() {
        let text = r#"{"materials":{"Red Wal":{"albedo":0.5}}}"#;
        let error = Lighting::from_json_for(text, Path::new(""), &scene()).unwrap_err();
        assert!(error.to_string().contains("\"Red Wal\""), "{error}");
        assert!(error.help().starts_with("choose one of the scene's, such as \"red wall\", "), "{}", error.help());
        let error = Lighting::from_json_for(text, Path::new(""), &Scene::default()).unwrap_err();
        assert_eq!(error.help(), "remove it: the scene has no materials");
        assert!(Lighting::from_json(text, Path::new("")).is_ok());
    }

    #[test]
    fn unknown_keys_name_the_nearest() {
        for (text, place, key, nearest) in [
            (r#"{"light":[]}"#, "top level", "light", "lights"),
            (r#"{"lights":[{"type":"point","postion":[0,0,0]}]}"#, "/lights/0", "postion", "position"),
            (r#"{"sky":{"type":"constant","radiance":[1,1,1],"scal":2}}"#, "/sky", "scal", "scale"),
            (r#"{"sky":{"type":"constant","radiance":[1,1,1],"scale":2}}"#, "/sky", "scale", "type"),
            (r#"{"materials":{"a/b":{"albdo":1}}}"#, "/materials/a~1b", "albdo", "albedo"),
        ] {
            let error = Lighting::from_json(text, Path::new("")).unwrap_err();
            assert_eq!(error.to_string(), format!("{place}: unknown key `{key}`"));
            assert!(error.help().starts_with(&format!("did you mean `{nearest}`? known are ")), "{}", error.help());
        }
    }

    #[test]
    fn bad_values_name_their_place() {
        let light =
            |rest: &str| format!(r#"{{"lights":[{{"type":"spot","position":[0,0,0],"direction":[0,1,0]{rest}}}]}}"#);
        for (text, place) in [
            (light(r#","intensity":-1"#), "/lights/0/intensity"),
            (light(r#","intensity":1e40"#), "/lights/0/intensity"),
            (light(r#","intensity":"9""#), "/lights/0/intensity"),
            (light(r#","color":[1,1]"#), "/lights/0/color"),
            (light(r#","color":[1,1,-1]"#), "/lights/0/color"),
            (light(r#","color":[1,1,null]"#), "/lights/0/color/2"),
            (light(r#","range":0"#), "/lights/0/range"),
            (light(r#","outer_cone":1.6"#), "/lights/0/outer_cone"),
            (light(r#","outer_cone":0"#), "/lights/0/outer_cone"),
            (light(r#","inner_cone":-0.1"#), "/lights/0/inner_cone"),
            (light(r#","inner_cone":0.8"#), "/lights/0/inner_cone"),
            (r#"{"lights":[{"type":"area"}]}"#.into(), "/lights/0/type"),
            (r#"{"lights":[{"type":"point"}]}"#.into(), "/lights/0: missing key `position`"),
            (r#"{"lights":[{"type":"directional"}]}"#.into(), "/lights/0: missing key `direction`"),
            (r#"{"lights":[{"type":"directional","direction":[0,0,0]}]}"#.into(), "/lights/0/direction"),
            (r#"{"lights":[{"position":[0,0,0]}]}"#.into(), "/lights/0: missing key `type`"),
            (r#"{"lights":{}}"#.into(), "/lights"),
            (r#"{"sky":{"type":"box"}}"#.into(), "/sky/type"),
            (r#"{"sky":{"type":"constant"}}"#.into(), "/sky: missing key `radiance`"),
            (r#"{"sky":{"type":"gradient","zenith":[1,1,1]}}"#.into(), "/sky: missing key `horizon`"),
            (r#"{"sky":{"type":"equirect","file":"nowhere.exr"}}"#.into(), "/sky/file"),
            (r#"{"sky":{"type":"equirect","file":"x.png"}}"#.into(), "/sky/file"),
            (r#"{"sky":{"type":"equirect","file":"x.exr","scale":-1}}"#.into(), "/sky/scale"),
            (r#"{"materials":{"a":{"albedo":1.5}}}"#.into(), "/materials/a/albedo"),
            (r#"{"materials":{"a":{"albedo":[0,-1,0]}}}"#.into(), "/materials/a/albedo"),
            (r#"{"materials":{"a":{"emission":2}}}"#.into(), "/materials/a/emission"),
            (r#"{"albedo_override":1.01}"#.into(), "/albedo_override"),
            ("[]".into(), "top level"),
            ("{".into(), "not valid JSON"),
            (r#"{"albedo_override":1e999}"#.into(), "not valid JSON"),
        ] {
            let error = Lighting::from_json(&text, Path::new("")).unwrap_err();
            assert!(error.to_string().starts_with(place), "{text}\n{error}");
            assert!(["add", "correct", "save"].iter().any(|action| error.help().starts_with(action)), "{text}");
        }
    }

    #[test]
    fn the_bundled_sky_leaves_the_sun_of_the_scene() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        let atrium = crate::builtin::scene("atrium").unwrap();
        let lighting = Lighting::load_for(&assets.join("clear-sky.json"), &atrium).unwrap();
        assert_eq!(lighting.lights, atrium.lights);
        assert!(!lighting.sky.is_black());
    }

    #[test]
    fn an_equirect_image_is_found_beside_the_lighting_file() {
        let folder = tempfile::tempdir().unwrap();
        exr::prelude::write_rgb_file(folder.path().join("sky.exr"), 4, 2, |_, _| (1.0f32, 2.0f32, 3.0f32)).unwrap();
        let path = folder.path().join("light.json");
        let text = r#"{"sky":{"type":"equirect","file":"sky.exr","scale":2,"rotation":-90}}"#;
        std::fs::write(&path, text).unwrap();
        let sky = Lighting::load(&path).unwrap().sky;
        assert!(matches!(sky, Sky::Equirect { width: 4, height: 2, rotation: -90.0, .. }));
        assert_eq!(sky.radiance(Vec3::X), Vec3::new(2.0, 4.0, 6.0));
    }

    #[test]
    fn a_directory_is_a_read_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(Lighting::load(folder.path()), Err(LightingError::Read { .. })));
    }
}
