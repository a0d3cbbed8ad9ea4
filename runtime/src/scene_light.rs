//! What a scene gives to relighters: the texels of its direct light map, which stay, and what shines in a lighting.
//!
//! Direct light is traced from those texels here; [`crate::passes::direct_irradiance`] does it by shadow maps.

use crate::{RelightError, RelightInputs, SceneTexels, SurfacePoint, SurfaceTexels, TexelSample, sky_sh};
use glam::Vec3;
use localprt_formats::{BakedView, quantize::pack_uv};
use localprt_scenes::{Incident, Light, Lighting, MaterialOverride, Scene, Sky, lighting::SurfaceShading};
use localprt_surfaces::{
    atlas::{
        Atlas,
        samples::{SAMPLES, SampledMap},
        texels,
        texels::ReceiverMap,
    },
    rays::{FacePoint, RayCaster},
};
use rayon::prelude::*;

/// What shines in a scene: the same for every gather of a lighting.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneLight {
    /// Albedo, emission and direct irradiance of the texels of the direct light map.
    pub surface: SurfaceTexels,
    /// The sky.
    pub sky: SkyInputs,
}

impl SceneLight {
    /// Of a scene in a lighting, with `direct` irradiance of every texel, W m^-2.
    pub fn new(
        scene: &Scene,
        texels: &SceneTexels,
        lighting: &Lighting,
        direct: Vec<Vec3>,
        baked: &BakedView<'_>,
    ) -> Self {
        let surface = texels.shaded(&material_overrides(scene, lighting), lighting.albedo_override, direct);
        Self { surface, sky: sky_inputs(&lighting.sky, baked) }
    }

    /// The same with direct light traced: a shadow ray per sample of a texel and light that reaches it.
    pub fn traced(caster: &RayCaster<'_>, texels: &SceneTexels, lighting: &Lighting, baked: &BakedView<'_>) -> Self {
        let direct = traced_irradiance(caster, texels, &lighting.lights);
        Self::new(caster.scene(), texels, lighting, direct, baked)
    }

    /// For so many gathers.
    pub fn inputs(&self, bounces: u32) -> RelightInputs<'_> {
        RelightInputs { sky_sh: &self.sky.sh, sky_rays: &self.sky.rays, bounces, ..RelightInputs::new(&self.surface) }
    }
}

/// Rays against a scene.
///
/// # Errors
/// [`RelightError::Scene`].
pub(crate) fn caster(scene: &Scene) -> Result<RayCaster<'_>, RelightError> {
    RayCaster::new(scene).map_err(|cause| RelightError::Scene { cause })
}

/// What stays the same while lights and materials change: the texels that the bake's relight rays were made for, with
/// place, normals, samples and the scene's own colors, which are means over the samples.
pub fn scene_texels(caster: &RayCaster<'_>, baked: &BakedView<'_>) -> SceneTexels {
    let scene = caster.scene();
    let (size, receiver_size) = (baked.metadata.direct_size, baked.metadata.lightmap_size);
    let mut has_receiver = vec![false; receiver_size as usize * receiver_size as usize];
    for &texel in baked.receiver_texel {
        has_receiver[texel as usize] = true;
    }
    let (light_map, receivers) = (Atlas::of_light_map(scene), Atlas::of(scene));
    let receivers = ReceiverMap { atlas: &receivers, size: receiver_size, has_receiver: &has_receiver };
    let (map, places) = texels::cover_visible(scene, &light_map, size, &receivers);
    let plain = Lighting::default();
    let own = SurfaceShading::new(scene, &plain);
    let of_light_map =
        SampledMap { caster, atlas: &light_map, map: &map, is_wanted: &|point| receivers.sends_light(scene, point) };
    let bands = of_light_map.visit(
        room_for,
        |texel| Some(texel.point().surface_point(scene)),
        |band, texel, samples| {
            let SurfacePoint { position, normal, geometric_normal } = texel.point().surface_point(scene);
            band.position.push(position);
            band.normal.push(normal);
            band.geometric_normal.push(geometric_normal);
            band.samples
                .extend(samples.points.iter().map(|point| TexelSample::new(&point.surface_point(scene), position)));
            band.sample_end.push(band.samples.len() as u32);
            let own_point = [texel.point()];
            let points = if samples.points.is_empty() { &own_point[..] } else { &samples.points };
            let mean =
                |color: &dyn Fn(&FacePoint) -> Vec3| points.iter().map(color).sum::<Vec3>() / points.len() as f32;
            band.albedo.push(mean(&|point| own.albedo(point.mesh, point.triangle, point.barycentrics)));
            band.emission.push(mean(&|point| own.emission(point.mesh, point.triangle, point.barycentrics)));
        },
    );
    let mut texels = SceneTexels {
        size,
        index: map.texels.iter().map(|texel| texel.index).collect(),
        lightmap_uv: places.iter().map(|place| pack_uv(place.to_array())).collect(),
        material: map.texels.iter().map(|texel| scene.meshes[texel.mesh as usize].material as u32).collect(),
        ..SceneTexels::default()
    };
    texels.samples.reserve_exact(bands.iter().map(|band| band.samples.len()).sum());
    for band in bands {
        let first = texels.samples.len() as u32;
        texels.sample_end.extend(band.sample_end.iter().map(|end| first + end));
        texels.samples.extend(band.samples);
        texels.position.extend(band.position);
        texels.normal.extend(band.normal);
        texels.geometric_normal.extend(band.geometric_normal);
        texels.albedo.extend(band.albedo);
        texels.emission.extend(band.emission);
    }
    texels
}

fn room_for(n_texels: usize) -> SceneTexels {
    let vectors = || Vec::with_capacity(n_texels);
    SceneTexels {
        position: vectors(),
        normal: vectors(),
        geometric_normal: vectors(),
        albedo: vectors(),
        emission: vectors(),
        sample_end: Vec::with_capacity(n_texels),
        samples: Vec::with_capacity(n_texels * SAMPLES),
        ..SceneTexels::default()
    }
}

/// Direct irradiance of every texel, the mean over its samples, shadows traced.
pub fn traced_irradiance(caster: &RayCaster<'_>, texels: &SceneTexels, lights: &[Light]) -> Vec<Vec3> {
    let at =
        |point: &SurfacePoint| direct_irradiance(caster, lights, point.position, point.normal, point.geometric_normal);
    (0..texels.len()).into_par_iter().map(|texel| texels.mean(texel, at)).collect()
}

/// The lighting's overrides, by material index instead of name.
pub fn material_overrides(scene: &Scene, lighting: &Lighting) -> Vec<MaterialOverride> {
    overrides_of(scene.materials.iter().map(|material| material.name.as_str()), lighting)
}

/// The same of materials of these names.
pub(crate) fn overrides_of<'a>(names: impl Iterator<Item = &'a str>, lighting: &Lighting) -> Vec<MaterialOverride> {
    names.map(|name| lighting.materials.get(name).copied().unwrap_or_default()).collect()
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
    lights
        .iter()
        .filter_map(|light| {
            let facing = facing_light(light, position, normal, geometric_normal)?;
            facing.is_free(caster, light, origin).then_some(facing.irradiance)
        })
        .sum()
}

/// A light above the horizon of a surface point, its shadow not asked for yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingLight {
    /// Irradiance of the surface if nothing is in between, W m^-2.
    pub irradiance: Vec3,
    incident: Incident,
}

/// What a light sends to a surface point; `None` from below the horizon of either normal.
pub fn facing_light(light: &Light, position: Vec3, normal: Vec3, geometric_normal: Vec3) -> Option<FacingLight> {
    let incident = light.incident(position)?;
    let cosine = normal.dot(incident.dir_to_light);
    let is_above = cosine > 0.0 && geometric_normal.dot(incident.dir_to_light) > 0.0;
    is_above.then_some(FacingLight { irradiance: incident.irradiance * cosine, incident })
}

impl FacingLight {
    /// Whether nothing is between the light and the origin of rays from the point. Traces one ray.
    pub fn is_free(&self, caster: &RayCaster<'_>, light: &Light, origin: Vec3) -> bool {
        let dir_to_light = self.incident.dir_to_light;
        match self.incident.distance.is_finite() {
            // A lamp may be flush with a surface.
            true => caster.visible(origin, light.position - dir_to_light * caster.offset_m()),
            false => caster.escapes(origin, dir_to_light),
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use localprt_formats::{BakedArrays, Metadata};
    use localprt_scenes::{LightKind, Material, Mesh};

    const SIZE: u32 = 16;
    const TEXEL_M: f32 = 0.25;

    /// A level quad that looks up, 4 m deep.
    fn quad(height: f32, from_x: f32, to_x: f32) -> Mesh {
        let corners = [(from_x, 0.0), (from_x, 4.0), (to_x, 4.0), (to_x, 0.0)];
        Mesh {
            positions: corners.map(|(x, z)| Vec3::new(x, height, z)).to_vec(),
            normals: vec![Vec3::Y; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    /// Direct irradiance of the middle row of a floor's texels, below a sheet that ends at `edge_x`, under a sun of 1 W m^-2.
    fn row_below_a_sheet(edge_x: f32) -> Vec<f32> {
        let mut floor = quad(0.0, 0.0, 4.0);
        floor.uv_sets = vec![Vec::new(), floor.positions.iter().map(|at| Vec2::new(at.x, at.z) / 4.0).collect()];
        let scene = Scene {
            meshes: vec![floor, quad(1.0, -1.0, edge_x)],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let sun = Light {
            name: String::new(),
            kind: LightKind::Directional,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            color: Vec3::ONE,
            intensity: 1.0,
            range: None,
        };
        let baked = BakedArrays {
            metadata: Metadata { lightmap_size: SIZE, direct_size: SIZE, ..Metadata::default() },
            receiver_texel: (0..SIZE * SIZE).collect(),
            ..BakedArrays::default()
        };
        let caster = RayCaster::new(&scene).expect("tree");
        let lighting = Lighting { lights: vec![sun], ..Lighting::default() };
        let view = baked.view();
        let surface = SceneLight::traced(&caster, &scene_texels(&caster, &view), &lighting, &view).surface;
        assert_eq!(surface.index, (0..SIZE * SIZE).collect::<Vec<u32>>());
        let row = SIZE / 2 * SIZE;
        surface.direct[row as usize..][..SIZE as usize].iter().map(|direct| direct.x).collect()
    }

    #[test]
    fn a_texel_at_the_edge_of_a_shadow_has_the_share_of_it_that_is_lit() {
        let column = 6;
        let mut sum = 0.0;
        for step in 0..16 {
            let shade = (step as f32 + 0.5) / 16.0;
            let row = row_below_a_sheet((column as f32 + shade) * TEXEL_M);
            assert!(row[..column].iter().all(|&direct| direct == 0.0));
            // Normals are stored in 16 bits.
            assert!(row[column + 1..].iter().all(|&direct| (direct - 1.0).abs() < 1e-6));
            // Samples stand for a quarter of the texel each, and lie in the middle of it.
            assert!((row[column] - (1.0 - shade)).abs() <= 0.125, "{shade} in shadow: {}", row[column]);
            sum += row[column];
        }
        assert!((sum / 16.0 - 0.5).abs() < 1e-6, "{sum}");
    }
}
