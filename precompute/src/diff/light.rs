//! Two files held against each other under one lighting, receiver by receiver.

use crate::metrics::{MethodError, mean, percentile, relative_errors};
use crate::probes::point_grid::PointGrid;
use glam::Vec3;
use localprt_formats::BakedView;
use localprt_scenes::luminance;
use serde::Serialize;
use serde_json::Value;

/// Places named, those with the largest differences.
const WORST: usize = 5;
/// Least cosine between the normals of receivers that are the same place: not the other side of a wall, nor around its corner.
const SAME_WAY: f32 = 0.9;

/// A file with the light that it gives.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    /// The file.
    pub view: BakedView<'a>,
    /// `[n_receivers]` indirect irradiance, W m^-2.
    pub irradiance: &'a [Vec3],
}

/// What differs in the light of two files, over the receivers that both have. Relative errors are those of
/// [`MethodError`], with the first file as the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LightDiff {
    /// Name of the lighting.
    pub name: String,
    /// Receivers of the first file that have one of the second at their place.
    pub pairs: usize,
    /// Both have the same texels at the same places, and pairs are those of a texel; else they are the nearest within one.
    pub same_layout: bool,
    /// Mean irradiance of both over the pairs, W m^-2.
    pub mean: [f64; 2],
    /// nrmse; absent, as all relative figures, where the first file is black.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nrmse: Option<f64>,
    /// Median of the relative difference of luminance.
    pub median_relative: f64,
    /// Its 95th percentile.
    pub p95_relative: f64,
    /// Its 99th percentile.
    pub p99_relative: f64,
    /// Its largest.
    pub max_relative: f64,
    /// Largest absolute difference of luminance, W m^-2.
    pub max_difference: f64,
    /// Where luminance differs most, worst first; none where nothing does.
    pub worst: Vec<Place>,
}

/// A receiver of both files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// World position in the first file, metres.
    pub position: [f32; 3],
    /// Irradiance of both, linear RGB, W m^-2.
    pub irradiance: [[f32; 3]; 2],
}

impl LightDiff {
    /// Compares two files under a lighting.
    pub fn of(name: &str, first: Lit<'_>, second: Lit<'_>) -> Self {
        let same = same_texels(&first.view, &second.view);
        let same_layout = same.is_some();
        let pairs = same.unwrap_or_else(|| nearest(&first.view, &second.view));
        let of_first: Vec<Vec3> = pairs.iter().map(|&(receiver, _)| first.irradiance[receiver]).collect();
        let of_second: Vec<Vec3> = pairs.iter().map(|&(_, receiver)| second.irradiance[receiver]).collect();
        let error = MethodError::of(&of_second, &of_first);
        let relative = if error.is_some() { relative_errors(&of_second, &of_first) } else { Vec::new() };
        let figures = error.unwrap_or_default();
        let difference = |pair: usize| (luminance(of_second[pair]) - luminance(of_first[pair])).abs();
        let mut order: Vec<usize> = (0..pairs.len()).filter(|&pair| difference(pair) > 0.0).collect();
        order.sort_by(|&a, &b| difference(b).total_cmp(&difference(a)));
        let place = |&pair: &usize| Place {
            position: first.view.receiver_position[pairs[pair].0],
            irradiance: [of_first[pair].to_array(), of_second[pair].to_array()],
        };
        Self {
            name: name.to_owned(),
            pairs: pairs.len(),
            same_layout,
            mean: [mean(&of_first), mean(&of_second)],
            nrmse: error.map(|error| error.nrmse),
            median_relative: figures.median_relative,
            p95_relative: figures.p95_relative,
            p99_relative: figures.p99_relative,
            max_relative: percentile(&relative, 1.0),
            max_difference: order.first().map_or(0.0, |&pair| difference(pair)),
            worst: order.iter().take(WORST).map(place).collect(),
        }
    }
}

/// Receivers of both by texel, in whatever order the files have them; `None` if texels or places differ.
fn same_texels(first: &BakedView<'_>, second: &BakedView<'_>) -> Option<Vec<(usize, usize)>> {
    let by_texel = |view: &BakedView<'_>| {
        let mut order: Vec<usize> = (0..view.receiver_texel.len()).collect();
        order.sort_unstable_by_key(|&receiver| view.receiver_texel[receiver]);
        order
    };
    let pairs: Vec<(usize, usize)> = by_texel(first).into_iter().zip(by_texel(second)).collect();
    let is_one = |&(a, b): &(usize, usize)| {
        first.receiver_texel[a] == second.receiver_texel[b] && first.receiver_position[a] == second.receiver_position[b]
    };
    let is_same = first.receiver_texel.len() == second.receiver_texel.len() && pairs.iter().all(is_one);
    is_same.then_some(pairs)
}

/// Receivers of the first file with the nearest of the second that faces the same way, if one is within a texel.
fn nearest(first: &BakedView<'_>, second: &BakedView<'_>) -> Vec<(usize, usize)> {
    let reach_m = texel_m(first).max(texel_m(second));
    let positions: Vec<Vec3> = second.receiver_position.iter().copied().map(Vec3::from).collect();
    let grid = PointGrid::new(&positions, reach_m);
    let receivers = first.receiver_position.iter().zip(first.receiver_normal).enumerate();
    let other = |(receiver, (&position, &normal)): (usize, (&[f32; 3], &[f32; 3]))| {
        let mut found: Option<(f32, u32)> = None;
        grid.for_each_within(position.into(), reach_m, |id, distance| {
            let faces = Vec3::from(second.receiver_normal[id as usize]).dot(normal.into()) > SAME_WAY;
            if faces && found.is_none_or(|nearest| (distance, id) < nearest) {
                found = Some((distance, id));
            }
        });
        found.map(|(_, id)| (receiver, id as usize))
    };
    receivers.filter_map(other).collect()
}

/// Median edge of the texels, metres, from the report in the file; without one, a thousandth of the scene's box.
fn texel_m(view: &BakedView<'_>) -> f32 {
    let report: Value = serde_json::from_str(view.report).unwrap_or_default();
    let told = report["budget"]["texel"]["median"].as_f64().filter(|&edge| edge > 0.0);
    let [low, high] = view.metadata.bounds.map(Vec3::from);
    told.map_or(1e-3 * (high - low).max_element(), |edge| edge as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::{BakedArrays, Metadata};

    /// Receivers in a row, a metre apart, facing up.
    fn file(positions: &[f32]) -> BakedArrays {
        BakedArrays {
            metadata: Metadata { bounds: [[0.0; 3], [1000.0, 1.0, 1.0]], ..Metadata::default() },
            receiver_position: positions.iter().map(|&x| [x, 0.0, 0.0]).collect(),
            receiver_normal: vec![[0.0, 1.0, 0.0]; positions.len()],
            receiver_texel: positions.iter().map(|&x| x as u32).collect(),
            ..BakedArrays::default()
        }
    }

    fn gray(values: &[f32]) -> Vec<Vec3> {
        values.iter().map(|&value| Vec3::splat(value)).collect()
    }

    fn compare(first: &BakedArrays, a: &[f32], second: &BakedArrays, b: &[f32]) -> LightDiff {
        let (a, b) = (gray(a), gray(b));
        LightDiff::of("x", Lit { view: first.view(), irradiance: &a }, Lit { view: second.view(), irradiance: &b })
    }

    #[test]
    fn the_same_layout_pairs_by_texel_and_the_worst_places_come_first() {
        let files = file(&[0.0, 1.0, 2.0, 3.0]);
        let other_order = compare(&files, &[1.0, 2.0, 3.0, 4.0], &file(&[3.0, 1.0, 0.0, 2.0]), &[4.0, 2.0, 1.0, 3.0]);
        assert!(other_order.same_layout && other_order.max_difference == 0.0);
        let found = compare(&files, &[1.0, 1.0, 1.0, 1.0], &files, &[1.0, 1.5, 1.0, 3.0]);
        assert!(found.same_layout && found.pairs == 4);
        assert!((found.nrmse.expect("light") - (4.25f64 / 4.0).sqrt()).abs() < 1e-9);
        // Luminance is a sum of f64 weights that make 1 up to rounding.
        assert!((found.max_relative - 2.0).abs() < 1e-9 && (found.max_difference - 2.0).abs() < 1e-9);
        let places: Vec<f32> = found.worst.iter().map(|place| place.position[0]).collect();
        assert_eq!(places, [3.0, 1.0]);
        let same = compare(&files, &[1.0, 2.0, 3.0, 4.0], &files, &[1.0, 2.0, 3.0, 4.0]);
        assert!(same.worst.is_empty() && same.nrmse == Some(0.0) && same.max_difference == 0.0);
        let dark = compare(&files, &[0.0; 4], &files, &[0.0, 0.0, 0.0, 1.0]);
        assert_eq!((dark.nrmse, dark.worst.len()), (None, 1), "nothing to be relative to");
    }

    #[test]
    fn other_layouts_pair_by_place_and_side() {
        let (first, mut second) = (file(&[0.0, 1.0, 2.0, 10.0]), file(&[2.4, 0.3, 1.2, 10.0, 50.0]));
        // The other side of the wall.
        second.receiver_normal[3] = [0.0, -1.0, 0.0];
        let found = compare(&first, &[1.0, 2.0, 3.0, 4.0], &second, &[3.0, 1.0, 2.5, 9.0, 9.0]);
        assert!(!found.same_layout);
        assert_eq!((found.pairs, found.worst.len()), (3, 1));
        assert_eq!(found.worst[0].position[0], 1.0);
    }
}
