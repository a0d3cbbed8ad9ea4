//! Views of shadow maps: which maps a light needs, and how points fall on them.

use super::CasterBounds;
use glam::{Vec2, Vec3, Vec4};
use localprt_scenes::{Light, LightKind};

/// Half angle in radians up to which a spot has one map: 70 degrees, where that map is 2.7 times as wide as a face of a
/// cube. Beyond, six faces resolve better.
pub const MAX_SPOT_MAP_ANGLE: f32 = 1.22;

/// Fewest texels per side of a shadow map; below, the border takes too much of it.
pub const MIN_SHADOW_MAP_SIZE: u32 = 16;

/// Texels around a view that are drawn beyond what the light needs. On the map a moved receiver shifts by at most
/// 1.125 (|x| + |y|) (|x| + T |z|) texels, (x, y, z) being a unit vector and T the view's tangent, 0 if it is parallel:
/// 1.125 / 2 (1 + sqrt(2 + 2 T^2)) is 2.9 for the widest spot, 1.7 for a cube's face. Its taps are one texel farther.
const BORDER_TEXELS: f32 = 4.0;

/// Part by which receivers are moved farther than a flat surface needs: for the 1/256 texel to which rasterizers snap
/// vertices, and for the footprint to grow on the way.
const OFFSET_MARGIN: f32 = 1.125;

/// One shadow map's view. Depth is reversed: 1 at the light, 0 where nothing is.
///
/// With (x, y, z) a point in the view's frame, relative to `origin`, the clip coordinates are
/// `(x scale.x, y scale.y, depth.x + depth.y z, w.x + w.y z)`, for parallel and for perspective views alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowView {
    /// Center of projection, or the middle of the casters for parallel light.
    pub origin: Vec3,
    /// Unit x axis of the map.
    pub right: Vec3,
    /// Unit y axis, upwards in the map.
    pub up: Vec3,
    /// Unit direction of view, away from the light.
    pub forward: Vec3,
    /// Factors of x and y.
    pub scale: Vec2,
    /// Constant and linear part of clip z.
    pub depth: Vec2,
    /// Constant and linear part of clip w.
    pub w: Vec2,
}

/// The views of a light: one, or six in the order +X, -X, +Y, -Y, +Z, -Z (see [`ShadowView::face`]). None for a light
/// that sends nothing anywhere.
pub fn shadow_views(light: &Light, bounds: &CasterBounds, map_size: u32) -> Vec<ShadowView> {
    let emitted = light.color * light.intensity;
    if !(emitted.max_element() > 0.0 && emitted.is_finite()) {
        return Vec::new();
    }
    match light.kind {
        LightKind::Directional => match light.direction.try_normalize() {
            Some(direction) => vec![parallel(direction, bounds, map_size)],
            None => Vec::new(),
        },
        _ if !light.position.is_finite() => Vec::new(),
        LightKind::Spot { outer_cone, .. } if outer_cone <= MAX_SPOT_MAP_ANGLE => {
            let Some(direction) = light.direction.try_normalize() else { return Vec::new() };
            let (right, up) = frame(direction);
            // Least width of a cone, for a finite scale.
            let tangent = outer_cone.max(1e-3).tan();
            vec![perspective(light.position, [right, up, direction], tangent, bounds, map_size)]
        }
        LightKind::Spot { .. } | LightKind::Point => [Vec3::X, Vec3::Y, Vec3::Z]
            .iter()
            .flat_map(|&axis| [axis, -axis])
            .map(|forward| {
                let (right, up) = frame(forward);
                perspective(light.position, [right, up, forward], 1.0, bounds, map_size)
            })
            .collect(),
    }
}

/// Orthographic view that holds the box of all casters. The scene is baked: neither the box nor the texels' places move
/// while the light stands still.
fn parallel(forward: Vec3, bounds: &CasterBounds, map_size: u32) -> ShadowView {
    let (right, up) = frame(forward);
    let origin = (bounds.low + bounds.high) / 2.0;
    let half = (bounds.high - bounds.low) / 2.0;
    // Half the box' extent along an axis, never 0.
    let pad = rounding_or_one(bounds);
    let reach = |axis: Vec3| axis.abs().dot(half) + pad;
    let inner = inner_share(map_size);
    let range = 2.0 * reach(forward);
    ShadowView {
        origin,
        right,
        up,
        forward,
        scale: Vec2::new(inner / reach(right), inner / reach(up)),
        depth: Vec2::new(0.5, -1.0 / range),
        w: Vec2::new(1.0, 0.0),
    }
}

/// View from a point without a far end, `tangent` wide to every side. Casters nearer than rounding do not count, as for
/// traced rays: a lamp may be flush with a surface.
fn perspective(
    origin: Vec3,
    [right, up, forward]: [Vec3; 3],
    tangent: f32,
    bounds: &CasterBounds,
    map_size: u32,
) -> ShadowView {
    let near = rounding_or_one(bounds);
    ShadowView {
        origin,
        right,
        up,
        forward,
        scale: Vec2::splat(inner_share(map_size) / tangent),
        depth: Vec2::new(near, 0.0),
        w: Vec2::new(0.0, 1.0),
    }
}

/// A positive length within rounding; any will do where there is nothing to see.
fn rounding_or_one(bounds: &CasterBounds) -> f32 {
    if bounds.rounding_m() > 0.0 { bounds.rounding_m() } else { 1.0 }
}

/// Share of the map's width within the border.
fn inner_share(map_size: u32) -> f32 {
    1.0 - 2.0 * BORDER_TEXELS / map_size as f32
}

/// Axes across a unit direction.
fn frame(forward: Vec3) -> (Vec3, Vec3) {
    forward.any_orthonormal_pair()
}

impl ShadowView {
    /// Position in the clip space of the map.
    pub fn clip(&self, position: Vec3) -> Vec4 {
        let from_origin = position - self.origin;
        let z = from_origin.dot(self.forward);
        Vec4::new(
            from_origin.dot(self.right) * self.scale.x,
            from_origin.dot(self.up) * self.scale.y,
            self.depth.x + self.depth.y * z,
            self.w.x + self.w.y * z,
        )
    }

    /// Which of six views holds a direction away from the light.
    pub fn face(from_light: Vec3) -> usize {
        let size = from_light.abs();
        let (axis, along) = if size.x >= size.y && size.x >= size.z {
            (0, from_light.x)
        } else if size.y >= size.z {
            (1, from_light.y)
        } else {
            (2, from_light.z)
        };
        2 * axis + usize::from(along < 0.0)
    }

    /// Distance along the geometric normal (on the light's side) by which a receiver leaves its surface, metres:
    /// `rounding_m`, and what keeps the flat surface around it from shading it.
    ///
    /// A read compares texels up to one texel away in x and y. With t metres per texel at the receiver, whatever the
    /// projection, the depths of the receiver's plane there stay behind a point that is t_x |n_x| + t_y |n_y| in front
    /// of the plane, n being the normal in the map's axes.
    pub fn receiver_offset_m(&self, position: Vec3, normal: Vec3, map_size: u32, rounding_m: f32) -> f32 {
        let z = (position - self.origin).dot(self.forward);
        let texel = (self.w.x + self.w.y * z) * 2.0 / map_size as f32;
        let across = normal.dot(self.right).abs() / self.scale.x + normal.dot(self.up).abs() / self.scale.y;
        rounding_m + OFFSET_MARGIN * texel * across
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::{counter_uniform, spherical_fibonacci};

    const BOUNDS: CasterBounds = CasterBounds { low: Vec3::new(-1.0, 0.0, -3.0), high: Vec3::new(2.0, 4.0, 5.0) };
    const SIZE: u32 = 64;

    fn light(kind: LightKind, direction: Vec3) -> Light {
        Light {
            name: String::new(),
            kind,
            position: Vec3::new(0.5, 3.0, 1.0),
            direction,
            color: Vec3::ONE,
            intensity: 1.0,
            range: None,
        }
    }

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..100).map(|index| Vec3::from(spherical_fibonacci(index, 100)))
    }

    /// Within the border of the map, and 0..=1 deep.
    #[track_caller]
    fn assert_inside(view: &ShadowView, position: Vec3) {
        let clip = view.clip(position);
        let inner = 1.0 - 2.0 * BORDER_TEXELS / SIZE as f32;
        // A few roundings of the scene's coordinates.
        assert!(clip.w > 0.0 && clip.truncate().truncate().abs().max_element() <= (inner + 1e-5) * clip.w, "{clip}");
        assert!(clip.z >= 0.0 && clip.z <= clip.w, "{clip}");
    }

    #[test]
    fn parallel_views_hold_the_scene() {
        for direction in directions() {
            let views = shadow_views(&light(LightKind::Directional, direction), &BOUNDS, SIZE);
            for corner in 0..8 {
                let high = |bit: u32| corner >> bit & 1 == 1;
                let position = Vec3::select(glam::BVec3::new(high(0), high(1), high(2)), BOUNDS.high, BOUNDS.low);
                assert_inside(&views[0], position);
            }
            let behind = views[0].clip(direction);
            let before = views[0].clip(Vec3::ZERO);
            assert!(behind.z < before.z, "depth is reversed");
        }
    }

    #[test]
    fn each_direction_lies_in_its_face() {
        let views = shadow_views(&light(LightKind::Point, Vec3::NEG_Z), &BOUNDS, SIZE);
        assert_eq!(views.len(), 6);
        let mut seen = [false; 6];
        for direction in directions() {
            let face = ShadowView::face(direction);
            seen[face] = true;
            assert_inside(&views[face], views[face].origin + 3.0 * direction);
        }
        assert_eq!(seen, [true; 6]);
    }

    #[test]
    fn spot_views_hold_the_cone() {
        for direction in directions() {
            let kind = LightKind::Spot { inner_cone: 0.0, outer_cone: 0.6 };
            let views = shadow_views(&light(kind, direction), &BOUNDS, SIZE);
            assert_eq!(views.len(), 1);
            for around in directions().filter(|around| around.dot(direction) >= 0.6f32.cos()) {
                assert_inside(&views[0], views[0].origin + 3.0 * around);
            }
        }
        let wide = LightKind::Spot { inner_cone: 0.0, outer_cone: 1.5 };
        assert_eq!(shadow_views(&light(wide, Vec3::X), &BOUNDS, SIZE).len(), 6);
    }

    #[test]
    fn lights_without_power_have_no_views() {
        let none = |light: Light| assert_eq!(shadow_views(&light, &BOUNDS, SIZE), []);
        let point = || light(LightKind::Point, Vec3::ZERO);
        none(Light { intensity: 0.0, ..point() });
        none(Light { color: Vec3::ZERO, ..point() });
        none(Light { intensity: f32::NAN, ..point() });
        none(Light { position: Vec3::INFINITY, ..point() });
        none(light(LightKind::Directional, Vec3::ZERO));
    }

    #[test]
    fn a_moved_receiver_is_in_front_of_its_plane_at_every_tap() {
        let spot = LightKind::Spot { inner_cone: 0.0, outer_cone: 1.2 };
        let mut n_tested = 0;
        let mut most_shifted = 0.0f32;
        for (number, kind) in [LightKind::Directional, spot, LightKind::Point].into_iter().enumerate() {
            for (index, normal) in directions().enumerate() {
                let random = |dimension| counter_uniform(7 + number as u64, index as u64, dimension) as f32;
                let light = light(kind, Vec3::new(random(0) - 0.5, -1.0, random(1) - 0.5).normalize());
                let position = Vec3::new(3.0 * random(2) - 1.0, 4.0 * random(3), 8.0 * random(4) - 3.0);
                let Some(incident) = light.incident(position) else { continue };
                let normal = normal * normal.dot(incident.dir_to_light).signum();
                let views = shadow_views(&light, &BOUNDS, SIZE);
                let view = match views.len() {
                    1 => &views[0],
                    _ => &views[ShadowView::face(position - light.position)],
                };
                let moved = position + normal * view.receiver_offset_m(position, normal, SIZE, 0.0);
                let clip = view.clip(moved);
                let center = Vec2::new(clip.x, clip.y) / clip.w;
                let before = view.clip(position);
                let shift = (center - Vec2::new(before.x, before.y) / before.w) * SIZE as f32 / 2.0;
                assert!(shift.abs().max_element() < BORDER_TEXELS - 1.0, "{shift}");
                most_shifted = most_shifted.max(shift.abs().max_element());
                for tap in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (0.0, 0.0)] {
                    let ndc = center + Vec2::from(tap) * 2.0 / SIZE as f32;
                    assert!(ndc.abs().max_element() <= 1.0, "tap outside of the map at {ndc}");
                    // The plane's depth along the ray of the tap, in f64.
                    let sideways = ndc.as_dvec2() / view.scale.as_dvec2();
                    let across = view.right.as_dvec3() * sideways.x + view.up.as_dvec3() * sideways.y;
                    let (start, way) = match kind {
                        LightKind::Directional => (view.origin.as_dvec3() + across, view.forward.as_dvec3()),
                        _ => (view.origin.as_dvec3(), view.forward.as_dvec3() + across),
                    };
                    let normal = normal.as_dvec3();
                    let z = normal.dot(position.as_dvec3() - start) / normal.dot(way);
                    if z <= 0.0 {
                        // A grazing plane that meets this ray behind the light.
                        continue;
                    }
                    let depth = (f64::from(view.depth.x) + f64::from(view.depth.y) * z)
                        / (f64::from(view.w.x) + f64::from(view.w.y) * z);
                    let own = f64::from(clip.z) / f64::from(clip.w);
                    assert!(own >= depth - 1e-6 * own, "{kind:?} {index} {tap:?}: {own} behind {depth}");
                    n_tested += 1;
                }
            }
        }
        assert!(n_tested > 900, "{n_tested}");
        // Lower casters than that cast no shadow where they touch the ground.
        assert!((1.0..2.0).contains(&most_shifted), "{most_shifted}");
    }
}
