//! A transport on the GPU: projection, reconstruction and what they read and write, in pages of whole clusters.
//!
//! A page stands alone: its clusters read the probe radiance and light its own receivers. So no binding is wider than the
//! device allows, however large the bake is.

use crate::error::RelightError;
use crate::gpu::{page_bytes, storage, zeros};
use bytemuck::{Pod, Zeroable};
use half::f16;
use localprt_formats::{Cluster, Transport};
use std::ops::Range;

/// A cluster in the shaders: its places within the page's arrays. Of its matrices in pairs of f16.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PageCluster {
    first_receiver: u32,
    n_receivers: u32,
    first_probe: u32,
    n_probes: u32,
    n_sky: u32,
    n_coefficients: u32,
    first_light: u32,
    projection_pair: u32,
    reconstruction_pair: u32,
}

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
    Ok(pages.into_iter().map(|page| upload_page(device, transport, page)).collect())
}

/// Bytes of the arrays of some clusters.
#[derive(Clone, Copy, Default)]
struct Widths([u64; 6]);

impl Widths {
    fn of_cluster(cluster: &Cluster<'_>, n_k: usize) -> Self {
        Self(
            [
                cluster.projection.len().next_multiple_of(2) * 2,
                cluster.reconstruction.len().next_multiple_of(2) * 2,
                cluster.lights.len() * 16,
                cluster.probes.len() * 4,
                size_of::<PageCluster>(),
                cluster.receivers.len() * n_k * 16,
            ]
            .map(|bytes| bytes as u64),
        )
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|array| self.0[array] + other.0[array]))
    }

    fn widest(self) -> u64 {
        self.0.into_iter().fold(0, u64::max)
    }
}

/// Cuts before the cluster that would make any array of a page wider than `limit`.
fn split<'t, 'a>(transport: &'t Transport<'a>, limit: u64) -> Result<Vec<&'t [Cluster<'a>]>, RelightError> {
    let mut pages = Vec::new();
    let mut first = 0;
    let mut widths = Widths::default();
    for (number, cluster) in transport.clusters.iter().enumerate() {
        let own = Widths::of_cluster(cluster, transport.n_k);
        if own.widest() > limit {
            return Err(RelightError::Limit { what: "one cluster", needed: own.widest(), allowed: limit });
        }
        if widths.plus(own).widest() > limit {
            pages.push(&transport.clusters[first..number]);
            first = number;
            widths = Widths::default();
        }
        widths = widths.plus(own);
    }
    pages.push(&transport.clusters[first..]);
    pages.retain(|page| !page.is_empty());
    Ok(pages)
}

fn upload_page(device: &wgpu::Device, transport: &Transport<'_>, clusters: &[Cluster<'_>]) -> TransportPage {
    let first = clusters.first().map_or(0, |cluster| cluster.receivers.start);
    let receivers = first..clusters.last().map_or(first, |cluster| cluster.receivers.end);
    let mut records = Vec::with_capacity(clusters.len());
    let mut receiver_cluster = Vec::with_capacity(receivers.len());
    let (mut probes, mut projection, mut reconstruction) = (Vec::new(), Vec::new(), Vec::new());
    let (mut n_lights, mut most_coefficients) = (0, 0);
    for cluster in clusters {
        receiver_cluster.resize(receiver_cluster.len() + cluster.receivers.len(), records.len() as u32);
        let n_coefficients = cluster.lights.len() as u32;
        records.push(PageCluster {
            first_receiver: (cluster.receivers.start - receivers.start) as u32,
            n_receivers: cluster.receivers.len() as u32,
            first_probe: probes.len() as u32,
            n_probes: cluster.probes.len() as u32,
            n_sky: cluster.n_sky as u32,
            n_coefficients,
            first_light: n_lights,
            projection_pair: (projection.len() / 2) as u32,
            reconstruction_pair: (reconstruction.len() / 2) as u32,
        });
        n_lights += n_coefficients;
        most_coefficients = n_coefficients.max(most_coefficients);
        probes.extend_from_slice(cluster.probes);
        push_even(&mut projection, cluster.projection);
        push_even(&mut reconstruction, cluster.reconstruction);
    }
    TransportPage {
        n_clusters: records.len(),
        most_coefficients,
        clusters: storage(device, "transport.clusters", bytemuck::cast_slice(&records)),
        cluster_probes: storage(device, "transport.cluster_probes", bytemuck::cast_slice(&probes)),
        projection: storage(device, "transport.projection", bytemuck::cast_slice(&projection)),
        cluster_lights: zeros(device, "transport.cluster_lights", u64::from(n_lights) * 16),
        n_lights: n_lights as usize,
        receiver_cluster: storage(device, "transport.receiver_cluster", bytemuck::cast_slice(&receiver_cluster)),
        reconstruction: storage(device, "transport.reconstruction", bytemuck::cast_slice(&reconstruction)),
        coefficients: zeros(device, "transport.coefficients", (receivers.len() * transport.n_k) as u64 * 16),
        receivers,
    }
}

/// Appends a matrix, padded to whole pairs.
fn push_even(array: &mut Vec<f16>, matrix: &[f16]) {
    array.extend_from_slice(matrix);
    array.extend((matrix.len() % 2 == 1).then_some(f16::ZERO));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::{self, layout_test::assert_same_layout};
    use std::mem::offset_of;

    #[test]
    fn clusters_lie_as_the_shaders_have_them() {
        let source = shaders::source("");
        let members = [
            ("first_receiver", offset_of!(PageCluster, first_receiver)),
            ("n_receivers", offset_of!(PageCluster, n_receivers)),
            ("first_probe", offset_of!(PageCluster, first_probe)),
            ("n_probes", offset_of!(PageCluster, n_probes)),
            ("n_sky", offset_of!(PageCluster, n_sky)),
            ("n_coefficients", offset_of!(PageCluster, n_coefficients)),
            ("first_light", offset_of!(PageCluster, first_light)),
            ("projection_pair", offset_of!(PageCluster, projection_pair)),
            ("reconstruction_pair", offset_of!(PageCluster, reconstruction_pair)),
        ];
        assert_same_layout(&source, "Cluster", size_of::<PageCluster>(), &members);
    }
}
