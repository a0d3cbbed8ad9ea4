//! Charts without a receiver of their own, and whose light they show.
//!
//! A small chart can lie within one texel whose points are all inside or behind something, though a part of it is seen: it would be
//! black.

use super::{Atlas, ReceiverSet, TexelMap, gutters::Grid};
use crate::{probes::point_grid::PointGrid, rays::RayCaster};
use glam::Vec3;
use localprt_surfaces::subdivision;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points along an edge of a face from which light is looked for.
const STEPS: u32 = 3;
/// Receivers that are asked, nearest first.
const ASKED: usize = 16;
/// A receiver whose surface faces less than this cosine along the texel's own counts as so many times farther.
const TURNED: f32 = 0.7;
const FARTHER: f32 = 2.0;
/// Receiver and texel look for each other this far above their surfaces, over their distance.
const LIFT: f32 = 0.3;

/// `(texel, receiver)` for those of `texels`, `(texel, chart)` by rising texel, whose chart sees a receiver: the nearest that faces
/// about the same way, before one that does not. Texels that see none take that of the nearest of their chart, and a chart none of whose
/// texels sees one that of its faces: of those that share a texel, only one has its points.
pub(super) fn lend(
    caster: &RayCaster<'_>,
    atlas: &Atlas,
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
    let found: Vec<Option<u32>> = texels.par_iter().map(|&(texel, _)| lender.of_texel(map, texel)).collect();
    let mut by_chart: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
    for (&(texel, chart), receiver) in texels.iter().zip(found) {
        by_chart.entry(chart).or_default().extend(receiver.map(|receiver| (texel, receiver)));
    }
    let of_faces = lender.of_faces(atlas, &by_chart);
    let of_map = Grid::of(map.size);
    let of_chart = |texel: u32, chart: u32| {
        let own = by_chart[&chart].iter().map(|&(other, receiver)| (of_map.distance(texel, other), receiver));
        own.min().map(|(_, receiver)| receiver).or_else(|| of_faces.get(&chart).copied())
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
    /// The receiver for a texel that a face covers; `None` if it sees none of those around.
    fn of_texel(&self, map: &TexelMap, texel: u32) -> Option<u32> {
        let place = map.texels.binary_search_by_key(&texel, |texel| texel.index).ok()?;
        let texel = &map.texels[place];
        let point = self.caster.scene().surface_point(texel.mesh as usize, texel.triangle as usize, texel.barycentrics);
        self.nearest(point.position, point.geometric_normal).map(|(_, receiver)| receiver)
    }

    /// By chart without one so far, the receiver nearest to any point of its faces that sees it.
    fn of_faces(&self, atlas: &Atlas, by_chart: &BTreeMap<u32, Vec<(u32, u32)>>) -> BTreeMap<u32, u32> {
        let scene = self.caster.scene();
        let is_without = |chart: &u32| by_chart.get(chart).is_some_and(Vec::is_empty);
        let faces: Vec<(u32, (usize, usize))> =
            atlas.chart.iter().copied().zip(scene.faces()).filter(|(chart, _)| is_without(chart)).collect();
        let of_face = |&(chart, (mesh, triangle)): &(u32, (usize, usize))| {
            let [a, b, c] = scene.corners(mesh, triangle);
            let normal = scene.geometric_normal(mesh, triangle);
            let found = subdivision(STEPS).filter_map(|[u, v, w]| self.nearest(a * u + b * v + c * w, normal));
            Some((chart, found.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?))
        };
        let mut nearest: BTreeMap<u32, (f32, u32)> = BTreeMap::new();
        for (chart, found) in faces.par_iter().filter_map(of_face).collect::<Vec<_>>() {
            let held = nearest.entry(chart).or_insert(found);
            if found.0 < held.0 {
                *held = found;
            }
        }
        nearest.into_iter().map(|(chart, (_, receiver))| (chart, receiver)).collect()
    }

    /// The nearest receiver that a surface point sees, and how far it is, metres; farther if it faces another way.
    fn nearest(&self, position: Vec3, normal: Vec3) -> Option<(f32, u32)> {
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
        near.into_iter().take(ASKED).find(|&(_, receiver)| self.is_open(position, normal, receiver as usize))
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
            let lent = lend(&caster, &atlas, &map, &set, &lone);
            assert_eq!(lent.len(), if is_open { lone.len() } else { 0 });
            assert!(lone.len() > 50);
            for (_, receiver) in lent {
                assert!(set.position[receiver as usize].x > 0.9, "not the nearest");
            }
        }
    }

    #[test]
    fn a_face_that_is_seen_lends_to_the_texel_of_one_that_is_not() {
        // A step of two faces: a tread that is seen, and one below the floor that has the chart's texel.
        let floor = with_uv(plane("floor", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |at| 0.1 + 0.4 * Vec2::new(at.x, at.z));
        let mut step = plane("step", Vec3::new(0.4, 0.02, 0.4), Vec3::X * 0.1, Vec3::Z * 0.1, 1, 1);
        let below = plane("below", Vec3::new(0.4, -0.5, 0.4), Vec3::X * 0.1, Vec3::Z * 0.1, 1, 1);
        let first = step.positions.len() as u32;
        step.positions.extend(&below.positions);
        step.normals.extend(&below.normals);
        step.triangles.extend(below.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
        let step = with_uv(step, |at| if at.y > 0.0 { Vec2::splat(0.8) } else { 0.8 + 0.1 * Vec2::new(at.x, at.z) });
        let scene = scene(vec![floor, step]);
        let (caster, mut atlas) = (RayCaster::new(&scene).unwrap(), Atlas::of(&scene));
        // Joined: one chart.
        let chart = atlas.chart[2];
        atlas.chart[2..].fill(chart);
        let map = texels::cover(&scene, &atlas, 32);
        let set = receivers::place(&scene, &atlas, &caster, 32, &|_, _, _| true).unwrap();
        let on_floor: Vec<usize> = (0..set.len()).filter(|&receiver| set.position[receiver].y == 0.0).collect();
        let set = ReceiverSet {
            position: on_floor.iter().map(|&receiver| set.position[receiver]).collect(),
            geometric_normal: on_floor.iter().map(|&receiver| set.geometric_normal[receiver]).collect(),
            texel: on_floor.iter().map(|&receiver| set.texel[receiver]).collect(),
            ..ReceiverSet::default()
        };
        let lone: Vec<(u32, u32)> =
            map.texels.iter().filter(|texel| texel.mesh == 1).map(|texel| (texel.index, chart)).collect();
        let lent = lend(&caster, &atlas, &map, &set, &lone);
        assert!(!lone.is_empty() && lent.len() == lone.len(), "{lent:?} {lone:?}");
        for (_, receiver) in lent {
            assert!(set.position[receiver as usize].distance(Vec3::new(0.45, 0.02, 0.45)) < 0.15);
        }
    }
}
