//! Samples of the frame buffer: one pixel of every tile, lit, with the area of the surface that it stands for.
//!
//! There is no picture: rays through the pixels that are sampled are the frame buffer. Pixels of the sky are no samples, as they have no
//! place; the sky comes by [`super::sources`].

use super::projection::Arriving;
use crate::{Frame, Shaded, Surfel, System, Work, World};
use glam::{UVec2, Vec2, Vec3};
use localprt_formats::directions::counter_uniform;
use localprt_scenes::{Camera, SurfacePoint};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Least cosine between the normal and the view, for areas; below Eq. (10).
const LEAST_COSINE: f32 = 0.01;

/// How the frame buffer is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameBuffer {
    /// Pixels per row and rows.
    pub size: UVec2,
    /// Tiles along each side, of one sample each.
    pub tiles: UVec2,
}

/// A pixel after the lighting pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSample {
    /// The surface.
    pub point: SurfacePoint,
    /// Area that the sample stands for, square metres.
    pub area_m2: f32,
    /// Radiance that it sends, W sr^-1 m^-2.
    pub radiance: Vec3,
}

/// A direction through the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRay {
    /// Unit, world space.
    pub dir: Vec3,
    /// Solid angle of its tile, as if all pixels of it were like this one, sr.
    pub solid_angle_sr: f32,
}

impl FrameBuffer {
    /// One random pixel of each tile, row by row. `key` is for random numbers.
    pub fn rays(&self, camera: &Camera, key: u64) -> Vec<PixelRay> {
        let aspect = camera.aspect.unwrap_or(self.size.x as f32 / self.size.y as f32);
        let half = (camera.fov_y * 0.5).tan();
        let tile = |index: u32| {
            let at = UVec2::new(index % self.tiles.x, index / self.tiles.x);
            let (first, end) = (at * self.size / self.tiles, (at + 1) * self.size / self.tiles);
            let uniform = |axis: u64| counter_uniform(key, u64::from(index), axis) as f32;
            let random = Vec2::new(uniform(0), uniform(1)) * (end - first).as_vec2();
            let pixel = (first + random.as_uvec2()).min(end - 1);
            let place = (pixel.as_vec2() + 0.5) / self.size.as_vec2();
            let local = Vec3::new((2.0 * place.x - 1.0) * half * aspect, (1.0 - 2.0 * place.y) * half, -1.0);
            // On the plane at distance 1, at the cube of the cosine to the axis.
            let pixel_area = 4.0 * half * half * aspect / self.size.as_vec2().element_product();
            let tile_area = pixel_area * (end - first).as_vec2().element_product();
            PixelRay {
                dir: camera.to_world.transform_vector3(local).normalize_or(Vec3::NEG_Z),
                solid_angle_sr: tile_area / local.length().powi(3),
            }
        };
        (0..self.tiles.element_product()).map(tile).collect()
    }

    /// Samples of a frame as `camera` sees it: direct light, emission and the indirect light that the frame's feedback has for `own`.
    pub fn samples(&self, own: &dyn System, frame: &Frame<'_>, camera: &Camera, key: u64) -> (Vec<PixelSample>, Work) {
        let (world, eye) = (frame.world, camera.to_world.w_axis.truncate());
        let rays = self.rays(camera, key);
        let met: Vec<Pixel> = rays.par_iter().filter_map(|ray| Pixel::met(world, eye, ray)).collect();
        let shaded: Vec<Shaded> = met.iter().map(|pixel| pixel.shaded).collect();
        let indirect = frame.feedback.irradiance(own, world, &shaded);
        let shadow_rays = met.iter().map(|pixel| pixel.shadow_rays).sum();
        let samples = met.iter().zip(indirect).map(|(pixel, indirect)| PixelSample {
            point: pixel.shaded.point,
            area_m2: pixel.area_m2,
            radiance: pixel.surfel.map_or(Vec3::ZERO, |surfel| surfel.sent(pixel.direct + indirect)),
        });
        (samples.collect(), Work { rays: rays.len() as u64, shadow_rays, ..Work::default() })
    }
}

/// A pixel that shows a surface, before indirect light.
struct Pixel {
    shaded: Shaded,
    /// `None` for the black back of a one-sided surface.
    surfel: Option<Surfel>,
    area_m2: f32,
    direct: Vec3,
    shadow_rays: u64,
}

impl Pixel {
    fn met(world: &World<'_>, eye: Vec3, ray: &PixelRay) -> Option<Self> {
        let hit = world.caster().closest_hit(eye, ray.dir)?;
        let surfel = world.surfel(&hit);
        let point = surfel.map_or_else(|| hit.surface_point(world.caster().scene()), |surfel| surfel.point);
        let (direct, shadow_rays) = surfel.map_or((Vec3::ZERO, 0), |surfel| world.direct(&surfel.point));
        Some(Self {
            shaded: Shaded { point, to_eye: -ray.dir },
            surfel,
            area_m2: area(ray, hit.t, point.normal),
            direct,
            shadow_rays,
        })
    }
}

/// Area of the surface that a pixel stands for, square metres; Eq. (10).
///
/// z is the distance along the ray. With the depth along the camera's axis areas off the axis would be too small, by the cosine squared.
fn area(ray: &PixelRay, z: f32, normal: Vec3) -> f32 {
    ray.solid_angle_sr * z * z / normal.dot(-ray.dir).max(LEAST_COSINE)
}

impl PixelSample {
    /// What arrives of it at a probe; `None` from behind its surface. Eq. (11).
    ///
    /// Differs from the paper: a flat patch never takes more than the half of all directions, to which it is held where the probe is
    /// nearer than the patch is wide.
    pub fn arriving(&self, probe: Vec3) -> Option<Arriving> {
        let d = probe - self.point.position;
        let along = self.point.normal.dot(d);
        if along <= 0.0 {
            return None;
        }
        let distance = d.length();
        let solid_angle_sr = (self.area_m2 * along / distance.powi(3)).min(TAU);
        Some(Arriving { dir: -d / distance, solid_angle_sr, radiance: self.radiance })
    }

    /// Whether nothing is between it and a probe. Traces one ray.
    pub fn is_seen_from(&self, world: &World<'_>, probe: Vec3) -> bool {
        let caster = world.caster();
        caster.visible(self.point.position + self.point.geometric_normal * caster.offset_m(), probe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ssgi_probes::tests::look;
    use crate::test_worlds::{in_world, lit_plane};
    use crate::{Feedback, Query};

    const PICTURE: FrameBuffer = FrameBuffer { size: UVec2::new(1920, 1080), tiles: UVec2::splat(20) };

    /// Indirect light that no test here asks for.
    struct Dark;

    impl System for Dark {
        fn update(&mut self, _: &Frame<'_>) -> Work {
            Work::default()
        }

        fn irradiance(&self, _: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
            vec![Vec3::ZERO; query.points.len()]
        }

        fn probes(&self) -> usize {
            0
        }

        fn bytes(&self) -> u64 {
            0
        }
    }

    /// Samples of the plane of 10 x 10 m.
    fn of_plane(camera: &Camera, frames: u64) -> Vec<Vec<PixelSample>> {
        let (scene, lighting) = lit_plane(0.5);
        in_world(&scene, &lighting, |world| {
            let frame =
                Frame { world, number: 0, camera: None, feedback: Feedback::Nothing, events: &[], still: false };
            (0..frames).map(|key| PICTURE.samples(&Dark, &frame, camera, key).0).collect()
        })
    }

    /// Solid angle of a square of half side `half` from above its middle, sr.
    fn square_sr(half: f32, height: f32) -> f32 {
        let ratio = half * half / (half * half + height * height);
        4.0 * ratio.asin()
    }

    #[test]
    fn tiles_cover_the_picture() {
        let mut camera = look(Vec3::ZERO, Vec3::new(1.0, 0.4, -2.0), 65.0);
        for (aspect, expected) in [(Some(1.0), 1.0), (None, 16.0 / 9.0)] {
            camera.aspect = aspect;
            let half = 32.5f32.to_radians().tan();
            let (across, up) = (half * expected, half);
            // Of a rectangular pyramid.
            let whole = 4.0 * (across * up / ((1.0 + across * across) * (1.0 + up * up)).sqrt()).asin();
            let rays = PICTURE.rays(&camera, 3);
            let sum: f32 = rays.iter().map(|ray| ray.solid_angle_sr).sum();
            // One random pixel in each of 400 tiles, over which the cubed cosine changes by about a tenth: 0.03 / sqrt(400).
            assert!((sum / whole - 1.0).abs() < 4.0 * 0.0015, "{sum} {whole}");
            let mean = rays.iter().map(|ray| ray.dir).sum::<Vec3>().normalize();
            // 1/20 of the picture over sqrt(12 * 400).
            assert!(mean.distance(Vec3::new(1.0, 0.4, -2.0).normalize()) < 0.01, "{mean}");
        }
    }

    #[test]
    fn areas_sum_to_what_the_camera_sees_of_a_plane() {
        // From straight above, 4 m up, the picture of 60 degrees and aspect 1 shows a square of 4.62 m, all of it on the plane. Seen from
        // the side it is a trapezoid whose corners are those of the picture.
        for (eye, target, fov) in
            [([0.0, 4.0, 0.0], [0.0, 0.0, 0.01], 60.0f32), ([0.0, 3.0, 3.0], [0.0, 0.0, 0.5], 40.0)]
        {
            let camera = Camera { aspect: Some(1.0), ..look(Vec3::from(eye), Vec3::from(target), fov) };
            let half = (fov * 0.5).to_radians().tan();
            let corner = |x: f32, y: f32| {
                let dir = camera.to_world.transform_vector3(Vec3::new(x * half, y * half, -1.0));
                let point = Vec3::from(eye) - dir * (eye[1] / dir.y);
                assert!(point.abs().max_element() < 5.0, "{point}");
                point
            };
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            let whole = 0.5 * (c - a).cross(d - b).length();
            for samples in of_plane(&camera, 8) {
                let sum: f32 = samples.iter().map(|sample| sample.area_m2).sum();
                assert_eq!(samples.len(), 400);
                // Areas grow with the cube of the distance over the height; within a tile of the second view by up to 20 %, of which
                // the root mean square is 0.06 / sqrt(400); four of these. Without the cosine, 1/2 at most, the sum is half of it.
                assert!((sum / whole - 1.0).abs() < 0.012, "{eye:?} {sum} {whole}");
            }
        }
    }

    #[test]
    fn grazing_views_count_as_a_cosine_of_a_hundredth() {
        let ray = |rise: f32| PixelRay { dir: Vec3::new(1.0, -rise, 0.0).normalize(), solid_angle_sr: 1e-3 };
        // At a cosine of 0.02 the true area, at 0.002 a fifth of it.
        assert!((area(&ray(0.02), 3.0, Vec3::Y) / (9e-3 / 0.02) - 1.0).abs() < 1e-3);
        assert!((area(&ray(0.002), 3.0, Vec3::Y) / (9e-3 / 0.01) - 1.0).abs() < 1e-5);
        // Shading normals that look away are no exception.
        assert!((area(&ray(-0.3), 3.0, Vec3::Y) / (9e-3 / 0.01) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn solid_angles_sum_to_that_of_the_plane_from_any_camera() {
        // The whole plane is on screen, from straight above and from aside.
        let probe = Vec3::new(0.0, 2.0, 0.0);
        let whole = square_sr(5.0, 2.0);
        for eye in [Vec3::new(0.0, 20.0, 0.01), Vec3::new(9.0, 9.0, 14.0)] {
            let sums: Vec<f32> = of_plane(&look(eye, Vec3::ZERO, 50.0), 40)
                .iter()
                .map(|samples| samples.iter().filter_map(|at| Some(at.arriving(probe)?.solid_angle_sr)).sum())
                .collect();
            let mean = sums.iter().sum::<f32>() / 40.0;
            let error = (sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f32>() / 39.0 / 40.0).sqrt();
            // No bias: four standard errors, which are small against the whole.
            assert!((mean - whole).abs() < 4.0 * error && error < 0.02 * whole, "{eye} {mean} {whole} {error}");
        }
        // From below nothing arrives, and from a hair above a patch not more than half of all directions.
        let sample = of_plane(&look(Vec3::new(0.0, 20.0, 0.01), Vec3::ZERO, 50.0), 1)[0][30];
        assert_eq!(sample.arriving(sample.point.position - Vec3::Y), None);
        let near = sample.arriving(sample.point.position + 1e-3 * Vec3::Y).unwrap();
        assert_eq!((near.solid_angle_sr, near.dir), (TAU, Vec3::NEG_Y));
    }

    #[test]
    fn one_pixel_per_tile_is_less_noisy_than_as_many_anywhere() {
        // Share of samples to the left of an upright edge that runs through the middle of a column of tiles.
        let camera = Camera { aspect: Some(1.0), ..look(Vec3::ZERO, Vec3::NEG_Z, 90.0) };
        let edge = 2.0 * 8.5 / 20.0 - 1.0;
        let left = |key: u64| {
            let rays = PICTURE.rays(&camera, key);
            rays.iter().filter(|ray| ray.dir.x / -ray.dir.z < edge).count() as f32 / 400.0
        };
        let shares: Vec<f32> = (0..300).map(left).collect();
        let mean = shares.iter().sum::<f32>() / 300.0;
        let spread = (shares.iter().map(|share| (share - mean).powi(2)).sum::<f32>() / 299.0).sqrt();
        // 20 tiles decide by a coin: sqrt(20) / 2 / 400 = 0.0056, where 400 pixels anywhere have sqrt(0.425 * 0.575 / 400) = 0.0247.
        // 300 frames know it to 4 %; four of them.
        assert!((spread / 0.0056 - 1.0).abs() < 0.17, "{spread}");
        // The mean is right to its standard error, 0.0056 / sqrt(300), and half a pixel of 1920.
        assert!((mean - 0.425).abs() < 4.0 * 0.0056 / 300f32.sqrt() + 0.5 / 1920.0, "{mean}");
    }
}
