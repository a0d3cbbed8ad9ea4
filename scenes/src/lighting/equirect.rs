//! Reads latitude-longitude images: OpenEXR and Radiance HDR, as linear radiance.

use super::LightingError;
use exr::prelude::{ReadChannels, ReadLayers};
use glam::Vec3;
use image::ImageDecoder;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Largest image taken: a file's header may claim any size, and the pixels are allocated before they are read.
const MAX_SIZE: (usize, usize) = (16384, 8192);

/// Width, height, and `width * height` linear radiances, top row first. Negative values, which image filters and color
/// conversions leave behind, become 0.
///
/// # Errors
/// `SkyImage` when the file is missing, is no such image, is too large or holds a number that is not finite.
pub(super) fn read(path: &Path) -> Result<(u32, u32, Vec<Vec3>), LightingError> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let pixels = match extension.as_deref() {
        Some("exr") => read_exr(path),
        Some("hdr") => read_hdr(path),
        _ => Err("the name must end in .exr or .hdr".into()),
    };
    pixels
        .and_then(|(width, height, mut pixels)| {
            for (index, pixel) in pixels.iter_mut().enumerate() {
                if !pixel.is_finite() {
                    let (column, row) = (index % width, index / width);
                    return Err(format!("pixel {column}, {row} is {pixel}, not finite"));
                }
                *pixel = pixel.max(Vec3::ZERO);
            }
            // Fits: both are below MAX_SIZE.
            Ok((width as u32, height as u32, pixels))
        })
        .map_err(|reason| LightingError::SkyImage { path: path.to_owned(), reason })
}

fn check_size(width: usize, height: usize) -> Result<(), String> {
    if width == 0 || height == 0 || width > MAX_SIZE.0 || height > MAX_SIZE.1 {
        let (most_wide, most_high) = MAX_SIZE;
        return Err(format!("{width} x {height} pixels, allowed are 1 x 1 to {most_wide} x {most_high}"));
    }
    Ok(())
}

fn read_exr(path: &Path) -> Result<(usize, usize, Vec<Vec3>), String> {
    let headers = exr::meta::MetaData::read_from_file(path, false).map_err(|error| error.to_string())?.headers;
    for header in &headers {
        let size = header.layer_size;
        check_size(size.0, size.1)?;
        let shown = header.shared_attributes.display_window;
        if shown.size != size || shown.position != header.own_attributes.layer_position {
            return Err("the data window is not the display window".into());
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.0, vec![Vec3::ZERO; size.0 * size.1]),
            |(width, pixels), at, (r, g, b): (f32, f32, f32)| pixels[at.1 * *width + at.0] = Vec3::new(r, g, b),
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|error| error.to_string())?;
    let size = image.layer_data.size;
    Ok((size.0, size.1, image.layer_data.channel_data.pixels.1))
}

fn read_hdr(path: &Path) -> Result<(usize, usize, Vec<Vec3>), String> {
    let file = BufReader::new(File::open(path).map_err(|error| error.to_string())?);
    let decoder = image::codecs::hdr::HdrDecoder::new(file).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    // The header says what the pixels were multiplied with on their way from radiance.
    let metadata = decoder.metadata();
    let correction = metadata.color_correction.map_or(Vec3::ONE, |(r, g, b)| Vec3::new(r, g, b));
    let factor = (correction * metadata.exposure.unwrap_or(1.0)).recip();
    let pixels = image::DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?.into_rgb32f();
    let pixels = pixels.pixels().map(|pixel| Vec3::from_array(pixel.0) * factor).collect();
    Ok((width, height, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn pixel(x: usize, y: usize) -> Vec3 {
        // Exact in RGBE: eight bits of mantissa.
        Vec3::new(x as f32, y as f32, 0.5)
    }

    fn written_exr(folder: &Path, name: &str, special: f32) -> PathBuf {
        let path = folder.join(name);
        exr::prelude::write_rgb_file(&path, 4, 2, |x, y| {
            let value = if (x, y) == (2, 1) { Vec3::splat(special) } else { pixel(x, y) };
            (value.x, value.y, value.z)
        })
        .unwrap();
        path
    }

    fn reason(path: &Path) -> String {
        read(path).unwrap_err().to_string()
    }

    #[test]
    fn exr_pixels_arrive_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let (width, height, pixels) = read(&written_exr(folder.path(), "sky.EXR", -1.0)).unwrap();
        assert_eq!((width, height), (4, 2));
        let expected: Vec<Vec3> = (0..8).map(|i| if i == 6 { Vec3::ZERO } else { pixel(i % 4, i / 4) }).collect();
        assert_eq!(pixels, expected);
    }

    #[test]
    fn hdr_pixels_arrive_in_order_and_exposure_is_undone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.hdr");
        let pixels: Vec<image::Rgb<f32>> = (0..32).map(|i| image::Rgb(pixel(i % 8, i / 8).to_array())).collect();
        image::codecs::hdr::HdrEncoder::new(File::create(&path).unwrap()).encode(&pixels, 8, 4).unwrap();
        let expected: Vec<Vec3> = (0..32).map(|i| pixel(i % 8, i / 8)).collect();
        let whole = read(&path).unwrap();
        assert_eq!((whole.0, whole.1), (8, 4));
        // The encoder rounds the mantissa down by at most one of 2^-7 of the largest band.
        let close = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).all(|(a, b)| (a - b).abs().max_element() <= 8.0 / 128.0);
        assert!(close(&whole.2, &expected), "{:?}", whole.2);
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(6).position(|window| window == b"FORMAT").unwrap();
        bytes.splice(at..at, *b"EXPOSURE=2\n");
        std::fs::write(&path, bytes).unwrap();
        let halved: Vec<Vec3> = whole.2.iter().map(|pixel| pixel / 2.0).collect();
        assert_eq!(read(&path).unwrap().2, halved);
    }

    #[test]
    fn bad_images_are_refused_with_a_reason() {
        let folder = tempfile::tempdir().unwrap();
        let not_finite = reason(&written_exr(folder.path(), "infinite.exr", f32::INFINITY));
        assert!(not_finite.contains("pixel 2, 1 is"), "{not_finite}");
        assert!(reason(&written_exr(folder.path(), "nan.exr", f32::NAN)).contains("pixel 2, 1 is"));
        let broken = folder.path().join("broken.exr");
        let whole = std::fs::read(written_exr(folder.path(), "whole.exr", 0.0)).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&broken, &whole[..length]).unwrap();
            assert!(read(&broken).is_err(), "{length} of {} bytes", whole.len());
        }
        let huge = folder.path().join("huge.hdr");
        std::fs::write(&huge, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8193 +X 16384\n").unwrap();
        assert!(reason(&huge).contains("16384 x 8193"), "{}", reason(&huge));
        std::fs::write(&huge, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\nabc").unwrap();
        assert!(read(&huge).is_err());
        assert!(reason(&folder.path().join("sky.png")).contains(".exr or .hdr"));
        assert!(reason(&folder.path().join("none.exr")).contains("none.exr"));
    }
}
