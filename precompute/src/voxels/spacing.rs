//! Probe spacing rho and the number of grid points it stands for.

use crate::settings::BakeSettings;
use glam::Vec3;

/// Probes that the default spacing aims at (SL17 uses 150 to 275 and leaves its spacing unstated).
pub const DEFAULT_PROBES: u32 = 150;

/// Probe spacing rho in metres: `settings.spacing`, or the spacing whose regular grid over the scene box has about
/// `settings.probes` points, or about [`DEFAULT_PROBES`].
///
/// `bounds` are the lowest and highest corner of the scene box in metres. Not validated here:
/// [`super::VoxelGrid::build`] refuses a spacing that is not positive.
pub fn spacing(bounds: (Vec3, Vec3), settings: &BakeSettings) -> f32 {
    settings.spacing.unwrap_or_else(|| spacing_for(bounds, settings.probes.unwrap_or(DEFAULT_PROBES)))
}

/// Points of a regular grid of spacing `rho` over a box, `prod(floor(d_i / rho) + 1)`; at least 1, flat boxes included.
pub fn grid_points((low, high): (Vec3, Vec3), rho: f32) -> f64 {
    points((low, high), f64::from(rho))
}

/// The spacing in metres whose regular grid over the box has the number of points closest to `count`.
///
/// The number of points falls in steps; of the two steps around `count` the nearer one is taken. A box without extent
/// gives 1 m.
pub fn spacing_for((low, high): (Vec3, Vec3), count: u32) -> f32 {
    let longest = (high.as_dvec3() - low.as_dvec3()).max_element();
    if !(longest > 0.0 && longest.is_finite()) {
        return 1.0;
    }
    let target = f64::from(count.max(1));
    // One point only, and the largest spacing this function returns.
    let mut large = longest * 1.01;
    let mut small = longest;
    while points((low, high), small) < target {
        large = small;
        small *= 0.5;
    }
    for _ in 0..60 {
        let middle = 0.5 * (small + large);
        if points((low, high), middle) >= target {
            small = middle;
        } else {
            large = middle;
        }
    }
    // A step lies exactly between the two: keep clear of it, so that rounding to f32 does not change the side.
    let (small, large) = (small * (1.0 - 1e-6), large * (1.0 + 1e-6));
    let above = points((low, high), small) - target;
    let below = target - points((low, high), large);
    (if below < above { large } else { small }) as f32
}

fn points((low, high): (Vec3, Vec3), rho: f64) -> f64 {
    let counts = ((high.as_dvec3() - low.as_dvec3()) / rho).floor() + 1.0;
    let product = counts.element_product();
    if product.is_nan() { f64::INFINITY } else { product.max(1.0) }
}
