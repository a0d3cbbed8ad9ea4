//! KTX2 textures: 16-bit floats, uncompressed. Source: KTX file format specification 2.0, Khronos data format specification 1.3.

use super::{OutputError, write_file};
use glam::Vec4;
use half::f16;
use std::path::Path;

/// `VK_FORMAT_R16G16B16A16_SFLOAT`, and the bytes of a texel and of a channel.
const FORMAT: u32 = 97;
const TEXEL: u32 = 8;
const CHANNEL: u32 = 2;
/// Bytes of identifier, head and index of one level.
const HEAD: usize = 12 + 9 * 4 + 4 * 4 + 2 * 8;
const LEVEL: usize = 24;
/// Channels of the basic data format: red, green, blue, alpha; signed floats.
const CHANNELS: [u8; 4] = [0, 1, 2, 15];
const SIGNED_FLOAT: u8 = 0xc0;

/// Writes linear Rec. 709 pixels with alpha, `[height][width]`, top row first, which is row 0 of texture coordinates.
///
/// Values beyond what 16-bit floats hold become the nearest that they do.
///
/// # Errors
/// [`OutputError`].
pub fn write_ktx2(path: &Path, width: u32, height: u32, pixels: &[Vec4]) -> Result<(), OutputError> {
    write_file(path, &ktx2(width, height, pixels))
}

fn ktx2(width: u32, height: u32, pixels: &[Vec4]) -> Vec<u8> {
    let format = format_descriptor();
    let notes = notes();
    let format_at = HEAD + LEVEL;
    let notes_at = format_at + format.len();
    let data_at = (notes_at + notes.len()).next_multiple_of(TEXEL as usize);
    let length = pixels.len() as u64 * u64::from(TEXEL);

    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    // Format, size of its type, width, height, depth, layers, faces, levels, supercompression.
    let head = [FORMAT, CHANNEL, width, height, 0, 0, 1, 1, 0];
    let index = [format_at, format.len(), notes_at, notes.len()].map(|value| value as u32);
    bytes.extend(head.into_iter().chain(index).flat_map(u32::to_le_bytes));
    // No data of supercompression; the level.
    bytes.extend([0, 0, data_at as u64, length, length].into_iter().flat_map(u64::to_le_bytes));
    bytes.extend(format);
    bytes.extend(notes);
    bytes.resize(data_at, 0);
    let half = |value: f32| f16::from_f32(value.clamp(f16::MIN.to_f32(), f16::MAX.to_f32())).to_le_bytes();
    bytes.extend(pixels.iter().flat_map(|pixel| pixel.to_array()).flat_map(half));
    bytes
}

/// The basic descriptor block: RGB with straight alpha, primaries of Rec. 709, linear.
fn format_descriptor() -> Vec<u8> {
    let block = 24 + 16 * CHANNELS.len() as u32;
    let mut bytes: Vec<u8> = [4 + block, 0, block << 16 | 2].into_iter().flat_map(u32::to_le_bytes).collect();
    bytes.extend([1, 1, 1, 0]);
    // Blocks of one texel; bytes of the first plane.
    bytes.extend([0; 4]);
    bytes.extend([TEXEL as u8, 0, 0, 0, 0, 0, 0, 0]);
    for (number, channel) in CHANNELS.into_iter().enumerate() {
        bytes.extend((16 * number as u16).to_le_bytes());
        bytes.extend([15, SIGNED_FLOAT | channel, 0, 0, 0, 0]);
        bytes.extend([-1f32, 1.0].into_iter().flat_map(f32::to_le_bytes));
    }
    bytes
}

/// Keys and values, in the order of the keys.
fn notes() -> Vec<u8> {
    let writer = concat!("localprt ", env!("CARGO_PKG_VERSION"));
    let mut bytes = Vec::new();
    for (key, value) in [("KTXorientation", "rd"), ("KTXwriter", writer)] {
        let entry = [key.as_bytes(), b"\0", value.as_bytes(), b"\0"].concat();
        bytes.extend((entry.len() as u32).to_le_bytes());
        bytes.extend(&entry);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_lie_where_the_head_says() {
        let pixels: Vec<Vec4> = (0..6).map(|i| Vec4::new(i as f32, 0.5, 1e9, 1.0)).collect();
        let bytes = ktx2(3, 2, &pixels);
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        assert_eq!([20, 24, 40].map(word), [3, 2, 1]);
        let [format, format_length, notes, notes_length] = [48, 52, 56, 60].map(word);
        let [data, length] = [80, 88].map(word);
        assert_eq!((word(format), format + format_length, length), (format_length, notes, 48));
        assert!(notes + notes_length <= data && data % 8 == 0 && bytes.len() == data + length);
        let text = String::from_utf8_lossy(&bytes[notes..notes + notes_length]);
        assert!(text.contains("KTXorientation\0rd\0") && text.contains("KTXwriter\0localprt"), "{text}");
        let half = |at: usize| f16::from_le_bytes([bytes[data + at], bytes[data + at + 1]]).to_f32();
        assert_eq!([half(0), half(8), half(2), half(4), half(6)], [0.0, 1.0, 0.5, 65504.0, 1.0]);
    }
}
