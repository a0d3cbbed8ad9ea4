//! Puts a finished picture onto a surface.

/// A pipeline for surfaces of one format.
pub struct Blit {
    pipeline: wgpu::RenderPipeline,
    nearest: wgpu::Sampler,
    linear: wgpu::Sampler,
}

/// A part of a surface, physical pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelRect {
    /// From the left.
    pub x: u32,
    /// From the top.
    pub y: u32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

impl Blit {
    /// `format` must not be one that encodes sRGB: the picture is encoded already.
    pub fn new(device: &wgpu::Device, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("viewer.blit"),
            source: wgpu::ShaderSource::Wgsl(include_str!("blit.wgsl").into()),
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("viewer.blit"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("whole_viewport"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("blit"),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            multiview_mask: None,
            cache: None,
        });
        let sampler = |filter| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("viewer.blit"),
                mag_filter: filter,
                min_filter: filter,
                ..Default::default()
            })
        };
        Self { pipeline, nearest: sampler(wgpu::FilterMode::Nearest), linear: sampler(wgpu::FilterMode::Linear) }
    }

    /// Draws a picture of `size` pixels over a part of the surface; exact if they are of one size.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        pass: &mut wgpu::RenderPass<'_>,
        picture: &wgpu::TextureView,
        size: (u32, u32),
        rect: PixelRect,
    ) {
        if rect.width == 0 || rect.height == 0 {
            return;
        }
        let sampler = if size == (rect.width, rect.height) { &self.nearest } else { &self.linear };
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("viewer.blit"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(picture) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(sampler) },
            ],
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_viewport(rect.x as f32, rect.y as f32, rect.width as f32, rect.height as f32, 0.0, 1.0);
        pass.draw(0..3, 0..1);
    }
}
