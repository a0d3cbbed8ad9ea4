//! Texels without a receiver that a bilinear tap can touch, and whose light they show.

use super::{Atlas, NO_RECEIVER, ReceiverSet, TexelMap};
use glam::DVec2;
use localprt_scenes::Scene;
use localprt_surfaces::atlas::raster::in_texels;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Texels around every chart that are filled.
const REACH: i64 = 2;
/// Receivers this near are found by looking at every texel around; beyond, from texel to texel.
const NEAR: i64 = 3;
/// Texels around a chart's own that a bilinear tap reads.
const TAPPED: i64 = 1;
/// Points of a chart without area that are looked at, texels apart.
const STEP: f64 = 0.5;
const NO_CHART: u32 = u32::MAX;

/// Texels to fill, by rising texel.
pub(super) struct Filled {
    /// `(texel, receiver)` for texels within two of a chart's texels, and for covered texels without a receiver: the nearest
    /// receiver of the same chart, the lowest of several; exact within three texels, to about a texel beyond.
    pub gutters: Vec<(u32, u32)>,
    /// `(texel, chart)` of the same texels of charts without any receiver, and of those around charts without area, where they are not
    /// another chart's.
    pub lone: Vec<(u32, u32)>,
}

/// What to fill, and from where.
pub(super) fn fill(
    scene: &Scene,
    atlas: &Atlas,
    map: &TexelMap,
    receivers: &ReceiverSet,
    receiver_at: &[u32],
) -> Filled {
    let grid = Grid::of(map.size);
    let mut chart_at = vec![NO_CHART; receiver_at.len()];
    for texel in &map.texels {
        chart_at[texel.index as usize] = texel.chart;
    }
    let mut has_receiver =
        vec![false; chart_at.iter().filter(|&&chart| chart != NO_CHART).max().map_or(0, |&chart| chart as usize + 1)];
    for &chart in &receivers.chart {
        has_receiver[chart as usize] = true;
    }
    let flat = around_flat_charts(scene, atlas, map);
    // Texels to fill, with their chart, in texel order.
    type Open = Vec<(u32, u32)>;
    let (open, lone): (Open, Open) = (0..receiver_at.len() as u32)
        .into_par_iter()
        .filter(|&texel| receiver_at[texel as usize] == NO_RECEIVER)
        .filter_map(|texel| {
            let own = chart_at[texel as usize];
            let is_tapped = || grid.around(texel, TAPPED).any(|(other, _)| chart_at[other as usize] != NO_CHART);
            let chart = if own != NO_CHART {
                own
            } else if let Some(&chart) = flat.get(&texel)
                && !is_tapped()
            {
                chart
            } else {
                let around = grid.around(texel, REACH).filter(|&(other, _)| chart_at[other as usize] != NO_CHART);
                chart_at[around.min_by_key(|&(other, distance)| (distance, chart_at[other as usize]))?.0 as usize]
            };
            Some((texel, chart))
        })
        .partition(|&(_, chart)| has_receiver.get(chart as usize).is_some_and(|&has_receiver| has_receiver));
    let mut source: Vec<u32> = open
        .par_iter()
        .map(|&(texel, chart)| {
            grid.around(texel, NEAR)
                .filter(|&(_, distance)| distance <= NEAR * NEAR)
                .filter_map(|(other, distance)| Some((distance, held(receiver_at, other)?)))
                .filter(|&(_, receiver)| receivers.chart[receiver as usize] == chart)
                .min()
                .map_or(NO_RECEIVER, |(_, receiver)| receiver)
        })
        .collect();
    spread(&grid, &open, &mut source, receivers);
    Filled { gutters: open.iter().zip(source).map(|(&(texel, _), receiver)| (texel, receiver)).collect(), lone }
}

/// The chart without texels, the lowest of several, that bilinear taps of each texel show: coordinates that were rounded, as packed
/// scenes have them, leave small charts no area.
fn around_flat_charts(scene: &Scene, atlas: &Atlas, map: &TexelMap) -> BTreeMap<u32, u32> {
    let mut has_texels = vec![false; atlas.n_charts as usize];
    for texel in &map.texels {
        has_texels[texel.chart as usize] = true;
    }
    let mut chart_at = BTreeMap::new();
    for ((mesh, triangle), (uv, &chart)) in scene.faces().zip(atlas.corners.iter().zip(&atlas.chart)) {
        if has_texels[chart as usize] || scene.area_m2(mesh, triangle) == 0.0 {
            continue;
        }
        let corners = uv.map(|uv| in_texels(uv, map.size));
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (corners[from], corners[to])) {
            let steps = (from.distance(to) / STEP).ceil().min(f64::from(map.size) / STEP) as u32;
            for step in 0..=steps {
                let point = from.lerp(to, f64::from(step) / f64::from(steps.max(1))) - 0.5;
                for tap in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                    let at =
                        (point.floor() + DVec2::from(tap)).clamp(DVec2::ZERO, DVec2::splat(f64::from(map.size) - 1.0));
                    let held = chart_at.entry(at.y as u32 * map.size + at.x as u32).or_insert(chart);
                    *held = chart.min(*held);
                }
            }
        }
    }
    chart_at
}

/// Fills the rest from neighbors of the same chart, ring by ring, and what no neighbor reaches from all receivers.
fn spread(grid: &Grid, open: &[(u32, u32)], source: &mut [u32], receivers: &ReceiverSet) {
    let mut rest: Vec<usize> = (0..open.len()).filter(|&place| source[place] == NO_RECEIVER).collect();
    while !rest.is_empty() {
        let found: Vec<u32> = rest
            .par_iter()
            .map(|&place| {
                let (texel, chart) = open[place];
                grid.around(texel, 1)
                    .filter_map(|(other, _)| {
                        let neighbor = open.binary_search_by_key(&other, |&(texel, _)| texel).ok()?;
                        let receiver = source[neighbor];
                        (open[neighbor].1 == chart && receiver != NO_RECEIVER)
                            .then(|| (grid.distance(texel, receivers.texel[receiver as usize]), receiver))
                    })
                    .min()
                    .map_or(NO_RECEIVER, |(_, receiver)| receiver)
            })
            .collect();
        if found.iter().all(|&receiver| receiver == NO_RECEIVER) {
            break;
        }
        for (&place, receiver) in rest.iter().zip(found) {
            source[place] = receiver;
        }
        rest.retain(|&place| source[place] == NO_RECEIVER);
    }
    let mut by_chart: Vec<(u32, u32)> = receivers.chart.iter().copied().zip(0..).collect();
    by_chart.sort_unstable();
    for place in rest {
        let (texel, chart) = open[place];
        let first = by_chart.partition_point(|&(other, _)| other < chart);
        let members = by_chart[first..].iter().take_while(|&&(other, _)| other == chart);
        let nearest =
            members.map(|&(_, receiver)| (grid.distance(texel, receivers.texel[receiver as usize]), receiver)).min();
        source[place] = nearest.map_or(0, |(_, receiver)| receiver);
    }
}

fn held(receiver_at: &[u32], texel: u32) -> Option<u32> {
    Some(receiver_at[texel as usize]).filter(|&receiver| receiver != NO_RECEIVER)
}

/// Texels of a square map.
pub(super) struct Grid {
    size: i64,
}

impl Grid {
    pub(super) fn of(size: u32) -> Self {
        Self { size: i64::from(size) }
    }

    /// `(texel, squared distance)` of the other texels at most `reach` rows and columns away.
    fn around(&self, texel: u32, reach: i64) -> impl Iterator<Item = (u32, i64)> {
        let (size, x, y) = (self.size, i64::from(texel) % self.size, i64::from(texel) / self.size);
        (-reach..=reach)
            .flat_map(move |dy| (-reach..=reach).map(move |dx| (dx, dy)))
            .filter(move |&(dx, dy)| {
                (dx, dy) != (0, 0) && (0..size).contains(&(x + dx)) && (0..size).contains(&(y + dy))
            })
            .map(move |(dx, dy)| (((y + dy) * size + x + dx) as u32, dx * dx + dy * dy))
    }

    /// Squared distance of two texels.
    pub(super) fn distance(&self, a: u32, b: u32) -> i64 {
        let (a, b) = (i64::from(a), i64::from(b));
        let (dx, dy) = (a % self.size - b % self.size, a / self.size - b / self.size);
        dx * dx + dy * dy
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        receivers,
        test_scenes::{plane, scene, with_uv},
        unwrap::{LayoutSize, usable_layout},
    };
    use super::*;
    use crate::rays::RayCaster;
    use glam::{Vec2, Vec3};

    fn placed(scene: &Scene, size: u32) -> ReceiverSet {
        let caster = RayCaster::new(scene).unwrap();
        receivers::place(scene, &Atlas::of(scene), &caster, size, &|_, _, _| true).unwrap()
    }

    #[test]
    fn what_rounded_coordinates_leave_no_area_shows_light_from_around_it() {
        let floor = with_uv(plane("floor", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |at| 0.1 + 0.4 * Vec2::new(at.x, at.z));
        // To a point in the open, to a line, and to a point beside the floor's chart, whose texels stay its own.
        let places: [fn(Vec3) -> Vec2; 3] =
            [|_| Vec2::new(0.8, 0.8), |at| Vec2::new(0.7 + 0.5 * (at.x - 0.4), 0.2), |_| Vec2::new(0.505, 0.3)];
        // A texel under each, of 32 x 32: at 25.1, 25.1; on the line from 21.9 to 23.5, 5.9; at 15.66, 9.1.
        let around = [(25, 25), (22, 5), (16, 9)].map(|(x, y): (u32, u32)| y * 32 + x);
        for (place, (flat, texel)) in places.into_iter().zip(around).enumerate() {
            let tile = plane("tile", Vec3::new(0.4, 0.02, 0.4), Vec3::X * 0.1, Vec3::Z * 0.1, 1, 1);
            let scene = scene(vec![floor.clone(), with_uv(tile, flat)]);
            let size = LayoutSize { texels: u32::MAX, lightmap: Some(32), finest_m: None };
            assert_eq!(usable_layout(&scene, size).unwrap(), Ok(32), "such a layout is taken");
            let set = placed(&scene, 32);
            let held = set.gutters.iter().find(|&&(other, _)| other == texel).map(|&(_, receiver)| receiver);
            let held = held.unwrap_or_else(|| panic!("{place}: nothing at texel {texel}"));
            let is_beside = set.position[held as usize].distance(Vec3::new(0.45, 0.0, 0.45)) < 0.2;
            assert_eq!(is_beside, place < 2, "{place}: {}", set.position[held as usize]);
        }
    }
}
