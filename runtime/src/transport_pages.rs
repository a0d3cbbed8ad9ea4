//! A transport on the GPU: projection, reconstruction and what they read and write, in pages of whole clusters.
//!
//! A page stands alone: its clusters read the probe radiance and light its own receivers. So no binding is wider than the
//! device allows, however large the bake is.

use crate::checked_bake::Transport;
use crate::error::RelightError;
use crate::gpu::{page_bytes, storage, zeros};
use half::f16;
use localprt_formats::ClusterRecord;
use std::ops::Range;

/// Stands in `receiver_cluster` for a receiver that no cluster lights.
const NO_CLUSTER: u32 = u32::MAX;

/// One page of a transport.
pub(crate) struct TransportPage {
    pub(crate) n_clusters: usize,
    /// Most rows of a cluster.
    pub(crate) most_coefficients: u32,
    /// Receivers of the page among all.
    pub(crate) receivers: Range<usize>,
    pub(crate) clusters: wgpu::Buffer,
    pub(crate) cluster_probes: wgpu::Buffer,
    pub(crate) projection: wgpu::Buffer,
    /// `[lights of the page]`, RGB0.
    pub(crate) cluster_lights: wgpu::Buffer,
    pub(crate) n_lights: usize,
    pub(crate) receiver_cluster: wgpu::Buffer,
    pub(crate) reconstruction: wgpu::Buffer,
    /// `[receivers of the page, n_k]`, RGB0.
    pub(crate) coefficients: wgpu::Buffer,
}

impl TransportPage {
    /// All its buffers.
    pub(crate) fn bytes(&self) -> u64 {
        [
            &self.clusters,
            &self.cluster_probes,
            &self.projection,
            &self.cluster_lights,
            &self.receiver_cluster,
            &self.reconstruction,
            &self.coefficients,
        ]
        .map(wgpu::Buffer::size)
        .into_iter()
        .sum()
    }
}

/// Splits and uploads a transport.
///
/// # Errors
/// [`RelightError::Limit`] if a single cluster is wider than a binding may be.
pub(crate) fn upload(device: &wgpu::Device, transport: &Transport<'_>) -> Result<Vec<TransportPage>, RelightError> {
    let pages = split(transport, page_bytes(device))?;
    Ok(pages.into_iter().map(|page| upload_page(device, transport, &page)).collect())
}

/// Clusters and receivers of a page.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    clusters: Range<usize>,
    receivers: Range<usize>,
}

/// Bytes of the arrays that hold something for every cluster of a page.
#[derive(Clone, Copy, Default)]
struct Widths([u64; 5]);

impl Widths {
    fn of_cluster(transport: &Transport<'_>, cluster: usize) -> Self {
        let record = &transport.clusters[cluster];
        Self([
            transport.projection_range(cluster).len().div_ceil(2) as u64 * 4,
            transport.reconstruction_range(cluster).len().div_ceil(2) as u64 * 4,
            u64::from(record.n_coefficients) * 16,
            u64::from(record.n_probes) * 4,
            size_of::<ClusterRecord>() as u64,
        ])
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|array| self.0[array] + other.0[array]))
    }

    fn widest(self) -> u64 {
        self.0.into_iter().fold(0, u64::max)
    }
}

/// Cuts before the cluster that would make any array of a page wider than `limit`.
fn split(transport: &Transport<'_>, limit: u64) -> Result<Vec<Part>, RelightError> {
    let receiver_bytes = 16 * transport.n_k as u64;
    let mut parts = Vec::new();
    let mut open = Part { clusters: 0..0, receivers: 0..0 };
    let mut widths = Widths::default();
    for cluster in 0..transport.clusters.len() {
        let own = Widths::of_cluster(transport, cluster);
        let receivers = transport.receiver_range(cluster);
        let own_bytes = own.widest().max(receivers.len() as u64 * receiver_bytes);
        if own_bytes > limit {
            return Err(RelightError::Limit { what: "one cluster", needed: own_bytes, allowed: limit });
        }
        let page_bytes = widths.plus(own).widest();
        if page_bytes.max((receivers.end - open.receivers.start) as u64 * receiver_bytes) > limit {
            open.receivers.end = receivers.start;
            push_in_pieces(&mut parts, open, limit / receiver_bytes);
            open = Part { clusters: cluster..cluster, receivers: receivers.clone() };
            widths = Widths::default();
        }
        widths = widths.plus(own);
        open.clusters.end = cluster + 1;
        open.receivers.end = receivers.end;
    }
    open.receivers.end = transport.n_receivers;
    push_in_pieces(&mut parts, open, limit / receiver_bytes);
    Ok(parts)
}

/// Receivers after the last cluster of a page are lit by none; if there are too many of them they get pages of their own.
fn push_in_pieces(parts: &mut Vec<Part>, part: Part, most_receivers: u64) {
    let most = most_receivers.max(1) as usize;
    let mut rest = part.receivers.clone();
    let mut clusters = part.clusters.clone();
    loop {
        let end = rest.end.min(rest.start + most);
        parts.push(Part { clusters: clusters.clone(), receivers: rest.start..end });
        clusters = clusters.end..clusters.end;
        rest.start = end;
        if rest.is_empty() {
            return;
        }
    }
}

fn upload_page(device: &wgpu::Device, transport: &Transport<'_>, part: &Part) -> TransportPage {
    let mut records = Vec::with_capacity(part.clusters.len());
    let mut receiver_cluster = vec![NO_CLUSTER; part.receivers.len()];
    let (mut probes, mut projection, mut reconstruction) = (Vec::new(), Vec::new(), Vec::new());
    let (mut n_lights, mut most_coefficients) = (0, 0);
    for cluster in part.clusters.clone() {
        let record = transport.clusters[cluster];
        let first_receiver = record.first_receiver - part.receivers.start as u32;
        receiver_cluster[first_receiver as usize..][..record.n_receivers as usize].fill(records.len() as u32);
        records.push(ClusterRecord {
            first_receiver,
            first_probe: probes.len() as u32,
            first_light: n_lights,
            projection_pair: (projection.len() / 2) as u32,
            reconstruction_pair: (reconstruction.len() / 2) as u32,
            ..record
        });
        n_lights += record.n_coefficients;
        most_coefficients = record.n_coefficients.max(most_coefficients);
        probes.extend_from_slice(&transport.cluster_probes[record.first_probe as usize..][..record.n_probes as usize]);
        push_block(&mut projection, &transport.projection[transport.projection_range(cluster)]);
        push_block(&mut reconstruction, &transport.reconstruction[transport.reconstruction_range(cluster)]);
    }
    let coefficients = (part.receivers.len() * transport.n_k) as u64 * 16;
    let n_clusters = records.len();
    if records.is_empty() {
        // A binding holds one element at least.
        records.push(ClusterRecord::default());
    }
    TransportPage {
        n_clusters,
        most_coefficients,
        receivers: part.receivers.clone(),
        clusters: storage(device, "transport.clusters", bytemuck::cast_slice(&records)),
        cluster_probes: storage(device, "transport.cluster_probes", bytemuck::cast_slice(&probes)),
        projection: storage(device, "transport.projection", bytemuck::cast_slice(&projection)),
        cluster_lights: zeros(device, "transport.cluster_lights", u64::from(n_lights) * 16),
        n_lights: n_lights as usize,
        receiver_cluster: storage(device, "transport.receiver_cluster", bytemuck::cast_slice(&receiver_cluster)),
        reconstruction: storage(device, "transport.reconstruction", bytemuck::cast_slice(&reconstruction)),
        coefficients: zeros(device, "transport.coefficients", coefficients),
    }
}

/// Appends a block of weights, padded to whole pairs.
fn push_block(array: &mut Vec<f16>, block: &[f16]) {
    array.extend_from_slice(block);
    array.extend((block.len() % 2 == 1).then_some(f16::ZERO));
}
