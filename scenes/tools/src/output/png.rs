//! PNG pictures: 8-bit sRGB.

use super::{OutputError, write_file};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use std::path::Path;

/// Writes an 8-bit RGB picture: `rgb` is `[height][width][3]`, sRGB encoded, top row first.
///
/// # Errors
/// [`OutputError`].
pub fn write_png(path: &Path, width: u32, height: u32, rgb: &[u8]) -> Result<(), OutputError> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| OutputError::Encode { path: path.to_owned(), what: error.to_string() })?;
    write_file(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_read_back() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.png");
        let rgb: Vec<u8> = (0..18).collect();
        write_png(&path, 3, 2, &rgb).expect("written");
        let bytes = std::fs::read(&path).expect("read");
        let read = image::load_from_memory(&bytes).expect("a PNG image").to_rgb8();
        assert_eq!((read.width(), read.height(), read.into_raw()), (3, 2, rgb));
    }
}
