//! Rays through the maps: in one probe, and from probe to probe of the cage around the ray.
//!
//! Source: sec. 4.1, Listing 1; where the paper gives no numbers, its supplement.

use super::{geometry::Geometry, polyline, settings::Settings};
use crate::probe_grid::Cage;
use glam::Vec3;

/// What is known of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It meets a surface.
    Hit,
    /// It leaves the scene.
    Miss,
    /// No probe of the cage sees on: taken for a hit of what hides the rest.
    Unknown,
}

/// A traced ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced {
    /// What is known.
    pub answer: Answer,
    /// Distance along the ray of the hit, or up to which it is known, metres.
    pub t: f32,
    /// The probe that answered.
    pub probe: usize,
    /// The texel of it that the ray met, or that hides it.
    pub texel: usize,
    /// Texels that were read.
    pub steps: u32,
    /// Probes that were asked.
    pub probes: u32,
}

/// The probe of a cage to be asked after another one: the farthest that was not.
///
/// Source: sec. 4.1, i' = (i + 3) mod 8.
pub fn next_corner(corner: usize) -> usize {
    (corner + 3) % 8
}

impl Geometry {
    /// Traces a ray; `dir` is unit length.
    pub fn trace(&self, settings: &Settings, origin: Vec3, dir: Vec3) -> Traced {
        self.trace_in_order(settings, origin, dir, next_corner)
    }

    /// The same with another order of probes.
    pub(super) fn trace_in_order(
        &self,
        settings: &Settings,
        origin: Vec3,
        dir: Vec3,
        next: impl Fn(usize) -> usize,
    ) -> Traced {
        let center = self.grid.position(self.grid.size - 1).midpoint(self.grid.low);
        // Past everything, from wherever.
        let end = 2.0 * self.extent_m + origin.distance(center);
        let mut cage = self.grid.cage(origin);
        let mut corner = self.nearest_to_line(&cage, origin, dir);
        let (mut left, mut around_from) = (8, 0.0);
        let mut traced = Traced { answer: Answer::Unknown, t: 0.0, probe: 0, texel: 0, steps: 0, probes: 0 };
        loop {
            traced.probe = self.grid.index(cage.probes()[corner].0);
            traced.probes += 1;
            self.trace_in_probe(settings, [origin, dir], end, &mut traced);
            if traced.answer != Answer::Unknown {
                return traced;
            }
            let reached = self.grid.cage(origin + dir * traced.t);
            if reached.base != cage.base {
                cage = reached;
                corner = self.nearest_to_line(&cage, origin + dir * traced.t, dir);
                (left, around_from) = (8, traced.t);
                continue;
            }
            left -= 1;
            if left == 0 {
                if traced.t - around_from < settings.least_progress_m {
                    return traced;
                }
                (left, around_from) = (8, traced.t);
            }
            corner = next(corner);
        }
    }

    /// The probe of a cage that is nearest to the line that holds the ray.
    fn nearest_to_line(&self, cage: &Cage, origin: Vec3, dir: Vec3) -> usize {
        let away = cage.probes().map(|(at, _)| (self.grid.position(at) - origin).cross(dir).length_squared());
        (0..8).fold(0, |nearest, corner| if away[corner] < away[nearest] { corner } else { nearest })
    }

    /// Traces a ray in the maps of `traced.probe` from `traced.t` on.
    fn trace_in_probe(&self, settings: &Settings, [origin, dir]: [Vec3; 2], end: f32, traced: &mut Traced) {
        let (side, coarse, probe) = (self.map.side, settings.coarse, traced.probe);
        let distances = &self.distances[probe * self.texels()..][..self.texels()];
        let blocks = side / coarse;
        let least = &self.least[probe * blocks * blocks..][..blocks * blocks];
        let origin = origin - self.grid.position(self.grid.at(probe));
        let from = traced.t;
        for segment in polyline::segments(origin, dir, [from, end], side) {
            let mut march = segment.march(side);
            let radius = |share: f32| (origin + dir * segment.time(share)).length();
            let mut goes_on = true;
            while goes_on {
                let block = march.cell / coarse as i32;
                if coarse > 1 {
                    traced.steps += 1;
                    let exit = march.exit(coarse);
                    // Distance from a point along a line is greatest at one of the ends.
                    let farthest = radius(march.entered).max(radius(exit.share));
                    if farthest < least[block.y as usize * blocks + block.x as usize] {
                        goes_on = march.advance(&exit);
                        continue;
                    }
                }
                while goes_on && march.cell / coarse as i32 == block {
                    traced.steps += 1;
                    let exit = march.exit(1);
                    let texel = march.cell.y as usize * side + march.cell.x as usize;
                    let ends = [march.entered, exit.share];
                    let [before, after] = ends.map(radius);
                    if before.max(after) >= distances[texel] {
                        let [before_t, middle_t] =
                            [ends[0], 0.5 * (ends[0] + ends[1])].map(|share| segment.time(share));
                        let to_ray = (origin + dir * middle_t).normalize_or(dir);
                        // The probe's measure along the ray: finer than the step.
                        let along = (to_ray * distances[texel] - origin).dot(dir);
                        let is_hit = self.is_hit(settings, [probe, texel], before.min(after), [dir, to_ray], along);
                        traced.answer = if is_hit { Answer::Hit } else { Answer::Unknown };
                        // Not farther than where it went out of sight, and not back.
                        traced.t = if is_hit { along.max(0.0) } else { from.max(along.min(before_t)) };
                        traced.texel = texel;
                        return;
                    }
                    goes_on = march.advance(&exit);
                }
            }
        }
        (traced.answer, traced.t) = (Answer::Miss, end);
    }

    /// Whether a ray that is not in front of a texel all the way meets its surface, and is not only hidden by it: it comes against the
    /// normal, and goes behind it by less than its thickness.
    ///
    /// The thickness grows from the least with the distance along the ray, where ray and view of the probe run alike, and at grazing
    /// incidence. Behind a black back there is none: what is there is free space, see the head of the folder.
    fn is_hit(
        &self,
        settings: &Settings,
        [probe, texel]: [usize; 2],
        nearest: f32,
        [dir, to_ray]: [Vec3; 2],
        along: f32,
    ) -> bool {
        let at = probe * self.texels() + texel;
        let (distance, facing) = (self.distances[at], self.normals[at].dot(dir));
        let thickness = if self.is_back(probe, texel) {
            0.0
        } else {
            let grown = dir.dot(to_ray).max(0.0) * (2.0 - facing.abs()) * (0.1 * along).clamp(0.05, 1.0);
            settings.least_thickness_m + (settings.most_thickness_m - settings.least_thickness_m) * grown
        };
        facing < 0.0 && nearest < distance + thickness
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{furnace, in_world};
    use crate::{Setup, World};
    use localprt_scenes::{Lighting, Scene, builtin};

    fn of(scene: &Scene, probes: usize, test: impl FnOnce(&World<'_>, &Geometry, &Settings)) {
        let settings = Settings { side: 64, ..Settings::PAPER };
        in_world(scene, &Lighting::default(), |world| {
            let setup = Setup { probes, cameras: &[], seed: 0 };
            test(world, &Geometry::new(world, &setup, &settings), &settings);
        });
    }

    #[test]
    fn thickness_is_that_of_the_supplement_and_counts_against_the_normal_alone() {
        of(&furnace(0.5, 1.0), 8, |_, geometry, settings| {
            // A texel of the middle of a wall, and a ray straight onto it, in line with the probe: at 1 m of its way a tenth of the most.
            let texel = (0..geometry.texels()).find(|&texel| geometry.dir(texel).x > 0.99).expect("a texel");
            let (into, distance) = (Vec3::X, geometry.distances[texel]);
            let is_hit = |beyond: f32, dir: Vec3, to_ray: Vec3, along: f32| {
                geometry.is_hit(settings, [0, texel], distance + beyond, [dir, to_ray], along)
            };
            let thickness = 0.03 + 0.47 * 0.1;
            assert!(is_hit(thickness - 1e-3, into, into, 1.0) && !is_hit(thickness + 1e-3, into, into, 1.0));
            // Far along the ray all of it, across the view of the probe the least.
            assert!(is_hit(0.499, into, into, 100.0) && !is_hit(0.501, into, into, 100.0));
            assert!(is_hit(0.029, into, Vec3::Y, 100.0) && !is_hit(0.031, into, Vec3::Y, 100.0));
            // Out of the wall it is none.
            assert!(!is_hit(0.0, -into, into, 1.0));
        });
    }

    #[test]
    fn rays_ask_the_cages_that_they_come_to() {
        let scene = builtin::scene("cornell").expect("a scene");
        of(&scene, 64, |_, geometry, settings| {
            // Low over the floor, across the blocks, where the nearest probes are covered.
            let elsewhere = (0..400).filter(|&ray| {
                let origin = Vec3::new(-0.95, 0.02 + 0.002 * ray as f32, 0.9 - 0.003 * ray as f32);
                let dir = Vec3::new(1.0, 0.0, 0.1 - 0.002 * ray as f32).normalize();
                let own = geometry.grid.cage(origin).probes().map(|(at, _)| geometry.grid.index(at));
                !own.contains(&geometry.trace(settings, origin, dir).probe)
            });
            assert!(elsewhere.count() > 10);
        });
    }

    #[test]
    fn a_ray_that_gets_on_goes_around_a_cage_again() {
        let scene = builtin::scene("cornell").expect("a scene");
        of(&scene, 8, |world, geometry, settings| {
            assert!(geometry.grid.len() == 8 && world.lighting().lights.is_empty());
            let most = |least_progress_m: f32| {
                let settings = Settings { least_progress_m, ..*settings };
                let traced = (0..4000).map(|ray| {
                    let dir = Vec3::from(localprt_formats::directions::spherical_fibonacci(ray, 4000));
                    geometry.trace(&settings, Vec3::new(0.1, 0.3, -0.75), dir).probes
                });
                traced.max().expect("rays")
            };
            // One cage: eight probes, unless a ray gets on.
            assert!(most(f32::INFINITY) == 8 && most(0.01) > 8);
        });
    }
}
