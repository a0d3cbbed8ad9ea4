//! Scenes and lighting for localprt.
//!
//! In: a glTF 2.0 file ([`load`], [`load_bytes`]) or a built-in scene ([`builtin`]). Out: a [`Scene`], flattened to world space, in
//! metres, +Y up, right-handed, with linear Rec. 709 colors; and a [`Lighting`]: punctual lights, sky and material
//! overrides.

pub mod builtin;
mod color;
pub mod gltf_export;
pub mod gltf_import;
mod guarded;
pub mod light;
pub mod lighting;
mod normal_map;
pub mod scene;
mod unit;
mod variants;

pub use color::luminance;
pub use gltf_export::{ExportError, export_glb};
pub use gltf_import::{
    Limits, LoadError, LoadErrorKind, linked_files, load, load_bytes, load_bytes_within, load_within,
};
pub use guarded::is_guarded;
pub use light::{Incident, Light, LightKind};
pub use lighting::{Lighting, LightingError, MaterialOverride, Sky, SurfaceShading};
pub use scene::{
    AlphaMode, Camera, FaceId, Image, LightmapWish, Material, Mesh, Scene, SurfacePoint, Texture, TextureRef, Wrap,
    linear_to_srgb,
};
pub use variants::VariantError;
