//! A ray as a polyline in a probe's octahedral map: at most four straight segments, one per octant around the probe, and the way along
//! each from texel to texel.
//!
//! Source: sec. 4.1 and Listing 1; Amanatides and Woo 1987 for the way.

use glam::{IVec2, Vec2, Vec3};

/// The part of a ray in one octant: a straight line in the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Where it begins, texels.
    start: Vec2,
    /// From there to its end, texels.
    way: Vec2,
    /// Sums of absolute coordinates at both ends, for the perspective.
    norms: [f32; 2],
    /// Distances along the ray of both ends.
    times: [f32; 2],
}

/// Segments of a ray, given from the probe's place, between two distances along it, in a map of so many texels.
pub(super) fn segments(origin: Vec3, dir: Vec3, [first, last]: [f32; 2], side: usize) -> impl Iterator<Item = Segment> {
    // Where it crosses the planes through the probe; never, where it runs along one.
    let crossing = |axis: usize| if dir[axis] == 0.0 { last } else { (-origin[axis] / dir[axis]).clamp(first, last) };
    let mut times = [first, crossing(0), crossing(1), crossing(2), last];
    times[1..4].sort_by(f32::total_cmp);
    (0..4).filter(move |&part| times[part] < times[part + 1]).map(move |part| {
        let ends = [times[part], times[part + 1]];
        let middle = origin + dir * (0.5 * (ends[0] + ends[1]));
        // The octant is known, so the ends, which lie on its faces, have one place: no need to shorten the segment.
        let octant = Vec3::ONE.copysign(middle);
        let [low, high] = ends.map(|time| Placed::of(origin + dir * time, octant, side));
        let middle = Placed::of(middle, octant, side);
        let [from, to] = [low, high].map(|end| if end.norm > 0.0 { end.place } else { middle.place });
        Segment { start: from, way: to - from, norms: [low.norm, high.norm], times: ends }
    })
}

#[derive(Clone, Copy)]
struct Placed {
    place: Vec2,
    norm: f32,
}

impl Placed {
    /// The octahedral mapping of a point that is held to an octant.
    fn of(point: Vec3, octant: Vec3, side: usize) -> Self {
        let inside = (point * octant).max(Vec3::ZERO);
        let norm = inside.element_sum();
        let flat = inside.truncate() / norm;
        let flat = if octant.z > 0.0 { flat } else { 1.0 - Vec2::new(flat.y, flat.x) };
        Self { place: (flat * octant.truncate() + 1.0) * (0.5 * side as f32), norm }
    }
}

impl Segment {
    /// Distance along the ray at a share of the way in the map.
    pub(super) fn time(&self, share: f32) -> f32 {
        let [near, far] = self.norms;
        let weight = (1.0 - share) * far + share * near;
        let along = if weight > 0.0 { share * near / weight } else { share };
        self.times[0] + (self.times[1] - self.times[0]) * along
    }

    /// The way along it.
    pub(super) fn march(self, side: usize) -> March {
        let cell = self.start.floor().as_ivec2().clamp(IVec2::ZERO, IVec2::splat(side as i32 - 1));
        March { segment: self, side: side as i32, cell, entered: 0.0 }
    }
}

/// A walk over all texels that a segment touches.
#[derive(Clone, Copy, Debug)]
pub(super) struct March {
    /// The segment.
    pub(super) segment: Segment,
    side: i32,
    /// The texel that it is in.
    pub(super) cell: IVec2,
    /// Share of the way at which it came into it.
    pub(super) entered: f32,
}

/// Where a walk leaves a square of texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exit {
    /// Share of the way.
    pub(super) share: f32,
    axis: usize,
    line: i32,
}

impl March {
    /// Where it leaves the aligned square of `size` texels per side that it is in.
    pub(super) fn exit(&self, size: usize) -> Exit {
        let [x, y] = [0, 1].map(|axis| self.crossing(axis, size as i32));
        let (axis, (share, line)) = if x.0 <= y.0 { (0, x) } else { (1, y) };
        Exit { share: share.clamp(self.entered, 1.0), axis, line }
    }

    /// Goes on behind an exit; false at the end of the segment.
    ///
    /// Lines are crossed at the same shares whatever the size of the square, so squares leave out no texel and add none.
    pub(super) fn advance(&mut self, exit: &Exit) -> bool {
        if exit.share >= 1.0 {
            return false;
        }
        let forward = |axis: usize| self.segment.way[axis] > 0.0;
        let other = 1 - exit.axis;
        self.cell[exit.axis] = if forward(exit.axis) { exit.line } else { exit.line - 1 };
        let step = if forward(other) { 1 } else { -1 };
        loop {
            // Of two lines at the same share that across x is first.
            let (share, _) = self.crossing(other, 1);
            let is_behind = if other == 0 { share <= exit.share } else { share < exit.share };
            if !is_behind {
                break;
            }
            self.cell[other] += step;
            if !(0..self.side).contains(&self.cell[other]) {
                return false;
            }
        }
        self.entered = exit.share;
        (0..self.side).contains(&self.cell[exit.axis])
    }

    /// Share and line at which it leaves, along one axis, the aligned square of so many texels per side.
    fn crossing(&self, axis: usize, size: i32) -> (f32, i32) {
        let (way, block) = (self.segment.way[axis], self.cell[axis] / size);
        if way == 0.0 {
            return (f32::INFINITY, 0);
        }
        let line = if way > 0.0 { (block + 1) * size } else { block * size };
        ((line as f32 - self.segment.start[axis]) / way, line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octahedral::encode;
    use localprt_formats::directions::counter_uniform;

    const SIDE: usize = 64;

    fn ray(number: u64) -> (Vec3, Vec3) {
        let random = |k| counter_uniform(3, number, k) as f32 * 2.0 - 1.0;
        let origin = Vec3::new(random(0), random(1), random(2)) * 3.0;
        (origin, Vec3::new(random(3), random(4), random(5)).normalize())
    }

    #[test]
    fn points_of_a_ray_lie_on_its_polyline() {
        for number in 0..500 {
            let (origin, dir) = ray(number);
            let parts: Vec<Segment> = segments(origin, dir, [0.0, 20.0], SIDE).collect();
            assert!((1..=4).contains(&parts.len()));
            assert_eq!((parts[0].times[0], parts[parts.len() - 1].times[1]), (0.0, 20.0));
            for part in &parts {
                for share in [0.05f32, 0.3, 0.5, 0.9] {
                    let point = origin + dir * part.time(share);
                    let place = (encode(point.normalize()) + 1.0) * (0.5 * SIDE as f32);
                    // Roundings of coordinates up to 20 m a centimetre from the probe: 1e-4 of a map of 64 texels. A segment that
                    // was taken across octants, or time without perspective, would be off by texels.
                    let found = part.start + part.way * share;
                    assert!(place.distance(found) < 0.02, "{number} {share}: {place} {found}");
                }
            }
        }
    }

    #[test]
    fn a_ray_through_the_probe_stays_in_two_texels() {
        let dir = Vec3::new(0.3, -0.5, 0.8).normalize();
        let cells: Vec<IVec2> = segments(-2.0 * dir, dir, [0.0, 5.0], SIDE)
            .flat_map(|part| {
                let mut march = part.march(SIDE);
                let mut cells = vec![march.cell];
                while march.advance(&march.exit(1)) {
                    cells.push(march.cell);
                }
                cells
            })
            .collect();
        let place = |dir: Vec3| ((encode(dir) + 1.0) * (0.5 * SIDE as f32)).as_ivec2();
        assert_eq!((cells.first(), cells.last()), (Some(&place(-dir)), Some(&place(dir))));
    }

    #[test]
    fn large_squares_lead_to_texels_that_small_steps_visit_too() {
        for number in 0..500 {
            let (origin, dir) = ray(number);
            for part in segments(origin, dir, [0.0, 20.0], SIDE) {
                let mut march = part.march(SIDE);
                let mut visited = vec![(march.cell, march.entered)];
                while march.advance(&march.exit(1)) {
                    assert!((march.cell - visited[visited.len() - 1].0).abs().element_sum() == 1, "neighbors");
                    visited.push((march.cell, march.entered));
                }
                let mut leaps = part.march(SIDE);
                while leaps.advance(&leaps.exit(16)) {
                    // To the bit: otherwise two levels could answer otherwise than one.
                    assert!(visited.contains(&(leaps.cell, leaps.entered)), "{number}: {:?}", leaps.cell);
                }
            }
        }
    }
}
