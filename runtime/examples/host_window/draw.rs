//! The host's own drawing: a pipeline, a vertex buffer and a depth buffer, as any renderer has them.

use glam::{Mat4, Vec3};
use localprt_runtime::{DIRECT_LIGHT_WGSL, HOST_WGSL, Relighter};
use localprt_scenes::Scene;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BindGroupEntry, BindGroupLayoutEntry, BindingResource, BindingType, BufferUsages, ShaderStages};

const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Position, normal, normal of the triangle, TEXCOORD_1 and a zero, albedo, emission.
type Corner = [Vec3; 6];

pub struct Draw {
    corners: wgpu::Buffer,
    world_to_clip: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    pipeline: wgpu::RenderPipeline,
}

impl Draw {
    /// `light_layout`: of the relighter's direct pass.
    pub fn new(
        device: &wgpu::Device,
        relighter: &Relighter,
        light_layout: &wgpu::BindGroupLayout,
        scene: &Scene,
        format: wgpu::TextureFormat,
    ) -> Self {
        let filled = |contents: &[u8], usage| {
            device.create_buffer_init(&BufferInitDescriptor { label: Some("host.buffer"), contents, usage })
        };
        let corners = filled(bytemuck::cast_slice(&corners(scene)), BufferUsages::VERTEX);
        let world_to_clip = filled(bytemuck::bytes_of(&Mat4::IDENTITY), BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        let pipeline = pipeline(device, light_layout, format);
        // The map is filtered; everything else of the sampler is as it comes, clamped.
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let irradiance = BindingResource::TextureView(relighter.irradiance_view());
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("host.frame"),
            layout: &pipeline.get_bind_group_layout(1),
            entries: &[
                BindGroupEntry { binding: 0, resource: world_to_clip.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: irradiance },
                BindGroupEntry { binding: 2, resource: BindingResource::Sampler(&sampler) },
            ],
        });
        Self { corners, world_to_clip, frame_group, pipeline }
    }

    pub fn set_camera(&self, queue: &wgpu::Queue, world_to_clip: &Mat4) {
        queue.write_buffer(&self.world_to_clip, 0, bytemuck::bytes_of(world_to_clip));
    }

    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        light_group: &wgpu::BindGroup,
        picture: &wgpu::TextureView,
        depth: &wgpu::TextureView,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("host.draw"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: picture,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                // Depth 1 is at the near plane, 0 infinitely far.
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, light_group, &[0]);
        pass.set_bind_group(1, &self.frame_group, &[]);
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.draw(0..(self.corners.size() / size_of::<Corner>() as u64) as u32, 0..1);
    }
}

pub fn depth_buffer(device: &wgpu::Device, width: u32, height: u32) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("host.depth"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: DEPTH,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

/// Corners of all triangles. Textures by their colors at corners; other renderers have materials.
fn corners(scene: &Scene) -> Vec<Corner> {
    let corners = |(mesh, triangle): (usize, usize)| {
        [Vec3::X, Vec3::Y, Vec3::Z].map(|barycentrics| {
            let point = scene.surface_point(mesh, triangle, barycentrics);
            let vertex = scene.meshes[mesh].triangles[triangle][barycentrics.max_position()] as usize;
            let uv = scene.meshes[mesh].lightmap_uv().map_or(Vec3::ZERO, |set| set[vertex].extend(0.0));
            let albedo = scene.base_color(mesh, triangle, barycentrics).truncate();
            let emission = scene.emission(mesh, triangle, barycentrics);
            [point.position, point.normal, point.geometric_normal, uv, albedo, emission]
        })
    };
    scene.faces().flat_map(corners).collect()
}

/// The lights' bind group is the relighter's, the other one the host's own.
fn pipeline(
    device: &wgpu::Device,
    light_layout: &wgpu::BindGroupLayout,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let source = [DIRECT_LIGHT_WGSL, HOST_WGSL, include_str!("draw.wgsl")].join("\n");
    let source = wgpu::ShaderSource::Wgsl(source.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("host.draw"), source });
    let entry = |binding, visibility, ty| BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let uniform =
        BindingType::Buffer { ty: wgpu::BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };
    let texture = BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let frame_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("host.draw"),
        entries: &[
            entry(0, ShaderStages::VERTEX, uniform),
            entry(1, ShaderStages::FRAGMENT, texture),
            entry(2, ShaderStages::FRAGMENT, BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
        ],
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(light_layout), Some(&frame_layout)],
        ..Default::default()
    });
    let attributes = wgpu::vertex_attr_array![
        0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x3, 5 => Float32x3
    ];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("host.draw"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Corner>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &attributes,
            })],
        },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        // A bake gives either side of a double-sided surface triangles of its own.
        primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Back), ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        multiview_mask: None,
        cache: None,
    })
}
