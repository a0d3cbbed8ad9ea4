//! Baked files as assets: the file with its scene, read, checked and prepared off the main thread.

use bevy::asset::io::Reader;
use bevy::asset::{Asset, AssetLoader, LoadContext, ParseAssetPathError, ReadAssetBytesError};
use bevy::reflect::TypePath;
use localprt_formats::{Baked, OpenError, VolumeGrid};
use localprt_runtime::scene_light::scene_texels;
use localprt_runtime::{SceneTexels, ShadowCasters};
use localprt_scenes::LoadError;
use localprt_surfaces::rays::{RayCaster, TreeError};
use std::sync::Arc;

/// A baked file, and of the scene beside it what relighting takes.
#[derive(Asset, TypePath, Clone)]
pub struct BakedLight {
    pub(crate) parts: Arc<Parts>,
}

pub(crate) struct Parts {
    pub(crate) baked: Baked,
    pub(crate) texels: SceneTexels,
    pub(crate) casters: ShadowCasters,
    /// Name and emission, W sr^-1 m^-2, of each of the scene's materials.
    pub(crate) materials: Vec<(String, glam::Vec3)>,
}

impl BakedLight {
    /// Reads a baked file and the scene that the bake wrote beside it, a .glb. `scene_name` is for messages. Takes a while: rays find
    /// out which points of texels lie in the open.
    ///
    /// # Errors
    /// A file or scene that is broken, a scene that is another one.
    pub fn from_bytes(file: Vec<u8>, scene_name: &str, scene: &[u8]) -> Result<Self, BakedLightError> {
        Self::new(Baked::from_bytes(file)?, scene_name, scene)
    }

    fn new(baked: Baked, scene_name: &str, scene: &[u8]) -> Result<Self, BakedLightError> {
        let scene = localprt_scenes::load_bytes(scene_name, scene)?;
        if scene.hash != baked.metadata().scene_hash {
            return Err(BakedLightError::OtherScene { scene: scene_name.to_owned() });
        }
        let texels = scene_texels(&RayCaster::new(&scene)?, baked.checked()?.view());
        let casters = ShadowCasters::of_scene(&scene);
        let materials = scene.materials.into_iter().map(|material| (material.name, material.emission)).collect();
        Ok(Self { parts: Arc::new(Parts { baked, texels, casters, materials }) })
    }

    /// Texels per side of the light map.
    pub fn lightmap_size(&self) -> u32 {
        self.parts.baked.metadata().lightmap_size
    }

    /// Where the cells of the light for moving objects lie, if the file has any.
    pub fn volume(&self) -> Option<&VolumeGrid> {
        self.parts.baked.view().volume.map(|volume| volume.grid)
    }
}

/// Why a [`BakedLight`] was not loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BakedLightError {
    /// The baked file cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The baked file is broken.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The file names no place that assets have.
    #[error(transparent)]
    ScenePath(#[from] ParseAssetPathError),
    /// The scene is not where the file says.
    #[error("the scene beside it: {0}")]
    SceneBytes(#[from] ReadAssetBytesError),
    /// The scene is broken.
    #[error(transparent)]
    Scene(#[from] LoadError),
    /// The scene has more triangles than rays can be traced against.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// The scene was changed since, or is another.
    #[error(
        "{scene} is not the scene that the file was baked from: keep the .glb that the bake wrote beside it, unchanged"
    )]
    OtherScene {
        /// The scene's path.
        scene: String,
    },
}

/// Loads `.lprt` files, with the scene that each names.
#[derive(Default, TypePath)]
pub struct BakedLightLoader;

impl AssetLoader for BakedLightLoader {
    type Asset = BakedLight;
    type Settings = ();
    type Error = BakedLightError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<BakedLight, BakedLightError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let baked = Baked::from_bytes(bytes)?;
        let scene_path = context.path().resolve_embed_str(&baked.metadata().scene_path)?;
        let scene = context.read_asset_bytes(scene_path.clone()).await?;
        BakedLight::new(baked, &scene_path.to_string(), &scene)
    }

    fn extensions(&self) -> &[&str] {
        &["lprt"]
    }
}
