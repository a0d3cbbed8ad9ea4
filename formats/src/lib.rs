//! Baked transport files of localprt: open, check, write; and the conventions that give their numbers meaning.
//!
//! World space, metres, +Y up; radiance in W sr^-1 m^-2, linear Rec. 709. Layout: `SPEC.md`.

pub mod baked;
pub mod directions;
pub mod sh;
pub mod weight;

pub use baked::{BakedArrays, BakedView, ClusterRecord, LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL, Metadata, Probe};
