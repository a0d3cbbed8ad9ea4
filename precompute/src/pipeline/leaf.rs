//! Local transport: one leaf of receivers at a time to a finished block; no type holds the rows of more.

use super::{
    leaf_cache::{LeafCache, LeafKey, Why},
    near_tiles::near_tiles,
};
use crate::{
    cache::Cache,
    cells::CellGrid,
    clusters::{Cluster, RefineSettings, refine},
    error::BakeError,
    progress::Progress,
    rays::RayCaster,
    report::CacheUse,
    transport::{Links, RayCounts, TransportScene},
};
use glam::Vec3;
use localprt_formats::{ClusterRecord, TransportBlock};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Work of a receiver for each probe of its leaf, and for each that supports it, over what it costs by itself.
const COST_OF_PROBE: f64 = 0.02;
const COST_OF_PAIR: f64 = 0.05;

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

/// Leaves of one transport stage, given by their receivers, and how they are come by.
pub(super) struct LeafWork<'a> {
    transport: &'a TransportScene<'a>,
    refining: &'a RefineSettings,
    leaves: &'a [Vec<u32>],
    cache: Option<LeafCache<'a>>,
    explains: bool,
    progress: &'a Progress,
}

impl<'a> LeafWork<'a> {
    /// `transport` notes the cells that its rays cross if there is a cache.
    pub(super) fn of(
        transport: &'a TransportScene<'a>,
        refining: &'a RefineSettings,
        leaves: &'a [Vec<u32>],
        cache: Option<&'a Cache>,
        progress: &'a Progress,
    ) -> Self {
        let _stage = cache.map(|_| progress.stage("cache", 0));
        let explains = cache.is_some_and(|cache| cache.options().explain);
        let cache = cache.and_then(|cache| LeafCache::of(cache, transport, refining));
        Self { transport, refining, leaves, cache, explains, progress }
    }

    /// Number of leaves.
    pub(super) fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Transport of all leaves, in their order: kept ones from the cache, if there is one. The rows of a leaf are made, compressed and
    /// dropped.
    pub(super) fn all(&self, stage: &str) -> Result<(Vec<LeafTransport>, CacheUse), BakeError> {
        let reused = AtomicU64::new(0);
        let n_receivers: usize = self.leaves.iter().map(Vec::len).sum();
        let stage = self.progress.stage(stage, n_receivers as u64);
        let leaf = |members: &Vec<u32>| {
            self.progress.check()?;
            let (leaf, is_kept) = self.one(members);
            reused.fetch_add(u64::from(is_kept), Relaxed);
            stage.inc(members.len() as u64);
            Ok(leaf)
        };
        let made = self.leaves.par_iter().map(leaf).collect::<Result<Vec<_>, BakeError>>()?;
        let reused = reused.into_inner();
        let use_of_cache = CacheUse { reused, baked: made.len() as u64 - reused };
        Ok((made, use_of_cache))
    }

    /// Makes some of the leaves, by number, that the cache does not hold yet, and keeps them there.
    pub(super) fn keep(&self, stage: &str, numbers: &[usize]) -> Result<CacheUse, BakeError> {
        let reused = AtomicU64::new(0);
        let n_receivers: usize = numbers.iter().map(|&number| self.leaves[number].len()).sum();
        let stage = self.progress.stage(stage, n_receivers as u64);
        numbers.par_iter().try_for_each(|&number| {
            self.progress.check()?;
            let members = &self.leaves[number];
            reused.fetch_add(u64::from(self.one(members).1), Relaxed);
            stage.inc(members.len() as u64);
            Ok::<(), BakeError>(())
        })?;
        let reused = reused.into_inner();
        Ok(CacheUse { reused, baked: numbers.len() as u64 - reused })
    }

    /// Numbers of the leaves that the cache does not hold.
    pub(super) fn missing(&self) -> Vec<usize> {
        let is_missing = |members: &Vec<u32>| self.find(members).is_none_or(|(_, _, found)| found.is_err());
        let missing = self.leaves.par_iter().enumerate().filter(|(_, members)| is_missing(members));
        missing.map(|(number, _)| number).collect()
    }

    /// About how much work each leaf is, in no unit: its rows are as many as its receivers, and each is fitted to the probes around.
    pub(super) fn costs(&self) -> Vec<f64> {
        let cost = |members: &Vec<u32>| {
            let pairs: usize = members.iter().map(|&member| self.transport.support.of(member as usize).len()).sum();
            let probes = self.transport.union_of_support(members).len();
            members.len() as f64 * (1.0 + COST_OF_PROBE * probes as f64) + COST_OF_PAIR * pairs as f64
        };
        self.leaves.par_iter().map(cost).collect()
    }

    fn find(&self, members: &[u32]) -> Option<(&LeafCache<'a>, LeafKey, Result<LeafTransport, Why>)> {
        let cache = self.cache.as_ref()?;
        let key = cache.key(self.transport, members);
        let found = cache.find(&key, members);
        Some((cache, key, found))
    }

    /// A leaf, and whether the cache held it.
    fn one(&self, members: &[u32]) -> (LeafTransport, bool) {
        let positions = self.transport.receivers.positions();
        let key = match self.find(members) {
            Some((_, _, Ok(leaf))) => return (leaf, true),
            Some((cache, key, Err(why))) => {
                if self.explains {
                    self.progress.note(&explanation(members, positions, why));
                }
                Some((cache, key))
            }
            None => None,
        };
        let mut rows = self.transport.rows(&self.transport.leaf(members), members);
        let (rays, links, crossed) = (rows.rays, std::mem::take(&mut rows.links), rows.crossed.take());
        let mut leaf = LeafTransport::of(refine(members, positions, rows, self.refining), rays);
        if self.transport.near.is_some() {
            let mut of_member: Vec<(u32, &Links)> = members.iter().copied().zip(&links).collect();
            of_member.sort_unstable_by_key(|(member, _)| *member);
            let at = |member: u32| of_member.partition_point(|(other, _)| *other < member);
            let stored: Vec<&Links> = leaf.members.iter().map(|&member| of_member[at(member)].1).collect();
            leaf.block.near = near_tiles(&stored, self.transport.gather.n_outputs());
        }
        if let (Some((cache, key)), Some(crossed)) = (key, crossed) {
            cache.keep(&key, members, &leaf, &crossed);
        }
        (leaf, false)
    }
}

/// Cells in which a bake with a cache notes where its rays went.
pub(super) fn cells(cache: Option<&Cache>, caster: &RayCaster<'_>) -> Option<CellGrid> {
    cache.map(|_| CellGrid::of(caster.scene().bounds().unwrap_or_default()))
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
