//! Materials, and the textures and images that they use.

use super::accessors::View;
use super::document::{Document, pointer, remedy_for, typed};
use super::error::{LoadError, Source};
use super::resources::Resources;
use crate::scene::{AlphaMode, Image, Material, Texture, TextureRef, Wrap};
use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode as JsonAlphaMode;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use std::collections::BTreeSet;

const REPAIR: &str = "correct the material and export again";
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// All materials of the file, with the textures and images that they use in file order.
pub(super) struct Appearance {
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub images: Vec<Image>,
}

/// Converts all materials, and reads the images that they use.
pub(super) fn read(
    source: &Source,
    document: &Document,
    views: &[View<'_>],
    resources: &mut Resources<'_>,
) -> Result<Appearance, LoadError> {
    let mut materials = Vec::with_capacity(document.materials.len());
    for (index, material) in document.materials.iter().enumerate() {
        materials.push(convert(source, material, index)?);
    }
    make_names_unique(&mut materials);

    // Only what a material uses is read; slots first hold the file's indices and are renumbered here.
    let used_textures: BTreeSet<usize> = slots(&mut materials).map(|slot| slot.texture).collect();
    let mut sources = Vec::new();
    for &index in &used_textures {
        sources.push(image_of(source, document, index)?);
    }
    let used_images: Vec<usize> = sources.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
    let mut images = Vec::with_capacity(used_images.len());
    for &index in &used_images {
        images.push(resources.image(document, views, index)?);
    }
    let used_textures: Vec<usize> = used_textures.into_iter().collect();
    let textures = used_textures
        .iter()
        .zip(&sources)
        .map(|(&texture, image)| {
            let sampler = document.textures[texture].sampler.map(|sampler| &document.samplers[sampler]);
            sampled(rank(&used_images, *image), sampler)
        })
        .collect();
    for slot in slots(&mut materials) {
        slot.texture = rank(&used_textures, slot.texture);
    }
    Ok(Appearance { materials, textures, images })
}

/// A name that no material has yet: the wish, or the wish with a number.
pub(super) fn unused_name(taken: &BTreeSet<String>, wish: &str, number: usize) -> String {
    let numbered = (number..).map(|number| format!("{wish}_{number}"));
    std::iter::once(wish.to_owned()).chain(numbered).find(|name| !taken.contains(name)).unwrap_or_default()
}

/// Position in a sorted list that holds the value.
fn rank(sorted: &[usize], value: usize) -> usize {
    sorted.partition_point(|&each| each < value)
}

fn slots(materials: &mut [Material]) -> impl Iterator<Item = &mut TextureRef> {
    materials.iter_mut().flat_map(|material| {
        let slots = [&mut material.base_color_texture, &mut material.emission_texture, &mut material.normal_texture];
        slots.into_iter().flatten()
    })
}

/// Names that the file gave keep precedence over numbered ones; of equal names the first stays as it is.
fn make_names_unique(materials: &mut [Material]) {
    let given: BTreeSet<String> = materials.iter().map(|material| material.name.clone()).collect();
    let mut taken = BTreeSet::new();
    for (index, material) in materials.iter_mut().enumerate() {
        if material.name.is_empty() {
            material.name = unused_name(&given, &format!("material_{index}"), 2);
        }
        if taken.contains(&material.name) {
            let avoid = given.union(&taken).cloned().collect();
            material.name = unused_name(&avoid, &material.name, index);
        }
        taken.insert(material.name.clone());
    }
}

fn convert(source: &Source, material: &json::Material, index: usize) -> Result<Material, LoadError> {
    let place = pointer("materials", index);
    let pbr = &material.pbr_metallic_roughness;
    let extensions = material.extensions.as_ref();
    let strength = extensions.and_then(|extensions| extensions.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let alpha = match material.alpha_mode {
        Checked::Valid(JsonAlphaMode::Opaque) => AlphaMode::Opaque,
        Checked::Valid(JsonAlphaMode::Mask) => {
            AlphaMode::Mask { cutoff: material.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0) }
        }
        Checked::Valid(JsonAlphaMode::Blend) => AlphaMode::Blend,
        Checked::Invalid => {
            return Err(source.invalid(format!("{place}/alphaMode"), "an unknown alphaMode", REPAIR));
        }
    };
    let slots = Slots { source, place: &place };
    let mut converted = Material {
        name: material.name.clone().unwrap_or_default(),
        base_color: Vec4::from_array(pbr.base_color_factor.0),
        base_color_texture: slots.info("pbrMetallicRoughness/baseColorTexture", pbr.base_color_texture.as_ref())?,
        emission: Vec3::from_array(material.emissive_factor.0) * strength,
        emission_texture: slots.info("emissiveTexture", material.emissive_texture.as_ref())?,
        normal_texture: slots.normal(material.normal_texture.as_ref())?,
        normal_scale: material.normal_texture.as_ref().map_or(1.0, |texture| texture.scale),
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        alpha,
        double_sided: material.double_sided,
        transmission: transmission(extensions),
    };
    if let Some(value) = extensions.and_then(|extensions| extensions.others.get(SPECULAR_GLOSSINESS)) {
        slots.specular_glossiness(&mut converted, value)?;
    }
    check(source, &place, &converted)?;
    Ok(converted)
}

/// The factor of KHR_materials_transmission; its texture is not read.
fn transmission(extensions: Option<&json::extensions::material::Material>) -> f32 {
    let extension = extensions.and_then(|extensions| extensions.others.get("KHR_materials_transmission"));
    let factor = extension.and_then(|extension| extension.get("transmissionFactor")?.as_f64());
    factor.map_or(0.0, |factor| factor.clamp(0.0, 1.0) as f32)
}

/// Refuses numbers that light transport cannot use.
fn check(source: &Source, place: &str, material: &Material) -> Result<(), LoadError> {
    let unit = 0.0..=1.0;
    let color = material.base_color;
    if !color.to_array().iter().all(|value| unit.contains(value)) {
        return Err(source.invalid(place, format!("base color factor {color}, must be in 0..1"), REPAIR));
    }
    let emission = material.emission;
    if !emission.is_finite() || emission.min_element() < 0.0 {
        return Err(source.invalid(place, format!("emission {emission}, must be finite and not negative"), REPAIR));
    }
    let cutoff = if let AlphaMode::Mask { cutoff } = material.alpha { cutoff } else { 0.0 };
    for (name, value) in [
        ("normal scale", material.normal_scale),
        ("metallic factor", material.metallic),
        ("roughness factor", material.roughness),
        ("alpha cutoff", cutoff),
    ] {
        if !value.is_finite() {
            return Err(source.invalid(place, format!("{name} {value}, must be finite"), REPAIR));
        }
    }
    Ok(())
}

/// Reads texture slots of one material.
struct Slots<'a> {
    source: &'a Source,
    place: &'a str,
}

impl Slots<'_> {
    fn info(&self, name: &str, info: Option<&json::texture::Info>) -> Result<Option<TextureRef>, LoadError> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        self.slot(name, info.index.value(), info.tex_coord, transform).map(Some)
    }

    fn normal(&self, texture: Option<&json::material::NormalTexture>) -> Result<Option<TextureRef>, LoadError> {
        let Some(texture) = texture else { return Ok(None) };
        let value = texture.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let transform = value.map(typed::<TextureTransform>).transpose();
        let transform =
            transform.map_err(|error| self.source.invalid(format!("{}/normalTexture", self.place), error, REPAIR))?;
        self.slot("normalTexture", texture.index.value(), texture.tex_coord, transform.as_ref()).map(Some)
    }

    fn slot(
        &self,
        name: &str,
        texture: usize,
        tex_coord: u32,
        transform: Option<&TextureTransform>,
    ) -> Result<TextureRef, LoadError> {
        let uv_set = transform.and_then(|transform| transform.tex_coord).unwrap_or(tex_coord) as usize;
        let transform = transform.map_or(Affine2::IDENTITY, |transform| {
            texture_transform(transform.offset.0.into(), transform.rotation.0, transform.scale.0.into())
        });
        if !transform.is_finite() {
            let found = format!("KHR_texture_transform gives {transform}, must be finite");
            return Err(self.source.invalid(format!("{}/{name}", self.place), found, REPAIR));
        }
        Ok(TextureRef { texture, uv_set, transform })
    }

    /// The archived extension's diffuse part is the base color; it is not metallic.
    fn specular_glossiness(&self, material: &mut Material, value: &serde_json::Value) -> Result<(), LoadError> {
        let name = format!("extensions/{SPECULAR_GLOSSINESS}");
        let invalid = |error: String| self.source.invalid(format!("{}/{name}", self.place), error, REPAIR);
        let optional = |key: &str| value.get(key).filter(|value| !value.is_null());
        let factor = optional("diffuseFactor").map(typed::<[f32; 4]>).transpose().map_err(invalid)?;
        let info = optional("diffuseTexture").map(typed::<json::texture::Info>).transpose().map_err(invalid)?;
        let glossiness = optional("glossinessFactor").map(typed::<f32>).transpose().map_err(invalid)?;
        material.base_color = factor.map_or(Vec4::ONE, Vec4::from_array);
        material.base_color_texture = self.info(&format!("{name}/diffuseTexture"), info.as_ref())?;
        material.metallic = 0.0;
        material.roughness = 1.0 - glossiness.unwrap_or(1.0);
        Ok(())
    }
}

/// The matrix of KHR_texture_transform: translation * rotation * scale.
///
/// A positive angle turns texture coordinates counter-clockwise as one sees them on the image, whose v axis points down:
/// `u' = cos u + sin v`, `v' = -sin u + cos v`. The extension's text says so, its test model (TextureTransformTest)
/// marks it as correct, and viewers do it; its shader fragment, read in GLSL's column order, would turn the other way.
pub(crate) fn texture_transform(offset: Vec2, rotation: f32, scale: Vec2) -> Affine2 {
    // f64 so that the result is the rounding of the exact matrix, on every machine that rounds alike.
    let (sin, cos) = f64::from(rotation).sin_cos();
    let (x, y) = (f64::from(scale.x), f64::from(scale.y));
    let column = |a: f64, b: f64| Vec2::new(a as f32, b as f32);
    let matrix = Mat2::from_cols(column(cos * x, -sin * x), column(sin * y, cos * y));
    Affine2::from_mat2_translation(matrix, offset)
}

fn image_of(source: &Source, document: &Document, texture: usize) -> Result<usize, LoadError> {
    let found = &document.textures[texture];
    let place = pointer("textures", texture);
    match (found.image, found.extension) {
        (Some(image), _) => Ok(image),
        (None, Some(extension)) => {
            Err(source.unsupported(place, format!("an image stored only with {extension}"), remedy_for(extension)))
        }
        (None, None) => Err(source.invalid(place, "a texture without an image", REPAIR)),
    }
}

fn sampled(image: usize, sampler: Option<&json::texture::Sampler>) -> Texture {
    let wrap = |mode: &Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    };
    Texture {
        image,
        wrap_u: sampler.map_or(Wrap::Repeat, |sampler| wrap(&sampler.wrap_s)),
        wrap_v: sampler.map_or(Wrap::Repeat, |sampler| wrap(&sampler.wrap_t)),
        nearest: sampler.is_some_and(|sampler| sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest))),
    }
}
