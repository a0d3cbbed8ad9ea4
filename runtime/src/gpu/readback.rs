//! Buffers and textures back to the CPU: at once by waiting for the GPU, or later as a [`Readback`].
//!
//! Browsers cannot wait; there a readback is awaited.

use crate::error::RelightError;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

/// The bytes of a buffer that can be copied from. Blocks until the GPU has finished all work submitted so far.
///
/// # Errors
/// [`RelightError::Device`] if the device is lost.
pub fn buffer(device: &wgpu::Device, queue: &wgpu::Queue, source: &wgpu::Buffer) -> Result<Vec<u8>, RelightError> {
    request_buffer(device, queue, source).wait(device)
}

/// Texels of one mip level and all layers of a texture, rows without padding. Blocks like [`buffer`].
///
/// # Errors
/// [`RelightError::Device`] if the device is lost.
pub fn texture(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    source: &wgpu::Texture,
    level: u32,
) -> Result<Vec<u8>, RelightError> {
    request_texture(device, queue, source, level).wait(device)
}

/// Asks for what [`buffer`] gives.
pub fn request_buffer(device: &wgpu::Device, queue: &wgpu::Queue, source: &wgpu::Buffer) -> Readback {
    let staging = staging(device, source.size());
    let mut encoder =
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("localprt.readback") });
    encoder.copy_buffer_to_buffer(source, 0, &staging, 0, source.size());
    queue.submit([encoder.finish()]);
    Readback::new(staging, None)
}

/// Asks for what [`texture`] gives.
pub fn request_texture(device: &wgpu::Device, queue: &wgpu::Queue, source: &wgpu::Texture, level: u32) -> Readback {
    let size = source.size().mip_level_size(level, source.dimension());
    let texel_bytes = source.format().block_copy_size(None).unwrap_or(16);
    let row = size.width * texel_bytes;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let n_rows = size.height * size.depth_or_array_layers;
    let staging = staging(device, u64::from(padded_row) * u64::from(n_rows));
    let mut encoder =
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("localprt.readback") });
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo { mip_level: level, ..source.as_image_copy() },
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_row),
                rows_per_image: Some(size.height),
            },
        },
        size,
    );
    queue.submit([encoder.finish()]);
    Readback::new(staging, Some(Rows { bytes: row as usize, padded: padded_row as usize }))
}

/// Bytes on their way from the GPU.
///
/// As a future it is ready once the device has been polled after the GPU has finished; browsers poll by themselves.
pub struct Readback {
    staging: wgpu::Buffer,
    rows: Option<Rows>,
    state: Arc<Mutex<State>>,
}

/// Rows of a texture in the staging buffer.
#[derive(Clone, Copy)]
struct Rows {
    bytes: usize,
    padded: usize,
}

#[derive(Default)]
struct State {
    mapped: Option<Result<(), wgpu::BufferAsyncError>>,
    waker: Option<Waker>,
}

impl Readback {
    fn new(staging: wgpu::Buffer, rows: Option<Rows>) -> Self {
        let state = Arc::<Mutex<State>>::default();
        let shared = Arc::clone(&state);
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            let mut state = shared.lock().unwrap_or_else(PoisonError::into_inner);
            state.mapped = Some(result);
            if let Some(waker) = state.waker.take() {
                waker.wake();
            }
        });
        Self { staging, rows, state }
    }

    /// Waits for the GPU.
    ///
    /// # Errors
    /// [`RelightError::Device`] if the device is lost, or cannot be waited for.
    pub fn wait(self, device: &wgpu::Device) -> Result<Vec<u8>, RelightError> {
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| lost(&error))?;
        self.take().unwrap_or_else(|| {
            Err(RelightError::Device { reason: "the GPU cannot be waited for here; await the readback".into() })
        })
    }

    /// The bytes if they are there.
    fn take(&self) -> Option<Result<Vec<u8>, RelightError>> {
        let mapped = self.state.lock().unwrap_or_else(PoisonError::into_inner).mapped.take()?;
        Some(mapped.map_err(|error| lost(&error)).and_then(|()| self.copied()))
    }

    fn copied(&self) -> Result<Vec<u8>, RelightError> {
        let bytes = self.staging.get_mapped_range(..).map_err(|error| lost(&error))?;
        Ok(match self.rows {
            None => bytes.to_vec(),
            Some(rows) => bytes.chunks_exact(rows.padded).flat_map(|line| &line[..rows.bytes]).copied().collect(),
        })
    }
}

impl Future for Readback {
    type Output = Result<Vec<u8>, RelightError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        // Before looking, so that nothing that comes between is missed.
        self.state.lock().unwrap_or_else(PoisonError::into_inner).waker = Some(context.waker().clone());
        self.take().map_or(Poll::Pending, Poll::Ready)
    }
}

fn lost(error: &dyn std::error::Error) -> RelightError {
    RelightError::Device { reason: error.to_string() }
}

fn staging(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("localprt.readback.staging"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    struct Count(AtomicU32);

    impl std::task::Wake for Count {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn a_readback_wakes_its_task_with_the_bytes() {
        let Some((device, queue)) = crate::test_gpu::device("a_readback_wakes_its_task_with_the_bytes") else { return };
        let source = crate::gpu::storage(&device, "readback.test", &[7; 20]);
        let mut readback = request_buffer(&device, &queue, &source);
        let count = Arc::new(Count(AtomicU32::new(0)));
        let waker = Waker::from(Arc::clone(&count));
        let mut poll = || Pin::new(&mut readback).poll(&mut Context::from_waker(&waker));
        assert!(poll().is_pending());
        device.poll(wgpu::PollType::wait_indefinitely()).expect("a device");
        assert_eq!(count.0.load(Ordering::Relaxed), 1);
        assert!(matches!(poll(), Poll::Ready(Ok(bytes)) if bytes == [7; 20]));
    }
}
