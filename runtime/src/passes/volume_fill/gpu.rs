//! GPU side of the volume: its transport, and the 3D textures that the host samples.

use crate::error::RelightError;
use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform};
use crate::passes::cluster_projection::ClusterProjectionPass;
use crate::passes::receiver_reconstruction::ReceiverReconstructionPass;
use crate::shaders;
use crate::transport_pages::{self, TransportPage};
use crate::volume::Volume;
use glam::Vec3;
use localprt_formats::{Transport, VolumeGrid};

/// Storage textures that WebGPU guarantees a shader stage.
const MAPS_PER_DISPATCH: usize = 4;
/// Marks a cell that takes its values from another.
const BORROWED: u32 = 1 << 31;

/// The volume of a file: a transport of its own and a texture per SH coefficient.
pub(crate) struct GpuVolume {
    pub(crate) grid: VolumeGrid,
    pub(crate) n_k: usize,
    #[cfg(test)]
    pub(crate) textures: Vec<wgpu::Texture>,
    pub(crate) views: Vec<wgpu::TextureView>,
    pub(crate) pages: Vec<TransportPage>,
    projection: ClusterProjectionPass,
    reconstruction: ReceiverReconstructionPass,
    kernel: Kernel,
    fills: Vec<(wgpu::BindGroup, Groups)>,
    fill_bytes: u64,
}

/// Name of a pass and what records it.
type Pass = (&'static str, fn(&GpuVolume, &mut wgpu::ComputePass<'_>));

impl GpuVolume {
    /// Its passes in order.
    pub(crate) const PASSES: [Pass; 3] = [
        ("volume_projection", |volume, pass| volume.projection.encode(pass)),
        ("volume_reconstruction", |volume, pass| volume.reconstruction.encode(pass)),
        ("volume_fill", Self::encode_fill),
    ];

    pub(crate) fn new(
        device: &wgpu::Device,
        volume: &Volume<'_>,
        transport: &Transport<'_>,
        probe_radiance: &wgpu::Buffer,
    ) -> Result<Self, RelightError> {
        let grid = *volume.grid();
        let [width, height, depth] = grid.dims;
        let allowed = device.limits().max_texture_dimension_3d;
        let longest = width.max(height).max(depth);
        if longest > allowed {
            let (needed, allowed) = (longest.into(), allowed.into());
            return Err(RelightError::Limit { what: "volume, cells along its longest side", needed, allowed });
        }
        let n_k = volume.n_k();
        let texture = |size| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("localprt.volume"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format: wgpu::TextureFormat::Rgba16Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
        let textures: Vec<_> = (0..n_k).map(|_| texture(size)).collect();
        let views: Vec<_> = textures.iter().map(|texture| texture.create_view(&Default::default())).collect();
        // Bound where there are fewer than four coefficients left.
        let spares: Vec<_> = (0..MAPS_PER_DISPATCH)
            .map(|_| texture(wgpu::Extent3d::default()).create_view(&Default::default()))
            .collect();

        let pages = transport_pages::upload(device, transport)?;
        let projection = ClusterProjectionPass::new(device, &pages, probe_radiance, (transport.n_sh, transport.n_sky));
        let reconstruction = ReceiverReconstructionPass::new(device, &pages, n_k);
        let kernel = Kernel::new(device, "volume_fill", &shaders::source(include_str!("volume_fill.wgsl")), &[]);
        let per_binding = (page_bytes(device) / 8).max(1) as usize;
        let mut fill_bytes = 0;
        let mut fills = Vec::new();
        for (page, of_page) in pages.iter().zip(fills_of_pages(volume, &pages)) {
            for of_binding in of_page.chunks(per_binding) {
                let buffer = storage(device, "volume_fill.fills", bytemuck::cast_slice(of_binding));
                fill_bytes += buffer.size();
                for first_k in (0..n_k).step_by(MAPS_PER_DISPATCH) {
                    let values = [of_binding.len() as u32, n_k as u32, first_k as u32, width, height, 0, 0, 0];
                    let params = uniform(device, "volume_fill.params", bytemuck::cast_slice(&values));
                    let mut resources = vec![
                        params.as_entire_binding(),
                        buffer.as_entire_binding(),
                        page.coefficients.as_entire_binding(),
                    ];
                    for (map, spare) in spares.iter().enumerate() {
                        resources.push(wgpu::BindingResource::TextureView(views.get(first_k + map).unwrap_or(spare)));
                    }
                    let groups = Groups::new(device, of_binding.len().div_ceil(64) as u64);
                    fills.push((kernel.bind(device, &resources), groups));
                }
            }
        }
        Ok(Self {
            grid,
            n_k,
            #[cfg(test)]
            textures,
            views,
            pages,
            projection,
            reconstruction,
            kernel,
            fills,
            fill_bytes,
        })
    }

    fn encode_fill(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (bindings, groups) in &self.fills {
            self.kernel.dispatch(pass, bindings, *groups);
        }
    }

    /// `[n_sky]` SH radiance; empty is black.
    pub(crate) fn set_sky(&self, queue: &wgpu::Queue, sky_sh: &[Vec3]) {
        self.projection.set_sky(queue, sky_sh);
    }

    /// Buffers and textures, bytes.
    pub(crate) fn memory(&self) -> [(&'static str, u64); 2] {
        let transport: u64 = self.pages.iter().map(TransportPage::bytes).sum();
        let texels: u64 = self.grid.dims.iter().map(|&cells| u64::from(cells)).product();
        [("volume transport", transport + self.fill_bytes), ("volume textures", 8 * texels * self.n_k as u64)]
    }
}

/// `[pages]` lists of cell and receiver within the page.
fn fills_of_pages(volume: &Volume<'_>, pages: &[TransportPage]) -> Vec<Vec<[u32; 2]>> {
    const NONE: u32 = u32::MAX;
    let view = volume.view();
    let mut receiver_of_cell = vec![NONE; volume.n_cells()];
    for (receiver, &cell) in view.cells.iter().enumerate() {
        receiver_of_cell[cell as usize] = receiver as u32;
    }
    let mut fills = vec![Vec::new(); pages.len()];
    let mut push = |cell: u32, receiver: u32, mark: u32| {
        let page = pages.partition_point(|page| page.receivers.end <= receiver as usize);
        fills[page].push([cell, (receiver - pages[page].receivers.start as u32) | mark]);
    };
    for (receiver, &cell) in view.cells.iter().enumerate() {
        push(cell, receiver as u32, 0);
    }
    for &[cell, source] in view.fill {
        push(cell, receiver_of_cell[source as usize], BORROWED);
    }
    fills
}
