//! Bytes from outside: the scene file, its buffers and its images, confined to the scene's folder and to [`Limits`].

use super::accessors::View;
use super::document::{Document, pointer, remedy_for};
use super::error::{LoadError, Source, unreadable};
use super::images::Format;
use super::meshopt;
use crate::scene::Image;
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Most that a scene may ask for. A file beyond a limit is refused before anything of that size is allocated.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Bytes of the scene file.
    pub file_bytes: u64,
    /// Bytes of its JSON part.
    pub json_bytes: u64,
    /// Bytes of all buffers together.
    pub buffer_bytes: u64,
    /// Encoded bytes of all images together.
    pub image_bytes: u64,
    /// Pixels along one side of an image.
    pub image_side: u32,
    /// Pixels of all images together.
    pub image_pixels: u64,
    /// Triangles of the scene, every instance counted.
    pub triangles: u64,
    /// Instances of one node.
    pub instances: u64,
    /// Entries of an accessor that stores nothing (all zero, or sparse).
    pub implicit_count: u64,
    /// Levels of nodes below a root.
    pub depth: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 4 << 30,
            json_bytes: 512 << 20,
            buffer_bytes: 2 << 30,
            image_bytes: 1 << 30,
            image_side: 16384,
            image_pixels: 256 << 20,
            triangles: 100_000_000,
            instances: 1 << 20,
            implicit_count: 1 << 22,
            depth: 1000,
        }
    }
}

const REFERENCE: &str = "name a file in the scene's folder, or pack everything into one .glb";
const SMALLER: &str = "split the scene or make it smaller";

/// Where the files are that the scene names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Neighbors {
    /// In the scene's folder.
    Folder,
    /// Nowhere: the scene is in memory.
    None,
}

/// Reads what the scene names, and hashes it in order of reading.
pub(super) struct Resources<'a> {
    source: &'a Source,
    limits: &'a Limits,
    neighbors: Neighbors,
    /// The scene's folder; resolved when the first file is asked for.
    folder: Option<PathBuf>,
    hasher: blake3::Hasher,
    encoded_bytes: u64,
    pixels: u64,
}

impl<'a> Resources<'a> {
    /// `bytes` is the whole scene file.
    pub fn new(source: &'a Source, limits: &'a Limits, bytes: &[u8], neighbors: Neighbors) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytes);
        Self { source, limits, neighbors, folder: None, hasher, encoded_bytes: 0, pixels: 0 }
    }

    /// Hash of everything read.
    pub fn hash(&self) -> [u8; 32] {
        *self.hasher.finalize().as_bytes()
    }

    /// All buffers, each exactly as long as it says; empty where views hold all that it would.
    pub fn buffers<'b>(&mut self, document: &Document, bin: Option<&'b [u8]>) -> Result<Vec<Cow<'b, [u8]>>, LoadError> {
        let placeholders = meshopt::placeholders(document);
        let mut total: u64 = 0;
        let mut buffers = Vec::new();
        for (index, buffer) in document.buffers.iter().enumerate() {
            let place = pointer("buffers", index);
            let length = buffer.byte_length.0;
            total = total.saturating_add(length);
            if total > self.limits.buffer_bytes {
                let found = format!("{total} bytes of buffers");
                return Err(self.source.too_large(place, found, self.limits.buffer_bytes, SMALLER));
            }
            if placeholders[index] {
                buffers.push(Cow::Borrowed(&[][..]));
                continue;
            }
            let (mut bytes, what) = match (&buffer.uri, bin) {
                (Some(uri), _) => {
                    let place = format!("{place}/uri");
                    (Cow::Owned(self.read_uri(&place, uri, Amount::First(length))?), "its uri")
                }
                (None, Some(bin)) if index == 0 => (Cow::Borrowed(bin), "the GLB's binary chunk"),
                (None, _) => {
                    let found = "a buffer without uri that is not the GLB's binary chunk";
                    return Err(self.source.invalid(place, found, REFERENCE));
                }
            };
            let present = bytes.len() as u64;
            if present < length {
                let found = format!("byteLength {length}, but {what} holds {present} bytes");
                return Err(self.source.invalid(place, found, "copy or export the scene again"));
            }
            match &mut bytes {
                Cow::Borrowed(bytes) => *bytes = &bytes[..length as usize],
                Cow::Owned(bytes) => bytes.truncate(length as usize),
            }
            buffers.push(bytes);
        }
        Ok(buffers)
    }

    /// Reads and decodes one image.
    pub fn image(&mut self, document: &Document, views: &[View<'_>], index: usize) -> Result<Image, LoadError> {
        let place = pointer("images", index);
        let image = &document.images[index];
        let uri = image.uri.as_deref();
        let file_name = uri.filter(|uri| !uri.starts_with("data:")).and_then(|uri| uri.rsplit('/').next());
        let name = match (&image.name, file_name) {
            (Some(name), _) if !name.is_empty() => name.clone(),
            (_, Some(file)) => percent_encoding::percent_decode_str(file).decode_utf8_lossy().into_owned(),
            _ => format!("image_{index}"),
        };
        let limit = self.limits.image_bytes - self.encoded_bytes;
        let encoded = match (uri, image.buffer_view) {
            (Some(uri), _) => self.read_uri(&format!("{place}/uri"), uri, Amount::All { limit })?,
            (None, Some(view)) => views[view.value()].bytes.to_vec(),
            (None, None) => {
                return Err(self.source.invalid(place, "an image with neither uri nor bufferView", REFERENCE));
            }
        };
        if encoded.len() as u64 > limit {
            let found = format!("{} bytes of images", self.encoded_bytes + encoded.len() as u64);
            return Err(self.source.too_large(place, found, self.limits.image_bytes, "scale images down"));
        }
        self.encoded_bytes += encoded.len() as u64;
        self.decode(&place, name, encoded)
    }

    fn decode(&mut self, place: &str, name: String, encoded: Vec<u8>) -> Result<Image, LoadError> {
        let format = match Format::of(&encoded) {
            Some(format) => format,
            None => return Err(self.other_format(place, &name, &encoded)),
        };
        let broken = |reason: String| {
            self.source.resource(place, &name, reason, "save the image again as PNG or JPEG, or remove its texture")
        };
        let (width, height) = format.size(&encoded).map_err(broken)?;
        let pixels = self.pixels.saturating_add(u64::from(width) * u64::from(height));
        let side = self.limits.image_side;
        if width > side || height > side {
            let found = format!("image {name:?} of {width} x {height} pixels");
            return Err(self.source.too_large(place, found, u64::from(side), "scale the image down"));
        }
        if pixels > self.limits.image_pixels {
            let found = format!("{pixels} pixels in all images up to {name:?}");
            return Err(self.source.too_large(place, found, self.limits.image_pixels, "scale images down"));
        }
        let rgba = format.pixels(&encoded, [width, height], side).map_err(broken)?;
        self.pixels = pixels;
        let encoded = format.mime().map(|mime| (mime.into(), encoded));
        Ok(Image { name, width, height, rgba, encoded })
    }

    fn other_format(&self, place: &str, name: &str, encoded: &[u8]) -> LoadError {
        let (format, extension) = match encoded {
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => ("WebP", "EXT_texture_webp"),
            [0xab, b'K', b'T', b'X', ..] => ("KTX2", "KHR_texture_basisu"),
            [b'D', b'D', b'S', b' ', ..] => ("DDS", "MSFT_texture_dds"),
            _ => {
                return self.source.resource(
                    place,
                    name,
                    "neither PNG nor JPEG nor another format that is read",
                    "save the image as PNG or JPEG",
                );
            }
        };
        self.source.unsupported(place, format!("image {name:?} in {format} format"), remedy_for(extension))
    }

    /// Bytes behind an address: a data URI, or a file in the scene's folder.
    fn read_uri(&mut self, place: &str, uri: &str, amount: Amount) -> Result<Vec<u8>, LoadError> {
        if let Some(data) = uri.strip_prefix("data:") {
            return self.decode_data_uri(place, uri, data);
        }
        let path = self.resolve(place, uri)?;
        let bytes = match read_regular_file(&path, amount) {
            Ok(bytes) => bytes,
            Err(ReadError::NotRegular) => {
                return Err(self.source.resource(place, uri, "it is not a regular file", REFERENCE));
            }
            Err(ReadError::TooLarge { length, limit }) => {
                return Err(self.source.too_large(
                    place,
                    format!("{length} bytes in {}", path.display()),
                    limit,
                    SMALLER,
                ));
            }
            Err(ReadError::Io(cause)) => return Err(unreadable(path, &cause)),
        };
        self.hasher.update(&bytes);
        Ok(bytes)
    }

    fn decode_data_uri(&self, place: &str, uri: &str, data: &str) -> Result<Vec<u8>, LoadError> {
        const ENGINE: GeneralPurpose = GeneralPurpose::new(
            &base64::alphabet::STANDARD,
            GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
        );
        let broken = |reason: String| self.source.resource(place, uri, reason, "export the scene again");
        let (head, body) = data.split_once(',').ok_or_else(|| broken("a data URI without a comma".into()))?;
        if !head.ends_with(";base64") {
            return Err(broken("a data URI that is not base64".into()));
        }
        ENGINE.decode(body).map_err(|error| broken(format!("broken base64: {error}")))
    }

    /// The canonical path of a relative reference, which must lie in the scene's folder.
    fn resolve(&mut self, place: &str, uri: &str) -> Result<PathBuf, LoadError> {
        let source = self.source;
        if self.neighbors == Neighbors::None {
            let reason = "a scene in memory reads no other files";
            return Err(source.resource(place, uri, reason, "pack everything into one .glb"));
        }
        let refused = |reason: &str| source.resource(place, uri, reason, REFERENCE);
        let scheme = uri.split_once(':').map(|(scheme, _)| scheme).filter(|scheme| {
            scheme.starts_with(|first: char| first.is_ascii_alphabetic())
                && scheme.chars().all(|each| each.is_ascii_alphanumeric() || "+-.".contains(each))
        });
        if let Some(scheme) = scheme {
            return Err(refused(&format!("addresses with the scheme {scheme}: are not read")));
        }
        let decoded = percent_encoding::percent_decode_str(uri)
            .decode_utf8()
            .map_err(|_| refused("its percent-encoding does not give UTF-8"))?;
        if decoded.contains(['\0', '\\']) {
            return Err(refused("it contains a backslash or a zero byte, folders are separated by /"));
        }
        let relative = Path::new(decoded.as_ref());
        if decoded.is_empty() || decoded.ends_with('/') {
            return Err(refused("it names no file"));
        }
        for component in relative.components() {
            match component {
                Component::Normal(_) | Component::CurDir => {}
                Component::ParentDir => return Err(refused("it leads out of the scene's folder by ..")),
                Component::RootDir | Component::Prefix(_) => return Err(refused("it is an absolute path")),
            }
        }
        let folder = match &self.folder {
            Some(folder) => folder,
            None => {
                let parent = source.file.parent().filter(|parent| !parent.as_os_str().is_empty());
                let parent = parent.unwrap_or(Path::new("."));
                let folder = parent.canonicalize().map_err(|cause| unreadable(parent.to_owned(), &cause))?;
                self.folder.insert(folder)
            }
        };
        let joined = folder.join(relative);
        let path = joined.canonicalize().map_err(|cause| match cause.kind() {
            io::ErrorKind::PermissionDenied => unreadable(joined, &cause),
            io::ErrorKind::NotFound => source.resource(place, uri, "there is no such file", "put it beside the scene"),
            _ => source.resource(place, uri, cause.to_string(), REFERENCE),
        })?;
        if !path.starts_with(folder) {
            return Err(refused("a symbolic link leads it out of the scene's folder"));
        }
        Ok(path)
    }
}

/// The file that an address names, unchecked; `None` of a data URI.
pub(super) fn file_named(source: &Source, uri: &str) -> Option<PathBuf> {
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8().ok()?;
    (!uri.starts_with("data:")).then(|| source.file.with_file_name(decoded.as_ref()))
}

/// Reads the scene file itself.
pub(super) fn read_scene_file(source: &Source, limits: &Limits) -> Result<Vec<u8>, LoadError> {
    read_regular_file(&source.file, Amount::All { limit: limits.file_bytes }).map_err(|error| match error {
        ReadError::NotRegular => source.container("not a regular file", "give the path of a .gltf or .glb file"),
        ReadError::TooLarge { length, limit } => source.too_large("/", format!("{length} bytes"), limit, SMALLER),
        ReadError::Io(cause) => unreadable(source.file.clone(), &cause),
    })
}

/// Refuses a scene of too many bytes.
pub(super) fn check_scene_length(source: &Source, limits: &Limits, length: u64) -> Result<(), LoadError> {
    if length > limits.file_bytes {
        return Err(source.too_large("/", format!("{length} bytes"), limits.file_bytes, SMALLER));
    }
    Ok(())
}

/// How much of a file is read.
#[derive(Clone, Copy)]
enum Amount {
    /// The first bytes; the rest is of no interest.
    First(u64),
    /// Everything, refused beyond the limit.
    All { limit: u64 },
}

enum ReadError {
    NotRegular,
    TooLarge { length: u64, limit: u64 },
    Io(io::Error),
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

fn read_regular_file(path: &Path, amount: Amount) -> Result<Vec<u8>, ReadError> {
    // Asked before opening, because opening a FIFO would wait for its writer.
    if !fs::metadata(path)?.is_file() {
        return Err(ReadError::NotRegular);
    }
    let file = fs::File::open(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(ReadError::NotRegular);
    }
    // Files of /proc have length 0 and grow while being read, so the limit is enforced on what was read.
    let most = match amount {
        Amount::First(wanted) => wanted,
        Amount::All { limit } => limit.saturating_add(1),
    };
    match amount {
        Amount::All { limit } if metadata.len() > limit => {
            return Err(ReadError::TooLarge { length: metadata.len(), limit });
        }
        _ => {}
    }
    let mut bytes = Vec::with_capacity(metadata.len().min(most) as usize);
    file.take(most).read_to_end(&mut bytes)?;
    match amount {
        Amount::All { limit } if bytes.len() as u64 > limit => {
            Err(ReadError::TooLarge { length: bytes.len() as u64, limit })
        }
        _ => Ok(bytes),
    }
}
