//! Blocks of transport: what one leaf of receivers needs, in one run of bytes, without an offset that reaches out of it.
//!
//! A block is the unit in which transport is made, stored, read and checked. The lightmap's transport is a list of blocks and so is
//! that of a volume: a table of [`BlockRecord`]s, and the bytes of all blocks. `SPEC.md`, 3.1.

use crate::header::ALIGNMENT;
use bytemuck::{Pod, Zeroable};
use half::f16;

/// Most receivers of a tile of near light.
pub const NEAR_TILE: u32 = 64;
/// Most nodes of a tile of near light.
pub const NEAR_NODES: u32 = 256;
/// Most singular values per cluster.
pub const MAX_COEFFICIENTS: u32 = 255;

/// Entry of a block table: how many of everything a block has, and where its bytes lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BlockRecord {
    /// Receivers, at least 1; those of all blocks follow each other.
    pub n_receivers: u32,
    /// Clusters.
    pub n_clusters: u32,
    /// Supporting probes of all its clusters.
    pub n_cluster_probes: u32,
    /// Kept singular values of all its clusters.
    pub n_lights: u32,
    /// Pairs of f16 in its `S V^T`.
    pub projection_pairs: u32,
    /// Pairs of f16 in its `U`.
    pub reconstruction_pairs: u32,
    /// Tiles of near light; 0 if no receiver has a link.
    pub n_tiles: u32,
    /// Nodes of its tiles.
    pub n_nodes: u32,
    /// Links of its receivers.
    pub n_links: u32,
    /// CRC-32C of its bytes.
    pub checksum: u32,
    /// Its first byte among those of all blocks: low and high half of a u64.
    pub offset: [u32; 2],
    /// Least box of its receivers' positions, metres.
    pub bounds: [[f32; 3]; 2],
    /// BLAKE3 of its bytes: blocks of the same hash are the same.
    pub hash: [u8; 32],
    /// 0.
    pub reserved: [u32; 6],
}

impl BlockRecord {
    /// First byte among those of all blocks.
    pub fn first_byte(&self) -> u64 {
        u64::from(self.offset[0]) | u64::from(self.offset[1]) << 32
    }

    /// Bytes of each array, in their order in the block.
    fn part_bytes(&self, n_k: usize) -> [u64; 9] {
        let bytes = |count: u32, each: usize| u64::from(count) * each as u64;
        [
            bytes(self.n_clusters, size_of::<ClusterRecord>()),
            bytes(self.n_cluster_probes, 4),
            bytes(self.projection_pairs, 4),
            bytes(self.reconstruction_pairs, 4),
            bytes(self.n_tiles, size_of::<NearTile>()),
            bytes(self.n_nodes, 4),
            if self.n_tiles > 0 { self.n_receivers.into() } else { 0 },
            self.n_links.into(),
            bytes(self.n_links, n_k),
        ]
    }

    /// Bytes of the block, with the zeros that fill it up.
    pub fn byte_count(&self, n_k: usize) -> u64 {
        self.part_bytes(n_k).iter().sum::<u64>().next_multiple_of(ALIGNMENT)
    }
}

/// One cluster of receivers: how many of the block's entries are its own; they follow those of the clusters before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ClusterRecord {
    /// Number of receivers, at least 1.
    pub n_receivers: u32,
    /// Number of supporting probes; their ids rise.
    pub n_probes: u32,
    /// Sky columns after the probe columns: 0, or `(sky_degree + 1)^2`.
    pub n_sky: u32,
    /// Number of kept singular values n_c; 0 for a cluster that sees nothing.
    pub n_coefficients: u32,
}

/// Receivers that read near light together, at most [`NEAR_TILE`]: how many of the block's entries are the tile's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct NearTile {
    /// Number of receivers, at least 1.
    pub n_receivers: u32,
    /// Number of nodes, at most [`NEAR_NODES`].
    pub n_nodes: u32,
    /// Number of links.
    pub n_links: u32,
    /// Weight of the code 127.
    pub scale: f32,
}

/// One block, owned: what a leaf of the bake makes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransportBlock {
    /// `[n_clusters]`.
    pub clusters: Vec<ClusterRecord>,
    /// Supporting probes of all clusters, cluster by cluster.
    pub cluster_probes: Vec<u32>,
    /// `S V^T` of all clusters: rows of `n_probes * n_sh + n_sky` columns, row-major, each padded with a zero to pairs.
    pub projection: Vec<f16>,
    /// `U` of all clusters: `n_receivers * n_k` rows of `n_coefficients`, row-major, receiver by receiver; padded likewise.
    pub reconstruction: Vec<f16>,
    /// What its receivers read from the light map; empty if they read nothing.
    pub near: NearArrays,
}

/// Near light of a block: texels of mip levels of the direct light map that receivers read beside their probes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NearArrays {
    /// `[n_tiles]`.
    pub tiles: Vec<NearTile>,
    /// Nodes of all tiles: mip level in the upper 4 bits, `y * size of the level + x` below.
    pub nodes: Vec<u32>,
    /// `[n_receivers]` links of each; empty without tiles.
    pub counts: Vec<u8>,
    /// `[n_links]` node of each, by its place in the tile's.
    pub links: Vec<u8>,
    /// `[n_links][n_k]` codes of [`crate::quantize::near_weight`].
    pub weights: Vec<i8>,
}

/// Node of a texel of a level, `y * size of the level + x`.
pub fn node_at(level: u32, texel: u32) -> u32 {
    (level << 28) | texel
}

/// Level of a node, and its texel there, `y * size of the level + x`.
pub fn node_level_and_texel(node: u32) -> (u32, u32) {
    (node >> 28, node & 0x0fff_ffff)
}

impl TransportBlock {
    /// Appends a cluster: its counts, its probes, and its matrices without padding.
    pub fn push(&mut self, cluster: ClusterRecord, probes: &[u32], projection: &[f16], reconstruction: &[f16]) {
        self.clusters.push(cluster);
        self.cluster_probes.extend_from_slice(probes);
        for (all, own) in [(&mut self.projection, projection), (&mut self.reconstruction, reconstruction)] {
            all.extend_from_slice(own);
            all.extend((own.len() % 2 == 1).then_some(f16::ZERO));
        }
    }

    /// Number of its receivers.
    pub fn n_receivers(&self) -> usize {
        self.clusters.iter().map(|cluster| cluster.n_receivers as usize).sum()
    }

    /// Whether arrays have the same length that are to, or one that follows from another's, and all can be counted.
    pub(crate) fn fits(&self, n_receivers: usize, n_k: usize) -> bool {
        let NearArrays { tiles, nodes, counts, links, weights } = &self.near;
        let n_counts = if tiles.is_empty() { 0 } else { n_receivers };
        let longest = [n_receivers, self.cluster_probes.len(), self.projection.len(), self.reconstruction.len()];
        let shorter = [nodes.len(), links.len(), tiles.len(), self.clusters.len()];
        counts.len() == n_counts
            && Some(weights.len()) == links.len().checked_mul(n_k)
            && (self.projection.len() | self.reconstruction.len()).is_multiple_of(2)
            && longest.iter().chain(&shorter).all(|len| u32::try_from(*len).is_ok())
    }

    /// Its counts, which fit.
    pub(crate) fn record(&self, n_receivers: usize) -> BlockRecord {
        BlockRecord {
            n_receivers: n_receivers as u32,
            n_clusters: self.clusters.len() as u32,
            n_cluster_probes: self.cluster_probes.len() as u32,
            n_lights: self.clusters.iter().fold(0, |sum: u32, cluster| sum.wrapping_add(cluster.n_coefficients)),
            projection_pairs: (self.projection.len() / 2) as u32,
            reconstruction_pairs: (self.reconstruction.len() / 2) as u32,
            n_tiles: self.near.tiles.len() as u32,
            n_nodes: self.near.nodes.len() as u32,
            n_links: self.near.links.len() as u32,
            ..BlockRecord::default()
        }
    }

    pub(crate) fn parts(&self) -> BlockParts<'_> {
        BlockParts {
            clusters: &self.clusters,
            cluster_probes: &self.cluster_probes,
            projection: &self.projection,
            reconstruction: &self.reconstruction,
            tiles: &self.near.tiles,
            nodes: &self.near.nodes,
            counts: &self.near.counts,
            links: &self.near.links,
            weights: &self.near.weights,
        }
    }
}

/// Blocks as they are stored, owned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockArrays {
    /// `[n_blocks]`.
    pub records: Vec<BlockRecord>,
    /// Bytes of all blocks, four to a word.
    pub data: Vec<u32>,
}

impl BlockArrays {
    /// A list of one block: see [`BlockArrays::push`].
    ///
    /// # Panics
    /// As there.
    pub fn of_one(block: &TransportBlock, positions: &[[f32; 3]], n_k: usize) -> Self {
        let mut blocks = Self::default();
        blocks.push(block, positions, n_k);
        blocks
    }

    /// Appends a block; `positions` are those of its receivers, in metres, and `n_k` is the number of outputs of each. Whether
    /// what is in the arrays agrees is checked when they are written.
    ///
    /// # Panics
    /// If arrays that are to have the same length, or one that follows from another's, do not: nothing in the file would tell.
    pub fn push(&mut self, block: &TransportBlock, positions: &[[f32; 3]], n_k: usize) {
        assert!(block.fits(positions.len(), n_k), "arrays of a block fit each other, and its matrices are padded");
        let parts = block.parts();
        let parts: [&[u8]; 9] = [
            bytemuck::cast_slice(parts.clusters),
            bytemuck::cast_slice(parts.cluster_probes),
            bytemuck::cast_slice(parts.projection),
            bytemuck::cast_slice(parts.reconstruction),
            bytemuck::cast_slice(parts.tiles),
            bytemuck::cast_slice(parts.nodes),
            parts.counts,
            parts.links,
            bytemuck::cast_slice(parts.weights),
        ];
        let mut bytes = parts.concat();
        bytes.resize(bytes.len().next_multiple_of(ALIGNMENT as usize), 0);
        let first = 4 * self.data.len() as u64;
        self.records.push(BlockRecord {
            checksum: crc32c::crc32c(&bytes),
            offset: [first as u32, (first >> 32) as u32],
            bounds: bounds_of(positions),
            hash: *blake3::hash(&bytes).as_bytes(),
            ..block.record(positions.len())
        });
        self.data.extend(bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])));
    }

    /// Appends a block as another list stores it, which has it alone: its record and its bytes, four to a word.
    pub fn append(&mut self, record: BlockRecord, data: &[u32]) {
        let first = 4 * self.data.len() as u64;
        self.records.push(BlockRecord { offset: [first as u32, (first >> 32) as u32], ..record });
        self.data.extend_from_slice(data);
    }

    /// The same, borrowed.
    pub fn view(&self) -> Blocks<'_> {
        Blocks { records: &self.records, data: &self.data }
    }
}

/// Least box of some positions; of none, a point at the origin.
pub(crate) fn bounds_of(positions: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let Some(&first) = positions.first() else { return Default::default() };
    positions.iter().fold([first; 2], |[low, high], at| {
        [
            std::array::from_fn(|axis| if at[axis] < low[axis] { at[axis] } else { low[axis] }),
            std::array::from_fn(|axis| if at[axis] > high[axis] { at[axis] } else { high[axis] }),
        ]
    })
}

/// Blocks as they are stored, borrowed: from [`BlockArrays`], or from a mapped file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocks<'a> {
    /// `[n_blocks]`.
    pub records: &'a [BlockRecord],
    /// Bytes of all blocks, four to a word.
    pub data: &'a [u32],
}

impl<'a> Blocks<'a> {
    /// Bytes of a block, with the zeros that fill it up; `None` if they do not lie within `data`.
    pub fn bytes(&self, index: usize, n_k: usize) -> Option<&'a [u8]> {
        let record = self.records.get(index)?;
        let first = record.first_byte();
        let end = first.checked_add(record.byte_count(n_k)).filter(|_| first.is_multiple_of(ALIGNMENT))?;
        bytemuck::cast_slice::<u32, u8>(self.data).get(usize::try_from(first).ok()?..usize::try_from(end).ok()?)
    }

    /// The arrays of a block, and the bytes behind them; `None` if they do not lie within `data`.
    pub(crate) fn parts(&self, index: usize, n_k: usize) -> Option<(BlockParts<'a>, &'a [u8])> {
        let mut rest = self.bytes(index, n_k)?;
        let mut next = self.records[index].part_bytes(n_k).into_iter();
        let mut take = || {
            let (part, behind) = rest.split_at(next.next().unwrap_or(0) as usize);
            rest = behind;
            part
        };
        // Words come first, so that all arrays are aligned.
        let parts = BlockParts {
            clusters: bytemuck::cast_slice(take()),
            cluster_probes: bytemuck::cast_slice(take()),
            projection: bytemuck::cast_slice(take()),
            reconstruction: bytemuck::cast_slice(take()),
            tiles: bytemuck::cast_slice(take()),
            nodes: bytemuck::cast_slice(take()),
            counts: take(),
            links: take(),
            weights: bytemuck::cast_slice(take()),
        };
        Some((parts, rest))
    }

    /// A block, owned, whether its numbers are sound or not; `None` if its arrays do not lie within `data`. `n_k` is the number of
    /// outputs per receiver.
    pub fn to_block(&self, index: usize, n_k: usize) -> Option<TransportBlock> {
        let (parts, _) = self.parts(index, n_k)?;
        Some(TransportBlock {
            clusters: parts.clusters.to_vec(),
            cluster_probes: parts.cluster_probes.to_vec(),
            projection: parts.projection.to_vec(),
            reconstruction: parts.reconstruction.to_vec(),
            near: NearArrays {
                tiles: parts.tiles.to_vec(),
                nodes: parts.nodes.to_vec(),
                counts: parts.counts.to_vec(),
                links: parts.links.to_vec(),
                weights: parts.weights.to_vec(),
            },
        })
    }

    /// Sum over all blocks of one of their counts.
    pub fn total(&self, count: impl Fn(&BlockRecord) -> u32) -> u64 {
        self.records.iter().map(|record| u64::from(count(record))).sum()
    }

    /// Bytes of records, matrices, lists and links, without what fills blocks up.
    pub fn byte_count(&self, n_k: usize) -> u64 {
        let record = size_of::<BlockRecord>() as u64;
        self.records.iter().map(|block| record + block.part_bytes(n_k).iter().sum::<u64>()).sum()
    }

    /// Bytes of near light.
    pub fn near_byte_count(&self, n_k: usize) -> u64 {
        self.records.iter().map(|block| block.part_bytes(n_k)[4..].iter().sum::<u64>()).sum()
    }
}

/// Arrays of a block where they lie.
#[derive(Clone, Copy)]
pub(crate) struct BlockParts<'a> {
    pub(crate) clusters: &'a [ClusterRecord],
    pub(crate) cluster_probes: &'a [u32],
    pub(crate) projection: &'a [f16],
    pub(crate) reconstruction: &'a [f16],
    pub(crate) tiles: &'a [NearTile],
    pub(crate) nodes: &'a [u32],
    pub(crate) counts: &'a [u8],
    pub(crate) links: &'a [u8],
    pub(crate) weights: &'a [i8],
}

/// What blocks are checked against: counts of the file that they belong to.
#[derive(Clone, Copy, Debug)]
pub struct BlockShape {
    /// Number of probes.
    pub n_probes: usize,
    /// SH functions per probe.
    pub n_sh: usize,
    /// SH functions of the sky.
    pub n_sky: usize,
    /// Outputs per receiver.
    pub n_k: usize,
    /// Texels per side of the direct light map.
    pub direct_size: u32,
    /// Names the transport in messages: empty, or `volume `.
    pub of: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One receiver with a link and a matrix of one value.
    fn block() -> TransportBlock {
        let mut block = TransportBlock::default();
        let record = ClusterRecord { n_receivers: 1, n_probes: 0, n_sky: 1, n_coefficients: 1 };
        block.push(record, &[], &[f16::ONE], &[f16::ONE]);
        block.near = NearArrays {
            tiles: vec![NearTile { n_receivers: 1, n_nodes: 1, n_links: 1, scale: 1.0 }],
            nodes: vec![0],
            counts: vec![1],
            links: vec![0],
            weights: vec![127],
        };
        block
    }

    #[test]
    fn a_block_returns_as_it_was_stored() {
        let stored = BlockArrays::of_one(&block(), &[[1.0, 2.0, 3.0]], 1);
        assert_eq!(stored.view().to_block(0, 1), Some(block()));
        assert_eq!(stored.records[0].bounds, [[1.0, 2.0, 3.0]; 2]);
        assert_eq!(stored.view().to_block(1, 1), None, "there is one");
        assert_eq!(stored.view().to_block(0, 300), None, "weights of 300 outputs are not there");
    }

    /// Padding would hide what is missing.
    #[test]
    fn arrays_that_do_not_fit_each_other_cannot_be_stored() {
        let changes: [Change; 4] = [
            |block| block.near.weights.clear(),
            |block| block.near.counts.push(0),
            |block| block.projection.truncate(1),
            |block| block.reconstruction.truncate(1),
        ];
        for change in changes {
            let mut broken = block();
            change(&mut broken);
            let stored = std::panic::catch_unwind(|| BlockArrays::of_one(&broken, &[[0.0; 3]], 1));
            assert!(stored.is_err(), "{broken:?}");
            assert_eq!(broken.check(1, SHAPE).expect_err("refused").rule, 51);
        }
    }

    const SHAPE: BlockShape = BlockShape { n_probes: 1, n_sh: 4, n_sky: 1, n_k: 1, direct_size: 4, of: "" };

    /// What breaks a rule.
    type Change = fn(&mut TransportBlock);

    #[test]
    fn a_block_is_checked_before_it_is_stored() {
        assert_eq!(block().check(1, SHAPE), Ok(()));
        let changes: [(u16, Change); 6] = [
            (55, |block| block.clusters.push(ClusterRecord::default())),
            (56, |block| block.cluster_probes.push(0)),
            (57, |block| block.clusters[0].n_sky = 2),
            (58, |block| block.clusters[0].n_coefficients = 3),
            (59, |block| block.projection[0] = f16::NAN),
            (85, |block| block.near.nodes[0] = 16),
        ];
        for (rule, change) in changes {
            let mut broken = block();
            change(&mut broken);
            assert_eq!(broken.check(1, SHAPE).expect_err("refused").rule, rule);
        }
        assert!(block().check(0, SHAPE).is_err() && block().check(2, SHAPE).is_err());
    }
}
