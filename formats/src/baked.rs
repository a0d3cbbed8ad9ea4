//! What a baked file holds, as plain arrays.

use crate::block::{BlockArrays, BlockRecord, BlockShape, Blocks};
use bytemuck::{Pod, Zeroable};
use half::f16;
use serde::{Deserialize, Serialize};

/// A radiance probe as stored.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Probe {
    /// World position, metres.
    pub position: [f32; 3],
    /// Support radius, metres.
    pub support_radius_m: f32,
}

/// Regular grid of a volume: where its cells lie, and the degree of what they hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct VolumeGrid {
    /// Position of cell 0, metres.
    pub origin: [f32; 3],
    /// Distance of neighboring cells along every axis, metres.
    pub spacing_m: f32,
    /// Cells per axis.
    pub dims: [u32; 3],
    /// SH degree of the incident radiance, 1 or 2.
    pub degree: u32,
}

impl VolumeGrid {
    /// Number of cells.
    pub fn n_cells(&self) -> u64 {
        // Saturates, so that a grid that is not checked yet is too large and not small.
        self.dims.iter().fold(1, |cells, dim| u64::saturating_mul(cells, u64::from(*dim)))
    }
    /// Outputs per cell.
    pub fn n_k(&self) -> usize {
        crate::sh::function_count(self.degree)
    }
    /// Index of a cell: `x + dims.x * (y + dims.y * z)`.
    pub fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        let [width, height, _] = self.dims;
        x as usize + width as usize * (y as usize + height as usize * z as usize)
    }
    /// Coordinates of a cell.
    pub fn coordinates(&self, cell: usize) -> [u32; 3] {
        let (width, height) = (self.dims[0] as usize, self.dims[1] as usize);
        [(cell % width) as u32, (cell / width % height) as u32, (cell / (width * height)) as u32]
    }
    /// World position of a cell, metres.
    pub fn position(&self, cell: usize) -> [f32; 3] {
        let at = self.coordinates(cell);
        [0, 1, 2].map(|axis| self.origin[axis] + at[axis] as f32 * self.spacing_m)
    }
}

/// A relight ray's level for rays that leave the scene: they read the sky.
pub const LEVEL_SKY: u8 = 254;
/// A relight ray's level for rays that hit something without light: the back of a one-sided surface, or a surface
/// without lightmap.
pub const LEVEL_BLACK: u8 = 255;
/// Highest mip level a relight ray may ask for.
pub const MAX_LEVEL: u8 = 15;

/// Facts about the bake: small, readable by `info`, stored as the metadata section.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Version of the program that wrote the file.
    pub tool_version: String,
    /// Path of the scene that carries the lightmap coordinates, relative to the file, with `/`.
    pub scene_path: String,
    /// BLAKE3 of that scene (`Scene::hash`).
    pub scene_hash: [u8; 32],
    /// Receiver map, texels per side.
    pub lightmap_size: u32,
    /// Direct light map, texels per side; same layout.
    pub direct_size: u32,
    /// SH degree of the probes.
    pub probe_degree: u32,
    /// SH degree of the receivers: 0 is irradiance.
    pub receiver_degree: u32,
    /// SH degree of the sky columns.
    pub sky_degree: u32,
    /// Relight rays per probe.
    pub n_rays: u32,
    /// Scene box, metres.
    pub bounds: [[f32; 3]; 2],
    /// All options of the bake, as the TOML text that `--config` takes.
    pub options: String,
}

impl Metadata {
    /// SH functions per probe.
    pub fn n_sh(&self) -> usize {
        crate::sh::function_count(self.probe_degree)
    }
    /// Outputs per receiver.
    pub fn n_k(&self) -> usize {
        crate::sh::function_count(self.receiver_degree)
    }
    /// SH functions of the sky.
    pub fn n_sky(&self) -> usize {
        crate::sh::function_count(self.sky_degree)
    }
}

/// Everything a baked file holds, owned: what [`crate::write()`] takes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakedArrays {
    /// Facts.
    pub metadata: Metadata,
    /// `[n_probes]`.
    pub probes: Vec<Probe>,
    /// `[n_rays]` unit relight directions, shared by all probes; w is 0.
    pub ray_dirs: Vec<[f32; 4]>,
    /// `[n_rays][n_sh]` SH values times `4 pi / n_rays`.
    pub ray_sh: Vec<f32>,
    /// `[n_probes][n_rays]` position in the direct light map, two unorm16: u low, v high.
    pub ray_uv: Vec<u32>,
    /// `[n_probes][n_rays]` mip level 0..=15, [`LEVEL_SKY`] or [`LEVEL_BLACK`].
    pub ray_level: Vec<u8>,
    /// `[n_probes][n_rays]` metres from the probe to what the ray meets, infinite where it leaves the scene; or empty
    /// where that is not told.
    pub ray_distance: Vec<f16>,
    /// `[n_receivers]` texel of the receiver map: `y * lightmap_size + x`, row 0 at v = 0.
    pub receiver_texel: Vec<u32>,
    /// `[n_receivers]` world position, metres.
    pub receiver_position: Vec<[f32; 3]>,
    /// `[n_receivers]` unit shading normal.
    pub receiver_normal: Vec<[f32; 3]>,
    /// `[n_receivers]` cosine-weighted share of directions whose surface neither a supporting probe sees nor a link reads, 0..=1.
    pub receiver_unseen: Vec<f32>,
    /// Transport to the receivers, in their order.
    pub blocks: BlockArrays,
    /// Gutter fill: `[texel, receiver]`, a texel without receiver and the receiver whose value it takes.
    pub gutters: Vec<[u32; 2]>,
    /// Pairs of receivers that lie on both sides of a chart seam at the same place.
    pub seams: Vec<[u32; 2]>,
    /// Light in the open space, for objects that move.
    pub volume: Option<VolumeArrays>,
    /// The bake report without times, JSON; may be empty.
    pub report: String,
    /// What the next bake needs to leave layout, probes and leaves where they are, JSON; may be empty.
    pub plan: String,
}

/// Transport to the cells of a grid: incident radiance from all directions about a point, SH in world axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeArrays {
    /// Where the cells lie.
    pub grid: VolumeGrid,
    /// `[n_volume_receivers]` cell of each, in cluster order.
    pub cells: Vec<u32>,
    /// Transport to the volume receivers, in their order.
    pub blocks: BlockArrays,
    /// `[cell, cell]`: a cell without receiver, and the one with a receiver whose values it takes.
    pub fill: Vec<[u32; 2]>,
}

/// Borrowed view of a volume; fields as in [`VolumeArrays`].
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub struct VolumeView<'a> {
    pub grid: &'a VolumeGrid,
    pub cells: &'a [u32],
    pub blocks: Blocks<'a>,
    pub fill: &'a [[u32; 2]],
}

impl VolumeArrays {
    /// The same arrays, borrowed.
    pub fn view(&self) -> VolumeView<'_> {
        VolumeView { grid: &self.grid, cells: &self.cells, blocks: self.blocks.view(), fill: &self.fill }
    }
}

/// Borrowed view of the same arrays, from a [`BakedArrays`] or from a mapped file; fields as there.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub struct BakedView<'a> {
    pub metadata: &'a Metadata,
    pub probes: &'a [Probe],
    pub ray_dirs: &'a [[f32; 4]],
    pub ray_sh: &'a [f32],
    pub ray_uv: &'a [u32],
    pub ray_level: &'a [u8],
    pub ray_distance: &'a [f16],
    pub receiver_texel: &'a [u32],
    pub receiver_position: &'a [[f32; 3]],
    pub receiver_normal: &'a [[f32; 3]],
    pub receiver_unseen: &'a [f32],
    pub blocks: Blocks<'a>,
    pub gutters: &'a [[u32; 2]],
    pub seams: &'a [[u32; 2]],
    pub volume: Option<VolumeView<'a>>,
    pub report: &'a str,
    pub plan: &'a str,
}

impl BakedArrays {
    /// The same arrays, borrowed.
    pub fn view(&self) -> BakedView<'_> {
        BakedView {
            metadata: &self.metadata,
            probes: &self.probes,
            ray_dirs: &self.ray_dirs,
            ray_sh: &self.ray_sh,
            ray_uv: &self.ray_uv,
            ray_level: &self.ray_level,
            ray_distance: &self.ray_distance,
            receiver_texel: &self.receiver_texel,
            receiver_position: &self.receiver_position,
            receiver_normal: &self.receiver_normal,
            receiver_unseen: &self.receiver_unseen,
            blocks: self.blocks.view(),
            gutters: &self.gutters,
            seams: &self.seams,
            volume: self.volume.as_ref().map(VolumeArrays::view),
            report: &self.report,
            plan: &self.plan,
        }
    }
}

/// Bytes that relighting reads, by what they are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TransportBytes {
    /// `S V^T` of all clusters.
    pub projection: u64,
    /// `U` of all clusters.
    pub reconstruction: u64,
    /// Relight rays: directions, basis, lookups, distances.
    pub relight: u64,
    /// Near light: tiles, nodes, links and weights.
    pub near_light: u64,
}

impl TransportBytes {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.projection + self.reconstruction + self.relight + self.near_light
    }
}

impl BakedView<'_> {
    /// Bytes that relighting reads in every frame.
    pub fn transport_bytes(&self) -> TransportBytes {
        // Pairs of halves.
        let pairs = |count: fn(&BlockRecord) -> u32| 4 * self.blocks.total(count);
        let rays = size_of_val(self.ray_dirs)
            + size_of_val(self.ray_sh)
            + size_of_val(self.ray_uv)
            + size_of_val(self.ray_level)
            + size_of_val(self.ray_distance);
        TransportBytes {
            projection: pairs(|block| block.projection_pairs),
            reconstruction: pairs(|block| block.reconstruction_pairs),
            relight: rays as u64,
            near_light: self.blocks.near_byte_count(self.metadata.n_k()),
        }
    }

    /// What blocks of the lightmap's transport are checked against.
    pub(crate) fn shape(&self) -> BlockShape {
        BlockShape {
            n_probes: self.probes.len(),
            n_sh: self.metadata.n_sh(),
            n_sky: self.metadata.n_sky(),
            n_k: self.metadata.n_k(),
            direct_size: self.metadata.direct_size,
            of: "",
        }
    }
}

impl VolumeView<'_> {
    /// The same of the volume's.
    pub(crate) fn shape(&self, file: &BakedView<'_>) -> BlockShape {
        BlockShape { n_k: self.grid.n_k(), of: "volume ", ..file.shape() }
    }
}
