//! Handles to move a point with the mouse: three axes, the one under the mouse, and dragging.

use crate::overlay_shapes::{arrow, line};
use crate::overlays::OverlayLine;
use glam::Vec3;

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];
const COLORS: [[f32; 3]; 3] = [[0.9, 0.03, 0.04], [0.1, 0.75, 0.05], [0.04, 0.2, 1.0]];
const HOVERED: [f32; 3] = [1.0, 0.75, 0.05];
/// An axis is under the mouse up to this share of its length beside it.
const REACH: f32 = 0.1;
/// Below this sine between mouse ray and axis or plane, a pixel would move a point by more than 50 times its own size.
const LEAST_SINE: f32 = 0.02;

/// Origin and unit direction of the ray through the mouse.
pub type MouseRay = (Vec3, Vec3);

/// Three arrows along the axes of the world, red, green and blue, and yellow where the mouse is.
pub fn gizmo(position: Vec3, size_m: f32, hovered_axis: Option<usize>) -> Vec<OverlayLine> {
    (0..3)
        .flat_map(|axis| {
            let (color, width_px) = if hovered_axis == Some(axis) { (HOVERED, 5.0) } else { (COLORS[axis], 3.0) };
            let tip = position + size_m * AXES[axis];
            arrow(position, tip, 0.15 * size_m).map(move |(from, to)| line(from, to, color, 1.0, width_px))
        })
        .collect()
}

/// The axis of a [`gizmo`] that a mouse ray passes nearest to, if it is near enough.
pub fn axis_under((origin, dir): MouseRay, position: Vec3, size_m: f32) -> Option<usize> {
    let distance = |axis: usize| {
        // Beside the axis's nearest point; at its ends, beside these.
        let along = along_axis((origin, dir), position, AXES[axis]).unwrap_or(0.0).clamp(0.0, size_m);
        let point = position + along * AXES[axis];
        let ahead = (point - origin).dot(dir);
        if ahead > 0.0 { point.distance(origin + ahead * dir) } else { f32::INFINITY }
    };
    let nearest = (0..3).map(|axis| (axis, distance(axis))).min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.filter(|&(_, distance)| distance <= REACH * size_m).map(|(axis, _)| axis)
}

/// What dragging keeps a point on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drag {
    /// A line along an axis of the world: 0 is X, 1 Y, 2 Z.
    Axis(usize),
    /// A plane with this unit normal; for one that faces the camera, the direction that it looks in.
    Plane(Vec3),
}

/// Where a point goes that the mouse has taken at the ray `from` and drags to the ray `to`. It stays where a ray leads
/// nowhere: along the axis or the plane, or away from it.
pub fn drag_along(drag: Drag, point: Vec3, from: MouseRay, to: MouseRay) -> Vec3 {
    let offset = match drag {
        Drag::Axis(axis) => {
            let dir = AXES[axis.min(2)];
            let at = |ray| along_axis(ray, point, dir);
            at(from).zip(at(to)).map(|(from, to)| (to - from) * dir)
        }
        Drag::Plane(normal) => {
            let at = |ray| on_plane(ray, point, normal);
            at(from).zip(at(to)).map(|(from, to)| to - from)
        }
    };
    point + offset.unwrap_or(Vec3::ZERO)
}

/// How far along a line from `point` its nearest point to a ray's line is. `None` if both are all but parallel.
fn along_axis((origin, dir): MouseRay, point: Vec3, axis: Vec3) -> Option<f32> {
    let cosine = axis.dot(dir);
    let sine_2 = 1.0 - cosine * cosine;
    let between = origin - point;
    (sine_2 > LEAST_SINE * LEAST_SINE).then(|| (between.dot(axis) - between.dot(dir) * cosine) / sine_2)
}

/// Where a ray meets the plane through `point`.
fn on_plane((origin, dir): MouseRay, point: Vec3, normal: Vec3) -> Option<Vec3> {
    let slope = dir.dot(normal);
    let distance = (point - origin).dot(normal) / slope;
    (slope.abs() > LEAST_SINE && distance > 0.0).then(|| origin + distance * dir)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: Vec3, through: Vec3) -> MouseRay {
        (origin, (through - origin).normalize())
    }

    const EYE: Vec3 = Vec3::new(3.0, 4.0, 5.0);

    #[test]
    fn the_axis_under_the_mouse_is_found_and_others_are_not() {
        let position = Vec3::new(0.5, -0.25, 1.0);
        for (axis, dir) in AXES.into_iter().enumerate() {
            let found = |share: f32| axis_under(ray(EYE, position + 2.0 * share * dir), position, 2.0);
            assert_eq!(found(0.5), Some(axis));
            assert_eq!(found(1.02), Some(axis));
            assert_eq!(found(1.5), None);
            assert_eq!(found(-0.5), None);
            // The same line, looked along the other way.
            let (origin, ahead) = ray(EYE, position + dir);
            assert_eq!(axis_under((origin, -ahead), position, 2.0), None);
        }
    }

    #[test]
    fn a_point_follows_the_mouse_along_an_axis() {
        let point = Vec3::new(1.0, 2.0, -1.0);
        for (axis, dir) in AXES.into_iter().enumerate() {
            let grabbed = point + 0.3 * dir;
            let target = grabbed + 0.75 * dir;
            let moved = drag_along(Drag::Axis(axis), point, ray(EYE, grabbed), ray(EYE, target));
            assert!(moved.abs_diff_eq(point + 0.75 * dir, 1e-4), "{axis}: {moved}");
            // Beside the axis, the nearest point counts; 0.1 m of 6 m are 0.1^2 / 6 m of difference along it.
            let beside = target + 0.1 * dir.cross((EYE - target).normalize());
            let moved = drag_along(Drag::Axis(axis), point, ray(EYE, grabbed), ray(EYE, beside));
            assert!(moved.abs_diff_eq(point + 0.75 * dir, 5e-3), "{axis}: {moved}");
            // Along the axis itself there is no telling.
            let down = (grabbed + 9.0 * dir, -dir);
            assert_eq!(drag_along(Drag::Axis(axis), point, ray(EYE, grabbed), down), point);
        }
    }

    #[test]
    fn a_point_follows_the_mouse_in_a_plane() {
        let point = Vec3::new(1.0, 2.0, -1.0);
        let normal = Vec3::new(0.2, -0.5, -1.0).normalize();
        let (right, up) = normal.any_orthonormal_pair();
        let grabbed = point + 0.1 * right;
        let step = 0.4 * right - 0.7 * up;
        let moved = drag_along(Drag::Plane(normal), point, ray(EYE, grabbed), ray(EYE, grabbed + step));
        assert!(moved.abs_diff_eq(point + step, 1e-4), "{moved}");
        let away = (EYE, -(grabbed - EYE).normalize());
        assert_eq!(drag_along(Drag::Plane(normal), point, ray(EYE, grabbed), away), point);
    }

    #[test]
    fn the_hovered_axis_stands_out() {
        let lines = gizmo(Vec3::ONE, 0.5, Some(1));
        let yellow: Vec<_> = lines.iter().filter(|line| line.color[..3] == HOVERED).collect();
        assert_eq!(3 * yellow.len(), lines.len());
        assert_eq!((yellow[0].from, yellow[0].to), (Vec3::ONE, Vec3::new(1.0, 1.5, 1.0)));
        assert!(lines.iter().all(|line| line.on_top));
    }
}
