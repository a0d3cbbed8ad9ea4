//! Outgoing radiance of surfaces: albedo, direct and indirect light, emission.

use crate::rays::SurfaceHit;
use glam::{Vec2, Vec3};
use localprt_scenes::{Lighting, MaterialOverride, Scene};
use std::f32::consts::PI;

/// What surfaces reflect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Albedo {
    /// The scene's base colours.
    #[default]
    Scene,
    /// The same share everywhere, 0..=1: shows light alone.
    Grey(f32),
}

/// Indirect irradiance in lightmap coordinates.
#[derive(Clone, Debug)]
pub struct IrradianceMap {
    size: u32,
    /// `[size][size]`; NaN where nothing is stored.
    texels: Vec<Vec3>,
}

impl IrradianceMap {
    /// `values` is `[n_receivers]` RGB irradiance, `receiver_texel` the texel of each (`y * size + x`, row 0 at v = 0),
    /// `gutters` the texels filled from a receiver: `[texel, receiver]`. All indices are below their limits.
    pub fn new(size: u32, receiver_texel: &[u32], gutters: &[[u32; 2]], values: &[Vec3]) -> Self {
        let mut texels = vec![Vec3::NAN; size as usize * size as usize];
        for (&texel, &value) in receiver_texel.iter().zip(values) {
            texels[texel as usize] = value;
        }
        for &[texel, receiver] in gutters {
            texels[texel as usize] = values[receiver as usize];
        }
        Self { size, texels }
    }

    /// Texels per side.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// `[size][size]` as an image, row 0 at v = 0; black where nothing is stored.
    pub fn to_image(&self) -> Vec<Vec3> {
        self.texels.iter().map(|&texel| if texel.is_nan() { Vec3::ZERO } else { texel }).collect()
    }

    /// Bilinear over the stored texels around a coordinate; black if there is none.
    pub fn sample(&self, uv: Vec2) -> Vec3 {
        if self.size == 0 || !uv.is_finite() {
            return Vec3::ZERO;
        }
        // Texel centres lie at (i + 0.5) / size.
        let at = uv.clamp(Vec2::ZERO, Vec2::ONE) * self.size as f32 - 0.5;
        let base = at.floor();
        let fraction = at - base;
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let corner = (base + Vec2::new(x, y)).clamp(Vec2::ZERO, Vec2::splat(self.size as f32 - 1.0)).as_uvec2();
            let value = self.texels[corner.y as usize * self.size as usize + corner.x as usize];
            let weight = (1.0 - (x - fraction.x).abs()) * (1.0 - (y - fraction.y).abs());
            if !value.is_nan() && weight > 0.0 {
                sum += value * weight;
                weights += weight;
            }
        }
        if weights > 0.0 { sum / weights } else { Vec3::ZERO }
    }
}

/// Surfaces of a scene with one lighting state's overrides and indirect light.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    indirect: &'a IrradianceMap,
    albedo: Albedo,
    /// By material.
    overrides: Vec<MaterialOverride>,
}

impl<'a> Surfaces<'a> {
    /// `scene` carries the lightmap coordinates of `indirect`. The lighting gives overrides only; a grey `albedo` wins
    /// over its own.
    pub fn new(scene: &'a Scene, lighting: &Lighting, indirect: &'a IrradianceMap, albedo: Albedo) -> Self {
        let overrides =
            scene.materials.iter().map(|material| lighting.materials.get(&material.name).copied().unwrap_or_default());
        let albedo = match (albedo, lighting.albedo_override) {
            (Albedo::Scene, Some(share)) => Albedo::Grey(share),
            _ => albedo,
        };
        Self { scene, indirect, albedo, overrides: overrides.collect() }
    }

    /// Radiance that leaves a hit towards the ray's origin: Le + albedo/pi (E_direct + E_indirect). `direct` gives the
    /// direct irradiance at a position and unit normal; the back of a one-sided surface is black.
    pub fn radiance(&self, hit: &SurfaceHit, direct: impl Fn(Vec3, Vec3) -> Vec3) -> Vec3 {
        let Some(point) = hit.point else { return Vec3::ZERO };
        let mesh = &self.scene.meshes[point.mesh];
        let own = &self.overrides[mesh.material];
        let albedo = match (self.albedo, own.albedo) {
            (Albedo::Grey(share), _) => Vec3::splat(share),
            (Albedo::Scene, Some(albedo)) => albedo,
            (Albedo::Scene, None) => self.scene.base_color(point.mesh, point.triangle, point.barycentrics).truncate(),
        };
        let emission =
            own.emission.unwrap_or_else(|| self.scene.emission(point.mesh, point.triangle, point.barycentrics));
        let indirect = mesh.lightmap_uv().map_or(Vec3::ZERO, |set| {
            let corners = mesh.triangles[point.triangle].map(|vertex| set[vertex as usize]);
            let weights = point.barycentrics;
            self.indirect.sample(corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z)
        });
        let normal = self.scene.shading_normal(point.mesh, point.triangle, point.barycentrics);
        // The other side of a double-sided face.
        let normal = if normal.dot(hit.normal) < 0.0 { -normal } else { normal };
        emission + albedo / PI * (direct(hit.position, normal) + indirect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::tests::floor;
    use crate::rays::RayCaster;

    /// Texel (x, y) of 4 x 4 holds (x, y, 0); the last row is not stored, but for its first texel, a gutter.
    fn map() -> IrradianceMap {
        let texels: Vec<u32> = (0..12).collect();
        let values: Vec<Vec3> =
            texels.iter().map(|&texel| Vec3::new((texel % 4) as f32, (texel / 4) as f32, 0.0)).collect();
        IrradianceMap::new(4, &texels, &[[12, 5]], &values)
    }

    #[test]
    fn lookups_interpolate_between_texel_centres_that_are_stored() {
        let map = map();
        assert_eq!(map.sample(Vec2::new(0.125, 0.125)), Vec3::ZERO);
        assert_eq!(map.sample(Vec2::new(0.5, 0.25)), Vec3::new(1.5, 0.5, 0.0));
        assert_eq!(map.sample(Vec2::new(0.125, 0.875)), Vec3::new(1.0, 1.0, 0.0), "the gutter");
        // Half way between row 2 and the missing row 3: row 2 alone.
        assert_eq!(map.sample(Vec2::new(0.875, 0.75)), Vec3::new(3.0, 2.0, 0.0));
        assert_eq!(map.sample(Vec2::ONE), Vec3::ZERO, "nothing near");
        assert_eq!(map.sample(Vec2::NAN), Vec3::ZERO);
        assert_eq!(map.to_image()[15], Vec3::ZERO);
    }

    #[test]
    fn a_surface_shows_emission_and_reflected_light() {
        let mut scene = floor();
        scene.materials[0].base_color = glam::Vec4::new(0.5, 0.25, 1.0, 1.0);
        scene.materials[0].emission = Vec3::new(0.0, 0.0, 2.0);
        let caster = RayCaster::new(&scene).expect("a tree");
        let map = map();
        // u = 0.125, v = 0.375: texel (0, 1).
        let above = Vec3::new(-0.75, 1.0, -0.25);
        let hit = caster.closest_hit(above, Vec3::NEG_Y).expect("the floor");
        let direct = |_: Vec3, normal: Vec3| Vec3::splat(3.0 * normal.y);
        let close = |value: Vec3, expected: Vec3| assert!(value.abs_diff_eq(expected, 1e-5), "{value} {expected}");
        let mut lighting = Lighting::default();
        let surfaces = Surfaces::new(&scene, &lighting, &map, Albedo::Scene);
        close(surfaces.radiance(&hit, direct), Vec3::new(1.5 / PI, 1.0 / PI, 2.0 + 3.0 / PI));
        let grey = Surfaces::new(&scene, &lighting, &map, Albedo::Grey(1.0));
        close(grey.radiance(&hit, |_, _| Vec3::ZERO), Vec3::new(0.0, 1.0 / PI, 2.0));
        let own = MaterialOverride { albedo: Some(Vec3::ZERO), emission: Some(Vec3::X) };
        lighting.materials.insert(scene.materials[0].name.clone(), own);
        let overridden = Surfaces::new(&scene, &lighting, &map, Albedo::Scene);
        close(overridden.radiance(&hit, direct), Vec3::X);
        let below = caster.closest_hit(Vec3::new(-0.75, -1.0, -0.25), Vec3::Y).expect("the back");
        assert_eq!(surfaces.radiance(&below, direct), Vec3::ZERO);
    }
}
