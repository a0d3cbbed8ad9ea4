//! Moves probes out of walls and away from surfaces close by (sec. 5, Fig. 8).

use crate::irradiance_probes::first_hit;
use crate::{Object, World};
use glam::Vec3;

/// A probe that sees more than this share of backs is inside of something.
const INSIDE: f32 = 0.25;
/// How far a probe may be from its place on the grid along each axis, in spacings.
///
/// Source: RTXGI; the paper names the limit and gives no number.
const LIMIT: f32 = 0.45;
/// Kept from the limit, as a share of the way to the back: Fig. 8 subtracts it from a factor, and calls it "millimeter scale".
const EPSILON: f32 = 1e-3;
/// Length of a step away from surfaces, and how close a surface is to cause one, in least spacings.
///
/// Differs from the paper: Fig. 8 steps 0.2 m whatever the spacing, and from every probe that sees two sides. Its text moves those with
/// close front faces; so does this.
const STEP: f32 = 0.2;
/// Front faces within this cosine of one another are one surface (Fig. 8).
const ONE_SURFACE: f32 = 0.5;

/// What a probe's rays find of the surfaces around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    rays: usize,
    backs: usize,
    /// To the closest back, not of unit length.
    closest_back: Option<Vec3>,
    /// Distance and direction of the closest and of the farthest front.
    closest_front: Option<(f32, Vec3)>,
    farthest_front: Option<(f32, Vec3)>,
    /// A front is in the cells around the probe's place on the grid: it may be lit by the probe.
    pub lights_surface: bool,
}

impl Sight {
    /// From a probe at `place` on the grid and `offset` from it. Surfaces in `objects` are not seen: probes stay where they are when
    /// things move.
    ///
    /// Differs from the paper: whether a surface is near is asked per axis, not by distance, since a point can be in a probe's cells at
    /// 1.7 spacings from it.
    pub fn of(
        world: &World<'_>,
        (place, offset): (Vec3, Vec3),
        spacing: Vec3,
        dirs: &[Vec3],
        objects: &[Object],
    ) -> Self {
        let mut sight = Self {
            rays: dirs.len(),
            backs: 0,
            closest_back: None,
            closest_front: None,
            farthest_front: None,
            lights_surface: false,
        };
        for &dir in dirs {
            let moves = |position| objects.iter().any(|object| object.holds(position, Vec3::ZERO));
            let Some(hit) = first_hit(world, place + offset, dir, |hit| moves(hit.position)) else { continue };
            if hit.point.is_none() {
                sight.backs += 1;
                if sight.closest_back.is_none_or(|closest| hit.t < closest.length()) {
                    sight.closest_back = Some(dir * hit.t);
                }
                continue;
            }
            if sight.closest_front.is_none_or(|closest| hit.t < closest.0) {
                sight.closest_front = Some((hit.t, dir));
            }
            if sight.farthest_front.is_none_or(|farthest| hit.t > farthest.0) {
                sight.farthest_front = Some((hit.t, dir));
            }
            sight.lights_surface |= (hit.position - place).abs().cmplt(spacing).all();
        }
        sight
    }

    /// Whether the probe is inside of something.
    pub fn is_inside(&self) -> bool {
        self.backs as f32 > INSIDE * self.rays as f32
    }

    /// The next offset of the probe: through the closest back as far as it may, or a step away from a close front.
    ///
    /// Differs from the paper: Fig. 8 does not hold the second kind of step within the limit; here such a step is not made.
    ///
    /// Source: Fig. 8.
    pub fn moved(&self, offset: Vec3, spacing: Vec3) -> Vec3 {
        let limit = spacing * LIMIT;
        if self.is_inside() {
            let Some(back) = self.closest_back else { return offset };
            // How often the way to the back fits in until the limit of some axis.
            let fits = |axis: usize| {
                let room = limit[axis] - offset[axis] * back[axis].signum();
                if back[axis] == 0.0 { f32::INFINITY } else { room / back[axis].abs() }
            };
            let scale = fits(0).min(fits(1)).min(fits(2)) - EPSILON;
            return if scale > 1.0 { offset + back * scale } else { offset };
        }
        let (Some((near, near_dir)), Some((far, far_dir))) = (self.closest_front, self.farthest_front) else {
            return offset;
        };
        let step = STEP * spacing.min_element();
        let moved = offset + far_dir * step.min(far);
        let is_due = near < step && far_dir.dot(near_dir) <= ONE_SURFACE;
        if is_due && moved.abs().cmple(limit).all() { moved } else { offset }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(backs: usize) -> Sight {
        Sight {
            rays: 100,
            backs,
            closest_back: Some(Vec3::new(0.1, 0.0, 0.05)),
            closest_front: Some((0.05, Vec3::NEG_X)),
            farthest_front: Some((3.0, Vec3::Z)),
            lights_surface: true,
        }
    }

    #[test]
    fn a_probe_inside_goes_through_the_closest_back_to_its_limit() {
        // x allows 0.45 / 0.1 = 4.5 times the way, z 9 times.
        let moved = sight(26).moved(Vec3::ZERO, Vec3::ONE);
        assert!(moved.distance(Vec3::new(0.1, 0.0, 0.05) * 4.499) < 1e-6, "{moved}");
        // A quarter of backs is not inside: a step away from what is close.
        assert!(sight(25).moved(Vec3::ZERO, Vec3::ONE).distance(Vec3::Z * 0.2) < 1e-6);
    }

    #[test]
    fn a_probe_that_cannot_leave_stays() {
        // Only 0.05 is left along x.
        let offset = Vec3::X * 0.4;
        assert_eq!(sight(80).moved(offset, Vec3::ONE), offset);
        // Backwards there would be room.
        let back = Some(Vec3::new(-0.1, 0.0, 0.0));
        assert!(Sight { closest_back: back, ..sight(80) }.moved(offset, Vec3::ONE).x < -0.4);
    }

    #[test]
    fn a_step_is_made_from_close_surfaces_alone_and_never_beyond_the_limit() {
        let free = Sight { closest_front: Some((0.3, Vec3::NEG_X)), ..sight(0) };
        assert_eq!(free.moved(Vec3::ZERO, Vec3::ONE), Vec3::ZERO);
        // One surface: farthest and closest lie the same way.
        let flat = Sight { farthest_front: Some((3.0, Vec3::new(-0.8, 0.6, 0.0))), ..sight(0) };
        assert_eq!(flat.moved(Vec3::ZERO, Vec3::ONE), Vec3::ZERO);
        assert_eq!(sight(0).moved(Vec3::Z * 0.3, Vec3::ONE), Vec3::Z * 0.3);
    }
}
