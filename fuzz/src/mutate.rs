//! Mutations that leave sound what stands around them: bytes behind a wrong checksum or length are never read.

use super::{CELLS, LAYOUT, LEAF, RECORD_HEAD};
use localprt_formats::{
    directions::counter_hash,
    header::{ENTRY_BYTES, HEADER_BYTES, MAX_SECTIONS},
};
use serde_json::Value;

/// Bytes by which a part may grow at once.
const GROWTH: usize = 256;

/// Throws that follow from a seed.
pub struct Dice {
    seed: u64,
    thrown: u64,
}

/// Changes some bytes in place; they may grow to so many.
pub type Change<'a> = &'a mut dyn FnMut(&mut Vec<u8>, usize);

/// A mutation of an input, to at most so many bytes.
pub type Mutation = fn(&[u8], usize, &mut Dice, Change<'_>) -> Vec<u8>;

impl Dice {
    /// The same throws for the same seed.
    pub fn new(seed: u64) -> Self {
        Self { seed, thrown: 0 }
    }

    /// Any number.
    pub fn any(&mut self) -> u64 {
        self.thrown += 1;
        counter_hash(self.seed, 0x66757a7a, self.thrown)
    }

    /// A number below another, or 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.any() % end.max(1) as u64) as usize
    }

    fn one_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }
}

/// A mutation as libFuzzer asks for it, whose own `mutator` changes the bytes.
pub fn in_place(
    mutation: Mutation,
    data: &mut [u8],
    size: usize,
    most: usize,
    seed: u32,
    mutator: fn(&mut [u8], usize, usize) -> usize,
) -> usize {
    let mut change = |bytes: &mut Vec<u8>, most: usize| {
        let size = bytes.len();
        let most = most.min(size + GROWTH).max(size).max(1);
        bytes.resize(most, 0);
        let size = mutator(bytes, size, most);
        bytes.truncate(size);
    };
    let mutated = mutation(&data[..size], most, &mut Dice::new(seed.into()), &mut change);
    let size = mutated.len().min(most);
    data[..size].copy_from_slice(&mutated[..size]);
    size
}

/// Changes bytes as they are.
pub fn plain(bytes: &[u8], most: usize, _: &mut Dice, change: Change<'_>) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    change(&mut bytes, most);
    bytes
}

/// A JSON text: moves, copies, removes or replaces values; or changes bytes.
pub fn json(bytes: &[u8], most: usize, dice: &mut Dice, change: Change<'_>) -> Vec<u8> {
    let parsed = if dice.one_in(4) { None } else { serde_json::from_slice::<Value>(bytes).ok() };
    let Some(mut root) = parsed else { return plain(bytes, most, dice, change) };
    for _ in 0..1 + dice.below(3) {
        let n_values = count(&root);
        let other = nth(&mut root, &mut dice.below(n_values)).cloned().unwrap_or_default();
        let Some(value) = nth(&mut root, &mut dice.below(n_values)) else { continue };
        match (dice.below(4), &mut *value) {
            (0, Value::Array(values)) if !values.is_empty() => drop(values.remove(dice.below(values.len()))),
            (1, Value::Array(values)) => values.insert(dice.below(values.len() + 1), other),
            (0, Value::Object(entries)) if !entries.is_empty() => {
                let key = entries.keys().nth(dice.below(entries.len())).cloned().unwrap_or_default();
                entries.shift_remove(&key);
            }
            (0 | 1, Value::String(text)) => {
                let mut bytes = std::mem::take(text).into_bytes();
                change(&mut bytes, most);
                *text = String::from_utf8_lossy(&bytes).into_owned();
            }
            (0, Value::Number(number)) => {
                let number = number.as_f64().unwrap_or(0.0);
                *value = [number + 1.0, number - 1.0, -number, 2.0 * number, number / 3.0, number * 1e30]
                    [dice.below(6)]
                .into();
            }
            (1 | 2, _) => *value = other,
            _ => *value = surprising(dice),
        }
    }
    root.to_string().into_bytes()
}

/// A value that readers may not expect.
fn surprising(dice: &mut Dice) -> Value {
    let values = [
        Value::Null,
        true.into(),
        0.into(),
        1.into(),
        (-1).into(),
        255.into(),
        5121.into(),
        5125.into(),
        5126.into(),
        u32::MAX.into(),
        (1u64 << 32).into(),
        u64::MAX.into(),
        i64::MIN.into(),
        0.5.into(),
        0.1.into(),
        1e-45.into(),
        3.4e38.into(),
        1e39.into(),
        1e300.into(),
        (dice.any() as u8).into(),
        f64::from(f32::from_bits(dice.any() as u32)).into(),
        f64::from_bits(dice.any()).into(),
        "".into(),
        "data:;base64,AAAA".into(),
        "../x".into(),
        "VEC3".into(),
        Value::Array(Vec::new()),
        vec![0; 3].into(),
        Value::Object(serde_json::Map::new()),
    ];
    values[dice.below(values.len())].clone()
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(values) => values.iter().map(count).sum(),
        Value::Object(entries) => entries.values().map(count).sum(),
        _ => 0,
    }
}

/// The value of that number, in the order of the text.
fn nth<'a>(value: &'a mut Value, number: &mut usize) -> Option<&'a mut Value> {
    if *number == 0 {
        return Some(value);
    }
    *number -= 1;
    match value {
        Value::Array(values) => values.iter_mut().find_map(|value| nth(value, number)),
        Value::Object(entries) => entries.values_mut().find_map(|value| nth(value, number)),
        _ => None,
    }
}

/// A glTF scene: its JSON, its bytes or its frame; lengths of chunks are right again.
pub fn gltf(bytes: &[u8], most: usize, dice: &mut Dice, change: Change<'_>) -> Vec<u8> {
    let word = |at: usize| bytes.get(at..at + 4).map(|word| u32::from_le_bytes(word.try_into().unwrap_or_default()));
    let end =
        |at: usize| word(at).and_then(|length| (at + 8).checked_add(length as usize)).filter(|end| *end <= bytes.len());
    let Some(json_end) = end(12).filter(|_| bytes.starts_with(b"glTF") && !dice.one_in(16)) else {
        return json(bytes, most, dice, change);
    };
    let bin_start = json_end.next_multiple_of(4);
    let mut text = bytes[20..json_end].to_vec();
    let mut bin = end(bin_start).map(|end| bytes[bin_start + 8..end].to_vec());
    match &mut bin {
        Some(bin) if dice.one_in(3) => change(bin, most.saturating_sub(text.len() + 28)),
        _ => text = json(&text, most, dice, change),
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    let chunks = [(b"JSON", Some(text)), (b"BIN\0", bin)];
    for (kind, mut chunk) in chunks.into_iter().filter_map(|(kind, chunk)| Some((kind, chunk?))) {
        chunk.resize(chunk.len().next_multiple_of(4), 0);
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    let length = glb.len() as u32;
    glb[8..12].copy_from_slice(&length.to_le_bytes());
    glb
}

/// A section of a baked file: its entry in the table, and its payload.
#[derive(Clone)]
struct Section {
    entry: Vec<u8>,
    payload: Vec<u8>,
}

/// A baked file: a payload, the order of the sections or their table; lengths, places and checksums are right again.
pub fn file(bytes: &[u8], most: usize, dice: &mut Dice, change: Change<'_>) -> Vec<u8> {
    let Some(mut sections) = sections(bytes).filter(|_| !dice.one_in(32)) else {
        return plain(bytes, most, dice, change);
    };
    let mut head = bytes[..HEADER_BYTES].to_vec();
    let room = most.saturating_sub(bytes.len());
    let one = dice.below(sections.len());
    match dice.below(16) {
        0 => {
            let other = sections[one].clone();
            sections.insert(dice.below(sections.len() + 1), other);
        }
        1 => drop(sections.remove(one)),
        2 => {
            let other = dice.below(sections.len());
            sections.swap(one, other);
        }
        3 => {
            change(&mut sections[one].entry, ENTRY_BYTES);
            sections[one].entry.resize(ENTRY_BYTES, 0);
        }
        4 => {
            change(&mut head, HEADER_BYTES);
            head.resize(HEADER_BYTES, 0);
        }
        // Without being laid out anew: what the table says is not so.
        5 => {
            let mut file = bytes.to_vec();
            let table = HEADER_BYTES..HEADER_BYTES + sections.len() * ENTRY_BYTES;
            let mut changed = file[table.clone()].to_vec();
            change(&mut changed, table.len());
            changed.resize(table.len(), 0);
            file[table].copy_from_slice(&changed);
            seal(&mut file, sections.len());
            return file;
        }
        throw => {
            let Section { entry, payload } = &mut sections[one];
            match &entry[..4] {
                b"REPT" | b"PLAN" if throw > 7 => *payload = json(payload, payload.len() + room, dice, change),
                _ => change(payload, payload.len() + room),
            }
        }
    }
    laid_out(head, sections)
}

/// Sections of a file whose table can be read.
fn sections(bytes: &[u8]) -> Option<Vec<Section>> {
    let n_sections = u32::from_le_bytes(bytes.get(12..16)?.try_into().ok()?);
    if !(1..=MAX_SECTIONS).contains(&n_sections) {
        return None;
    }
    let table = bytes.get(HEADER_BYTES..HEADER_BYTES + n_sections as usize * ENTRY_BYTES)?;
    let section = |entry: &[u8]| {
        let number = |at: usize| usize::try_from(u64::from_le_bytes(entry[at..at + 8].try_into().ok()?)).ok();
        let (offset, length) = (number(24)?, number(32)?);
        let payload = bytes.get(offset..offset.checked_add(length)?)?.to_vec();
        Some(Section { entry: entry.to_vec(), payload })
    };
    table.chunks_exact(ENTRY_BYTES).map(section).collect()
}

/// A file of these sections: whole elements only, each at its place, with the checksums that they have.
fn laid_out(mut head: Vec<u8>, sections: Vec<Section>) -> Vec<u8> {
    let mut end = HEADER_BYTES + sections.len() * ENTRY_BYTES;
    let (mut table, mut payloads) = (Vec::new(), vec![0; end]);
    for Section { mut entry, mut payload } in sections {
        let half = |at: usize| usize::from(u16::from_le_bytes([entry[at], entry[at + 1]]));
        // Bytes of an element by the codes of scalars: u8, u16, u32, f16, f32.
        let element = [0, 1, 2, 4, 2, 4].get(half(8)).copied().unwrap_or(0) * half(10);
        if let Some(count) = payload.len().checked_div(element) {
            payload.truncate(count * element);
            entry[16..24].copy_from_slice(&(count as u64).to_le_bytes());
        }
        let offset = end.next_multiple_of(256);
        end = offset + payload.len();
        payloads.resize(offset, 0);
        payloads.extend(payload);
        entry[24..32].copy_from_slice(&(offset as u64).to_le_bytes());
        entry[32..40].copy_from_slice(&((end - offset) as u64).to_le_bytes());
        table.extend(entry);
    }
    let n_sections = table.len() / ENTRY_BYTES;
    head[12..16].copy_from_slice(&(n_sections as u32).to_le_bytes());
    head[16..24].copy_from_slice(&(end as u64).to_le_bytes());
    payloads[..HEADER_BYTES].copy_from_slice(&head);
    payloads[HEADER_BYTES..HEADER_BYTES + table.len()].copy_from_slice(&table);
    seal(&mut payloads, n_sections);
    payloads
}

/// Makes the checksums of sections, the hash of all of them and the header's checksum right.
fn seal(file: &mut [u8], n_sections: usize) {
    let table = HEADER_BYTES..HEADER_BYTES + n_sections * ENTRY_BYTES;
    let mut hasher = blake3::Hasher::new();
    for at in table.clone().step_by(ENTRY_BYTES) {
        let number = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap_or_default());
        let (offset, length) = (number(at + 24), number(at + 32));
        let end = offset.checked_add(length).filter(|end| *end <= file.len() as u64);
        let payload = end.map_or(&[][..], |end| &file[offset as usize..end as usize]);
        hasher.update(payload);
        let checksum = crc32c::crc32c(payload);
        file[at + 12..at + 16].copy_from_slice(&checksum.to_le_bytes());
    }
    hasher.update(&file[table.clone()]);
    file[24..56].copy_from_slice(hasher.finalize().as_bytes());
    let checksum = crc32c::crc32c_append(crc32c::crc32c(&file[..60]), &file[table]);
    file[60..64].copy_from_slice(&checksum.to_le_bytes());
}

/// A record: one of its arrays, whose length is right again.
pub fn record(bytes: &[u8], most: usize, dice: &mut Dice, change: Change<'_>) -> Vec<u8> {
    let Some((head, mut arrays)) = arrays(bytes).filter(|_| !dice.one_in(16)) else {
        return plain(bytes, most, dice, change);
    };
    let room = most.saturating_sub(bytes.len());
    let mut head = head.to_vec();
    let n_arrays = arrays.len();
    match dice.below(16) {
        0 => {
            change(&mut head, RECORD_HEAD);
            head.resize(RECORD_HEAD, 0);
        }
        1 if n_arrays > 0 => drop(arrays.remove(dice.below(n_arrays))),
        2 if n_arrays > 0 => arrays.insert(dice.below(n_arrays), arrays[dice.below(n_arrays)].clone()),
        _ if n_arrays > 0 => {
            let (element, values) = &mut arrays[dice.below(n_arrays)];
            match values.starts_with(b"{") {
                true => *values = json(values, values.len() + room, dice, change),
                false => change(values, values.len() + room),
            }
            values.truncate(values.len() / *element * *element);
        }
        _ => change(&mut head, most),
    }
    for (element, values) in arrays {
        head.extend(((values.len() / element) as u64).to_le_bytes());
        head.extend(values);
    }
    head
}

/// Bytes of an element, and those of all.
pub(super) type Array = (usize, Vec<u8>);

/// What stands before the arrays of a record, and each of them with the bytes of its elements.
pub(super) fn arrays(bytes: &[u8]) -> Option<(&[u8], Vec<Array>)> {
    let (head, mut rest) = bytes.split_at_checked(RECORD_HEAD)?;
    let mut arrays: Vec<Array> = Vec::new();
    while !rest.is_empty() {
        let element = element_bytes(head, &arrays);
        let (count, behind) = rest.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*count)).ok()?.checked_mul(element)?;
        let (values, behind) = behind.split_at_checked(length)?;
        arrays.push((element, values.to_vec()));
        rest = behind;
    }
    Some((head, arrays))
}

/// Bytes of an element of the array that follows on others.
fn element_bytes(head: &[u8], before: &[Array]) -> usize {
    let number = before.len();
    match head[0] % 4 {
        CELLS => 8,
        LEAF => [16, 4, 2, 2, 16, 4, 1, 1, 1, 4, 4, 8, 16].get(number).copied().unwrap_or(1),
        LAYOUT if number < 5 => [8, 1, 1, 1, 8][number],
        LAYOUT => {
            // Of each mesh: name, source, four numbers, positions, normals, tangents, colors, triangles, variants, and as many sets
            // of coordinates as the last number says.
            const MESH: [usize; 9] = [1, 1, 8, 12, 12, 16, 16, 12, 16];
            let mut first = 5;
            loop {
                let n_sets =
                    before.get(first + 2).and_then(|(_, numbers)| numbers.get(24)).map_or(0, |sets| usize::from(*sets));
                let next = first + MESH.len() + n_sets;
                if number < next {
                    return MESH.get(number - first).copied().unwrap_or(8);
                }
                first = next;
            }
        }
        _ => [32, 1].get(number).copied().unwrap_or(1),
    }
}
