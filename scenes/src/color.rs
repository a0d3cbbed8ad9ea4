//! Colors: linear Rec. 709 everywhere.

use glam::DVec3;

/// Luminance of Rec. 709, in the unit of the color.
pub fn luminance(color: impl Into<DVec3>) -> f64 {
    color.into().dot(DVec3::new(0.2126, 0.7152, 0.0722))
}
