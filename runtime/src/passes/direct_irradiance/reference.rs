//! CPU twin of the direct irradiance.

use crate::passes::shadow_map::{CasterBounds, ShadowCasters, ShadowMap, ShadowView, shadow_map, shadow_views};
use crate::surface::SceneTexels;
use glam::Vec3;
use localprt_scenes::{Light, SurfacePoint};
use rayon::prelude::*;

/// `[n_covered]` irradiance straight from punctual lights, W m^-2, shadowed by maps of `shadow_map_size` texels per side: the
/// mean over each texel's samples.
///
/// Lights below the horizon of either normal give nothing, as when shadows are traced.
///
/// # Panics
/// If `texels` or `casters` do not pass their checks.
pub fn direct_irradiance(
    texels: &SceneTexels,
    casters: &ShadowCasters,
    lights: &[Light],
    shadow_map_size: u32,
) -> Vec<Vec3> {
    let bounds = casters.bounds();
    let mut irradiance = vec![Vec3::ZERO; texels.len()];
    for light in lights {
        let views = shadow_views(light, &bounds, shadow_map_size);
        let maps: Vec<ShadowMap> = views.iter().map(|view| shadow_map(view, casters, shadow_map_size)).collect();
        add_light(texels, &bounds, light, &views, &maps, &mut irradiance);
    }
    irradiance
}

/// Adds one light to `irradiance`, given its views and a map for each; nothing if it has no views.
pub fn add_light(
    texels: &SceneTexels,
    bounds: &CasterBounds,
    light: &Light,
    views: &[ShadowView],
    maps: &[ShadowMap],
    irradiance: &mut [Vec3],
) {
    if views.is_empty() {
        return;
    }
    let rounding_m = bounds.rounding_m();
    irradiance.par_iter_mut().enumerate().for_each(|(texel, sum)| {
        *sum += texels.mean(texel, |point| {
            let SurfacePoint { position, normal, geometric_normal } = *point;
            let Some(incident) = light.incident(position) else { return Vec3::ZERO };
            let cosine = normal.dot(incident.dir_to_light);
            if cosine <= 0.0 || geometric_normal.dot(incident.dir_to_light) <= 0.0 {
                return Vec3::ZERO;
            }
            let face = if views.len() == 6 { ShadowView::face(position - light.position) } else { 0 };
            let visibility = maps[face].visibility(&views[face], position, geometric_normal, rounding_m);
            incident.irradiance * (cosine * visibility)
        });
    });
}
