//! Brightness of the picture measured from the picture, without making the GPU wait.

use crate::target::OffscreenTarget;
use glam::Vec3;
use half::f16;
use localprt_tools::picture::Exposure;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Most pixels looked at; larger pictures are thinned out.
const MOST_PIXELS: usize = 1 << 17;

const IDLE: u8 = 0;
const COPIED: u8 = 1;
const MAPPING: u8 = 2;
const MAPPED: u8 = 3;

/// Reads a picture's radiance back when it is ready, and says which exposure suits it.
#[derive(Default)]
pub struct Meter {
    staging: Option<wgpu::Buffer>,
    /// Pixels per row, bytes per row.
    shape: (usize, usize),
    state: Arc<AtomicU8>,
}

impl Meter {
    /// Records a copy of the target's radiance; `false` while an earlier one is still on its way.
    pub fn encode(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        target: &OffscreenTarget,
    ) -> bool {
        if self.state.load(Ordering::Acquire) != IDLE {
            return false;
        }
        let texture = target.radiance_texture();
        let bytes_per_row = (8 * texture.width()).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("viewer.meter"),
            size: u64::from(bytes_per_row) * u64::from(texture.height()),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes_per_row),
            rows_per_image: Some(texture.height()),
        };
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
            texture.size(),
        );
        self.shape = (texture.width() as usize, bytes_per_row as usize);
        self.staging = Some(staging);
        self.state.store(COPIED, Ordering::Release);
        true
    }

    /// Whether none is on its way.
    pub fn is_idle(&self) -> bool {
        self.state.load(Ordering::Acquire) == IDLE
    }

    /// Call once per frame after submitting: the exposure value of a picture measured before, once it has arrived.
    pub fn take(&mut self) -> Option<f32> {
        let staging = self.staging.as_ref()?;
        match self.state.load(Ordering::Acquire) {
            COPIED => {
                self.state.store(MAPPING, Ordering::Release);
                let state = Arc::clone(&self.state);
                staging.map_async(wgpu::MapMode::Read, .., move |result| {
                    state.store(if result.is_ok() { MAPPED } else { IDLE }, Ordering::Release);
                });
                None
            }
            MAPPED => {
                let ev = staging.get_mapped_range(..).ok().map(|bytes| Exposure::Auto.ev(&self.pixels(&bytes)));
                self.staging = None;
                self.state.store(IDLE, Ordering::Release);
                ev
            }
            _ => None,
        }
    }

    fn pixels(&self, bytes: &[u8]) -> Vec<Vec3> {
        let (width, bytes_per_row) = self.shape;
        let n_pixels = bytes.len() / bytes_per_row.max(1) * width;
        // An odd step does not stay in the same columns of pictures of even width.
        let step = if n_pixels > MOST_PIXELS { n_pixels.div_ceil(MOST_PIXELS) | 1 } else { 1 };
        let band = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
        (0..n_pixels)
            .step_by(step)
            .map(|pixel| {
                let start = pixel / width * bytes_per_row + pixel % width * 8;
                let bytes = &bytes[start..start + 6];
                Vec3::new(band(bytes), band(&bytes[2..]), band(&bytes[4..]))
            })
            .collect()
    }
}
