//! Modes 1 and 2: triangles by the edges and vertices of those before them, and indices as differences.

use super::{Fault, Reader, SHORT};

/// Bytes behind the triangles' data: the table of frequent codes.
const TABLE: usize = 16;
/// Bytes behind a sequence's data.
const PADDING: usize = 4;

/// Little-endian numbers of 2 or 4 bytes.
pub(super) fn packed(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// Mode 2: `count` indices, each by the last of one of two sequences.
pub(super) fn sequence(bytes: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    let mut reader = Reader(body(bytes, 0xd1, PADDING, "not indices of version 1")?.0);
    let mut last = [0u32; 2];
    let mut indices = Vec::new();
    for _ in 0..count {
        let value = reader.varint()?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(unzigzag(value >> 1));
        indices.push(*last);
    }
    reader.end()?;
    Ok(indices)
}

/// Mode 1: the `count` indices of a list of triangles.
pub(super) fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    let (body, table) = body(bytes, 0xe1, TABLE, "not triangles of version 1")?;
    let (codes, data) = body.split_at_checked(count / 3).ok_or(SHORT)?;
    let mut decoder = Triangles { data: Reader(data), ..Triangles::default() };
    let mut indices = Vec::new();
    for &code in codes {
        let corners = match (code >> 4, code & 15) {
            (15, entry @ 14..) => decoder.explicit(entry == 15)?,
            (15, entry) => {
                let [second, third] = halves(table[usize::from(entry)]);
                decoder.fresh(Corner::Next, second, third)?
            }
            (edge, corner) => decoder.beside(edge, corner)?,
        };
        indices.extend(corners);
    }
    decoder.data.end()?;
    Ok(indices)
}

/// What is between the header and the last bytes, and these.
fn body(bytes: &[u8], header: u8, tail: usize, other: Fault) -> Result<(&[u8], &[u8]), Fault> {
    let (&found, body) = bytes.split_first().ok_or(SHORT)?;
    if found != header {
        return Err(other);
    }
    body.split_at_checked(body.len().checked_sub(tail).ok_or(SHORT)?).ok_or(SHORT)
}

fn unzigzag(value: u32) -> u32 {
    if value & 1 == 0 { value >> 1 } else { !(value >> 1) }
}

/// A corner by four bits.
#[derive(Clone, Copy)]
enum Corner {
    /// The next vertex that was not used yet.
    Next,
    /// One of the last vertices, 0 being the newest.
    Recent(u8),
    /// In the data.
    Explicit,
}

fn halves(byte: u8) -> [Corner; 2] {
    [byte >> 4, byte & 15].map(|bits| match bits {
        0 => Corner::Next,
        15 => Corner::Explicit,
        bits => Corner::Recent(bits - 1),
    })
}

#[derive(Default)]
struct Triangles<'a> {
    data: Reader<'a>,
    next: u32,
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

impl Triangles<'_> {
    /// A triangle on one of the last edges.
    fn beside(&mut self, edge: u8, corner: u8) -> Result<[u32; 3], Fault> {
        let [a, b] = self.edges.get(edge)?;
        let (c, is_new) = match corner {
            0 => (self.take(Corner::Next)?, true),
            13 | 14 => {
                self.last = if corner == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                (self.last, true)
            }
            15 => (self.take(Corner::Explicit)?, true),
            corner => (self.vertices.get(corner)?, false),
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle of its own, by a byte of the data.
    fn explicit(&mut self, is_first_explicit: bool) -> Result<[u32; 3], Fault> {
        let byte = self.data.byte()?;
        if byte == 0 {
            self.next = 0;
        }
        let [second, third] = halves(byte);
        self.fresh(if is_first_explicit { Corner::Explicit } else { Corner::Next }, second, third)
    }

    fn fresh(&mut self, first: Corner, second: Corner, third: Corner) -> Result<[u32; 3], Fault> {
        let a = self.take(first)?;
        let b = self.take(second)?;
        let c = self.take(third)?;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        self.vertices.push(a);
        for (corner, vertex) in [(second, b), (third, c)] {
            if !matches!(corner, Corner::Recent(_)) {
                self.vertices.push(vertex);
            }
        }
        Ok([a, b, c])
    }

    fn take(&mut self, corner: Corner) -> Result<u32, Fault> {
        match corner {
            Corner::Next => {
                let vertex = self.next;
                self.next = self.next.wrapping_add(1);
                Ok(vertex)
            }
            Corner::Recent(age) => self.vertices.get(age),
            Corner::Explicit => {
                self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
                Ok(self.last)
            }
        }
    }
}

/// The last sixteen things.
#[derive(Default)]
struct Recent<T> {
    held: [Option<T>; 16],
    newest: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, value: T) {
        self.newest = (self.newest + 1) % 16;
        self.held[self.newest] = Some(value);
    }

    /// 0 is the newest.
    fn get(&self, age: u8) -> Result<T, Fault> {
        self.held[(self.newest + 16 - usize::from(age)) % 16].ok_or("an edge or vertex from before the first triangle")
    }
}
