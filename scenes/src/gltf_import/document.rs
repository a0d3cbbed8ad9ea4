//! JSON text to the `gltf` crate's typed model, with every index and enumeration checked first.
//!
//! The typed model narrows integers to 32 bits without a word and validates by panicking in places; so indices and
//! enumerations are checked on the plain JSON, where a JSON pointer is at hand, and each object is converted by itself.

use super::error::{LoadError, Source};
use crate::guarded::guarded;
use gltf::json;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fmt::Write;

pub(super) type JsonLight = json::extensions::scene::khr_lights_punctual::Light;

/// The parts of a glTF file that a bake needs. Every index in it is in range.
#[derive(Default)]
pub(super) struct Document {
    pub accessors: Vec<json::Accessor>,
    pub buffers: Vec<json::Buffer>,
    pub buffer_views: Vec<json::buffer::View>,
    pub cameras: Vec<json::Camera>,
    pub images: Vec<json::Image>,
    pub lights: Vec<JsonLight>,
    pub materials: Vec<json::Material>,
    pub meshes: Vec<json::Mesh>,
    pub nodes: Vec<json::Node>,
    pub samplers: Vec<json::texture::Sampler>,
    pub textures: Vec<TextureSource>,
    /// Root nodes of each scene.
    pub scenes: Vec<Vec<usize>>,
    /// The default scene.
    pub scene: Option<usize>,
    /// Names of KHR_materials_variants.
    pub variants: Vec<String>,
    /// `/asset/extras/localprt/light_map_set`, as this program writes it.
    pub light_map_set: Option<usize>,
}

/// A texture's image and sampler. The `gltf` crate demands an image, but an extension may hold it.
pub(super) struct TextureSource {
    /// That of every reader, or else of an extension that is read.
    pub image: Option<usize>,
    pub sampler: Option<usize>,
    /// The extension that holds an image of another format.
    pub extension: Option<&'static str>,
}

/// Extensions that may be required: read, or without effect on diffuse light transport.
const READ_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    #[cfg(feature = "compressed")]
    "EXT_texture_webp",
    #[cfg(feature = "compressed")]
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    #[cfg(feature = "compressed")]
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Extensions that store images of other formats.
const TEXTURE_EXTENSIONS: &[&str] = &["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"];

const REPAIR: &str = "export the file again or repair it (npx gltf-validator names every fault)";

/// Says which TEXCOORD set lays out the direct light map.
pub(super) const LIGHT_MAP_SET: &str = "/asset/extras/localprt/light_map_set";

/// Where indices stand, and the array they point into.
const INDICES: &[(&str, &str)] = &[
    ("accessors/*/bufferView", "bufferViews"),
    ("accessors/*/sparse/indices/bufferView", "bufferViews"),
    ("accessors/*/sparse/values/bufferView", "bufferViews"),
    ("bufferViews/*/buffer", "buffers"),
    ("bufferViews/*/extensions/EXT_meshopt_compression/buffer", "buffers"),
    ("bufferViews/*/extensions/KHR_meshopt_compression/buffer", "buffers"),
    ("images/*/bufferView", "bufferViews"),
    ("textures/*/source", "images"),
    ("textures/*/extensions/EXT_texture_webp/source", "images"),
    ("textures/*/extensions/KHR_texture_basisu/source", "images"),
    ("textures/*/sampler", "samplers"),
    ("materials/*/pbrMetallicRoughness/baseColorTexture/index", "textures"),
    ("materials/*/pbrMetallicRoughness/metallicRoughnessTexture/index", "textures"),
    ("materials/*/normalTexture/index", "textures"),
    ("materials/*/occlusionTexture/index", "textures"),
    ("materials/*/emissiveTexture/index", "textures"),
    ("materials/*/extensions/KHR_materials_pbrSpecularGlossiness/diffuseTexture/index", "textures"),
    ("meshes/*/primitives/*/attributes/*", "accessors"),
    ("meshes/*/primitives/*/indices", "accessors"),
    ("meshes/*/primitives/*/material", "materials"),
    ("meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView", "bufferViews"),
    ("meshes/*/primitives/*/extensions/KHR_materials_variants/mappings/*/material", "materials"),
    (
        "meshes/*/primitives/*/extensions/KHR_materials_variants/mappings/*/variants/*",
        "extensions/KHR_materials_variants/variants",
    ),
    ("meshes/*/primitives/*/targets/*/*", "accessors"),
    ("nodes/*/camera", "cameras"),
    ("nodes/*/children/*", "nodes"),
    ("nodes/*/mesh", "meshes"),
    ("nodes/*/skin", "skins"),
    ("nodes/*/extensions/EXT_mesh_gpu_instancing/attributes/*", "accessors"),
    ("nodes/*/extensions/KHR_lights_punctual/light", "extensions/KHR_lights_punctual/lights"),
    ("scenes/*/nodes/*", "nodes"),
    ("scene", "scenes"),
];

/// Where enumerations stand, and their values.
const ENUMERATIONS: &[(&str, &[u64])] = &[
    ("accessors/*/componentType", &[5120, 5121, 5122, 5123, 5125, 5126]),
    ("accessors/*/sparse/indices/componentType", &[5121, 5123, 5125]),
    ("bufferViews/*/target", &[34962, 34963]),
    ("meshes/*/primitives/*/mode", &[0, 1, 2, 3, 4, 5, 6]),
    ("samplers/*/magFilter", &[9728, 9729]),
    ("samplers/*/minFilter", &[9728, 9729, 9984, 9985, 9986, 9987]),
    ("samplers/*/wrapS", &[33071, 33648, 10497]),
    ("samplers/*/wrapT", &[33071, 33648, 10497]),
];

/// Reads the JSON part of a scene.
pub(super) fn parse(source: &Source, text: &[u8]) -> Result<Document, LoadError> {
    let root: Value = serde_json::from_slice(text)
        .map_err(|error| source.container(format!("the JSON does not parse: {error}"), REPAIR))?;
    if !root.is_object() {
        return Err(source.container("the JSON is not an object", REPAIR));
    }
    check_version(source, &root)?;
    check_required_extensions(source, &root)?;
    check_indices(source, &root)?;
    check_enumerations(source, &root)?;
    Ok(Document {
        accessors: typed_array(source, &root, "/accessors")?,
        buffers: typed_array(source, &root, "/buffers")?,
        buffer_views: typed_array(source, &root, "/bufferViews")?,
        cameras: typed_array(source, &root, "/cameras")?,
        images: typed_array(source, &root, "/images")?,
        lights: typed_array(source, &root, "/extensions/KHR_lights_punctual/lights")?,
        materials: typed_array(source, &root, "/materials")?,
        meshes: typed_array(source, &root, "/meshes")?,
        nodes: typed_array(source, &root, "/nodes")?,
        samplers: typed_array(source, &root, "/samplers")?,
        textures: array(source, &root, "/textures")?.iter().map(texture_source).collect(),
        scenes: (0..array(source, &root, "/scenes")?.len())
            .map(|scene| array(source, &root, &format!("/scenes/{scene}/nodes")).map(indices_in))
            .collect::<Result<_, _>>()?,
        scene: root["scene"].as_u64().map(|index| index as usize),
        variants: array(source, &root, "/extensions/KHR_materials_variants/variants")?
            .iter()
            .enumerate()
            .map(|(number, variant)| variant["name"].as_str().map_or(format!("variant_{number}"), str::to_owned))
            .collect(),
        light_map_set: match root.pointer(LIGHT_MAP_SET) {
            None => None,
            Some(set) => Some(set.as_u64().ok_or_else(|| {
                source.invalid(LIGHT_MAP_SET, format!("{}, must be the number of a set", brief(set)), REPAIR)
            })? as usize),
        },
    })
}

/// Names an array entry of the document, such as `/accessors/3`.
pub(super) fn pointer(array: &str, index: usize) -> String {
    format!("/{array}/{index}")
}

fn check_version(source: &Source, root: &Value) -> Result<(), LoadError> {
    for key in ["version", "minVersion"] {
        let place = format!("/asset/{key}");
        match &root["asset"][key] {
            Value::String(version) if version.split('.').next() == Some("2") => {}
            Value::Null if key == "minVersion" => {}
            Value::String(version) => {
                let remedy = "convert it to glTF 2.0, for example by importing and exporting it with Blender";
                return Err(source.unsupported(place, format!("glTF version {version:?}"), remedy));
            }
            _ => return Err(source.invalid(place, "no glTF version", "export it as glTF 2.0")),
        }
    }
    Ok(())
}

fn check_required_extensions(source: &Source, root: &Value) -> Result<(), LoadError> {
    for (index, name) in array(source, root, "/extensionsRequired")?.iter().enumerate() {
        let place = pointer("extensionsRequired", index);
        let Value::String(name) = name else {
            return Err(source.invalid(place, format!("{name}, must be a string"), REPAIR));
        };
        if !READ_EXTENSIONS.contains(&name.as_str()) {
            return Err(source.unsupported(place, format!("required extension {name}"), remedy_for(name)));
        }
    }
    Ok(())
}

/// How to get rid of an extension.
pub(super) fn remedy_for(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "decode it with `npx @gltf-transform/cli copy IN.glb OUT.glb`",
        "KHR_texture_basisu" => "decode it with `npx @gltf-transform/cli ktxdecompress IN.glb OUT.glb`",
        "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "convert its images with `npx @gltf-transform/cli png IN.glb OUT.glb`"
        }
        _ => "export the file without it, or try `npx @gltf-transform/cli copy IN.glb OUT.glb`",
    }
}

fn check_indices(source: &Source, root: &Value) -> Result<(), LoadError> {
    for (pattern, target) in INDICES {
        let count = root.pointer(&format!("/{target}")).and_then(Value::as_array).map_or(0, Vec::len);
        each(source, root, pattern, &mut |value, place| match value.as_u64() {
            Some(index) if index < count as u64 => Ok(()),
            Some(index) => {
                let found = format!("index {index} into {target}, which has {count} entries");
                Err(source.invalid(place, found, REPAIR))
            }
            None => Err(source.invalid(place, format!("{}, must be an index into {target}", brief(value)), REPAIR)),
        })?;
    }
    Ok(())
}

fn check_enumerations(source: &Source, root: &Value) -> Result<(), LoadError> {
    for (pattern, allowed) in ENUMERATIONS {
        each(source, root, pattern, &mut |value, place| match value.as_u64() {
            Some(value) if allowed.contains(&value) => Ok(()),
            _ => Err(source.invalid(place, format!("{}, must be one of {allowed:?}", brief(value)), REPAIR)),
        })?;
    }
    Ok(())
}

/// Calls `visit` with every value that a pattern such as `nodes/*/children/*` reaches, and its JSON pointer. Refuses arrays on the
/// way where objects are to be: the typed conversion takes their values for the fields.
fn each<'a>(
    source: &Source,
    root: &'a Value,
    pattern: &str,
    visit: &mut dyn FnMut(&'a Value, &str) -> Result<(), LoadError>,
) -> Result<(), LoadError> {
    fn walk<'a>(
        source: &Source,
        value: &'a Value,
        rest: &[&str],
        place: &mut String,
        visit: &mut dyn FnMut(&'a Value, &str) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        let Some((&step, rest)) = rest.split_first() else {
            return visit(value, place);
        };
        let length = place.len();
        match value {
            Value::Array(entries) if step == "*" => {
                for (index, entry) in entries.iter().enumerate() {
                    let _ = write!(place, "/{index}");
                    walk(source, entry, rest, place, visit)?;
                    place.truncate(length);
                }
            }
            Value::Object(entries) => {
                for (key, entry) in entries.iter().filter(|(key, _)| step == "*" || *key == step) {
                    let _ = write!(place, "/{}", key.replace('~', "~0").replace('/', "~1"));
                    walk(source, entry, rest, place, visit)?;
                    place.truncate(length);
                }
            }
            Value::Array(_) => return Err(source.invalid(&*place, "an array, must be an object", REPAIR)),
            // Values of other wrong types are reported by the typed conversion.
            _ => {}
        }
        Ok(())
    }
    let steps: Vec<&str> = pattern.split('/').collect();
    walk(source, root, &steps, &mut String::new(), visit)
}

/// The array at a JSON pointer, empty if absent.
fn array<'a>(source: &Source, root: &'a Value, place: &str) -> Result<&'a [Value], LoadError> {
    match root.pointer(place) {
        None => Ok(&[]),
        Some(Value::Array(entries)) => Ok(entries),
        Some(other) => Err(source.invalid(place, format!("{}, must be an array", brief(other)), REPAIR)),
    }
}

fn typed_array<T: DeserializeOwned>(source: &Source, root: &Value, place: &str) -> Result<Vec<T>, LoadError> {
    array(source, root, place)?
        .iter()
        .enumerate()
        .map(|(index, value)| typed(value).map_err(|error| source.invalid(format!("{place}/{index}"), error, REPAIR)))
        .collect()
}

/// Converts one JSON object to a type of the `gltf` crate.
pub(super) fn typed<T: DeserializeOwned>(value: &Value) -> Result<T, String> {
    // Belt: none of the conversions used here is known to panic.
    guarded("the glTF library cannot read this object", || T::deserialize(value).map_err(|error| error.to_string()))
}

fn texture_source(texture: &Value) -> TextureSource {
    // Of two images of one texture that of every reader is the one that others were made from.
    let read = TEXTURE_EXTENSIONS.iter().filter(|name| READ_EXTENSIONS.contains(name));
    let mut sources =
        std::iter::once(&texture["source"]).chain(read.map(|name| &texture["extensions"][*name]["source"]));
    TextureSource {
        image: sources.find_map(Value::as_u64).map(|index| index as usize),
        sampler: texture["sampler"].as_u64().map(|index| index as usize),
        extension: TEXTURE_EXTENSIONS.iter().find(|name| texture["extensions"][**name].is_object()).copied(),
    }
}

fn indices_in(values: &[Value]) -> Vec<usize> {
    values.iter().filter_map(Value::as_u64).map(|index| index as usize).collect()
}

fn brief(value: &Value) -> String {
    match value {
        Value::Array(_) => "an array".into(),
        Value::Object(_) => "an object".into(),
        Value::String(text) => format!("the string {:?}", text.chars().take(40).collect::<String>()),
        other => other.to_string(),
    }
}
