//! From the main world to the render world, once per frame: what shines on each [`Relit`].

use crate::baked_light::{BakedLight, Parts};
use crate::light_maps::RelitMaterials;
use crate::relit::{Relit, RelitMaps, RelitStatus, SkyRadiance};
use crate::units;
use bevy::asset::{AssetId, Assets};
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::math::Affine3A;
use bevy::pbr::StandardMaterial;
use bevy::render::Extract;
use bevy::transform::components::GlobalTransform;
use localprt_scenes::{Light, MaterialOverride};
use std::sync::{Arc, Mutex};

/// All that are relit in this frame.
#[derive(Resource, Default)]
pub(crate) struct ExtractedScenes(pub(crate) Vec<ExtractedScene>);

pub(crate) struct ExtractedScene {
    /// In the main world.
    pub(crate) root: Entity,
    pub(crate) parts: Arc<Parts>,
    pub(crate) file: AssetId<BakedLight>,
    pub(crate) lightmap: AssetId<Image>,
    pub(crate) voxels: Option<AssetId<Image>>,
    pub(crate) status: Arc<Mutex<RelitStatus>>,
    pub(crate) bounces: u32,
    pub(crate) shadow_map_size: u32,
    pub(crate) scale: f32,
    pub(crate) reset: u32,
    pub(crate) sky: SkyRadiance,
    pub(crate) lights: Vec<Light>,
    /// By the scene's index.
    pub(crate) materials: Vec<MaterialOverride>,
}

/// A kind of light: itself, where it is, and whether it shines.
type Lights<'w, 's, L> =
    Extract<'w, 's, Query<'static, 'static, (&'static L, &'static GlobalTransform, &'static InheritedVisibility)>>;

pub(crate) fn extract(
    mut scenes: ResMut<ExtractedScenes>,
    roots: Extract<Query<(Entity, &Relit, &RelitMaps, &RelitMaterials, &GlobalTransform)>>,
    files: Extract<Res<Assets<BakedLight>>>,
    assets: Extract<Res<Assets<StandardMaterial>>>,
    points: Lights<PointLight>,
    spots: Lights<SpotLight>,
    suns: Lights<DirectionalLight>,
) {
    scenes.0.clear();
    for (root, relit, maps, materials, place) in &roots {
        let Some(file) = files.get(maps.file) else { continue };
        let to_scene = place.affine().inverse();
        let mut lights = taken(&points, &to_scene, units::point);
        lights.extend(taken(&spots, &to_scene, units::spot));
        lights.extend(taken(&suns, &to_scene, units::directional));
        scenes.0.push(ExtractedScene {
            root,
            parts: file.parts.clone(),
            file: maps.file,
            lightmap: maps.lightmap.id(),
            voxels: maps.voxels.as_ref().map(|voxels| voxels.id()),
            status: maps.status.clone(),
            bounces: relit.bounces.max(1),
            shadow_map_size: relit.shadow_map_size,
            scale: relit.scale,
            reset: relit.reset,
            sky: relit.sky,
            lights,
            materials: overrides(&file.parts.materials, materials, &assets),
        });
    }
}

/// All that shine, seen by a camera or not.
fn taken<L: Component>(
    lights: &Query<(&L, &GlobalTransform, &InheritedVisibility)>,
    to_scene: &Affine3A,
    convert: impl Fn(&L, &Affine3A) -> Option<Light>,
) -> Vec<Light> {
    let shining = lights.iter().filter(|(_, _, visibility)| visibility.get());
    shining.filter_map(|(light, place, _)| convert(light, &(*to_scene * place.affine()))).collect()
}

fn overrides(
    own: &[(String, glam::Vec3)],
    materials: &RelitMaterials,
    assets: &Assets<StandardMaterial>,
) -> Vec<MaterialOverride> {
    let mut overrides = vec![MaterialOverride::default(); own.len()];
    for &(index, material) in &materials.0 {
        let Some(material) = assets.get(material) else { continue };
        let changed = units::emission(material.emissive, own[index].1);
        if changed.emission.is_some() {
            overrides[index] = changed;
        }
    }
    overrides
}
