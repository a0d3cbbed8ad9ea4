//! Surfaces of a scene: between `localprt-scenes`, which says what there is, and whoever lights it.
//!
//! [`rays`] asks what a ray meets and which points see each other; [`emitters`] draws points of what emits; [`atlas`] reads layouts,
//! covers maps with them and spreads points over their texels. All in world space, metres, with unit normals.

pub mod atlas;
pub mod emitters;
pub mod rays;
mod sets;
#[cfg(test)]
#[allow(dead_code, reason = "tests of layouts, which include this file, use the rest")]
mod test_scenes;
mod triangle;

pub use sets::Sets;
pub use triangle::subdivision;
