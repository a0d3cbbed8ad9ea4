//! GPU side of near light: tiles in pages, each with the receivers of one page of the transport.

use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform};
use crate::passes::lightmap_mips::LightMap;
use crate::shaders;
use crate::transport_pages::TransportPage;
use bytemuck::{Pod, Zeroable};
use localprt_formats::{Tile, Transport};

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
    n_receivers: u32,
    light_map_size: u32,
    pad: u32,
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
    place: u32,
    pad: u32,
}

impl NearLightPass {
    pub(crate) fn new(
        device: &wgpu::Device,
        transport: &Transport<'_>,
        pages: &[TransportPage],
        light_map: &LightMap,
    ) -> Self {
        let source = shaders::source(include_str!("near_light.wgsl"));
        let n_k = transport.n_k;
        let kernel = Kernel::new(device, "near_light", &source, &[("N_K", n_k as f64)]);
        let mut pass = Self { kernel, pages: Vec::new(), bytes: 0, n_nodes: 0 };
        let limit = page_bytes(device);
        for page in pages {
            // A tile may reach into two pages; each lights its own receivers.
            let first = transport.tiles.partition_point(|tile| tile.receivers.end <= page.receivers.start);
            let end = transport.tiles.partition_point(|tile| tile.receivers.start < page.receivers.end);
            let mut rest = transport.tiles.get(first..end).unwrap_or_default();
            while !rest.is_empty() {
                let (tiles, behind) = rest.split_at(fitting(rest, n_k, limit));
                pass.add_page(device, tiles, page, light_map);
                rest = behind;
            }
        }
        pass
    }

    /// Some tiles as far as they light the receivers of a page.
    fn add_page(&mut self, device: &wgpu::Device, tiles: &[Tile<'_>], page: &TransportPage, light_map: &LightMap) {
        let mut records = Vec::with_capacity(tiles.len());
        let (mut nodes, mut counts, mut links) = (Vec::new(), Vec::new(), Vec::new());
        let mut weights: Vec<u8> = Vec::new();
        for tile in tiles {
            records.push(TileRecord {
                first_receiver: counts.len() as u32,
                n_receivers: tile.receivers.len() as u32,
                first_node: nodes.len() as u32,
                n_nodes: tile.nodes.len() as u32,
                first_link: links.len() as u32,
                scale: tile.scale,
                // May be before the page's first receiver: the difference wraps, and so does the shader's.
                place: (tile.receivers.start as u32).wrapping_sub(page.receivers.start as u32),
                pad: 0,
            });
            nodes.extend_from_slice(tile.nodes);
            counts.extend_from_slice(tile.counts);
            links.extend_from_slice(tile.links);
            weights.extend_from_slice(bytemuck::cast_slice(tile.weights));
        }
        let params = Params {
            n_tiles: records.len() as u32,
            n_receivers: page.receivers.len() as u32,
            light_map_size: light_map.size,
            pad: 0,
        };
        let buffers = [
            storage(device, "near_light.tiles", bytemuck::cast_slice(&records)),
            storage(device, "near_light.nodes", bytemuck::cast_slice(&nodes)),
            storage(device, "near_light.counts", &counts),
            storage(device, "near_light.links", &links),
            storage(device, "near_light.weights", &weights),
        ];
        self.bytes += buffers.iter().map(wgpu::Buffer::size).sum::<u64>();
        self.n_nodes += nodes.len() as u64;
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

/// Tiles from the first on whose arrays fit a binding, at least one.
fn fitting(tiles: &[Tile<'_>], n_k: usize, limit: u64) -> usize {
    let mut widths = [0; 4];
    let fits = |tile: &&Tile<'_>| {
        let own = [tile.links.len() * n_k, 4 * tile.nodes.len(), size_of::<TileRecord>(), tile.receivers.len()];
        widths.iter_mut().zip(own).for_each(|(width, own)| *width += own as u64);
        widths.iter().all(|width| width.next_multiple_of(4) <= limit)
    };
    tiles.iter().take_while(fits).count().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::layout_test::assert_same_layout;
    use std::mem::offset_of;

    #[test]
    fn records_lie_as_the_shader_has_them() {
        let source = shaders::source(include_str!("near_light.wgsl"));
        let members = [
            ("first_receiver", offset_of!(TileRecord, first_receiver)),
            ("n_receivers", offset_of!(TileRecord, n_receivers)),
            ("first_node", offset_of!(TileRecord, first_node)),
            ("n_nodes", offset_of!(TileRecord, n_nodes)),
            ("first_link", offset_of!(TileRecord, first_link)),
            ("scale", offset_of!(TileRecord, scale)),
            ("place", offset_of!(TileRecord, place)),
            ("pad", offset_of!(TileRecord, pad)),
        ];
        assert_same_layout(&source, "Tile", size_of::<TileRecord>(), &members);
        let members = [
            ("n_tiles", offset_of!(Params, n_tiles)),
            ("n_receivers", offset_of!(Params, n_receivers)),
            ("light_map_size", offset_of!(Params, light_map_size)),
            ("pad", offset_of!(Params, pad)),
        ];
        assert_same_layout(&source, "Params", size_of::<Params>(), &members);
    }
}
