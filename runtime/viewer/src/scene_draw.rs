//! Draws surfaces, objects and sky into an [`OffscreenTarget`].

use crate::draw_error::DrawError;
use crate::geometry::{self, Geometry};
use crate::object_light::ObjectLight;
use crate::objects::{MovingObject, ObjectGeometry, ObjectRecord};
use crate::options::{DrawOptions, Specular, View};
use crate::other_light::{OtherLight, OtherMaps};
use crate::overlays::{OverlayView, Overlays};
use crate::receiver_maps::{self, ReceiverMap};
use crate::sky::SkyRecord;
use crate::target::{COLOR, DEPTH, OffscreenTarget, SAMPLES};
use crate::textures;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, camera::rh::proj::directx::perspective_infinite_reverse};
use localprt_runtime::{DIRECT_LIGHT_WGSL, HOST_WGSL, Relighter};
use localprt_scenes::{AlphaMode, Material, MaterialOverride, Scene, Sky};
use wgpu::{BindGroupEntry, BindingResource, ShaderStages};

/// `Frame` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct FrameRecord {
    world_to_clip: [[f32; 4]; 4],
    eye: [f32; 3],
    flags: u32,
    right: [f32; 3],
    sky_kind: u32,
    up: [f32; 3],
    sky_turns: f32,
    forward: [f32; 3],
    f0: f32,
    zenith: [f32; 3],
    roughness: f32,
    horizon: [f32; 4],
    ground: [f32; 3],
    view: u32,
    split_px: f32,
    pad: [u32; 3],
}

const FLAG_NORMAL_MAPS: u32 = 1;
const FLAG_SPECULAR: u32 = 2;
const FLAG_RADIANCE: u32 = 4;
const FLAG_CULL: u32 = 8;

/// `Material` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct MaterialRecord {
    base_color: [f32; 4],
    emission: [f32; 3],
    cutoff: f32,
    albedo: [f32; 4],
    own_emission: [f32; 4],
    normal_scale: f32,
    roughness: f32,
    has_normal_map: u32,
    is_double_sided: u32,
}

impl MaterialRecord {
    fn new(material: &Material, own: MaterialOverride, albedo_override: Option<f32>) -> Self {
        let replacing = |color: Option<Vec3>| color.map_or([0.0; 4], |color| color.extend(1.0).to_array());
        Self {
            base_color: material.base_color.to_array(),
            emission: material.emission.to_array(),
            cutoff: match material.alpha {
                AlphaMode::Opaque => -1.0,
                AlphaMode::Mask { cutoff } => cutoff,
                AlphaMode::Blend => 0.5,
            },
            albedo: replacing(albedo_override.map(Vec3::splat).or(own.albedo)),
            own_emission: replacing(own.emission),
            normal_scale: material.normal_scale,
            roughness: material.roughness,
            has_normal_map: u32::from(material.normal_texture.is_some()),
            is_double_sided: u32::from(material.double_sided),
        }
    }
}

/// A scene on the GPU, ready to be drawn again and again.
pub struct SceneDraw {
    options: DrawOptions,
    geometry: Geometry,
    materials: Vec<Material>,
    material_groups: Vec<wgpu::BindGroup>,
    material_buffer: wgpu::Buffer,
    object_geometry: ObjectGeometry,
    objects: Vec<MovingObject>,
    object_buffer: wgpu::Buffer,
    object_light: ObjectLight,
    sky: SkyRecord,
    frame_buffer: wgpu::Buffer,
    frame_layout: wgpu::BindGroupLayout,
    frame_group: wgpu::BindGroup,
    maps: Maps,
    /// Fronts, then backs: where two surfaces share a place, the one that is seen wins.
    surface_pipelines: [wgpu::RenderPipeline; 2],
    object_pipeline: wgpu::RenderPipeline,
    sky_pipeline: wgpu::RenderPipeline,
}

/// The relighter's maps, and that of the receivers.
struct Maps {
    irradiance: wgpu::TextureView,
    /// One texel if the relighter has none.
    radiance: wgpu::TextureView,
    has_radiance: bool,
    sampler: wgpu::Sampler,
    /// Of the map views.
    receivers: wgpu::TextureView,
    /// Of another system.
    other: OtherMaps,
}

impl SceneDraw {
    /// Uploads a scene, which must carry the lightmap coordinates of the relighter's file. Materials are the scene's own
    /// and the sky is black until set.
    ///
    /// # Errors
    /// [`DrawError::NoScene`] unless the relighter has been given the scene.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        scene: &Scene,
        relighter: &Relighter,
        options: DrawOptions,
    ) -> Result<Self, DrawError> {
        let light_layout = relighter.direct_pass().ok_or(DrawError::NoScene)?.light_layout();
        let frame_layout = frame_layout(device);
        let material_layout = textures::material_layout(device);
        let maps = Maps::new(device, queue, relighter);
        let sky = SkyRecord::new(device, queue, &Sky::Black);
        let buffer = |label, size: usize, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let (storage, uniform) = (wgpu::BufferUsages::STORAGE, wgpu::BufferUsages::UNIFORM);
        let n_materials = scene.materials.len().max(1);
        let material_buffer = buffer("viewer.materials", n_materials * size_of::<MaterialRecord>(), storage);
        let object_buffer = buffer("viewer.objects", size_of::<ObjectRecord>(), storage);
        let frame_buffer = buffer("viewer.frame", size_of::<FrameRecord>(), uniform);
        let frame_group =
            frame_group(device, &frame_layout, [&frame_buffer, &material_buffer, &object_buffer], &maps, &sky.view);
        let object_light = ObjectLight::new(device, relighter);
        let pipeline = pipelines(device, [light_layout, &frame_layout, &material_layout, &object_light.layout]);
        let [fronts, backs, object_pipeline, sky_pipeline] = pipeline;
        let draw = Self {
            options,
            geometry: Geometry::new(device, scene),
            material_groups: textures::material_groups(device, queue, &material_layout, scene),
            materials: scene.materials.clone(),
            material_buffer,
            object_geometry: ObjectGeometry::new(device),
            objects: Vec::new(),
            object_buffer,
            object_light,
            sky,
            frame_buffer,
            frame_layout,
            frame_group,
            maps,
            surface_pipelines: [fronts, backs],
            object_pipeline,
            sky_pipeline,
        };
        draw.set_materials(queue, &[], None);
        Ok(draw)
    }

    /// Changes what is shown.
    pub fn set_options(&mut self, options: DrawOptions) {
        self.options = options;
    }

    /// The same overrides as the relighter has.
    pub fn set_materials(&self, queue: &wgpu::Queue, overrides: &[MaterialOverride], albedo_override: Option<f32>) {
        let own = |index: usize| overrides.get(index).copied().unwrap_or_default();
        let records: Vec<MaterialRecord> = self
            .materials
            .iter()
            .enumerate()
            .map(|(index, material)| MaterialRecord::new(material, own(index), albedo_override))
            .collect();
        queue.write_buffer(&self.material_buffer, 0, bytemuck::cast_slice(&records));
    }

    /// The sky behind the scene.
    pub fn set_sky(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, sky: &Sky) {
        self.sky = SkyRecord::new(device, queue, sky);
        self.bind_frame(device);
    }

    /// What surfaces show in the map views; nothing until set. Its size is that of the relighter's file.
    pub fn set_receiver_map(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, map: &ReceiverMap) {
        self.maps.receivers = receiver_maps::upload(device, queue, map.size, &map.rgba);
        self.bind_frame(device);
    }

    /// Light of another system for the pixels right of [`DrawOptions::split`]; black until set.
    pub fn set_other(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, light: &OtherLight) {
        self.maps.other = OtherMaps::new(device, queue, light);
        self.bind_frame(device);
    }

    /// Objects that are drawn with the scene, in the indirect light of the file's volume, or else of the probes around
    /// them. They cast shadows if the relighter has their
    /// [`moving_casters`](crate::moving_casters).
    pub fn set_objects(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, objects: &[MovingObject]) {
        let records: Vec<ObjectRecord> = objects.iter().map(ObjectRecord::from).collect();
        let size = size_of_val(records.as_slice()) as u64;
        if size > self.object_buffer.size() {
            self.object_buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("viewer.objects"),
                size,
                usage: self.object_buffer.usage(),
                mapped_at_creation: false,
            });
            self.bind_frame(device);
        }
        queue.write_buffer(&self.object_buffer, 0, bytemuck::cast_slice(&records));
        self.objects = objects.to_vec();
    }

    fn bind_frame(&mut self, device: &wgpu::Device) {
        let buffers = [&self.frame_buffer, &self.material_buffer, &self.object_buffer];
        self.frame_group = frame_group(device, &self.frame_layout, buffers, &self.maps, &self.sky.view);
    }

    /// Records one picture into the target's radiance, with the lights and maps that the relighter has last encoded, and
    /// overlays over it.
    ///
    /// # Errors
    /// [`DrawError::NoScene`], [`DrawError::TooManyLights`].
    pub fn encode(
        &self,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        relighter: &Relighter,
        view: &View,
        target: &OffscreenTarget,
        overlays: Option<&Overlays>,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) -> Result<(), DrawError> {
        let direct_pass = relighter.direct_pass().ok_or(DrawError::NoScene)?;
        let lights = direct_pass.light_group().ok_or(DrawError::TooManyLights)?;
        let frame = self.frame(view, target);
        queue.write_buffer(&self.frame_buffer, 0, bytemuck::bytes_of(&frame));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("viewer.scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.samples,
                depth_slice: None,
                resolve_target: Some(&target.radiance_view),
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Discard },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_bind_group(0, lights, &[0]);
        pass.set_bind_group(1, &self.frame_group, &[]);
        pass.set_vertex_buffer(0, self.geometry.vertices.slice(..));
        pass.set_index_buffer(self.geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
        for (index, pipeline) in self.surface_pipelines.iter().enumerate() {
            pass.set_pipeline(pipeline);
            for (indices, material) in &self.geometry.draws {
                let is_back = index == 1;
                if is_back && self.options.cull_backs && !self.materials[*material].double_sided {
                    continue;
                }
                pass.set_bind_group(2, &self.material_groups[*material], &[]);
                pass.draw_indexed(indices.clone(), 0, *material as u32..*material as u32 + 1);
            }
        }
        pass.set_pipeline(&self.object_pipeline);
        pass.set_bind_group(2, &self.object_light.group, &[]);
        pass.set_vertex_buffer(0, self.object_geometry.vertices.slice(..));
        pass.set_index_buffer(self.object_geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
        for (index, object) in self.objects.iter().enumerate() {
            let (indices, base_vertex) = self.object_geometry.range(object.shape);
            pass.draw_indexed(indices, base_vertex, index as u32..index as u32 + 1);
        }
        pass.set_pipeline(&self.sky_pipeline);
        pass.draw(0..3, 0..1);
        if let Some(overlays) = overlays {
            let picture = target.radiance_view.texture();
            let size_px = [picture.width() as f32, picture.height() as f32];
            let view = OverlayView { world_to_clip: frame.world_to_clip, eye: frame.eye, size_px };
            overlays.encode(queue, &mut pass, &view);
        }
        Ok(())
    }

    fn frame(&self, view: &View, target: &OffscreenTarget) -> FrameRecord {
        let aspect = target.aspect();
        let projection = perspective_infinite_reverse(view.fov_y, aspect, view.near_m.max(f32::MIN_POSITIVE));
        let half_height = (0.5 * view.fov_y).tan();
        let axis = |column: usize| view.to_world.col(column).truncate();
        let is_specular = self.options.specular.is_some();
        let specular = self.options.specular.unwrap_or(Specular { f0: 0.0, roughness: None });
        let flags = [
            (self.options.normal_maps, FLAG_NORMAL_MAPS),
            (is_specular, FLAG_SPECULAR),
            (self.maps.has_radiance, FLAG_RADIANCE),
            (self.options.cull_backs, FLAG_CULL),
        ];
        let [zenith, horizon, ground] = self.sky.colors;
        FrameRecord {
            world_to_clip: (projection * view.to_world.inverse()).to_cols_array_2d(),
            eye: axis(3).to_array(),
            flags: flags.iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum(),
            right: (axis(0) * half_height * aspect).to_array(),
            sky_kind: self.sky.kind,
            up: (axis(1) * half_height).to_array(),
            sky_turns: self.sky.turns,
            forward: (-axis(2)).to_array(),
            f0: specular.f0,
            zenith: zenith.to_array(),
            roughness: specular.roughness.unwrap_or(-1.0),
            horizon: horizon.extend(0.0).to_array(),
            ground: ground.to_array(),
            view: self.options.view.code(),
            split_px: self.options.split.map_or(f32::MAX, |split| target.split_px(split)),
            pad: [0; 3],
        }
    }
}

impl Maps {
    fn new(device: &wgpu::Device, queue: &wgpu::Queue, relighter: &Relighter) -> Self {
        let radiance = relighter.radiance_view().cloned();
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("viewer.maps"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self {
            irradiance: relighter.irradiance_view().clone(),
            has_radiance: radiance.is_some(),
            radiance: radiance.unwrap_or_else(|| no_radiance(device)),
            sampler,
            receivers: receiver_maps::upload(device, queue, 1, &[0; 4]),
            other: OtherMaps::nothing(device, queue),
        }
    }
}

fn no_radiance(device: &wgpu::Device) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.no_radiance"),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 4 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

fn frame_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = |filterable, view_dimension| wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension,
        multisampled: false,
    };
    let storage = buffer(wgpu::BufferBindingType::Storage { read_only: true });
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("viewer.frame"),
        entries: &[
            entry(0, ShaderStages::VERTEX_FRAGMENT, buffer(wgpu::BufferBindingType::Uniform)),
            entry(1, ShaderStages::FRAGMENT, texture(true, wgpu::TextureViewDimension::D2)),
            entry(2, ShaderStages::FRAGMENT, texture(true, wgpu::TextureViewDimension::D2Array)),
            entry(3, ShaderStages::FRAGMENT, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            entry(4, ShaderStages::FRAGMENT, storage),
            entry(5, ShaderStages::VERTEX_FRAGMENT, storage),
            entry(6, ShaderStages::FRAGMENT, texture(false, wgpu::TextureViewDimension::D2)),
            entry(7, ShaderStages::FRAGMENT, texture(false, wgpu::TextureViewDimension::D2)),
            entry(8, ShaderStages::FRAGMENT, texture(true, wgpu::TextureViewDimension::D2)),
            entry(9, ShaderStages::FRAGMENT, storage),
        ],
    })
}

/// `buffers`: frame, materials, objects.
fn frame_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    buffers: [&wgpu::Buffer; 3],
    maps: &Maps,
    sky: &wgpu::TextureView,
) -> wgpu::BindGroup {
    let [frame, materials, objects] = buffers;
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("viewer.frame"),
        layout,
        entries: &[
            BindGroupEntry { binding: 0, resource: frame.as_entire_binding() },
            BindGroupEntry { binding: 1, resource: BindingResource::TextureView(&maps.irradiance) },
            BindGroupEntry { binding: 2, resource: BindingResource::TextureView(&maps.radiance) },
            BindGroupEntry { binding: 3, resource: BindingResource::Sampler(&maps.sampler) },
            BindGroupEntry { binding: 4, resource: materials.as_entire_binding() },
            BindGroupEntry { binding: 5, resource: objects.as_entire_binding() },
            BindGroupEntry { binding: 6, resource: BindingResource::TextureView(sky) },
            BindGroupEntry { binding: 7, resource: BindingResource::TextureView(&maps.receivers) },
            BindGroupEntry { binding: 8, resource: BindingResource::TextureView(&maps.other.map) },
            BindGroupEntry { binding: 9, resource: maps.other.probes.as_entire_binding() },
        ],
    })
}

/// The whole shader.
fn source() -> String {
    let own = [include_str!("scene_draw.wgsl"), include_str!("objects.wgsl"), include_str!("other_light.wgsl")];
    [&[DIRECT_LIGHT_WGSL, HOST_WGSL], &own[..]].concat().join("\n")
}

/// Twins of opposite winding have the same corners in another order, and their depths differ by roundings: some dozens of
/// f32 steps, and a share of the slope where surfaces are seen edge on.
const BEHIND_FRONTS: wgpu::DepthBiasState = wgpu::DepthBiasState { constant: -64, slope_scale: -0.05, clamp: 0.0 };

/// Of surfaces, objects and sky. `layouts`: lights, frame, material, light of objects.
fn pipelines(device: &wgpu::Device, layouts: [&wgpu::BindGroupLayout; 4]) -> [wgpu::RenderPipeline; 4] {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("viewer.scene"),
        source: wgpu::ShaderSource::Wgsl(source().into()),
    });
    let pipeline = |name: &str, groups: &[&wgpu::BindGroupLayout], buffers: &[_], cull_mode: Option<wgpu::Face>| {
        let is_sky = name == "sky";
        let is_back = cull_mode == Some(wgpu::Face::Front);
        let label = format!("viewer.{name}");
        let groups: Vec<_> = groups.iter().map(|layout| Some(*layout)).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&label),
            bind_group_layouts: &groups,
            ..Default::default()
        });
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(&label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(&format!("{name}_vertex")),
                compilation_options: Default::default(),
                buffers,
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(&format!("{name}_fragment")),
                compilation_options: Default::default(),
                targets: &[Some(COLOR.into())],
            }),
            primitive: wgpu::PrimitiveState { cull_mode, ..Default::default() },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(!is_sky),
                // Depth 1 is at the near plane, 0 infinitely far.
                depth_compare: Some(if is_sky {
                    wgpu::CompareFunction::GreaterEqual
                } else {
                    wgpu::CompareFunction::Greater
                }),
                stencil: Default::default(),
                bias: if is_back { BEHIND_FRONTS } else { wgpu::DepthBiasState::default() },
            }),
            multisample: wgpu::MultisampleState { count: SAMPLES, ..Default::default() },
            multiview_mask: None,
            cache: None,
        })
    };
    let vertex = |attributes, array_stride| {
        Some(wgpu::VertexBufferLayout { array_stride, step_mode: wgpu::VertexStepMode::Vertex, attributes })
    };
    let [lights, frame, material, object_light] = layouts;
    let object_attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
    let surface = |culled| {
        let vertices = [vertex(&geometry::ATTRIBUTES, geometry::STRIDE)];
        pipeline("surface", &[lights, frame, material], &vertices, Some(culled))
    };
    [
        surface(wgpu::Face::Back),
        surface(wgpu::Face::Front),
        pipeline("object", &[lights, frame, object_light], &[vertex(&object_attributes, 24)], None),
        pipeline("sky", &[lights, frame], &[], None),
    ]
}

#[cfg(test)]
mod tests;
