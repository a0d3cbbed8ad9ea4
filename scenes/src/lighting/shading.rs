//! Albedo and emission of surfaces as a lighting state has them.

use super::Lighting;
use crate::scene::Scene;
use glam::Vec3;

/// Surface colors of a scene under a lighting state: the scene's own, or what an override puts in their place.
pub struct SurfaceShading<'a> {
    scene: &'a Scene,
    /// One per material, resolved once so that a look-up compares no names.
    overrides: Vec<Overrides>,
}

#[derive(Clone, Copy, Default)]
struct Overrides {
    albedo: Option<Vec3>,
    emission: Option<Vec3>,
}

impl<'a> SurfaceShading<'a> {
    /// Resolves the overrides: `albedo_override` comes before a material's albedo, which comes before factor, texture
    /// and vertex color. Materials that share a name share their override; names that the scene lacks do nothing.
    pub fn new(scene: &'a Scene, lighting: &Lighting) -> Self {
        let overrides = scene.materials.iter().map(|material| {
            let own = lighting.materials.get(&material.name).copied().unwrap_or_default();
            Overrides { albedo: lighting.albedo_override.map(Vec3::splat).or(own.albedo), emission: own.emission }
        });
        Self { scene, overrides: overrides.collect() }
    }

    /// Diffuse albedo at a point of a triangle, each band within 0..=1.
    pub fn albedo(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec3 {
        let own = || self.scene.base_color(mesh, triangle, barycentrics).truncate();
        self.of_mesh(mesh).albedo.unwrap_or_else(own).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Emitted radiance at a point of a triangle, W sr^-1 m^-2.
    pub fn emission(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec3 {
        let own = || self.scene.emission(mesh, triangle, barycentrics);
        self.of_mesh(mesh).emission.unwrap_or_else(own)
    }

    /// Whether any surface of the scene may emit.
    pub fn any_emission(&self) -> bool {
        self.scene.meshes.iter().filter(|mesh| !mesh.triangles.is_empty()).any(|mesh| {
            let own = self.scene.materials[mesh.material].emission;
            self.overrides[mesh.material].emission.unwrap_or(own) != Vec3::ZERO
        })
    }

    fn of_mesh(&self, mesh: usize) -> Overrides {
        self.overrides[self.scene.meshes[mesh].material]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lighting::MaterialOverride;
    use crate::scene::{Material, Mesh};
    use glam::Vec4;

    fn scene() -> Scene {
        let mesh = |material| Mesh {
            material,
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let material = |name: &str, albedo: f32, emission: f32| Material {
            name: name.into(),
            base_color: Vec4::splat(albedo),
            emission: Vec3::splat(emission),
            ..Material::default()
        };
        Scene {
            meshes: vec![mesh(0), mesh(1), mesh(2)],
            materials: vec![material("a", 0.25, 0.0), material("b", 1.5, 3.0), material("a", 0.75, 0.0)],
            ..Scene::default()
        }
    }

    fn colors(lighting: &Lighting) -> [(f32, f32); 3] {
        let scene = scene();
        let shading = SurfaceShading::new(&scene, lighting);
        let middle = Vec3::splat(1.0 / 3.0);
        [0, 1, 2].map(|mesh| (shading.albedo(mesh, 0, middle).x, shading.emission(mesh, 0, middle).x))
    }

    #[test]
    fn overrides_replace_by_name_and_albedo_is_clamped() {
        let mut lighting = Lighting::default();
        assert_eq!(colors(&lighting), [(0.25, 0.0), (1.0, 3.0), (0.75, 0.0)]);
        let glowing = MaterialOverride { albedo: None, emission: Some(Vec3::splat(9.0)) };
        lighting.materials.insert("a".into(), glowing);
        lighting.materials.insert("b".into(), MaterialOverride { albedo: Some(Vec3::splat(0.125)), emission: None });
        assert_eq!(colors(&lighting), [(0.25, 9.0), (0.125, 3.0), (0.75, 9.0)]);
        lighting.albedo_override = Some(0.5);
        assert_eq!(colors(&lighting), [(0.5, 9.0), (0.5, 3.0), (0.5, 9.0)]);
    }

    #[test]
    fn emission_is_noticed() {
        let mut scene = scene();
        let mut lighting = Lighting::default();
        assert!(SurfaceShading::new(&scene, &lighting).any_emission());
        scene.meshes.remove(1);
        assert!(!SurfaceShading::new(&scene, &lighting).any_emission());
        lighting.materials.insert("a".into(), MaterialOverride { albedo: None, emission: Some(Vec3::ONE) });
        assert!(SurfaceShading::new(&scene, &lighting).any_emission());
    }
}
