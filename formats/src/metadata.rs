//! The metadata section's encoding; the only file that names bincode.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};

use crate::baked::Metadata;
use crate::error::{OpenError, WriteError};

/// Most bytes of the metadata section.
pub const MAX_METADATA_BYTES: usize = 1 << 20;

/// Fixed-size little-endian numbers, so that `SPEC.md` can give the section byte by byte; never without the limit.
const CONFIG: Configuration<LittleEndian, Fixint, Limit<MAX_METADATA_BYTES>> =
    bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<MAX_METADATA_BYTES>();

/// Bytes of the section.
pub(crate) fn encode(metadata: &Metadata) -> Result<Vec<u8>, WriteError> {
    let bytes = bincode::serde::encode_to_vec(metadata, CONFIG)
        .map_err(|error| WriteError::MetadataEncoding { reason: error.to_string() })?;
    if bytes.len() > MAX_METADATA_BYTES {
        return Err(WriteError::MetadataTooLarge { found: bytes.len() as u64, allowed: MAX_METADATA_BYTES as u64 });
    }
    Ok(bytes)
}

/// Rule 30: at most [`MAX_METADATA_BYTES`], well formed, and nothing left over.
pub(crate) fn decode(bytes: &[u8]) -> Result<Metadata, OpenError> {
    if bytes.len() > MAX_METADATA_BYTES {
        return Err(OpenError::MetadataTooLarge { found: bytes.len() as u64, allowed: MAX_METADATA_BYTES as u64 });
    }
    let (metadata, consumed) = bincode::serde::decode_from_slice(bytes, CONFIG)
        .map_err(|error| OpenError::MetadataEncoding { reason: error.to_string() })?;
    if consumed != bytes.len() {
        let reason = format!("{} bytes are left over after byte {consumed}", bytes.len() - consumed);
        return Err(OpenError::MetadataEncoding { reason });
    }
    Ok(metadata)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Metadata {
        Metadata { tool_version: "1".into(), scene_path: "a/b.glb".into(), n_rays: 8, ..Metadata::default() }
    }

    #[test]
    fn metadata_returns_as_written_and_every_prefix_is_refused() {
        let bytes = encode(&example()).unwrap();
        // 3 strings of 8 + n bytes, 32 bytes of hash, 6 counts, 6 floats.
        assert_eq!(bytes.len(), (8 + 1) + (8 + 7) + 32 + 6 * 4 + 6 * 4 + 8);
        assert_eq!(decode(&bytes).unwrap(), example());
        for length in 0..bytes.len() {
            assert!(matches!(decode(&bytes[..length]), Err(OpenError::MetadataEncoding { .. })), "{length}");
        }
    }

    #[test]
    fn bytes_left_over_are_refused() {
        let mut bytes = encode(&example()).unwrap();
        bytes.push(0);
        assert!(decode(&bytes).unwrap_err().to_string().contains("1 bytes are left over"));
    }

    #[test]
    fn a_huge_string_length_asks_for_no_memory() {
        let mut bytes = encode(&example()).unwrap();
        for claim in [u64::MAX, u64::MAX / 2, 1 << 40, 1 << 20, 1 << 19] {
            bytes[..8].copy_from_slice(&claim.to_le_bytes());
            assert!(matches!(decode(&bytes), Err(OpenError::MetadataEncoding { .. })), "{claim}");
        }
    }

    #[test]
    fn metadata_above_the_limit_is_neither_written_nor_read() {
        let large = Metadata { options: " ".repeat(MAX_METADATA_BYTES), ..example() };
        assert!(matches!(encode(&large), Err(WriteError::MetadataTooLarge { .. })));
        let bytes = vec![0; MAX_METADATA_BYTES + 1];
        assert!(matches!(decode(&bytes), Err(OpenError::MetadataTooLarge { .. })));
        // The largest that is written can be read: the limit of the decoder counts the same bytes.
        let room = MAX_METADATA_BYTES - encode(&example()).unwrap().len();
        let largest = Metadata { options: " ".repeat(room), ..example() };
        assert_eq!(decode(&encode(&largest).unwrap()).unwrap(), largest);
    }
}
