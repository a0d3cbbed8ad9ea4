//! Indirect light of another system, as the drawing passes take it: a map of the receivers, or probes that the shader itself reads.

use bytemuck::{Pod, Zeroable};
use half::f16;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Which system's light is shown beside the file's, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Its name.
    pub system: &'static str,
    /// Share of the picture's width, from the left, that stays the file's.
    pub split: f32,
}

/// Indirect light of one frame of another system.
#[derive(Clone, Debug, PartialEq)]
pub enum OtherLight {
    /// Irradiance in the texels of the receiver map, W m^-2: in the file's texels, which are what the file's own light has.
    Map {
        /// Texels per side.
        size: u32,
        /// `[size][size]` RGBA; alpha is 1 where there is light to show and 0 elsewhere.
        rgba: Vec<[f16; 4]>,
    },
    /// Probes, for every pixel.
    Probes {
        /// What they have in common.
        record: OtherRecord,
        /// Of octahedral probes `[n_probes]` positions, with 1 in w where a probe counts; `[n_probes][(side + 2)^2]` irradiance, then moments.
        /// Of harmonics low and spacing, `[n_grids][2]`; coefficients, `[n_grids][n_probes][9]`.
        texels: Vec<[f32; 4]>,
    },
}

/// `Other` of the shader, without its texels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct OtherRecord {
    /// Where the first probe of the grid stands, metres.
    pub low: [f32; 3],
    /// [`OtherRecord::MAP`] or one of the others.
    pub kind: u32,
    /// From probe to probe, metres.
    pub spacing: [f32; 3],
    /// Texels per side of the maps of irradiance, without the border.
    pub irradiance_side: u32,
    /// Probes along each axis, of each grid.
    pub size: [u32; 3],
    /// Texels per side of the maps of distance, without the border.
    pub distance_side: u32,
    /// How far along the normal the point lies whose visibility is asked for, metres.
    pub normal_bias_m: f32,
    /// How far toward the eye, metres.
    pub eye_bias_m: f32,
    /// 1 if the cage is that of this point, 0 if it is that of the surface.
    pub is_cage_biased: u32,
    /// Exponent from what maps hold to what is blended.
    pub stored_power: f32,
    /// Exponent from what was blended to mean radiance by cosine.
    pub mean_power: f32,
    /// Nested grids, of harmonics.
    pub n_grids: u32,
    /// Nothing.
    pub pad: [u32; 2],
}

impl OtherRecord {
    /// There are no probes, but a map. These are the shader's constants.
    pub const MAP: u32 = 1;
    /// Octahedral probes that count as those of DDGI do.
    pub const WRAPPED: u32 = 2;
    /// Octahedral probes that count as those of light fields do.
    pub const FACING: u32 = 3;
    /// Spherical harmonics.
    pub const HARMONICS: u32 = 4;
}

/// The light on the GPU.
pub(crate) struct OtherMaps {
    pub(crate) map: wgpu::TextureView,
    pub(crate) probes: wgpu::Buffer,
}

impl OtherMaps {
    /// None: black.
    pub(crate) fn nothing(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        Self::new(device, queue, &OtherLight::Map { size: 1, rgba: vec![[f16::ZERO; 4]] })
    }

    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue, light: &OtherLight) -> Self {
        match light {
            OtherLight::Map { size, rgba } => {
                let record = OtherRecord { kind: OtherRecord::MAP, ..OtherRecord::default() };
                Self { map: upload(device, queue, *size, rgba), probes: buffer(device, &record, &[]) }
            }
            OtherLight::Probes { record, texels } => {
                Self { map: upload(device, queue, 1, &[[f16::ZERO; 4]]), probes: buffer(device, record, texels) }
            }
        }
    }
}

fn buffer(device: &wgpu::Device, record: &OtherRecord, texels: &[[f32; 4]]) -> wgpu::Buffer {
    let mut contents = bytemuck::bytes_of(record).to_vec();
    // Arrays of the shader have an element at least.
    contents.extend_from_slice(bytemuck::cast_slice(if texels.is_empty() { &[[0.0; 4]] } else { texels }));
    device.create_buffer_init(&BufferInitDescriptor {
        label: Some("viewer.other_probes"),
        contents: &contents,
        usage: wgpu::BufferUsages::STORAGE,
    })
}

fn upload(device: &wgpu::Device, queue: &wgpu::Queue, size: u32, rgba: &[[f16; 4]]) -> wgpu::TextureView {
    let extent = wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.other_map"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(8 * size), rows_per_image: None };
    queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(rgba), layout, extent);
    texture.create_view(&Default::default())
}
