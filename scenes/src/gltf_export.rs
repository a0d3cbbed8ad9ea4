//! glTF 2.0 export: a [`Scene`] to one .glb file that loads as the same scene.
//!
//! Geometry stays in world space, so every node is at rest; lights and cameras keep their transforms. The same scene
//! gives the same bytes.

mod images;
mod texture_transform;

use crate::light::{Light, LightKind};
use crate::scene::{AlphaMode, Camera, LightmapWish, Material, Mesh, Scene, Texture, TextureRef, Wrap};
use glam::{Affine2, Mat4, Vec2, Vec3, Vec4};
use gltf::json::{accessor, buffer, mesh, texture};
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Why a scene could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// Creating, writing or renaming the file failed.
    #[error("{}: cannot be written: {cause}", .file.display())]
    Write {
        /// The file to be written.
        file: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// A GLB holds at most 4 GiB.
    #[error("{}: needs {bytes} bytes, a .glb holds at most {limit}", .file.display())]
    TooLarge {
        /// The file to be written.
        file: PathBuf,
        /// Bytes needed.
        bytes: u64,
        /// Bytes possible.
        limit: u64,
    },
    /// An image without encoded bytes could not be encoded as PNG.
    #[error("{}: image {image:?} cannot be encoded: {cause}", .file.display())]
    Image {
        /// The file to be written.
        file: PathBuf,
        /// Name of the image.
        image: String,
        /// What the encoder said.
        cause: image::ImageError,
    },
}

impl ExportError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::Write { .. } => "check the folder, its permissions and the free space",
            Self::TooLarge { .. } => "split the scene",
            Self::Image { .. } => "give the image a size that matches its pixels",
        }
    }
}

/// Writes a scene as .glb: one node and mesh per [`Mesh`], in order, then lights and cameras. The file appears whole or
/// not at all. Returns the hash that the scene has when it is read from there.
///
/// # Errors
/// [`ExportError::Write`] if the file cannot be written, [`ExportError::TooLarge`] beyond 4 GiB,
/// [`ExportError::Image`] if an image cannot be encoded.
pub fn export_glb(scene: &Scene, path: impl AsRef<Path>) -> Result<[u8; 32], ExportError> {
    let path = path.as_ref();
    let (root, bin) = document(scene, path)?;
    let glb = container(&root, &bin).map_err(|bytes| ExportError::TooLarge {
        file: path.to_owned(),
        bytes,
        limit: u64::from(u32::MAX),
    })?;
    write_atomically(path, &glb).map_err(|cause| ExportError::Write { file: path.to_owned(), cause })?;
    Ok(*blake3::hash(&glb).as_bytes())
}

/// The glTF JSON under construction, with its one buffer.
#[derive(Default)]
struct Writer {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    extensions: Vec<&'static str>,
}

fn document(scene: &Scene, path: &Path) -> Result<(Value, Vec<u8>), ExportError> {
    let mut writer = Writer::default();
    for mesh in &scene.meshes {
        writer.mesh(mesh);
    }
    let images = scene.images.iter().map(|image| {
        images::encoded(image)
            .map(|(mime, bytes)| {
                let view = writer.view(&bytes, None);
                json!({ "name": image.name, "mimeType": mime, "bufferView": view })
            })
            .map_err(|cause| ExportError::Image { file: path.to_owned(), image: image.name.clone(), cause })
    });
    let images: Vec<Value> = images.collect::<Result<_, _>>()?;
    let materials: Vec<Value> = scene.materials.iter().map(|material| writer.material(material)).collect();
    let lights: Vec<Value> = scene.lights.iter().map(|light| writer.light(light)).collect();
    let cameras: Vec<Value> = scene.cameras.iter().map(|camera| writer.camera(camera)).collect();
    let samplers: Vec<Value> = scene.textures.iter().map(sampler).collect();
    let textures: Vec<Value> = scene
        .textures
        .iter()
        .enumerate()
        .map(|(sampler, texture)| json!({ "source": texture.image, "sampler": sampler }))
        .collect();

    let mut root = Map::new();
    let generator = concat!("localprt ", env!("CARGO_PKG_VERSION"));
    let mut asset = json!({ "version": "2.0", "generator": generator });
    if let Some(set) = scene.light_map_set {
        asset["extras"] = json!({ "localprt": { "light_map_set": set } });
    }
    root.insert("asset".into(), asset);
    if !scene.variants.is_empty() {
        writer.extensions.push("KHR_materials_variants");
    }
    writer.extensions.sort_unstable();
    writer.extensions.dedup();
    let extensions_used: Vec<Value> = writer.extensions.iter().map(|&name| name.into()).collect();
    let buffers = match writer.bin.len() {
        0 => Vec::new(),
        length => vec![json!({ "byteLength": length })],
    };
    let mut node_list = Map::new();
    if !writer.nodes.is_empty() {
        node_list.insert("nodes".into(), (0..writer.nodes.len()).collect());
    }
    // The schema asks for arrays to be absent rather than empty.
    for (key, values) in [
        ("extensionsUsed", extensions_used),
        ("scenes", vec![node_list.into()]),
        ("nodes", writer.nodes),
        ("meshes", writer.meshes),
        ("cameras", cameras),
        ("materials", materials),
        ("textures", textures),
        ("samplers", samplers),
        ("images", images),
        ("accessors", writer.accessors),
        ("bufferViews", writer.views),
        ("buffers", buffers),
    ] {
        if !values.is_empty() {
            root.insert(key.into(), values.into());
        }
    }
    root.insert("scene".into(), 0.into());
    let mut extensions = Map::new();
    if !lights.is_empty() {
        extensions.insert("KHR_lights_punctual".into(), json!({ "lights": lights }));
    }
    if !scene.variants.is_empty() {
        let variants: Vec<Value> = scene.variants.iter().map(|name| json!({ "name": name })).collect();
        extensions.insert("KHR_materials_variants".into(), json!({ "variants": variants }));
    }
    if !extensions.is_empty() {
        root.insert("extensions".into(), extensions.into());
    }
    Ok((root.into(), writer.bin))
}

impl Writer {
    /// Adds bytes at a multiple of four.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bin.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn floats<const N: usize>(&mut self, kind: &str, values: impl Iterator<Item = [f32; N]>) -> usize {
        let bytes: Vec<u8> = values.flatten().flat_map(f32::to_le_bytes).collect();
        let view = self.view(&bytes, Some(buffer::ARRAY_BUFFER));
        let count = bytes.len() / (4 * N);
        self.accessor(json!({ "bufferView": view, "componentType": accessor::FLOAT, "count": count, "type": kind }))
    }

    /// Fills a gap between sets, which are numbered without any, and is read as an absent set. It says 0 of the first vertex: common
    /// readers refuse an accessor that says nothing, which glTF has for zeros.
    fn zeros(&mut self, count: usize) -> usize {
        let view = self.view(&[0; 8], None);
        self.accessor(json!({
            "componentType": accessor::FLOAT,
            "count": count,
            "type": "VEC2",
            "sparse": {
                "count": 1,
                "indices": { "bufferView": view, "componentType": accessor::UNSIGNED_INT },
                "values": { "bufferView": view },
            },
        }))
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn mesh(&mut self, mesh: &Mesh) {
        // A glTF mesh cannot be empty; its node stays, so that nodes and meshes of the scene keep their numbers.
        if mesh.triangles.is_empty() || mesh.positions.is_empty() {
            self.nodes.push(json!({ "name": mesh.name }));
            return;
        }
        let mut attributes = Map::new();
        let positions = self.floats("VEC3", mesh.positions.iter().map(Vec3::to_array));
        let first = mesh.positions[0];
        let low = mesh.positions.iter().copied().fold(first, Vec3::min);
        let high = mesh.positions.iter().copied().fold(first, Vec3::max);
        self.accessors[positions]["min"] = json!(low.to_array());
        self.accessors[positions]["max"] = json!(high.to_array());
        attributes.insert("POSITION".into(), positions.into());
        if !mesh.normals.is_empty() {
            let normals = self.floats("VEC3", mesh.normals.iter().map(Vec3::to_array));
            attributes.insert("NORMAL".into(), normals.into());
        }
        if !mesh.tangents.is_empty() {
            let tangents = self.floats("VEC4", mesh.tangents.iter().map(Vec4::to_array));
            attributes.insert("TANGENT".into(), tangents.into());
        }
        let used_sets = mesh.uv_sets.iter().rposition(|set| !set.is_empty()).map_or(0, |last| last + 1);
        for (number, set) in mesh.uv_sets[..used_sets].iter().enumerate() {
            let accessor = match set.as_slice() {
                [] => self.zeros(mesh.positions.len()),
                set => self.floats("VEC2", set.iter().map(Vec2::to_array)),
            };
            attributes.insert(format!("TEXCOORD_{number}"), accessor.into());
        }
        if !mesh.colors.is_empty() {
            let colors = self.floats("VEC4", mesh.colors.iter().map(Vec4::to_array));
            attributes.insert("COLOR_0".into(), colors.into());
        }
        let bytes: Vec<u8> = mesh.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(buffer::ELEMENT_ARRAY_BUFFER));
        let indices = self.accessor(json!({
            "bufferView": view,
            "componentType": accessor::UNSIGNED_INT,
            "count": mesh.triangles.len() * 3,
            "type": "SCALAR",
        }));
        self.meshes.push(json!({
            "name": mesh.name,
            "primitives": [{
                "attributes": attributes,
                "indices": indices,
                "material": mesh.material,
                "mode": mesh::TRIANGLES,
            }],
        }));
        if !mesh.variants.is_empty() {
            self.extensions.push("KHR_materials_variants");
            let mapping = |[variant, material]: &[usize; 2]| json!({ "material": material, "variants": [variant] });
            let mappings: Vec<Value> = mesh.variants.iter().map(mapping).collect();
            let last = self.meshes.len() - 1;
            self.meshes[last]["primitives"][0]["extensions"] =
                json!({ "KHR_materials_variants": { "mappings": mappings } });
        }
        let mut node = json!({ "name": mesh.name, "mesh": self.meshes.len() - 1 });
        if mesh.lightmap != LightmapWish::default() {
            let LightmapWish { texel_scale, bake } = mesh.lightmap;
            node["extras"] = json!({ "localprt": { "texel_scale": texel_scale, "bake": bake } });
        }
        self.nodes.push(node);
    }

    fn material(&mut self, material: &Material) -> Value {
        let mut pbr = json!({
            "baseColorFactor": material.base_color.to_array(),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        });
        if let Some(reference) = &material.base_color_texture {
            pbr["baseColorTexture"] = self.texture_info(reference);
        }
        // A power of two, so that dividing by it and multiplying again gives the same floats.
        let brightest = material.emission.max_element();
        let strength = if brightest > 1.0 { 2f64.powi(f64::from(brightest).log2().ceil() as i32) as f32 } else { 1.0 };
        let mut value = json!({
            "name": material.name,
            "pbrMetallicRoughness": pbr,
            "emissiveFactor": (material.emission / strength).to_array(),
            "doubleSided": material.double_sided,
        });
        if strength != 1.0 {
            self.extensions.push("KHR_materials_emissive_strength");
            value["extensions"]["KHR_materials_emissive_strength"] = json!({ "emissiveStrength": strength });
        }
        if material.transmission > 0.0 {
            self.extensions.push("KHR_materials_transmission");
            value["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": material.transmission });
        }
        if let Some(reference) = &material.emission_texture {
            value["emissiveTexture"] = self.texture_info(reference);
        }
        if let Some(reference) = &material.normal_texture {
            value["normalTexture"] = self.texture_info(reference);
            value["normalTexture"]["scale"] = json!(material.normal_scale);
        }
        match material.alpha {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { cutoff } => {
                value["alphaMode"] = "MASK".into();
                value["alphaCutoff"] = json!(cutoff);
            }
            AlphaMode::Blend => value["alphaMode"] = "BLEND".into(),
        }
        value
    }

    fn texture_info(&mut self, reference: &TextureRef) -> Value {
        let mut info = json!({ "index": reference.texture, "texCoord": reference.uv_set });
        if reference.transform != Affine2::IDENTITY {
            self.extensions.push("KHR_texture_transform");
            let parts = texture_transform::decompose(reference.transform);
            info["extensions"] = json!({ "KHR_texture_transform": {
                "offset": parts.offset.to_array(),
                "rotation": parts.rotation,
                "scale": parts.scale.to_array(),
            } });
        }
        info
    }

    fn light(&mut self, light: &Light) -> Value {
        self.extensions.push("KHR_lights_punctual");
        let mut value = json!({ "name": light.name, "color": light.color.to_array(), "intensity": light.intensity });
        match light.kind {
            LightKind::Point => value["type"] = "point".into(),
            LightKind::Directional => value["type"] = "directional".into(),
            LightKind::Spot { inner_cone, outer_cone } => {
                value["type"] = "spot".into();
                value["spot"] = json!({ "innerConeAngle": inner_cone, "outerConeAngle": outer_cone });
            }
        }
        if let Some(range) = light.range {
            value["range"] = json!(range);
        }
        let number = self.nodes.iter().filter(|node| node.get("extensions").is_some()).count();
        let back = -light.direction.normalize_or(Vec3::NEG_Z);
        let (right, up) = back.any_orthonormal_pair();
        let axes = [right.extend(0.0), up.extend(0.0), back.extend(0.0), light.position.extend(1.0)];
        // The third axis keeps the direction's bits, so that it is read back exactly.
        let axes = if light.direction.is_normalized() {
            [axes[0], axes[1], (-light.direction).extend(0.0), axes[3]]
        } else {
            axes
        };
        self.nodes.push(json!({
            "name": light.name,
            "matrix": Mat4::from_cols(axes[0], axes[1], axes[2], axes[3]).to_cols_array(),
            "extensions": { "KHR_lights_punctual": { "light": number } },
        }));
        value
    }

    fn camera(&mut self, camera: &Camera) -> Value {
        let number = self.nodes.iter().filter(|node| node.get("camera").is_some()).count();
        let matrix = camera.to_world.to_cols_array();
        self.nodes.push(json!({ "name": camera.name, "matrix": matrix, "camera": number }));
        // The bake's cameras have no clipping planes; a near one is mandatory.
        let mut perspective = json!({ "yfov": camera.fov_y, "znear": 0.01 });
        if let Some(aspect) = camera.aspect {
            perspective["aspectRatio"] = json!(aspect);
        }
        json!({ "name": camera.name, "type": "perspective", "perspective": perspective })
    }
}

fn sampler(texture: &Texture) -> Value {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => texture::REPEAT,
        Wrap::MirroredRepeat => texture::MIRRORED_REPEAT,
        Wrap::ClampToEdge => texture::CLAMP_TO_EDGE,
    };
    let filter = if texture.nearest { texture::NEAREST } else { texture::LINEAR };
    json!({ "magFilter": filter, "wrapS": wrap(texture.wrap_u), "wrapT": wrap(texture.wrap_v) })
}

/// The GLB around the JSON and its buffer; the number of bytes it needs if that is too many.
fn container(root: &Value, bin: &[u8]) -> Result<Vec<u8>, u64> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let padded_bin = bin.len().next_multiple_of(4);
    let total = 12 + 8 + text.len() + if bin.is_empty() { 0 } else { 8 + padded_bin };
    let length = |bytes: usize| u32::try_from(bytes).map(u32::to_le_bytes).map_err(|_| total as u64);
    let mut glb = Vec::with_capacity(total);
    glb.extend_from_slice(b"glTF");
    glb.extend_from_slice(&2u32.to_le_bytes());
    glb.extend_from_slice(&length(total)?);
    glb.extend_from_slice(&length(text.len())?);
    glb.extend_from_slice(b"JSON");
    glb.extend_from_slice(&text);
    if !bin.is_empty() {
        glb.extend_from_slice(&length(padded_bin)?);
        glb.extend_from_slice(b"BIN\0");
        glb.extend_from_slice(bin);
        glb.resize(total, 0);
    }
    Ok(glb)
}

/// Writes beside the target, syncs and renames: readers see the old file or the new one.
fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    let permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    // Temporary files are private by default; this one becomes an ordinary file, subject to the umask.
    builder.permissions(permissions);
    let mut file = builder.prefix(".localprt-").suffix(".glb.tmp").tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    #[cfg(unix)]
    std::fs::File::open(folder)?.sync_all()?;
    Ok(())
}
