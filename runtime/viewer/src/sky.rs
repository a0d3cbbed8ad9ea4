//! The sky as the shader reads it: three colors, or a texture.

use glam::Vec3;
use localprt_scenes::Sky;

/// `kind` and colors of the shader's `Frame`, and the picture of an equirect sky.
pub(crate) struct SkyRecord {
    pub(crate) kind: u32,
    /// Turns by which the picture is rotated.
    pub(crate) turns: f32,
    /// Zenith, horizon, ground.
    pub(crate) colors: [Vec3; 3],
    pub(crate) view: wgpu::TextureView,
}

const GRADIENT: u32 = 0;
const EQUIRECT: u32 = 1;

impl SkyRecord {
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue, sky: &Sky) -> Self {
        let gradient =
            |colors| Self { kind: GRADIENT, turns: 0.0, colors, view: texture(device, queue, 1, 1, &[0.0; 4]) };
        match sky {
            Sky::Black => gradient([Vec3::ZERO; 3]),
            Sky::Constant(radiance) => gradient([*radiance; 3]),
            Sky::Gradient { zenith, horizon, ground } => gradient([*zenith, *horizon, *ground]),
            Sky::Equirect { width, height, pixels, scale, rotation } => {
                let (width, height, pixels) = fitting(device, *width, *height, pixels);
                let texels: Vec<f32> =
                    pixels.iter().flat_map(|pixel| (*pixel * *scale).extend(1.0).to_array()).collect();
                let view = texture(device, queue, width, height, &texels);
                Self { kind: EQUIRECT, turns: rotation / 360.0, colors: [Vec3::ZERO; 3], view }
            }
        }
    }
}

/// Halved until the device can hold it.
fn fitting(device: &wgpu::Device, width: u32, height: u32, pixels: &[Vec3]) -> (u32, u32, Vec<Vec3>) {
    let (mut width, mut height, mut pixels) = (width, height, pixels.to_vec());
    while width.max(height) > device.limits().max_texture_dimension_2d {
        let at = |x: u32, y: u32| pixels[(y.min(height - 1) * width + x.min(width - 1)) as usize];
        let half = |x: u32, y: u32| {
            (at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) + at(2 * x + 1, 2 * y + 1)) / 4.0
        };
        let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
        pixels = (0..half_width * half_height).map(|index| half(index % half_width, index / half_width)).collect();
        (width, height) = (half_width, half_height);
    }
    (width, height, pixels)
}

fn texture(device: &wgpu::Device, queue: &wgpu::Queue, width: u32, height: u32, texels: &[f32]) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.sky"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        // Suns are brighter than f16 can say.
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * 16), rows_per_image: Some(height) },
        size,
    );
    texture.create_view(&Default::default())
}
