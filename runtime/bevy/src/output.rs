//! From the relighter's maps to those that Bevy samples: a light map, and ambient cubes of a volume.

use crate::units::of_degree_1;
use bevy::render::render_resource::TextureViewId;
use bevy::render::renderer::RenderQueue;
use bevy::render::texture::GpuImage;
use localprt_runtime::{HOST_WGSL, Relighter};
use std::f32::consts::PI;

const LIGHTMAP_TILE: u32 = 8;
const VOLUME_TILE: u32 = 4;

/// Compute passes into the textures of Bevy's images.
pub(crate) struct Output {
    passes: Vec<Pass>,
    into: Into,
}

/// Lightmap and voxels.
type Into = (TextureViewId, Option<TextureViewId>);

struct Pass {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: [u32; 3],
}

impl Output {
    /// What is written is irradiance over pi, times `scale`.
    pub(crate) fn new(
        device: &wgpu::Device,
        queue: &RenderQueue,
        relighter: &Relighter,
        scale: f32,
        lightmap: &GpuImage,
        voxels: Option<&GpuImage>,
    ) -> Self {
        let factor = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("localprt.bevy.factor"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&factor, 0, &(scale / PI).to_ne_bytes());
        let irradiance = relighter.irradiance_view();
        let size = irradiance.texture().size();
        let groups = [size.width.div_ceil(LIGHTMAP_TILE), size.height.div_ceil(LIGHTMAP_TILE), 1];
        let views: [&wgpu::TextureView; 2] = [irradiance, &lightmap.texture_view];
        let mut passes = vec![pass(device, "lightmap", include_str!("lightmap.wgsl"), &views, &factor, groups)];
        let coefficients = relighter.volume().as_ref().and_then(of_degree_1);
        if let (Some(voxels), Some([c0, cy, cz, cx])) = (voxels, coefficients) {
            let size = c0.texture().size();
            let groups = [size.width, size.height, size.depth_or_array_layers].map(|side| side.div_ceil(VOLUME_TILE));
            let source = [HOST_WGSL, include_str!("ambient_cubes.wgsl")].concat();
            let views: [&wgpu::TextureView; 5] = [c0, cy, cz, cx, &voxels.texture_view];
            passes.push(pass(device, "ambient_cubes", &source, &views, &factor, groups));
        }
        Self { passes, into: into(lightmap, voxels) }
    }

    /// Whether these are still the textures that are written.
    pub(crate) fn is_into(&self, lightmap: &GpuImage, voxels: Option<&GpuImage>) -> bool {
        self.into == into(lightmap, voxels)
    }

    pub(crate) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        for Pass { label, pipeline, bindings, groups: [x, y, z] } in &self.passes {
            let descriptor = wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bindings, &[]);
            pass.dispatch_workgroups(*x, *y, *z);
        }
    }
}

fn into(lightmap: &GpuImage, voxels: Option<&GpuImage>) -> Into {
    (lightmap.texture_view.id(), voxels.map(|voxels| voxels.texture_view.id()))
}

/// A pass of one entry point that has its own name: textures by number, then the factor.
fn pass(
    device: &wgpu::Device,
    name: &'static str,
    source: &str,
    views: &[&wgpu::TextureView],
    factor: &wgpu::Buffer,
    groups: [u32; 3],
) -> Pass {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: None,
        module: &module,
        entry_point: Some(name),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let textures = views.iter().map(|view| wgpu::BindingResource::TextureView(view));
    let resources = textures.chain([factor.as_entire_binding()]).zip(0..);
    let entries: Vec<_> = resources.map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource }).collect();
    let layout = &pipeline.get_bind_group_layout(0);
    let bindings =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(name), layout, entries: &entries });
    Pass { label: name, pipeline, bindings, groups }
}
