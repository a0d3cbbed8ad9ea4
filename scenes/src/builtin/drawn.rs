//! Images drawn by code.

use super::shapes::noise;
use crate::scene::Image;
use glam::{DVec2, DVec3, Vec2, Vec3};
use image::ImageEncoder;

/// Colors in 0..255, sRGB or as they are, and alpha in 0..1, evaluated at pixel centers in 0..1, row 0 on top.
pub(super) fn draw(name: &str, size: u32, color: impl Fn(Vec2) -> (Vec3, f32)) -> Image {
    let mut rgba = vec![];
    for y in 0..size {
        for x in 0..size {
            let (color, alpha) = color((Vec2::new(x as f32, y as f32) + 0.5) / size as f32);
            let bytes = color.clamp(Vec3::ZERO, Vec3::splat(255.0)).round();
            rgba.extend([bytes.x as u8, bytes.y as u8, bytes.z as u8, (alpha * 255.0).round() as u8]);
        }
    }
    let mut png = vec![];
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    // Writing to memory does not fail, and an image without its encoded form is complete.
    let encoded = encoder.write_image(&rgba, size, size, image::ExtendedColorType::Rgba8);
    let encoded = encoded.ok().map(|()| ("image/png".into(), png));
    Image { name: name.into(), width: size, height: size, rgba, encoded }
}

/// The normal map of a surface that repeats: `height` in metres over right and up in 0..1, one of which is `size_m` metres. Red points
/// right, green up in the image.
pub(super) fn normal_map(name: &str, size: u32, size_m: f64, height: impl Fn(DVec2) -> f64) -> Image {
    let step = 0.25 / f64::from(size);
    draw(name, size, |at| {
        let at = DVec2::new(f64::from(at.x), 1.0 - f64::from(at.y));
        let slope = |axis: DVec2| (height(at + axis * step) - height(at - axis * step)) / (2.0 * step * size_m);
        let normal = DVec3::new(-slope(DVec2::X), -slope(DVec2::Y), 1.0).normalize();
        ((normal.as_vec3() + 1.0) * 127.5, 1.0)
    })
}

/// A number in -1..1 for a cell.
pub(super) fn of_cell(cell: DVec2, which: u32) -> f64 {
    f64::from(noise(cell.x as u32 * 64 + cell.y as u32 * 8 + which)) * 2.0 - 1.0
}
