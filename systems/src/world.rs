//! What rays meet, and what surfaces send back along them.

use glam::Vec3;
use localprt_runtime::scene_light::facing_light;
use localprt_scenes::{Lighting, SurfacePoint, SurfaceShading};
use localprt_surfaces::rays::{RayCaster, SurfaceHit};
use std::f32::consts::FRAC_1_PI;

/// A scene and what shines on it, at one moment.
pub struct World<'a> {
    caster: &'a RayCaster<'a>,
    lighting: &'a Lighting,
    shading: SurfaceShading<'a>,
    /// What casts shadows.
    shadows: &'a RayCaster<'a>,
}

/// A surface that a ray met, as shading needs it: an entry of a surfel buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// The point, with the normals on the side that the ray came from.
    pub point: SurfacePoint,
    /// Diffuse albedo, 0 to 1.
    pub albedo: Vec3,
    /// Emitted radiance, W sr^-1 m^-2.
    pub emission: Vec3,
}

impl<'a> World<'a> {
    /// Of a scene's rays and a lighting state.
    pub fn new(caster: &'a RayCaster<'a>, lighting: &'a Lighting) -> Self {
        Self { caster, lighting, shading: SurfaceShading::new(caster.scene(), lighting), shadows: caster }
    }

    /// The same with shadows of another scene's surfaces in place of its own.
    pub fn with_shadows_of(self, shadows: &'a RayCaster<'a>) -> Self {
        Self { shadows, ..self }
    }

    /// Rays against its surfaces.
    pub fn caster(&self) -> &'a RayCaster<'a> {
        self.caster
    }

    /// What shines.
    pub fn lighting(&self) -> &'a Lighting {
        self.lighting
    }

    /// Lowest and highest corner of what there is, metres; zeros for nothing.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.caster.scene().bounds().unwrap_or_default()
    }

    /// Radiance where a ray leaves the scene, W sr^-1 m^-2.
    pub fn sky(&self, dir: Vec3) -> Vec3 {
        self.lighting.sky.radiance(dir)
    }

    /// The surface at a hit; `None` for the black back of a one-sided one.
    pub fn surfel(&self, hit: &SurfaceHit) -> Option<Surfel> {
        let face = hit.point?;
        Some(Surfel {
            point: hit.surface_point(self.caster.scene()),
            albedo: self.shading.albedo(face.mesh, face.triangle, face.barycentrics),
            emission: self.shading.emission(face.mesh, face.triangle, face.barycentrics),
        })
    }

    /// Irradiance straight from punctual lights, W m^-2, with traced shadows, and the shadow rays that it took.
    pub fn direct(&self, point: &SurfacePoint) -> (Vec3, u64) {
        let origin = point.position + point.geometric_normal * self.shadows.offset_m();
        let (mut irradiance, mut rays) = (Vec3::ZERO, 0);
        for light in &self.lighting.lights {
            let facing = facing_light(light, point.position, point.normal, point.geometric_normal);
            let Some(facing) = facing else { continue };
            rays += 1;
            if facing.is_free(self.shadows, light, origin) {
                irradiance += facing.irradiance;
            }
        }
        (irradiance, rays)
    }
}

impl Surfel {
    /// Radiance that it sends, W sr^-1 m^-2, given the irradiance that arrives: L = Le + albedo / pi * E.
    pub fn sent(&self, irradiance: Vec3) -> Vec3 {
        self.emission + self.albedo * FRAC_1_PI * irradiance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{in_world, lit_plane};
    use localprt_scenes::{Light, LightKind, Scene};

    #[test]
    fn shadows_may_be_those_of_another_scene() {
        let (plane, _) = lit_plane(0.5);
        let sun = Light {
            name: String::new(),
            kind: LightKind::Directional,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            color: Vec3::ONE,
            intensity: 2.0,
            range: None,
        };
        let lighting = Lighting { lights: vec![sun], ..Lighting::default() };
        // The same plane once more, 1 m above.
        let mut covered: Scene = plane.clone();
        let mut sheet = plane.meshes[0].clone();
        sheet.positions.iter_mut().for_each(|position| position.y += 1.0);
        covered.meshes.push(sheet);
        let point = SurfacePoint { position: Vec3::ZERO, normal: Vec3::Y, geometric_normal: Vec3::Y };
        in_world(&plane, &lighting, |open| {
            assert_eq!(open.direct(&point), (Vec3::splat(2.0), 1));
            in_world(&covered, &lighting, |covered| {
                let shaded = World::new(open.caster(), &lighting).with_shadows_of(covered.caster());
                assert_eq!(shaded.direct(&point), (Vec3::ZERO, 1));
                assert!(shaded.caster().escapes(Vec3::Y * 0.5, Vec3::Y), "rays meet its own surfaces");
            });
        });
    }
}
