//! Which texels a triangle touches, exactly, and where in them.

use glam::{DVec2, DVec3, Vec2};
use std::ops::Range;

/// Touches shallower than this share of a texel do not count: faces that end on a texel's border leave the next texel
/// alone although their coordinates are rounded. 8192 texels times half an f32 rounding of a coordinate is 2.5e-4.
const SHALLOW: f64 = 5e-4;

/// Coordinates in texels are multiples of one over this: the same when a map has grown and its coordinates were divided by another
/// size. Half a step is more than the rounding of f32 coordinates of a map of 8192 texels.
const STEPS: f64 = 1024.0;

/// A coordinate of a map in texels.
pub fn in_texels(uv: Vec2, size: u32) -> DVec2 {
    (uv.as_dvec2() * f64::from(size) * STEPS).round() / STEPS
}

/// The coordinate of a place in texels, which [`in_texels`] brings back.
pub fn on_map(texel: DVec2, size: u32) -> Vec2 {
    ((texel * STEPS).round() / STEPS / f64::from(size)).as_vec2()
}

/// A triangle in texel units of a map: texel (x, y) is the square from (x, y) to (x + 1, y + 1).
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    corners: [DVec2; 3],
    /// Twice the signed area.
    double_area: f64,
}

impl Footprint {
    /// `None` for a triangle without area.
    pub fn new(uv: [Vec2; 3], size: u32) -> Option<Self> {
        let corners = uv.map(|uv| in_texels(uv, size));
        let double_area = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
        (double_area.is_finite() && double_area != 0.0).then_some(Self { corners, double_area })
    }

    /// Area in texels.
    pub fn area(&self) -> f64 {
        self.double_area.abs() * 0.5
    }

    /// Rows that it touches, cut to `0..size`.
    pub fn rows(&self, size: u32) -> Range<u32> {
        let [a, b, c] = self.corners.map(|corner| corner.y);
        span(a.min(b).min(c), a.max(b).max(c), size)
    }

    /// Texels `x` of row `y` that it touches, cut to `0..size`.
    pub fn columns(&self, y: u32, size: u32) -> Range<u32> {
        let (low, high) = (f64::from(y) + SHALLOW, f64::from(y + 1) - SHALLOW);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut take = |x: f64| {
            least = least.min(x);
            most = most.max(x);
        };
        for corner in 0..3 {
            let (a, b) = (self.corners[corner], self.corners[(corner + 1) % 3]);
            if a.y >= low && a.y <= high {
                take(a.x);
            }
            for line in [low, high] {
                if (a.y < line) != (b.y < line) {
                    take(a.x + (b.x - a.x) * ((line - a.y) / (b.y - a.y)));
                }
            }
        }
        if least > most { 0..0 } else { span(least, most, size) }
    }

    /// Weights of the corners at a point, unbounded outside of the triangle.
    pub fn barycentrics(&self, point: DVec2) -> DVec3 {
        let [a, b, c] = self.corners;
        let u = (b - point).perp_dot(c - point) / self.double_area;
        let v = (c - point).perp_dot(a - point) / self.double_area;
        DVec3::new(u, v, 1.0 - u - v)
    }

    /// Signed distance, in texels, from a point to the nearest edge line; positive inside.
    pub fn depth(&self, point: DVec2) -> f64 {
        (0..3).fold(f64::INFINITY, |least, corner| {
            let (a, b) = (self.corners[corner], self.corners[(corner + 1) % 3]);
            let edge = b - a;
            let length = edge.length();
            if length == 0.0 {
                return least;
            }
            least.min(edge.perp_dot(point - a) * self.double_area.signum() / length)
        })
    }

    /// Whether it holds a point, edges included.
    pub fn contains(&self, point: DVec2) -> bool {
        self.barycentrics(point).min_element() >= 0.0
    }

    /// Distance from the center of a texel to the nearest point of the triangle within the texel, and a sample point: the middle of
    /// what the texel holds of the triangle, for which it stands. On a strip narrower than a texel that is its middle, not one of
    /// its borders. `None` if the texel holds nothing of it.
    pub fn sample_in(&self, x: u32, y: u32) -> Option<(f64, DVec2)> {
        let low = DVec2::new(f64::from(x), f64::from(y));
        let held = Polygon::of(self.corners).clipped(low, low + 1.0);
        let points = held.points();
        if points.is_empty() {
            return None;
        }
        let center = low + 0.5;
        let mut nearest = f64::INFINITY;
        for (index, &a) in points.iter().enumerate() {
            let b = points[(index + 1) % points.len()];
            let edge = b - a;
            let along = ((center - a).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            nearest = nearest.min((a + edge * along).distance(center));
        }
        Some((nearest, points.iter().sum::<DVec2>() / points.len() as f64))
    }
}

/// Whole texels that the interval touches.
fn span(least: f64, most: f64, size: u32) -> Range<u32> {
    let limit = f64::from(size);
    let first = (least + SHALLOW).floor().clamp(0.0, limit);
    // A sliver on a texel border is thinner than the margin; it belongs to the texel its start is rounded to.
    let end = (most - SHALLOW).ceil().max(first + 1.0).clamp(0.0, limit);
    if least >= limit || most <= 0.0 { 0..0 } else { first as u32..end as u32 }
}

/// A convex polygon of at most seven corners: a triangle cut by four lines.
#[derive(Clone, Copy)]
struct Polygon {
    points: [DVec2; 8],
    len: usize,
}

impl Polygon {
    fn of(corners: [DVec2; 3]) -> Self {
        let mut points = [DVec2::ZERO; 8];
        points[..3].copy_from_slice(&corners);
        Self { points, len: 3 }
    }

    fn points(&self) -> &[DVec2] {
        &self.points[..self.len]
    }

    fn clipped(self, low: DVec2, high: DVec2) -> Self {
        self.cut(|p| p.x - low.x).cut(|p| high.x - p.x).cut(|p| p.y - low.y).cut(|p| high.y - p.y)
    }

    /// Keeps the part where `side` is not negative (Sutherland and Hodgman 1974).
    fn cut(self, side: impl Fn(DVec2) -> f64) -> Self {
        let mut kept = Self { points: [DVec2::ZERO; 8], len: 0 };
        let mut push = |point: DVec2| {
            if kept.len < kept.points.len() {
                kept.points[kept.len] = point;
                kept.len += 1;
            }
        };
        for index in 0..self.len {
            let (a, b) = (self.points[index], self.points[(index + 1) % self.len]);
            let (of_a, of_b) = (side(a), side(b));
            if of_a >= 0.0 {
                push(a);
            }
            if (of_a < 0.0) != (of_b < 0.0) {
                push(a + (b - a) * (of_a / (of_a - of_b)));
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_touches_exactly_the_texels_that_hold_some_of_it() {
        // Against clipping every texel of the map.
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for _ in 0..200 {
            let uv = std::array::from_fn(|_| Vec2::new(random(), random()));
            let Some(footprint) = Footprint::new(uv, 16) else { continue };
            let rows = footprint.rows(16);
            for y in 0..16 {
                let columns = if rows.contains(&y) { footprint.columns(y, 16) } else { 0..0 };
                for x in 0..16 {
                    let low = DVec2::new(f64::from(x), f64::from(y));
                    // Touches near the margin may fall on either side.
                    let deep = !Polygon::of(footprint.corners).clipped(low + 1e-3, low + 0.999).points().is_empty();
                    let shallow = !Polygon::of(footprint.corners).clipped(low, low + 1.0).points().is_empty();
                    assert!(!deep || columns.contains(&x), "texel {x} {y} of {uv:?} is missed");
                    assert!(shallow || !columns.contains(&x), "texel {x} {y} of {uv:?} is not touched");
                }
            }
        }
    }

    #[test]
    fn a_face_that_ends_on_a_border_leaves_the_next_texel_alone() {
        let uv = [Vec2::new(0.25, 0.25), Vec2::new(0.75, 0.25), Vec2::new(0.25, 0.75)];
        let footprint = Footprint::new(uv, 16).unwrap();
        assert_eq!(footprint.rows(16), 4..12);
        assert_eq!(footprint.columns(4, 16), 4..12);
    }
}
