//! Scenes built in code, for tests, first steps and closed forms. World space in metres, +Y up, linear colors.
//!
//! Walls of rooms are single-sided and face inwards: from outside they are invisible to a camera and black to light. Only
//! `room-on-plain`, `blinds`, `atrium` and `city` have walls with two sides.
//! None of the scenes has lightmap coordinates; the bake unwraps them.

mod atrium;
mod blinds;
mod bricks;
mod city;
mod cornell;
mod drawn;
mod furnace;
mod plane;
mod room_on_plain;
mod shapes;
mod sphere;
mod two_rooms;

pub use city::MOST_BLOCKS;
pub use furnace::{FURNACE_ALBEDO, FURNACE_EMISSION, furnace_irradiance};
pub use sphere::{SPHERE_ALBEDO, SPHERE_INTENSITY};

use crate::light::{Light, LightKind};
use crate::scene::{AlphaMode, Camera, Material, Scene, TextureRef};
use glam::{Mat4, Vec3};

/// Names of all built-in scenes, the first one being the one to start with.
pub fn names() -> &'static [&'static str] {
    &[
        "cornell",
        "furnace",
        "two-rooms",
        "two-rooms-door",
        "atrium",
        "city",
        "room-on-plain",
        "blinds",
        "bricks",
        "sphere",
        "plane",
    ]
}

/// Builds a scene; `None` for a name that is not in [`names`]. `two-rooms:doorway` is another name of `two-rooms-door`; `city:N` is a
/// city of N blocks, 1 to [`MOST_BLOCKS`], and `city` the one of 4.
pub fn scene(name: &str) -> Option<Scene> {
    let mut scene = match name {
        "cornell" => cornell::build(),
        "furnace" => furnace::build(),
        "two-rooms" => two_rooms::build(false),
        "two-rooms-door" | "two-rooms:doorway" => two_rooms::build(true),
        "atrium" => atrium::build(),
        "room-on-plain" => room_on_plain::build(),
        "blinds" => blinds::build(),
        "bricks" => bricks::build(),
        "sphere" => sphere::build(),
        "plane" => plane::build(),
        _ => city::build(city::blocks(name)?),
    };
    // Names that are those of files too.
    scene.name = if name == "two-rooms:doorway" { "two-rooms-door".into() } else { name.replace(':', "-") };
    for mesh in &mut scene.meshes {
        mesh.source = format!("builtin:{name}/{}", mesh.name);
    }
    scene.hash = content_hash(&scene);
    Some(scene)
}

/// BLAKE3 of what a bake depends on: meshes, materials, textures and images. Names of meshes, lights and cameras do not
/// count, names of materials do.
pub fn content_hash(scene: &Scene) -> [u8; 32] {
    let mut hasher = Hasher(blake3::Hasher::new());
    hasher.count(scene.meshes.len());
    for mesh in &scene.meshes {
        hasher.count(mesh.material);
        hasher.floats(mesh.positions.iter().flat_map(|position| position.to_array()));
        hasher.floats(mesh.normals.iter().flat_map(|normal| normal.to_array()));
        hasher.floats(mesh.tangents.iter().flat_map(|tangent| tangent.to_array()));
        hasher.floats(mesh.colors.iter().flat_map(|color| color.to_array()));
        hasher.count(mesh.uv_sets.len());
        for set in &mesh.uv_sets {
            hasher.floats(set.iter().flat_map(|uv| uv.to_array()));
        }
        hasher.bytes(mesh.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect::<Vec<u8>>());
    }
    hasher.count(scene.materials.len());
    for material in &scene.materials {
        hasher.bytes(&material.name);
        hasher.floats(material.base_color.to_array());
        hasher.floats(material.emission.to_array());
        hasher.floats([material.normal_scale, material.metallic, material.roughness]);
        let cutoff = match material.alpha {
            AlphaMode::Opaque => [0.0, 0.0],
            AlphaMode::Mask { cutoff } => [1.0, cutoff],
            AlphaMode::Blend => [2.0, 0.0],
        };
        hasher.floats(cutoff);
        hasher.count(usize::from(material.double_sided));
        for texture in [&material.base_color_texture, &material.emission_texture, &material.normal_texture] {
            hasher.texture(texture.as_ref());
        }
    }
    hasher.count(scene.textures.len());
    for texture in &scene.textures {
        hasher.count(texture.image);
        hasher.bytes([texture.wrap_u as u8, texture.wrap_v as u8, u8::from(texture.nearest)]);
    }
    hasher.count(scene.images.len());
    for image in &scene.images {
        hasher.count(image.width as usize);
        hasher.count(image.height as usize);
        hasher.bytes(&image.rgba);
    }
    *hasher.0.finalize().as_bytes()
}

/// Every array goes in with its length, so that no two scenes run into the same bytes.
struct Hasher(blake3::Hasher);

impl Hasher {
    fn count(&mut self, count: usize) {
        self.0.update(&(count as u64).to_le_bytes());
    }

    fn bytes(&mut self, bytes: impl AsRef<[u8]>) {
        self.count(bytes.as_ref().len());
        self.0.update(bytes.as_ref());
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f32>) {
        // Plus 0 makes one zero of both.
        self.bytes(values.into_iter().flat_map(|value| (value + 0.0).to_le_bytes()).collect::<Vec<u8>>());
    }

    fn texture(&mut self, reference: Option<&TextureRef>) {
        self.count(usize::from(reference.is_some()));
        if let Some(reference) = reference {
            self.count(reference.texture);
            self.count(reference.uv_set);
            self.floats(reference.transform.to_cols_array());
        }
    }
}

/// A diffuse material.
fn matte(name: &str, albedo: [f32; 3]) -> Material {
    let base_color = Vec3::from_array(albedo).extend(1.0);
    Material { name: name.into(), base_color, metallic: 0.0, ..Material::default() }
}

/// A white point light, intensity in candela.
fn point_light(name: &str, position: Vec3, intensity: f32) -> Light {
    Light {
        name: name.into(),
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Z,
        color: Vec3::ONE,
        intensity,
        range: None,
    }
}

/// An afternoon's sun of 20 W m^-2 that shines in a direction.
fn sun(direction: Vec3) -> Light {
    Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: direction.normalize(),
        color: Vec3::new(1.0, 0.95, 0.85),
        intensity: 20.0,
        range: None,
    }
}

/// A camera with +Y up; `fov_y` in degrees.
fn camera(name: &str, eye: Vec3, target: Vec3, fov_y: f32) -> Camera {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let to_world = Mat4::from_cols(right.extend(0.0), back.cross(right).extend(0.0), back.extend(0.0), eye.extend(1.0));
    Camera { name: name.into(), to_world, fov_y: fov_y.to_radians(), aspect: None }
}

#[cfg(test)]
mod tests;
