//! Opening a file: map or copy, check everything a reader relies on, hand out slices. Holds the crate's only `unsafe`.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytemuck::Pod;

use crate::baked::{BakedView, Metadata, VolumeGrid, VolumeView};
use crate::block::Blocks;
use crate::check::{check_invariants, check_tables};
use crate::error::{OpenError, Violation};
use crate::header::{HEADER_BYTES, Header, Known, LAYOUTS, VOLUME};
use crate::metadata;
use crate::section::SectionInfo;
use crate::transport::{Block, Checked, block};

#[cfg(target_endian = "big")]
compile_error!("files are little-endian and read in place; big-endian hosts are not supported");

/// An opened file. Its slices have been checked, but for what is in the blocks of transport: counts agree, every index is in
/// range, every number is finite. [`Baked::checked`] and [`Baked::block`] check blocks. Clones share what was read.
#[derive(Clone)]
pub struct Baked {
    bytes: Arc<Bytes>,
    header: Header,
    metadata: Metadata,
    /// Where each known section lies, by [`Known`]; empty for an absent one.
    ranges: [Range<usize>; LAYOUTS.len()],
    /// Copied, so that a mapped file that changes underneath cannot make it invalid UTF-8.
    report: String,
    plan: String,
}

impl Baked {
    /// Maps the file and checks structure, ranges, counts and every index outside of the blocks of transport, whose bytes are
    /// not read; nor the payload checksums, which [`crate::check()`] verifies.
    ///
    /// The file must not be changed or truncated in place while it is open; replacing it by renaming, as
    /// [`crate::write()`] does, is fine. Where others can write to it, use [`Baked::open_copied`].
    ///
    /// # Errors
    /// [`OpenError::Io`], or the variant of the first broken rule of `SPEC.md`.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, OpenError> {
        Self::from_checked(map(path.as_ref())?)
    }

    /// As [`Baked::open`], but reads the file into memory: for storage that others may change at any time.
    ///
    /// # Errors
    /// As [`Baked::open`].
    pub fn open_copied(path: impl AsRef<Path>) -> Result<Self, OpenError> {
        let path = path.as_ref();
        Self::from_checked(read(path).map_err(|source| OpenError::Io { path: path.into(), source })?)
    }

    /// As [`Baked::open`], from a file's bytes; copies them once to align them.
    ///
    /// # Errors
    /// As [`Baked::open`], without [`OpenError::Io`].
    pub fn from_bytes(file: Vec<u8>) -> Result<Self, OpenError> {
        Self::from_checked(Bytes::copy_of(&file))
    }

    fn from_checked(bytes: Bytes) -> Result<Self, OpenError> {
        let file = bytes.as_slice();
        let header = Header::parse(file)?;
        let ranges = section_ranges(&header)?;
        let metadata = metadata::decode(&file[ranges[Known::Metadata as usize].clone()])?;
        let [report, plan] = texts(file, &ranges)?.map(str::to_owned);
        check_tables(&view(file, &ranges, &metadata, [&report, &plan]))?;
        Ok(Self { bytes: Arc::new(bytes), header, metadata, ranges, report, plan })
    }

    /// All arrays.
    pub fn view(&self) -> BakedView<'_> {
        view(self.bytes.as_slice(), &self.ranges, &self.metadata, [&self.report, &self.plan])
    }

    /// The file with every block of transport checked: what relighters take.
    ///
    /// # Errors
    /// [`OpenError::Invalid`] with the first broken rule of a block.
    pub fn checked(&self) -> Result<Checked<'_>, OpenError> {
        Ok(Checked::of_tables(self.view())?)
    }

    /// One block of the lightmap's transport, checked: for readers that do not need all of them at once. Its lights are numbered from
    /// the block's first.
    ///
    /// # Errors
    /// [`OpenError::Invalid`] with the broken rule.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn block(&self, index: usize) -> Result<Block<'_>, OpenError> {
        let view = self.view();
        let before = Blocks { records: &view.blocks.records[..index], ..view.blocks };
        let first_receiver = before.total(|block| block.n_receivers) as usize;
        Ok(block(view.blocks, index, first_receiver, 0, view.shape())?)
    }

    /// Facts of the bake.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The stated BLAKE3 of all payloads and the section table: two files with the same hash hold the same data.
    pub fn content_hash(&self) -> [u8; 32] {
        self.header.content_hash
    }

    /// Format version, major and minor.
    pub fn version(&self) -> (u16, u16) {
        (crate::header::VERSION_MAJOR, self.header.minor)
    }

    /// The section table, in file order, unknown optional sections included.
    pub fn sections(&self) -> &[SectionInfo] {
        &self.header.sections
    }

    /// Bytes of the file.
    pub fn file_bytes(&self) -> u64 {
        self.bytes.as_slice().len() as u64
    }
}

impl fmt::Debug for Baked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("Baked");
        out.field("file_bytes", &self.file_bytes()).field("metadata", &self.metadata);
        out.field("sections", &self.header.sections).finish_non_exhaustive()
    }
}

/// Every broken rule that can be told from the others; empty if the file is sound.
pub(crate) fn check_file(file: &[u8]) -> Vec<OpenError> {
    // Views need aligned bytes; a slice from outside may not be.
    let copy;
    let file = if (file.as_ptr() as usize).is_multiple_of(align_of::<u64>()) {
        file
    } else {
        copy = Bytes::copy_of(file);
        copy.as_slice()
    };
    let header = match Header::parse(file) {
        Ok(header) => header,
        Err(error) => return vec![error],
    };
    let mut errors = Vec::new();
    let mut hasher = blake3::Hasher::new();
    for section in &header.sections {
        let payload = &file[section_range(section)];
        hasher.update(payload);
        let computed = crc32c::crc32c(payload);
        if computed != section.checksum {
            errors.push(OpenError::SectionChecksum { section: section.kind, stated: section.checksum, computed });
        }
    }
    let table_bytes = header.sections.len() * crate::header::ENTRY_BYTES;
    hasher.update(&file[HEADER_BYTES..HEADER_BYTES + table_bytes]);
    if *hasher.finalize().as_bytes() != header.content_hash {
        errors.push(OpenError::ContentHash);
    }
    let checked = section_ranges(&header).map_err(OpenError::from).and_then(|ranges| {
        let metadata = metadata::decode(&file[ranges[Known::Metadata as usize].clone()])?;
        let texts = texts(file, &ranges)?;
        Ok(check_invariants(&view(file, &ranges, &metadata, texts))?)
    });
    errors.extend(checked.err());
    errors
}

/// Maps a file for reading.
pub(crate) fn map(path: &Path) -> Result<Bytes, OpenError> {
    let open = || {
        let (file, length) = open_regular(path)?;
        // An empty file cannot be mapped on every system; its error is that it is cut off.
        if length == 0 {
            return Ok(Bytes::copy_of(&[]));
        }
        // SAFETY: the mapping is private and read-only, and lives as long as the slices borrowed from it. Nothing in
        // this crate changes a file in place. That no one else does so while it is open is the caller's part, stated at
        // `Baked::open`; `Baked::open_copied` is there for callers who cannot tell.
        #[allow(unsafe_code)]
        let mapped = unsafe { memmap2::Mmap::map(&file)? };
        Ok(Bytes::Mapped(mapped))
    };
    open().map_err(|source| OpenError::Io { path: path.into(), source })
}

/// Opening something that is not a regular file could wait for ever.
fn open_regular(path: &Path) -> io::Result<(File, u64)> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    Ok((file, length))
}

/// Reads a whole file into aligned memory.
fn read(path: &Path) -> io::Result<Bytes> {
    let (mut file, length) = open_regular(path)?;
    let length = usize::try_from(length).map_err(|_| io::ErrorKind::OutOfMemory)?;
    // The first bytes tell whether the rest is worth reading.
    let mut head = [0; HEADER_BYTES];
    let head = &mut head[..length.min(HEADER_BYTES)];
    file.read_exact(head)?;
    if head.len() < HEADER_BYTES || head[..8] != crate::header::MAGIC {
        return Ok(Bytes::copy_of(head));
    }
    let mut words = Vec::new();
    words.try_reserve_exact(length.div_ceil(8)).map_err(|_| io::ErrorKind::OutOfMemory)?;
    words.resize(length.div_ceil(8), 0u64);
    let bytes = &mut bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..length];
    bytes[..HEADER_BYTES].copy_from_slice(head);
    file.read_exact(&mut bytes[HEADER_BYTES..])?;
    Ok(Bytes::Copied { words, length })
}

/// A file's bytes, aligned to 8 or more.
pub(crate) enum Bytes {
    Mapped(memmap2::Mmap),
    Copied { words: Vec<u64>, length: usize },
}

impl Bytes {
    fn copy_of(bytes: &[u8]) -> Self {
        let mut words = vec![0u64; bytes.len().div_ceil(8)];
        bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self::Copied { words, length: bytes.len() }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        match self {
            Self::Mapped(mapped) => mapped,
            Self::Copied { words, length } => &bytemuck::cast_slice(words)[..*length],
        }
    }
}

/// Bytes of a section; [`Header::parse`] has checked that they lie in the file, hence in memory.
fn section_range(section: &SectionInfo) -> Range<usize> {
    section.offset as usize..(section.offset + section.length) as usize
}

/// Where each known section lies. Those of a volume are there together or not at all (rule 70); one of them that is skipped
/// for its version takes the others with it.
fn section_ranges(header: &Header) -> Result<[Range<usize>; LAYOUTS.len()], Violation> {
    let mut ranges = header.known.map(|index| index.map_or(0..0, |index| section_range(&header.sections[index])));
    let listed = |known: &&Known| header.sections.iter().any(|section| section.kind == LAYOUTS[**known as usize].kind);
    let present = VOLUME.iter().filter(listed).count();
    if present != 0 && present != VOLUME.len() {
        let message = format!("volume: {present} of its {} sections are present", VOLUME.len());
        return Err(Violation { rule: 70, message });
    }
    if VOLUME.iter().any(|known| header.known[*known as usize].is_none()) {
        VOLUME.iter().for_each(|known| ranges[*known as usize] = 0..0);
    } else if ranges[Known::Volume as usize].len() != size_of::<VolumeGrid>() {
        let message = "volume: VOLU does not have exactly one element".into();
        return Err(Violation { rule: 70, message });
    }
    Ok(ranges)
}

/// Report and plan.
fn texts<'a>(file: &'a [u8], ranges: &[Range<usize>; LAYOUTS.len()]) -> Result<[&'a str; 2], Violation> {
    let text = |known: Known, name: &str| {
        let bytes = &file[ranges[known as usize].clone()];
        let refusal = |error| Violation { rule: 62, message: format!("{name}: not UTF-8: {error}") };
        std::str::from_utf8(bytes).map_err(refusal)
    };
    Ok([text(Known::Report, "report")?, text(Known::Plan, "plan")?])
}

fn view<'a>(
    file: &'a [u8],
    ranges: &[Range<usize>; LAYOUTS.len()],
    metadata: &'a Metadata,
    [report, plan]: [&'a str; 2],
) -> BakedView<'a> {
    BakedView {
        metadata,
        probes: slice(file, ranges, Known::Probes),
        ray_dirs: slice(file, ranges, Known::RayDirs),
        ray_sh: slice(file, ranges, Known::RaySh),
        ray_uv: slice(file, ranges, Known::RayUv),
        ray_level: slice(file, ranges, Known::RayLevel),
        ray_distance: slice(file, ranges, Known::RayDistance),
        receiver_texel: slice(file, ranges, Known::ReceiverTexel),
        receiver_position: slice(file, ranges, Known::ReceiverPosition),
        receiver_normal: slice(file, ranges, Known::ReceiverNormal),
        receiver_unseen: slice(file, ranges, Known::ReceiverUnseen),
        blocks: blocks(file, ranges, Known::Blocks, Known::BlockData),
        gutters: slice(file, ranges, Known::Gutters),
        seams: slice(file, ranges, Known::Seams),
        volume: slice(file, ranges, Known::Volume).first().map(|grid| VolumeView {
            grid,
            cells: slice(file, ranges, Known::VolumeCells),
            blocks: blocks(file, ranges, Known::VolumeBlocks, Known::VolumeBlockData),
            fill: slice(file, ranges, Known::VolumeFill),
        }),
        report,
        plan,
    }
}

fn blocks<'a>(file: &'a [u8], ranges: &[Range<usize>; LAYOUTS.len()], table: Known, data: Known) -> Blocks<'a> {
    Blocks { records: slice(file, ranges, table), data: slice(file, ranges, data) }
}

/// A section's elements in place: the file is aligned to 8, sections to 256, and lengths are whole elements (rule 14).
fn slice<'a, T: Pod>(file: &'a [u8], ranges: &[Range<usize>; LAYOUTS.len()], known: Known) -> &'a [T] {
    bytemuck::cast_slice(&file[ranges[known as usize].clone()])
}
