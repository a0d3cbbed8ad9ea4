//! Shadow maps: what each light sees first, as depth.
//!
//! In: [`ShadowCasters`] and lights. Out: one depth map per [`ShadowView`] of a light, and how to read it.
//!
//! A directional light has one orthographic map of the whole scene, a spot one perspective map of its cone, a point
//! light six, as has a spot too wide for one map. All casters are drawn from both sides, as traced rays meet them: walls
//! may be single triangles that face one room only, so neither side alone closes a scene.
//!
//! Depths are stored as they are and receivers are moved off their surface instead of being biased in depth: by the
//! rounding of positions, and by just enough along the geometric normal that a flat surface cannot shade itself through
//! the texels that one read compares ([`ShadowView::receiver_offset_m`]). The price: a caster lower than the offset, at
//! most 1.6 texels of the map, casts no shadow where it touches the ground, and within 2.7 texels of a silhouette on the
//! map (a wall's foot is one too) light and shadow mix.

mod casters;
#[cfg(feature = "gpu")]
pub(crate) mod gpu;
#[cfg(feature = "gpu")]
pub mod records;
mod reference;
mod views;

pub use casters::{AlphaImage, AlphaMask, CasterBounds, CasterMasks, NO_MASK, ShadowCasters};
pub use reference::{ShadowMap, shadow_map};
pub use views::{MAX_SPOT_MAP_ANGLE, MIN_SHADOW_MAP_SIZE, ShadowView, shadow_views};
