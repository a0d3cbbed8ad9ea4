//! Outgoing radiance of surfaces: albedo, direct and indirect light, emission.

use glam::{Vec2, Vec3};
use localprt_scenes::{Lighting, Scene, SurfaceShading};
use localprt_surfaces::rays::SurfaceHit;
use std::f32::consts::PI;

/// Surfaces of a scene as one lighting state has them.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    shading: SurfaceShading<'a>,
    gray: Option<f32>,
}

impl<'a> Surfaces<'a> {
    /// The lighting gives overrides only. With `gray`, 0..=1, every surface has that albedo: shows light alone.
    pub fn new(scene: &'a Scene, lighting: &Lighting, gray: Option<f32>) -> Self {
        Self { scene, shading: SurfaceShading::new(scene, lighting), gray }
    }

    /// Radiance that leaves a hit toward the ray's origin: Le + albedo/pi (E_direct + E_indirect).
    ///
    /// `direct` gives the irradiance straight from the lights at a position and unit normal, `indirect` the irradiance at
    /// a lightmap coordinate (TEXCOORD_1) about a unit normal: the one of the material's normal map. The back of a one-sided surface is black.
    pub fn radiance(
        &self,
        hit: &SurfaceHit,
        direct: impl Fn(Vec3, Vec3) -> Vec3,
        indirect: impl Fn(Vec2, Vec3) -> Vec3,
    ) -> Vec3 {
        let Some(point) = hit.point else { return Vec3::ZERO };
        let (mesh, triangle, weights) = (&self.scene.meshes[point.mesh], point.triangle, point.barycentrics);
        let albedo = self.gray.map_or_else(|| self.shading.albedo(point.mesh, triangle, weights), Vec3::splat);
        let normal = hit.mapped_point(self.scene).normal;
        let indirect = mesh.lightmap_uv().map_or(Vec3::ZERO, |set| {
            let corners = mesh.triangles[triangle].map(|vertex| set[vertex as usize]);
            indirect(corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z, normal)
        });
        let emission = self.shading.emission(point.mesh, triangle, weights);
        emission + albedo / PI * (direct(hit.position, normal) + indirect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::tests::floor;
    use glam::Vec4;
    use localprt_scenes::MaterialOverride;
    use localprt_surfaces::rays::RayCaster;

    fn close(value: Vec3, expected: Vec3) {
        // A handful of f32 roundings of values up to 4.
        assert!(value.abs_diff_eq(expected, 1e-5), "{value} {expected}");
    }

    #[test]
    fn a_surface_shows_emission_and_reflected_light() {
        let mut scene = floor();
        scene.materials[0].base_color = Vec4::new(0.5, 0.25, 1.0, 1.0);
        scene.materials[0].emission = Vec3::new(0.0, 0.0, 2.0);
        let caster = RayCaster::new(&scene).expect("a tree");
        let hit = caster.closest_hit(Vec3::new(-0.75, 1.0, -0.25), Vec3::NEG_Y).expect("the floor");
        let direct = |_: Vec3, normal: Vec3| Vec3::splat(3.0 * normal.y);
        // The lightmap covers the floor: u = (x + 1) / 2, v = (z + 1) / 2.
        let indirect = |uv: Vec2, _: Vec3| Vec3::new(0.0, uv.x, uv.y);
        let mut lighting = Lighting::default();
        let surfaces = Surfaces::new(&scene, &lighting, None);
        let expected = Vec3::new(0.5 * 3.0 / PI, 0.25 * 3.125 / PI, 2.0 + 3.375 / PI);
        close(surfaces.radiance(&hit, direct, indirect), expected);
        let gray = Surfaces::new(&scene, &lighting, Some(1.0));
        close(gray.radiance(&hit, |_, _| Vec3::ZERO, indirect), Vec3::new(0.0, 0.125 / PI, 2.0 + 0.375 / PI));
        let own = MaterialOverride { albedo: Some(Vec3::ZERO), emission: Some(Vec3::X) };
        lighting.materials.insert(scene.materials[0].name.clone(), own);
        close(Surfaces::new(&scene, &lighting, None).radiance(&hit, direct, indirect), Vec3::X);
        let below = caster.closest_hit(Vec3::new(-0.75, -1.0, -0.25), Vec3::Y).expect("the back");
        assert_eq!(surfaces.radiance(&below, direct, indirect), Vec3::ZERO);
    }
}
