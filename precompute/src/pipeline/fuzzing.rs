//! Content of records as a bake reads it, for fuzz targets: what is read is packed again. No part of the interface.

use super::{kept_bake, layout_cache, leaf_cache};
use crate::{
    cache::{HEAD_BYTES, is_whole, sealed},
    cells::CellGrid,
    report::BakeReport,
};
use glam::Vec3;
use localprt_formats::{BlockArrays, BlockShape};
use localprt_scenes::Scene;

/// Kind and digest of all records here.
const KIND: (&str, [u8; 32]) = ("fuzz", [7; 32]);

/// A record as it lies in a cache.
pub fn seal(content: &[u8]) -> Vec<u8> {
    sealed(KIND.0, &KIND.1, content)
}

/// Content of a record that is whole.
pub fn open(record: &[u8]) -> Option<&[u8]> {
    is_whole(record, KIND.0, &KIND.1).then(|| &record[HEAD_BYTES..])
}

/// Sets of cells over a box.
pub fn cells(content: &[u8], bounds: (Vec3, Vec3)) -> Option<Vec<u8>> {
    Some(leaf_cache::pack_sets(&leaf_cache::unpack_sets(content, CellGrid::of(bounds))?))
}

/// A leaf of so many receivers, of one output each, and probes of degree 1. What is read is stored, as it would be in a file.
pub fn leaf(content: &[u8], n_members: u8, n_probes: u8) -> Option<Vec<u8>> {
    let (members, probes): (Vec<u32>, Vec<u32>) =
        ((0..n_members.into()).rev().collect(), (0..n_probes.into()).collect());
    let shape = BlockShape { n_probes: n_probes.into(), n_sh: 4, n_sky: 4, n_k: 1, direct_size: 16, of: "" };
    let leaf = leaf_cache::unpack(content, &members, &probes, shape)?;
    let packed = leaf_cache::pack(&leaf, &members, &probes);
    BlockArrays::of_one(&leaf.block, &vec![[0.0; 3]; leaf.members.len()], 1);
    Some(packed)
}

/// A layout of a scene.
pub fn layout(content: &[u8], scene: &Scene) -> Option<(Scene, Vec<u8>)> {
    let (scene, layout, plan) = layout_cache::unpack(content, scene)?;
    let packed = layout_cache::pack(&scene, &layout, &plan);
    Some((scene, packed))
}

/// A whole bake.
pub fn bake(content: &[u8]) -> Option<BakeReport> {
    kept_bake::unpack(content).map(|(_, report)| report)
}
