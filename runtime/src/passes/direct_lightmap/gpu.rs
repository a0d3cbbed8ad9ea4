//! GPU side of the direct light map: surface facts in pages, the material table, and the kernel over them.

use super::SurfaceTexels;
use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform, zeros};
use crate::shaders;
use crate::surface_texels::lightmap_uv;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use localprt_scenes::lighting::MaterialOverride;

/// Bytes of a material in the table: albedo and emission, each with a flag.
const MATERIAL_BYTES: usize = 32;

/// What the light map of one scene is made from.
pub(crate) struct DirectLightmapPass {
    kernel: Kernel,
    host_kernel: Kernel,
    pages: Vec<Page>,
    materials: wgpu::Buffer,
    /// `[n_texels]` vec4f.
    direct: wgpu::Buffer,
    params: Params,
    n_texels: usize,
}

struct Page {
    bindings: wgpu::BindGroup,
    params: wgpu::Buffer,
    len: usize,
    groups: Groups,
    bytes: u64,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    n_texels: u32,
    size: u32,
    irradiance_size: u32,
    has_emission: u32,
    feedback_albedo_cap: f32,
    albedo_override: f32,
    n_materials: u32,
    pad: u32,
}

/// Facts about the surface that stay as they are while lights and materials change.
pub(crate) struct Surface<'a> {
    pub(crate) size: u32,
    pub(crate) index: &'a [u32],
    /// Empty: places of their own.
    pub(crate) lightmap_uv: &'a [u32],
    pub(crate) albedo: &'a [Vec3],
    pub(crate) emission: &'a [Vec3],
    /// Empty: all are 0.
    pub(crate) material: &'a [u32],
}

impl<'a> Surface<'a> {
    pub(crate) fn of_texels(texels: &'a SurfaceTexels) -> Self {
        Self {
            size: texels.size,
            index: &texels.index,
            lightmap_uv: &texels.lightmap_uv,
            albedo: &texels.albedo,
            emission: &texels.emission,
            material: &[],
        }
    }
}

/// The maps that the pass reads and writes.
pub(crate) struct Maps<'a> {
    pub(crate) irradiance: &'a wgpu::TextureView,
    pub(crate) irradiance_size: u32,
    pub(crate) light_map_level_0: &'a wgpu::TextureView,
}

impl DirectLightmapPass {
    pub(crate) fn new(device: &wgpu::Device, light_map_format: wgpu::TextureFormat, feedback_albedo_cap: f32) -> Self {
        let source = |text| shaders::source_with_format(text, light_map_format);
        Self {
            kernel: Kernel::new(device, "direct_lightmap", &source(include_str!("direct_lightmap.wgsl")), &[]),
            host_kernel: Kernel::new(device, "host_lightmap", &source(include_str!("host_lightmap.wgsl")), &[]),
            pages: Vec::new(),
            materials: zeros(device, "direct_lightmap.materials", MATERIAL_BYTES as u64),
            direct: zeros(device, "direct_lightmap.direct", 16),
            params: Params { feedback_albedo_cap, albedo_override: -1.0, ..Params::zeroed() },
            n_texels: 0,
        }
    }

    /// Uploads the facts of a scene. `direct` is read every gather: irradiance per covered texel, `[n_texels]` vec4f.
    pub(crate) fn set_surface(
        &mut self,
        device: &wgpu::Device,
        surface: &Surface<'_>,
        direct: wgpu::Buffer,
        maps: &Maps<'_>,
    ) {
        self.direct = direct;
        // The widest element is the direct irradiance; pages start at multiples of 256 bytes of it.
        let per_page = (page_bytes(device) / 16) as usize;
        let has_emission = surface.emission.iter().any(|emission| *emission != Vec3::ZERO);
        self.params.size = surface.size;
        self.params.albedo_override = -1.0;
        self.params.irradiance_size = maps.irradiance_size;
        self.params.has_emission = has_emission.into();
        self.n_texels = surface.index.len();
        self.params.n_materials = surface.material.iter().max().map_or(1, |last| last + 1);
        self.materials =
            zeros(device, "direct_lightmap.materials", u64::from(self.params.n_materials) * MATERIAL_BYTES as u64);
        self.pages = (0..surface.index.len())
            .step_by(per_page.max(1))
            .map(|first| {
                let range = first..surface.index.len().min(first + per_page);
                let packed: Vec<[u32; 3]> = range
                    .clone()
                    .map(|texel| {
                        let [r, g, b] = surface.albedo[texel].to_array().map(unorm16);
                        let material = surface.material.get(texel).copied().unwrap_or(0);
                        let place = lightmap_uv(surface.size, surface.index[texel], texel, surface.lightmap_uv);
                        [r | g << 16, b | material << 16, place]
                    })
                    .collect();
                let emission: &[Vec3] = if has_emission { &surface.emission[range.clone()] } else { &[] };
                let index = &surface.index[range.clone()];
                let buffers = [
                    storage(device, "direct_lightmap.texel_index", bytemuck::cast_slice(index)),
                    storage(device, "direct_lightmap.surface", bytemuck::cast_slice(&packed)),
                    storage(device, "direct_lightmap.emission", bytemuck::cast_slice(emission)),
                ];
                let direct = wgpu::BufferBinding {
                    buffer: &self.direct,
                    offset: range.start as u64 * 16,
                    size: wgpu::BufferSize::new(range.len() as u64 * 16),
                };
                let params = uniform(
                    device,
                    "direct_lightmap.params",
                    bytemuck::bytes_of(&Params { n_texels: range.len() as u32, ..self.params }),
                );
                let bindings = self.kernel.bind(
                    device,
                    &[
                        params.as_entire_binding(),
                        buffers[0].as_entire_binding(),
                        buffers[1].as_entire_binding(),
                        buffers[2].as_entire_binding(),
                        self.materials.as_entire_binding(),
                        wgpu::BindingResource::Buffer(direct),
                        wgpu::BindingResource::TextureView(maps.irradiance),
                        wgpu::BindingResource::TextureView(maps.light_map_level_0),
                    ],
                );
                let bytes = buffers.iter().map(wgpu::Buffer::size).sum::<u64>();
                let groups = Groups::new(device, range.len().div_ceil(64) as u64);
                Page { bindings, params, len: range.len(), groups, bytes }
            })
            .collect();
    }

    /// Overrides by material index; materials beyond the list are the scene's own.
    pub(crate) fn set_materials(
        &mut self,
        queue: &wgpu::Queue,
        overrides: &[MaterialOverride],
        albedo_override: Option<f32>,
    ) {
        let flagged = |color: Option<Vec3>| color.map_or([0.0; 4], |color| color.extend(1.0).to_array());
        let table: Vec<[f32; 8]> = (0..self.params.n_materials as usize)
            .map(|material| {
                let own = overrides.get(material).copied().unwrap_or_default();
                bytemuck::cast([flagged(own.albedo), flagged(own.emission)])
            })
            .collect();
        queue.write_buffer(&self.materials, 0, bytemuck::cast_slice(&table));
        self.params.albedo_override = albedo_override.map_or(-1.0, |albedo| albedo.clamp(0.0, 1.0));
        self.write_params(queue);
    }

    fn write_params(&self, queue: &wgpu::Queue) {
        for page in &self.pages {
            let params = Params { n_texels: page.len as u32, ..self.params };
            queue.write_buffer(&page.params, 0, bytemuck::bytes_of(&params));
        }
    }

    /// Irradiance straight from punctual lights, one value per covered texel.
    pub(crate) fn set_direct(&self, queue: &wgpu::Queue, direct: &[Vec3]) {
        let padded: Vec<[f32; 4]> = direct.iter().map(|value| value.extend(0.0).to_array()).collect();
        queue.write_buffer(&self.direct, 0, bytemuck::cast_slice(&padded));
    }

    /// Covered texels of the scene.
    pub(crate) fn n_texels(&self) -> usize {
        self.n_texels
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for page in &self.pages {
            self.kernel.dispatch(pass, &page.bindings, page.groups);
        }
    }

    /// Level 0 from a map of the host.
    pub(crate) fn encode_host_map(
        &self,
        device: &wgpu::Device,
        pass: &mut wgpu::ComputePass<'_>,
        host_map: &wgpu::TextureView,
        light_map_level_0: &wgpu::TextureView,
        size: u32,
    ) {
        let bindings = self.host_kernel.bind(
            device,
            &[wgpu::BindingResource::TextureView(host_map), wgpu::BindingResource::TextureView(light_map_level_0)],
        );
        self.host_kernel.dispatch(pass, &bindings, Groups::square(size, 8));
    }

    /// Bytes read and written per gather, but for the irradiance map.
    pub(crate) fn traffic(&self, light_map_texel_bytes: u64) -> u64 {
        let pages: u64 = self.pages.iter().map(|page| page.bytes).sum();
        pages + self.n_texels as u64 * (16 + light_map_texel_bytes)
    }

    /// Buffers by name with their bytes.
    pub(crate) fn memory(&self) -> Vec<(&'static str, u64)> {
        let total: u64 = self.pages.iter().map(|page| page.bytes).sum();
        vec![("surface texels", total), ("materials", self.materials.size())]
    }
}

/// A share in 0..=1 as a 16-bit integer; error at most 2^-17.
fn unorm16(value: f32) -> u32 {
    (value.clamp(0.0, 1.0) * 65535.0).round() as u32
}
