//! What is drawn over a finished scene: lines of a width in pixels, and probes as spheres of their radiance.

use crate::objects;
use crate::target::{COLOR, DEPTH, SAMPLES, WHITE};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use localprt_formats::{BakedView, Probe};
use localprt_runtime::Relighter;
use wgpu::ShaderStages;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// A line with a color of the display, whatever the exposure is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverlayLine {
    /// One end, world space, metres.
    pub from: Vec3,
    /// The other end.
    pub to: Vec3,
    /// Linear RGB of the display, 0..=1, and opacity.
    pub color: [f32; 4],
    /// Width in pixels.
    pub width_px: f32,
    /// Shines faintly through what is before it; else it is hidden there.
    pub on_top: bool,
}

/// How probes are shown.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeSpheres {
    /// Radius of the spheres, metres; [`default_probe_radius_m`] suits most files.
    pub radius_m: f32,
    /// Probes with a colored rim, and its strength, 0..=1.
    pub highlighted: Vec<(u32, f32)>,
}

/// Radius of probe spheres as a share of the median support radius: many fit into a support, and none hides a room.
const RADIUS_SHARE: f32 = 0.05;

/// A radius for [`ProbeSpheres`], metres: a share of the median support radius; 0 for a file without probes.
pub fn default_probe_radius_m(baked: &BakedView<'_>) -> f32 {
    let mut radii: Vec<f32> = baked.probes.iter().map(|probe| probe.support_radius_m).collect();
    radii.sort_by(f32::total_cmp);
    radii.get(radii.len() / 2).map_or(0.0, |median| RADIUS_SHARE * median)
}

/// `Overlay` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct OverlayRecord {
    world_to_clip: [[f32; 4]; 4],
    eye: [f32; 3],
    scale: f32,
    size_px: [f32; 2],
    white: f32,
    radius_m: f32,
    probe_degree: u32,
    pad: [u32; 3],
}

/// An instance of the shader's lines.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LineRecord {
    from: [f32; 3],
    width_px: f32,
    to: [f32; 3],
    color: [f32; 4],
}

const LINE_ATTRIBUTES: [wgpu::VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x3, 3 => Float32x4];

/// Segments around a probe's sphere.
const SEGMENTS: u32 = 32;

/// The eye that a picture is drawn for.
pub(crate) struct OverlayView {
    pub(crate) world_to_clip: [[f32; 4]; 4],
    pub(crate) eye: [f32; 3],
    pub(crate) size_px: [f32; 2],
}

/// Lines and probes, ready to be drawn over a scene: see [`SceneDraw::encode`](crate::SceneDraw::encode).
pub struct Overlays {
    record: OverlayRecord,
    uniform: wgpu::Buffer,
    group: wgpu::BindGroup,
    line_pipeline: wgpu::RenderPipeline,
    hidden_line_pipeline: wgpu::RenderPipeline,
    sphere_pipeline: wgpu::RenderPipeline,
    lines: wgpu::Buffer,
    n_lines: u32,
    /// Those of them, at the end, that shine through.
    n_on_top: u32,
    sphere_vertices: wgpu::Buffer,
    sphere_indices: wgpu::Buffer,
    probe_positions: Vec<[f32; 3]>,
    /// `[n_probes]` position and weight.
    probes: wgpu::Buffer,
    shows_probes: bool,
}

impl Overlays {
    /// No lines, and no probes until they are asked for. Exposure is 1.
    pub fn new(device: &wgpu::Device, relighter: &Relighter, baked: &BakedView<'_>) -> Self {
        Self::of_probes(device, baked.probes, baked.metadata.probe_degree, relighter.probe_radiance())
    }

    /// `radiance`: `[n_probes, n_sh]` of vec4f.
    fn of_probes(device: &wgpu::Device, probes: &[Probe], probe_degree: u32, radiance: &wgpu::Buffer) -> Self {
        let record = OverlayRecord { scale: 1.0, white: WHITE, probe_degree, ..OverlayRecord::zeroed() };
        let buffer = |label, size: usize, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size.max(16) as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let uniform = buffer("viewer.overlay", size_of::<OverlayRecord>(), wgpu::BufferUsages::UNIFORM);
        let layout = layout(device);
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("viewer.overlay"),
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: radiance.as_entire_binding() },
            ],
        });
        let [line_pipeline, hidden_line_pipeline, sphere_pipeline] = pipelines(device, &layout);
        let sphere = objects::sphere(SEGMENTS);
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let (vertex, index) = (wgpu::BufferUsages::VERTEX, wgpu::BufferUsages::INDEX);
        Self {
            record,
            uniform,
            group,
            line_pipeline,
            hidden_line_pipeline,
            sphere_pipeline,
            lines: buffer("viewer.overlay_lines", 256 * size_of::<LineRecord>(), vertex),
            n_lines: 0,
            n_on_top: 0,
            sphere_vertices: filled("viewer.probe_sphere", bytemuck::cast_slice(&sphere.positions), vertex),
            sphere_indices: filled("viewer.probe_sphere", bytemuck::cast_slice(&sphere.triangles), index),
            probe_positions: probes.iter().map(|probe| probe.position).collect(),
            probes: buffer("viewer.overlay_probes", 16 * probes.len(), vertex),
            shows_probes: false,
        }
    }

    /// What the picture is tone-mapped with: 2^EV, as for [`OffscreenTarget::tone_map`](crate::OffscreenTarget::tone_map).
    pub fn set_exposure(&mut self, scale: f32) {
        self.record.scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };
    }

    /// Whether the picture goes through the tone curve, as it does until set; else its values are shown as they are, times
    /// the exposure.
    pub fn set_tone_curve(&mut self, has_curve: bool) {
        self.record.white = if has_curve { WHITE } else { 0.0 };
    }

    /// All lines from now on. Those with ends that are not finite are left out.
    pub fn set_lines(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, lines: &[OverlayLine]) {
        let (records, n_on_top) = line_records(lines);
        let bytes: &[u8] = bytemuck::cast_slice(&records);
        if bytes.len() as u64 > self.lines.size() {
            self.lines = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("viewer.overlay_lines"),
                size: (bytes.len() as u64).next_power_of_two(),
                usage: self.lines.usage(),
                mapped_at_creation: false,
            });
        }
        queue.write_buffer(&self.lines, 0, bytes);
        (self.n_lines, self.n_on_top) = (records.len() as u32, n_on_top);
    }

    /// How probes are shown, if at all. Unknown probes are left out.
    pub fn set_probes(&mut self, queue: &wgpu::Queue, spheres: Option<ProbeSpheres>) {
        self.shows_probes = spheres.is_some();
        let Some(spheres) = spheres else { return };
        self.record.radius_m = spheres.radius_m;
        let mut records: Vec<[f32; 4]> = self.probe_positions.iter().map(|&[x, y, z]| [x, y, z, -1.0]).collect();
        for (probe, weight) in spheres.highlighted {
            if let Some(record) = records.get_mut(probe as usize) {
                record[3] = weight.clamp(0.0, 1.0);
            }
        }
        queue.write_buffer(&self.probes, 0, bytemuck::cast_slice(&records));
    }

    /// Records into the pass that has drawn the scene.
    pub(crate) fn encode(&self, queue: &wgpu::Queue, pass: &mut wgpu::RenderPass<'_>, view: &OverlayView) {
        let OverlayView { world_to_clip, eye, size_px } = *view;
        let record = OverlayRecord { world_to_clip, eye, size_px, ..self.record };
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&record));
        pass.set_bind_group(0, &self.group, &[]);
        let n_probes = self.probe_positions.len() as u32;
        if self.shows_probes && n_probes > 0 {
            pass.set_pipeline(&self.sphere_pipeline);
            pass.set_vertex_buffer(0, self.sphere_vertices.slice(..));
            pass.set_vertex_buffer(1, self.probes.slice(..));
            pass.set_index_buffer(self.sphere_indices.slice(..), wgpu::IndexFormat::Uint32);
            let n_indices = (self.sphere_indices.size() / 4) as u32;
            pass.draw_indexed(0..n_indices, 0, 0..n_probes);
        }
        if self.n_lines > 0 {
            pass.set_vertex_buffer(0, self.lines.slice(..));
            pass.set_pipeline(&self.hidden_line_pipeline);
            pass.draw(0..4, self.n_lines - self.n_on_top..self.n_lines);
            pass.set_pipeline(&self.line_pipeline);
            pass.draw(0..4, 0..self.n_lines);
        }
    }
}

/// Lines that shine through come last; returns their number too.
fn line_records(lines: &[OverlayLine]) -> (Vec<LineRecord>, u32) {
    let drawn = |on_top: bool| {
        let is_finite = |line: &OverlayLine| line.from.is_finite() && line.to.is_finite();
        lines.iter().filter(move |line| line.on_top == on_top && is_finite(line)).map(|line| LineRecord {
            from: line.from.to_array(),
            width_px: line.width_px,
            to: line.to.to_array(),
            color: line.color,
        })
    };
    let mut records: Vec<LineRecord> = drawn(false).collect();
    let n_hidden = records.len();
    records.extend(drawn(true));
    let n_on_top = (records.len() - n_hidden) as u32;
    (records, n_on_top)
}

fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("viewer.overlay"),
        entries: &[
            entry(0, ShaderStages::VERTEX_FRAGMENT, wgpu::BufferBindingType::Uniform),
            entry(1, ShaderStages::FRAGMENT, wgpu::BufferBindingType::Storage { read_only: true }),
        ],
    })
}

/// Of lines, of lines behind something, of probe spheres.
fn pipelines(device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> [wgpu::RenderPipeline; 3] {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("viewer.overlay"),
        source: wgpu::ShaderSource::Wgsl(include_str!("overlays.wgsl").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("viewer.overlay"),
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    });
    let pipeline = |[vertex, fragment]: [&str; 2], buffers: &[_], depth_compare, is_solid: bool| {
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(&format!("viewer.{fragment}")),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers,
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(fragment),
                compilation_options: Default::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    blend: (!is_solid).then_some(wgpu::BlendState::ALPHA_BLENDING),
                    ..COLOR.into()
                })],
            }),
            primitive: wgpu::PrimitiveState {
                topology: if is_solid {
                    wgpu::PrimitiveTopology::TriangleList
                } else {
                    wgpu::PrimitiveTopology::TriangleStrip
                },
                cull_mode: is_solid.then_some(wgpu::Face::Back),
                ..Default::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(is_solid),
                depth_compare: Some(depth_compare),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: wgpu::MultisampleState { count: SAMPLES, ..Default::default() },
            multiview_mask: None,
            cache: None,
        })
    };
    let buffer = |attributes, array_stride: usize, step_mode| {
        Some(wgpu::VertexBufferLayout { array_stride: array_stride as u64, step_mode, attributes })
    };
    let lines = [buffer(&LINE_ATTRIBUTES, size_of::<LineRecord>(), wgpu::VertexStepMode::Instance)];
    let normal = wgpu::vertex_attr_array![0 => Float32x3];
    let probe = wgpu::vertex_attr_array![1 => Float32x3, 2 => Float32];
    let spheres =
        [buffer(&normal, 12, wgpu::VertexStepMode::Vertex), buffer(&probe, 16, wgpu::VertexStepMode::Instance)];
    [
        // Depth 1 is at the near plane, 0 infinitely far.
        pipeline(["line_vertex", "line_fragment"], &lines, wgpu::CompareFunction::GreaterEqual, false),
        pipeline(["line_vertex", "hidden_line_fragment"], &lines, wgpu::CompareFunction::Less, false),
        pipeline(["sphere_vertex", "sphere_fragment"], &spheres, wgpu::CompareFunction::Greater, true),
    ]
}

#[cfg(test)]
mod tests;
