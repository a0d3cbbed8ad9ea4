//! Checked transport: clusters and tiles of near light with everything that is theirs, numbered over all blocks.

use crate::baked::{BakedView, VolumeView};
use crate::block::{BlockParts, BlockShape, Blocks, ClusterRecord, NearTile};
use crate::check_blocks::check_block;
use crate::error::Violation;
use half::f16;
use std::ops::Range;

/// A cluster of receivers; its arrays agree, and its probes exist.
#[derive(Clone, Debug)]
pub struct Cluster<'a> {
    /// Its receivers among all.
    pub receivers: Range<usize>,
    /// Its lights among those of all clusters: as many as singular values were kept.
    pub lights: Range<usize>,
    /// Supporting probes; ids rise.
    pub probes: &'a [u32],
    /// Sky columns after the probe columns.
    pub n_sky: usize,
    /// `S V^T`, `[lights][n_probes * n_sh + n_sky]`, without padding.
    pub projection: &'a [f16],
    /// `U`, `[n_receivers * n_k][lights]`, without padding.
    pub reconstruction: &'a [f16],
}

/// Receivers that read near light together; its nodes are texels of the light map, its links nodes of its own.
#[derive(Clone, Debug)]
pub struct Tile<'a> {
    /// Its receivers among all.
    pub receivers: Range<usize>,
    /// Texels of levels of the direct light map: see [`crate::node_level_and_texel`].
    pub nodes: &'a [u32],
    /// `[n_receivers]` links of each.
    pub counts: &'a [u8],
    /// `[n_links]` node of each.
    pub links: &'a [u8],
    /// `[n_links][n_k]` codes of [`crate::quantize::near_weight`].
    pub weights: &'a [i8],
    /// Weight of the code 127.
    pub scale: f32,
}

/// A block whose every number has been checked.
#[derive(Clone, Debug)]
pub struct Block<'a> {
    /// Its receivers among all.
    pub receivers: Range<usize>,
    /// Its clusters, in the order of their receivers.
    pub clusters: Vec<Cluster<'a>>,
    /// Its tiles of near light, in the order of their receivers; none if no receiver has a link.
    pub tiles: Vec<Tile<'a>>,
}

/// Transport from probes and sky to one set of receivers, all of it checked.
#[derive(Clone, Debug)]
pub struct Transport<'a> {
    /// Clusters of all blocks, in the order of their receivers: every receiver is in one.
    pub clusters: Vec<Cluster<'a>>,
    /// Tiles of all blocks, likewise; receivers without links may be in none.
    pub tiles: Vec<Tile<'a>>,
    /// Number of probes.
    pub n_probes: usize,
    /// SH functions per probe.
    pub n_sh: usize,
    /// SH functions of the sky.
    pub n_sky: usize,
    /// Outputs per receiver.
    pub n_k: usize,
    /// Number of receivers.
    pub n_receivers: usize,
    /// Lights of all clusters.
    pub n_lights: usize,
}

impl<'a> Transport<'a> {
    /// Checks every block.
    pub(crate) fn new(blocks: Blocks<'a>, shape: BlockShape) -> Result<Self, Violation> {
        let mut transport = Self {
            clusters: Vec::with_capacity(blocks.total(|block| block.n_clusters) as usize),
            tiles: Vec::with_capacity(blocks.total(|block| block.n_tiles) as usize),
            n_probes: shape.n_probes,
            n_sh: shape.n_sh,
            n_sky: shape.n_sky,
            n_k: shape.n_k,
            n_receivers: 0,
            n_lights: 0,
        };
        for index in 0..blocks.records.len() {
            let block = block(blocks, index, transport.n_receivers, transport.n_lights, shape)?;
            transport.n_receivers = block.receivers.end;
            transport.n_lights = block.clusters.last().map_or(transport.n_lights, |cluster| cluster.lights.end);
            transport.clusters.extend(block.clusters);
            transport.tiles.extend(block.tiles);
        }
        Ok(transport)
    }

    /// The cluster of a receiver, by its number.
    pub fn cluster_of(&self, receiver: usize) -> Option<usize> {
        let number = self.clusters.partition_point(|cluster| cluster.receivers.end <= receiver);
        (number < self.clusters.len()).then_some(number)
    }

    /// Links of a receiver: node, and weight of output 0.
    pub fn links_of(&self, receiver: usize) -> Vec<(u32, f32)> {
        let after = self.tiles.partition_point(|tile| tile.receivers.end <= receiver);
        let Some(tile) = self.tiles.get(after).filter(|tile| tile.receivers.start <= receiver) else {
            return Vec::new();
        };
        let at = receiver - tile.receivers.start;
        let first: usize = tile.counts[..at].iter().map(|&count| usize::from(count)).sum();
        let link = |link: usize| {
            let weight = crate::quantize::near_weight(tile.weights[link * self.n_k], tile.scale);
            (tile.nodes[usize::from(tile.links[link])], weight)
        };
        (first..first + usize::from(tile.counts[at])).map(link).collect()
    }
}

/// Block `index`, checked; its first receiver and its first light among all are given.
pub(crate) fn block<'a>(
    blocks: Blocks<'a>,
    index: usize,
    first_receiver: usize,
    first_light: usize,
    shape: BlockShape,
) -> Result<Block<'a>, Violation> {
    let parts = check_block(blocks, index, shape)?;
    Ok(Block {
        receivers: first_receiver..first_receiver + blocks.records[index].n_receivers as usize,
        clusters: clusters(&parts, first_receiver, first_light, shape),
        tiles: tiles(&parts, first_receiver, shape.n_k),
    })
}

/// Takes its next `count` elements off a slice.
fn take<'a, T>(rest: &mut &'a [T], count: usize) -> &'a [T] {
    let (taken, behind) = rest.split_at(count);
    *rest = behind;
    taken
}

fn clusters<'a>(
    parts: &BlockParts<'a>,
    first_receiver: usize,
    first_light: usize,
    shape: BlockShape,
) -> Vec<Cluster<'a>> {
    let BlockParts { mut cluster_probes, mut projection, mut reconstruction, .. } = *parts;
    let (mut receiver, mut light) = (first_receiver, first_light);
    let matrix = |rest: &mut &'a [f16], len: usize| &take(rest, len.next_multiple_of(2))[..len];
    let mut each = |record: &ClusterRecord| {
        let [n_receivers, n_probes, n_sky, n_c] =
            [record.n_receivers, record.n_probes, record.n_sky, record.n_coefficients].map(|count| count as usize);
        let cluster = Cluster {
            receivers: receiver..receiver + n_receivers,
            lights: light..light + n_c,
            probes: take(&mut cluster_probes, n_probes),
            n_sky,
            projection: matrix(&mut projection, n_c * (n_probes * shape.n_sh + n_sky)),
            reconstruction: matrix(&mut reconstruction, n_c * n_receivers * shape.n_k),
        };
        (receiver, light) = (cluster.receivers.end, cluster.lights.end);
        cluster
    };
    parts.clusters.iter().map(&mut each).collect()
}

fn tiles<'a>(parts: &BlockParts<'a>, first_receiver: usize, n_k: usize) -> Vec<Tile<'a>> {
    let BlockParts { mut nodes, mut counts, mut links, mut weights, .. } = *parts;
    let mut receiver = first_receiver;
    let mut each = |&NearTile { n_receivers, n_nodes, n_links, scale }: &NearTile| {
        let tile = Tile {
            receivers: receiver..receiver + n_receivers as usize,
            nodes: take(&mut nodes, n_nodes as usize),
            counts: take(&mut counts, n_receivers as usize),
            links: take(&mut links, n_links as usize),
            weights: take(&mut weights, n_links as usize * n_k),
            scale,
        };
        receiver = tile.receivers.end;
        tile
    };
    parts.tiles.iter().map(&mut each).collect()
}

/// A baked file of which every number has been checked: what relighters take. From [`crate::Baked::checked`] or
/// [`crate::BakedArrays::checked`].
#[derive(Clone, Debug)]
pub struct Checked<'a> {
    view: BakedView<'a>,
    transport: Transport<'a>,
    volume: Option<Transport<'a>>,
}

impl<'a> Checked<'a> {
    /// `view` has been checked but for what is in its blocks.
    pub(crate) fn of_tables(view: BakedView<'a>) -> Result<Self, Violation> {
        let volume = |volume: VolumeView<'a>| Transport::new(volume.blocks, volume.shape(&view));
        Ok(Self {
            transport: Transport::new(view.blocks, view.shape())?,
            volume: view.volume.map(volume).transpose()?,
            view,
        })
    }

    /// The arrays of the file.
    pub fn view(&self) -> &BakedView<'a> {
        &self.view
    }

    /// Transport to the receivers of the lightmap.
    pub fn transport(&self) -> &Transport<'a> {
        &self.transport
    }

    /// Transport to the cells of the volume that have a receiver; `None` without a volume.
    pub fn volume_transport(&self) -> Option<&Transport<'a>> {
        self.volume.as_ref()
    }

    /// SH functions per probe.
    pub fn n_sh(&self) -> usize {
        self.transport.n_sh
    }

    /// Outputs per receiver: 1 for irradiance, 4 for SH radiance of degree 1.
    pub fn n_k(&self) -> usize {
        self.transport.n_k
    }

    /// Number of probes.
    pub fn n_probes(&self) -> usize {
        self.transport.n_probes
    }

    /// Relight rays per probe.
    pub fn n_rays(&self) -> usize {
        self.view.metadata.n_rays as usize
    }

    /// Number of receivers.
    pub fn n_receivers(&self) -> usize {
        self.transport.n_receivers
    }

    /// Lights of all clusters.
    pub fn n_cluster_lights(&self) -> usize {
        self.transport.n_lights
    }

    /// Whether receivers read from the light map beside their probes.
    pub fn has_near_light(&self) -> bool {
        !self.transport.tiles.is_empty()
    }
}
