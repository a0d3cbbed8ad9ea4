//! Directions and normals, which have unit length.

use glam::{DVec3, Vec3};

/// A vector scaled to unit length. One that is a unit vector already, but for the rounding of its f32 components, keeps
/// its bits, so that reading what was written changes nothing.
pub(crate) fn unit_or_keep(vector: DVec3) -> Vec3 {
    // Rounding each component by at most 2^-24 of itself changes the squared length by at most 2^-23 (and a bit).
    let rounded = vector.as_vec3();
    if (rounded.as_dvec3().length_squared() - 1.0).abs() <= 2f64.powi(-22) {
        return rounded;
    }
    vector.normalize_or_zero().as_vec3()
}
