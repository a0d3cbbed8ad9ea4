//! Charts without a receiver of their own, and whose light they show.
//!
//! A small chart can lie within one texel whose points are all inside or behind something, though a part of it is seen: it would be
//! black.

use super::{NO_RECEIVER, ReceiverSet, TexelMap, gutters::Grid};
use crate::{probes::point_grid::PointGrid, rays::RayCaster};
use glam::Vec3;
use rayon::prelude::*;

/// Receivers that are asked, nearest first.
const ASKED: usize = 16;
/// A receiver whose surface faces less than this cosine along the texel's own counts as so many times farther.
const TURNED: f32 = 0.7;
const FARTHER: f32 = 2.0;
/// Receiver and texel look for each other this far above their surfaces, over their distance.
const LIFT: f32 = 0.3;

/// `(texel, receiver)` for those of `texels`, `(texel, chart)` by rising texel, whose chart sees a receiver: the nearest that faces
/// about the same way, before one that does not. Texels that see none take that of the nearest of their chart.
pub(super) fn lend(
    caster: &RayCaster<'_>,
    map: &TexelMap,
    receivers: &ReceiverSet,
    texels: &[(u32, u32)],
) -> Vec<(u32, u32)> {
    if texels.is_empty() || receivers.is_empty() {
        return Vec::new();
    }
    let extent_m = caster.scene().extent();
    let grid = PointGrid::new(&receivers.position, extent_m / (receivers.len() as f32).sqrt());
    let lender = Lender { caster, receivers, grid, extent_m };
    let found: Vec<u32> = texels.par_iter().map(|&(texel, _)| lender.nearest(map, texel)).collect();
    let mut by_chart: Vec<(u32, u32, u32)> = texels
        .iter()
        .zip(&found)
        .filter(|(_, receiver)| **receiver != NO_RECEIVER)
        .map(|(&(texel, chart), &receiver)| (chart, texel, receiver))
        .collect();
    by_chart.sort_unstable();
    let of_map = Grid::of(map.size);
    let of_chart = |texel: u32, chart: u32| {
        let first = by_chart.partition_point(|held| held.0 < chart);
        by_chart[first..]
            .iter()
            .take_while(|held| held.0 == chart)
            .map(|&(_, other, receiver)| (of_map.distance(texel, other), receiver))
            .min()
            .map(|(_, receiver)| receiver)
    };
    texels.iter().filter_map(|&(texel, chart)| Some((texel, of_chart(texel, chart)?))).collect()
}

struct Lender<'a> {
    caster: &'a RayCaster<'a>,
    receivers: &'a ReceiverSet,
    grid: PointGrid,
    extent_m: f32,
}

impl Lender<'_> {
    /// For a texel that a face covers; [`NO_RECEIVER`] if it sees none of those around, or is none.
    fn nearest(&self, map: &TexelMap, texel: u32) -> u32 {
        let Ok(place) = map.texels.binary_search_by_key(&texel, |texel| texel.index) else { return NO_RECEIVER };
        let texel = &map.texels[place];
        let point = self.caster.scene().surface_point(texel.mesh as usize, texel.triangle as usize, texel.barycentrics);
        let (position, normal) = (point.position, point.geometric_normal);
        let mut near: Vec<(f32, u32)> = Vec::new();
        let mut radius_m = self.extent_m / (self.receivers.len() as f32).sqrt();
        while near.len() < ASKED && radius_m < 2.0 * self.extent_m {
            near.clear();
            self.grid.for_each_within(position, radius_m, |receiver, distance_m| {
                let cos = normal.dot(self.receivers.geometric_normal[receiver as usize]);
                if cos > 0.0 {
                    near.push((if cos < TURNED { FARTHER * distance_m } else { distance_m }, receiver));
                }
            });
            radius_m *= 2.0;
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.iter()
            .take(ASKED)
            .find(|&&(_, receiver)| self.is_open(position, normal, receiver as usize))
            .map_or(NO_RECEIVER, |&(_, receiver)| receiver)
    }

    fn is_open(&self, position: Vec3, normal: Vec3, receiver: usize) -> bool {
        let lift_m = LIFT * position.distance(self.receivers.position[receiver]) + self.caster.offset_m();
        let own = position + normal * self.caster.offset_m();
        let heads = [
            position + normal * lift_m,
            self.receivers.position[receiver] + self.receivers.geometric_normal[receiver] * lift_m,
        ];
        self.caster.visible(own, heads[0]) && self.caster.visible(heads[0], heads[1])
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        Atlas, receivers,
        test_scenes::{plane, scene, with_uv},
        texels,
    };
    use super::*;
    use glam::Vec2;

    #[test]
    fn a_chart_without_receivers_shows_the_nearest_that_it_sees() {
        // Two halves of a floor, each a chart; a wall between them, or not.
        let half = |name: &str, x: f32| {
            let mesh = plane(name, Vec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Z, 1, 1);
            with_uv(mesh, |at| Vec2::new(0.1 + 0.4 * at.x, 0.1 + 0.4 * at.z))
        };
        let wall = |x: f32| {
            let mesh = plane("wall", Vec3::new(x, -1.0, -5.0), Vec3::Z * 10.0, Vec3::Y * 10.0, 1, 1);
            with_uv(mesh, |_| Vec2::splat(0.95))
        };
        for (wall_x, is_open) in [(5.0, true), (1.05, false)] {
            let scene = scene(vec![half("lit", 0.0), half("lone", 1.1), wall(wall_x)]);
            let (caster, atlas) = (RayCaster::new(&scene).unwrap(), Atlas::of(&scene));
            let map = texels::cover(&scene, &atlas, 32);
            let mut set = receivers::place(&scene, &atlas, &caster, 32, &|_, _, _| true).unwrap();
            let lone: Vec<(u32, u32)> =
                map.texels.iter().filter(|texel| texel.mesh == 1).map(|texel| (texel.index, texel.chart)).collect();
            let lit: Vec<usize> = (0..set.len()).filter(|&receiver| set.position[receiver].x <= 1.0).collect();
            set = ReceiverSet {
                size: 32,
                texel: lit.iter().map(|&receiver| set.texel[receiver]).collect(),
                position: lit.iter().map(|&receiver| set.position[receiver]).collect(),
                geometric_normal: lit.iter().map(|&receiver| set.geometric_normal[receiver]).collect(),
                ..ReceiverSet::default()
            };
            let lent = lend(&caster, &map, &set, &lone);
            assert_eq!(lent.len(), if is_open { lone.len() } else { 0 });
            assert!(lone.len() > 50);
            for (_, receiver) in lent {
                assert!(set.position[receiver as usize].x > 0.9, "not the nearest");
            }
        }
    }
}
