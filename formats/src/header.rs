//! Header and section table: what lies where, and rules 1 to 21 of `SPEC.md`, all checked without reading a payload.

use crate::error::OpenError;
use crate::section::{Scalar, SectionInfo, SectionKind};

/// First bytes of every file: not ASCII, the name, and line ends that a transfer as text would change.
pub const MAGIC: [u8; 8] = *b"\x89LPR\r\n\x1a\n";
/// Major version this crate reads and writes; others are refused.
pub const VERSION_MAJOR: u16 = 2;
/// Minor version this crate writes; any is read.
pub const VERSION_MINOR: u16 = 1;
/// Bytes of the header.
pub const HEADER_BYTES: usize = 64;
/// Bytes of one entry of the section table.
pub const ENTRY_BYTES: usize = 48;
/// Sections start at multiples of this, the largest storage binding alignment WebGPU allows.
pub const ALIGNMENT: u64 = 256;
/// Most sections: far above need, and keeps the table small.
pub const MAX_SECTIONS: u32 = 256;

/// The header's checksum covers header and table but for itself, the last four bytes of the header.
const CHECKSUM_AT: usize = 60;

impl SectionInfo {
    /// Whether this crate reads the section; unknown optional ones are skipped.
    pub fn is_known(&self) -> bool {
        known_section(self.kind).is_some_and(|(_, layout)| layout.version == self.version)
    }
}

/// Sections of format version 2, in the order in which they are written. The discriminant is the place in [`LAYOUTS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    Metadata,
    Probes,
    RayDirs,
    RaySh,
    RayUv,
    RayLevel,
    RayDistance,
    ReceiverTexel,
    ReceiverPosition,
    ReceiverNormal,
    ReceiverUnseen,
    Blocks,
    BlockData,
    Gutters,
    Seams,
    Volume,
    VolumeCells,
    VolumeBlocks,
    VolumeBlockData,
    VolumeFill,
    Report,
    Plan,
}

/// How a known section is described.
pub(crate) struct Layout {
    pub known: Known,
    pub kind: SectionKind,
    pub version: u16,
    pub scalar: Scalar,
    pub components: u16,
    /// Whether every file has it, and readers that do not know it must refuse the file.
    pub required: bool,
}

const fn layout(known: Known, kind: &[u8; 4], scalar: Scalar, components: u16) -> Layout {
    Layout { known, kind: SectionKind(*kind), version: 1, scalar, components, required: true }
}

const fn optional(known: Known, kind: &[u8; 4], scalar: Scalar, components: u16) -> Layout {
    Layout { required: false, ..layout(known, kind, scalar, components) }
}

/// Descriptions of all known sections, by [`Known`], in the order in which they are written.
pub(crate) const LAYOUTS: [Layout; 22] = [
    layout(Known::Metadata, b"META", Scalar::U8, 1),
    layout(Known::Probes, b"PROB", Scalar::F32, 4),
    layout(Known::RayDirs, b"RDIR", Scalar::F32, 4),
    layout(Known::RaySh, b"RASH", Scalar::F32, 1),
    layout(Known::RayUv, b"RAUV", Scalar::U32, 1),
    layout(Known::RayLevel, b"RALV", Scalar::U8, 1),
    optional(Known::RayDistance, b"RADS", Scalar::F16, 1),
    layout(Known::ReceiverTexel, b"RTEX", Scalar::U32, 1),
    layout(Known::ReceiverPosition, b"RPOS", Scalar::F32, 3),
    layout(Known::ReceiverNormal, b"RNRM", Scalar::F32, 3),
    layout(Known::ReceiverUnseen, b"RUNS", Scalar::F32, 1),
    layout(Known::Blocks, b"BLOK", Scalar::U32, 32),
    layout(Known::BlockData, b"BDAT", Scalar::U32, 1),
    layout(Known::Gutters, b"GUTR", Scalar::U32, 2),
    layout(Known::Seams, b"SEAM", Scalar::U32, 2),
    optional(Known::Volume, b"VOLU", Scalar::U32, 8),
    optional(Known::VolumeCells, b"VCEL", Scalar::U32, 1),
    optional(Known::VolumeBlocks, b"VBLK", Scalar::U32, 32),
    optional(Known::VolumeBlockData, b"VDAT", Scalar::U32, 1),
    optional(Known::VolumeFill, b"VFIL", Scalar::U32, 2),
    optional(Known::Report, b"REPT", Scalar::U8, 1),
    optional(Known::Plan, b"PLAN", Scalar::U8, 1),
];

fn known_section(kind: SectionKind) -> Option<(usize, &'static Layout)> {
    LAYOUTS.iter().enumerate().find(|(_, layout)| layout.kind == kind)
}

/// Sections of a volume: all of them or none.
pub(crate) const VOLUME: [Known; 5] =
    [Known::Volume, Known::VolumeCells, Known::VolumeBlocks, Known::VolumeBlockData, Known::VolumeFill];

/// A checked header with its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub minor: u16,
    pub content_hash: [u8; 32],
    pub sections: Vec<SectionInfo>,
    /// Entry of `sections` of each known section, by [`Known`].
    pub known: [Option<usize>; LAYOUTS.len()],
}

impl Header {
    /// Reads and checks header, table and padding of a whole file.
    pub fn parse(file: &[u8]) -> Result<Self, OpenError> {
        let present = file.len() as u64;
        let truncated = |needed: usize| OpenError::Truncated { needed: needed as u64, present };
        let head = file.get(..HEADER_BYTES).ok_or_else(|| truncated(HEADER_BYTES))?;
        if head[..8] != MAGIC {
            return Err(OpenError::WrongMagic { found: bytes_at(head, 0) });
        }
        let (major, minor) = (u16_at(head, 8), u16_at(head, 10));
        if major != VERSION_MAJOR {
            return Err(OpenError::UnsupportedVersion { major, minor, supported: VERSION_MAJOR });
        }
        let n_sections = u32_at(head, 12);
        if n_sections == 0 || n_sections > MAX_SECTIONS {
            return Err(OpenError::SectionCount { found: n_sections, allowed: MAX_SECTIONS });
        }
        let stated = u64_at(head, 16);
        if stated != present {
            return Err(OpenError::WrongLength { stated, present });
        }
        let head_bytes = HEADER_BYTES + n_sections as usize * ENTRY_BYTES;
        let table = file.get(HEADER_BYTES..head_bytes).ok_or_else(|| truncated(head_bytes))?;
        let (stated, computed) = (u32_at(head, CHECKSUM_AT), checksum(head, table));
        if stated != computed {
            return Err(OpenError::HeaderChecksum { stated, computed });
        }
        let reserved = u32_at(head, 56);
        if reserved != 0 {
            return Err(OpenError::ReservedNotZero { place: "header".into(), found: reserved.into() });
        }
        let mut header = Self {
            minor,
            content_hash: bytes_at(head, 24),
            sections: Vec::with_capacity(n_sections as usize),
            known: [None; LAYOUTS.len()],
        };
        let mut end = head_bytes as u64;
        for (index, entry) in table.chunks_exact(ENTRY_BYTES).enumerate() {
            let section = parse_entry(index as u32, entry)?;
            if header.sections.iter().any(|other| other.kind == section.kind) {
                return Err(OpenError::DuplicateSection { section: section.kind });
            }
            end = check_place(&section, end, file)?;
            header.sections.push(section);
        }
        if let Some(last) = header.sections.last()
            && end != present
        {
            return Err(OpenError::WrongEnd { section: last.kind, end, present });
        }
        header.find_known()?;
        Ok(header)
    }

    /// Rules 18 to 21.
    fn find_known(&mut self) -> Result<(), OpenError> {
        for (index, section) in self.sections.iter().enumerate() {
            let Some((known, layout)) = known_section(section.kind) else {
                if section.required {
                    return Err(OpenError::UnknownRequiredSection { section: section.kind, version: section.version });
                }
                continue;
            };
            if section.version != layout.version {
                if section.required || layout.required {
                    let (section, found) = (section.kind, section.version);
                    return Err(OpenError::SectionVersion { section, found, supported: layout.version });
                }
                continue;
            }
            let found = describe(section.scalar, section.components, section.required);
            let expected = describe(layout.scalar, layout.components, layout.required);
            if found != expected {
                return Err(OpenError::WrongElementType { section: section.kind, found, expected });
            }
            self.known[known] = Some(index);
        }
        match LAYOUTS.iter().zip(&self.known).find(|(layout, found)| layout.required && found.is_none()) {
            Some((layout, _)) => Err(OpenError::MissingSection { section: layout.kind }),
            None => Ok(()),
        }
    }
}

/// Header and table as bytes; `content_hash` takes the table.
pub(crate) fn encode(
    sections: &[SectionInfo],
    file_bytes: u64,
    content_hash: impl FnOnce(&[u8]) -> [u8; 32],
) -> Vec<u8> {
    let mut table = Vec::with_capacity(sections.len() * ENTRY_BYTES);
    for section in sections {
        table.extend(section.kind.0);
        table.extend(section.version.to_le_bytes());
        table.extend(u16::from(section.required).to_le_bytes());
        table.extend((section.scalar as u16).to_le_bytes());
        table.extend(section.components.to_le_bytes());
        table.extend(section.checksum.to_le_bytes());
        table.extend(section.count.to_le_bytes());
        table.extend(section.offset.to_le_bytes());
        table.extend(section.length.to_le_bytes());
        table.extend(0u64.to_le_bytes());
    }
    let mut head = Vec::with_capacity(HEADER_BYTES + table.len());
    head.extend(MAGIC);
    head.extend(VERSION_MAJOR.to_le_bytes());
    head.extend(VERSION_MINOR.to_le_bytes());
    head.extend((sections.len() as u32).to_le_bytes());
    head.extend(file_bytes.to_le_bytes());
    head.extend(content_hash(&table));
    head.extend(0u32.to_le_bytes());
    head.extend(checksum(&head, &table).to_le_bytes());
    head.extend(table);
    head
}

/// First multiple of [`ALIGNMENT`] at or after `offset`.
pub(crate) fn align(offset: u64) -> Option<u64> {
    offset.checked_next_multiple_of(ALIGNMENT)
}

fn checksum(head: &[u8], table: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&head[..CHECKSUM_AT]), table)
}

/// Rules 6 and 10 to 14.
fn parse_entry(index: u32, entry: &[u8]) -> Result<SectionInfo, OpenError> {
    let kind = SectionKind(bytes_at(entry, 0));
    if !kind.0.iter().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit()) {
        return Err(OpenError::BadKind { index, found: kind.0 });
    }
    let flags = u16_at(entry, 6);
    if flags > 1 {
        return Err(OpenError::UnknownFlags { section: kind, found: flags });
    }
    let (code, components) = (u16_at(entry, 8), u16_at(entry, 10));
    let scalar = match Scalar::from_code(code) {
        Some(scalar) if components > 0 => scalar,
        _ => return Err(OpenError::UnknownElementType { section: kind, scalar: code, components }),
    };
    let (count, length) = (u64_at(entry, 16), u64_at(entry, 32));
    let element_bytes = scalar.bytes() * u64::from(components);
    if count.checked_mul(element_bytes) != Some(length) {
        return Err(OpenError::SectionLength { section: kind, count, element_bytes, found: length });
    }
    let reserved = u64_at(entry, 40);
    if reserved != 0 {
        return Err(OpenError::ReservedNotZero { place: format!("section {kind}"), found: reserved });
    }
    Ok(SectionInfo {
        kind,
        version: u16_at(entry, 4),
        required: flags == 1,
        scalar,
        components,
        count,
        offset: u64_at(entry, 24),
        length,
        checksum: u32_at(entry, 12),
    })
}

/// Rules 15 to 17: the section starts at the first aligned byte after `previous_end`; returns its own end.
fn check_place(section: &SectionInfo, previous_end: u64, file: &[u8]) -> Result<u64, OpenError> {
    let present = file.len() as u64;
    let expected = align(previous_end).unwrap_or(u64::MAX);
    if section.offset != expected {
        return Err(OpenError::Misplaced { section: section.kind, found: section.offset, expected });
    }
    let end = section.offset.saturating_add(section.length);
    if end > present {
        return Err(OpenError::WrongEnd { section: section.kind, end, present });
    }
    // Both fit: previous_end <= offset <= end <= file length.
    let padding = &file[previous_end as usize..section.offset as usize];
    match padding.iter().position(|byte| *byte != 0) {
        Some(place) => Err(OpenError::PaddingNotZero { offset: previous_end + place as u64, found: padding[place] }),
        None => Ok(end),
    }
}

fn describe(scalar: Scalar, components: u16, required: bool) -> String {
    format!("{scalar} x {components}, {}", if required { "required" } else { "optional" })
}

/// `N` bytes from `at`; callers pass slices of a checked size.
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut value = [0; N];
    value.copy_from_slice(&bytes[at..at + N]);
    value
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(bytes, at))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, at))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes_at(bytes, at))
}
