//! GPU side of the cluster projection.

use crate::gpu::{Groups, Kernel, uniform, zeros};
use crate::shaders;
use crate::transport_pages::TransportPage;
use glam::Vec3;

/// Rows of a cluster that a workgroup computes: `ROWS` of the shader.
const ROWS: u32 = 8;

pub(crate) struct ClusterProjectionPass {
    kernel: Kernel,
    pages: Vec<Page>,
    sky_sh: wgpu::Buffer,
}

struct Page {
    params: wgpu::Buffer,
    n_clusters: u32,
    bindings: wgpu::BindGroup,
    groups: Groups,
}

impl ClusterProjectionPass {
    pub(crate) fn new(
        device: &wgpu::Device,
        pages: &[TransportPage],
        probe_radiance: &wgpu::Buffer,
        (n_sh, n_sky): (usize, usize),
    ) -> Self {
        let source = shaders::source(include_str!("cluster_projection.wgsl"));
        let kernel = Kernel::new(device, "cluster_projection", &source, &[("N_SH", n_sh as f64)]);
        let sky_sh = zeros(device, "cluster_projection.sky_sh", n_sky as u64 * 16);
        let pages = pages
            .iter()
            .map(|page| {
                let n_clusters = page.n_clusters as u32;
                let params = uniform(device, "cluster_projection.params", bytemuck::cast_slice(&[n_clusters, 0, 0, 0]));
                let resources = [
                    &params,
                    &page.clusters,
                    &page.cluster_probes,
                    &page.projection,
                    probe_radiance,
                    &sky_sh,
                    &page.cluster_lights,
                ];
                let bindings = kernel.bind(device, &resources.map(wgpu::Buffer::as_entire_binding));
                let layers = page.most_coefficients.div_ceil(ROWS).max(1);
                let groups = Groups::new(device, page.n_clusters as u64).layers(layers);
                Page { params, n_clusters, bindings, groups }
            })
            .collect();
        Self { kernel, pages, sky_sh }
    }

    /// `[n_sky]` SH radiance of the sky; empty is black, and its columns are then not read.
    pub(crate) fn set_sky(&self, queue: &wgpu::Queue, sky_sh: &[Vec3]) {
        let padded: Vec<[f32; 4]> = sky_sh.iter().map(|radiance| radiance.extend(0.0).to_array()).collect();
        queue.write_buffer(&self.sky_sh, 0, bytemuck::cast_slice(&padded));
        for page in &self.pages {
            let params = [page.n_clusters, (!sky_sh.is_empty()).into(), 0, 0];
            queue.write_buffer(&page.params, 0, bytemuck::cast_slice(&params));
        }
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for page in self.pages.iter().filter(|page| page.n_clusters > 0) {
            self.kernel.dispatch(pass, &page.bindings, page.groups);
        }
    }
}
