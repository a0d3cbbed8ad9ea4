//! glTF 2.0 import: a .gltf or .glb file to a [`Scene`] in world space.
//!
//! The `gltf` crate supplies the typed JSON model. Files, accessors and the hierarchy are read here, because the scene
//! may come from anywhere: paths stay in the scene's folder, every range is checked before it is read, and nothing is
//! allocated that the bytes present (or [`Limits`]) do not justify. Animations, skins and morph targets are left out:
//! a bake is of the scene at rest.

mod accessors;
mod container;
mod document;
#[cfg(feature = "compressed")]
mod draco;
mod error;
mod geometry;
mod images;
mod instancing;
mod materials;
mod meshopt;
mod nodes;
mod resources;
mod sanitize;

pub use error::{LoadError, LoadErrorKind};
pub(crate) use materials::texture_transform;
pub use resources::Limits;

use crate::scene::{Material, Mesh, Scene};
use document::Document;
use error::Source;
use geometry::Geometry;
use glam::DMat4;
use nodes::Placed;
use resources::{Neighbors, Resources};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Loads a .gltf or .glb file, told apart by content, within the default [`Limits`].
///
/// # Errors
/// See [`LoadError`]; each message names the file, the place as a JSON pointer, what was found and what to do.
pub fn load(path: impl AsRef<Path>) -> Result<Scene, LoadError> {
    load_within(path, &Limits::default())
}

/// Loads a .gltf or .glb file within given limits.
///
/// # Errors
/// As [`load`].
pub fn load_within(path: impl AsRef<Path>, limits: &Limits) -> Result<Scene, LoadError> {
    let source = &Source::new(path.as_ref());
    let bytes = resources::read_scene_file(source, limits)?;
    import(source, limits, &bytes, Neighbors::Folder)
}

/// Loads a scene that is already in memory and holds all it needs: a .glb, or a .gltf with data URIs. `name` stands for
/// its path, in messages and in the scene's name; nothing is read from there.
///
/// # Errors
/// As [`load`]; a buffer or image in a file of its own is refused.
pub fn load_bytes(name: &str, bytes: &[u8]) -> Result<Scene, LoadError> {
    load_bytes_within(name, bytes, &Limits::default())
}

/// As [`load_bytes`], within given limits.
///
/// # Errors
/// As there.
pub fn load_bytes_within(name: &str, bytes: &[u8], limits: &Limits) -> Result<Scene, LoadError> {
    let source = &Source::new(name.as_ref());
    resources::check_scene_length(source, limits, bytes.len() as u64)?;
    import(source, limits, bytes, Neighbors::None)
}

/// Files that a scene names beside itself, be they there or not: buffers and images. None of a scene that cannot be read.
pub fn linked_files(path: impl AsRef<Path>) -> Vec<PathBuf> {
    let (source, limits) = (&Source::new(path.as_ref()), &Limits::default());
    let linked = || -> Result<Vec<PathBuf>, LoadError> {
        let bytes = resources::read_scene_file(source, limits)?;
        let document = document::parse(source, container::split(source, &bytes)?.json)?;
        let buffers = document.buffers.iter().map(|buffer| &buffer.uri);
        let uris = buffers.chain(document.images.iter().map(|image| &image.uri)).flatten();
        Ok(uris.filter_map(|uri| resources::file_named(source, uri)).collect())
    };
    linked().unwrap_or_default()
}

fn import(source: &Source, limits: &Limits, bytes: &[u8], neighbors: Neighbors) -> Result<Scene, LoadError> {
    let container = container::split(source, bytes)?;
    if container.json.len() as u64 > limits.json_bytes {
        let found = format!("{} bytes of JSON", container.json.len());
        return Err(source.too_large("/", found, limits.json_bytes, "store buffers and images outside of the JSON"));
    }
    let document = document::parse(source, container.json)?;
    let placed = nodes::place(source, limits, &document)?;
    let mut resources = Resources::new(source, limits, bytes, neighbors);
    let buffers = resources.buffers(&document, container.bin)?;
    let decoded = meshopt::views(source, limits, &document, &buffers)?;
    let views = accessors::views(source, &document, &buffers, &decoded)?;
    #[cfg(feature = "compressed")]
    let streamed = draco::accessors(source, limits, &document, &views)?;
    #[cfg(not(feature = "compressed"))]
    let streamed = std::collections::BTreeMap::new();
    let accessors = accessors::accessors(source, limits, &document, &views, &streamed)?;
    let geometry = Geometry { source, limits, document: &document, accessors: &accessors };
    let mut meshes = instances(&geometry, &placed)?;
    let mut appearance = materials::read(source, &document, &views, &mut resources)?;
    give_material(&mut meshes, &mut appearance.materials);
    if let Some(set) = document.light_map_set
        && let Some(mesh) = meshes.iter().find(|mesh| mesh.uv_set(set).is_none())
    {
        let found = format!("set {set}, which mesh {} does not have", mesh.name);
        let remedy = "use the file as `precompute bake` wrote it, or bake the scene again";
        return Err(source.invalid(document::LIGHT_MAP_SET, found, remedy));
    }
    let mut scene = Scene {
        name: source.file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default(),
        meshes,
        materials: appearance.materials,
        textures: appearance.textures,
        images: appearance.images,
        lights: nodes::lights(source, &document, &placed)?,
        cameras: nodes::cameras(source, &document, &placed)?,
        variants: document.variants.clone(),
        light_map_set: document.light_map_set,
        hash: resources.hash(),
        ..Scene::default()
    };
    sanitize::sanitize(&mut scene);
    Ok(scene)
}

/// Stands for the glTF default material until [`give_material`].
const NO_MATERIAL: usize = usize::MAX;

/// One mesh per primitive of every placed node.
fn instances(geometry: &Geometry<'_>, placed: &[Placed]) -> Result<Vec<Mesh>, LoadError> {
    let document: &Document = geometry.document;
    check_counts(geometry, placed)?;
    // Each primitive is read once, however many nodes draw it.
    let mut shapes: Vec<Option<Vec<_>>> = document.meshes.iter().map(|_| None).collect();
    let mut meshes = Vec::new();
    for Placed { node, to_world, lightmap } in placed {
        let Some(mesh) = document.nodes[*node].mesh.map(|mesh| mesh.value()) else { continue };
        let data = &document.meshes[mesh];
        let shapes = match &mut shapes[mesh] {
            Some(shapes) => shapes,
            unread => {
                let primitives = 0..data.primitives.len();
                unread.insert(primitives.map(|each| geometry.read(mesh, each)).collect::<Result<_, _>>()?)
            }
        };
        let name = nodes::name_of([&document.nodes[*node].name, &data.name], "mesh", mesh);
        let copies = instancing::transforms(geometry, *node)?.unwrap_or_else(|| vec![DMat4::IDENTITY]);
        for to_node in copies {
            for (primitive, shape) in shapes.iter().enumerate() {
                let Some(shape) = shape else { continue };
                meshes.push(Mesh {
                    name: name.clone(),
                    source: geometry::place_of(mesh, primitive),
                    material: data.primitives[primitive].material.map_or(NO_MATERIAL, |material| material.value()),
                    variants: variants_of(geometry, mesh, primitive),
                    lightmap: *lightmap,
                    ..geometry.place(shape, *to_world * to_node, *node)?
                });
            }
        }
    }
    Ok(meshes)
}

/// Materials of a primitive in variants of the scene.
fn variants_of(geometry: &Geometry<'_>, mesh: usize, primitive: usize) -> Vec<[usize; 2]> {
    let extensions = geometry.document.meshes[mesh].primitives[primitive].extensions.as_ref();
    let extension = extensions.and_then(|extensions| extensions.others.get("KHR_materials_variants"));
    let mappings = extension.and_then(|extension| extension["mappings"].as_array());
    let of_mapping = |mapping: &Value| {
        // Both are in range, if they are there.
        let material = mapping["material"].as_u64()? as usize;
        let variants = mapping["variants"].as_array()?.iter().filter_map(Value::as_u64);
        Some(variants.map(|variant| [variant as usize, material]).collect::<Vec<_>>())
    };
    mappings.into_iter().flatten().filter_map(of_mapping).flatten().collect()
}

/// Refuses what no bake could hold before any of it is read, and meshes that are broken though nothing draws them.
fn check_counts(geometry: &Geometry<'_>, placed: &[Placed]) -> Result<(), LoadError> {
    let document = geometry.document;
    let mut counts = Vec::with_capacity(document.meshes.len());
    for (mesh, data) in document.meshes.iter().enumerate() {
        let mut count: u64 = 0;
        for primitive in 0..data.primitives.len() {
            geometry::check_primitive(geometry.source, document, mesh, primitive)?;
            count = count.saturating_add(geometry.triangle_count(mesh, primitive)?.unwrap_or(0));
        }
        counts.push(count);
    }
    let mut total: u64 = 0;
    for placed in placed {
        if let Some(mesh) = document.nodes[placed.node].mesh {
            let copies = instancing::count(geometry, placed.node)?.unwrap_or(1);
            total = total.saturating_add(counts[mesh.value()].saturating_mul(copies));
            geometry.check_total(total, placed.node)?;
        }
    }
    Ok(())
}

/// Adds the default material if a mesh needs it.
fn give_material(meshes: &mut [Mesh], materials: &mut Vec<Material>) {
    let added = materials.len();
    let mut is_needed = false;
    for mesh in meshes.iter_mut().filter(|mesh| mesh.material == NO_MATERIAL) {
        mesh.material = added;
        is_needed = true;
    }
    if is_needed {
        let taken: BTreeSet<String> = materials.iter().map(|material| material.name.clone()).collect();
        let name = materials::unused_name(&taken, &Material::default().name, 2);
        materials.push(Material { name, ..Material::default() });
    }
}
