//! GPU side of the receiver reconstruction.

use crate::gpu::{Groups, Kernel, uniform};
use crate::shaders;
use crate::transport_pages::TransportPage;

pub(crate) struct ReceiverReconstructionPass {
    kernel: Kernel,
    pages: Vec<(wgpu::BindGroup, Groups)>,
}

impl ReceiverReconstructionPass {
    pub(crate) fn new(device: &wgpu::Device, pages: &[TransportPage], n_k: usize) -> Self {
        let source = shaders::source(include_str!("receiver_reconstruction.wgsl"));
        let kernel = Kernel::new(device, "receiver_reconstruction", &source, &[("N_K", n_k as f64)]);
        let pages = pages
            .iter()
            .filter(|page| !page.receivers.is_empty())
            .map(|page| {
                let n_receivers = page.receivers.len();
                let params = uniform(
                    device,
                    "receiver_reconstruction.params",
                    bytemuck::cast_slice(&[n_receivers as u32, 0, 0, 0]),
                );
                let resources = [
                    &params,
                    &page.clusters,
                    &page.receiver_cluster,
                    &page.reconstruction,
                    &page.cluster_lights,
                    &page.coefficients,
                ];
                let bindings = kernel.bind(device, &resources.map(wgpu::Buffer::as_entire_binding));
                (bindings, Groups::new(device, (n_receivers * n_k).div_ceil(64) as u64))
            })
            .collect();
        Self { kernel, pages }
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (bindings, groups) in &self.pages {
            self.kernel.dispatch(pass, bindings, *groups);
        }
    }
}
