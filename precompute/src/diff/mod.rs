//! What differs between two baked files: [`FileDiff`] by section, field and option, [`LightDiff`] in the light that they give.

mod files;
mod light;

pub use files::{Counts, FieldDiff, FileDiff, SectionDiff};
pub use light::{LightDiff, Lit, Place};
