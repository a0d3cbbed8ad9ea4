//! Lines that explain a file and its lights: supports, transport rows, relight rays, lights. Pure functions; world space,
//! metres.

use crate::overlays::OverlayLine;
use glam::Vec3;
use localprt_formats::weight::weight_kernel;
use localprt_formats::{BakedView, Checked, LEVEL_BLACK, LEVEL_SKY, Probe, node_level_and_texel};
use localprt_runtime::SceneTexels;
use localprt_scenes::{Light, LightKind};
use std::f32::consts::TAU;

const WHITE: [f32; 3] = [0.9, 0.88, 0.82];
const SKY_BLUE: [f32; 3] = [0.1, 0.35, 1.0];
const RED: [f32; 3] = [0.9, 0.03, 0.02];
const GREEN: [f32; 3] = [0.05, 0.8, 0.1];
const ORANGE: [f32; 3] = [1.0, 0.32, 0.02];

/// Lines of a circle.
const SEGMENTS: usize = 64;

pub(crate) fn line(from: Vec3, to: Vec3, [r, g, b]: [f32; 3], opacity: f32, width_px: f32) -> OverlayLine {
    OverlayLine { from, to, color: [r, g, b, opacity], width_px, on_top: true }
}

/// A circle about `center` through `center + a` and `center + b`.
fn circle(center: Vec3, a: Vec3, b: Vec3) -> impl Iterator<Item = (Vec3, Vec3)> {
    let point = move |index: usize| {
        let (sin, cos) = (index as f32 / SEGMENTS as f32 * TAU).sin_cos();
        center + cos * a + sin * b
    };
    (0..SEGMENTS).map(move |index| (point(index), point((index + 1) % SEGMENTS)))
}

/// Color of a weight, 0..=1: from violet by orange to yellow, ever brighter.
fn weight_color(weight: f32) -> [f32; 3] {
    let stops = [Vec3::new(0.12, 0.03, 0.25), Vec3::new(0.85, 0.1, 0.06), Vec3::new(1.0, 0.8, 0.1)];
    let at = 2.0 * weight.clamp(0.0, 1.0);
    let [low, high] = if at < 1.0 { [stops[0], stops[1]] } else { [stops[1], stops[2]] };
    low.lerp(high, at.fract() + if at >= 2.0 { 1.0 } else { 0.0 }).to_array()
}

/// Three great circles where a probe's weight ends.
pub fn support_sphere(probe: &Probe) -> Vec<OverlayLine> {
    let (center, radius) = (Vec3::from(probe.position), probe.support_radius_m);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| radius * axis);
    [(0, 1), (1, 2), (2, 0)]
        .into_iter()
        .flat_map(|(a, b)| circle(center, axes[a], axes[b]))
        .map(|(from, to)| line(from, to, ORANGE, 0.8, 1.5))
        .collect()
}

/// A probe that a receiver's transport reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportingProbe {
    /// Number of the probe.
    pub probe: u32,
    /// From the receiver, metres.
    pub distance_m: f32,
    /// w(distance / support radius) of Eq. (10); 0 if the probe supports other receivers of the cluster only.
    pub kernel_weight: f32,
    /// Share of the receiver's transport, 0..=1: the square sum of the probe's columns in the stored rows `U S V^T` of the
    /// receiver, over that of all columns.
    pub row_share: f32,
}

/// What a receiver's transport reads: shares of probes and sky add up to 1, or are 0 for a receiver that sees nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Support {
    /// Probes of the receiver's cluster, those with the largest shares first.
    pub probes: Vec<SupportingProbe>,
    /// Share of the sky's columns.
    pub sky_share: f32,
}

/// The probes that a receiver gets its light from, and how much of its transport is theirs. Empty for a receiver that does
/// not exist.
pub fn supporting_probes(baked: &Checked<'_>, receiver: u32) -> Support {
    let transport = baked.transport();
    let Some(cluster) = transport.cluster_of(receiver as usize).map(|number| &transport.clusters[number]) else {
        return Support::default();
    };
    let position = baked.view().receiver_position[receiver as usize];
    let (n_sh, n_k) = (transport.n_sh, transport.n_k);
    let (probes, n_coefficients) = (cluster.probes, cluster.lights.len());
    let n_columns = probes.len() * n_sh + cluster.n_sky;
    let first = (receiver as usize - cluster.receivers.start) * n_k * n_coefficients;
    let (projection, rows) = (cluster.projection, &cluster.reconstruction[first..]);
    // Square sums by probe, and of the sky at the end.
    let mut squares = vec![0.0f64; probes.len() + 1];
    for row in rows[..n_k * n_coefficients].chunks_exact(n_coefficients.max(1)) {
        let mut transport = vec![0.0f64; n_columns];
        for (weight, columns) in row.iter().zip(projection.chunks_exact(n_columns.max(1))) {
            let weight = f64::from(*weight);
            transport.iter_mut().zip(columns).for_each(|(sum, column)| *sum += weight * f64::from(*column));
        }
        for (column, value) in transport.iter().enumerate() {
            squares[(column / n_sh).min(probes.len())] += value * value;
        }
    }
    let total: f64 = squares.iter().sum();
    let share = |square: f64| if total > 0.0 { (square / total) as f32 } else { 0.0 };
    let mut supporting: Vec<SupportingProbe> = probes
        .iter()
        .zip(&squares)
        .map(|(&probe, &square)| {
            let record = &baked.view().probes[probe as usize];
            let distance_m = Vec3::from(record.position).distance(position.into());
            let kernel_weight = weight_kernel(distance_m / record.support_radius_m);
            SupportingProbe { probe, distance_m, kernel_weight, row_share: share(square) }
        })
        .collect();
    supporting.sort_by(|a, b| b.row_share.total_cmp(&a.row_share));
    Support { probes: supporting, sky_share: share(squares[probes.len()]) }
}

/// A receiver's normal, and a line to each probe of [`supporting_probes`], colored by its kernel weight: violet and thin
/// for none, yellow and thick for 1. Empty for a receiver that does not exist.
pub fn receiver_lines(baked: &Checked<'_>, receiver: u32) -> Vec<OverlayLine> {
    let index = receiver as usize;
    let (Some(&position), Some(&normal)) =
        (baked.view().receiver_position.get(index), baked.view().receiver_normal.get(index))
    else {
        return Vec::new();
    };
    let position = Vec3::from(position);
    let support = supporting_probes(baked, receiver);
    let nearest = support.probes.iter().map(|probe| probe.distance_m).reduce(f32::min);
    let [low, high] = baked.view().metadata.bounds.map(Vec3::from);
    let normal_m = nearest.map_or(0.02 * (high - low).max_element(), |distance| 0.4 * distance);
    // The strongest last, over the others.
    let to_probe = |probe: &SupportingProbe| {
        let weight = probe.kernel_weight;
        let to = Vec3::from(baked.view().probes[probe.probe as usize].position);
        line(position, to, weight_color(weight), 0.5 + 0.5 * weight, 1.5 + 2.5 * weight)
    };
    let mut probes = support.probes;
    probes.sort_by(|a, b| a.kernel_weight.total_cmp(&b.kernel_weight));
    let mut lines: Vec<OverlayLine> = probes.iter().map(to_probe).collect();
    let tip = position + normal_m * Vec3::from(normal);
    lines.extend(arrow(position, tip, 0.2 * normal_m).map(|(from, to)| line(from, to, GREEN, 1.0, 3.0)));
    lines
}

/// Lines from a receiver to the places of the light map that it reads, colored by weight over that of the strongest. Nodes that
/// no texel of the scene covers have no place.
pub fn link_lines(baked: &Checked<'_>, texels: &SceneTexels, receiver: u32) -> Vec<OverlayLine> {
    let Some(&position) = baked.view().receiver_position.get(receiver as usize) else { return Vec::new() };
    let mut links = baked.transport().links_of(receiver as usize);
    links.sort_by(|a, b| a.1.total_cmp(&b.1));
    let strongest = links.last().map_or(0.0, |link| link.1);
    let to_node = |&(node, weight): &(u32, f32)| {
        let share = if strongest > 0.0 { (weight / strongest).max(0.0) } else { 0.0 };
        let place = place_of(node, texels)?;
        Some(line(position.into(), place, weight_color(share), 0.5 + 0.5 * share, 1.0 + 2.0 * share))
    };
    links.iter().filter_map(to_node).collect()
}

/// Mean place of the surface that a node of the light map covers.
fn place_of(node: u32, texels: &SceneTexels) -> Option<Vec3> {
    let (level, texel) = node_level_and_texel(node);
    let (size, edge) = (texels.size.div_ceil(1 << level).max(1), 1 << level);
    let (first_x, first_y) = (texel % size * edge, texel / size * edge);
    let mut places = Vec::new();
    for y in first_y..(first_y + edge).min(texels.size) {
        let row = y * texels.size;
        let from = texels.index.partition_point(|&index| index < row + first_x);
        let to = texels.index.partition_point(|&index| index < row + (first_x + edge).min(texels.size));
        places.extend_from_slice(&texels.position[from..to]);
    }
    (!places.is_empty()).then(|| places.iter().sum::<Vec3>() / places.len() as f32)
}

/// Relight rays of a probe, at most so many and evenly spread, to what they meet: white-ish where they read the light map,
/// blue for the sky, red for what gives no light. Rays of unknown length, and those into the sky, are as long as the
/// support radius. Empty for a probe that does not exist.
pub fn probe_rays(baked: &BakedView<'_>, probe: u32, most: usize) -> Vec<OverlayLine> {
    let n_rays = baked.ray_dirs.len();
    let Some(record) = baked.probes.get(probe as usize) else { return Vec::new() };
    let origin = Vec3::from(record.position);
    let n_drawn = most.min(n_rays);
    // Within its stride, each is somewhere else: every n-th direction of a spiral would lie on few arms.
    let chosen = |index: usize| {
        let jitter = (index as f64 * 0.618_033_988_749_895).fract();
        ((index as f64 + jitter) * n_rays as f64 / n_drawn as f64) as usize
    };
    (0..n_drawn)
        .map(|index| {
            let ray = chosen(index).min(n_rays - 1);
            let entry = probe as usize * n_rays + ray;
            let [x, y, z, _] = baked.ray_dirs[ray];
            let color = match baked.ray_level[entry] {
                LEVEL_SKY => SKY_BLUE,
                LEVEL_BLACK => RED,
                _ => WHITE,
            };
            let known = baked.ray_distance.get(entry).map(|distance| distance.to_f32());
            let length = known.filter(|distance| distance.is_finite()).unwrap_or(record.support_radius_m);
            let to = origin + length * Vec3::new(x, y, z);
            OverlayLine { on_top: false, ..line(origin, to, color, 0.7, 1.5) }
        })
        .collect()
}

/// A light of this size: a star and rings for a point, the outer cone of a spot, a bundle of arrows for a directional light,
/// which has no place of its own and is shown at `anchor`. In the light's color, or orange and thicker if it is selected.
pub fn light_shape(light: &Light, anchor: Vec3, size_m: f32, selected: bool) -> Vec<OverlayLine> {
    let brightest = light.color.max_element();
    let own = if brightest > 0.0 { (light.color / brightest).max(Vec3::ZERO).to_array() } else { WHITE };
    let (color, width_px) = if selected { (ORANGE, 2.5) } else { (own, 1.5) };
    let shape = match light.kind {
        LightKind::Point => point_shape(light.position, size_m),
        LightKind::Spot { inner_cone, outer_cone } => spot_shape(light, [inner_cone, outer_cone], size_m),
        LightKind::Directional => arrows(anchor, light.direction, size_m),
    };
    shape.into_iter().map(|(from, to)| line(from, to, color, 1.0, width_px)).collect()
}

fn point_shape(center: Vec3, size_m: f32) -> Vec<(Vec3, Vec3)> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let star = axes.map(|axis| (center - size_m * axis, center + size_m * axis));
    let ring = |(a, b): (usize, usize)| circle(center, 0.5 * size_m * axes[a], 0.5 * size_m * axes[b]);
    star.into_iter().chain([(0, 1), (1, 2), (2, 0)].into_iter().flat_map(ring)).collect()
}

/// Cones whose sides are twice the size long: rings of both, sides of the outer one, and its axis.
fn spot_shape(light: &Light, cones: [f32; 2], size_m: f32) -> Vec<(Vec3, Vec3)> {
    let side = 2.0 * size_m;
    let (right, up) = across(light.direction);
    let ring = |angle: f32| {
        let (sin, cos) = angle.sin_cos();
        circle(light.position + side * cos * light.direction, side * sin * right, side * sin * up)
    };
    let outer: Vec<(Vec3, Vec3)> = ring(cones[1]).collect();
    let sides = outer.iter().step_by(SEGMENTS / 4).map(|&(point, _)| (light.position, point));
    let axis = (light.position, light.position + side * light.direction);
    sides.chain([axis]).chain(ring(cones[0])).chain(outer.iter().copied()).collect()
}

/// Five parallel arrows that end about the anchor.
fn arrows(anchor: Vec3, dir: Vec3, size_m: f32) -> Vec<(Vec3, Vec3)> {
    let (right, up) = across(dir);
    [Vec3::ZERO, right, -right, up, -up]
        .into_iter()
        .flat_map(|offset| {
            let tip = anchor + 0.5 * size_m * offset + size_m * dir;
            arrow(tip - 2.0 * size_m * dir, tip, 0.25 * size_m)
        })
        .collect()
}

/// A line with a head of four lines.
pub(crate) fn arrow(from: Vec3, to: Vec3, head_m: f32) -> impl Iterator<Item = (Vec3, Vec3)> {
    let dir = (to - from).normalize_or_zero();
    let (right, up) = across(dir);
    let back = to - head_m * dir;
    let barbs = [right, -right, up, -up].map(|side| (to, back + 0.4 * head_m * side));
    [(from, to)].into_iter().chain(barbs)
}

/// Two unit vectors across a direction and each other; of any direction if it is zero.
fn across(dir: Vec3) -> (Vec3, Vec3) {
    dir.try_normalize().unwrap_or(Vec3::Y).any_orthonormal_pair()
}

#[cfg(test)]
mod tests;
