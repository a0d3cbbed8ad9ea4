//! What lights objects that move: the file's volume where there is one, else the probes around them.

use bytemuck::{Pod, Zeroable};
use localprt_runtime::Relighter;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BindGroupEntry, BindingResource, ShaderStages};

/// `ObjectLight` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct ObjectLightRecord {
    pub(crate) origin: [f32; 3],
    /// 0 without a volume.
    pub(crate) spacing_m: f32,
    pub(crate) size: [f32; 3],
    pub(crate) n_probes: u32,
    pub(crate) n_sh: u32,
    pub(crate) pad: [u32; 3],
}

/// SH coefficients of degree 1, each a texture.
const N_VOLUME_TEXTURES: usize = 4;

/// Group 2 of the objects' shader.
pub(crate) struct ObjectLight {
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
}

impl ObjectLight {
    pub(crate) fn new(device: &wgpu::Device, relighter: &Relighter) -> Self {
        let layout = layout(device);
        let volume = relighter.volume();
        let grid = volume.map(|volume| *volume.grid).unwrap_or_default();
        let record = ObjectLightRecord {
            origin: grid.origin,
            spacing_m: grid.spacing_m,
            size: grid.dims.map(|cells| cells as f32),
            n_probes: relighter.n_probes() as u32,
            n_sh: localprt_formats::sh::function_count(relighter.probe_degree()) as u32,
            pad: [0; 3],
        };
        let record = device.create_buffer_init(&BufferInitDescriptor {
            label: Some("viewer.object_light"),
            contents: bytemuck::bytes_of(&record),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let nothing = nothing(device);
        let texture = |index: usize| {
            let view = volume.and_then(|volume| volume.coefficients.get(index)).unwrap_or(&nothing);
            BindGroupEntry { binding: 3 + index as u32, resource: BindingResource::TextureView(view) }
        };
        let buffers = [
            BindGroupEntry { binding: 0, resource: record.as_entire_binding() },
            BindGroupEntry { binding: 1, resource: relighter.probes().as_entire_binding() },
            BindGroupEntry { binding: 2, resource: relighter.probe_radiance().as_entire_binding() },
        ];
        let entries: Vec<_> = buffers.into_iter().chain((0..N_VOLUME_TEXTURES).map(texture)).collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("viewer.object_light"),
            layout: &layout,
            entries: &entries,
        });
        Self { layout, group }
    }
}

/// Bound where there is no volume.
fn nothing(device: &wgpu::Device) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.no_volume"),
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = buffer(wgpu::BufferBindingType::Storage { read_only: true });
    let texture = |index: usize| {
        let ty = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D3,
            multisampled: false,
        };
        entry(3 + index as u32, ShaderStages::FRAGMENT, ty)
    };
    let buffers = [
        entry(0, ShaderStages::VERTEX_FRAGMENT, buffer(wgpu::BufferBindingType::Uniform)),
        entry(1, ShaderStages::VERTEX, storage),
        entry(2, ShaderStages::VERTEX, storage),
    ];
    let entries: Vec<_> = buffers.into_iter().chain((0..N_VOLUME_TEXTURES).map(texture)).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("viewer.object_light"),
        entries: &entries,
    })
}
