//! CPU twin of the shadow map: a rasterizer by the rules of Vulkan, and the read of four texels.

use super::{NO_MASK, ShadowCasters, ShadowView};
use glam::{DVec2, DVec3, DVec4, Vec2, Vec3};
use rayon::prelude::*;

/// Steps per texel to which vertices are snapped (`subPixelPrecisionBits` of 8).
const SUBPIXELS: f64 = 256.0;

/// Rows per parallel task; any number gives the same result.
const ROWS_PER_TASK: usize = 32;

/// Half width, in maps, within which triangles are drawn whole; larger ones are cut, so that all products of edges fit
/// into 64 bits. Hardware has such a band too.
const GUARD_BAND: f64 = 4.0;

/// Depth seen from a light, 1 at the light, 0 where nothing is.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowMap {
    /// Texels per side.
    pub size: u32,
    /// `[size * size]`, top row (y of the view upwards) first.
    pub depth: Vec<f32>,
}

/// Draws all casters, from both sides.
pub fn shadow_map(view: &ShadowView, casters: &ShadowCasters, size: u32) -> ShadowMap {
    let triangles: Vec<ScreenTriangle> = (0..casters.triangles.len())
        .into_par_iter()
        .flat_map_iter(|triangle| screen_triangles(view, casters, triangle, size))
        .collect();
    let width = size as usize;
    let mut depth = vec![0.0; width * width];
    depth.par_chunks_mut((width * ROWS_PER_TASK).max(1)).enumerate().for_each(|(task, rows)| {
        for triangle in &triangles {
            triangle.draw(casters, width, task * ROWS_PER_TASK, rows);
        }
    });
    ShadowMap { size, depth }
}

impl ShadowMap {
    /// Share of a light that reaches a surface point, 0..=1: the four texels around the moved receiver, each compared,
    /// weighted bilinearly.
    ///
    /// `normal` is the geometric one, on the light's side; `rounding_m` is [`CasterBounds::rounding_m`].
    ///
    /// [`CasterBounds::rounding_m`]: super::CasterBounds::rounding_m
    pub fn visibility(&self, view: &ShadowView, position: Vec3, normal: Vec3, rounding_m: f32) -> f32 {
        let moved = position + normal * view.receiver_offset_m(position, normal, self.size, rounding_m);
        let clip = view.clip(moved);
        if clip.w <= 0.0 {
            return 1.0;
        }
        // Behind the farthest caster depth ends at 0, which is nothing.
        let depth = (clip.z / clip.w).max(0.0);
        let half = 0.5 * self.size as f32;
        let at = Vec2::new(half + half * (clip.x / clip.w), half - half * (clip.y / clip.w)) - 0.5;
        let base = at.floor();
        let fraction = at - base;
        let lit = |x: f32, y: f32| {
            let last = self.size as i32 - 1;
            let (x, y) = ((x as i32).clamp(0, last) as usize, (y as i32).clamp(0, last) as usize);
            if depth >= self.depth[y * self.size as usize + x] { 1.0 } else { 0.0 }
        };
        let top = lit(base.x, base.y) * (1.0 - fraction.x) + lit(base.x + 1.0, base.y) * fraction.x;
        let bottom = lit(base.x, base.y + 1.0) * (1.0 - fraction.x) + lit(base.x + 1.0, base.y + 1.0) * fraction.x;
        top * (1.0 - fraction.y) + bottom * fraction.y
    }
}

/// A corner after clipping.
#[derive(Clone, Copy)]
struct Corner {
    clip: DVec4,
    /// Weights of the caster's corners.
    weights: DVec3,
}

/// A clipped triangle on the map.
struct ScreenTriangle {
    /// Snapped corners in 1 / 256 texel, so ordered that all edge functions are positive inside.
    corners: [[i64; 2]; 3],
    /// Twice the area in squared 1 / 256 texel, positive.
    area: i64,
    /// Clip z over w per corner.
    depth: DVec3,
    /// 1 / w per corner.
    inverse_w: DVec3,
    /// Weights of the caster's corners, per corner.
    weights: [DVec3; 3],
    /// Corners before snapping, in texels: depth is that of the true surface.
    exact: [DVec2; 3],
    /// The caster.
    triangle: usize,
}

fn screen_triangles(
    view: &ShadowView,
    casters: &ShadowCasters,
    triangle: usize,
    size: u32,
) -> impl Iterator<Item = ScreenTriangle> {
    let positions = casters.triangles[triangle].map(|vertex| casters.positions[vertex as usize]);
    let corners = positions.map(|position| view.clip(position).as_dvec4());
    let unit = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut polygon: Vec<Corner> =
        corners.into_iter().zip(unit).map(|(clip, weights)| Corner { clip, weights }).collect();
    let outside = |inside: &dyn Fn(DVec4) -> f64| polygon.iter().all(|corner| inside(corner.clip) < 0.0);
    let missed =
        outside(&|c| c.w - c.x) || outside(&|c| c.w + c.x) || outside(&|c| c.w - c.y) || outside(&|c| c.w + c.y);
    if missed {
        polygon.clear();
    }
    let planes: [&dyn Fn(DVec4) -> f64; 6] = [
        &|c| c.w - c.z,
        &|c| c.z,
        &|c| GUARD_BAND * c.w - c.x,
        &|c| GUARD_BAND * c.w + c.x,
        &|c| GUARD_BAND * c.w - c.y,
        &|c| GUARD_BAND * c.w + c.y,
    ];
    for plane in planes {
        clip_polygon(&mut polygon, plane);
    }
    let fan = 1..polygon.len().saturating_sub(1);
    let parts: Vec<ScreenTriangle> = fan
        .filter_map(|second| {
            let corners = [polygon[0], polygon[second], polygon[second + 1]];
            ScreenTriangle::new(corners, triangle, size)
        })
        .collect();
    parts.into_iter()
}

/// Keeps the part of a convex polygon where `inside` is not negative (Sutherland and Hodgman).
fn clip_polygon(polygon: &mut Vec<Corner>, inside: &dyn Fn(DVec4) -> f64) {
    if polygon.iter().all(|corner| inside(corner.clip) >= 0.0) {
        return;
    }
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &to) in polygon.iter().enumerate() {
        let from = polygon[(index + polygon.len() - 1) % polygon.len()];
        let (before, after) = (inside(from.clip), inside(to.clip));
        if (before < 0.0) != (after < 0.0) {
            let t = before / (before - after);
            kept.push(Corner { clip: from.clip.lerp(to.clip, t), weights: from.weights.lerp(to.weights, t) });
        }
        if after >= 0.0 {
            kept.push(to);
        }
    }
    *polygon = kept;
}

impl ScreenTriangle {
    fn new(mut corners: [Corner; 3], triangle: usize, size: u32) -> Option<Self> {
        if corners.iter().any(|corner| corner.clip.w <= 0.0) {
            return None;
        }
        let half = 0.5 * f64::from(size);
        let mut exact =
            corners.map(|Corner { clip, .. }| DVec2::new(half + half * clip.x / clip.w, half - half * clip.y / clip.w));
        let snap = |corner: DVec2| (corner * SUBPIXELS).to_array().map(|value| value.round_ties_even() as i64);
        let mut snapped = exact.map(snap);
        let mut area = edge(snapped[0], snapped[1], snapped[2]);
        if area < 0 {
            corners.swap(1, 2);
            snapped.swap(1, 2);
            exact.swap(1, 2);
            area = -area;
        }
        (area > 0).then(|| Self {
            corners: snapped,
            area,
            depth: DVec3::from(corners.map(|corner| corner.clip.z / corner.clip.w)),
            inverse_w: DVec3::from(corners.map(|corner| 1.0 / corner.clip.w)),
            weights: corners.map(|corner| corner.weights),
            exact,
            triangle,
        })
    }

    /// Draws into consecutive rows of the map, of which `first_row` is the first.
    fn draw(&self, casters: &ShadowCasters, width: usize, first_row: usize, rows: &mut [f32]) {
        let n_rows = rows.len() / width;
        let [xs, ys] = [0, 1].map(|axis| self.corners.map(|corner| corner[axis]));
        let columns = texel_range(xs, 0, width);
        let lines = texel_range(ys, first_row, first_row + n_rows);
        let [a, b, c] = self.corners;
        let edges = [(b, c), (c, a), (a, b)];
        // Texels on an edge belong to it if it is a left edge (upwards) or a top edge (to the right, level).
        let bias = edges.map(|(from, to)| i64::from(!(to[1] < from[1] || to[1] == from[1] && to[0] > from[0])));
        for y in lines {
            for x in columns.clone() {
                let center = [x as i64 * 256 + 128, y as i64 * 256 + 128];
                let values = edges.map(|(from, to)| edge(from, to, center));
                if (0..3).any(|side| values[side] < bias[side]) {
                    continue;
                }
                let snapped = DVec3::from(values.map(|value| value as f64)) / self.area as f64;
                let share = self.exact_share(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap_or(snapped);
                if self.is_present(casters, share) {
                    // Snapping may have added texels outside of the triangle; of a sliver they could be far outside.
                    let depth = self.depth.dot(share).clamp(self.depth.min_element(), self.depth.max_element());
                    let texel = &mut rows[(y - first_row) * width + x];
                    *texel = texel.max(depth as f32);
                }
            }
        }
    }

    /// Weights of the corners before snapping; `None` if they span no area, or one that snapping turned around.
    fn exact_share(&self, at: DVec2) -> Option<DVec3> {
        let [a, b, c] = self.exact;
        let area = (b - a).perp_dot(c - a);
        let parts = DVec3::new((c - b).perp_dot(at - b), (a - c).perp_dot(at - c), (b - a).perp_dot(at - a));
        (area > 0.0).then(|| parts / area)
    }

    fn is_present(&self, casters: &ShadowCasters, share: DVec3) -> bool {
        let Some(masks) = casters.masks.as_ref().filter(|masks| masks.mask[self.triangle] != NO_MASK) else {
            return true;
        };
        let by_w = share * self.inverse_w;
        let weights = self.weights[0] * by_w.x + self.weights[1] * by_w.y + self.weights[2] * by_w.z;
        let weights = (weights / by_w.element_sum()).as_vec3().to_array();
        let vertices = casters.triangles[self.triangle].map(|vertex| vertex as usize);
        let uv = vertices.iter().zip(weights).map(|(&vertex, weight)| masks.uv[vertex] * weight).sum();
        let alpha = vertices.iter().zip(weights).map(|(&vertex, weight)| masks.alpha[vertex] * weight).sum();
        masks.is_present(masks.mask[self.triangle], uv, alpha)
    }
}

/// Twice the signed area of a triangle; positive if c is to the right of a -> b in a picture with y downwards.
fn edge(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Texels whose centers lie between the least and the greatest of three coordinates, within limits.
fn texel_range(values: [i64; 3], first: usize, end: usize) -> std::ops::Range<usize> {
    let low = values.iter().min().map_or(0, |&value| (value + 127).div_euclid(256));
    let high = values.iter().max().map_or(0, |&value| (value - 128).div_euclid(256) + 1);
    let clamp = |value: i64| value.clamp(first as i64, end as i64) as usize;
    clamp(low)..clamp(high).max(clamp(low))
}

#[cfg(test)]
mod tests;
