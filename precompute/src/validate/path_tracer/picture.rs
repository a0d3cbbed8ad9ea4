//! Picture mode: what a camera sees, with the indirect light of every pixel path traced at the very point it shows.
//!
//! The parts of the light are kept apart, so that pictures made by other means of indirect light share primary hits,
//! direct light and surfaces with the reference, and differ from it by indirect light alone.

use super::{PathTracer, SurfacePoint};
use crate::picture::{Picture, camera_dir};
use crate::progress::{Cancelled, Progress};
use glam::{DVec3, Vec2, Vec3, Vec4Swizzles};
use localprt_scenes::Camera;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Where in its share of a pixel a primary ray goes through. Not the middle: a camera in the axis of a room would look
/// straight into its edges, where a point belongs to one wall and its light may come from behind the other.
const CENTER: [f32; 2] = [0.43, 0.52];

/// Albedo of every surface in pictures of indirect light alone.
pub const GRAY: f32 = 0.5;

/// Size and smoothness of a reference picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewSettings {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Primary rays per pixel and axis.
    pub rays_per_axis: u32,
    /// Paths per primary ray.
    pub paths: u32,
}

/// Light of one primary ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelLight {
    /// Radiance that needs no indirect light: emission and reflected direct light, or the sky.
    pub other: Vec3,
    /// Albedo; 0 where the ray leaves the scene or meets a black back.
    pub albedo: Vec3,
    /// Path traced indirect irradiance, W m^-2, one estimate from each half of the paths.
    pub indirect: [Vec3; 2],
    /// Lightmap coordinate of the point, if a face with one was met.
    pub uv: Option<Vec2>,
    /// World position of the point.
    pub position: Vec3,
    /// The point as one that receives light, with the normal of its normal map; `None` where no light is reflected.
    pub point: Option<SurfacePoint>,
}

/// A view: `[height][width][rays per pixel]`.
#[derive(Clone, Debug)]
pub struct ViewLight {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Primary rays per pixel.
    pub per_pixel: usize,
    /// Pixel by pixel.
    pub rays: Vec<PixelLight>,
    /// Paths per primary ray so far, in each half.
    half: u32,
    /// Lattices per primary ray so far, in each half.
    batches: u64,
}

impl ViewLight {
    /// A picture, pixel = mean of its rays.
    pub fn picture(&self, radiance: impl Fn(&PixelLight) -> Vec3) -> Picture {
        let pixels = self.rays.chunks_exact(self.per_pixel).map(|rays| {
            let sum: DVec3 = rays.iter().map(|ray| radiance(ray).as_dvec3()).sum();
            (sum / self.per_pixel as f64).as_vec3()
        });
        Picture { width: self.width, height: self.height, pixels: pixels.collect() }
    }

    /// Values per pixel, the mean over its rays that have one; NaN where none has.
    pub fn values(&self, value: impl Fn(&PixelLight) -> Option<f32>) -> Vec<f32> {
        let pixel = |rays: &[PixelLight]| {
            let (sum, count) =
                rays.iter().filter_map(&value).fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
            if count > 0.0 { sum / count } else { f32::NAN }
        };
        self.rays.chunks_exact(self.per_pixel).map(pixel).collect()
    }
}

impl ViewLight {
    /// The same view with given indirect light, W m^-2, ray by ray, in place of what was path traced.
    ///
    /// # Panics
    /// Unless there is as much as there are rays.
    pub fn lit_by(&self, indirect: &[Vec3]) -> Self {
        assert_eq!(indirect.len(), self.rays.len(), "light of every ray");
        let rays = self.rays.iter().zip(indirect).map(|(ray, &light)| PixelLight { indirect: [light; 2], ..*ray });
        Self { rays: rays.collect(), ..*self }
    }
}

impl PixelLight {
    /// Radiance of some indirect irradiance alone, on surfaces of albedo [`GRAY`]; none where no light is reflected.
    pub fn gray(&self, indirect: Vec3) -> Vec3 {
        if self.albedo == Vec3::ZERO { Vec3::ZERO } else { indirect * GRAY / PI }
    }

    /// Radiance toward the camera with some indirect irradiance.
    pub fn radiance(&self, indirect: Vec3) -> Vec3 {
        self.other + self.albedo / PI * indirect
    }

    /// Path traced indirect irradiance from all paths.
    pub fn reference(&self) -> Vec3 {
        (self.indirect[0] + self.indirect[1]) / 2.0
    }
}

impl PathTracer<'_> {
    /// Traces a camera's view.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn view(&self, camera: &Camera, settings: ViewSettings, progress: &Progress) -> Result<ViewLight, Cancelled> {
        let per_axis = settings.rays_per_axis.max(1);
        let per_pixel = per_axis * per_axis;
        let row = |y: u32| -> Vec<PixelLight> {
            let mut rays = Vec::with_capacity((settings.width * per_pixel) as usize);
            for x in 0..settings.width {
                for sub in 0..per_pixel {
                    let step = |sub: u32, center: f32| (sub as f32 + center) / per_axis as f32;
                    let u = (x as f32 + step(sub % per_axis, CENTER[0])) / settings.width as f32;
                    let v = (y as f32 + step(sub / per_axis, CENTER[1])) / settings.height as f32;
                    let dir = camera_dir(camera, u, v, settings.width as f32 / settings.height as f32);
                    rays.push(self.primary(camera.to_world.w_axis.xyz(), dir));
                }
            }
            rays
        };
        let rows: Vec<Vec<PixelLight>> = (0..settings.height).into_par_iter().map(row).collect();
        progress.check()?;
        let mut view = ViewLight {
            width: settings.width,
            height: settings.height,
            per_pixel: per_pixel as usize,
            rays: rows.concat(),
            half: 0,
            batches: 0,
        };
        self.add_paths(&mut view, settings.paths, progress)?;
        Ok(view)
    }

    /// Adds paths to every primary ray of a view, half of them to each of its two estimates, in one lattice: few large
    /// rounds converge faster than many small ones.
    ///
    /// # Errors
    /// [`Cancelled`]; the view is then without use.
    pub fn add_paths(&self, view: &mut ViewLight, paths: u32, progress: &Progress) -> Result<(), Cancelled> {
        let half = (paths / 2).max(1);
        let stage = progress.stage(&format!("reference picture, {} paths", 2 * (view.half + half)), view.height.into());
        let share = half as f32 / (view.half + half) as f32;
        let batches = view.batches;
        let row = view.width as usize * view.per_pixel;
        view.rays.par_chunks_mut(row.max(1)).enumerate().for_each(|(y, rays)| {
            if progress.is_cancelled() {
                return;
            }
            for (x, ray) in rays.iter_mut().enumerate() {
                let Some(point) = ray.point else { continue };
                // Streams of pictures lie apart from those of receivers, which are numbered with 32 bits.
                let stream = (1 << 40) + (y * row + x) as u64;
                for (number, held) in ray.indirect.iter_mut().enumerate() {
                    let fresh = self.batch(&[point], stream, 2 * batches + number as u64, half).0.as_vec3();
                    *held = held.lerp(fresh, share);
                }
            }
            stage.inc(1);
        });
        progress.check()?;
        view.half += half;
        view.batches += 1;
        Ok(())
    }

    fn primary(&self, origin: Vec3, dir: Vec3) -> PixelLight {
        let scene = self.caster.scene();
        let Some(hit) = self.caster.closest_hit(origin, dir) else {
            return PixelLight { other: self.lighting.sky.radiance(dir), ..PixelLight::default() };
        };
        let Some(face) = hit.point else { return PixelLight { position: hit.position, ..PixelLight::default() } };
        let point = hit.mapped_point(scene);
        let albedo = self.shading.albedo(face.mesh, face.triangle, face.barycentrics);
        let emission = self.shading.emission(face.mesh, face.triangle, face.barycentrics);
        // All lights, so that a picture's direct light has no noise.
        let lights = &self.lighting.lights;
        let direct = localprt_runtime::scene_light::direct_irradiance(
            self.caster,
            lights,
            point.position,
            point.normal,
            point.geometric_normal,
        );
        let mesh = &scene.meshes[face.mesh];
        let uv = mesh.lightmap_uv().map(|set| {
            let corners = mesh.triangles[face.triangle].map(|vertex| set[vertex as usize]);
            corners[0] * face.barycentrics.x + corners[1] * face.barycentrics.y + corners[2] * face.barycentrics.z
        });
        let reflects = albedo != Vec3::ZERO;
        PixelLight {
            other: emission + albedo / PI * direct,
            albedo,
            indirect: [Vec3::ZERO; 2],
            uv,
            position: hit.position,
            point: reflects.then_some(point),
        }
    }
}
