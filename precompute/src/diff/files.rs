//! Two files held against each other without lighting them.

use half::f16;
use localprt_formats::{Baked, Metadata, Scalar, SectionInfo};
use localprt_tools::inputs::short;
use serde::Serialize;
use std::collections::{BTreeSet, HashSet};
use toml::{Table, Value};

/// What differs, without lighting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileDiff {
    /// Neither data nor metadata differ: the content hashes are the same.
    pub identical: bool,
    /// Of both files.
    pub counts: [Counts; 2],
    /// Blocks of transport that both have, by their hashes.
    pub same_blocks: usize,
    /// Fields of the metadata that differ, apart from the options.
    pub metadata: Vec<FieldDiff>,
    /// Options of the bake that differ.
    pub options: Vec<FieldDiff>,
    /// Sections that differ, in the order of the first file.
    pub sections: Vec<SectionDiff>,
}

/// How many of everything a file has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Receivers.
    pub receivers: usize,
    /// Probes.
    pub probes: usize,
    /// Clusters.
    pub clusters: u64,
    /// Values that all clusters keep.
    pub coefficients: u64,
    /// Links of near light.
    pub links: u64,
    /// Blocks of transport.
    pub blocks: usize,
    /// Of the file.
    pub bytes: u64,
}

/// A field or option with both values.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FieldDiff {
    /// Its name.
    pub name: String,
    /// In the first file and in the second; `null` where it is absent.
    pub values: [Option<String>; 2],
}

/// A section that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SectionDiff {
    /// Four letters, as `info` shows them.
    pub section: String,
    /// Elements in the first file and in the second; `null` where it is absent.
    pub counts: [Option<u64>; 2],
    /// Elements that differ, of as many; `null` if there are not as many.
    pub differing: Option<u64>,
    /// Largest absolute difference of two numbers; `null` if there are not as many, or they are no floats.
    pub max_difference: Option<f64>,
}

impl FileDiff {
    /// Compares two files; `bytes` are those of the files.
    pub fn of(files: [&Baked; 2], bytes: [&[u8]; 2]) -> Self {
        let [first, second] = files;
        let hashes = |file: &Baked| file.view().blocks.records.iter().map(|block| block.hash).collect::<Vec<_>>();
        let known: HashSet<[u8; 32]> = hashes(first).into_iter().collect();
        Self {
            identical: first.content_hash() == second.content_hash(),
            counts: files.map(Counts::of),
            same_blocks: hashes(second).iter().filter(|hash| known.contains(*hash)).count(),
            metadata: differing(files.map(fields)),
            options: differing(files.map(|file| options(file.metadata()))),
            sections: sections(files, bytes),
        }
    }
}

impl Counts {
    fn of(file: &Baked) -> Self {
        let view = file.view();
        Self {
            receivers: view.receiver_texel.len(),
            probes: view.probes.len(),
            clusters: view.blocks.total(|block| block.n_clusters),
            coefficients: view.blocks.total(|block| block.n_lights),
            links: view.blocks.total(|block| block.n_links),
            blocks: view.blocks.records.len(),
            bytes: file.file_bytes(),
        }
    }
}

/// Name and value of every field.
type Fields = Vec<(String, String)>;

fn fields(file: &Baked) -> Fields {
    let (major, minor) = file.version();
    let Metadata {
        tool_version,
        scene_path,
        scene_hash,
        lightmap_size,
        direct_size,
        probe_degree,
        receiver_degree,
        sky_degree,
        n_rays,
        bounds,
        options: _,
    } = file.metadata();
    let [low, high] = bounds;
    [
        ("format", format!("{major}.{minor}")),
        ("tool_version", tool_version.clone()),
        ("scene_path", scene_path.clone()),
        ("scene_hash", short(scene_hash)),
        ("lightmap_size", lightmap_size.to_string()),
        ("direct_size", direct_size.to_string()),
        ("probe_degree", probe_degree.to_string()),
        ("receiver_degree", receiver_degree.to_string()),
        ("sky_degree", sky_degree.to_string()),
        ("n_rays", n_rays.to_string()),
        ("bounds", format!("{low:?} to {high:?}")),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

fn options(metadata: &Metadata) -> Fields {
    let options = metadata.options.parse::<Table>().unwrap_or_default();
    let shown = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    options.iter().map(|(key, value)| (key.clone(), shown(value))).collect()
}

/// Those that differ, in the order of the first, then those that only the second has.
fn differing([first, second]: [Fields; 2]) -> Vec<FieldDiff> {
    let value = |fields: &Fields, name: &str| fields.iter().find(|field| field.0 == name).map(|field| field.1.clone());
    let mut named = BTreeSet::new();
    let names = first.iter().chain(&second).map(|(name, _)| name).filter(|&name| named.insert(name));
    let both =
        names.map(|name| FieldDiff { name: name.clone(), values: [&first, &second].map(|all| value(all, name)) });
    both.filter(|field| field.values[0] != field.values[1]).collect()
}

fn sections(files: [&Baked; 2], bytes: [&[u8]; 2]) -> Vec<SectionDiff> {
    let [first, second] = files.map(Baked::sections);
    let other = |section: &SectionInfo| second.iter().find(|other| other.kind == section.kind);
    let is_new = |section: &&SectionInfo| !first.iter().any(|other| other.kind == section.kind);
    let pairs = first.iter().map(|section| [Some(section), other(section)]);
    let pairs = pairs.chain(second.iter().filter(is_new).map(|section| [None, Some(section)]));
    pairs.filter_map(|pair| section(pair, bytes)).collect()
}

/// `None` if nothing differs.
fn section(pair: [Option<&SectionInfo>; 2], [first, second]: [&[u8]; 2]) -> Option<SectionDiff> {
    let payload = |section: &SectionInfo, file: &'_ [u8]| {
        let range = section.offset as usize..(section.offset + section.length) as usize;
        file.get(range).unwrap_or_default().to_vec()
    };
    let counts = pair.map(|section| section.map(|section| section.count));
    let kind = pair.into_iter().flatten().next()?.kind;
    let mut found = SectionDiff { section: kind.to_string(), counts, differing: None, max_difference: None };
    let [Some(a), Some(b)] = pair else { return Some(found) };
    let (of_a, of_b) = (payload(a, first), payload(b, second));
    let is_same_layout = (a.version, a.scalar, a.components) == (b.version, b.scalar, b.components);
    if is_same_layout && of_a == of_b {
        return None;
    }
    if is_same_layout && of_a.len() == of_b.len() {
        let element = (a.scalar.bytes() * u64::from(a.components)).max(1) as usize;
        let elements = of_a.chunks(element).zip(of_b.chunks(element));
        found.differing = Some(elements.filter(|(a, b)| a != b).count() as u64);
        found.max_difference = max_difference(a.scalar, &of_a, &of_b);
    }
    Some(found)
}

/// Of floats; the others are indices, codes and text, of which a difference says nothing.
fn max_difference(scalar: Scalar, first: &[u8], second: &[u8]) -> Option<f64> {
    let number = |bytes: &[u8]| match *bytes {
        [a, b] => f16::from_le_bytes([a, b]).to_f64(),
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]).into(),
        _ => 0.0,
    };
    let size = match scalar {
        Scalar::F16 => 2,
        Scalar::F32 => 4,
        _ => return None,
    };
    let pairs = first.chunks(size).zip(second.chunks(size)).filter(|(a, b)| a != b);
    Some(pairs.map(|(a, b)| (number(a) - number(b)).abs()).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_fields_that_differ_are_told() {
        let fields = |text: &str| -> Fields {
            text.split(' ').filter_map(|pair| pair.split_once('=')).map(|(a, b)| (a.into(), b.into())).collect()
        };
        let found = differing([fields("a=1 b=2 c=3"), fields("c=3 b=5 d=4")]);
        let told: Vec<_> = found.iter().map(|field| (field.name.as_str(), field.values.clone())).collect();
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(told, [("a", [some("1"), None]), ("b", [some("2"), some("5")]), ("d", [None, some("4")])]);
    }

    #[test]
    fn floats_differ_by_numbers_and_indices_do_not() {
        let bytes = |values: [f32; 3]| values.map(f32::to_le_bytes).concat();
        let (a, b) = (bytes([1.0, -2.0, f32::INFINITY]), bytes([1.5, -4.0, f32::INFINITY]));
        assert_eq!(max_difference(Scalar::F32, &a, &b), Some(2.0));
        assert_eq!(max_difference(Scalar::U32, &a, &b), None);
        let halves = |values: [f32; 2]| values.map(|value| f16::from_f32(value).to_le_bytes()).concat();
        assert_eq!(max_difference(Scalar::F16, &halves([1.0, 2.0]), &halves([1.0, 2.5])), Some(0.5));
    }
}
