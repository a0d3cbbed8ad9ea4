//! Blocks of transport: rules 50 to 54 of their table, which opening checks, and 55 to 59 and 81 to 89 of what is in them, which
//! are checked when a block is first used.

use crate::baked::MAX_LEVEL;
use crate::block::{
    BlockParts, BlockRecord, BlockShape, Blocks, ClusterRecord, MAX_COEFFICIENTS, NEAR_NODES, NEAR_TILE,
    TransportBlock, bounds_of, node_level_and_texel,
};
use crate::error::{Violation, fail};
use half::f16;

/// Rules 50 to 54: the table, and where the bytes of the blocks lie. `positions` are those of all receivers.
pub(crate) fn check_table(blocks: Blocks<'_>, positions: &[[f32; 3]], shape: BlockShape) -> Result<(), Violation> {
    let of = shape.of;
    let (mut receiver, mut end) = (0u64, 0u64);
    for (i, record) in blocks.records.iter().enumerate() {
        let first_receiver = receiver;
        receiver += u64::from(record.n_receivers);
        if record.n_receivers == 0 || receiver > positions.len() as u64 {
            let (found, there) = (record.n_receivers, positions.len());
            return fail(50, format!("{of}block {i}: {found} receivers from {first_receiver}, there are {there}"));
        }
        if record.first_byte() != end {
            return fail(51, format!("{of}block {i}: starts at byte {}, must start at {end}", record.first_byte()));
        }
        // Counts are below 2^32, so no sum of blocks that lie in memory comes near 2^64.
        end += record.byte_count(shape.n_k);
        let present = 4 * blocks.data.len() as u64;
        if end > present {
            return fail(51, format!("{of}block {i}: ends at byte {end}, there are {present}"));
        }
        let bounds = bounds_of(&positions[first_receiver as usize..receiver as usize]);
        // To the bit, as everything: -0 is not 0.
        if bytemuck::bytes_of(&bounds) != bytemuck::bytes_of(&record.bounds) {
            let found = record.bounds;
            return fail(52, format!("{of}block {i}: box is {found:?}, that of its receivers is {bounds:?}"));
        }
        if record.reserved != [0; 6] {
            return fail(53, format!("{of}block {i}: reserved is {:?}, must be 0", record.reserved));
        }
        if (record.n_tiles == 0) != (record.n_links == 0) || (record.n_tiles == 0 && record.n_nodes > 0) {
            let (tiles, nodes, links) = (record.n_tiles, record.n_nodes, record.n_links);
            return fail(54, format!("{of}block {i}: {tiles} tiles, {nodes} nodes, {links} links: all or none"));
        }
        // Each has a receiver at least. Readers make room for as many before they look at them.
        for (rule, name, found) in [(55, "clusters", record.n_clusters), (81, "tiles", record.n_tiles)] {
            if found > record.n_receivers {
                let most = record.n_receivers;
                return fail(rule, format!("{of}block {i}: {found} {name} for {most} receivers"));
            }
        }
    }
    if receiver != positions.len() as u64 {
        return fail(50, format!("{of}blocks: hold {receiver} receivers of {}", positions.len()));
    }
    if end != 4 * blocks.data.len() as u64 {
        return fail(51, format!("{of}blocks: end at byte {end} of {}", 4 * blocks.data.len()));
    }
    Ok(())
}

/// Rules 55 to 59 and 81 to 87 of one block of a table that has been checked: its arrays.
pub(crate) fn check_block<'a>(
    blocks: Blocks<'a>,
    index: usize,
    shape: BlockShape,
) -> Result<BlockParts<'a>, Violation> {
    let Some((parts, padding)) = blocks.parts(index, shape.n_k) else {
        return fail(51, format!("{}block {index}: its bytes are not there", shape.of));
    };
    let within = |violation: Violation| Violation {
        message: format!("{}block {index}, {}", shape.of, violation.message),
        ..violation
    };
    check_parts(&blocks.records[index], &parts, shape).map_err(within)?;
    if padding.iter().any(|byte| *byte != 0) {
        return fail(87, format!("{}block {index}: bytes that fill it up are not 0", shape.of));
    }
    Ok(parts)
}

impl TransportBlock {
    /// Checks all that can be told of a block of so many receivers before it is stored: that its arrays fit each other, and rules 55
    /// to 59 and 81 to 86 of `SPEC.md`.
    ///
    /// # Errors
    /// The first broken rule.
    pub fn check(&self, n_receivers: usize, shape: BlockShape) -> Result<(), Violation> {
        if !self.fits(n_receivers, shape.n_k) {
            return fail(51, format!("{}block: its arrays do not fit each other", shape.of));
        }
        let record = self.record(n_receivers);
        if record.n_clusters > record.n_receivers || record.n_tiles > record.n_receivers {
            return fail(55, format!("{}block: more clusters or tiles than its {n_receivers} receivers", shape.of));
        }
        check_parts(&record, &self.parts(), shape)
    }
}

/// Rules 55 to 59 and 81 to 86: what is in the arrays of a block.
fn check_parts(record: &BlockRecord, parts: &BlockParts<'_>, shape: BlockShape) -> Result<(), Violation> {
    check_clusters(record, parts, shape)?;
    check_near(record, parts, shape)
}

/// Rules 88 and 89: checksum and hash of every block.
pub(crate) fn check_hashes(blocks: Blocks<'_>, shape: BlockShape) -> Result<(), Violation> {
    for (i, record) in blocks.records.iter().enumerate() {
        let bytes = blocks.bytes(i, shape.n_k).unwrap_or_default();
        let computed = crc32c::crc32c(bytes);
        if computed != record.checksum {
            let (of, stated) = (shape.of, record.checksum);
            return fail(88, format!("{of}block {i}: checksum is {computed:08x}, stated is {stated:08x}"));
        }
        if *blake3::hash(bytes).as_bytes() != record.hash {
            return fail(89, format!("{}block {i}: hash differs from the stated one", shape.of));
        }
    }
    Ok(())
}

/// Rules 55 to 59. Nothing states where the entries of a cluster begin: they follow those of the one before.
fn check_clusters(record: &BlockRecord, parts: &BlockParts<'_>, shape: BlockShape) -> Result<(), Violation> {
    let (mut receivers, mut lights) = (0u64, 0u64);
    let mut probes = parts.cluster_probes;
    let (mut projection, mut reconstruction) = (parts.projection, parts.reconstruction);
    for (i, cluster) in parts.clusters.iter().enumerate() {
        let ClusterRecord { n_receivers, n_probes, n_sky, n_coefficients } = *cluster;
        receivers += u64::from(n_receivers);
        if n_receivers == 0 || receivers > u64::from(record.n_receivers) {
            let there = record.n_receivers;
            return fail(55, format!("cluster {i}: {n_receivers} receivers, the block has {there}"));
        }
        let Some((listed, rest)) = probes.split_at_checked(n_probes as usize) else {
            return fail(56, format!("cluster {i}: {n_probes} probes, {} are left in the block", probes.len()));
        };
        probes = rest;
        if let Some(pair) = listed.windows(2).find(|pair| pair[0] >= pair[1]) {
            return fail(56, format!("cluster {i}: probe {} follows probe {}, ids must rise", pair[1], pair[0]));
        }
        if let Some(&last) = listed.last().filter(|last| **last as usize >= shape.n_probes) {
            return fail(56, format!("cluster {i}: probe {last}, there are {}", shape.n_probes));
        }
        if n_sky != 0 && n_sky as usize != shape.n_sky {
            return fail(57, format!("cluster {i}: {n_sky} sky columns, allowed are 0 and {}", shape.n_sky));
        }
        if n_coefficients > MAX_COEFFICIENTS {
            let most = MAX_COEFFICIENTS;
            return fail(57, format!("cluster {i}: {n_coefficients} coefficients, at most {most} are allowed"));
        }
        lights += u64::from(n_coefficients);
        // Listed probes lie in memory, so products stay far below 2^64.
        let columns = u64::from(n_probes) * shape.n_sh as u64 + u64::from(n_sky);
        let rows = u64::from(n_receivers) * shape.n_k as u64;
        projection = check_matrix(i, "projection", projection, u64::from(n_coefficients) * columns)?;
        reconstruction = check_matrix(i, "reconstruction", reconstruction, rows * u64::from(n_coefficients))?;
    }
    let totals = [
        (55, "receivers", receivers, u64::from(record.n_receivers)),
        (56, "probes", (parts.cluster_probes.len() - probes.len()) as u64, u64::from(record.n_cluster_probes)),
        (57, "lights", lights, u64::from(record.n_lights)),
        (58, "projection values", (parts.projection.len() - projection.len()) as u64, parts.projection.len() as u64),
        (
            58,
            "reconstruction values",
            (parts.reconstruction.len() - reconstruction.len()) as u64,
            parts.reconstruction.len() as u64,
        ),
    ];
    for (rule, name, used, stated) in totals {
        if used != stated {
            return fail(rule, format!("{name}: its clusters have {used}, the block {stated}"));
        }
    }
    for (name, values) in [("projection", parts.projection), ("reconstruction", parts.reconstruction)] {
        // Without early exit, so that it vectorizes.
        if values.iter().fold(false, |wrong, value| wrong | !value.is_finite()) {
            return fail(59, format!("{name} {}: is not finite", first(values, |value| !value.is_finite())));
        }
    }
    Ok(())
}

/// What follows a matrix of `n_values`; its padding value, if any, is 0.
fn check_matrix<'a>(cluster: usize, name: &str, values: &'a [f16], n_values: u64) -> Result<&'a [f16], Violation> {
    let taken = n_values.next_multiple_of(2);
    let split = usize::try_from(taken).ok().and_then(|taken| values.split_at_checked(taken));
    let Some((own, rest)) = split else {
        let left = values.len();
        return fail(58, format!("cluster {cluster}: its {name} has {taken} values, {left} are left in the block"));
    };
    if n_values % 2 == 1 && own.last().is_some_and(|value| value.to_bits() != 0) {
        return fail(58, format!("cluster {cluster}: the padding value of its {name} is not 0"));
    }
    Ok(rest)
}

/// Rules 81 to 86: near light of the block, if there is any.
fn check_near(record: &BlockRecord, parts: &BlockParts<'_>, shape: BlockShape) -> Result<(), Violation> {
    let (mut receivers, mut nodes, mut n_links) = (0u64, 0u64, 0u64);
    for (i, tile) in parts.tiles.iter().enumerate() {
        let first_receiver = receivers as usize;
        receivers += u64::from(tile.n_receivers);
        nodes += u64::from(tile.n_nodes);
        if !(1..=NEAR_TILE).contains(&tile.n_receivers) || receivers > u64::from(record.n_receivers) {
            let (found, there) = (tile.n_receivers, record.n_receivers);
            return fail(81, format!("tile {i}: {found} receivers, at most {NEAR_TILE} of {there} are allowed"));
        }
        if tile.n_nodes > NEAR_NODES || nodes > u64::from(record.n_nodes) {
            let (found, there) = (tile.n_nodes, record.n_nodes);
            return fail(82, format!("tile {i}: {found} nodes, at most {NEAR_NODES} of {there} are allowed"));
        }
        let counts = &parts.counts[first_receiver..receivers as usize];
        let counted: u64 = counts.iter().map(|count| u64::from(*count)).sum();
        if counted != u64::from(tile.n_links) {
            return fail(83, format!("tile {i}: {} links, its receivers have {counted}", tile.n_links));
        }
        let first_link = n_links as usize;
        n_links += counted;
        let Some(links) = parts.links.get(first_link..n_links as usize) else {
            return fail(83, format!("tile {i}: links end at {n_links}, the block has {}", record.n_links));
        };
        if !(tile.scale.is_finite() && tile.scale >= 0.0) {
            return fail(84, format!("tile {i}: scale {} is not usable", tile.scale));
        }
        if let Some(link) = links.iter().position(|link| u32::from(*link) >= tile.n_nodes) {
            return fail(86, format!("tile {i}: link {link} to node {} of {}", links[link], tile.n_nodes));
        }
    }
    let totals = [
        (81, "receivers", receivers, if record.n_tiles > 0 { u64::from(record.n_receivers) } else { 0 }),
        (82, "nodes", nodes, u64::from(record.n_nodes)),
        (83, "links", n_links, u64::from(record.n_links)),
    ];
    for (rule, name, used, stated) in totals {
        if used != stated {
            return fail(rule, format!("near light: tiles have {used} {name}, the block {stated}"));
        }
    }
    let last_level = shape.direct_size.max(1).ilog2().min(MAX_LEVEL.into());
    for (i, &node) in parts.nodes.iter().enumerate() {
        let (level, texel) = node_level_and_texel(node);
        let size = u64::from(shape.direct_size.checked_shr(level).unwrap_or(0));
        if level > last_level || u64::from(texel) >= size * size {
            return fail(85, format!("near node {i}: texel {texel} of level {level}, whose size is {size}"));
        }
    }
    Ok(())
}

/// Place of the first value that is wrong; the caller knows there is one.
pub(crate) fn first<T>(values: &[T], is_wrong: impl Fn(&T) -> bool) -> usize {
    values.iter().position(is_wrong).unwrap_or(0)
}
