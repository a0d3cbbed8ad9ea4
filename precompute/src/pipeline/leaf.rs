//! Local transport: one leaf of receivers at a time to a finished block; no type holds the rows of more.

use super::{
    leaf_cache::{LeafCache, Why},
    near_tiles::near_tiles,
};
use crate::{
    cache::Cache,
    cells::CellGrid,
    clusters::{Cluster, RefineSettings, leaves, refine},
    error::BakeError,
    progress::Progress,
    report::CacheUse,
    transport::{Links, RayCounts, TransportScene},
};
use glam::Vec3;
use localprt_formats::{ClusterRecord, TransportBlock};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What a leaf of receivers becomes.
pub(super) struct LeafTransport {
    /// As stored.
    pub(super) block: TransportBlock,
    /// Its receivers in stored order.
    pub(super) members: Vec<u32>,
    /// Unseen share of each.
    pub(super) unseen: Vec<f32>,
    /// Squared RMS error of each of its rows, by compression.
    pub(super) row_error_squared: Vec<f64>,
    /// Rays it cost.
    pub(super) rays: RayCounts,
}

/// Transport of all leaves, in their order: kept ones from the cache, if there is one. The rows of a leaf are made, compressed and
/// dropped.
pub(super) fn local_transport(
    transport: &TransportScene<'_>,
    refining: &RefineSettings,
    leaf: u32,
    stage: &str,
    cache: Option<&Cache>,
    progress: &Progress,
) -> Result<(Vec<LeafTransport>, CacheUse), BakeError> {
    let explains = cache.is_some_and(|cache| cache.options().explain);
    let cells = cache.map(|_| CellGrid::of(transport.caster.scene().bounds().unwrap_or_default()));
    let transport = &TransportScene { cells, ..*transport };
    let cache = {
        let _stage = cache.map(|_| progress.stage("cache", 0));
        cache.and_then(|cache| LeafCache::of(cache, transport, refining))
    };
    let reused = AtomicU64::new(0);
    let positions = transport.receivers.positions();
    let stage = progress.stage(stage, positions.len() as u64);
    let made: Result<Vec<LeafTransport>, BakeError> = leaves(positions, leaf as usize)
        .par_iter()
        .map(|members| {
            progress.check()?;
            let key = cache.as_ref().map(|cache| (cache, cache.key(transport, members)));
            match key.as_ref().map(|(cache, key)| cache.find(key, members)) {
                Some(Ok(leaf)) => {
                    reused.fetch_add(1, Relaxed);
                    stage.inc(members.len() as u64);
                    return Ok(leaf);
                }
                Some(Err(why)) if explains => progress.note(&explanation(members, positions, why)),
                _ => {}
            }
            let mut rows = transport.rows(&transport.leaf(members), members);
            let (rays, links, crossed) = (rows.rays, std::mem::take(&mut rows.links), rows.crossed.take());
            let clusters = refine(members, positions, rows, refining);
            stage.inc(members.len() as u64);
            let mut leaf = LeafTransport::of(clusters, rays);
            if transport.near.is_some() {
                let mut of_member: Vec<(u32, &Links)> = members.iter().copied().zip(&links).collect();
                of_member.sort_unstable_by_key(|(member, _)| *member);
                let at = |member: u32| of_member.partition_point(|(other, _)| *other < member);
                let stored: Vec<&Links> = leaf.members.iter().map(|&member| of_member[at(member)].1).collect();
                leaf.block.near = near_tiles(&stored, transport.gather.n_outputs());
            }
            if let (Some((cache, key)), Some(crossed)) = (key, crossed) {
                cache.keep(&key, members, &leaf, &crossed);
            }
            Ok(leaf)
        })
        .collect();
    let (made, reused) = (made?, reused.into_inner());
    let use_of_cache = CacheUse { reused, baked: made.len() as u64 - reused };
    Ok((made, use_of_cache))
}

/// Which leaf is made, and why.
fn explanation(members: &[u32], positions: &[Vec3], why: Why) -> String {
    let sum: Vec3 = members.iter().map(|&member| positions[member as usize]).sum();
    let [x, y, z] = (sum / members.len() as f32).to_array();
    format!("making a leaf of {} receivers about {x:.2}, {y:.2}, {z:.2}: {}", members.len(), why.text())
}

impl LeafTransport {
    fn of(clusters: Vec<Cluster>, rays: RayCounts) -> Self {
        let mut leaf = Self {
            block: TransportBlock::default(),
            members: Vec::new(),
            unseen: Vec::new(),
            row_error_squared: Vec::new(),
            rays,
        };
        for cluster in clusters {
            let record = ClusterRecord {
                n_receivers: cluster.members.len() as u32,
                n_probes: cluster.probes.len() as u32,
                n_sky: cluster.n_sky as u32,
                n_coefficients: cluster.rows.n_coefficients as u32,
            };
            leaf.block.push(record, &cluster.probes, &cluster.rows.projection, &cluster.rows.reconstruction);
            leaf.members.extend(cluster.members);
            leaf.unseen.extend(cluster.unseen);
            leaf.row_error_squared.extend(cluster.rows.row_error_squared);
        }
        leaf
    }
}

/// Receivers of all leaves in stored order.
pub(super) fn stored_members(leaves: &[LeafTransport]) -> Vec<u32> {
    leaves.iter().flat_map(|leaf| leaf.members.iter().copied()).collect()
}
