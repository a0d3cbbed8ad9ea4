//! One lighting state of a baked file on the CPU: what shines, as the runtime's twins want it.
//!
//! Direct light is traced from the texels of the direct light map; the rest is `localprt_runtime`'s CPU relighter.

use crate::{
    lightmap::{Atlas, Texel, TexelMap, texels},
    rays::RayCaster,
};
use glam::Vec3;
use localprt_formats::{BakedView, quantize::pack_uv};
use localprt_runtime::{SceneTexels, SurfaceTexels, sky_sh};
use localprt_scenes::{Light, Lighting, Material, MaterialOverride, Scene, Sky, lighting::SurfaceShading};
use rayon::prelude::*;

/// Albedo, emission and traced direct irradiance of every covered texel of the direct light map.
///
/// One shadow ray per texel and light that reaches it.
pub fn surface_texels(caster: &RayCaster<'_>, lighting: &Lighting, baked: &BakedView<'_>) -> SurfaceTexels {
    let texels = scene_texels(caster.scene(), baked);
    let direct = traced_irradiance(caster, &texels, &lighting.lights);
    texels.shaded(&material_overrides(caster.scene(), lighting), lighting.albedo_override, direct)
}

/// What stays the same while lights and materials change: the texels that the bake's relight rays were made for, with
/// place, normals and the scene's own colors.
pub fn scene_texels(scene: &Scene, baked: &BakedView<'_>) -> SceneTexels {
    let (size, receiver_size) = (baked.metadata.direct_size, baked.metadata.lightmap_size);
    let mut has_receiver = vec![false; receiver_size as usize * receiver_size as usize];
    for &texel in baked.receiver_texel {
        has_receiver[texel as usize] = true;
    }
    let (light_map, receivers) = (Atlas::of_light_map(scene), Atlas::of(scene));
    let (TexelMap { texels, .. }, places) =
        texels::cover_visible(scene, &light_map, size, &receivers, receiver_size, &has_receiver);
    let plain = Lighting::default();
    let own = SurfaceShading::new(scene, &plain);
    let points = |value: &(dyn Fn(usize, usize, Vec3) -> Vec3 + Sync)| -> Vec<Vec3> {
        let of_texel = |texel: &Texel| value(texel.mesh as usize, texel.triangle as usize, texel.barycentrics);
        texels.par_iter().map(of_texel).collect()
    };
    SceneTexels {
        size,
        index: texels.iter().map(|texel| texel.index).collect(),
        lightmap_uv: places.iter().map(|place| pack_uv(place.to_array())).collect(),
        position: points(&|mesh, triangle, weights| {
            let corners = scene.corners(mesh, triangle);
            corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z
        }),
        normal: points(&|mesh, triangle, weights| scene.shading_normal(mesh, triangle, weights)),
        geometric_normal: points(&|mesh, triangle, _| scene.geometric_normal(mesh, triangle)),
        albedo: points(&|mesh, triangle, weights| own.albedo(mesh, triangle, weights)),
        emission: points(&|mesh, triangle, weights| own.emission(mesh, triangle, weights)),
        material: texels.iter().map(|texel| scene.meshes[texel.mesh as usize].material as u32).collect(),
    }
}

/// Direct irradiance of every texel, shadows traced.
pub fn traced_irradiance(caster: &RayCaster<'_>, texels: &SceneTexels, lights: &[Light]) -> Vec<Vec3> {
    let irradiance = |texel: usize| {
        let (position, normal) = (texels.position[texel], texels.normal[texel]);
        direct_irradiance(caster, lights, position, normal, texels.geometric_normal[texel])
    };
    (0..texels.len()).into_par_iter().map(irradiance).collect()
}

/// The lighting's overrides, by material index instead of name.
pub fn material_overrides(scene: &Scene, lighting: &Lighting) -> Vec<MaterialOverride> {
    let of_material = |material: &Material| lighting.materials.get(&material.name).copied().unwrap_or_default();
    scene.materials.iter().map(of_material).collect()
}

/// Irradiance straight from punctual lights at a surface point, W m^-2, with traced shadows.
///
/// Lights below the horizon of either normal give nothing.
pub fn direct_irradiance(
    caster: &RayCaster<'_>,
    lights: &[Light],
    position: Vec3,
    normal: Vec3,
    geometric_normal: Vec3,
) -> Vec3 {
    let origin = position + geometric_normal * caster.offset_m();
    let mut irradiance = Vec3::ZERO;
    for light in lights {
        let Some(incident) = light.incident(position) else { continue };
        let cosine = normal.dot(incident.dir_to_light);
        if cosine <= 0.0 || geometric_normal.dot(incident.dir_to_light) <= 0.0 {
            continue;
        }
        let free = if incident.distance.is_finite() {
            // A lamp may be flush with a surface.
            caster.visible(origin, light.position - incident.dir_to_light * caster.offset_m())
        } else {
            caster.escapes(origin, incident.dir_to_light)
        };
        if free {
            irradiance += incident.irradiance * cosine;
        }
    }
    irradiance
}

/// The sky as the relighter wants it: SH radiance for the sky columns and radiance along the relight rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkyInputs {
    /// `[n_sky]` SH coefficients; empty for a black sky.
    pub sh: Vec<Vec3>,
    /// `[n_rays]` radiances; empty for a black sky.
    pub rays: Vec<Vec3>,
}

/// Projects a sky for one baked file.
pub fn sky_inputs(sky: &Sky, baked: &BakedView<'_>) -> SkyInputs {
    if sky.is_black() {
        return SkyInputs::default();
    }
    SkyInputs {
        sh: sky_sh(sky, baked.metadata.sky_degree),
        rays: baked.ray_dirs.iter().map(|&[x, y, z, _]| sky.radiance(Vec3::new(x, y, z))).collect(),
    }
}
