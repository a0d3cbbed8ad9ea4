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
        Self { caster, lighting, shading: SurfaceShading::new(caster.scene(), lighting) }
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
        let origin = point.position + point.geometric_normal * self.caster.offset_m();
        let (mut irradiance, mut rays) = (Vec3::ZERO, 0);
        for light in &self.lighting.lights {
            let facing = facing_light(light, point.position, point.normal, point.geometric_normal);
            let Some(facing) = facing else { continue };
            rays += 1;
            if facing.is_free(self.caster, light, origin) {
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
