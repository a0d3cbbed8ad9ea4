//! Buffers and textures back to the CPU, for tests and tools: waits for the GPU.

use crate::error::RelightError;

/// The bytes of a buffer that can be copied from. Blocks until the GPU has finished all work submitted so far.
///
/// # Errors
/// [`RelightError::Device`] if the device is lost.
pub fn buffer(device: &wgpu::Device, queue: &wgpu::Queue, source: &wgpu::Buffer) -> Result<Vec<u8>, RelightError> {
    let staging = staging(device, source.size());
    let mut encoder =
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("localprt.readback") });
    encoder.copy_buffer_to_buffer(source, 0, &staging, 0, source.size());
    queue.submit([encoder.finish()]);
    mapped(device, &staging)
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
    let bytes = mapped(device, &staging)?;
    Ok(bytes.chunks_exact(padded_row as usize).flat_map(|line| &line[..row as usize]).copied().collect())
}

fn staging(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("localprt.readback.staging"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn mapped(device: &wgpu::Device, staging: &wgpu::Buffer) -> Result<Vec<u8>, RelightError> {
    let lost = |reason: String| RelightError::Device { reason };
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| lost(error.to_string()))?;
    receiver.recv().map_err(|error| lost(error.to_string()))?.map_err(|error| lost(error.to_string()))?;
    Ok(staging.get_mapped_range(..).map_err(|error| lost(error.to_string()))?.to_vec())
}
