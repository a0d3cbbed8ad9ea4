//! GLB or plain JSON, told apart by content.

use super::error::{LoadError, Source};

const EXPORT_AGAIN: &str = "copy it again, or export it again as glTF 2.0 (.glb or .gltf)";
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BIN_CHUNK: u32 = 0x004e_4942;

/// The JSON text and the GLB's binary chunk, if there is one.
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    pub bin: Option<&'a [u8]>,
}

/// Splits the bytes of a .gltf or .glb file.
pub(super) fn split<'a>(source: &Source, bytes: &'a [u8]) -> Result<Container<'a>, LoadError> {
    if bytes.starts_with(b"glTF") {
        return split_glb(source, bytes);
    }
    // A byte order mark is against the specification, harmless, and common on Windows.
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match text.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'{') => Ok(Container { json: text, bin: None }),
        Some(_) => Err(source.container("neither a GLB (magic \"glTF\") nor a JSON object", EXPORT_AGAIN)),
        None => Err(source.container("the file is empty", EXPORT_AGAIN)),
    }
}

fn split_glb<'a>(source: &Source, bytes: &'a [u8]) -> Result<Container<'a>, LoadError> {
    let word = |at: usize| bytes.get(at..at + 4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    let truncated = || source.container(format!("GLB cut off after {} bytes", bytes.len()), EXPORT_AGAIN);
    let version = word(4).ok_or_else(truncated)?;
    if version != 2 {
        return Err(source.unsupported(
            "/",
            format!("GLB version {version}"),
            "convert it to glTF 2.0, for example by importing and exporting it with Blender",
        ));
    }
    let length = word(8).ok_or_else(truncated)?;
    if u64::from(length) != bytes.len() as u64 {
        let found = format!("GLB header says {length} bytes, the file has {}", bytes.len());
        return Err(source.container(found, EXPORT_AGAIN));
    }
    let mut chunks = Vec::new();
    let mut at = 12;
    while at < bytes.len() {
        let (length, kind) = (word(at).ok_or_else(truncated)?, word(at + 4).ok_or_else(truncated)?);
        let end = (at + 8).checked_add(length as usize).ok_or_else(truncated)?;
        let data = bytes.get(at + 8..end).ok_or_else(|| {
            let found = format!("GLB chunk at byte {at} says {length} bytes, the file ends before that");
            source.container(found, EXPORT_AGAIN)
        })?;
        chunks.push((kind, data));
        // Chunks start at multiples of four; lengths that are not are padded by some writers and not by others.
        at = end.next_multiple_of(4);
    }
    match chunks.as_slice() {
        [(JSON_CHUNK, json), (BIN_CHUNK, bin), ..] => Ok(Container { json, bin: Some(bin) }),
        [(JSON_CHUNK, json), ..] => Ok(Container { json, bin: None }),
        _ => Err(source.container("GLB whose first chunk is not JSON", EXPORT_AGAIN)),
    }
}
