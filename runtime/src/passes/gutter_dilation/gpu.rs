//! GPU side of the gutter dilation: the irradiance map and, for degree 1, the map of SH radiance.

use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform};
use crate::shaders;
use crate::transport_pages::TransportPage;
use localprt_formats::Checked;

/// The maps that the host samples.
pub(crate) struct ReceiverMaps {
    pub(crate) irradiance: wgpu::Texture,
    pub(crate) irradiance_view: wgpu::TextureView,
    /// Four layers, one SH coefficient each; 1 x 1 for files of degree 0.
    pub(crate) radiance: wgpu::Texture,
    pub(crate) radiance_view: wgpu::TextureView,
}

impl ReceiverMaps {
    pub(crate) fn new(device: &wgpu::Device, size: u32, n_k: usize, irradiance_format: wgpu::TextureFormat) -> Self {
        let map = |name, size, layers, format| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(name),
                size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let irradiance = map("localprt.irradiance_map", size, 1, irradiance_format);
        let radiance_size = if n_k == 4 { size } else { 1 };
        let radiance = map("localprt.radiance_map", radiance_size, 4, wgpu::TextureFormat::Rgba16Float);
        let irradiance_view = irradiance.create_view(&Default::default());
        let radiance_view = radiance.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Self { irradiance, irradiance_view, radiance, radiance_view }
    }
}

pub(crate) struct GutterDilationPass {
    kernel: Kernel,
    pages: Vec<(wgpu::BindGroup, Groups)>,
    bytes: u64,
    n_fills: u64,
}

impl GutterDilationPass {
    pub(crate) fn new(
        device: &wgpu::Device,
        baked: &Checked<'_>,
        pages: &[TransportPage],
        maps: &ReceiverMaps,
    ) -> Self {
        let view = baked.view();
        let n_k = baked.n_k();
        let text = [include_str!("../../shaders/sh.wgsl"), include_str!("gutter_dilation.wgsl")].join("\n");
        let source = shaders::source_with_format(&text, maps.irradiance.format());
        let kernel = Kernel::new(device, "gutter_dilation", &source, &[("N_K", n_k as f64)]);
        let per_binding = (page_bytes(device) / 8).max(1) as usize;
        let (mut bytes, mut n_fills) = (0, 0);
        let mut bound = Vec::new();
        for (page, fills) in pages.iter().zip(fills_of_pages(baked, pages)) {
            let normals: &[[f32; 3]] = if n_k == 4 { &view.receiver_normal[page.receivers.clone()] } else { &[] };
            let normals = storage(device, "gutter_dilation.normals", bytemuck::cast_slice(normals));
            bytes += normals.size();
            for fills in fills.chunks(per_binding) {
                let buffer = storage(device, "gutter_dilation.fills", bytemuck::cast_slice(fills));
                let size = view.metadata.lightmap_size;
                let params =
                    uniform(device, "gutter_dilation.params", bytemuck::cast_slice(&[fills.len() as u32, size, 0, 0]));
                bytes += buffer.size();
                n_fills += fills.len() as u64;
                let bindings = kernel.bind(
                    device,
                    &[
                        params.as_entire_binding(),
                        buffer.as_entire_binding(),
                        page.coefficients.as_entire_binding(),
                        normals.as_entire_binding(),
                        wgpu::BindingResource::TextureView(&maps.irradiance_view),
                        wgpu::BindingResource::TextureView(&maps.radiance_view),
                    ],
                );
                bound.push((bindings, Groups::new(device, fills.len().div_ceil(64) as u64)));
            }
        }
        Self { kernel, pages: bound, bytes, n_fills }
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (bindings, groups) in &self.pages {
            self.kernel.dispatch(pass, bindings, *groups);
        }
    }

    /// Texels that are written.
    pub(crate) fn n_fills(&self) -> u64 {
        self.n_fills
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// `[pages]` lists of texel and receiver within the page. Invocations run in any order, so a texel that is named twice
/// is listed once, with the value that counts last.
fn fills_of_pages(baked: &Checked<'_>, pages: &[TransportPage]) -> Vec<Vec<[u32; 2]>> {
    let view = baked.view();
    let size = view.metadata.lightmap_size as usize;
    const NONE: u32 = u32::MAX;
    let mut receiver_of_texel = vec![NONE; size * size];
    for (receiver, &texel) in view.receiver_texel.iter().enumerate() {
        receiver_of_texel[texel as usize] = receiver as u32;
    }
    for &[texel, receiver] in view.gutters {
        receiver_of_texel[texel as usize] = receiver;
    }
    let mut fills = vec![Vec::new(); pages.len()];
    for (texel, &receiver) in receiver_of_texel.iter().enumerate().filter(|(_, receiver)| **receiver != NONE) {
        let page = pages.partition_point(|page| page.receivers.end <= receiver as usize);
        fills[page].push([texel as u32, receiver - pages[page].receivers.start as u32]);
    }
    fills
}
