//! What a device can move at best: the yardstick of the passes.

use super::{Groups, Kernel, Timestamps, page_bytes, zeros};
use crate::error::RelightError;

const RUNS: usize = 11;

/// Copies a vec4f per invocation.
const SOURCE: &str = "
@group(0) @binding(0) var<storage, read> source: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> copied: array<vec4f>;
@compute @workgroup_size(256)
fn copy(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let at = (group.x + group.y * groups.x) * 256u + local;
    if (at < arrayLength(&source)) {
        copied[at] = source[at];
    }
}
";

/// GB/s of a plain copy between two buffers of `bytes` (or as many as a binding may have), read and written; median of
/// several. `None` on devices without timestamps.
///
/// # Errors
/// [`RelightError::Device`] if the device is lost.
pub fn copy_bandwidth(device: &wgpu::Device, queue: &wgpu::Queue, bytes: u64) -> Result<Option<f64>, RelightError> {
    let bytes = bytes.min(page_bytes(device)).next_multiple_of(16);
    let Some(mut timestamps) = Timestamps::new(device, queue) else { return Ok(None) };
    let kernel = Kernel::new(device, "copy", SOURCE, &[]);
    let buffers = [zeros(device, "copy.source", bytes), zeros(device, "copy.target", bytes)];
    let bindings = kernel.bind(device, &[buffers[0].as_entire_binding(), buffers[1].as_entire_binding()]);
    let mut milliseconds = Vec::new();
    for _ in 0..RUNS {
        let mut encoder = device.create_command_encoder(&Default::default());
        timestamps.begin_frame();
        let span = timestamps.reserve("copy");
        let timestamp_writes = span.map(|(begin, end)| wgpu::ComputePassTimestampWrites {
            query_set: timestamps.queries(),
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        });
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("localprt.copy"), timestamp_writes });
        kernel.dispatch(&mut pass, &bindings, Groups::new(device, bytes.div_ceil(16 * 256)));
        drop(pass);
        timestamps.end_frame(&mut encoder);
        queue.submit([encoder.finish()]);
        let mut times = timestamps.take();
        if times.is_none() {
            let lost = |error: wgpu::PollError| RelightError::Device { reason: error.to_string() };
            device.poll(wgpu::PollType::wait_indefinitely()).map_err(lost)?;
            times = timestamps.take();
        }
        milliseconds.extend(times.iter().flatten().map(|time| time.milliseconds));
    }
    milliseconds.sort_by(f64::total_cmp);
    Ok(milliseconds.get(milliseconds.len() / 2).map(|milliseconds| 2.0 * bytes as f64 / milliseconds * 1e-6))
}
