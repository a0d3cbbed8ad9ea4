//! The textures of materials with their mip levels, which the CPU makes.

use localprt_scenes::{Image, Material, Scene, TextureRef, Wrap, scene::srgb_to_linear};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How the bytes of an image are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Encoding {
    Srgb,
    Linear,
}

/// Bind groups of all materials: base color, emission and normal map, each with its sampler.
pub(crate) fn material_groups(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    layout: &wgpu::BindGroupLayout,
    scene: &Scene,
) -> Vec<wgpu::BindGroup> {
    let slots = |material: &Material| {
        [
            (material.base_color_texture, Encoding::Srgb),
            (material.emission_texture, Encoding::Srgb),
            (material.normal_texture, Encoding::Linear),
        ]
    };
    let used: BTreeMap<(usize, Encoding), ()> = scene
        .materials
        .iter()
        .flat_map(slots)
        .filter_map(|(reference, encoding)| Some(((image_of(scene, reference)?, encoding), ())))
        .collect();
    let levels: Vec<_> =
        used.par_iter().map(|(&(image, encoding), ())| mip_levels(&scene.images[image], encoding)).collect();
    let views: BTreeMap<(usize, Encoding), wgpu::TextureView> = used
        .keys()
        .zip(&levels)
        .map(|(&(image, encoding), levels)| ((image, encoding), upload(device, queue, levels, encoding)))
        .collect();
    let white = Level { width: 1, height: 1, rgba: vec![255; 4] };
    let white = upload(device, queue, &[white], Encoding::Linear);
    let mut groups = Vec::new();
    for material in &scene.materials {
        let samplers = slots(material).map(|(reference, _)| sampler(device, scene, reference));
        let views = slots(material)
            .map(|(reference, encoding)| image_of(scene, reference).map_or(&white, |image| &views[&(image, encoding)]));
        let entries: Vec<_> = (0..3)
            .flat_map(|slot| {
                let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
                [
                    entry(2 * slot as u32, wgpu::BindingResource::TextureView(views[slot])),
                    entry(2 * slot as u32 + 1, wgpu::BindingResource::Sampler(&samplers[slot])),
                ]
            })
            .collect();
        groups.push(device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("viewer.material"),
            layout,
            entries: &entries,
        }));
    }
    groups
}

/// Three textures and their samplers.
pub(crate) fn material_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding: u32| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: if binding.is_multiple_of(2) {
            wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: true },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            }
        } else {
            wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)
        },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("viewer.material"),
        entries: &[0, 1, 2, 3, 4, 5].map(entry),
    })
}

fn image_of(scene: &Scene, reference: Option<TextureRef>) -> Option<usize> {
    let image = scene.textures[reference?.texture].image;
    (scene.images[image].width > 0 && scene.images[image].height > 0).then_some(image)
}

fn sampler(device: &wgpu::Device, scene: &Scene, reference: Option<TextureRef>) -> wgpu::Sampler {
    let texture = reference.map(|reference| scene.textures[reference.texture]);
    let address = |wrap: Option<Wrap>| match wrap.unwrap_or_default() {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::MirroredRepeat => wgpu::AddressMode::MirrorRepeat,
        Wrap::ClampToEdge => wgpu::AddressMode::ClampToEdge,
    };
    let nearest = texture.is_some_and(|texture| texture.nearest);
    let is_software = device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("viewer.material"),
        address_mode_u: address(texture.map(|texture| texture.wrap_u)),
        address_mode_v: address(texture.map(|texture| texture.wrap_v)),
        mag_filter: if nearest { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear },
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        // Only where all filters are linear. llvmpipe visits every texel in the box around a footprint, however large:
        // at some sizes of picture a few pixels take minutes.
        anisotropy_clamp: if nearest || is_software { 1 } else { 4 },
        ..Default::default()
    })
}

struct Level {
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

/// The image and its halves down to one texel; colors are averaged linearly.
fn mip_levels(image: &Image, encoding: Encoding) -> Vec<Level> {
    let mut levels = vec![Level { width: image.width, height: image.height, rgba: image.rgba.clone() }];
    while let Some(last) = levels.last().filter(|last| last.width > 1 || last.height > 1) {
        levels.push(halved(last, encoding));
    }
    levels
}

fn halved(level: &Level, encoding: Encoding) -> Level {
    let (width, height) = ((level.width / 2).max(1), (level.height / 2).max(1));
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let taps = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
                let (x, y) = ((2 * x + dx).min(level.width - 1), (2 * y + dy).min(level.height - 1));
                ((y * level.width + x) * 4) as usize
            });
            for band in 0..4 {
                let bytes = taps.map(|tap| level.rgba[tap + band]);
                rgba.push(match encoding {
                    Encoding::Srgb if band < 3 => linear_to_srgb(bytes.map(srgb_to_linear).iter().sum::<f32>() / 4.0),
                    _ => (bytes.iter().map(|&byte| u32::from(byte)).sum::<u32>() + 2).div_euclid(4) as u8,
                });
            }
        }
    }
    Level { width, height, rgba }
}

fn linear_to_srgb(linear: f32) -> u8 {
    // Steps of 2^-14 are finer than sRGB's finest, 1 / (255 * 12.92).
    static TABLE: std::sync::LazyLock<Vec<u8>> = std::sync::LazyLock::new(|| {
        (0..=16384)
            .map(|step| {
                let linear = step as f32 / 16384.0;
                let encoded =
                    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
                (encoded * 255.0).round() as u8
            })
            .collect()
    });
    TABLE[(linear * 16384.0).round() as usize]
}

fn upload(device: &wgpu::Device, queue: &wgpu::Queue, levels: &[Level], encoding: Encoding) -> wgpu::TextureView {
    // A device that is too small for the first levels starts with a later one.
    let largest = device.limits().max_texture_dimension_2d;
    let skipped = levels.iter().take_while(|level| level.width.max(level.height) > largest).count();
    let levels = &levels[skipped..];
    let size = |level: &Level| wgpu::Extent3d { width: level.width, height: level.height, depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.texture"),
        size: size(&levels[0]),
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: match encoding {
            Encoding::Srgb => wgpu::TextureFormat::Rgba8UnormSrgb,
            Encoding::Linear => wgpu::TextureFormat::Rgba8Unorm,
        },
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (mip_level, level) in levels.iter().enumerate() {
        queue.write_texture(
            wgpu::TexelCopyTextureInfo { mip_level: mip_level as u32, ..texture.as_image_copy() },
            &level.rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(level.width * 4),
                rows_per_image: Some(level.height),
            },
            size(level),
        );
    }
    texture.create_view(&Default::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_bytes_survive_a_round_trip() {
        for byte in 0..=255 {
            assert_eq!(linear_to_srgb(srgb_to_linear(byte)), byte);
        }
    }

    #[test]
    fn levels_halve_down_to_one_texel_and_keep_the_mean() {
        let rgba = (0..5 * 2).flat_map(|texel| [if texel % 2 == 0 { 255 } else { 0 }, 80, 80, 255]).collect();
        let image = Image { name: String::new(), width: 5, height: 2, rgba, encoded: None };
        let levels = mip_levels(&image, Encoding::Srgb);
        assert_eq!(
            levels.iter().map(|level| (level.width, level.height)).collect::<Vec<_>>(),
            [(5, 2), (2, 1), (1, 1)]
        );
        // Half of the light, not half of the byte.
        assert_eq!(levels[1].rgba[..4], [188, 80, 80, 255]);
    }
}
