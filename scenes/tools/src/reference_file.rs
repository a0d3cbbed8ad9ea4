//! What a validation leaves beside a baked file: irradiance by path tracing and by the file, at the measured receivers.
//!
//! In: what `precompute validate` measured under its first lighting state. Out: `hall.reference.ply` beside
//! `hall.lprt`, a point cloud that programs for points open, and that a viewer shows as a map of the error. Its header
//! names the baked file by content hash, so that a file which has been baked again is not shown with old errors.
//!
//! World space, metres; irradiance in W m^-2, linear RGB.

use crate::error::{CommandError, Exit, reason};
use crate::hex;
use crate::output::{OutputError, write_file};
use localprt_formats::Baked;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// First line of the header that is ours, with the version of the format.
const MARK: &str = "comment localprt reference 1";
/// Columns after the header, little-endian.
const FLOATS: [&str; 9] =
    ["x", "y", "z", "red", "green", "blue", "compressed_red", "compressed_green", "compressed_blue"];
/// Bytes of a point: the floats, then the receiver.
const STRIDE: usize = 4 * FLOATS.len() + 4;
/// Bytes of a state's name, at most.
const MOST_NAME: usize = 200;
/// Bytes of a header, at most.
const MOST_HEADER: usize = 2048;
/// Bytes of a file, at most: 26 million receivers.
const MOST_BYTES: u64 = 1 << 30;

/// A measured receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferencePoint {
    /// Its number in the baked file.
    pub receiver: u32,
    /// World position, metres.
    pub position: [f32; 3],
    /// Indirect irradiance by path tracing, W m^-2.
    pub reference: [f32; 3],
    /// The same as the baked file gives it.
    pub compressed: [f32; 3],
}

/// Reference and result at the measured receivers of a baked file, under one lighting.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceFile {
    /// Content hash of the baked file.
    pub content_hash: [u8; 32],
    /// Name of the lighting state.
    pub state: String,
    /// Gathers; 1 is the first indirect bounce.
    pub bounces: u32,
    /// By rising receiver.
    pub points: Vec<ReferencePoint>,
}

/// Why a reference file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The system refused.
    #[error("cannot be read: {}", reason(cause))]
    Io {
        /// The system's reason.
        cause: io::Error,
    },
    /// Not what [`ReferenceFile::write`] writes.
    #[error("is not a whole reference file: {what}")]
    Damaged {
        /// What is wrong.
        what: String,
    },
    /// Of another bake.
    #[error("was measured on another bake: its content hash is {found}, not {expected}")]
    OtherBake {
        /// First digits of the hash in the reference file.
        found: String,
        /// Those of the baked file.
        expected: String,
    },
}

impl ReferenceError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::Io { .. } => "check that it is a file and may be read",
            Self::Damaged { .. } => "run precompute validate again",
            Self::OtherBake { .. } => "run precompute validate on this one",
        }
    }
}

impl From<ReferenceError> for CommandError {
    fn from(error: ReferenceError) -> Self {
        let exit = match error {
            ReferenceError::Io { .. } => Exit::Io,
            ReferenceError::Damaged { .. } | ReferenceError::OtherBake { .. } => Exit::InvalidInput,
        };
        Self::of(exit, &error).help(error.help())
    }
}

fn damaged(what: impl Into<String>) -> ReferenceError {
    ReferenceError::Damaged { what: what.into() }
}

impl ReferenceFile {
    /// Where the reference of a baked file lies: `hall.reference.ply` for `hall.lprt`.
    pub fn path_beside(baked: &Path) -> PathBuf {
        if baked.extension().is_some_and(|extension| extension == "lprt") {
            return baked.with_extension("reference.ply");
        }
        let mut name = baked.as_os_str().to_owned();
        name.push(".reference.ply");
        name.into()
    }

    /// Writes the file whole or not at all. Of the state's name the first 200 bytes are kept, in one line.
    ///
    /// # Errors
    /// [`OutputError`]; an existing file is unchanged then.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        write_file(path, &self.to_bytes())
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.header(self.points.len()).into_bytes();
        bytes.reserve(STRIDE * self.points.len());
        for point in &self.points {
            let floats = [point.position, point.reference, point.compressed];
            bytes.extend(floats.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
            bytes.extend(point.receiver.to_le_bytes());
        }
        bytes
    }

    fn header(&self, n_points: usize) -> String {
        let mut lines = vec![
            "ply".to_owned(),
            "format binary_little_endian 1.0".into(),
            MARK.into(),
            format!("comment content_hash {}", hex(&self.content_hash)),
            format!("comment state {}", one_line(&self.state)),
            format!("comment bounces {}", self.bounces),
            format!("element vertex {n_points}"),
        ];
        lines.extend(FLOATS.iter().map(|name| format!("property float {name}")));
        lines.push("property uint receiver".into());
        lines.push("end_header\n".into());
        lines.join("\n")
    }

    /// Reads what [`ReferenceFile::write`] has written.
    ///
    /// # Errors
    /// [`ReferenceError::Io`], and [`ReferenceError::Damaged`] for anything that `write` would not write.
    pub fn read(path: &Path) -> Result<Self, ReferenceError> {
        let io = |cause| ReferenceError::Io { cause };
        let file = File::open(path).map_err(io)?;
        let data = file.metadata().map_err(io)?;
        if !data.is_file() {
            return Err(damaged("it is not a plain file"));
        }
        if data.len() > MOST_BYTES {
            return Err(damaged(format!("it has {} bytes, allowed are {MOST_BYTES}", data.len())));
        }
        let mut bytes = Vec::new();
        file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, ReferenceError> {
        const END: &[u8] = b"\nend_header\n";
        let head = &bytes[..bytes.len().min(MOST_HEADER)];
        let end = head.windows(END.len()).position(|window| window == END);
        let end = end.ok_or_else(|| damaged("it has no header"))? + END.len();
        let header = std::str::from_utf8(&bytes[..end]).map_err(|_| damaged("its header is not text"))?;
        let value = |key: &str| {
            let found = header.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
            found.ok_or_else(|| damaged(format!("its header has no line `{key}`")))
        };
        let number = |key: &str| {
            let text = value(key)?;
            text.parse::<u32>().map_err(|_| damaged(format!("`{key} {text}` is not a number of 32 bits")))
        };
        if !header.lines().any(|line| line == MARK) {
            return Err(damaged(format!("its header has no line `{MARK}`")));
        }
        let n_points = number("element vertex")? as usize;
        let mut file = Self {
            content_hash: hash_of(value("comment content_hash")?)
                .ok_or_else(|| damaged("its content hash is not 64 hexadecimal digits"))?,
            state: value("comment state")?.to_owned(),
            bounces: number("comment bounces")?,
            points: Vec::new(),
        };
        // Every other header means something that is not read here.
        if file.header(n_points) != header {
            return Err(damaged("its header is not the one that precompute writes"));
        }
        let body = &bytes[end..];
        if body.len() as u64 != (n_points as u64) * (STRIDE as u64) {
            return Err(damaged(format!("it has {} bytes for {n_points} points of {STRIDE}", body.len())));
        }
        file.points = body.chunks_exact(STRIDE).map(point_of).collect();
        if !file.points.is_sorted_by(|a, b| a.receiver < b.receiver) {
            return Err(damaged("its receivers do not rise"));
        }
        let numbers = |point: &ReferencePoint| [point.position, point.reference, point.compressed];
        if !file.points.iter().all(|point| numbers(point).as_flattened().iter().all(|value| value.is_finite())) {
            return Err(damaged("it has values that are not finite"));
        }
        Ok(file)
    }

    /// Whether it was measured on this very bake.
    ///
    /// # Errors
    /// [`ReferenceError::OtherBake`]; [`ReferenceError::Damaged`] where it names receivers that the bake does not have.
    pub fn matches(&self, baked: &Baked) -> Result<(), ReferenceError> {
        if self.content_hash != baked.content_hash() {
            let short = crate::inputs::short;
            return Err(ReferenceError::OtherBake {
                found: short(&self.content_hash),
                expected: short(&baked.content_hash()),
            });
        }
        let n_receivers = baked.view().receiver_texel.len();
        match self.points.last() {
            Some(last) if last.receiver as usize >= n_receivers => {
                Err(damaged(format!("it names receiver {} of {n_receivers}", last.receiver)))
            }
            _ => Ok(()),
        }
    }
}

/// Text without line breaks and other control characters, cut at a character's end.
fn one_line(text: &str) -> String {
    let text: String = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    text[..text.floor_char_boundary(MOST_NAME)].to_owned()
}

fn hash_of(digits: &str) -> Option<[u8; 32]> {
    let digits: Vec<u8> =
        digits.chars().map(|digit| digit.to_digit(16).map(|value| value as u8)).collect::<Option<_>>()?;
    let bytes: Vec<u8> = digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect();
    (digits.len() == 64).then(|| bytes.try_into().ok()).flatten()
}

/// `bytes`: [`STRIDE`] of them.
fn point_of(bytes: &[u8]) -> ReferencePoint {
    let four = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    let color = |first: usize| [0, 1, 2].map(|axis| f32::from_le_bytes(four(4 * (first + axis))));
    ReferencePoint {
        position: color(0),
        reference: color(3),
        compressed: color(6),
        receiver: u32::from_le_bytes(four(STRIDE - 4)),
    }
}

#[cfg(test)]
mod tests;
