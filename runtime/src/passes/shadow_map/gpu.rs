//! Shadow maps on the GPU: draws the casters into the layers of a depth texture.

use super::records::{MaskedVertex, mask_records, masked_vertices, opaque_indices};
use super::{CasterBounds, CasterMasks, ShadowCasters, ShadowView};
use crate::error::RelightError;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BindGroupDescriptor, BindGroupEntry, BufferDescriptor, BufferUsages, ShaderStages};

/// The whole shader; `shadow_view.wgsl` comes first.
pub(crate) const SHADER: &str = concat!(include_str!("shadow_view.wgsl"), include_str!("shadow_map.wgsl"));

const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// `ShadowView` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct ViewRecord {
    origin: [f32; 3],
    scale_x: f32,
    right: [f32; 3],
    scale_y: f32,
    up: [f32; 3],
    depth_0: f32,
    forward: [f32; 3],
    depth_z: f32,
    w_0: f32,
    w_z: f32,
    /// Structs with a vec3f end at a multiple of 16 bytes.
    padding: [f32; 2],
}

impl From<&ShadowView> for ViewRecord {
    fn from(view: &ShadowView) -> Self {
        Self {
            origin: view.origin.to_array(),
            scale_x: view.scale.x,
            right: view.right.to_array(),
            scale_y: view.scale.y,
            up: view.up.to_array(),
            depth_0: view.depth.x,
            forward: view.forward.to_array(),
            depth_z: view.depth.y,
            w_0: view.w.x,
            w_z: view.w.y,
            padding: [0.0; 2],
        }
    }
}

/// Draws shadow maps into the layers of one texture.
pub(crate) struct ShadowMapPass {
    texture: wgpu::Texture,
    /// All layers, to be read.
    maps: wgpu::TextureView,
    /// One layer each, to be drawn into.
    layers: Vec<wgpu::TextureView>,
    opaque_pipeline: wgpu::RenderPipeline,
    masked_pipeline: wgpu::RenderPipeline,
    views_layout: wgpu::BindGroupLayout,
    masks_layout: wgpu::BindGroupLayout,
    casters: CasterBuffers,
    moving: CasterBuffers,
    views: wgpu::Buffer,
    views_group: wgpu::BindGroup,
}

struct CasterBuffers {
    bounds: CasterBounds,
    positions: wgpu::Buffer,
    indices: wgpu::Buffer,
    n_indices: u32,
    masked: wgpu::Buffer,
    /// Vertices of `masked` with the masks that they read.
    masked_draws: Vec<(Range<u32>, wgpu::BindGroup)>,
}

impl ShadowMapPass {
    pub fn new(device: &wgpu::Device, size: u32, n_layers: u32) -> Self {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("localprt.shadow_map.maps"),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: n_layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let maps = texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some("localprt.shadow_map.maps"),
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let layer = |layer| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                label: Some("localprt.shadow_map.layer"),
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            })
        };
        let views_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("localprt.shadow_map.views"),
            entries: &[storage_entry(0, ShaderStages::VERTEX)],
        });
        let masks_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("localprt.shadow_map.masks"),
            entries: &[storage_entry(0, ShaderStages::FRAGMENT), storage_entry(1, ShaderStages::FRAGMENT)],
        });
        let (opaque_pipeline, masked_pipeline) = pipelines(device, &views_layout, &masks_layout);
        let (casters, moving) = (CasterBuffers::empty(device), CasterBuffers::empty(device));
        let (views, views_group) = view_buffer(device, &views_layout, 6);
        Self {
            layers: (0..n_layers).map(layer).collect(),
            texture,
            maps,
            opaque_pipeline,
            masked_pipeline,
            views_layout,
            masks_layout,
            casters,
            moving,
            views,
            views_group,
        }
    }

    /// Uploads casters, which must have passed their check.
    pub fn set_casters(&mut self, device: &wgpu::Device, casters: &ShadowCasters) -> Result<(), RelightError> {
        self.casters = CasterBuffers::new(device, &self.masks_layout, casters)?;
        Ok(())
    }

    /// The same for those that move, drawn after them.
    pub fn set_moving_casters(&mut self, device: &wgpu::Device, casters: &ShadowCasters) -> Result<(), RelightError> {
        self.moving = CasterBuffers::new(device, &self.masks_layout, casters)?;
        Ok(())
    }

    /// Box around all casters.
    pub fn bounds(&self) -> CasterBounds {
        let (fixed, moving) = (self.casters.bounds, self.moving.bounds);
        if self.moving.is_empty() {
            return fixed;
        }
        CasterBounds { low: fixed.low.min(moving.low), high: fixed.high.max(moving.high) }
    }

    pub fn size(&self) -> u32 {
        self.texture.width()
    }

    pub fn n_layers(&self) -> usize {
        self.layers.len()
    }

    pub fn texture(&self) -> &wgpu::Texture {
        &self.texture
    }

    /// All layers as `texture_depth_2d_array`.
    pub fn maps(&self) -> &wgpu::TextureView {
        &self.maps
    }

    /// Of casters and maps.
    pub fn bytes(&self) -> u64 {
        let casters = [&self.casters.positions, &self.casters.indices, &self.casters.masked];
        let size = self.texture.size();
        casters.map(wgpu::Buffer::size).into_iter().sum::<u64>()
            + 4 * u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers)
    }

    /// The views of the last [`ShadowMapPass::write_views`].
    pub fn views(&self) -> &wgpu::Buffer {
        &self.views
    }

    /// Writes the views that [`ShadowMapPass::draw`] refers to; true if that took a new buffer.
    pub fn write_views(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, views: &[ViewRecord]) -> bool {
        let grows = size_of_val(views) as u64 > self.views.size();
        if grows {
            (self.views, self.views_group) = view_buffer(device, &self.views_layout, views.len());
        }
        queue.write_buffer(&self.views, 0, bytemuck::cast_slice(views));
        grows
    }

    /// Draws one view into a layer.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        layer: usize,
        view: u32,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("localprt.shadow_map"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.layers[layer],
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes,
            ..Default::default()
        });
        pass.set_bind_group(0, &self.views_group, &[]);
        for casters in [&self.casters, &self.moving] {
            self.draw_casters(&mut pass, casters, view);
        }
    }

    fn draw_casters(&self, pass: &mut wgpu::RenderPass<'_>, casters: &CasterBuffers, view: u32) {
        if casters.n_indices > 0 {
            pass.set_pipeline(&self.opaque_pipeline);
            pass.set_vertex_buffer(0, casters.positions.slice(..));
            pass.set_index_buffer(casters.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..casters.n_indices, 0, view..view + 1);
        }
        if !casters.masked_draws.is_empty() {
            pass.set_pipeline(&self.masked_pipeline);
            pass.set_vertex_buffer(0, casters.masked.slice(..));
            for (vertices, masks) in &casters.masked_draws {
                pass.set_bind_group(1, masks, &[]);
                pass.draw(vertices.clone(), view..view + 1);
            }
        }
    }
}

/// A read-only storage buffer of a bind group layout.
pub(crate) fn storage_entry(binding: u32, visibility: ShaderStages) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

fn pipelines(
    device: &wgpu::Device,
    views_layout: &wgpu::BindGroupLayout,
    masks_layout: &wgpu::BindGroupLayout,
) -> (wgpu::RenderPipeline, wgpu::RenderPipeline) {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("localprt.shadow_map.shader"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let pipeline = |label, groups: &[_], entry_point, vertex: wgpu::VertexBufferLayout<'_>, fragment: Option<&str>| {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: groups,
            ..Default::default()
        });
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: Default::default(),
                buffers: &[Some(vertex)],
            },
            // Both sides cast.
            primitive: wgpu::PrimitiveState { cull_mode: None, ..Default::default() },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: fragment.map(|entry_point| wgpu::FragmentState {
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: Default::default(),
                targets: &[],
            }),
            multiview_mask: None,
            cache: None,
        })
    };
    let opaque = wgpu::VertexBufferLayout {
        array_stride: 12,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3],
    };
    let masked = wgpu::VertexBufferLayout {
        array_stride: size_of::<MaskedVertex>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x2, 2 => Float32, 3 => Uint32],
    };
    (
        pipeline("localprt.shadow_map.opaque_pipeline", &[Some(views_layout)], "opaque_vertex", opaque, None),
        pipeline(
            "localprt.shadow_map.masked_pipeline",
            &[Some(views_layout), Some(masks_layout)],
            "masked_vertex",
            masked,
            Some("masked_fragment"),
        ),
    )
}

fn view_buffer(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    n_views: usize,
) -> (wgpu::Buffer, wgpu::BindGroup) {
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("localprt.shadow_map.views"),
        size: (n_views * size_of::<ViewRecord>()) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let group = device.create_bind_group(&BindGroupDescriptor {
        label: Some("localprt.shadow_map.views"),
        layout,
        entries: &[BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
    });
    (buffer, group)
}

/// A buffer with these contents, or of 16 bytes if there are none: a binding must not be empty.
pub(crate) fn filled_buffer(
    device: &wgpu::Device,
    label: &'static str,
    contents: &[u8],
    usage: BufferUsages,
) -> Result<wgpu::Buffer, RelightError> {
    let (needed, allowed) = (contents.len() as u64, device.limits().max_buffer_size);
    if needed > allowed {
        return Err(RelightError::Limit { what: label, needed, allowed });
    }
    let contents = if contents.is_empty() { &[0; 16] } else { contents };
    Ok(device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage }))
}

impl CasterBuffers {
    fn is_empty(&self) -> bool {
        self.n_indices == 0 && self.masked_draws.is_empty()
    }

    fn empty(device: &wgpu::Device) -> Self {
        let vertices = |label| {
            device.create_buffer_init(&BufferInitDescriptor {
                label: Some(label),
                contents: &[0; 16],
                usage: BufferUsages::VERTEX | BufferUsages::INDEX,
            })
        };
        Self {
            bounds: CasterBounds::default(),
            positions: vertices("localprt.shadow_map.positions"),
            indices: vertices("localprt.shadow_map.indices"),
            n_indices: 0,
            masked: vertices("localprt.shadow_map.masked"),
            masked_draws: Vec::new(),
        }
    }

    fn new(
        device: &wgpu::Device,
        masks_layout: &wgpu::BindGroupLayout,
        casters: &ShadowCasters,
    ) -> Result<Self, RelightError> {
        let indices = opaque_indices(casters);
        let label = "localprt.shadow_map.positions";
        let positions = filled_buffer(device, label, bytemuck::cast_slice(&casters.positions), BufferUsages::VERTEX)?;
        let label = "localprt.shadow_map.indices";
        let index_buffer = filled_buffer(device, label, bytemuck::cast_slice(&indices), BufferUsages::INDEX)?;

        let mut vertices: Vec<MaskedVertex> = Vec::new();
        let mut masked_draws = Vec::new();
        if let Some(masks) = &casters.masks {
            for page in mask_pages(device, masks)? {
                let first = vertices.len() as u32;
                vertices.extend(masked_vertices(casters, &page.images));
                if vertices.len() as u32 > first {
                    masked_draws.push((first..vertices.len() as u32, page.bind_group(device, masks_layout, masks)?));
                }
            }
        }
        let label = "localprt.shadow_map.masked";
        let masked = filled_buffer(device, label, bytemuck::cast_slice(&vertices), BufferUsages::VERTEX)?;
        let n_indices = indices.len() as u32;
        Ok(Self { bounds: casters.bounds(), positions, indices: index_buffer, n_indices, masked, masked_draws })
    }
}

/// Consecutive images that fit into one binding.
struct MaskPage {
    images: Range<usize>,
}

fn mask_pages(device: &wgpu::Device, masks: &CasterMasks) -> Result<Vec<MaskPage>, RelightError> {
    // Less a word, to which a page is rounded up.
    let allowed = device.limits().max_storage_buffer_binding_size.min(device.limits().max_buffer_size) - 4;
    let mut pages: Vec<MaskPage> = Vec::new();
    let mut page_bytes = 0;
    for (index, image) in masks.images.iter().enumerate() {
        let needed = image.alpha.len() as u64;
        if needed > allowed {
            return Err(RelightError::Limit { what: "the alpha of an image", needed, allowed });
        }
        match pages.last_mut() {
            Some(page) if page_bytes + needed <= allowed => page.images.end = index + 1,
            _ => {
                pages.push(MaskPage { images: index..index + 1 });
                page_bytes = 0;
            }
        }
        page_bytes += needed;
    }
    Ok(pages)
}

impl MaskPage {
    fn bind_group(
        &self,
        device: &wgpu::Device,
        layout: &wgpu::BindGroupLayout,
        masks: &CasterMasks,
    ) -> Result<wgpu::BindGroup, RelightError> {
        let (records, texels) = mask_records(masks, &self.images);
        let label = "localprt.shadow_map.masks";
        let records = filled_buffer(device, label, bytemuck::cast_slice(&records), BufferUsages::STORAGE)?;
        let texels = filled_buffer(device, "localprt.shadow_map.mask_texels", &texels, BufferUsages::STORAGE)?;
        Ok(device.create_bind_group(&BindGroupDescriptor {
            label: Some(label),
            layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: records.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: texels.as_entire_binding() },
            ],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::records::MaskRecord;
    use super::*;
    use crate::shaders::layout_test::assert_same_layout;
    use std::mem::offset_of;

    #[test]
    fn records_lie_as_the_shader_has_them() {
        let view = [
            ("origin", offset_of!(ViewRecord, origin)),
            ("scale_x", offset_of!(ViewRecord, scale_x)),
            ("right", offset_of!(ViewRecord, right)),
            ("scale_y", offset_of!(ViewRecord, scale_y)),
            ("up", offset_of!(ViewRecord, up)),
            ("depth_0", offset_of!(ViewRecord, depth_0)),
            ("forward", offset_of!(ViewRecord, forward)),
            ("depth_z", offset_of!(ViewRecord, depth_z)),
            ("w_0", offset_of!(ViewRecord, w_0)),
            ("w_z", offset_of!(ViewRecord, w_z)),
        ];
        assert_same_layout(SHADER, "ShadowView", size_of::<ViewRecord>(), &view);
        let mask = [
            ("first_texel", offset_of!(MaskRecord, first_texel)),
            ("width", offset_of!(MaskRecord, width)),
            ("height", offset_of!(MaskRecord, height)),
            ("wrap_u", offset_of!(MaskRecord, wrap_u)),
            ("wrap_v", offset_of!(MaskRecord, wrap_v)),
            ("nearest", offset_of!(MaskRecord, nearest)),
            ("cutoff", offset_of!(MaskRecord, cutoff)),
        ];
        assert_same_layout(SHADER, "Mask", size_of::<MaskRecord>(), &mask);
    }
}
