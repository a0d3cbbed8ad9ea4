//! What is drawn into: radiance with depth and four samples per pixel, resolved, then tone-mapped to 8-bit sRGB.

use crate::tone::ToneMap;
use glam::Vec3;
use half::f16;
use localprt_runtime::{
    RelightError,
    gpu::readback::{self, Readback},
};

/// Exposed value that [`ToneMap::Reinhard`] maps to white.
pub const WHITE: f32 = 4.0;

pub(crate) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const SRGB: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// The same bytes, undecoded.
const BYTES: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(crate) const SAMPLES: u32 = 4;

/// Textures of one picture size.
pub struct OffscreenTarget {
    pub(crate) samples: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    pub(crate) radiance_view: wgpu::TextureView,
    radiance: wgpu::Texture,
    srgb: wgpu::Texture,
    srgb_view: wgpu::TextureView,
    pipeline: wgpu::RenderPipeline,
    params: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl OffscreenTarget {
    /// `width` and `height` in pixels, at least 1.
    pub fn new(device: &wgpu::Device, width: u32, height: u32) -> Self {
        use wgpu::TextureUsages as Usage;
        let texture = |label, format, sample_count, usage, view_formats: &[wgpu::TextureFormat]| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: Usage::RENDER_ATTACHMENT | usage,
                view_formats,
            })
        };
        let samples = texture("viewer.samples", COLOR, SAMPLES, Usage::empty(), &[]);
        let depth = texture("viewer.depth", DEPTH, SAMPLES, Usage::empty(), &[]);
        let radiance = texture("viewer.radiance", COLOR, 1, Usage::TEXTURE_BINDING | Usage::COPY_SRC, &[]);
        let srgb = texture("viewer.srgb", SRGB, 1, Usage::TEXTURE_BINDING | Usage::COPY_SRC, &[BYTES]);
        let radiance_view = radiance.create_view(&Default::default());
        let pipeline = pipeline(device);
        let params = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("viewer.tone_map"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("viewer.tone_map"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: params.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(&radiance_view) },
            ],
        });
        Self {
            samples: samples.create_view(&Default::default()),
            depth: depth.create_view(&Default::default()),
            radiance_view,
            radiance,
            srgb_view: srgb.create_view(&Default::default()),
            srgb,
            pipeline,
            params,
            group,
        }
    }

    /// Width over height.
    pub fn aspect(&self) -> f32 {
        self.radiance.width() as f32 / self.radiance.height() as f32
    }

    /// The pixel from which on a picture that is split at a share of its width shows another system's light.
    pub fn split_px(&self, split: f32) -> f32 {
        (split * self.radiance.width() as f32).round()
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.radiance.width(), self.radiance.height())
    }

    /// Linear radiance, Rgba16Float: can be sampled and copied from.
    pub fn radiance_texture(&self) -> &wgpu::Texture {
        &self.radiance
    }

    /// The picture's sRGB bytes as they are, Rgba8Unorm: for a user interface that composes encoded colors.
    pub fn srgb_bytes_view(&self) -> wgpu::TextureView {
        self.srgb.create_view(&wgpu::TextureViewDescriptor {
            label: Some("viewer.srgb_bytes"),
            format: Some(BYTES),
            usage: Some(wgpu::TextureUsages::TEXTURE_BINDING),
            ..Default::default()
        })
    }

    /// Encodes the picture from the radiance: radiance times `scale` (2^EV) through a tone curve.
    pub fn tone_map(&self, queue: &wgpu::Queue, encoder: &mut wgpu::CommandEncoder, scale: f32, tone: ToneMap) {
        self.tone_map_split(queue, encoder, scale, tone, None);
    }

    /// The same with a white line where the picture is split, at a share of its width.
    pub fn tone_map_split(
        &self,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        scale: f32,
        tone: ToneMap,
        split: Option<f32>,
    ) {
        let split_px = split.map_or(0.0, |split| self.split_px(split));
        let params = [scale.to_bits(), WHITE.to_bits(), tone.code(), split_px.to_bits()];
        queue.write_buffer(&self.params, 0, bytemuck::cast_slice(&params));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("viewer.tone_map"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.srgb_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }

    /// Radiance per pixel, top row first. Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_radiance(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Vec<Vec3>, RelightError> {
        let bytes = readback::texture(device, queue, &self.radiance, 0)?;
        let band = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
        let pixel = |bytes: &[u8]| Vec3::new(band(bytes), band(&bytes[2..]), band(&bytes[4..]));
        Ok(bytes.chunks_exact(8).map(pixel).collect())
    }

    /// The tone-mapped picture, three bytes a pixel, top row first. Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`].
    pub fn read_srgb(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Vec<u8>, RelightError> {
        let bytes = readback::texture(device, queue, &self.srgb, 0)?;
        Ok(bytes.chunks_exact(4).flat_map(|rgba| &rgba[..3]).copied().collect())
    }

    /// The same when it has arrived, four bytes a pixel.
    pub fn request_srgb(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Readback {
        readback::request_texture(device, queue, &self.srgb, 0)
    }
}

fn pipeline(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("viewer.tone_map"),
        source: wgpu::ShaderSource::Wgsl(include_str!("tone_map.wgsl").into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("viewer.tone_map"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("whole_picture"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("tone_map"),
            compilation_options: Default::default(),
            targets: &[Some(SRGB.into())],
        }),
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        multiview_mask: None,
        cache: None,
    })
}
