//! How much a probe of the cage counts for a point.
//!
//! Source: the DDGI evaluation, sec. 3.4.1, for what there is; the code of Majercik et al. 2019 for formulas and numbers.

use glam::{Vec2, Vec3};

/// Added to the square of the wrapped cosine, so that probes behind a surface count a little: small things have normals that would
/// rule out every probe.
const WRAP_FLOOR: f32 = 0.2;
/// Weights below this are crushed.
const CRUSH_BELOW: f32 = 0.2;
/// No weight is less than this before it is crushed: a point that no probe sees still has the light of those that miss it least.
const LEAST: f32 = 1e-6;

/// The weights of a query, each to be switched off (the evaluation's Fig. 7 applies them one after another).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weights {
    /// Smooth back face weight: probes behind the surface count less.
    pub wrap: bool,
    /// Visibility by the moments of distance.
    pub chebyshev: bool,
    /// Small weights are crushed: a little light is well seen in the dark.
    pub crush: bool,
    /// Trilinear weight of the place between probes.
    pub trilinear: bool,
}

impl Default for Weights {
    fn default() -> Self {
        Self { wrap: true, chebyshev: true, crush: true, trilinear: true }
    }
}

impl Weights {
    /// No weight: the plain mean over the cage.
    pub const NONE: Self = Self { wrap: false, chebyshev: false, crush: false, trilinear: false };

    /// Weight of a probe for a surface point. `tested` is the point, moved by the bias, whose visibility is asked for; `moments` are
    /// the probe's in a direction, and asked for that one only.
    pub fn of_probe(
        self,
        probe: Vec3,
        (point, normal): (Vec3, Vec3),
        tested: Vec3,
        moments: impl Fn(Vec3) -> Vec2,
        trilinear: f32,
    ) -> f32 {
        let mut weight = 1.0;
        if self.wrap {
            weight *= wrap((probe - point).normalize_or_zero().dot(normal));
        }
        if self.chebyshev {
            let from_probe = tested - probe;
            let distance = from_probe.length();
            if distance > 0.0 {
                weight *= chebyshev(moments(from_probe / distance), distance);
            }
        }
        weight = weight.max(LEAST);
        if self.crush {
            weight = crush(weight);
        }
        if self.trilinear { weight * trilinear } else { weight }
    }
}

/// Smooth back face weight of the cosine between the normal and the direction to the probe: `((c + 1) / 2)^2 + 0.2`.
pub fn wrap(cosine: f32) -> f32 {
    let wrapped = (cosine + 1.0) * 0.5;
    wrapped * wrapped + WRAP_FLOOR
}

/// Share of a probe's lobe that reaches a distance at least, by its moments, cubed for contrast. 1 up to the mean.
///
/// Source: Donnelly and Lauritzen 2006, Variance Shadow Maps, Eq. (5).
pub fn chebyshev(moments: Vec2, distance: f32) -> f32 {
    if distance <= moments.x {
        return 1.0;
    }
    let variance = (moments.y - moments.x * moments.x).abs();
    let beyond = distance - moments.x;
    (variance / (variance + beyond * beyond)).powi(3)
}

/// Crushes small weights and keeps the curve continuous: `w^3 / 0.2^2` below 0.2.
pub fn crush(weight: f32) -> f32 {
    if weight < CRUSH_BELOW { weight.powi(3) / (CRUSH_BELOW * CRUSH_BELOW) } else { weight }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probe_behind_the_surface_counts_least() {
        assert_eq!([wrap(1.0), wrap(0.0), wrap(-1.0)], [1.2, 0.45, 0.2]);
    }

    #[test]
    fn what_lies_behind_the_mean_is_seen_by_the_share_that_chebyshev_allows() {
        // Half of a lobe ends at 1 m, half at 3 m: mean 2, variance 1.
        let moments = Vec2::new(2.0, 5.0);
        assert_eq!(chebyshev(moments, 1.5), 1.0);
        assert_eq!(chebyshev(moments, 2.0), 1.0);
        assert_eq!(chebyshev(moments, 3.0), 0.125);
        // A flat wall lets nothing through.
        assert_eq!(chebyshev(Vec2::new(2.0, 4.0), 2.001), 0.0);
    }

    #[test]
    fn crushing_is_continuous_and_leaves_large_weights() {
        assert_eq!(crush(0.7), 0.7);
        // Rounding alone.
        assert!((crush(0.199_999) - 0.2).abs() < 1e-5);
        assert!((crush(0.02) - 2e-4).abs() < 1e-9);
    }

    #[test]
    fn each_weight_can_be_switched_off() {
        let weigh = |weights: Weights| {
            // A probe 2 m above the point, whose view ends after 1 m.
            weights.of_probe(Vec3::Y * 2.0, (Vec3::ZERO, Vec3::Y), Vec3::Y * 0.1, |_| Vec2::new(1.0, 1.1), 0.25)
        };
        let visibility = (0.1f32 / (0.1 + 0.9 * 0.9)).powi(3);
        let crushed = (1.2 * visibility).powi(3) / 0.04 * 0.25;
        // A few roundings.
        let close = |a: f32, b: f32| assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
        close(weigh(Weights::default()), crushed);
        close(weigh(Weights { wrap: false, ..Weights::default() }), crushed / 1.2f32.powi(3));
        close(weigh(Weights { crush: false, ..Weights::default() }), 1.2 * visibility * 0.25);
        close(weigh(Weights { chebyshev: false, ..Weights::default() }), 1.2 * 0.25);
        close(weigh(Weights { trilinear: false, ..Weights::default() }), crushed * 4.0);
        assert_eq!(weigh(Weights::NONE), 1.0);
    }
}
