//! GPU side of near light: tiles in pages, each with the receivers of one page of the transport.

use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform};
use crate::passes::lightmap_mips::LightMap;
use crate::shaders;
use crate::transport_pages::TransportPage;
use bytemuck::{Pod, Zeroable};
use localprt_formats::{NearTile, NearView};

pub(crate) struct NearLightPass {
    kernel: Kernel,
    pages: Vec<(wgpu::BindGroup, Groups)>,
    bytes: u64,
    n_nodes: u64,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    n_tiles: u32,
    first_receiver: u32,
    n_receivers: u32,
    light_map_size: u32,
}

/// A tile, its places within the page's arrays.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TileRecord {
    first_receiver: u32,
    n_receivers: u32,
    first_node: u32,
    n_nodes: u32,
    first_link: u32,
    scale: f32,
    pad: [u32; 2],
}

impl NearLightPass {
    pub(crate) fn new(
        device: &wgpu::Device,
        near: &NearView<'_>,
        pages: &[TransportPage],
        light_map: &LightMap,
        n_k: usize,
    ) -> Self {
        let source = shaders::source(include_str!("near_light.wgsl"));
        let kernel = Kernel::new(device, "near_light", &source, &[("N_K", n_k as f64)]);
        let mut pass = Self { kernel, pages: Vec::new(), bytes: 0, n_nodes: 0 };
        let limit = page_bytes(device);
        for page in pages.iter().filter(|page| !page.receivers.is_empty()) {
            let is_of_page = |pair: &[NearTile]| {
                (pair[0].first_receiver as usize) < page.receivers.end
                    && pair[1].first_receiver as usize > page.receivers.start
            };
            let first = near.tiles.windows(2).position(is_of_page).unwrap_or(0);
            let end = near.tiles.windows(2).rposition(is_of_page).map_or(first, |last| last + 1);
            let mut from = first;
            while from < end {
                let to = fitting(&near.tiles[from..=end], n_k, limit) + from;
                pass.add_page(device, near, from..to, page, light_map, n_k);
                from = to;
            }
        }
        pass
    }

    /// Some tiles as far as they light the receivers of a page.
    fn add_page(
        &mut self,
        device: &wgpu::Device,
        near: &NearView<'_>,
        tiles: std::ops::Range<usize>,
        page: &TransportPage,
        light_map: &LightMap,
        n_k: usize,
    ) {
        let (start, end) = (near.tiles[tiles.start], near.tiles[tiles.end]);
        // Words of counts, links and weights start where their first byte stands in the file, so that bytes keep their places.
        let aligned = |first: u32| first / 4 * 4;
        let first_count = aligned(start.first_receiver);
        let first_link = aligned(start.first_link);
        let records: Vec<TileRecord> = near.tiles[tiles.start..=tiles.end]
            .windows(2)
            .map(|pair| TileRecord {
                first_receiver: pair[0].first_receiver - first_count,
                n_receivers: pair[1].first_receiver - pair[0].first_receiver,
                first_node: pair[0].first_node - start.first_node,
                n_nodes: pair[1].first_node - pair[0].first_node,
                first_link: pair[0].first_link - first_link,
                scale: pair[0].scale,
                pad: [0; 2],
            })
            .collect();
        let bytes = |values: &[u8], first: u32, end: u32, each: usize| {
            storage(device, "near_light.bytes", &values[first as usize * each..end as usize * each])
        };
        let weights: &[u8] = bytemuck::cast_slice(near.weights);
        let params = Params {
            n_tiles: records.len() as u32,
            // May be before the first counted receiver: the difference wraps, and so does the shader's.
            first_receiver: (page.receivers.start as u32).wrapping_sub(first_count),
            n_receivers: page.receivers.len() as u32,
            light_map_size: light_map.size,
        };
        let buffers = [
            storage(device, "near_light.tiles", bytemuck::cast_slice(&records)),
            storage(
                device,
                "near_light.nodes",
                bytemuck::cast_slice(&near.nodes[start.first_node as usize..end.first_node as usize]),
            ),
            bytes(near.counts, first_count, end.first_receiver, 1),
            bytes(near.links, first_link, end.first_link, 1),
            bytes(weights, first_link, end.first_link, n_k),
        ];
        self.bytes += buffers.iter().map(wgpu::Buffer::size).sum::<u64>();
        self.n_nodes += u64::from(end.first_node - start.first_node);
        let params = uniform(device, "near_light.params", bytemuck::bytes_of(&params));
        let mut resources = vec![params.as_entire_binding()];
        resources.extend(buffers.iter().map(wgpu::Buffer::as_entire_binding));
        resources.push(wgpu::BindingResource::TextureView(&light_map.view));
        resources.push(page.coefficients.as_entire_binding());
        let bindings = self.kernel.bind(device, &resources);
        self.pages.push((bindings, Groups::new(device, records.len() as u64)));
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (bindings, groups) in &self.pages {
            self.kernel.dispatch(pass, bindings, *groups);
        }
    }

    /// Bytes of its arrays.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Texels of the light map that it reads.
    pub(crate) fn n_nodes(&self) -> u64 {
        self.n_nodes
    }
}

/// Tiles from the first on whose arrays fit a binding, at least one; `tiles` holds one more than there are.
fn fitting(tiles: &[NearTile], n_k: usize, limit: u64) -> usize {
    let fits = |count: usize| {
        let (first, end) = (tiles[0], tiles[count]);
        let links = u64::from(end.first_link - first.first_link) + 4;
        let nodes = u64::from(end.first_node - first.first_node);
        let widest = (links * n_k as u64).max(4 * nodes).max((size_of::<TileRecord>() * count) as u64);
        widest.max(u64::from(end.first_receiver - first.first_receiver) + 4) <= limit
    };
    // Widths rise with the count.
    let (mut low, mut high) = (1, tiles.len() - 1);
    while low < high {
        let middle = (low + high).div_ceil(2);
        if fits(middle) { low = middle } else { high = middle - 1 }
    }
    low
}
