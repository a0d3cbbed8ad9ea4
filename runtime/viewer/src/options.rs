//! From where a picture is taken, and what it shows.

use crate::views::ViewKind;
use glam::Mat4;
use localprt_scenes::Camera;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawOptions {
    /// Light as it is, one part of it, or a map of the bake.
    pub view: ViewKind,
    /// Normal maps bend normals. Where they do, indirect light is that of the degree-1 SH radiance about the bent normal,
    /// if the file has it.
    pub normal_maps: bool,
    /// With [`ViewKind::Final`], mirror reflection of direct light and, if the file has degree-1 SH radiance, of indirect
    /// light.
    pub specular: Option<Specular>,
    /// Backs of one-sided surfaces are left out; otherwise they are black.
    pub cull_backs: bool,
    /// Share of the picture's width from which indirect light is that of [`SceneDraw::set_other`](crate::SceneDraw::set_other) in place
    /// of the relighter's.
    pub split: Option<f32>,
}

impl Default for DrawOptions {
    fn default() -> Self {
        Self { view: ViewKind::Final, normal_maps: true, specular: None, cull_backs: false, split: None }
    }
}

/// Mirror reflection of all surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specular {
    /// Reflectance head on; 0.04 for most that is not metal.
    pub f0: f32,
    /// Replaces the roughness of materials.
    pub roughness: Option<f32>,
}

/// A camera that looks along -Z of its transform, +Y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Camera to world, no scale.
    pub to_world: Mat4,
    /// Vertical field of view, radians.
    pub fov_y: f32,
    /// Distance at which surfaces begin to be drawn, metres.
    pub near_m: f32,
}

impl View {
    /// The view of a scene's camera, for a scene of this size in metres.
    pub fn of_camera(camera: &Camera, extent_m: f32) -> Self {
        Self { to_world: camera.to_world, fov_y: camera.fov_y, near_m: 5e-4 * extent_m }
    }
}
