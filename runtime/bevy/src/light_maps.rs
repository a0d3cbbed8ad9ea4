//! Main world: the maps of a [`Relit`], light maps of the meshes below it, and which materials they wear.

use crate::baked_light::BakedLight;
use crate::relit::{Relit, RelitMaps};
use crate::units::{volume_box, voxel_texels};
use bevy::asset::{AssetId, Assets, Handle, RenderAssetUsages};
use bevy::ecs::prelude::*;
use bevy::gltf::GltfMaterialName;
use bevy::image::{Image, ImageSampler};
use bevy::light::{IrradianceVolume, LightProbe};
use bevy::log::warn;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{Lightmap, MeshMaterial3d, StandardMaterial};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::transform::components::Transform;
use localprt_formats::VolumeGrid;

/// WebGPU's guaranteed limit of 3D textures, texels per side.
const LARGEST_VOLUME: u32 = 2048;

/// A mesh that was given the light map of a [`Relit`].
#[derive(Component)]
pub(crate) struct RelitMesh {
    root: Entity,
}

/// The scene's materials, by index, and who stands for them below a [`Relit`].
#[derive(Component, Default)]
pub(crate) struct RelitMaterials(pub(crate) Vec<(usize, AssetId<StandardMaterial>)>);

/// Makes the maps of files that have been loaded.
pub(crate) fn create(
    mut commands: Commands,
    roots: Query<(Entity, &Relit), Without<RelitMaps>>,
    files: Res<Assets<BakedLight>>,
    mut images: ResMut<Assets<Image>>,
) {
    for (root, relit) in &roots {
        let Some(file) = files.get(&relit.file) else { continue };
        let size = file.lightmap_size();
        let lightmap = images.add(map([size, size, 1], TextureDimension::D2));
        let (mut voxels, mut volume) = (None, None);
        if let Some(grid) = file.volume() {
            let texels = voxel_texels(grid.dims);
            if texels.iter().any(|side| *side > LARGEST_VOLUME) {
                warn!("the light for moving objects is left out: {texels:?} texels, allowed are {LARGEST_VOLUME}");
            } else {
                let image = images.add(map(texels, TextureDimension::D3));
                volume = Some(commands.spawn((volume_of(grid, image.clone(), relit.scale), ChildOf(root))).id());
                voxels = Some(image);
            }
        }
        let maps = RelitMaps { lightmap, voxels, volume, file: relit.file.id(), status: Default::default() };
        commands.entity(root).insert((maps, RelitMaterials::default()));
    }
}

/// Written by the relighter, in place: Bevy does not see a texture that takes another's place.
fn map([width, height, depth_or_array_layers]: [u32; 3], dimension: TextureDimension) -> Image {
    let size = Extent3d { width, height, depth_or_array_layers };
    let format = TextureFormat::Rgba16Float;
    let mut image = Image::new_uninit(size, dimension, format, RenderAssetUsages::RENDER_WORLD);
    image.texture_descriptor.label = Some("localprt.map");
    image.texture_descriptor.usage = TextureUsages::TEXTURE_BINDING
        | TextureUsages::STORAGE_BINDING
        | TextureUsages::COPY_SRC
        | TextureUsages::COPY_DST;
    image.sampler = ImageSampler::linear();
    image
}

fn volume_of(grid: &VolumeGrid, voxels: Handle<Image>, scale: f32) -> impl Bundle {
    let (center, size) = volume_box(grid.origin, grid.spacing_m, grid.dims);
    let light = IrradianceVolume { voxels, intensity: 1.0 / scale, affects_lightmapped_meshes: false };
    (LightProbe::new(), light, Transform::from_translation(center).with_scale(size))
}

/// Gives the light map to meshes that come below a [`Relit`], and to those that are there when its maps come.
pub(crate) fn apply(
    mut commands: Commands,
    roots: Query<(Entity, Ref<RelitMaps>)>,
    moved: Query<Entity, Changed<ChildOf>>,
    with_new_mesh: Query<Entity, Changed<Mesh3d>>,
    without_map: Query<&Mesh3d, Without<Lightmap>>,
    children: Query<&Children>,
    parents: Query<&ChildOf>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut waiting: Local<Vec<Entity>>,
) {
    let new_roots = roots.iter().filter(|(_, maps)| maps.is_added()).map(|(root, _)| root);
    let trees = new_roots.chain(&moved);
    let mut candidates: Vec<Entity> = trees
        .flat_map(|top| std::iter::once(top).chain(children.iter_descendants(top)))
        .chain(&with_new_mesh)
        .collect();
    candidates.append(&mut waiting);
    candidates.sort_unstable();
    candidates.dedup();
    for entity in candidates {
        let Ok(Mesh3d(handle)) = without_map.get(entity) else { continue };
        let mut above = std::iter::once(entity).chain(parents.iter_ancestors(entity));
        let Some((root, maps)) = above.find_map(|ancestor| roots.get(ancestor).ok()) else { continue };
        let Some(mesh) = meshes.get(handle) else {
            waiting.push(entity);
            continue;
        };
        // A mesh that is on the device alone cannot be asked; one without the coordinates shows no light map.
        let has = |set| mesh.try_contains_attribute(set).unwrap_or(true);
        if !has(Mesh::ATTRIBUTE_UV_1) {
            continue;
        }
        // Bevy's shader of light maps does not compile without them.
        if !has(Mesh::ATTRIBUTE_UV_0)
            && let Some(mut mesh) = meshes.get_mut(handle)
        {
            let n_vertices = mesh.count_vertices();
            mesh.insert_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0f32; 2]; n_vertices]);
        }
        let lightmap = Lightmap { image: maps.lightmap.clone(), ..Lightmap::default() };
        commands.entity(entity).insert((lightmap, RelitMesh { root }));
    }
}

/// Notes which material stands for which of the scene's, by name, after meshes have come, gone or changed theirs.
pub(crate) fn note_materials(
    mut roots: Query<(&RelitMaps, &mut RelitMaterials)>,
    files: Res<Assets<BakedLight>>,
    worn: Query<(&RelitMesh, &GltfMaterialName, &MeshMaterial3d<StandardMaterial>)>,
    changed: Query<(), (With<RelitMesh>, Or<(Added<RelitMesh>, Changed<MeshMaterial3d<StandardMaterial>>)>)>,
    mut gone: RemovedComponents<RelitMesh>,
) {
    if gone.read().count() == 0 && changed.is_empty() {
        return;
    }
    for (_, mut materials) in &mut roots {
        materials.0.clear();
    }
    for (mesh, name, material) in &worn {
        let Ok((maps, mut materials)) = roots.get_mut(mesh.root) else { continue };
        let Some(file) = files.get(maps.file) else { continue };
        let named = file.parts.materials.iter().enumerate().filter(|(_, (known, _))| *known == name.0);
        materials.0.extend(named.map(|(index, _)| (index, material.0.id())));
    }
    for (_, mut materials) in &mut roots {
        materials.0.sort_unstable();
        materials.0.dedup();
    }
}

/// Takes the maps away where there is no [`Relit`] any more, or one of another file. Meshes keep their `Lightmap`: Bevy 0.20.1 draws shadows
/// of one that loses it by pipelines that still have it, and ends.
pub(crate) fn remove(mut commands: Commands, roots: Query<(Entity, &RelitMaps, Option<&Relit>)>) {
    for (root, maps, relit) in &roots {
        if relit.is_some_and(|relit| relit.file.id() == maps.file) {
            continue;
        }
        if let Some(volume) = maps.volume {
            commands.entity(volume).try_despawn();
        }
        commands.entity(root).remove::<(RelitMaps, RelitMaterials)>();
    }
}
