//! Encoded images to pixels: PNG and JPEG, WebP, and Basis textures in KTX2.

use crate::guarded::guarded;
use image::{ImageFormat, ImageReader};
use std::io::Cursor;

const FAILED: &str = "the image decoder failed";

/// A format that is read, told by content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// By the `image` crate.
    Plain(ImageFormat),
    /// ETC1S or UASTC.
    #[cfg(feature = "compressed")]
    Basis,
}

impl Format {
    /// `None` of others.
    pub fn of(encoded: &[u8]) -> Option<Self> {
        #[cfg(feature = "compressed")]
        if encoded.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n") {
            return Some(Self::Basis);
        }
        let format = image::guess_format(encoded).ok()?;
        let is_plain = matches!(format, ImageFormat::Png | ImageFormat::Jpeg);
        let is_read = is_plain || (cfg!(feature = "compressed") && format == ImageFormat::WebP);
        is_read.then_some(Self::Plain(format))
    }

    /// What every glTF reader knows it as; `None` of those that only extensions name.
    pub fn mime(self) -> Option<&'static str> {
        match self {
            Self::Plain(ImageFormat::Png) => Some("image/png"),
            Self::Plain(ImageFormat::Jpeg) => Some("image/jpeg"),
            _ => None,
        }
    }

    /// Width and height, from the head.
    pub fn size(self, encoded: &[u8]) -> Result<(u32, u32), String> {
        guarded(FAILED, || match self {
            Self::Plain(format) => {
                let reader = ImageReader::with_format(Cursor::new(encoded), format);
                reader.into_dimensions().map_err(|error| error.to_string())
            }
            #[cfg(feature = "compressed")]
            Self::Basis => Ok(basis(encoded)?.base_dimensions()),
        })
    }

    /// RGBA of 8 bits, row by row, of an image of this size, each side at most `side`.
    pub fn pixels(self, encoded: &[u8], [width, height]: [u32; 2], side: u32) -> Result<Vec<u8>, String> {
        let rgba = guarded(FAILED, || match self {
            Self::Plain(format) => {
                let mut reader = ImageReader::with_format(Cursor::new(encoded), format);
                let mut limits = image::Limits::default();
                limits.max_image_width = Some(side);
                limits.max_image_height = Some(side);
                // RGBA with 16 bits per channel is the widest pixel; as much again for the decoder's own rows.
                limits.max_alloc = Some(u64::from(width) * u64::from(height) * 16 + (1 << 20));
                reader.limits(limits);
                Ok(reader.decode().map_err(|error| error.to_string())?.into_rgba8().into_raw())
            }
            #[cfg(feature = "compressed")]
            Self::Basis => {
                let target = basisu::TargetFormat::Rgba32;
                basis(encoded)?.transcode(0, target, basisu::DecodeFlags::NONE).map_err(|error| format!("{error:?}"))
            }
        })?;
        if rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(format!("{} bytes of pixels, not {width} x {height} of them", rgba.len()));
        }
        Ok(rgba)
    }
}

#[cfg(feature = "compressed")]
fn basis(encoded: &[u8]) -> Result<basisu::Transcoder<'_>, String> {
    check_levels(encoded)?;
    let transcoder =
        basisu::Transcoder::new(encoded).map_err(|_| "not a Basis texture of KHR_texture_basisu".to_owned())?;
    let target = basisu::TargetFormat::Rgba32;
    if !transcoder.supports(target) {
        return Err(format!("a texture of {:?}, of which there are no 8-bit pixels", transcoder.source_format()));
    }
    Ok(transcoder)
}

/// What the transcoder takes on trust: that no level unpacks to more than its blocks. Source: KTX file format 2.0, sec. 3.
#[cfg(feature = "compressed")]
fn check_levels(encoded: &[u8]) -> Result<(), String> {
    /// Bytes of the head before its list of levels, and of a level in it.
    const HEAD: usize = 80;
    const LEVEL: usize = 24;
    let short = || "a head that ends too early".to_owned();
    let bytes = |at: usize, count: usize| encoded.get(at..at + count).ok_or_else(short);
    let word = |at: usize| bytes(at, 4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    let [width, height] = [word(20)?, word(24)?].map(|side| u64::from(side).div_ceil(4));
    let [depth, layers, faces, levels] = [word(28)?, word(32)?, word(36)?, word(40)?];
    if depth > 0 || layers > 1 || faces != 1 || levels > 32 {
        return Err("not a plain picture, but one with layers, faces or depth".into());
    }
    for level in 0..levels.max(1) as usize {
        let unpacked =
            bytes(HEAD + LEVEL * level + 16, 8)?.iter().rev().fold(0u64, |sum, &byte| sum << 8 | u64::from(byte));
        // Blocks of 4 x 4 pixels are of 16 bytes at most, and a level is no larger than the first.
        if unpacked > width.saturating_mul(height).saturating_mul(16) {
            return Err(format!("level {level} unpacks to {unpacked} bytes, more than its pixels are"));
        }
    }
    Ok(())
}
