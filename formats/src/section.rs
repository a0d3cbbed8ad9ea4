//! What the section table says of a section.

use std::fmt;

/// Four-letter name of a section.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SectionKind(pub [u8; 4]);

impl fmt::Display for SectionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

impl fmt::Debug for SectionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Number type of a section's elements; the discriminant is the code in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Scalar {
    /// Unsigned, 1 byte.
    U8 = 1,
    /// Unsigned, 2 bytes.
    U16 = 2,
    /// Unsigned, 4 bytes.
    U32 = 3,
    /// IEEE 754 binary16.
    F16 = 4,
    /// IEEE 754 binary32.
    F32 = 5,
}

impl Scalar {
    /// Bytes of one number.
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    pub(crate) fn from_code(code: u16) -> Option<Self> {
        [Self::U8, Self::U16, Self::U32, Self::F16, Self::F32].into_iter().find(|scalar| *scalar as u16 == code)
    }
}

impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::F16 => "f16",
            Self::F32 => "f32",
        })
    }
}

/// One entry of the section table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Name.
    pub kind: SectionKind,
    /// Version of this section's layout, from 1.
    pub version: u16,
    /// Whether a reader that does not know the section must refuse the file.
    pub required: bool,
    /// Number type of its elements.
    pub scalar: Scalar,
    /// Numbers per element.
    pub components: u16,
    /// Elements.
    pub count: u64,
    /// First byte in the file, a multiple of [`crate::header::ALIGNMENT`].
    pub offset: u64,
    /// Bytes, without padding.
    pub length: u64,
    /// CRC-32C of those bytes.
    pub checksum: u32,
}
