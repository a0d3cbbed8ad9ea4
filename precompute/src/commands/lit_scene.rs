//! `relight --glb`: the scene as it looks in one lighting, for programs that know nothing of lightmaps.
//!
//! glTF has no lightmaps. What every reader has is a texture of emission with coordinates of its own: it holds what surfaces send out,
//! direct light and emission with it, in the layout of the light map, and nothing else of a material is left but its holes.

use glam::{Affine2, Vec3, Vec4};
use localprt_formats::BakedView;
use localprt_precompute::rays::RayCaster;
use localprt_runtime::passes::direct_lightmap::direct_lightmap;
use localprt_runtime::scene_light::scene_texels;
use localprt_runtime::{CoverageMap, Relit, SceneLight};
use localprt_scenes::{AlphaMode, Image, Lighting, Scene, Texture, TextureRef, Wrap, linear_to_srgb};

/// Texels around charts that take the light of their neighbors, so that filtering finds nothing black.
const GUTTER: usize = 4;
/// Share of the texels that are not brighter than what the texture can hold: the sun on few of them must not leave others without bits.
const WITHIN: f64 = 0.999;

/// The scene with its light in it: the same meshes, materials that send it out, and no lights.
pub fn lit_scene(caster: &RayCaster<'_>, baked: &BakedView<'_>, lighting: &Lighting, relit: &Relit) -> Scene {
    let light = SceneLight::traced(caster, &scene_texels(caster, baked), lighting, baked);
    let mut map = CoverageMap::uncovered(light.surface.size);
    direct_lightmap(&light.surface, Some(&relit.irradiance_map), 1.0, &mut map);
    let radiance = dilated(&map);
    let strength = brightest(&map);
    let mut scene = caster.scene().clone();
    let texture = scene.textures.len();
    scene.textures.push(Texture {
        image: scene.images.len(),
        wrap_u: Wrap::ClampToEdge,
        wrap_v: Wrap::ClampToEdge,
        nearest: false,
    });
    scene.images.push(Image {
        name: "light".into(),
        width: map.size(),
        height: map.size(),
        rgba: radiance
            .iter()
            .flat_map(|texel| (texel.truncate() / strength).extend(1.0).to_array().map(linear_to_srgb))
            .collect(),
        encoded: None,
    });
    let uv_set = scene.light_map_set.unwrap_or(1);
    for material in &mut scene.materials {
        let has_holes = material.alpha != AlphaMode::Opaque;
        material.base_color = Vec3::ZERO.extend(material.base_color.w);
        material.base_color_texture = material.base_color_texture.filter(|_| has_holes);
        material.emission = Vec3::splat(strength);
        material.emission_texture = Some(TextureRef { texture, uv_set, transform: Affine2::IDENTITY });
        material.normal_texture = None;
        (material.metallic, material.roughness) = (0.0, 1.0);
    }
    scene.lights.clear();
    scene
}

/// Radiance that the texture's white stands for: that of the brightest texels, but for a few.
fn brightest(map: &CoverageMap) -> f32 {
    let covered = (0..map.texels().len()).filter(|&texel| map.coverage(texel) > 0.0);
    let mut values: Vec<f32> = covered.map(|texel| map.color(texel).max_element()).collect();
    values.sort_by(f32::total_cmp);
    let at = (values.len() as f64 * WITHIN) as usize;
    values.get(at).or(values.last()).copied().unwrap_or(0.0).max(1e-3)
}

/// The map with light around its charts: `[size][size]`, w 1 where there is some.
fn dilated(map: &CoverageMap) -> Vec<Vec4> {
    let side = map.size() as usize;
    let color = |texel: usize| if map.coverage(texel) > 0.0 { map.color(texel).extend(1.0) } else { Vec4::ZERO };
    let mut texels: Vec<Vec4> = (0..side * side).map(color).collect();
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
