//! OpenEXR images: linear values, no tone curve.

use super::{OutputError, write_file};
use exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Text, Vec2,
    WritableImage,
};
use glam::Vec3;
use half::f16;
use std::io::Cursor;
use std::path::Path;

/// Type of the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrPrecision {
    /// 16-bit floats: values up to 65504, relative error 2^-11.
    Half,
    /// 32-bit floats.
    #[default]
    Full,
}

/// Writes an RGB image in scanlines, lossless ZIP.
///
/// `pixels` is `[height][width]`, top row first. Of a map in lightmap coordinates the top row is the one at v = 0, as in
/// glTF.
///
/// # Errors
/// [`OutputError`]; panics if `pixels` has another length than `width * height`.
pub fn write_exr(
    path: &Path,
    width: usize,
    height: usize,
    pixels: &[Vec3],
    precision: ExrPrecision,
) -> Result<(), OutputError> {
    assert_eq!(pixels.len(), width * height, "one value per pixel");
    let mut bytes = Cursor::new(Vec::new());
    let at = |position: Vec2<usize>| pixels[position.y() * width + position.x()];
    let written = match precision {
        ExrPrecision::Full => {
            let channels = SpecificChannels::rgb(|position| {
                let value = at(position);
                (value.x, value.y, value.z)
            });
            Image::from_layer(Layer::new((width, height), attributes(), encoding(), channels))
                .write()
                .non_parallel()
                .to_buffered(&mut bytes)
        }
        ExrPrecision::Half => {
            // Larger values would become infinite, which no later step can use.
            let narrow = |value: f32| f16::from_f32(value.clamp(-65504.0, 65504.0));
            let channels = SpecificChannels::rgb(|position| {
                let value = at(position);
                (narrow(value.x), narrow(value.y), narrow(value.z))
            });
            Image::from_layer(Layer::new((width, height), attributes(), encoding(), channels))
                .write()
                .non_parallel()
                .to_buffered(&mut bytes)
        }
    };
    written.map_err(|error| OutputError::Encode { path: path.to_owned(), what: error.to_string() })?;
    write_file(path, bytes.get_ref())
}

fn attributes() -> LayerAttributes {
    LayerAttributes { software_name: Some(Text::from("localprt")), ..LayerAttributes::default() }
}

fn encoding() -> Encoding {
    Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::read_first_rgba_layer_from_file;

    fn read(path: &Path) -> (usize, usize, Vec<[f32; 3]>) {
        let image = read_first_rgba_layer_from_file(
            path,
            |size, _| (size.x(), vec![[0.0f32; 3]; size.x() * size.y()]),
            |(width, pixels), position, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[position.y() * *width + position.x()] = [r, g, b];
            },
        )
        .expect("an EXR image");
        let size = image.layer_data.size;
        (size.x(), size.y(), image.layer_data.channel_data.pixels.1)
    }

    #[test]
    fn images_read_back_with_the_first_row_at_the_top() {
        let folder = tempfile::tempdir().expect("folder");
        let pixels: Vec<Vec3> = (0..6).map(|index| Vec3::new(index as f32, 0.1, 1e5)).collect();
        let path = folder.path().join("full.exr");
        write_exr(&path, 3, 2, &pixels, ExrPrecision::Full).expect("written");
        let expected: Vec<[f32; 3]> = pixels.iter().map(Vec3::to_array).collect();
        assert_eq!(read(&path), (3, 2, expected));
        let path = folder.path().join("half.exr");
        write_exr(&path, 3, 2, &pixels, ExrPrecision::Half).expect("written");
        let (_, _, halved) = read(&path);
        for (value, original) in halved.iter().zip(&pixels) {
            assert_eq!(value[0], original.x);
            // Rounding to 11 significant bits.
            assert!((value[1] - 0.1).abs() <= 0.1 / 2048.0);
            assert_eq!(value[2], 65504.0);
        }
    }
}
