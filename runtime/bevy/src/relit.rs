//! The component that games use, and what the plugin puts beside it.

use crate::baked_light::BakedLight;
use bevy::asset::{AssetId, Handle};
use bevy::camera::visibility::Visibility;
use bevy::ecs::{component::Component, entity::Entity};
use bevy::image::Image;
use bevy::math::Vec3;
use bevy::transform::components::Transform;
use std::sync::{Arc, Mutex, PoisonError};

/// Relights what lies below this entity: every mesh there with `Mesh::ATTRIBUTE_UV_1` gets a `Lightmap`. Belongs on the root of the
/// scene that the bake wrote, which may be moved and turned, but not scaled.
#[derive(Component, Clone, Debug)]
#[require(Transform, Visibility)]
pub struct Relit {
    /// The baked file.
    pub file: Handle<BakedLight>,
    /// Gathers per frame, at least 1; more follow quick changes within one frame.
    pub bounces: u32,
    /// Texels per side of the shadow maps of bounced light; taken when the file is.
    pub shadow_map_size: u32,
    /// What the light map holds is multiplied by it, and `StandardMaterial::lightmap_exposure` has to be its inverse. Below 1 for light
    /// brighter than the 65,504 cd/m² that a light map can hold; taken when the file is.
    pub scale: f32,
    /// Light from where rays leave the scene.
    pub sky: SkyRadiance,
    /// Another number than before forgets all light, for cuts: the next frame starts with a first bounce.
    pub reset: u32,
}

impl Relit {
    /// One gather per frame, shadow maps of 2048², no sky.
    pub fn new(file: Handle<BakedLight>) -> Self {
        Self { file, bounces: 1, shadow_map_size: 2048, scale: 1.0, sky: SkyRadiance::default(), reset: 0 }
    }
}

/// Radiance of a sky, linear Rec. 709, cd/m²: straight up, at the horizon and straight down, mixed by the height of a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyRadiance {
    /// At +Y.
    pub zenith: Vec3,
    /// At the horizon.
    pub horizon: Vec3,
    /// At -Y.
    pub ground: Vec3,
}

impl SkyRadiance {
    /// The same from everywhere.
    pub fn constant(radiance: Vec3) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance }
    }
}

/// The maps of a [`Relit`], put beside it once its file is loaded.
#[derive(Component, Clone, Debug)]
pub struct RelitMaps {
    /// Irradiance over pi times `Relit::scale`, cd/m²: for meshes that take it by themselves.
    pub lightmap: Handle<Image>,
    /// Ambient cubes of the same, if the file has light for moving objects.
    pub voxels: Option<Handle<Image>>,
    /// Holds the irradiance volume.
    pub(crate) volume: Option<Entity>,
    pub(crate) file: AssetId<BakedLight>,
    pub(crate) status: Arc<Mutex<RelitStatus>>,
}

impl RelitMaps {
    /// How relighting goes, as of the last frame that was drawn.
    pub fn status(&self) -> RelitStatus {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// What a relighter tells about itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RelitStatus {
    /// Gathers since the start or the last reset.
    pub gathers: u64,
    /// Device memory by purpose, bytes, without the maps of [`RelitMaps`].
    pub memory: Vec<(&'static str, u64)>,
    /// Why there is no light: a device that is too small for the file.
    pub error: Option<String>,
}
