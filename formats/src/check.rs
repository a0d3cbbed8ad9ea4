//! Invariants across sections: rules 31 to 86 of `SPEC.md`. The same function runs before writing and after opening.
//!
//! [`check`] adds to that every checksum and the content hash, which opening leaves out because they read every byte twice.

use std::fmt;
use std::path::Path;

use half::f16;

use crate::baked::{
    BakedView, ClusterRecord, LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL, Metadata, NEAR_NODES, NEAR_TILE, VolumeView,
    node_level_and_texel,
};
use crate::error::OpenError;
use crate::open;

/// Most relight rays per probe.
pub const MAX_RAYS: u32 = 1 << 20;
/// Most texels per side of the receiver map and of the direct light map: unorm16 positions still tell quarter texels.
pub const MAX_MAP_SIZE: u32 = 16384;
/// Highest SH degree of the receivers.
pub const MAX_RECEIVER_DEGREE: u32 = 1;
/// Highest SH degree of a volume.
pub const MAX_VOLUME_DEGREE: u32 = 2;
/// Most cells of a volume.
pub const MAX_VOLUME_CELLS: u64 = 1 << 22;
/// Most singular values per cluster.
pub const MAX_COEFFICIENTS: u32 = 255;
/// Unit vectors may have a squared length this far from 1: f32 rounding with margin for fast reciprocal roots.
pub const UNIT_TOLERANCE: f32 = 1e-4;

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

/// Full verification of a file: structure, every checksum, the content hash and every invariant. Empty if all hold.
///
/// Damage to the structure hides what lies behind it, so it is reported alone; otherwise every section with a wrong
/// checksum is listed, and the first broken invariant.
///
/// # Errors
/// [`OpenError::Io`] if the file cannot be read; everything else is in the list.
pub fn check(path: impl AsRef<Path>) -> Result<Vec<Violation>, OpenError> {
    Ok(check_bytes(open::map(path.as_ref())?.as_slice()))
}

/// [`check`] of a file in memory.
pub fn check_bytes(file: &[u8]) -> Vec<Violation> {
    open::check_file(file).iter().filter_map(Violation::from_error).collect()
}

impl Violation {
    fn from_error(error: &OpenError) -> Option<Self> {
        let message = match error {
            OpenError::Invalid(violation) => violation.message.clone(),
            other => other.to_string(),
        };
        error.rule().map(|rule| Self { rule, message })
    }
}

/// Checks rules 31 to 86, in order but for 49, and stops at the first that is broken.
///
/// Memory: four bytes per receiver and gutter texel, to find texels that occur twice; likewise for the cells of a volume.
///
/// # Errors
/// The rule, with the place.
pub fn check_invariants(view: &BakedView<'_>) -> Result<(), Violation> {
    check_metadata(view.metadata)?;
    check_lengths(view)?;
    check_probes_and_rays(view)?;
    check_receivers(view)?;
    check_clusters(view, &ClusterSet::of_lightmap(view))?;
    check_gutters_and_seams(view)?;
    if !view.report.is_empty()
        && let Err(error) = serde_json::from_str::<serde::de::IgnoredAny>(view.report)
    {
        return fail(62, format!("report: not JSON: {error}"));
    }
    view.volume.as_ref().map_or(Ok(()), |volume| check_volume(view, volume))?;
    check_near(view)
}

fn fail<T>(rule: u16, message: String) -> Result<T, Violation> {
    Err(Violation { rule, message })
}

/// Rules 31 to 35.
fn check_metadata(metadata: &Metadata) -> Result<(), Violation> {
    let degree = crate::sh::MAX_DEGREE;
    let numbers = [
        (31, "probe_degree", metadata.probe_degree, 0, degree),
        (31, "receiver_degree", metadata.receiver_degree, 0, MAX_RECEIVER_DEGREE),
        (31, "sky_degree", metadata.sky_degree, 0, degree),
        (32, "lightmap_size", metadata.lightmap_size, 1, MAX_MAP_SIZE),
        (32, "direct_size", metadata.direct_size, 1, MAX_MAP_SIZE),
        (33, "n_rays", metadata.n_rays, 1, MAX_RAYS),
    ];
    for (rule, name, found, least, most) in numbers {
        if !(least..=most).contains(&found) {
            return fail(rule, format!("metadata: {name} is {found}, allowed are {least} to {most}"));
        }
    }
    if !metadata.direct_size.is_power_of_two() {
        return fail(32, format!("metadata: direct_size is {}, not a power of two", metadata.direct_size));
    }
    let [low, high] = metadata.bounds;
    for axis in 0..3 {
        if !(low[axis].is_finite() && high[axis].is_finite() && low[axis] <= high[axis]) {
            return fail(34, format!("metadata: bounds {low:?} to {high:?} are not a finite box"));
        }
    }
    let path = metadata.scene_path.as_bytes();
    let drive = path.len() >= 2 && path[0].is_ascii_alphabetic() && path[1] == b':';
    if path.first() == Some(&b'/') || drive || path.iter().any(|byte| *byte == b'\\' || byte.is_ascii_control()) {
        let path = metadata.scene_path.escape_debug();
        return fail(35, format!("metadata: scene path \"{path}\" is not a relative path with / between its parts"));
    }
    Ok(())
}

/// Rule 40.
fn check_lengths(view: &BakedView<'_>) -> Result<(), Violation> {
    let rays = u64::from(view.metadata.n_rays);
    let lookups = (view.probes.len() as u64).checked_mul(rays);
    let receivers = view.receiver_texel.len() as u64;
    let lengths = [
        ("ray_dirs", view.ray_dirs.len(), Some(rays)),
        ("ray_sh", view.ray_sh.len(), rays.checked_mul(view.metadata.n_sh() as u64)),
        ("ray_uv", view.ray_uv.len(), lookups),
        ("ray_level", view.ray_level.len(), lookups),
        ("ray_distance", view.ray_distance.len(), if view.ray_distance.is_empty() { Some(0) } else { lookups }),
        ("receiver_position", view.receiver_position.len(), Some(receivers)),
        ("receiver_normal", view.receiver_normal.len(), Some(receivers)),
        ("receiver_unseen", view.receiver_unseen.len(), Some(receivers)),
    ];
    for (name, found, expected) in lengths {
        if expected != Some(found as u64) {
            let expected = expected.map_or_else(|| "more than any file holds".into(), |expected| expected.to_string());
            return fail(40, format!("{name}: has {found} elements, must have {expected}"));
        }
    }
    let counts =
        [("probes", view.probes.len()), ("receivers", view.receiver_texel.len()), ("clusters", view.clusters.len())];
    for (name, found) in counts {
        if u32::try_from(found).is_err() {
            return fail(40, format!("{name}: {found} are more than 32 bits can number"));
        }
    }
    Ok(())
}

/// Rules 41 to 44, and 49.
fn check_probes_and_rays(view: &BakedView<'_>) -> Result<(), Violation> {
    for (i, probe) in view.probes.iter().enumerate() {
        let radius = probe.support_radius_m;
        if !(is_finite(&probe.position) && radius.is_finite() && radius > 0.0) {
            let position = probe.position;
            return fail(41, format!("probe {i}: position {position:?} or support radius {radius} is not usable"));
        }
    }
    for (i, &[x, y, z, w]) in view.ray_dirs.iter().enumerate() {
        if !is_unit([x, y, z]) || w != 0.0 {
            return fail(42, format!("ray_dirs {i}: [{x}, {y}, {z}, {w}] is not a unit vector followed by 0"));
        }
    }
    if !is_finite(view.ray_sh) {
        return fail(43, format!("ray_sh {}: is not finite", first(view.ray_sh, |value| !value.is_finite())));
    }
    let last_level = view.metadata.direct_size.max(1).ilog2().min(MAX_LEVEL.into()) as u8;
    let is_wrong = |level: &u8| *level > last_level && *level != LEVEL_SKY && *level != LEVEL_BLACK;
    if view.ray_level.iter().fold(false, |wrong, level| wrong | is_wrong(level)) {
        let place = first(view.ray_level, is_wrong);
        let found = view.ray_level[place];
        let allowed = format!("0 to {last_level}, {LEVEL_SKY} and {LEVEL_BLACK}");
        return fail(44, format!("ray_level {place}: is {found}, allowed are {allowed}"));
    }
    // As bits, numbers rise from +0 to infinity; then come NaN and everything negative.
    let is_wrong = |distance: &f16| distance.to_bits() > f16::INFINITY.to_bits();
    if view.ray_distance.iter().fold(false, |wrong, distance| wrong | is_wrong(distance)) {
        let place = first(view.ray_distance, is_wrong);
        let found = view.ray_distance[place];
        return fail(49, format!("ray_distance {place}: is {found}, allowed are +0 to infinity"));
    }
    Ok(())
}

/// Rules 45 to 48.
fn check_receivers(view: &BakedView<'_>) -> Result<(), Violation> {
    let texels = texel_count(view.metadata);
    for (i, &texel) in view.receiver_texel.iter().enumerate() {
        if texel >= texels {
            return fail(45, format!("receiver {i}: texel {texel}, the map has {texels}"));
        }
    }
    if let Some(texel) = first_repeated(view.receiver_texel.to_vec()) {
        return fail(45, format!("receiver map: texel {texel} has two receivers"));
    }
    for (i, position) in view.receiver_position.iter().enumerate() {
        if !is_finite(position) {
            return fail(46, format!("receiver {i}: position {position:?} is not finite"));
        }
    }
    for (i, normal) in view.receiver_normal.iter().enumerate() {
        if !is_unit(*normal) {
            return fail(47, format!("receiver {i}: normal {normal:?} is not a unit vector"));
        }
    }
    for (i, unseen) in view.receiver_unseen.iter().enumerate() {
        if !(0.0..=1.0).contains(unseen) {
            return fail(48, format!("receiver {i}: unseen is {unseen}, allowed are 0 to 1"));
        }
    }
    Ok(())
}

/// Clusters of one set of receivers, with their arrays.
struct ClusterSet<'a> {
    clusters: &'a [ClusterRecord],
    cluster_probes: &'a [u32],
    projection: &'a [f16],
    reconstruction: &'a [f16],
    n_receivers: u64,
    n_k: u64,
}

impl<'a> ClusterSet<'a> {
    fn of_lightmap(view: &BakedView<'a>) -> Self {
        Self {
            clusters: view.clusters,
            cluster_probes: view.cluster_probes,
            projection: view.projection,
            reconstruction: view.reconstruction,
            n_receivers: view.receiver_texel.len() as u64,
            n_k: view.metadata.n_k() as u64,
        }
    }

    fn of_volume(volume: &VolumeView<'a>) -> Self {
        Self {
            clusters: volume.clusters,
            cluster_probes: volume.cluster_probes,
            projection: volume.projection,
            reconstruction: volume.reconstruction,
            n_receivers: volume.cells.len() as u64,
            n_k: volume.grid.n_k() as u64,
        }
    }
}

/// Rules 50 to 58. Offsets are running sums, so every block lies where the one before it ends.
fn check_clusters(view: &BakedView<'_>, set: &ClusterSet<'_>) -> Result<(), Violation> {
    let (n_sh, n_sky, n_probes) = (view.metadata.n_sh() as u64, view.metadata.n_sky() as u64, view.probes.len() as u64);
    let (n_k, n_receivers) = (set.n_k, set.n_receivers);
    let (mut receiver, mut entry, mut light, mut projection, mut reconstruction) = (0u64, 0u64, 0u64, 0u64, 0u64);
    for (i, cluster) in set.clusters.iter().enumerate() {
        // All sums and products below stay far under 2^64: each end is checked against an array before it grows again,
        // columns are at most 2^32 * 121 + 121, coefficients at most 255.
        at(50, i, "first_receiver", cluster.first_receiver, receiver)?;
        receiver += u64::from(cluster.n_receivers);
        if cluster.n_receivers == 0 || receiver > n_receivers {
            let found = cluster.n_receivers;
            return fail(
                50,
                format!("cluster {i}: {found} receivers from {}, there are {n_receivers}", cluster.first_receiver),
            );
        }
        at(51, i, "first_probe", cluster.first_probe, entry)?;
        let first_entry = entry as usize;
        entry += u64::from(cluster.n_probes);
        let Some(listed) = usize::try_from(entry).ok().and_then(|end| set.cluster_probes.get(first_entry..end)) else {
            let present = set.cluster_probes.len();
            return fail(51, format!("cluster {i}: its probes end at entry {entry}, cluster_probes has {present}"));
        };
        if let Some(pair) = listed.windows(2).find(|pair| pair[0] >= pair[1]) {
            return fail(51, format!("cluster {i}: probe {} follows probe {}, ids must rise", pair[1], pair[0]));
        }
        if let Some(&last) = listed.last().filter(|last| u64::from(**last) >= n_probes) {
            return fail(51, format!("cluster {i}: probe {last}, there are {n_probes}"));
        }
        if cluster.n_sky != 0 && u64::from(cluster.n_sky) != n_sky {
            return fail(52, format!("cluster {i}: {} sky columns, allowed are 0 and {n_sky}", cluster.n_sky));
        }
        let n_c = u64::from(cluster.n_coefficients);
        if n_c > u64::from(MAX_COEFFICIENTS) {
            return fail(53, format!("cluster {i}: {n_c} coefficients, at most {MAX_COEFFICIENTS} are allowed"));
        }
        at(54, i, "first_light", cluster.first_light, light)?;
        light += n_c;
        at(55, i, "projection_pair", cluster.projection_pair, projection)?;
        let columns = u64::from(cluster.n_probes) * n_sh + u64::from(cluster.n_sky);
        projection = block_end(55, i, "projection", set.projection, projection, n_c * columns)?;
        at(56, i, "reconstruction_pair", cluster.reconstruction_pair, reconstruction)?;
        let rows = u64::from(cluster.n_receivers) * n_k;
        reconstruction = block_end(56, i, "reconstruction", set.reconstruction, reconstruction, rows * n_c)?;
        if cluster.reserved != 0 {
            return fail(57, format!("cluster {i}: reserved is {}, must be 0", cluster.reserved));
        }
    }
    let totals = [
        (50, "receivers", receiver, n_receivers),
        (51, "cluster_probes", entry, set.cluster_probes.len() as u64),
        (55, "projection", 2 * projection, set.projection.len() as u64),
        (56, "reconstruction", 2 * reconstruction, set.reconstruction.len() as u64),
    ];
    for (rule, name, used, present) in totals {
        if used != present {
            return fail(rule, format!("{name}: clusters use {used} of {present}"));
        }
    }
    for (name, values) in [("projection", set.projection), ("reconstruction", set.reconstruction)] {
        if values.iter().fold(false, |wrong, value| wrong | !value.is_finite()) {
            return fail(58, format!("{name} {}: is not finite", first(values, |value| !value.is_finite())));
        }
    }
    Ok(())
}

fn at(rule: u16, cluster: usize, name: &str, found: u32, expected: u64) -> Result<(), Violation> {
    if u64::from(found) == expected {
        return Ok(());
    }
    fail(rule, format!("cluster {cluster}: {name} is {found}, must be {expected}"))
}

/// End, in pairs, of a block of `n_values` that starts at pair `start`; its padding value, if any, is 0.
fn block_end(
    rule: u16,
    cluster: usize,
    name: &str,
    values: &[f16],
    start: u64,
    n_values: u64,
) -> Result<u64, Violation> {
    let end = start + n_values.div_ceil(2);
    let present = values.len() as u64 / 2;
    if end > present {
        return fail(rule, format!("cluster {cluster}: its {name} ends at pair {end}, the array has {present}"));
    }
    if n_values % 2 == 1 && values[2 * end as usize - 1].to_bits() != 0 {
        return fail(rule, format!("cluster {cluster}: the padding value of its {name} is not 0"));
    }
    Ok(end)
}

/// Rules 60 and 61.
fn check_gutters_and_seams(view: &BakedView<'_>) -> Result<(), Violation> {
    let texels = texel_count(view.metadata);
    let n_receivers = view.receiver_texel.len();
    for (i, &[texel, receiver]) in view.gutters.iter().enumerate() {
        if texel >= texels || receiver as usize >= n_receivers {
            let there = format!("there are {texels} texels and {n_receivers} receivers");
            return fail(60, format!("gutter {i}: texel {texel} takes receiver {receiver}, {there}"));
        }
    }
    if !view.gutters.is_empty() {
        let filled = view.receiver_texel.iter().copied().chain(view.gutters.iter().map(|gutter| gutter[0])).collect();
        if let Some(texel) = first_repeated(filled) {
            return fail(60, format!("gutters: texel {texel} is filled twice, or has a receiver"));
        }
    }
    for (i, &[a, b]) in view.seams.iter().enumerate() {
        if a == b || a as usize >= n_receivers || b as usize >= n_receivers {
            return fail(61, format!("seam {i}: receivers {a} and {b}, must be two of {n_receivers}"));
        }
    }
    Ok(())
}

/// Rules 71 to 76.
fn check_volume(view: &BakedView<'_>, volume: &VolumeView<'_>) -> Result<(), Violation> {
    let grid = volume.grid;
    let spacing = grid.spacing_m;
    let end = |axis: usize| grid.origin[axis] + grid.dims[axis] as f32 * spacing;
    if !(is_finite(&grid.origin) && spacing > 0.0 && is_finite(&[end(0), end(1), end(2)])) {
        let origin = grid.origin;
        return fail(71, format!("volume: origin {origin:?} or spacing {spacing} is not usable"));
    }
    let n_cells = grid.n_cells();
    if !(1..=MAX_VOLUME_CELLS).contains(&n_cells) {
        let dims = grid.dims;
        return fail(72, format!("volume: {dims:?} are {n_cells} cells, allowed are 1 to {MAX_VOLUME_CELLS}"));
    }
    if !(1..=MAX_VOLUME_DEGREE).contains(&grid.degree) {
        return fail(73, format!("volume: degree is {}, allowed are 1 to {MAX_VOLUME_DEGREE}", grid.degree));
    }
    for (i, &cell) in volume.cells.iter().enumerate() {
        if u64::from(cell) >= n_cells {
            return fail(74, format!("volume receiver {i}: cell {cell}, there are {n_cells}"));
        }
    }
    if let Some(cell) = first_repeated(volume.cells.to_vec()) {
        return fail(74, format!("volume: cell {cell} has two receivers"));
    }
    check_clusters(view, &ClusterSet::of_volume(volume))
        .map_err(|violation| Violation { message: format!("volume {}", violation.message), ..violation })?;
    let mut has_receiver = vec![false; n_cells as usize];
    volume.cells.iter().for_each(|cell| has_receiver[*cell as usize] = true);
    for (i, &[cell, source]) in volume.fill.iter().enumerate() {
        if u64::from(cell) >= n_cells || has_receiver.get(source as usize) != Some(&true) {
            return fail(75, format!("volume fill {i}: cell {cell} takes cell {source}, which must have a receiver"));
        }
    }
    let filled = volume.cells.iter().copied().chain(volume.fill.iter().map(|fill| fill[0])).collect();
    match first_repeated(filled) {
        Some(cell) => fail(76, format!("volume fill: cell {cell} is filled twice, or has a receiver")),
        None => Ok(()),
    }
}

/// Rules 80 to 86: near light, if there is any.
///
/// # Errors
/// The rule, with the place.
pub fn check_near(view: &BakedView<'_>) -> Result<(), Violation> {
    let Some(near) = &view.near else { return Ok(()) };
    let (n_receivers, n_links) = (view.receiver_texel.len(), near.links.len());
    let ([first, ..], Some(end)) = (near.tiles, near.tiles.last()) else {
        return fail(80, "near light: there is no tile".into());
    };
    if near.counts.len() != n_receivers {
        return fail(81, format!("near light: {} counts of links for {n_receivers} receivers", near.counts.len()));
    }
    let starts = [first.first_receiver, first.first_node, first.first_link];
    let ends = [end.first_receiver, end.first_node, end.first_link].map(|end| end as usize);
    if starts != [0; 3] || ends != [n_receivers, near.nodes.len(), n_links] {
        return fail(81, format!("near light: tiles go from {starts:?} to {ends:?}, not over all arrays"));
    }
    for (i, pair) in near.tiles.windows(2).enumerate() {
        let [tile, next] = [pair[0], pair[1]];
        let receivers = tile.first_receiver..next.first_receiver;
        let n_nodes = next.first_node.checked_sub(tile.first_node);
        if !(1..=NEAR_TILE as usize).contains(&receivers.len())
            || n_nodes.is_none_or(|nodes| nodes > NEAR_NODES)
            || next.first_receiver as usize > n_receivers
        {
            return fail(82, format!("near tile {i}: receivers {receivers:?} with {n_nodes:?} nodes"));
        }
        let counts = &near.counts[tile.first_receiver as usize..next.first_receiver as usize];
        let expected = u64::from(tile.first_link) + counts.iter().map(|count| u64::from(*count)).sum::<u64>();
        if u64::from(next.first_link) != expected {
            return fail(83, format!("near tile {i}: links end at {}, must end at {expected}", next.first_link));
        }
        if !(tile.scale.is_finite() && tile.scale >= 0.0) {
            return fail(84, format!("near tile {i}: scale {} is not usable", tile.scale));
        }
        let links = near.links.get(tile.first_link as usize..next.first_link as usize).unwrap_or_default();
        if let Some(link) = links.iter().position(|link| u32::from(*link) >= n_nodes.unwrap_or_default()) {
            return fail(86, format!("near tile {i}: link {link} to node {} of {n_nodes:?}", links[link]));
        }
    }
    // Levels halve rounded up.
    let direct_size = view.metadata.direct_size.max(1);
    if end.scale.to_bits() != 0 {
        return fail(84, format!("near light: the last tile's scale is {}, must be 0", end.scale));
    }
    let last_level = direct_size.next_power_of_two().ilog2().min(MAX_LEVEL.into());
    for (i, &node) in near.nodes.iter().enumerate() {
        let (level, texel) = node_level_and_texel(node);
        let size = u64::from(direct_size.div_ceil(1 << level));
        if level > last_level || u64::from(texel) >= size * size {
            return fail(85, format!("near node {i}: texel {texel} of level {level}, whose size is {size}"));
        }
    }
    if near.weights.len() as u64 != n_links as u64 * view.metadata.n_k() as u64 {
        return fail(86, format!("near light: {} weights for {n_links} links", near.weights.len()));
    }
    Ok(())
}

/// Texels of the receiver map; rule 32 keeps it within 2^28.
fn texel_count(metadata: &Metadata) -> u32 {
    metadata.lightmap_size * metadata.lightmap_size
}

fn first_repeated(mut values: Vec<u32>) -> Option<u32> {
    values.sort_unstable();
    values.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

/// Without early exit, so that it vectorizes.
fn is_finite(values: &[f32]) -> bool {
    values.iter().fold(true, |finite, value| finite & value.is_finite())
}

fn is_unit(vector: [f32; 3]) -> bool {
    // NaN fails the comparison.
    (vector.iter().map(|value| value * value).sum::<f32>() - 1.0).abs() <= UNIT_TOLERANCE
}

/// Place of the first value that is wrong; the caller knows there is one.
fn first<T>(values: &[T], is_wrong: impl Fn(&T) -> bool) -> usize {
    values.iter().position(is_wrong).unwrap_or(0)
}
