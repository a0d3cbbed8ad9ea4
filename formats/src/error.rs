//! What can be wrong with a file, and with writing one. Numbers of rules are those of `SPEC.md`.

use std::fmt;
use std::io;
use std::path::PathBuf;

use crate::section::SectionKind;

/// A broken rule of `SPEC.md`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Number of the rule.
    pub rule: u16,
    /// Place, what was found, what is allowed.
    pub message: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rule {}: {}", self.rule, self.message)
    }
}

impl std::error::Error for Violation {}

pub(crate) fn fail<T>(rule: u16, message: String) -> Result<T, Violation> {
    Err(Violation { rule, message })
}

/// Why a file was refused. Every variant but [`OpenError::Io`] stands for one numbered rule of `SPEC.md`; what to do is
/// [`OpenError::help`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The file system said no.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// Rule 1.
    #[error("file is cut off: needs at least {needed} bytes, has {present}")]
    Truncated {
        /// Bytes that header and section table take.
        needed: u64,
        /// Bytes of the file.
        present: u64,
    },
    /// Rule 2.
    #[error("not a localprt file (starts with {found:02x?})")]
    WrongMagic {
        /// First bytes of the file.
        found: [u8; 8],
    },
    /// Rule 3.
    #[error("format version {major}.{minor} is not supported, this program reads {supported}.x")]
    UnsupportedVersion {
        /// Major version of the file.
        major: u16,
        /// Minor version of the file.
        minor: u16,
        /// Major version that can be read.
        supported: u16,
    },
    /// Rule 4.
    #[error("header: {found} sections, allowed are 1 to {allowed}")]
    SectionCount {
        /// Stated count.
        found: u32,
        /// Most sections.
        allowed: u32,
    },
    /// Rule 5.
    #[error("header: states a file of {stated} bytes, file has {present}")]
    WrongLength {
        /// Length in the header.
        stated: u64,
        /// Length of the file.
        present: u64,
    },
    /// Rule 6.
    #[error("{place}: reserved field is {found}, must be 0")]
    ReservedNotZero {
        /// Header or section.
        place: String,
        /// Value.
        found: u64,
    },
    /// Rule 7.
    #[error("header: checksum is {computed:08x}, stated is {stated:08x}")]
    HeaderChecksum {
        /// Checksum in the header.
        stated: u32,
        /// Checksum of the bytes.
        computed: u32,
    },
    /// Rule 8.
    #[error("content hash differs from the stated one")]
    ContentHash,
    /// Rule 10.
    #[error("section table: entry {index} has the kind {found:02x?}, allowed are four of A-Z and 0-9")]
    BadKind {
        /// Entry of the table.
        index: u32,
        /// Its kind.
        found: [u8; 4],
    },
    /// Rule 11.
    #[error("section {section}: appears twice")]
    DuplicateSection {
        /// Section.
        section: SectionKind,
    },
    /// Rule 12.
    #[error("section {section}: flags are {found:#06x}, allowed are 0 and 1")]
    UnknownFlags {
        /// Section.
        section: SectionKind,
        /// Flags.
        found: u16,
    },
    /// Rule 13.
    #[error("section {section}: element type {scalar} x {components} is unknown")]
    UnknownElementType {
        /// Section.
        section: SectionKind,
        /// Scalar code.
        scalar: u16,
        /// Scalars per element.
        components: u16,
    },
    /// Rule 14.
    #[error("section {section}: {count} elements of {element_bytes} bytes do not make {found} bytes")]
    SectionLength {
        /// Section.
        section: SectionKind,
        /// Stated elements.
        count: u64,
        /// Bytes of one element.
        element_bytes: u64,
        /// Stated bytes.
        found: u64,
    },
    /// Rule 15.
    #[error("section {section}: starts at byte {found}, must start at {expected}")]
    Misplaced {
        /// Section.
        section: SectionKind,
        /// Stated offset.
        found: u64,
        /// First multiple of 256 after the section before it.
        expected: u64,
    },
    /// Rule 16.
    #[error("section {section}: ends at byte {end}, the last section must end with the file, at byte {present}")]
    WrongEnd {
        /// Section.
        section: SectionKind,
        /// End of the section.
        end: u64,
        /// Length of the file.
        present: u64,
    },
    /// Rule 17.
    #[error("padding byte {offset} is {found:#04x}, must be 0")]
    PaddingNotZero {
        /// Place in the file.
        offset: u64,
        /// Value.
        found: u8,
    },
    /// Rule 18.
    #[error("section {section} (version {version}) is required to read this file and unknown to this program")]
    UnknownRequiredSection {
        /// Section.
        section: SectionKind,
        /// Its version.
        version: u16,
    },
    /// Rule 19.
    #[error("section {section}: version {found} is not supported, this program reads version {supported}")]
    SectionVersion {
        /// Section.
        section: SectionKind,
        /// Its version.
        found: u16,
        /// Version that can be read.
        supported: u16,
    },
    /// Rule 20.
    #[error("section {section}: is {found}, must be {expected}")]
    WrongElementType {
        /// Section.
        section: SectionKind,
        /// Element type and required flag found.
        found: String,
        /// Element type and required flag of this kind.
        expected: String,
    },
    /// Rule 21.
    #[error("section {section} is missing")]
    MissingSection {
        /// Section.
        section: SectionKind,
    },
    /// Rule 22.
    #[error("section {section}: checksum is {computed:08x}, stated is {stated:08x}")]
    SectionChecksum {
        /// Section.
        section: SectionKind,
        /// Checksum in the table.
        stated: u32,
        /// Checksum of the bytes.
        computed: u32,
    },
    /// Rule 30, size.
    #[error("section META: {found} bytes, at most {allowed} are allowed")]
    MetadataTooLarge {
        /// Bytes.
        found: u64,
        /// Most bytes.
        allowed: u64,
    },
    /// Rule 30, encoding.
    #[error("section META: cannot be decoded: {reason}")]
    MetadataEncoding {
        /// What the decoder met.
        reason: String,
    },
    /// Rules 31 and above: a number that breaks an invariant.
    #[error(transparent)]
    Invalid(#[from] Violation),
}

impl OpenError {
    /// Number of the broken rule in `SPEC.md`; none for failures of the file system.
    pub fn rule(&self) -> Option<u16> {
        Some(match self {
            Self::Io { .. } => return None,
            Self::Truncated { .. } => 1,
            Self::WrongMagic { .. } => 2,
            Self::UnsupportedVersion { .. } => 3,
            Self::SectionCount { .. } => 4,
            Self::WrongLength { .. } => 5,
            Self::ReservedNotZero { .. } => 6,
            Self::HeaderChecksum { .. } => 7,
            Self::ContentHash => 8,
            Self::BadKind { .. } => 10,
            Self::DuplicateSection { .. } => 11,
            Self::UnknownFlags { .. } => 12,
            Self::UnknownElementType { .. } => 13,
            Self::SectionLength { .. } => 14,
            Self::Misplaced { .. } => 15,
            Self::WrongEnd { .. } => 16,
            Self::PaddingNotZero { .. } => 17,
            Self::UnknownRequiredSection { .. } => 18,
            Self::SectionVersion { .. } => 19,
            Self::WrongElementType { .. } => 20,
            Self::MissingSection { .. } => 21,
            Self::SectionChecksum { .. } => 22,
            Self::MetadataTooLarge { .. } | Self::MetadataEncoding { .. } => 30,
            Self::Invalid(violation) => violation.rule,
        })
    }

    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::Io { .. } => "check that it is a file and may be read",
            Self::WrongMagic { .. } => "name a file that was baked, or copy it again, as bytes and not as text",
            Self::UnsupportedVersion { major, supported, .. } if major < supported => "bake the scene again",
            Self::UnsupportedVersion { .. } | Self::UnknownRequiredSection { .. } | Self::SectionVersion { .. } => {
                "update this program"
            }
            _ => "copy the file again, or bake the scene again",
        }
    }
}

/// Why a file was not written. An existing file under that name is as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The arrays break an invariant; nothing was written.
    #[error("the baked arrays break {0}")]
    Invalid(#[from] Violation),
    /// The metadata, mostly its options text, is too large to be read back.
    #[error("metadata takes {found} bytes, at most {allowed} are allowed")]
    MetadataTooLarge {
        /// Bytes.
        found: u64,
        /// Most bytes.
        allowed: u64,
    },
    /// The metadata could not be encoded.
    #[error("metadata cannot be encoded: {reason}")]
    MetadataEncoding {
        /// What the encoder met.
        reason: String,
    },
    /// Something that is not a regular file, such as a device or a folder, has that name.
    #[error("{path} exists and is not a regular file")]
    NotAFile {
        /// Target.
        path: PathBuf,
    },
    /// The file system said no.
    #[error("cannot {action} {path} ({needed_bytes} bytes needed): {source}")]
    Io {
        /// Step that failed, a verb.
        action: &'static str,
        /// Target.
        path: PathBuf,
        /// Bytes of the whole file.
        needed_bytes: u64,
        /// Cause.
        source: io::Error,
    },
}
