//! The light that is seen: the lightmap as an engine reads it, against path tracing at the very points that a camera sees,
//! and at points drawn by area.
//!
//! Receivers are measured elsewhere; a small bright one counts there as much as a wall. Here a pixel is a pixel, and the
//! figures hold what texels do to the light as well: a read between four of them, over gutters and beside edges.

use super::{path_tracer::Estimates, subject::Subject};
use crate::metrics::{MethodError, nrmse_without_worst, rms, share_off};
use crate::{
    picture::camera_dir,
    rays::{SurfaceHit, frame},
};
use glam::{Vec2, Vec3, Vec4Swizzles};
use localprt_formats::directions::{cosine_hemisphere, counter_uniform, fibonacci_square};
use localprt_runtime::{CoverageMap, LightMaps};
use localprt_scenes::{Camera, FaceId, SurfacePoint};
use rayon::prelude::*;
use serde::Serialize;

/// Rays cast for a point of a view, at most: a model before the sky fills little of its picture.
const MOST_RAYS: u32 = 16;
/// Draws for a point by area, at most: much of a scene may be inside other geometry.
const MOST_DRAWS: u64 = 64;
/// A point by area is looked for from this many ray offsets above it.
const LIFT: f32 = 8.0;
/// Cosine-weighted rays that ask whether a point is inside of geometry: it is where more than half of them meet backs.
const INSIDE_RAYS: u32 = 16;
/// Share of the points that `nrmse_99` leaves out.
const WORST: f64 = 0.01;

/// A surface point, with the normal that its normal map gives, and where the lightmap holds its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// The point.
    pub point: SurfacePoint,
    /// Its lightmap coordinate.
    pub uv: Vec2,
}

/// Points that were compared, and their reference.
#[derive(Clone, Debug, Default)]
pub struct SeenReference {
    /// The points.
    pub points: Vec<SeenPoint>,
    /// Path traced there.
    pub reference: Estimates,
}

/// Errors over points. [`SeenError::points`] is 0 where there is nothing to compare: no surface with texels, or no light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SeenError {
    /// As [`MethodError::nrmse`], over the points. The reference's noise is part of it.
    pub nrmse: f64,
    /// As [`MethodError::median_relative`].
    pub median_relative: f64,
    /// As [`MethodError::p95_relative`].
    pub p95_relative: f64,
    /// As [`MethodError::bias`].
    pub bias: f64,
    /// [`SeenError::nrmse`] without the 1 % of the points that are worst: a crevice narrower than a texel can be all of it.
    pub nrmse_99: f64,
    /// As [`MethodError::p99_relative`].
    pub p99_relative: f64,
    /// Mean over the points of the unseen share of the receivers that are read.
    pub unseen: f64,
    /// RMS of the reference's standard error, over its mean.
    pub standard_error: f64,
    /// Share of the points where the luminance is off by more than 10 % of the mean of the reference.
    pub off_10: f64,
    /// The same with 50 %.
    pub off_50: f64,
    /// Points.
    pub points: usize,
}

impl SeenError {
    /// Compares what maps hold with the reference at the same points.
    pub fn of(points: &[SeenPoint], maps: &LightMaps, unseen: &CoverageMap, reference: &Estimates) -> Self {
        let found: Vec<Vec3> = points.iter().map(|seen| seen.engine_read(maps)).collect();
        let Some(error) = MethodError::of(&found, &reference.irradiance) else { return Self::default() };
        let mean = crate::metrics::mean(&reference.irradiance);
        let shares: Vec<f64> =
            points.iter().filter_map(|seen| unseen.sample(seen.uv)).map(|share| f64::from(share.x)).collect();
        let [off_10, off_50] = [0.1, 0.5].map(|share| share_off(&found, &reference.irradiance, share));
        Self {
            nrmse: error.nrmse,
            median_relative: error.median_relative,
            p95_relative: error.p95_relative,
            bias: error.bias,
            nrmse_99: nrmse_without_worst(&found, &reference.irradiance, WORST),
            p99_relative: error.p99_relative,
            unseen: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
            standard_error: rms(reference.standard_error.iter().map(|error| error.as_dvec3())) / mean,
            off_10,
            off_50,
            points: points.len(),
        }
    }
}

impl SeenPoint {
    /// Irradiance about the point's normal as an engine reads it, W m^-2.
    pub fn engine_read(&self, maps: &LightMaps) -> Vec3 {
        maps.irradiance_about(self.point.normal, |map| Some(engine_read(map, self.uv))).unwrap_or_default()
    }
}

/// Bilinear read as by a texture unit that clamps at the border: texels without a value are black and count.
fn engine_read(map: &CoverageMap, uv: Vec2) -> Vec3 {
    let (texels, weights) = footprint(map.size(), uv);
    texels.iter().zip(weights).map(|(&texel, weight)| map.color(texel) * weight).sum()
}

/// The four texels of a bilinear read and their weights.
fn footprint(size: u32, uv: Vec2) -> ([usize; 4], [f32; 4]) {
    let last = size.saturating_sub(1) as usize;
    let position = (uv * size as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(last as f32));
    let (x, y) = (position.x as usize, position.y as usize);
    let (right, below) = ((x + 1).min(last), (y + 1).min(last));
    let f = position - position.floor();
    let row = size as usize;
    (
        [y * row + x, y * row + right, below * row + x, below * row + right],
        [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y],
    )
}

/// About `count` points that a camera sees, spread over its picture: one pixel drawn from each of as many cells. Only
/// surfaces with lightmap texels count. In the order of the file's receivers, so that neighbors follow each other.
pub fn of_view(subject: &Subject<'_>, camera: &Camera, count: u32, seed: u64) -> Vec<SeenPoint> {
    let aspect = camera.aspect.filter(|aspect| (0.1..=10.0).contains(aspect)).unwrap_or(4.0 / 3.0);
    let grid =
        |cells: f32| [(cells * aspect).sqrt().ceil().max(1.0) as u32, (cells / aspect).sqrt().ceil().max(1.0) as u32];
    let cast = |[across, down]: [u32; 2]| -> Vec<SeenPoint> {
        let cell = |cell: u32| {
            let shift = |axis: u64| counter_uniform(seed, 0x5ee0 + axis, u64::from(cell)) as f32;
            let u = ((cell % across) as f32 + shift(0)) / across as f32;
            let v = ((cell / across) as f32 + shift(1)) / down as f32;
            let dir = camera_dir(camera, u, v, aspect);
            of_hit(subject, &subject.caster.closest_hit(camera.to_world.w_axis.xyz(), dir)?)
        };
        (0..across * down).into_par_iter().filter_map(cell).collect()
    };
    let first = cast(grid(count as f32));
    let share = (first.len() as f32 / count.max(1) as f32).min(1.0);
    let points =
        if share > 0.0 && share < 0.9 { cast(grid(count as f32 / share.max(1.0 / MOST_RAYS as f32))) } else { first };
    in_file_order(subject, super::selection::thin(&points, count as usize))
}

/// `count` points drawn by area from the fronts of all faces that have lightmap texels and stand in the open: where the
/// bake put a receiver into the four texels that are read, and not inside of geometry, where a read beside an edge may reach
/// them too. Fewer where most of the scene is inside other geometry. In the
/// order of the file's receivers.
pub fn by_area(subject: &Subject<'_>, count: u32, seed: u64) -> Vec<SeenPoint> {
    let scene = subject.caster.scene();
    let faces: Vec<(usize, usize)> = scene.faces().collect();
    let mut sum = 0.0;
    let areas: Vec<f64> = faces
        .iter()
        .enumerate()
        .map(|(face, &(mesh, triangle))| {
            if has_texels(subject, FaceId(face as u32)) {
                sum += scene.area_m2(mesh, triangle);
            }
            sum
        })
        .collect();
    if sum <= 0.0 {
        return Vec::new();
    }
    let size = subject.view.metadata.lightmap_size;
    let draw = |index: u64| {
        let random = |axis: u64| counter_uniform(seed, 0xa2ea + axis, index);
        let face = areas.partition_point(|&below| below <= random(0) * sum).min(faces.len() - 1);
        let (mesh, triangle) = faces[face];
        let [a, b, c] = scene.corners(mesh, triangle);
        // Uniform over the triangle.
        let (root, along) = (random(1).sqrt() as f32, random(2) as f32);
        let position = a * (1.0 - root) + b * (root * (1.0 - along)) + c * (root * along);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let hit = subject.caster.closest_hit(position + normal * (LIFT * subject.caster.offset_m()), -normal)?;
        // Another surface lies over it, or the point is cut out by a mask.
        hit.point.filter(|point| point.face == FaceId(face as u32))?;
        let seen = of_hit(subject, &hit)?;
        let (texels, weights) = footprint(size, seen.uv);
        let is_lit = |(&texel, weight): (&usize, f32)| weight > 0.0 && subject.at_texel[texel] != u32::MAX;
        (texels.iter().zip(weights).any(is_lit) && !is_inside(subject, &seen.point)).then_some(seen)
    };
    let mut points: Vec<SeenPoint> = Vec::new();
    let mut drawn = 0;
    while points.len() < count as usize && drawn < MOST_DRAWS * u64::from(count) {
        points.par_extend((drawn..drawn + u64::from(count)).into_par_iter().filter_map(draw));
        drawn += u64::from(count);
    }
    points.truncate(count as usize);
    in_file_order(subject, points)
}

/// What a ray met, if the lightmap has texels for it.
pub(super) fn of_hit(subject: &Subject<'_>, hit: &SurfaceHit) -> Option<SeenPoint> {
    let face = hit.point?;
    if !has_texels(subject, face.face) {
        return None;
    }
    Some(SeenPoint { point: hit.mapped_point(subject.caster.scene()), uv: subject.atlas.at(&face) })
}

fn is_inside(subject: &Subject<'_>, point: &SurfacePoint) -> bool {
    let (tangent, bitangent) = frame(point.geometric_normal);
    let origin = point.position + point.geometric_normal * subject.caster.offset_m();
    let backs = (0..INSIDE_RAYS).filter(|&ray| {
        let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, INSIDE_RAYS, [0.0; 2]));
        let hit = subject.caster.closest_hit(origin, tangent * x + bitangent * y + point.geometric_normal * z);
        hit.is_some_and(|hit| hit.point.is_none())
    });
    2 * backs.count() > INSIDE_RAYS as usize
}

fn has_texels(subject: &Subject<'_>, face: FaceId) -> bool {
    subject.has_texels[face.0 as usize]
}

fn in_file_order(subject: &Subject<'_>, mut points: Vec<SeenPoint>) -> Vec<SeenPoint> {
    points.sort_by_key(|seen| subject.receiver_at(seen.uv).unwrap_or(u32::MAX));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_read_mixes_four_texels_and_clamps_at_the_border() {
        let (texels, weights) = footprint(4, Vec2::new(1.75, 2.5) / 4.0);
        assert_eq!((texels, weights), ([9, 10, 13, 14], [0.75, 0.25, 0.0, 0.0]));
        assert_eq!(footprint(4, Vec2::ZERO), ([0, 1, 4, 5], [1.0, 0.0, 0.0, 0.0]));
        assert_eq!(footprint(4, Vec2::splat(2.0)), ([15; 4], [1.0, 0.0, 0.0, 0.0]));
    }
}
