//! GPU time of every pass of a frame, where the device has timestamp queries.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Passes that one frame can time: enough for dozens of bounces; what comes after is not timed.
const MAX_SPANS: u32 = 256;

/// Time that a frame spent in passes of one name, all bounces together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the pass, such as `cluster_projection`.
    pub name: &'static str,
    /// Milliseconds between the first and the last command of the pass, summed over bounces.
    pub milliseconds: f64,
    /// How often it ran.
    pub runs: u32,
}

const IDLE: u8 = 0;
const RESOLVED: u8 = 1;
const MAPPING: u8 = 2;
const MAPPED: u8 = 3;

/// Times the passes of one frame; those of the next are not timed while the last ones are on their way.
pub struct Timestamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    /// Nanoseconds per tick.
    period: f32,
    spans: Vec<&'static str>,
    state: Arc<AtomicU8>,
}

impl Timestamps {
    /// `None` without `Features::TIMESTAMP_QUERY`.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |name, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(name),
                size: u64::from(MAX_SPANS) * 16,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("localprt.timestamps.queries"),
                ty: wgpu::QueryType::Timestamp,
                count: MAX_SPANS * 2,
            }),
            resolved: buffer(
                "localprt.timestamps.resolved",
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
            staging: buffer("localprt.timestamps.staging", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            period: queue.get_timestamp_period(),
            spans: Vec::new(),
            state: Arc::new(AtomicU8::new(IDLE)),
        })
    }

    /// Starts a frame. While times of an earlier frame are on their way, the new frame is not timed.
    pub fn begin_frame(&mut self) {
        if self.state.load(Ordering::Acquire) <= RESOLVED {
            self.state.store(IDLE, Ordering::Release);
            self.spans.clear();
        }
    }

    /// Begin and end query of the next pass; `None` if it is not timed.
    pub fn reserve(&mut self, name: &'static str) -> Option<(u32, u32)> {
        let index = self.spans.len() as u32;
        if self.state.load(Ordering::Acquire) != IDLE || index == MAX_SPANS {
            return None;
        }
        self.spans.push(name);
        Some((2 * index, 2 * index + 1))
    }

    /// The queries that [`Timestamps::reserve`] numbers.
    pub fn queries(&self) -> &wgpu::QuerySet {
        &self.queries
    }

    /// Ends a frame: records how its times get where they can be read.
    pub fn end_frame(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.state.load(Ordering::Acquire) != IDLE || self.spans.is_empty() {
            return;
        }
        let n_queries = 2 * self.spans.len() as u32;
        encoder.resolve_query_set(&self.queries, 0..n_queries, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, u64::from(n_queries) * 8);
        self.state.store(RESOLVED, Ordering::Release);
    }

    /// Times of the last timed frame once they have arrived; call again later if `None`.
    pub fn take(&mut self) -> Option<Vec<PassTime>> {
        match self.state.load(Ordering::Acquire) {
            RESOLVED => {
                self.state.store(MAPPING, Ordering::Release);
                let state = Arc::clone(&self.state);
                let n_bytes = self.spans.len() as u64 * 16;
                self.staging.map_async(wgpu::MapMode::Read, ..n_bytes, move |result| {
                    state.store(if result.is_ok() { MAPPED } else { IDLE }, Ordering::Release);
                });
                None
            }
            MAPPED => {
                let n_bytes = self.spans.len() as u64 * 16;
                let ticks: Vec<u64> = self
                    .staging
                    .get_mapped_range(..n_bytes)
                    .map(|bytes| bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect())
                    .unwrap_or_default();
                self.staging.unmap();
                self.state.store(IDLE, Ordering::Release);
                Some(self.sums(&ticks))
            }
            _ => None,
        }
    }

    fn sums(&self, ticks: &[u64]) -> Vec<PassTime> {
        let mut times: Vec<PassTime> = Vec::new();
        for (&name, span) in self.spans.iter().zip(ticks.as_chunks::<2>().0) {
            let milliseconds = span[1].saturating_sub(span[0]) as f64 * f64::from(self.period) * 1e-6;
            match times.iter_mut().find(|time| time.name == name) {
                Some(time) => {
                    time.milliseconds += milliseconds;
                    time.runs += 1;
                }
                None => times.push(PassTime { name, milliseconds, runs: 1 }),
            }
        }
        times
    }
}
