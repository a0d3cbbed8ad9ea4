//! The relative error that a validation has measured at some receivers, shown at all of them.

use super::{Legend, ReceiverMap, percentages, ramp_map};
use glam::Vec3;
use localprt_formats::Checked;
use localprt_tools::metrics::relative_errors;
use localprt_tools::range::nice_range;
use localprt_tools::reference_file::ReferenceFile;
use rayon::prelude::*;

/// How far a measured receiver speaks for others outside its cluster, in distances that measured receivers would have if
/// they were spread evenly over the walls of the scene's box.
const REACH: f32 = 4.0;
/// Cosine between normals up to which receivers face the same way.
const FACING: f32 = 0.5;

pub(super) fn map(baked: &Checked<'_>, reference: &ReferenceFile) -> ReceiverMap {
    let colors = |values: fn(&localprt_tools::reference_file::ReferencePoint) -> [f32; 3]| {
        reference.points.iter().map(|point| Vec3::from(values(point))).collect::<Vec<_>>()
    };
    let errors = relative_errors(&colors(|point| point.compressed), &colors(|point| point.reference));
    let measured: Vec<(u32, f32)> =
        reference.points.iter().zip(&errors).map(|(point, &error)| (point.receiver, error as f32)).collect();
    let values = everywhere(baked, &measured);
    let plain: Vec<f32> = errors.iter().map(|&error| error as f32).collect();
    let [low, high] = nice_range(&plain, 99.0);
    let note = format!(
        "{} at {} of {} receivers; {} bounces under {}",
        percentages(&errors),
        measured.len(),
        baked.view().receiver_texel.len(),
        reference.bounces,
        reference.state
    );
    let unit = "share of the reference";
    ramp_map(baked, &values, Legend { title: "Relative error".into(), low, high, unit, note, ..Legend::default() })
}

/// Values at `[n_receivers]` from those at measured ones, which rise: each its own; any other that of the nearest measured
/// one of its cluster, or else of the nearest one around that faces the same way; NaN where there is none.
pub(super) fn everywhere(baked: &Checked<'_>, measured: &[(u32, f32)]) -> Vec<f32> {
    let position =
        |receiver: u32| baked.view().receiver_position.get(receiver as usize).map_or(Vec3::NAN, |&at| Vec3::from(at));
    let mut values = vec![f32::NAN; baked.view().receiver_texel.len()];
    let around = Around::new(baked, measured);
    let of_cluster = |cluster: &localprt_formats::Cluster<'_>| -> Vec<(u32, f32)> {
        let (start, end) = (cluster.receivers.start as u32, cluster.receivers.end as u32);
        let first = measured.partition_point(|&(receiver, _)| receiver < start);
        let own = &measured[first..measured.partition_point(|&(receiver, _)| receiver < end)];
        let value = |receiver: u32| {
            if let Ok(index) = own.binary_search_by_key(&receiver, |&(receiver, _)| receiver) {
                return own[index].1;
            }
            let at = position(receiver);
            let nearest = own.iter().min_by(|(a, _), (b, _)| {
                position(*a).distance_squared(at).total_cmp(&position(*b).distance_squared(at))
            });
            nearest.map_or_else(|| around.nearest(receiver), |&(_, value)| value)
        };
        (start..end).map(|receiver| (receiver, value(receiver))).collect()
    };
    let found: Vec<_> = baked.transport().clusters.par_iter().map(of_cluster).collect();
    for (receiver, value) in found.into_iter().flatten() {
        values[receiver as usize] = value;
    }
    values
}

/// Measured receivers by x, for those whose clusters have none.
struct Around<'a> {
    baked: &'a Checked<'a>,
    /// Position, receiver, value.
    sorted: Vec<(Vec3, u32, f32)>,
    reach_m: f32,
}

impl<'a> Around<'a> {
    fn new(baked: &'a Checked<'a>, measured: &[(u32, f32)]) -> Self {
        let placed = |&(receiver, value): &(u32, f32)| {
            Some((Vec3::from(*baked.view().receiver_position.get(receiver as usize)?), receiver, value))
        };
        let mut sorted: Vec<_> = measured.iter().filter_map(placed).collect();
        sorted.sort_by(|(a, ..), (b, ..)| a.x.total_cmp(&b.x));
        let [low, high] = baked.view().metadata.bounds.map(Vec3::from);
        let sides = (high - low).max(Vec3::ZERO);
        let walls = 2.0 * (sides.x * sides.y + sides.y * sides.z + sides.z * sides.x);
        let reach_m = REACH * (walls / sorted.len().max(1) as f32).sqrt();
        Self { baked, sorted, reach_m }
    }

    fn nearest(&self, receiver: u32) -> f32 {
        let normal = |receiver: u32| {
            self.baked.view().receiver_normal.get(receiver as usize).map_or(Vec3::ZERO, |&normal| Vec3::from(normal))
        };
        let Some(&at) = self.baked.view().receiver_position.get(receiver as usize) else { return f32::NAN };
        let (at, own) = (Vec3::from(at), normal(receiver));
        let first = self.sorted.partition_point(|(point, ..)| point.x < at.x - self.reach_m);
        let mut best = (self.reach_m, f32::NAN);
        for &(point, other, value) in &self.sorted[first..] {
            if point.x > at.x + self.reach_m {
                break;
            }
            let distance = point.distance(at);
            if distance < best.0 && normal(other).dot(own) > FACING {
                best = (distance, value);
            }
        }
        best.1
    }
}
