//! What a device can move at best: the yardstick of the passes.

use super::{Groups, Kernel, Timestamps, page_bytes, zeros};
use crate::error::RelightError;
use std::time::Instant;

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

/// How time is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Timestamp queries of the device.
    Timestamps,
    /// From submission to the end of all work, on the CPU.
    Wall,
}

/// GB/s of a plain copy between two buffers of `bytes` (or as many as a binding may have), read and written; median of
/// several.
///
/// # Errors
/// [`RelightError::Device`] if the device is lost, or has no timestamps and they are asked for.
pub fn copy_bandwidth(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    bytes: u64,
    clock: Clock,
) -> Result<f64, RelightError> {
    let lost = |reason: String| RelightError::Device { reason };
    let bytes = bytes.min(page_bytes(device)).next_multiple_of(16);
    let mut timestamps = Timestamps::new(device, queue);
    let kernel = Kernel::new(device, "copy", SOURCE, &[]);
    let buffers = [zeros(device, "copy.source", bytes), zeros(device, "copy.target", bytes)];
    let bindings = kernel.bind(device, &[buffers[0].as_entire_binding(), buffers[1].as_entire_binding()]);
    let mut milliseconds = Vec::new();
    for _ in 0..RUNS {
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut span = None;
        if let Some(timestamps) = &mut timestamps {
            timestamps.begin_frame();
            span = timestamps.reserve("copy");
        }
        let queries = timestamps.as_ref().map(Timestamps::queries);
        let timestamp_writes = queries.zip(span).map(|(query_set, (begin, end))| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        });
        let label = Some("localprt.copy");
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes });
        kernel.dispatch(&mut pass, &bindings, Groups::new(device, bytes.div_ceil(16 * 256)));
        drop(pass);
        if let Some(timestamps) = &mut timestamps {
            timestamps.end_frame(&mut encoder);
        }
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        let mut times = timestamps.as_mut().and_then(Timestamps::take);
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| lost(error.to_string()))?;
        let wall = start.elapsed().as_secs_f64() * 1e3;
        if times.is_none() {
            times = timestamps.as_mut().and_then(Timestamps::take);
        }
        milliseconds.push(match clock {
            Clock::Wall => wall,
            Clock::Timestamps => times
                .and_then(|times| times.first().map(|time| time.milliseconds))
                .ok_or_else(|| lost("it has no timestamp queries".into()))?,
        });
    }
    milliseconds.sort_by(f64::total_cmp);
    Ok(2.0 * bytes as f64 / milliseconds[RUNS / 2] * 1e-6)
}
