//! GPU side of the probe relight: rays in pages of whole probes, partial sums, probe radiance.

use crate::gpu::{Groups, Kernel, page_bytes, storage, uniform, zeros};
use crate::occluder::{MAX_OCCLUDERS, Occluder, OccluderShape};
use crate::passes::lightmap_mips::{LightMap, level_sizes};
use crate::shaders;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use localprt_formats::Checked;

const PROBES_PER_GROUP: usize = 4;
const RAYS_PER_SEGMENT: usize = 256;

pub(crate) struct ProbeRelightPass {
    kernel: Kernel,
    occluded_kernel: Kernel,
    sum_kernel: Kernel,
    pages: Vec<Page>,
    /// `[n_probes, n_sh]`, RGB0.
    pub(crate) probe_radiance: wgpu::Buffer,
    sky_rays: wgpu::Buffer,
    occluders: wgpu::Buffer,
    n_occluders: u32,
    has_sky: bool,
    memory: Vec<(&'static str, u64)>,
}

struct Page {
    params: wgpu::Buffer,
    values: Params,
    bindings: wgpu::BindGroup,
    occluded_bindings: wgpu::BindGroup,
    groups: Groups,
    sum_bindings: wgpu::BindGroup,
    sum_groups: Groups,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    n_probes: u32,
    n_rays: u32,
    n_segments: u32,
    direct_size: u32,
    n_levels: u32,
    has_sky: u32,
    n_occluders: u32,
    first_probe: u32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct OccluderRecord {
    a: Vec3,
    kind: u32,
    b: Vec3,
    bounding_radius: f32,
    size: Vec3,
    pad_0: u32,
    rotation: [f32; 4],
    radiance: Vec3,
    pad_1: u32,
}

impl OccluderRecord {
    fn new(occluder: &Occluder) -> Self {
        let (_, bounding_radius) = occluder.bounding_sphere();
        let base = Self { bounding_radius, radiance: occluder.radiance, ..Self::zeroed() };
        match occluder.shape {
            OccluderShape::Sphere { center, radius } => Self { a: center, kind: 0, size: Vec3::splat(radius), ..base },
            OccluderShape::Box { center, half_extents, rotation } => {
                Self { a: center, kind: 1, size: half_extents, rotation: rotation.inverse().to_array(), ..base }
            }
            OccluderShape::Capsule { a, b, radius } => Self { a, b, kind: 2, size: Vec3::splat(radius), ..base },
        }
    }
}

impl ProbeRelightPass {
    pub(crate) fn new(device: &wgpu::Device, baked: &Checked<'_>, light_map: &LightMap) -> Self {
        let view = baked.view();
        let (n_rays, n_sh, n_probes) = (baked.n_rays(), baked.n_sh(), baked.n_probes());
        let source = shaders::source(include_str!("probe_relight.wgsl"));
        let constants = |occluders: f64| [("N_SH", n_sh as f64), ("OCCLUDERS", occluders)];
        let kernel = Kernel::new(device, "probe_relight", &source, &constants(0.0));
        let occluded_kernel = Kernel::new(device, "probe_relight", &source, &constants(1.0));
        let sum_source = shaders::source(include_str!("sum_segments.wgsl"));
        let sum_kernel = Kernel::new(device, "sum_segments", &sum_source, &[("N_SH", n_sh as f64)]);

        let probe_radiance = zeros(device, "probe_relight.probe_radiance", (n_probes * n_sh * 16) as u64);
        let sky_rays = zeros(device, "probe_relight.sky_rays", n_rays as u64 * 16);
        let occluders =
            uniform(device, "probe_relight.occluders", &vec![0; MAX_OCCLUDERS * size_of::<OccluderRecord>()]);
        let ray_sh = storage(device, "probe_relight.ray_sh", bytemuck::cast_slice(view.ray_sh));
        let ray_dirs = storage(device, "probe_relight.ray_dirs", bytemuck::cast_slice(view.ray_dirs));
        let probes = storage(device, "probe_relight.probes", bytemuck::cast_slice(&seen_from_probes(baked)));

        let n_segments = n_rays.div_ceil(RAYS_PER_SEGMENT).max(1);
        // The widest arrays of a page are the partial sums and the ray positions. Whole groups of probes, so that every
        // page of ray levels starts with a whole word.
        let probe_bytes = (n_segments * n_sh * 16).max(n_rays * 4).max(1);
        let fitting = (page_bytes(device) as usize / probe_bytes).max(1);
        let per_page =
            if fitting >= PROBES_PER_GROUP { fitting / PROBES_PER_GROUP * PROBES_PER_GROUP } else { fitting };
        let mut memory = vec![
            ("probe radiance", probe_radiance.size()),
            ("relight SH table and directions", ray_sh.size() + ray_dirs.size() + sky_rays.size()),
        ];
        let (mut ray_bytes, mut partial_bytes) = (0, 0);
        let pages = (0..n_probes)
            .step_by(per_page)
            .map(|first| {
                let range = first * n_rays..n_probes.min(first + per_page) * n_rays;
                let n_page = n_probes.min(first + per_page) - first;
                let ray_uv = storage(device, "probe_relight.ray_uv", bytemuck::cast_slice(&view.ray_uv[range.clone()]));
                let ray_level = storage(device, "probe_relight.ray_level", &view.ray_level[range.clone()]);
                let distances = baked.view().ray_distance.get(range).unwrap_or_default();
                let ray_distance = storage(device, "probe_relight.ray_distance", bytemuck::cast_slice(distances));
                let partial = zeros(device, "probe_relight.partial_sums", (n_page * n_segments * n_sh * 16) as u64);
                ray_bytes += ray_uv.size() + ray_level.size() + ray_distance.size();
                partial_bytes += partial.size();
                let values = Params {
                    n_probes: n_page as u32,
                    n_rays: n_rays as u32,
                    n_segments: n_segments as u32,
                    direct_size: light_map.size,
                    n_levels: level_sizes(light_map.size).len() as u32,
                    has_sky: 0,
                    n_occluders: 0,
                    first_probe: first as u32,
                };
                let params = uniform(device, "probe_relight.params", bytemuck::bytes_of(&values));
                let resources = [
                    params.as_entire_binding(),
                    ray_sh.as_entire_binding(),
                    ray_uv.as_entire_binding(),
                    ray_level.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&light_map.view),
                    sky_rays.as_entire_binding(),
                    partial.as_entire_binding(),
                    occluders.as_entire_binding(),
                    probes.as_entire_binding(),
                    ray_dirs.as_entire_binding(),
                    ray_distance.as_entire_binding(),
                ];
                let sum_params = uniform(
                    device,
                    "sum_segments.params",
                    bytemuck::cast_slice(&[n_page as u32, n_segments as u32, first as u32, 0]),
                );
                let sums =
                    [sum_params.as_entire_binding(), partial.as_entire_binding(), probe_radiance.as_entire_binding()];
                Page {
                    bindings: kernel.bind(device, &resources),
                    occluded_bindings: occluded_kernel.bind(device, &resources),
                    groups: Groups::new(device, (n_page.div_ceil(PROBES_PER_GROUP) * n_segments) as u64),
                    sum_bindings: sum_kernel.bind(device, &sums),
                    sum_groups: Groups::new(device, (n_page * n_sh).div_ceil(64) as u64),
                    params,
                    values,
                }
            })
            .collect();
        memory.push(("relight rays", ray_bytes));
        memory.push(("relight partial sums", partial_bytes));
        Self {
            kernel,
            occluded_kernel,
            sum_kernel,
            pages,
            probe_radiance,
            sky_rays,
            occluders,
            n_occluders: 0,
            has_sky: false,
            memory,
        }
    }

    /// Radiance of the sky along the relight rays; empty is black.
    pub(crate) fn set_sky_rays(&mut self, queue: &wgpu::Queue, sky_rays: &[Vec3]) {
        let padded: Vec<[f32; 4]> = sky_rays.iter().map(|radiance| radiance.extend(0.0).to_array()).collect();
        queue.write_buffer(&self.sky_rays, 0, bytemuck::cast_slice(&padded));
        self.has_sky = !sky_rays.is_empty();
        self.write_params(queue);
    }

    pub(crate) fn set_occluders(&mut self, queue: &wgpu::Queue, occluders: &[Occluder]) {
        let records: Vec<_> = occluders.iter().map(OccluderRecord::new).collect();
        queue.write_buffer(&self.occluders, 0, bytemuck::cast_slice(&records));
        self.n_occluders = records.len() as u32;
        self.write_params(queue);
    }

    fn write_params(&self, queue: &wgpu::Queue) {
        for page in &self.pages {
            let values = Params { has_sky: self.has_sky.into(), n_occluders: self.n_occluders, ..page.values };
            queue.write_buffer(&page.params, 0, bytemuck::bytes_of(&values));
        }
    }

    pub(crate) fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for page in &self.pages {
            if self.n_occluders > 0 {
                self.occluded_kernel.dispatch(pass, &page.occluded_bindings, page.groups);
            } else {
                self.kernel.dispatch(pass, &page.bindings, page.groups);
            }
            self.sum_kernel.dispatch(pass, &page.sum_bindings, page.sum_groups);
        }
    }

    /// Bytes read and written per gather, but for the light map: rays, SH table, partial sums both ways, radiance.
    pub(crate) fn traffic(&self) -> u64 {
        let bytes = |name| self.memory.iter().find(|(found, _)| *found == name).map_or(0, |(_, bytes)| *bytes);
        bytes("relight SH table and directions")
            + bytes("relight rays")
            + 2 * bytes("relight partial sums")
            + self.probe_radiance.size()
    }

    pub(crate) fn memory(&self) -> &[(&'static str, u64)] {
        &self.memory
    }
}

/// `[n_probes]` position, and the distance of the farthest hit of its rays (infinite where a ray leaves the scene, or if
/// the file has no distances).
fn seen_from_probes(baked: &Checked<'_>) -> Vec<[f32; 4]> {
    let view = baked.view();
    let n_rays = baked.n_rays();
    let farthest = |probe: usize| match baked.view().ray_distance.get(probe * n_rays..(probe + 1) * n_rays) {
        Some(distances) => distances.iter().fold(0.0f32, |far, distance| far.max(distance.to_f32())).min(f32::MAX),
        None => f32::MAX,
    };
    view.probes
        .iter()
        .enumerate()
        .map(|(probe, &localprt_formats::Probe { position: [x, y, z], .. })| [x, y, z, farthest(probe)])
        .collect()
}
