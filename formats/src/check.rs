//! Invariants across sections: rules 31 to 77 of `SPEC.md`. The same functions run before writing and after opening.

use half::f16;

use crate::baked::{BakedArrays, BakedView, LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL, Metadata, VolumeView};
use crate::check_blocks::{check_hashes, check_table, first};
use crate::error::{Violation, fail};
use crate::transport::Checked;

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
/// Unit vectors may have a squared length this far from 1: f32 rounding with margin for fast reciprocal roots.
pub const UNIT_TOLERANCE: f32 = 1e-4;

/// Checks everything but what is in the blocks of transport: rules 31 to 54, 60 to 62 and 70 to 77. Stops at the first that is
/// broken.
///
/// Memory: four bytes per receiver and gutter texel, to find texels that occur twice; likewise for the cells of a volume.
///
/// # Errors
/// The rule, with the place.
pub(crate) fn check_tables(view: &BakedView<'_>) -> Result<(), Violation> {
    check_metadata(view.metadata)?;
    check_lengths(view)?;
    check_probes_and_rays(view)?;
    check_receivers(view)?;
    check_table(view.blocks, view.receiver_position, view.shape())?;
    check_gutters_and_seams(view)?;
    for (name, text) in [("report", view.report), ("plan", view.plan)] {
        if !text.is_empty()
            && let Err(error) = serde_json::from_str::<serde::de::IgnoredAny>(text)
        {
            return fail(62, format!("{name}: not JSON: {error}"));
        }
    }
    view.volume.as_ref().map_or(Ok(()), |volume| check_volume(view, volume))
}

/// Checks all rules from 31 on, those of checksums and hashes of blocks too.
///
/// # Errors
/// The rule, with the place.
pub fn check_invariants(view: &BakedView<'_>) -> Result<(), Violation> {
    check_tables(view)?;
    Checked::of_tables(*view)?;
    check_hashes(view.blocks, view.shape())?;
    view.volume.map_or(Ok(()), |volume| check_hashes(volume.blocks, volume.shape(view)))
}

impl BakedArrays {
    /// The arrays with every rule checked but those of checksums and hashes of blocks: what relighters take.
    ///
    /// # Errors
    /// The first broken rule.
    pub fn checked(&self) -> Result<Checked<'_>, Violation> {
        let view = self.view();
        check_tables(&view)?;
        Checked::of_tables(view)
    }
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
    let counts = [("probes", view.probes.len()), ("receivers", view.receiver_texel.len())];
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

/// Rules 71 to 77, and 50 to 54 of its blocks.
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
    let positions: Vec<[f32; 3]> = volume.cells.iter().map(|&cell| grid.position(cell as usize)).collect();
    check_table(volume.blocks, &positions, volume.shape(view))?;
    if let Some(block) = volume.blocks.records.iter().position(|block| block.n_tiles > 0) {
        return fail(77, format!("volume block {block}: has near light"));
    }
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
