//! Draws a scene as a host of `localprt-runtime` would: textured surfaces under direct light with shadow maps, indirect
//! light from the maps of a [`Relighter`](localprt_runtime::Relighter), the sky behind it, and objects that move.
//!
//! In: a [`Scene`](localprt_scenes::Scene) with lightmap coordinates, a relighter that has been given the same scene, a
//! [`View`]. Out: radiance and a tone-mapped picture in an [`OffscreenTarget`].
//!
//! ```no_run
//! # use localprt_viewer::{DrawOptions, OffscreenTarget, SceneDraw, ToneMap, View};
//! # fn f(device: &wgpu::Device, queue: &wgpu::Queue, scene: &localprt_scenes::Scene,
//! #      gi: &mut localprt_runtime::Relighter, view: &View) -> Result<(), Box<dyn std::error::Error>> {
//! let mut draw = SceneDraw::new(device, queue, scene, gi, DrawOptions::default())?;
//! let target = OffscreenTarget::new(device, 960, 540);
//! let mut encoder = device.create_command_encoder(&Default::default());
//! gi.encode(&mut encoder, &localprt_runtime::DirectLight::Lights)?;
//! draw.encode(queue, &mut encoder, gi, view, &target, None, None)?;
//! target.tone_map(queue, &mut encoder, 1.0, ToneMap::default());
//! queue.submit([encoder.finish()]);
//! let rgb = target.read_srgb(device, queue)?;
//! # Ok(()) }
//! ```
//!
//! World space, metres, +Y up; radiance in W sr^-1 m^-2, linear Rec. 709.

mod app;
mod blit;
#[cfg(not(target_arch = "wasm32"))]
mod camera_path;
#[cfg(not(target_arch = "wasm32"))]
pub mod cli;
mod daylight;
mod draw_error;
mod exposure;
mod frame;
mod geometry;
mod gizmo;
mod gpu;
#[cfg(not(target_arch = "wasm32"))]
mod headless;
mod object_light;
mod objects;
mod open_bake;
mod options;
mod other_light;
mod other_system;
mod overlay_shapes;
mod overlays;
#[cfg(target_arch = "wasm32")]
mod page;
mod panel;
mod receiver_maps;
#[cfg(not(target_arch = "wasm32"))]
mod run;
mod scene_draw;
mod scene_overlays;
mod sky;
mod stage;
mod state;
mod target;
mod textures;
mod tone;
mod ui;
mod viewpoint;
mod viewport;
mod views;
#[cfg(target_arch = "wasm32")]
pub mod web;
mod window;

pub use app::{App, CameraMode, Requests, Viewport};
pub use blit::PixelRect;
pub use draw_error::DrawError;
pub use frame::Renderer;
pub use gizmo::{Drag, MouseRay, axis_under, drag_along, gizmo};
pub use gpu::Gpu;
#[cfg(not(target_arch = "wasm32"))]
pub use headless::Headless;
pub use objects::{MovingObject, ObjectShape, moving_casters};
pub use open_bake::{Files, OpenBake};
pub use options::{DrawOptions, Specular, View};
pub use other_light::{Beside, OtherLight, OtherRecord};
pub use other_system::{Engine, Found, Moment, OtherFigures, names as system_names};
pub use overlay_shapes::{
    Support, SupportingProbe, light_shape, link_lines, probe_rays, receiver_lines, support_sphere, supporting_probes,
};
pub use overlays::{OverlayLine, Overlays, ProbeSpheres, default_probe_radius_m};
pub use panel::{Figures, History};
pub use receiver_maps::{Legend, ReceiverMap, receiver_map};
#[cfg(not(target_arch = "wasm32"))]
pub use run::run;
pub use scene_draw::SceneDraw;
pub use stage::Stage;
pub use state::{Ball, Bounces, Door, LitObject, Look, OverlayState, SceneLight, ViewState};
pub use target::{OffscreenTarget, WHITE};
pub use tone::ToneMap;
pub use viewpoint::Viewpoint;
pub use views::{GRAY_ALBEDO, ViewKind};
