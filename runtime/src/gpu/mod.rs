//! What every pass needs of wgpu: labeled buffers and pipelines, dispatches of any size, limits.

mod copy_bandwidth;
pub mod readback;
mod timestamps;

pub use copy_bandwidth::{Clock, copy_bandwidth};

pub use timestamps::{PassTime, Timestamps};

use crate::error::RelightError;
use wgpu::util::DeviceExt;

/// A device without a window, for tools and tests: the fastest adapter with all the limits that it offers, and with
/// timestamps where it has them.
///
/// # Errors
/// [`RelightError::Device`] if there is no adapter, or it gives no device.
pub async fn headless() -> Result<(wgpu::Device, wgpu::Queue), RelightError> {
    headless_with(|adapter| adapter.limits()).await
}

/// The same with chosen limits.
pub(crate) async fn headless_with(
    limits: impl FnOnce(&wgpu::Adapter) -> wgpu::Limits,
) -> Result<(wgpu::Device, wgpu::Queue), RelightError> {
    let failed = |reason: String| RelightError::Device { reason };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let wanted =
        wgpu::RequestAdapterOptions { power_preference: wgpu::PowerPreference::HighPerformance, ..Default::default() };
    let adapter = instance.request_adapter(&wanted).await.map_err(|error| failed(error.to_string()))?;
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("localprt.device"),
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        required_limits: limits(&adapter),
        ..Default::default()
    };
    adapter.request_device(&descriptor).await.map_err(|error| failed(error.to_string()))
}

/// A compute pipeline with the layout that its shader declares in group 0.
pub(crate) struct Kernel {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Kernel {
    /// Compiles the entry point `name` of a shader; `constants` set its overrides.
    pub(crate) fn new(device: &wgpu::Device, name: &'static str, source: &str, constants: &[(&str, f64)]) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&format!("localprt.{name}.shader")),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&format!("localprt.{name}.pipeline")),
            layout: None,
            module: &module,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        });
        let layout = pipeline.get_bind_group_layout(0);
        Self { name, pipeline, layout }
    }

    /// Resources for bindings 0, 1, 2, ...
    pub(crate) fn bind(&self, device: &wgpu::Device, resources: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .iter()
            .enumerate()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource: resource.clone() })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&format!("localprt.{}.bindings", self.name)),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// Records `n_groups` workgroups; the shader finds its number with `linear_group`.
    pub(crate) fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, bindings: &wgpu::BindGroup, groups: Groups) {
        if groups.x == 0 {
            return;
        }
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bindings, &[]);
        pass.dispatch_workgroups(groups.x, groups.y, groups.z);
    }
}

/// A number of workgroups as two dimensions within the device's limit; there may be a few more than asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Groups {
    x: u32,
    y: u32,
    z: u32,
}

impl Groups {
    /// As near to square rows as the limit asks for: no more than `y - 1` spare workgroups.
    pub(crate) fn new(device: &wgpu::Device, n_groups: u64) -> Self {
        Self::within(device.limits().max_compute_workgroups_per_dimension, n_groups)
    }

    fn within(limit: u32, n_groups: u64) -> Self {
        let y = n_groups.div_ceil(u64::from(limit)).max(1);
        Self { x: n_groups.div_ceil(y) as u32, y: y as u32, z: 1 }
    }

    /// Workgroups of 8 x 8 over a square.
    pub(crate) fn square(size: u32, group_size: u32) -> Self {
        Self { x: size.div_ceil(group_size), y: size.div_ceil(group_size), z: 1 }
    }

    /// As many workgroups once more for each layer.
    pub(crate) fn layers(self, z: u32) -> Self {
        Self { z, ..self }
    }
}

/// A read-only storage buffer with this content, at least 16 bytes long so that it can be bound.
pub(crate) fn storage(device: &wgpu::Device, name: &str, bytes: &[u8]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    let mut padded;
    let mut contents = bytes;
    if bytes.len() < 16 || !bytes.len().is_multiple_of(4) {
        padded = bytes.to_vec();
        padded.resize(bytes.len().next_multiple_of(4).max(16), 0);
        contents = &padded;
    }
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(&format!("localprt.{name}")),
        contents,
        usage,
    })
}

/// A storage buffer of zeros.
pub(crate) fn zeros(device: &wgpu::Device, name: &str, bytes: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(&format!("localprt.{name}")),
        size: bytes.next_multiple_of(4).max(16),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// A uniform buffer with this content.
pub(crate) fn uniform(device: &wgpu::Device, name: &str, bytes: &[u8]) -> wgpu::Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(&format!("localprt.{name}")),
        contents: bytes,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    })
}

/// Most bytes that one storage binding, and so one page of a paged array, may have: a multiple of 256.
pub(crate) fn page_bytes(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / 256 * 256
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_cover_what_is_asked_for_within_the_limit() {
        for (limit, n) in [(65535, 0), (65535, 1), (65535, 65535), (65535, 65536), (65535, 3_000_000), (7, 48), (7, 49)]
        {
            let Groups { x, y, .. } = Groups::within(limit, n);
            assert!(x <= limit && y <= limit.max(1), "{x} x {y}");
            let all = u64::from(x) * u64::from(y);
            assert!(all >= n && all < n + u64::from(y).max(1), "{x} x {y} for {n}");
        }
    }
}
