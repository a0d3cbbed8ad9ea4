//! Pictures of a lit scene: what to look at before reading numbers.
//!
//! [`render`] casts rays from a camera; [`Surfaces::radiance`] shades a hit with textured albedo, direct light
//! that the caller traces and indirect irradiance read from the receiver map; [`Picture::develop`] makes an sRGB image of it.

mod camera;
mod surfaces;
mod tone;

pub use camera::default_camera;
pub use surfaces::Surfaces;
pub use tone::{Exposure, WHITE, tone_curve};

use crate::progress::{Cancelled, Progress};
use glam::{Vec3, Vec4Swizzles};
use localprt_scenes::Camera;
use localprt_surfaces::rays::{RayCaster, SurfaceHit};
use rayon::prelude::*;

/// Size and smoothness of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rays per pixel and axis, on a regular grid: 2 means 4 rays.
    pub rays_per_axis: u32,
}

impl PictureSize {
    /// A picture of about 0.7 million pixels, 960 wide, in the camera's shape, or 4:3.
    pub fn of_camera(camera: &Camera) -> Self {
        let aspect = camera.aspect.filter(|aspect| (0.1..=10.0).contains(aspect)).unwrap_or(4.0 / 3.0);
        Self { width: 960, height: (960.0 / aspect).round() as u32, rays_per_axis: 2 }
    }
}

/// Radiance per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height][width]` linear RGB radiance, W sr^-1 m^-2, top row first.
    pub pixels: Vec<Vec3>,
}

/// Radiance that arrives at a camera.
///
/// `radiance` shades what a ray hits, `sky` where it leaves the scene (unit direction). A pixel is the mean of its rays.
///
/// # Errors
/// [`Cancelled`].
pub fn render(
    caster: &RayCaster<'_>,
    camera: &Camera,
    size: PictureSize,
    progress: &Progress,
    radiance: impl Fn(&SurfaceHit) -> Vec3 + Sync,
    sky: impl Fn(Vec3) -> Vec3 + Sync,
) -> Result<Picture, Cancelled> {
    let stage = progress.stage("picture", size.height.into());
    let origin = camera.to_world.w_axis.xyz();
    let per_axis = size.rays_per_axis.max(1);
    let row = |y: u32| -> Vec<Vec3> {
        if progress.is_cancelled() {
            return Vec::new();
        }
        let pixel = |x: u32| {
            let mut sum = Vec3::ZERO;
            for sub in 0..per_axis * per_axis {
                let step = |sub: u32| (sub as f32 + 0.5) / per_axis as f32;
                let u = (x as f32 + step(sub % per_axis)) / size.width as f32;
                let v = (y as f32 + step(sub / per_axis)) / size.height as f32;
                let dir = camera_dir(camera, u, v, size.width as f32 / size.height as f32);
                sum += caster.closest_hit(origin, dir).map_or_else(|| sky(dir), |hit| radiance(&hit));
            }
            sum / (per_axis * per_axis) as f32
        };
        let pixels = (0..size.width).map(pixel).collect();
        stage.inc(1);
        pixels
    };
    let rows: Vec<Vec<Vec3>> = (0..size.height).into_par_iter().map(row).collect();
    progress.check()?;
    Ok(Picture { width: size.width, height: size.height, pixels: rows.concat() })
}

/// Unit world direction through a point of the picture: u to the right, v down, both 0..=1.
pub fn camera_dir(camera: &Camera, u: f32, v: f32, aspect: f32) -> Vec3 {
    let half = (camera.fov_y * 0.5).tan();
    let local = Vec3::new((2.0 * u - 1.0) * half * aspect, (1.0 - 2.0 * v) * half, -1.0);
    camera.to_world.transform_vector3(local).normalize_or(Vec3::NEG_Z)
}

impl Picture {
    /// 8-bit sRGB, `[height][width][3]`: radiance times 2^EV, through [`tone_curve`], sRGB encoded.
    pub fn develop(&self, exposure: Exposure) -> Vec<u8> {
        let scale = exposure.ev(&self.pixels).exp2();
        self.pixels.iter().flat_map(|&pixel| tone::encode(pixel * scale)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec3Swizzles, camera::rh::view::look_at_mat4};
    use localprt_scenes::{Material, Mesh, Scene};

    /// A floor of 2 m x 2 m at y = 0, lightmap over all of it: u along x, v along z.
    pub(super) fn floor() -> Scene {
        let positions =
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
        let uv = positions.iter().map(|point| (point.xz() + 1.0) * 0.5).collect();
        let mesh = Mesh {
            name: "floor".into(),
            normals: vec![Vec3::Y; 4],
            uv_sets: vec![Vec::new(), uv],
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            positions,
            ..Mesh::default()
        };
        Scene { meshes: vec![mesh], materials: vec![Material::default()], ..Scene::default() }
    }

    /// Above the floor, looking down; up is -z.
    fn above() -> Camera {
        let to_world = look_at_mat4(Vec3::Y * 2.0, Vec3::ZERO, Vec3::NEG_Z).inverse();
        Camera { name: "above".into(), to_world, fov_y: std::f32::consts::FRAC_PI_2, aspect: None }
    }

    #[test]
    fn pixels_show_what_lies_behind_them() {
        let scene = floor();
        let caster = RayCaster::new(&scene).expect("a tree");
        let size = PictureSize { width: 8, height: 4, rays_per_axis: 2 };
        let shade = |hit: &SurfaceHit| hit.position;
        let picture = render(&caster, &above(), size, &Progress::silent(), shade, |_| Vec3::splat(9.0));
        let picture = picture.expect("not cancelled");
        // 90 degrees at 2 m show 4 m of height and 8 m of width: 1 m per pixel; the floor fills the middle 2 x 2.
        let at = |x: usize, y: usize| picture.pixels[y * 8 + x];
        for (x, y, expected) in [(3, 1, [-0.5, 0.0, -0.5]), (4, 1, [0.5, 0.0, -0.5]), (3, 2, [-0.5, 0.0, 0.5])] {
            // Positions of about 1 m after some ten f32 roundings.
            assert!(at(x, y).abs_diff_eq(Vec3::from(expected), 1e-5), "{x} {y} {}", at(x, y));
        }
        assert_eq!(at(0, 0), Vec3::splat(9.0));
        assert_eq!(at(2, 1), Vec3::splat(9.0));
    }

    #[test]
    fn a_cancelled_picture_is_none() {
        let scene = floor();
        let caster = RayCaster::new(&scene).expect("a tree");
        let progress = Progress::silent();
        progress.cancel();
        let size = PictureSize { width: 8, height: 4, rays_per_axis: 1 };
        let picture = render(&caster, &above(), size, &progress, |_| Vec3::ZERO, |_| Vec3::ZERO);
        assert_eq!(picture, Err(Cancelled));
    }
}
