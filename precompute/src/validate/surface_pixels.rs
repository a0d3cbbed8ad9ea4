//! Pixels of a view's smooth picture as places on surfaces: what the lightmap shows there, what two halves of the reference
//! show, and how far the next edge is. [`super::edges`] and [`super::mottling`] read them.

use super::{
    path_tracer::{PixelLight, ViewLight},
    seen::of_hit,
    subject::Subject,
};
use crate::{
    probes::point_grid::PointGrid,
    rays::{RayCaster, SurfaceHit, frame},
};
use glam::{Vec2, Vec3, Vec4Swizzles};
use localprt_runtime::LightMaps;
use localprt_scenes::{Camera, luminance};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Directions along the surface in which an edge is looked for.
const EDGE_RAYS: u32 = 8;
/// A surface stands on another where their normals are at least 30 degrees apart, as this cosine: those within a rounded
/// surface are not.
const EDGE_COSINE: f32 = 0.866;
/// An edge is looked for within so many texels; none nearer makes a pixel smooth.
pub const SMOOTH_TEXELS: f32 = 3.0;
/// Points are of one surface if their normals are within 5 degrees, as this cosine...
const SAME_COSINE: f32 = 0.9962;
/// ...and one is off the tangent plane of the other by at most this share of their distance.
const SAME_RISE: f32 = 0.1;
/// Relative irradiance is over the reference, or over this times its mean in the dark.
pub const DARK: f64 = 0.05;

/// A place on a surface that a pixel shows. Irradiance is luminance, W m^-2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePixel {
    /// Index into the picture.
    pub pixel: u32,
    /// World position.
    pub position: Vec3,
    /// Unit shading normal, without a normal map.
    pub normal: Vec3,
    /// Unit geometric normal.
    pub geometric_normal: Vec3,
    /// Surface that the pixel shows, m^2 up to a factor that all pixels share.
    pub area: f64,
    /// Edge of a lightmap texel, metres.
    pub texel_m: f32,
    /// Distance to the next edge in texels; infinite beyond [`SMOOTH_TEXELS`].
    pub edge_texels: f32,
    /// Support radius of the receiver whose texel this is, metres; 0 without one.
    pub radius_m: f32,
    /// What the lightmap shows.
    pub found: f64,
    /// Two independent estimates of the reference.
    pub halves: [f64; 2],
}

/// All pixels of a picture that show lightmap texels.
pub struct SurfacePixels {
    /// In picture order.
    pub pixels: Vec<SurfacePixel>,
    /// Mean of the reference over the pixels.
    pub mean: f64,
    grid: PointGrid,
}

impl SurfacePixel {
    /// The reference from all paths.
    pub fn reference(&self) -> f64 {
        (self.halves[0] + self.halves[1]) / 2.0
    }

    /// Whether no edge is near.
    pub fn is_smooth(&self) -> bool {
        self.edge_texels > SMOOTH_TEXELS
    }

    fn is_same_surface(&self, other: &Self) -> bool {
        let way = other.position - self.position;
        self.normal.dot(other.normal) >= SAME_COSINE && way.dot(self.normal).abs() <= SAME_RISE * way.length()
    }
}

impl SurfacePixels {
    /// Of a picture with one primary ray per pixel.
    pub fn of(subject: &Subject<'_>, camera: &Camera, picture: &ViewLight, maps: &LightMaps) -> Self {
        let eye = camera.to_world.w_axis.xyz();
        let pixel = |(pixel, light): (usize, &PixelLight)| {
            // A black surface reflects nothing, and its light is not traced.
            light.point?;
            let dir = (light.position - eye).normalize_or_zero();
            let hit = subject.caster.closest_hit(eye, dir)?;
            let texel_m2 = subject.atlas.texel_m2(subject.caster.scene(), &hit.point?, maps.irradiance.size());
            let (seen, texel_m) = (of_hit(subject, &hit)?, texel_m2.sqrt());
            // A face that is a point of the map has no texels of its own.
            texel_m.is_finite().then(|| SurfacePixel {
                pixel: pixel as u32,
                position: hit.position,
                normal: hit.surface_point(subject.caster.scene()).normal,
                geometric_normal: hit.normal,
                area: f64::from(hit.t * hit.t / hit.normal.dot(dir).abs().max(f32::EPSILON)),
                texel_m,
                edge_texels: edge_m(subject.caster, &hit, SMOOTH_TEXELS * texel_m) / texel_m,
                radius_m: radius_m(subject, seen.uv),
                found: luminance(seen.engine_read(maps)),
                halves: light.indirect.map(luminance),
            })
        };
        Self::new(picture.rays.par_iter().enumerate().filter_map(pixel).collect())
    }

    /// Of pixels in picture order.
    pub(super) fn new(pixels: Vec<SurfacePixel>) -> Self {
        let n = pixels.len().max(1) as f64;
        let mean = pixels.iter().map(SurfacePixel::reference).sum::<f64>() / n;
        let positions: Vec<Vec3> = pixels.iter().map(|pixel| pixel.position).collect();
        let texel_m = pixels.iter().map(|pixel| f64::from(pixel.texel_m)).sum::<f64>() / n;
        let grid = PointGrid::new(&positions, SMOOTH_TEXELS * texel_m as f32);
        Self { pixels, mean, grid }
    }

    /// Calls `visit` for every pixel of the same surface within a distance, itself among them.
    pub fn for_each_around(&self, pixel: &SurfacePixel, radius_m: f32, mut visit: impl FnMut(&SurfacePixel)) {
        self.grid.for_each_within(pixel.position, radius_m, |id, _| {
            let other = &self.pixels[id as usize];
            if pixel.is_same_surface(other) {
                visit(other);
            }
        });
    }
}

/// Distance along the surface, just above it, to one that stands on it or crosses it; infinite if there is none within
/// `reach_m`. Too long by up to 8 % where an edge is straight.
fn edge_m(caster: &RayCaster<'_>, hit: &SurfaceHit, reach_m: f32) -> f32 {
    let origin = hit.position + hit.normal * caster.offset_m();
    let (tangent, bitangent) = frame(hit.normal);
    let met = |ray: u32| {
        let (sin, cos) = (TAU * ray as f32 / EDGE_RAYS as f32).sin_cos();
        let other = caster.closest_hit(origin, tangent * cos + bitangent * sin)?;
        let is_edge = other.point.is_none() || other.normal.dot(hit.normal) < EDGE_COSINE;
        (is_edge && other.t <= reach_m).then_some(other.t)
    };
    (0..EDGE_RAYS).filter_map(met).fold(f32::INFINITY, f32::min)
}

fn radius_m(subject: &Subject<'_>, uv: Vec2) -> f32 {
    subject.receiver_at(uv).map_or(0.0, |receiver| subject.radius_m(receiver))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use localprt_scenes::builtin;

    /// Pixels of 1 cm on a square of the plane y = 0 with corner 0, texels of 5 cm, under irradiance 1.
    pub fn plane(side: u32, change: impl Fn(u32, u32, &mut SurfacePixel)) -> SurfacePixels {
        let pixel = |index: u32| {
            let (x, z) = (index % side, index / side);
            let mut pixel = SurfacePixel {
                pixel: index,
                position: Vec3::new(x as f32 + 0.5, 0.0, z as f32 + 0.5) / 100.0,
                normal: Vec3::Y,
                geometric_normal: Vec3::Y,
                area: 1e-4,
                texel_m: 0.05,
                edge_texels: f32::INFINITY,
                radius_m: 0.4,
                found: 1.0,
                halves: [1.0; 2],
            };
            change(x, z, &mut pixel);
            pixel
        };
        SurfacePixels::new((0..side * side).map(pixel).collect())
    }

    #[test]
    fn a_wall_is_an_edge_of_the_floor_and_a_sphere_has_none() {
        let cornell = builtin::scene("cornell").unwrap();
        let caster = RayCaster::new(&cornell).unwrap();
        let below = |x: f32, z: f32| caster.closest_hit(Vec3::new(x, 0.3, z), Vec3::NEG_Y).unwrap();
        // 10 cm from the wall at x = -1; at most 1 / cos(22.5 degrees) as far along the nearest ray.
        let found = edge_m(&caster, &below(-0.9, 0.8), 0.3);
        assert!((0.0999..0.1083).contains(&found), "{found}");
        assert_eq!(edge_m(&caster, &below(-0.9, 0.8), 0.09), f32::INFINITY);
        assert_eq!(edge_m(&caster, &below(-0.5, 0.8), 0.3), f32::INFINITY);
        let sphere = builtin::scene("sphere").unwrap();
        let caster = RayCaster::new(&sphere).unwrap();
        let hit = caster.closest_hit(Vec3::ZERO, Vec3::new(0.3, 0.4, 0.866).normalize()).unwrap();
        assert_eq!(edge_m(&caster, &hit, 0.3), f32::INFINITY);
    }

    #[test]
    fn only_the_same_surface_is_around() {
        let pixels = plane(20, |x, z, pixel| match (x, z) {
            (10, _) => pixel.normal = Vec3::X,
            (_, 10) => pixel.position.y = 0.05,
            _ => {}
        });
        let mut found = Vec::new();
        let middle = pixels.pixels[9 * 20 + 9];
        pixels.for_each_around(&middle, 0.0101, |other| found.push(other.pixel));
        assert_eq!(found, [8 * 20 + 9, 9 * 20 + 8, 9 * 20 + 9]);
    }
}
