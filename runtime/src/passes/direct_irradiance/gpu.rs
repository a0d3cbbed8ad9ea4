//! Direct irradiance on the GPU: draws the lights' shadow maps batch by batch and adds each batch up.

use crate::error::RelightError;
use crate::passes::shadow_map::{MIN_SHADOW_MAP_SIZE, ShadowCasters, gpu as shadow_gpu, shadow_views};
use crate::surface::SceneTexels;
use crate::texel_sample::TexelSample;
use bytemuck::{Pod, Zeroable};
use localprt_scenes::{Light, LightKind};
use shadow_gpu::{ShadowMapPass, ViewRecord, filled_buffer, storage_entry};
use std::ops::Range;
use wgpu::{BindGroupDescriptor, BindGroupEntry, BufferDescriptor, BufferUsages, ShaderStages};

/// What the lights of [`DirectPass::light_group`] send to a point, for the host's own fragment shaders.
///
/// Declares bind group 0, bound with the dynamic offset 0, and the functions of `direct_light.wgsl`: for every `index` from
/// `batch.first_light` on, `batch.n_lights` of them, `incident_light(index, position, geometric_normal)` gives the
/// direction to the light and the irradiance, shadows included, of a surface that faces it.
pub const DIRECT_LIGHT_WGSL: &str =
    concat!(include_str!("../shadow_map/shadow_view.wgsl"), include_str!("direct_light.wgsl"));

/// The whole shader.
pub(crate) const SHADER: &str = concat!(
    include_str!("../shadow_map/shadow_view.wgsl"),
    include_str!("direct_light.wgsl"),
    include_str!("direct_irradiance.wgsl")
);

/// Views of a point light: a batch must hold them.
const MOST_VIEWS: u32 = 6;
const WORKGROUP_SIZE: u32 = 64;
/// Position, two normals and the end of the samples.
const WORDS_PER_TEXEL: u64 = 10;
const TEXEL_BYTES: u64 = 4 * WORDS_PER_TEXEL;
const SAMPLE_BYTES: u64 = size_of::<TexelSample>() as u64;
const IRRADIANCE_BYTES: u64 = 16;

/// Sizes of the shadow maps; the depth texture takes `4 * shadow_map_size^2 * shadow_layers` bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectOptions {
    /// Texels per side of each map; brought into [`MIN_SHADOW_MAP_SIZE`] and the device's limit.
    pub shadow_map_size: u32,
    /// Maps drawn at once, at least six and at most the device's limit; more save passes where there are many lights.
    pub shadow_layers: u32,
}

impl Default for DirectOptions {
    fn default() -> Self {
        Self { shadow_map_size: 2048, shadow_layers: MOST_VIEWS }
    }
}

/// Where to write times: query set, and the indices of begin and end.
///
/// With several batches of lights, either span runs from the first batch's begin to the last one's end.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectTimestamps<'a> {
    /// Around all shadow maps.
    pub shadow_maps: Option<(&'a wgpu::QuerySet, u32, u32)>,
    /// Around all irradiance.
    pub irradiance: Option<(&'a wgpu::QuerySet, u32, u32)>,
}

/// Direct light of any number of punctual lights in the covered texels of the direct light map.
pub struct DirectPass {
    shadow: ShadowMapPass,
    pipeline: wgpu::ComputePipeline,
    batch_layout: wgpu::BindGroupLayout,
    page_layout: wgpu::BindGroupLayout,
    texels: TexelBuffers,
    batches: wgpu::Buffer,
    lights: wgpu::Buffer,
    batch_group: wgpu::BindGroup,
    /// Batches of the last encoding.
    n_batches: usize,
}

/// `Light` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LightRecord {
    position: [f32; 3],
    inverse_range: f32,
    direction: [f32; 3],
    cone_scale: f32,
    emitted: [f32; 3],
    cone_offset: f32,
    is_directional: u32,
    first_view: u32,
    n_views: u32,
    padding: u32,
}

/// `Batch` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BatchRecord {
    first_light: u32,
    n_lights: u32,
    first_view: u32,
    is_first: u32,
    rounding_m: f32,
}

/// Lights whose views fill the layers together.
#[derive(Clone, Debug, PartialEq, Eq)]
struct LightBatch {
    lights: Range<u32>,
    views: Range<u32>,
}

struct TexelBuffers {
    irradiance: wgpu::Buffer,
    n_texels: usize,
    n_samples: usize,
    /// Bind group and number of texels of each page.
    pages: Vec<(wgpu::BindGroup, u32)>,
}

impl DirectPass {
    /// A pass without a scene.
    pub fn new(device: &wgpu::Device, options: &DirectOptions) -> Self {
        let limits = device.limits();
        let size = options.shadow_map_size.clamp(MIN_SHADOW_MAP_SIZE, limits.max_texture_dimension_2d);
        let n_layers = options.shadow_layers.clamp(MOST_VIEWS, limits.max_texture_array_layers);
        let shadow = ShadowMapPass::new(device, size, n_layers);
        let batch_layout = batch_layout(device);
        let page_layout = page_layout(device);
        let pipeline = pipeline(device, &batch_layout, &page_layout);
        let batches = batch_buffer(device, 1);
        let lights = light_buffer(device, 1);
        let batch_group = batch_group(device, &batch_layout, &batches, &lights, &shadow);
        let texels =
            TexelBuffers { irradiance: irradiance_buffer(device, 0), n_texels: 0, n_samples: 0, pages: Vec::new() };
        Self { shadow, pipeline, batch_layout, page_layout, texels, batches, lights, batch_group, n_batches: 0 }
    }

    /// Uploads surfaces and casters; replaces those before, and the irradiance buffer.
    ///
    /// # Errors
    /// Those of [`SceneTexels::check`] and [`ShadowCasters::check`], and [`RelightError::Limit`]. The pass then
    /// keeps the scene that it had.
    pub fn set_scene(
        &mut self,
        device: &wgpu::Device,
        texels: &SceneTexels,
        casters: &ShadowCasters,
    ) -> Result<(), RelightError> {
        texels.check(texels.size)?;
        casters.check()?;
        let texels = TexelBuffers::new(device, &self.page_layout, texels)?;
        self.shadow.set_casters(device, casters)?;
        self.texels = texels;
        Ok(())
    }

    /// Casters that move, drawn with those of the scene; none until set.
    ///
    /// # Errors
    /// Those of [`ShadowCasters::check`], and [`RelightError::Limit`].
    pub fn set_moving_casters(&mut self, device: &wgpu::Device, casters: &ShadowCasters) -> Result<(), RelightError> {
        casters.check()?;
        self.shadow.set_moving_casters(device, casters)
    }

    /// Layout of [`DirectPass::light_group`], for pipelines that use [`DIRECT_LIGHT_WGSL`].
    pub fn light_layout(&self) -> &wgpu::BindGroupLayout {
        &self.batch_layout
    }

    /// Lights and shadow maps of the last encoding, for compute and fragment shaders, with the dynamic offset 0. `None` if
    /// the maps of all lights did not fit into the layers at once, so that only some are still there.
    pub fn light_group(&self) -> Option<&wgpu::BindGroup> {
        (self.n_batches <= 1).then_some(&self.batch_group)
    }

    /// Encodes shadow maps and irradiance of these lights.
    ///
    /// Writes the lights through the queue: submit the encoder before encoding the next lighting state.
    pub fn encode(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        lights: &[Light],
        timestamps: DirectTimestamps<'_>,
    ) {
        let (bounds, size) = (self.shadow.bounds(), self.shadow.size());
        let mut light_records = Vec::new();
        let mut view_records: Vec<ViewRecord> = Vec::new();
        for light in lights {
            let views = shadow_views(light, &bounds, size);
            if !views.is_empty() {
                light_records.push(LightRecord::new(light, view_records.len() as u32, views.len() as u32));
                view_records.extend(views.iter().map(ViewRecord::from));
            }
        }
        let n_views: Vec<u32> = light_records.iter().map(|light| light.n_views).collect();
        let batches = light_batches(&n_views, self.shadow.n_layers() as u32);
        self.n_batches = batches.len();
        if batches.is_empty() {
            // No lights for those who read the first batch.
            queue.write_buffer(&self.batches, 0, &[0; size_of::<BatchRecord>()]);
            encoder.clear_buffer(&self.texels.irradiance, 0, None);
            encode_empty_spans(encoder, timestamps);
            return;
        }
        self.write(device, queue, &light_records, &view_records, &batches, bounds.rounding_m());
        let stride = batch_stride(device);
        for (index, batch) in batches.iter().enumerate() {
            let (is_first, is_last) = (index == 0, index + 1 == batches.len());
            for (layer, view) in batch.views.clone().enumerate() {
                let begins = is_first && view == batch.views.start;
                let ends = is_last && view + 1 == batch.views.end;
                let writes = timestamps.shadow_maps.filter(|_| begins || ends);
                let writes = writes.map(|(query_set, begin, end)| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: begins.then_some(begin),
                    end_of_pass_write_index: ends.then_some(end),
                });
                self.shadow.draw(encoder, layer, view, writes);
            }
            let writes = timestamps.irradiance.filter(|_| is_first || is_last);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("localprt.direct_irradiance"),
                timestamp_writes: writes.map(|(query_set, begin, end)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: is_first.then_some(begin),
                    end_of_pass_write_index: is_last.then_some(end),
                }),
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.batch_group, &[index as u32 * stride as u32]);
            for (page, n_texels) in &self.texels.pages {
                let n_workgroups = n_texels.div_ceil(WORKGROUP_SIZE);
                let row = n_workgroups.min(device.limits().max_compute_workgroups_per_dimension);
                pass.set_bind_group(1, page, &[]);
                pass.dispatch_workgroups(row, n_workgroups.div_ceil(row), 1);
            }
        }
    }

    /// `[n_covered]` vec4f in the order of the texels: irradiance of the last encoding in W m^-2, and 0. Holds one unused
    /// element where no texel is covered.
    pub fn irradiance_buffer(&self) -> &wgpu::Buffer {
        &self.texels.irradiance
    }

    /// The maps of the last batch, `Depth32Float` with a layer per view: to look at, and for tests.
    pub fn shadow_maps(&self) -> &wgpu::Texture {
        self.shadow.texture()
    }

    /// Buffers and textures by purpose, bytes.
    pub(crate) fn memory(&self) -> [(&'static str, u64); 2] {
        let texels = self.texels.n_texels as u64 * (TEXEL_BYTES + IRRADIANCE_BYTES)
            + self.texels.n_samples as u64 * SAMPLE_BYTES;
        [("shadow casters and shadow maps", self.shadow.bytes()), ("texel geometry and direct irradiance", texels)]
    }

    fn write(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        lights: &[LightRecord],
        views: &[ViewRecord],
        batches: &[LightBatch],
        rounding_m: f32,
    ) {
        let stride = batch_stride(device);
        let mut bytes = vec![0; batches.len() * stride as usize];
        for (index, batch) in batches.iter().enumerate() {
            let record = BatchRecord {
                first_light: batch.lights.start,
                n_lights: batch.lights.len() as u32,
                first_view: batch.views.start,
                is_first: u32::from(index == 0),
                rounding_m,
            };
            bytes[index * stride as usize..][..size_of::<BatchRecord>()].copy_from_slice(bytemuck::bytes_of(&record));
        }
        let mut is_stale = self.shadow.write_views(device, queue, views);
        if bytes.len() as u64 > self.batches.size() {
            self.batches = batch_buffer(device, batches.len());
            is_stale = true;
        }
        if size_of_val(lights) as u64 > self.lights.size() {
            self.lights = light_buffer(device, lights.len());
            is_stale = true;
        }
        if is_stale {
            self.batch_group = batch_group(device, &self.batch_layout, &self.batches, &self.lights, &self.shadow);
        }
        queue.write_buffer(&self.batches, 0, &bytes);
        queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(lights));
    }
}

impl LightRecord {
    fn new(light: &Light, first_view: u32, n_views: u32) -> Self {
        let (cone_scale, cone_offset) = match light.kind {
            // As in Light::incident.
            LightKind::Spot { inner_cone, outer_cone } => {
                let scale = 1.0 / (inner_cone.cos() - outer_cone.cos()).max(0.001);
                (scale, -outer_cone.cos() * scale)
            }
            _ => (0.0, 1.0),
        };
        Self {
            position: light.position.to_array(),
            inverse_range: light.range.map_or(0.0, |range| 1.0 / range.max(f32::MIN_POSITIVE)),
            direction: light.direction.to_array(),
            cone_scale,
            emitted: (light.color * light.intensity).to_array(),
            cone_offset,
            is_directional: u32::from(light.kind == LightKind::Directional),
            first_view,
            n_views,
            padding: 0,
        }
    }
}

/// Groups lights, in order, so that the views of each group fit into the layers.
fn light_batches(n_views: &[u32], n_layers: u32) -> Vec<LightBatch> {
    let mut batches: Vec<LightBatch> = Vec::new();
    let mut view = 0;
    for (light, &n_views) in n_views.iter().enumerate() {
        let (light, views) = (light as u32, view..view + n_views);
        match batches.last_mut() {
            Some(batch) if views.end - batch.views.start <= n_layers => {
                batch.lights.end = light + 1;
                batch.views.end = views.end;
            }
            _ => batches.push(LightBatch { lights: light..light + 1, views }),
        }
        view += n_views;
    }
    batches
}

/// Writes begin and end of spans in which nothing happens.
fn encode_empty_spans(encoder: &mut wgpu::CommandEncoder, timestamps: DirectTimestamps<'_>) {
    for (query_set, begin, end) in [timestamps.shadow_maps, timestamps.irradiance].into_iter().flatten() {
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("localprt.direct_irradiance.no_lights"),
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(begin),
                end_of_pass_write_index: Some(end),
            }),
        });
    }
}

impl TexelBuffers {
    fn new(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, texels: &SceneTexels) -> Result<Self, RelightError> {
        let limits = device.limits();
        let (needed, allowed) = (texels.len() as u64 * IRRADIANCE_BYTES, limits.max_buffer_size);
        if needed > allowed {
            let what = "localprt.direct_irradiance.irradiance";
            return Err(RelightError::Limit { what, needed, allowed });
        }
        let irradiance = irradiance_buffer(device, texels.len());
        let largest = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let most_samples = (0..texels.len()).map(|texel| texels.samples_of(texel).len()).max().unwrap_or(0);
        let page_size = page_size(largest, limits.min_storage_buffer_offset_alignment, most_samples as u64);
        let mut pages = Vec::new();
        for first in (0..texels.len()).step_by(page_size) {
            let page = first..texels.len().min(first + page_size);
            let mut words = Vec::with_capacity(page.len() * WORDS_PER_TEXEL as usize);
            let mut samples = Vec::new();
            for texel in page.clone() {
                let vectors = [texels.position[texel], texels.normal[texel], texels.geometric_normal[texel]];
                words.extend(vectors.iter().flat_map(|vector| vector.to_array()).map(f32::to_bits));
                samples.extend_from_slice(texels.samples_of(texel));
                words.push(samples.len() as u32);
            }
            let filled = |label, contents| filled_buffer(device, label, contents, BufferUsages::STORAGE);
            let geometry = filled("localprt.direct_irradiance.texels", bytemuck::cast_slice(&words))?;
            let samples = filled("localprt.direct_irradiance.samples", bytemuck::cast_slice(&samples))?;
            let group = device.create_bind_group(&BindGroupDescriptor {
                label: Some("localprt.direct_irradiance.page"),
                layout,
                entries: &[
                    BindGroupEntry { binding: 0, resource: geometry.as_entire_binding() },
                    BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                            buffer: &irradiance,
                            offset: first as u64 * IRRADIANCE_BYTES,
                            size: wgpu::BufferSize::new(page.len() as u64 * IRRADIANCE_BYTES),
                        }),
                    },
                    BindGroupEntry { binding: 2, resource: samples.as_entire_binding() },
                ],
            });
            pages.push((group, page.len() as u32));
        }
        Ok(Self { irradiance, n_texels: texels.len(), n_samples: texels.samples.len(), pages })
    }
}

/// Texels whose geometry fits into a binding, and whose samples do, at most `most_samples` a texel; so many that the next
/// page's irradiance is aligned.
fn page_size(largest_binding: u64, alignment: u32, most_samples: u64) -> usize {
    let alignment = u64::from(alignment).div_ceil(IRRADIANCE_BYTES);
    let bytes = TEXEL_BYTES.max(SAMPLE_BYTES * most_samples);
    // Numbers of words are 32 bits in the shader.
    let fitting = (largest_binding / bytes).min(u64::from(u32::MAX) / WORDS_PER_TEXEL.max(most_samples));
    (fitting / alignment * alignment).max(alignment) as usize
}

fn irradiance_buffer(device: &wgpu::Device, n_texels: usize) -> wgpu::Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some("localprt.direct_irradiance.irradiance"),
        size: n_texels.max(1) as u64 * IRRADIANCE_BYTES,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

fn light_buffer(device: &wgpu::Device, n_lights: usize) -> wgpu::Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some("localprt.direct_irradiance.lights"),
        size: (n_lights * size_of::<LightRecord>()) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn batch_buffer(device: &wgpu::Device, n_batches: usize) -> wgpu::Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some("localprt.direct_irradiance.batches"),
        size: n_batches as u64 * batch_stride(device),
        usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Bytes from one batch to the next, so that each can be bound.
fn batch_stride(device: &wgpu::Device) -> u64 {
    let alignment = u64::from(device.limits().min_uniform_buffer_offset_alignment);
    (size_of::<BatchRecord>() as u64).next_multiple_of(alignment.max(16))
}

fn batch_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let visibility = ShaderStages::COMPUTE | ShaderStages::FRAGMENT;
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("localprt.direct_irradiance.batch"),
        entries: &[
            wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: true,
                    min_binding_size: wgpu::BufferSize::new(size_of::<BatchRecord>() as u64),
                },
                count: None,
            },
            storage_entry(1, visibility),
            storage_entry(2, visibility),
            wgpu::BindGroupLayoutEntry {
                binding: 3,
                visibility,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Depth,
                    view_dimension: wgpu::TextureViewDimension::D2Array,
                    multisampled: false,
                },
                count: None,
            },
        ],
    })
}

fn page_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let written = wgpu::BindGroupLayoutEntry {
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: false },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        ..storage_entry(1, ShaderStages::COMPUTE)
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("localprt.direct_irradiance.page"),
        entries: &[storage_entry(0, ShaderStages::COMPUTE), written, storage_entry(2, ShaderStages::COMPUTE)],
    })
}

fn pipeline(
    device: &wgpu::Device,
    batch_layout: &wgpu::BindGroupLayout,
    page_layout: &wgpu::BindGroupLayout,
) -> wgpu::ComputePipeline {
    let label = Some("localprt.direct_irradiance.pipeline");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("localprt.direct_irradiance.shader"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(batch_layout), Some(page_layout)],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&layout),
        module: &module,
        entry_point: Some("direct_irradiance"),
        compilation_options: Default::default(),
        cache: None,
    })
}

fn batch_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    batches: &wgpu::Buffer,
    lights: &wgpu::Buffer,
    shadow: &ShadowMapPass,
) -> wgpu::BindGroup {
    device.create_bind_group(&BindGroupDescriptor {
        label: Some("localprt.direct_irradiance.batch"),
        layout,
        entries: &[
            BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: batches,
                    offset: 0,
                    size: wgpu::BufferSize::new(size_of::<BatchRecord>() as u64),
                }),
            },
            BindGroupEntry { binding: 1, resource: lights.as_entire_binding() },
            BindGroupEntry { binding: 2, resource: shadow.views().as_entire_binding() },
            BindGroupEntry { binding: 3, resource: wgpu::BindingResource::TextureView(shadow.maps()) },
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::layout_test::assert_same_layout;
    use std::mem::offset_of;

    #[test]
    fn batches_hold_whole_lights_in_order() {
        let batch = |lights, views| LightBatch { lights, views };
        assert_eq!(light_batches(&[], 6), []);
        assert_eq!(light_batches(&[6, 1, 6], 6), [batch(0..1, 0..6), batch(1..2, 6..7), batch(2..3, 7..13)]);
        assert_eq!(light_batches(&[1, 1, 6, 1], 8), [batch(0..3, 0..8), batch(3..4, 8..9)]);
    }

    #[test]
    fn pages_fit_their_bindings_and_are_aligned() {
        for (largest, most_samples) in [(65536, 0), (1 << 20, 4), (128 << 20, 4), (128 << 20, 1), (u64::MAX, 16)] {
            let size = page_size(largest, 256, most_samples) as u64;
            assert!(size * TEXEL_BYTES <= largest && size * most_samples * SAMPLE_BYTES <= largest);
            assert!((size * IRRADIANCE_BYTES).is_multiple_of(256), "{largest}: {size}");
            // Numbers of words are 32 bits in the shader.
            assert!(size * WORDS_PER_TEXEL.max(most_samples) <= u64::from(u32::MAX));
        }
    }

    #[test]
    fn records_lie_as_the_shader_has_them() {
        let light = [
            ("position", offset_of!(LightRecord, position)),
            ("inverse_range", offset_of!(LightRecord, inverse_range)),
            ("direction", offset_of!(LightRecord, direction)),
            ("cone_scale", offset_of!(LightRecord, cone_scale)),
            ("emitted", offset_of!(LightRecord, emitted)),
            ("cone_offset", offset_of!(LightRecord, cone_offset)),
            ("is_directional", offset_of!(LightRecord, is_directional)),
            ("first_view", offset_of!(LightRecord, first_view)),
            ("n_views", offset_of!(LightRecord, n_views)),
        ];
        assert_same_layout(SHADER, "Light", size_of::<LightRecord>(), &light);
        let batch = [
            ("first_light", offset_of!(BatchRecord, first_light)),
            ("n_lights", offset_of!(BatchRecord, n_lights)),
            ("first_view", offset_of!(BatchRecord, first_view)),
            ("is_first", offset_of!(BatchRecord, is_first)),
            ("rounding_m", offset_of!(BatchRecord, rounding_m)),
        ];
        assert_same_layout(SHADER, "Batch", size_of::<BatchRecord>(), &batch);
    }
}
