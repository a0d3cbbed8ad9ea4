//! Local transport: one leaf of receivers at a time to a finished block; no type holds the rows of more.

use super::near_tiles::near_tiles;
use crate::{
    clusters::{Cluster, RefineSettings, leaves, refine},
    error::BakeError,
    progress::Progress,
    transport::{Links, RayCounts, TransportScene},
};
use localprt_formats::{ClusterRecord, TransportBlock};
use rayon::prelude::*;

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

/// Transport of all leaves, in their order. The rows of a leaf are made, compressed and dropped.
pub(super) fn local_transport(
    transport: &TransportScene<'_>,
    refining: &RefineSettings,
    leaf: u32,
    stage: &str,
    progress: &Progress,
) -> Result<Vec<LeafTransport>, BakeError> {
    let positions = transport.receivers.positions();
    let stage = progress.stage(stage, positions.len() as u64);
    leaves(positions, leaf as usize)
        .par_iter()
        .map(|members| {
            progress.check()?;
            let mut rows = transport.rows(&transport.leaf(members), members);
            let (rays, links) = (rows.rays, std::mem::take(&mut rows.links));
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
            Ok(leaf)
        })
        .collect()
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
