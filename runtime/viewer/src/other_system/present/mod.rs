//! Systems, where they are part of the viewer.

mod engine;
mod moving_scene;
mod worker;

pub use engine::{Engine, names};
pub(crate) use worker::Beneath;
