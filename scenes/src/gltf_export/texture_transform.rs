//! A texture matrix back to the offset, rotation and scale of KHR_texture_transform.

use crate::gltf_import::texture_transform;
use glam::{Affine2, Vec2};

/// The properties of KHR_texture_transform.
pub(super) struct Parts {
    pub offset: Vec2,
    /// Radians.
    pub rotation: f32,
    pub scale: Vec2,
}

/// Parts that give the matrix when they are read again: the same bits if the matrix came from such parts (with an
/// angle of at most half a turn), the nearest rotation and scale otherwise. The format cannot express shear.
pub(super) fn decompose(transform: Affine2) -> Parts {
    let offset = transform.translation;
    let (x, y) = (transform.matrix2.x_axis, transform.matrix2.y_axis);
    let angle = match x == Vec2::ZERO {
        true => f64::from(y.x).atan2(f64::from(y.y)),
        false => f64::from(-x.y).atan2(f64::from(x.x)),
    };
    let estimate = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let [x, y] = [x, y].map(Vec2::as_dvec2);
        Vec2::new((x.x * cos - x.y * sin) as f32, (y.x * sin + y.y * cos) as f32)
    };
    // A negative scale along u looks like half a turn; both angles are tried. Rounding the matrix to f32 moves angle and
    // scale by an ulp or two, hence the neighbors.
    let half_turn = if angle > 0.0 { angle - std::f64::consts::PI } else { angle + std::f64::consts::PI };
    for angle in [angle, half_turn] {
        for rotation in neighbors(angle as f32) {
            let guess = estimate(f64::from(rotation));
            let column = |scale: Vec2| texture_transform(offset, rotation, scale).matrix2;
            let u = neighbors(guess.x).find(|&u| column(Vec2::new(u, guess.y)).x_axis == x);
            let v = neighbors(guess.y).find(|&v| column(Vec2::new(guess.x, v)).y_axis == y);
            if let (Some(u), Some(v)) = (u, v) {
                return Parts { offset, rotation, scale: Vec2::new(u, v) };
            }
        }
    }
    Parts { offset, rotation: angle as f32, scale: estimate(angle) }
}

/// The value, then the floats around it.
fn neighbors(value: f32) -> impl Iterator<Item = f32> {
    const REACH: usize = 6;
    let up = std::iter::successors(Some(value), |value| Some(value.next_up())).skip(1).take(REACH);
    let down = std::iter::successors(Some(value), |value| Some(value.next_down())).skip(1).take(REACH);
    std::iter::once(value).chain(up).chain(down)
}
