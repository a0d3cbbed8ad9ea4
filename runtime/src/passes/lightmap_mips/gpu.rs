//! GPU side of the mip chain: the light map texture and the dispatches that fill its levels.

use super::level_sizes;
use crate::gpu::{Groups, Kernel, uniform};
use crate::shaders;

/// Levels that one dispatch writes: WebGPU guarantees four storage textures.
const LEVELS_PER_DISPATCH: usize = 4;

/// The light map with all levels.
///
/// Levels halve rounded up, texture levels rounded down; the texture has the next power of two as its size, so that every
/// level fits.
pub(crate) struct LightMap {
    pub(crate) texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    pub(crate) levels: Vec<wgpu::TextureView>,
    pub(crate) size: u32,
}

impl LightMap {
    pub(crate) fn new(device: &wgpu::Device, size: u32, format: wgpu::TextureFormat) -> Self {
        let texture_size = size.next_power_of_two();
        let n_levels = level_sizes(size).len() as u32;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("localprt.light_map"),
            size: wgpu::Extent3d { width: texture_size, height: texture_size, depth_or_array_layers: 1 },
            mip_level_count: n_levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let levels = (0..n_levels)
            .map(|level| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    label: Some("localprt.light_map.level"),
                    base_mip_level: level,
                    mip_level_count: Some(1),
                    ..Default::default()
                })
            })
            .collect();
        let view = texture.create_view(&Default::default());
        Self { texture, view, levels, size }
    }

    /// Uncovers all texels of level 0 before the commands that are submitted next.
    pub(crate) fn clear_level_0(&self, queue: &wgpu::Queue) {
        const ROWS: u32 = 64;
        let row_bytes = self.size * self.texture.format().block_copy_size(None).unwrap_or(16);
        let zeros = vec![0; (row_bytes * ROWS) as usize];
        for first in (0..self.size).step_by(ROWS as usize) {
            let rows = ROWS.min(self.size - first);
            queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    origin: wgpu::Origin3d { x: 0, y: first, z: 0 },
                    ..self.texture.as_image_copy()
                },
                &zeros[..(row_bytes * rows) as usize],
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: Some(rows) },
                wgpu::Extent3d { width: self.size, height: rows, depth_or_array_layers: 1 },
            );
        }
    }
}

pub(crate) struct LightmapMipsPass {
    kernel: Kernel,
    dispatches: Vec<(wgpu::BindGroup, Groups)>,
}

impl LightmapMipsPass {
    pub(crate) fn new(device: &wgpu::Device, light_map: &LightMap) -> Self {
        let format = light_map.texture.format();
        let kernel = Kernel::new(
            device,
            "lightmap_mips",
            &shaders::source_with_format(include_str!("lightmap_mips.wgsl"), format),
            &[],
        );
        let sizes = level_sizes(light_map.size);
        // Bound where there is no level to write.
        let spare: Vec<_> = (0..LEVELS_PER_DISPATCH).map(|_| spare_view(device, format)).collect();
        let dispatches = (0..sizes.len().saturating_sub(1))
            .step_by(LEVELS_PER_DISPATCH)
            .map(|below| {
                let n_levels = (sizes.len() - 1 - below).min(LEVELS_PER_DISPATCH);
                let params = uniform(
                    device,
                    "lightmap_mips.params",
                    bytemuck::cast_slice(&[sizes[below], n_levels as u32, 0, 0]),
                );
                let mut resources =
                    vec![params.as_entire_binding(), wgpu::BindingResource::TextureView(&light_map.levels[below])];
                for (above, spare) in spare.iter().enumerate() {
                    let view = if above < n_levels { &light_map.levels[below + 1 + above] } else { spare };
                    resources.push(wgpu::BindingResource::TextureView(view));
                }
                (kernel.bind(device, &resources), Groups::square(sizes[below], 16))
            })
            .collect();
        Self { kernel, dispatches }
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (bindings, groups) in &self.dispatches {
            self.kernel.dispatch(pass, bindings, *groups);
        }
    }
}

fn spare_view(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("localprt.lightmap_mips.spare"),
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}
