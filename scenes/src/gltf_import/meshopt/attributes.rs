//! Mode 0: attributes, byte by byte as differences from element to element.

use super::{Fault, Reader, SHORT};

/// Elements of a group, which share one number of bits.
const GROUP: usize = 16;
/// Most elements of a block, and most bytes.
const BLOCK: usize = 256;
const BLOCK_BYTES: usize = 8192;

/// How the deltas of one byte of all elements of a block are stored.
#[derive(Clone, Copy)]
enum Control {
    /// Groups with bits of this list, by two bits of the header.
    Groups([u32; 4]),
    Zeros,
    Literal,
}

impl Control {
    const VERSION_0: Self = Self::Groups([0, 2, 4, 8]);

    fn of(bits: u8) -> Self {
        match bits & 3 {
            0 => Self::Groups([0, 1, 2, 4]),
            1 => Self::Groups([1, 2, 4, 8]),
            2 => Self::Zeros,
            _ => Self::Literal,
        }
    }
}

/// What a delta is between, of four bytes of an element.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Words,
    /// Exclusive or, rotated by so many bits.
    Xor(u32),
}

impl Channel {
    fn of(mode: u8) -> Result<Self, Fault> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, rotation) => Ok(Self::Xor(u32::from(rotation))),
            _ => Err("an unknown channel mode"),
        }
    }

    /// Four bytes of an element by those of the one before it.
    fn next(self, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|at| {
                let delta = delta[at];
                last[at].wrapping_add(if delta & 1 == 0 { delta >> 1 } else { !(delta >> 1) })
            }),
            Self::Words => {
                let word = |bytes: [u8; 4], at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
                let next = |at: usize| {
                    let delta = word(delta, at);
                    word(last, at).wrapping_add(if delta & 1 == 0 { delta >> 1 } else { !(delta >> 1) }).to_le_bytes()
                };
                let [low, high] = [next(0), next(2)];
                [low[0], low[1], high[0], high[1]]
            }
            Self::Xor(rotation) => {
                (u32::from_le_bytes(last) ^ u32::from_le_bytes(delta).rotate_left(rotation)).to_le_bytes()
            }
        }
    }
}

/// `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Fault> {
    let (&header, body) = bytes.split_first().ok_or(SHORT)?;
    let channel_bytes = match header {
        0xa0 => 0,
        0xa1 => stride / 4,
        _ => return Err("not attributes of version 0 or 1"),
    };
    let is_version_1 = channel_bytes > 0;
    let used = stride + channel_bytes;
    let tail = used.max(if is_version_1 { 24 } else { 32 });
    let at = body.len().checked_sub(tail).ok_or(SHORT)?;
    let (blocks, tail) = body.split_at(at);
    let (first, modes) = tail[tail.len() - used..].split_at(stride);
    let channels: Vec<Channel> = match is_version_1 {
        true => modes.iter().map(|&mode| Channel::of(mode)).collect::<Result<_, _>>()?,
        false => vec![Channel::Bytes; stride / 4],
    };

    let mut reader = Reader(blocks);
    let mut last = first.to_vec();
    let mut decoded = Vec::new();
    let mut deltas = vec![0; stride * BLOCK];
    let mut left = count;
    while left > 0 {
        let elements = left.min(((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK));
        let controls = if is_version_1 { Some(reader.take(stride / 4)?) } else { None };
        for (byte, deltas) in deltas.chunks_exact_mut(BLOCK).enumerate() {
            let control = controls.map_or(Control::VERSION_0, |all| Control::of(all[byte / 4] >> (2 * (byte % 4))));
            read_deltas(&mut reader, control, elements, deltas)?;
        }
        for element in 0..elements {
            for (channel, last) in channels.iter().zip(last.chunks_exact_mut(4)).enumerate() {
                let (kind, last) = last;
                let delta = std::array::from_fn(|at| deltas[(4 * channel + at) * BLOCK + element]);
                last.copy_from_slice(&kind.next([last[0], last[1], last[2], last[3]], delta));
            }
            decoded.extend_from_slice(&last);
        }
        left -= elements;
    }
    reader.end()?;
    Ok(decoded)
}

/// The deltas of one byte of the elements of a block.
fn read_deltas(reader: &mut Reader<'_>, control: Control, elements: usize, deltas: &mut [u8]) -> Result<(), Fault> {
    match control {
        Control::Zeros => deltas[..elements].fill(0),
        Control::Literal => deltas[..elements].copy_from_slice(reader.take(elements)?),
        Control::Groups(widths) => {
            let groups = elements.div_ceil(GROUP);
            let header = reader.take(groups.div_ceil(4))?;
            for (group, deltas) in deltas.chunks_exact_mut(GROUP).take(groups).enumerate() {
                let bits = widths[usize::from(header[group / 4] >> (2 * (group % 4)) & 3)];
                read_group(reader, bits, deltas)?;
            }
        }
    }
    Ok(())
}

/// Sixteen deltas of so many bits; those with all bits set follow as bytes.
fn read_group(reader: &mut Reader<'_>, bits: u32, deltas: &mut [u8]) -> Result<(), Fault> {
    match bits {
        0 => deltas.fill(0),
        8 => deltas.copy_from_slice(reader.take(GROUP)?),
        _ => {
            let packed = reader.take(GROUP * bits as usize / 8)?;
            let (per_byte, sentinel) = (8 / bits as usize, (1u8 << bits) - 1);
            for (at, delta) in deltas.iter_mut().enumerate() {
                let within = (at % per_byte) as u32;
                // Single bits begin with the lowest, others with the highest.
                let shift = if bits == 1 { within } else { 8 - bits * (within + 1) };
                let value = packed[at / per_byte] >> shift & sentinel;
                *delta = if value == sentinel { reader.byte()? } else { value };
            }
        }
    }
    Ok(())
}
