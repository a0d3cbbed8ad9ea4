//! `relight --glb`: the scene as it looks in one lighting, for programs that know nothing of lightmaps.
//!
//! glTF has no lightmaps. What every reader has is a texture of emission with coordinates of its own: it holds what surfaces send out,
//! direct light and emission with it, in the layout of the light map, and nothing else of a material is left but its holes.

use glam::{Affine2, Vec3, Vec4};
use localprt_runtime::passes::direct_lightmap::direct_lightmap;
use localprt_runtime::{CoverageMap, Relit, SceneLight};
use localprt_scenes::{AlphaMode, Image, Material, Scene, Texture, TextureRef, Wrap, linear_to_srgb};

/// Texels around charts that take the light of their neighbors, so that filtering finds nothing black.
const GUTTER: usize = 4;
/// Share of the texels that are not brighter than what the texture can hold: the sun on few of them must not leave others without bits.
const WITHIN: f64 = 0.999;
/// What white stands for at least, W sr^-1 m^-2: scenes without light have no strength of zero.
const DARKEST: f32 = 1e-3;

/// A scene with its light in it: the same meshes, materials that send it out, one image more, and no lights.
///
/// What shines and the irradiance after the last gather belong to the scene's own light map.
pub fn lit_scene(scene: &Scene, shining: &SceneLight, relit: &Relit) -> Scene {
    let mut map = CoverageMap::uncovered(shining.surface.size);
    direct_lightmap(&shining.surface, Some(&relit.maps.irradiance), 1.0, &mut map);
    let strength = brightest(map.texels());
    let mut lit = Scene { images: Vec::new(), textures: Vec::new(), ..scene.clone() };
    for material in &mut lit.materials {
        // Holes are all that is left of the base color.
        let alpha = material.base_color_texture.take().filter(|_| material.alpha != AlphaMode::Opaque);
        *material = Material {
            name: std::mem::take(&mut material.name),
            base_color: Vec3::ZERO.extend(material.base_color.w),
            base_color_texture: alpha.map(|reference| kept(scene, &mut lit.textures, &mut lit.images, reference)),
            emission: Vec3::splat(strength),
            metallic: 0.0,
            alpha: material.alpha,
            double_sided: material.double_sided,
            ..Material::default()
        };
    }
    let light = TextureRef {
        texture: lit.textures.len(),
        uv_set: scene.light_map_set.unwrap_or(1),
        transform: Affine2::IDENTITY,
    };
    lit.textures.push(Texture {
        image: lit.images.len(),
        wrap_u: Wrap::ClampToEdge,
        wrap_v: Wrap::ClampToEdge,
        nearest: false,
    });
    lit.images.push(picture(&map, strength));
    lit.materials.iter_mut().for_each(|material| material.emission_texture = Some(light));
    lit.meshes.iter_mut().for_each(|mesh| mesh.variants.clear());
    lit.variants.clear();
    lit.lights.clear();
    lit
}

/// A texture of the scene in the lists of another one.
fn kept(scene: &Scene, textures: &mut Vec<Texture>, images: &mut Vec<Image>, reference: TextureRef) -> TextureRef {
    let texture = scene.textures[reference.texture];
    let image = &scene.images[texture.image];
    let number = images.iter().position(|there| there.name == image.name && there.rgba == image.rgba);
    let number = number.unwrap_or_else(|| {
        images.push(image.clone());
        images.len() - 1
    });
    textures.push(Texture { image: number, ..texture });
    TextureRef { texture: textures.len() - 1, ..reference }
}

/// The light map as an image whose white is `strength`, W sr^-1 m^-2.
fn picture(map: &CoverageMap, strength: f32) -> Image {
    let texel = |texel: &Vec4| (texel.truncate() / strength).extend(1.0).to_array().map(linear_to_srgb);
    Image {
        name: "light".into(),
        width: map.size(),
        height: map.size(),
        rgba: dilated(map.texels(), map.size() as usize).iter().flat_map(texel).collect(),
        encoded: None,
    }
}

/// Radiance that the texture's white stands for: that of the brightest texels, but for a few. Texels have a w of 1 where there is light.
fn brightest(texels: &[Vec4]) -> f32 {
    let covered = texels.iter().filter(|texel| texel.w > 0.0);
    let mut values: Vec<f32> = covered.map(|texel| texel.truncate().max_element()).collect();
    values.sort_by(f32::total_cmp);
    let at = (values.len() as f64 * WITHIN) as usize;
    values.get(at).or(values.last()).copied().unwrap_or(0.0).max(DARKEST)
}

/// Square texels with light around charts, w 1 where there is some.
fn dilated(texels: &[Vec4], side: usize) -> Vec<Vec4> {
    let mut texels = texels.to_vec();
    for _ in 0..GUTTER {
        let before = texels.clone();
        for (texel, value) in texels.iter_mut().enumerate().filter(|(_, value)| value.w == 0.0) {
            let (x, y) = (texel % side, texel / side);
            let [left, right] = [x.saturating_sub(1), (x + 1).min(side - 1)];
            let [top, bottom] = [y.saturating_sub(1), (y + 1).min(side - 1)];
            let around = (top..=bottom).flat_map(|row| (left..=right).map(move |column| row * side + column));
            let sum: Vec4 = around.map(|neighbor| before[neighbor]).sum();
            if sum.w > 0.0 {
                *value = sum / sum.w;
            }
        }
    }
    texels
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_runtime::LightMaps;

    const NOTHING: [Vec4; 25] = [Vec4::ZERO; 25];

    #[test]
    fn light_goes_on_around_charts() {
        let light = Vec4::new(3.0, 2.0, 1.0, 1.0);
        let mut texels = NOTHING;
        texels[12] = light;
        // Two steps reach all of 5 x 5 texels, each by the light of the only neighbor that has some.
        assert_eq!(dilated(&texels, 5), [light; 25]);
        assert_eq!(dilated(&NOTHING, 5), NOTHING);
    }

    #[test]
    fn white_is_the_brightest_light_but_for_a_few_texels() {
        assert_eq!(brightest(&NOTHING), DARKEST);
        let mut sunny = vec![Vec4::ONE; 10_000];
        assert_eq!(brightest(&sunny), 1.0);
        // Five in ten thousand are fewer than one in a thousand, twenty are more.
        sunny[..5].fill(Vec4::splat(100.0));
        assert_eq!(brightest(&sunny), 1.0);
        sunny[..20].fill(Vec4::splat(100.0));
        assert_eq!(brightest(&sunny), 100.0);
    }

    #[test]
    fn holes_are_all_that_is_left_of_materials() {
        let mut scene = localprt_scenes::builtin::scene("atrium").expect("a scene");
        scene.materials[0].transmission = 1.0;
        let shining = SceneLight::default();
        let maps = LightMaps::of_irradiance(CoverageMap::uncovered(1));
        let relit = Relit { maps, ..Relit::default() };
        let lit = lit_scene(&scene, &shining, &relit);
        // The leaves alone have holes.
        assert_eq!((lit.images.len(), lit.textures.len(), lit.lights.len()), (2, 2, 0));
        let with_holes = lit.materials.iter().filter(|material| material.base_color_texture.is_some());
        assert_eq!(with_holes.map(|material| material.name.as_str()).collect::<Vec<_>>(), ["leaves"]);
        assert!(lit.materials.iter().all(|material| material.transmission == 0.0));
        assert_eq!(lit.materials.len(), scene.materials.len());
    }
}
