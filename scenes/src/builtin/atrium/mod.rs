//! A two-story court with arcades on all sides, open to the sky, 24 x 14.4 x 12 m: stone with real thickness, cloth
//! that is lit from both sides, plants with alpha masks.
//!
//! Every solid part is closed and reaches a little into its neighbors: no light passes between them, and no visible
//! face coincides with another one.

mod furnishing;
mod masonry;
mod textures;

use super::shapes::{noise, sin_cos};
use super::{camera, matte};
use crate::light::{Light, LightKind};
use crate::scene::{AlphaMode, Material, Mesh, Scene, TextureRef, Wrap};
use glam::{Affine2, Vec3, Vec4};

/// Arcade lines from the middle of the court, x and z, which are also the middles of the corner piers.
const LINE: [f32; 2] = [8.4, 3.6];
/// Distance of columns.
const BAY: f32 = 2.4;
/// Upper sides of ground, gallery and roof.
const LEVELS: [f32; 3] = [0.0, 6.0, 10.8];
/// Parts that touch reach this far into each other.
const EMBED: f32 = 0.02;

const STONE: usize = 0;
const WALL: usize = 1;
const FLOOR: usize = 2;
pub(super) const PAVING: usize = 3;
const WATER: usize = 4;
const TERRACOTTA: usize = 5;
const BARK: usize = 6;
const LEAVES: usize = 7;
const CLOTHS: [usize; 3] = [8, 9, 10];

pub(super) fn build() -> Scene {
    let mut meshes = masonry::build(masonry::Detail::Fine);
    meshes.extend(furnishing::build());
    Scene {
        meshes,
        lights: vec![sunlight()],
        cameras: vec![
            camera("court", Vec3::new(-7.7, 1.7, 0.25), Vec3::new(3.0, 3.6, -0.5), 66.0),
            camera("gallery", Vec3::new(-9.6, 7.9, 0.2), Vec3::new(0.0, 5.4, -0.1), 66.0),
        ],
        ..looks()
    }
}

/// The court as one of many: its stone and cloth, coarsely. About a tenth of the faces.
pub(super) fn coarse() -> Vec<Mesh> {
    let mut meshes = masonry::build(masonry::Detail::Coarse);
    meshes.extend(furnishing::banners([4, 6]));
    meshes
}

/// Into the court from one corner of the sky.
pub(super) fn sunlight() -> Light {
    Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.5, -1.0, -0.3).normalize(),
        color: Vec3::new(1.0, 0.93, 0.82),
        intensity: 8.0,
        range: None,
    }
}

/// Materials and their textures, of no mesh.
pub(super) fn looks() -> Scene {
    let images = vec![textures::ashlar(), textures::checker(), textures::leaf()];
    let texture = |image, wrap| crate::scene::Texture { image, wrap_u: wrap, wrap_v: wrap, nearest: false };
    Scene {
        materials: materials(),
        textures: vec![texture(0, Wrap::Repeat), texture(1, Wrap::Repeat), texture(2, Wrap::ClampToEdge)],
        images,
        ..Scene::default()
    }
}

fn materials() -> Vec<Material> {
    let textured = |name: &str, texture| {
        let reference = TextureRef { texture, uv_set: 0, transform: Affine2::IDENTITY };
        Material { base_color: Vec4::ONE, base_color_texture: Some(reference), ..matte(name, [1.0; 3]) }
    };
    let cloth = |name: &str, albedo| Material { double_sided: true, ..matte(name, albedo) };
    vec![
        matte("stone", [0.62, 0.57, 0.48]),
        textured("wall", 0),
        textured("floor", 1),
        matte("paving", [0.52, 0.47, 0.4]),
        matte("water", [0.06, 0.16, 0.18]),
        matte("terracotta", [0.5, 0.2, 0.1]),
        matte("bark", [0.16, 0.1, 0.06]),
        Material { alpha: AlphaMode::Mask { cutoff: 0.5 }, double_sided: true, ..textured("leaves", 2) },
        cloth("cloth red", [0.6, 0.05, 0.04]),
        cloth("cloth blue", [0.05, 0.13, 0.5]),
        cloth("cloth ochre", [0.65, 0.38, 0.06]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_court_is_large_enough_and_has_few_meshes() {
        let scene = build();
        assert_eq!((scene.face_count(), scene.meshes.len()), (86_168, 16), "as the README says");
        let (low, high) = scene.bounds().unwrap();
        assert_eq!((low, high), (Vec3::new(-12.0, -0.3, -7.2), Vec3::new(12.0, 12.0, 7.2)));
    }

    #[test]
    fn leaves_have_holes_and_leaflets() {
        let scene = build();
        let mesh = scene.meshes.iter().position(|mesh| mesh.material == LEAVES).unwrap();
        let count = (1..64)
            .filter(|step| {
                let along = *step as f32 / 64.0;
                scene.is_present(mesh, 0, Vec3::new(0.3 * (1.0 - along), along, 0.7 * (1.0 - along)))
            })
            .count();
        assert!((5..60).contains(&count), "{count} of 63 points are present");
    }

    #[test]
    fn textured_meshes_have_coordinates_and_others_none() {
        let scene = build();
        for mesh in &scene.meshes {
            let textured = scene.materials[mesh.material].base_color_texture.is_some();
            assert_eq!(mesh.uv_sets.len(), usize::from(textured), "{}", mesh.name);
        }
    }
}
