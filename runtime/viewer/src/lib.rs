//! Draws a scene as a host of `localprt-runtime` would: textured surfaces under direct light with shadow maps, indirect
//! light from the maps of a [`Relighter`](localprt_runtime::Relighter), the sky behind it, and objects that move.
//!
//! In: a [`Scene`](localprt_scenes::Scene) with lightmap coordinates, a relighter that has been given the same scene, a
//! [`View`]. Out: radiance and a tone-mapped picture in an [`OffscreenTarget`].
//!
//! ```no_run
//! # use localprt_viewer::{DrawOptions, OffscreenTarget, SceneDraw, View};
//! # fn f(device: &wgpu::Device, queue: &wgpu::Queue, scene: &localprt_scenes::Scene,
//! #      gi: &mut localprt_runtime::Relighter, view: &View) -> Result<(), Box<dyn std::error::Error>> {
//! let mut draw = SceneDraw::new(device, queue, scene, gi, DrawOptions::default())?;
//! let target = OffscreenTarget::new(device, 960, 540);
//! let mut encoder = device.create_command_encoder(&Default::default());
//! gi.encode(&mut encoder, &localprt_runtime::DirectLight::Lights)?;
//! draw.encode(queue, &mut encoder, gi, view, &target)?;
//! target.tone_map(queue, &mut encoder, 1.0);
//! queue.submit([encoder.finish()]);
//! let rgb = target.read_srgb(device, queue)?;
//! # Ok(()) }
//! ```
//!
//! World space, metres, +Y up; radiance in W sr^-1 m^-2, linear Rec. 709.

mod geometry;
mod objects;
mod scene_draw;
mod sky;
mod target;
mod textures;

pub use objects::{MovingObject, ObjectShape, moving_casters};
pub use scene_draw::{DrawError, DrawOptions, SceneDraw, Specular, View};
pub use target::{OffscreenTarget, WHITE};
