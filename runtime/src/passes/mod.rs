//! The passes of one gather, in order; each folder holds one pass and its CPU twin.
//!
//! Before the gathers, where shadows are not traced: [`shadow_map`] -> [`direct_irradiance`].
//!
//! [`direct_lightmap`] -> [`lightmap_mips`] -> [`probe_relight`] -> [`cluster_projection`] ->
//! [`receiver_reconstruction`] -> [`near_light`] -> [`gutter_dilation`]; the last one's map is the next gather's feedback.
//! After the last gather of a relight [`cluster_projection`], [`receiver_reconstruction`] and [`volume_fill`] light the volume.
//! [`CpuRelighter`](crate::CpuRelighter) is the one file that knows this order.

pub mod cluster_projection;
pub mod direct_irradiance;
pub mod direct_lightmap;
pub mod gutter_dilation;
pub mod lightmap_mips;
pub mod near_light;
pub mod probe_relight;
pub mod receiver_reconstruction;
pub mod shadow_map;
pub mod volume_fill;

/// Splits off the given ranges, which must rise and not overlap, so that they can be written in parallel.
fn split_ranges<T>(mut values: &mut [T], ranges: impl Iterator<Item = std::ops::Range<usize>>) -> Vec<&mut [T]> {
    let mut parts = Vec::new();
    let mut consumed = 0;
    for range in ranges {
        let (part, rest) = std::mem::take(&mut values)[range.start - consumed..].split_at_mut(range.len());
        parts.push(part);
        values = rest;
        consumed = range.end;
    }
    parts
}
