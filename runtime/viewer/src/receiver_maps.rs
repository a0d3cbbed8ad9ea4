//! Maps of what a baked file says about its receivers, as colors of the texels of the receiver map, with their legends.
//!
//! In: a baked file, and for the error a [`ReferenceFile`]. Out: a [`ReceiverMap`] for
//! [`SceneDraw::set_receiver_map`](crate::SceneDraw::set_receiver_map). Light has no part in it.

use crate::views::ViewKind;
use localprt_formats::Checked;
use localprt_tools::metrics::percentile;
use localprt_tools::reference_file::ReferenceFile;
use localprt_tools::{ramp::Ramp, range::nice_range};

mod clusters;
mod error;

/// Colors of the receiver map's texels.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceiverMap {
    /// Texels per side.
    pub size: u32,
    /// `[size][size][4]` sRGB bytes, row 0 at v = 0; alpha is 0 where there is nothing to show.
    pub rgba: Vec<u8>,
    /// What the colors mean.
    pub legend: Legend,
}

/// What the colors of a map mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend {
    /// What is shown.
    pub title: String,
    /// Value of the first color.
    pub low: f32,
    /// Value of the last color, and of all above.
    pub high: f32,
    /// Unit of both; empty for categories.
    pub unit: &'static str,
    /// From low to high in even steps; empty for categories.
    pub colors: Vec<[u8; 3]>,
    /// Figures, and what else there is to know.
    pub note: String,
}

/// Steps of a legend.
const STEPS: usize = 64;
/// Texels of [`ViewKind::Texels`] that a receiver fills for others, and that are empty. No cluster has these colors.
const GUTTER: [u8; 3] = [255; 3];
const EMPTY: [u8; 3] = [0; 3];
/// What the colors of clusters are mixed with in [`ViewKind::Texels`], so that the checkerboard leads.
const PALE: f32 = 200.0;
/// Share of every other texel's color there.
const DARKER: f32 = 0.6;

/// The map of a view: `None` for views that are not maps, and for [`ViewKind::Error`] without a reference. That the
/// reference is of this bake is for [`ReferenceFile::matches`] to say.
pub fn receiver_map(view: ViewKind, baked: &Checked<'_>, reference: Option<&ReferenceFile>) -> Option<ReceiverMap> {
    match view {
        ViewKind::Final | ViewKind::Lighting | ViewKind::Direct | ViewKind::Indirect => None,
        ViewKind::Unseen => Some(unseen(baked)),
        ViewKind::Clusters => Some(cluster_map(baked)),
        ViewKind::Coefficients => Some(coefficients(baked)),
        ViewKind::Texels => Some(texels(baked)),
        ViewKind::Error => reference.map(|reference| error::map(baked, reference)),
    }
}

fn unseen(baked: &Checked<'_>) -> ReceiverMap {
    let values = baked.view().receiver_unseen;
    let [low, high] = nice_range(values, 99.0);
    let shares: Vec<f64> = values.iter().map(|&value| value.into()).collect();
    let legend = Legend {
        title: "Unseen light".into(),
        low,
        high: high.min(1.0),
        unit: "share of the hemisphere",
        note: percentages(&shares),
        ..Legend::default()
    };
    ramp_map(baked, values, legend)
}

fn coefficients(baked: &Checked<'_>) -> ReceiverMap {
    let values: Vec<f32> =
        clusters::of_receivers(baked).into_iter().map(|cluster| kept(baked, cluster) as f32).collect();
    let counts: Vec<f64> = values.iter().map(|&value| value.into()).collect();
    let note =
        format!("mean {:.1}, p95 {}, max {}", mean(&counts), percentile(&counts, 0.95), percentile(&counts, 1.0));
    let (low, high) = (0.0, values.iter().copied().fold(1.0, f32::max));
    let legend = Legend { title: "Coefficients".into(), low, high, unit: "singular values", note, ..Legend::default() };
    ramp_map(baked, &values, legend)
}

fn kept(baked: &Checked<'_>, cluster: u32) -> u32 {
    baked.transport().clusters.get(cluster as usize).map_or(0, |cluster| cluster.lights.len() as u32)
}

fn cluster_map(baked: &Checked<'_>) -> ReceiverMap {
    let colors = clusters::colors(baked);
    let of_receiver = clusters::of_receivers(baked);
    let sizes: Vec<f64> = baked.transport().clusters.iter().map(|cluster| cluster.receivers.len() as f64).collect();
    let note = format!(
        "{} clusters of {:.0} receivers in the mean, {} to {}",
        sizes.len(),
        mean(&sizes),
        percentile(&sizes, 0.0),
        percentile(&sizes, 1.0)
    );
    let rgba = paint(baked, |receiver| color_of(&colors, &of_receiver, receiver));
    map(baked, rgba, Legend { title: "Clusters".into(), note, ..Legend::default() })
}

fn texels(baked: &Checked<'_>) -> ReceiverMap {
    let colors = clusters::colors(baked);
    let of_receiver = clusters::of_receivers(baked);
    let size = baked.view().metadata.lightmap_size;
    let [red, green, blue] = EMPTY;
    let mut rgba = [red, green, blue, 255].repeat(size as usize * size as usize);
    for &[texel, _] in baked.view().gutters {
        set(&mut rgba, texel, GUTTER);
    }
    for (receiver, &texel) in baked.view().receiver_texel.iter().enumerate() {
        let color = color_of(&colors, &of_receiver, receiver);
        let is_dark = (texel % size.max(1) + texel / size.max(1)) & 1 == 1;
        let shade = |value: u8| {
            let pale = (f32::from(value) + PALE) / 2.0;
            (if is_dark { DARKER * pale } else { pale }).round() as u8
        };
        set(&mut rgba, texel, color.map(shade));
    }
    let note = format!(
        "{size} x {size}: {} receivers, {} texels of gutters (white), the rest (black) empty",
        baked.view().receiver_texel.len(),
        baked.view().gutters.len()
    );
    map(baked, rgba, Legend { title: "Receiver texels".into(), note, ..Legend::default() })
}

fn color_of(colors: &[[u8; 3]], of_receiver: &[u32], receiver: usize) -> [u8; 3] {
    let cluster = of_receiver.get(receiver).copied().unwrap_or(u32::MAX);
    colors.get(cluster as usize).copied().unwrap_or(Ramp::Sequential.color(f32::NAN))
}

/// `values`: `[n_receivers]`; NaN is mid gray. The legend's range becomes its colors.
fn ramp_map(baked: &Checked<'_>, values: &[f32], legend: Legend) -> ReceiverMap {
    let Legend { low, high, .. } = legend;
    let color = |value: f32| Ramp::Sequential.color((value - low) / (high - low));
    let rgba = paint(baked, |receiver| color(values.get(receiver).copied().unwrap_or(f32::NAN)));
    let colors = (0..STEPS).map(|step| Ramp::Sequential.color(step as f32 / (STEPS - 1) as f32)).collect();
    map(baked, rgba, Legend { colors, ..legend })
}

fn map(baked: &Checked<'_>, rgba: Vec<u8>, legend: Legend) -> ReceiverMap {
    ReceiverMap { size: baked.view().metadata.lightmap_size, rgba, legend }
}

/// Receivers in their texels, and gutters as the receivers whose light they take.
fn paint(baked: &Checked<'_>, color: impl Fn(usize) -> [u8; 3]) -> Vec<u8> {
    let size = baked.view().metadata.lightmap_size as usize;
    let mut rgba = vec![0; 4 * size * size];
    for &[texel, receiver] in baked.view().gutters {
        set(&mut rgba, texel, color(receiver as usize));
    }
    for (receiver, &texel) in baked.view().receiver_texel.iter().enumerate() {
        set(&mut rgba, texel, color(receiver));
    }
    rgba
}

fn set(rgba: &mut [u8], texel: u32, [red, green, blue]: [u8; 3]) {
    if let Some(bytes) = rgba.get_mut(4 * texel as usize..).and_then(|rest| rest.first_chunk_mut()) {
        *bytes = [red, green, blue, 255];
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn percentages(shares: &[f64]) -> String {
    let [mean, p95, max] = [mean(shares), percentile(shares, 0.95), percentile(shares, 1.0)].map(|share| 100.0 * share);
    format!("mean {mean:.2} %, p95 {p95:.2} %, max {max:.2} %")
}

/// `rgba`: `[size][size][4]`, sRGB.
pub(crate) fn upload(device: &wgpu::Device, queue: &wgpu::Queue, size: u32, rgba: &[u8]) -> wgpu::TextureView {
    let extent = wgpu::Extent3d { width: size.max(1), height: size.max(1), depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewer.receiver_map"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    if size > 0 {
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size), rows_per_image: None };
        queue.write_texture(texture.as_image_copy(), rgba, layout, extent);
    }
    texture.create_view(&Default::default())
}

#[cfg(test)]
mod tests;
