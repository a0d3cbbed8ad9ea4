//! Encoded bytes of images: those of the source file, or a PNG of the pixels.

use crate::scene::Image;
use image::{ExtendedColorType, ImageEncoder, ImageResult, codecs::png::PngEncoder};
use std::borrow::Cow;

/// MIME type and bytes.
pub(super) fn encoded(image: &Image) -> ImageResult<(&str, Cow<'_, [u8]>)> {
    // Formats that plain glTF allows; anything else is written as PNG.
    if let Some((mime, bytes)) = &image.encoded
        && matches!(mime.as_str(), "image/png" | "image/jpeg")
    {
        return Ok((mime, Cow::Borrowed(bytes)));
    }
    let too_short = image.rgba.len() as u64 != u64::from(image.width) * u64::from(image.height) * 4;
    if too_short || image.rgba.is_empty() {
        let kind = image::error::ParameterErrorKind::DimensionMismatch;
        return Err(image::ImageError::Parameter(image::error::ParameterError::from_kind(kind)));
    }
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(&image.rgba, image.width, image.height, ExtendedColorType::Rgba8)?;
    Ok(("image/png", Cow::Owned(bytes)))
}
