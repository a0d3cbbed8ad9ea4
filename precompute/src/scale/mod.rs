//! Local scale: how far light may vary little around a surface point.
//!
//! R(x) is the harmonic mean of the distances that rays from x meet (Ward, Rubinstein and Clear 1988), no larger than at any
//! other sample plus the way to it (neighbor clamping, Křivánek et al. 2006). It is measured once, on few samples of the
//! surfaces ([`measure`]), and defined everywhere by the same rule:
//!
//! ```text
//! R(x) = min over samples i of R_i + |x - p_i|
//! ```
//!
//! so it grows no faster than distance, in the open as on surfaces. Densities of receivers and probes, their radii, and where
//! large faces are cut follow it. With [`LocalScale::uniform`] all of them are even.
//!
//! Between samples a distance t apart, light that varies over R is off by about (t / R)² of itself. Of all ways to spend a number of
//! samples, ∫ t^-2 dA, the sum of squared errors that are seen, ∫ W (t / R)^4 dA, is least where
//!
//! ```text
//! t^6 ~ R^4 / W                                                                    (S1)
//! ```
//!
//! W being how much is seen of an area ([`importance`]). Texels and the distances between probes follow it; where large faces are cut
//! goes with R alone.

mod importance;
mod samples;
mod tree;

pub use importance::importance;
pub use samples::measure;

use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use localprt_scenes::Scene;
use tree::Tree;

/// Coarsest over finest texel.
pub const RANGE: f32 = 64.0;
/// Powers of R and W that texels go with (S1).
const POWERS: [f32; 2] = [4.0 / 6.0, -1.0 / 6.0];
/// The finest scale that texels, and that probes follow: where this share of all detail, the sum of area over R, is finer. Below are
/// crevices that hardly anybody sees into.
const FINEST_SHARE: [f64; 2] = [0.1, 0.5];
/// Probes are spread evenly where the scale is less than this many times the finest that they follow: across a room, more of them
/// in its corners take more from its middle than they give.
const EVEN: f32 = 4.0;
/// Hits that every face has beside those that it got.
pub const LEAST_SEEN: f64 = 0.1;
/// Texels are this many times finer within a focus, and probes as much closer.
const FOCUS: f32 = 2.0;

/// A surface point and its harmonic mean distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// World position, metres.
    pub position: Vec3,
    /// Unit normal on the side that was measured.
    pub normal: Vec3,
    /// Harmonic mean of the distances to what its rays meet, metres; infinite where they meet nothing.
    pub scale_m: f32,
    /// Area that it stands for, square metres.
    pub area_m2: f32,
    /// The face that it lies on.
    pub face: u32,
    /// W: how often its face is seen, per square metre; 1 before anybody has looked.
    pub seen: f32,
}

/// A place that gets more than its share: a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// Middle, metres.
    pub center: Vec3,
    /// Radius, metres.
    pub radius_m: f32,
}

/// R everywhere, metres.
#[derive(Clone, Debug)]
pub struct LocalScale {
    samples: Vec<Sample>,
    tree: Option<Tree>,
    focus: Vec<Focus>,
    /// Finest scale for texels, metres.
    finest_m: f32,
    /// Finest scale for probes, metres.
    finest_of_probes_m: f32,
}

impl LocalScale {
    /// The same scale everywhere: even densities.
    pub fn uniform() -> Self {
        Self { samples: Vec::new(), tree: None, focus: Vec::new(), finest_m: 1.0, finest_of_probes_m: 1.0 }
    }

    /// Of samples; `extent_m` is the diagonal of the scene box.
    pub fn of(samples: Vec<Sample>, extent_m: f32, focus: Vec<Focus>) -> Self {
        let points = samples.iter().map(|sample| (sample.position, sample.scale_m.min(extent_m))).collect();
        let Some(tree) = Tree::new(points) else { return Self::uniform() };
        let mut scale = Self { samples, tree: Some(tree), focus, finest_m: 1.0, finest_of_probes_m: 1.0 };
        [scale.finest_m, scale.finest_of_probes_m] = FINEST_SHARE.map(|share| scale.quantile(share, extent_m));
        scale
    }

    /// Takes in how often each face of the scene is seen.
    pub fn look(&mut self, scene: &Scene, hits: &[u32]) {
        let seen: Vec<f32> = scene
            .faces()
            .zip(hits)
            .map(|((mesh, triangle), &hits)| {
                ((f64::from(hits) + LEAST_SEEN) / scene.area_m2(mesh, triangle).max(f64::MIN_POSITIVE)) as f32
            })
            .collect();
        for sample in &mut self.samples {
            sample.seen = seen.get(sample.face as usize).copied().unwrap_or(1.0);
        }
        self.finest_of_probes_m = self.quantile(FINEST_SHARE[1], scene.extent());
    }

    /// The scale below which this share of all detail that is seen lies.
    fn quantile(&self, share: f64, extent_m: f32) -> f32 {
        let scales = self.samples.iter().map(|sample| {
            let scale_m = self.at(sample.position);
            let detail = f64::from(sample.area_m2) / f64::from(scale_m.max(f32::MIN_POSITIVE));
            (scale_m, detail * f64::from(sample.seen))
        });
        weighted_quantile(scales, share).unwrap_or(extent_m).max(f32::MIN_POSITIVE)
    }

    /// Whether it is the same everywhere.
    pub fn is_uniform(&self) -> bool {
        self.tree.is_none()
    }

    /// Where it was measured.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// R at a place, metres.
    pub fn at(&self, position: Vec3) -> f32 {
        self.tree.as_ref().map_or(1.0, |tree| tree.scale(position))
    }

    /// R at a place, metres, but not below the finest scale of texels; lower within a focus.
    pub fn of_texels(&self, position: Vec3) -> f32 {
        self.not_below(self.finest_m, position)
    }

    /// R at a place, metres, but not below the finest scale of probes; lower within a focus. Where this differs much, charts are cut.
    pub fn of_charts(&self, position: Vec3) -> f32 {
        self.not_below(self.finest_of_probes_m, position)
    }

    fn not_below(&self, least_m: f32, position: Vec3) -> f32 {
        self.at(position).max(least_m) / self.focus(position).powf(1.0 / POWERS[0])
    }

    /// What the edge of a texel is in proportion to (S1), where the scale is `scale_m` and people see `seen` of each area.
    pub fn texel(&self, scale_m: f32, seen: f32) -> f32 {
        if self.is_uniform() { 1.0 } else { scale_m.powf(POWERS[0]) * seen.powf(POWERS[1]) }
    }

    /// What the distance between probes near a sample is in proportion to (S1), less within a focus. Of `samples` by index.
    pub fn spacing(&self, index: usize) -> f32 {
        let sample = &self.samples[index];
        let scale_m = self.at(sample.position).max(EVEN * self.finest_of_probes_m);
        scale_m.powf(POWERS[0]) * sample.seen.powf(POWERS[1]) / self.focus(sample.position)
    }

    /// How much finer a focus makes texels: fading over its own radius.
    fn focus(&self, position: Vec3) -> f32 {
        let within = |focus: &Focus| {
            let beyond = position.distance(focus.center) / focus.radius_m - 1.0;
            FOCUS + (1.0 - FOCUS) * beyond.clamp(0.0, 1.0)
        };
        self.focus.iter().map(within).fold(1.0, f32::max)
    }

    /// Finest scale for texels, metres.
    pub fn finest_m(&self) -> f32 {
        self.finest_m
    }

    /// Finest scale for probes, metres.
    pub fn finest_of_probes_m(&self) -> f32 {
        self.finest_of_probes_m
    }
}

/// The smallest value that this share of all weight does not exceed; `None` of nothing.
pub(crate) fn weighted_quantile(values: impl Iterator<Item = (f32, f64)>, share: f64) -> Option<f32> {
    let mut sorted: Vec<(f32, f64)> = values.collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = sorted.iter().map(|value| value.1).sum();
    let mut sum = 0.0;
    let found = sorted.iter().find(|value| {
        sum += value.1;
        sum >= share * total
    });
    found.or(sorted.last()).map(|value| value.0)
}

/// Rays of a sample.
const RAYS: u32 = 64;

/// Local directions of the rays that measure a surface point, cosine-weighted.
fn rays() -> Vec<Vec3> {
    (0..RAYS).map(|ray| Vec3::from(cosine_hemisphere(fibonacci_square(ray, RAYS, [0.0; 2]))).normalize()).collect()
}

/// Harmonic mean; what is infinitely far adds nothing to the sum.
fn harmonic_mean(distances: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = distances.fold((0.0f64, 0u32), |(sum, count), distance| {
        (sum + 1.0 / f64::from(distance.max(f32::MIN_POSITIVE)), count + 1)
    });
    if sum > 0.0 { (f64::from(count) / sum) as f32 } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::RayCaster;

    #[test]
    fn the_harmonic_mean_counts_what_is_infinitely_far() {
        assert_eq!(harmonic_mean([1.0, f32::INFINITY].into_iter()), 2.0);
        assert!(harmonic_mean([f32::INFINITY].into_iter()).is_infinite());
        assert!((harmonic_mean([1.0, 2.0, 4.0].into_iter()) - 12.0 / 7.0).abs() < 1e-6);
    }

    #[test]
    fn quantiles_count_weight() {
        let values = [(3.0, 1.0), (1.0, 8.0), (2.0, 1.0)];
        let at = |share| weighted_quantile(values.into_iter(), share);
        assert_eq!([0.0, 0.8, 0.85, 0.95, 1.0].map(at), [1.0, 1.0, 2.0, 3.0, 3.0].map(Some));
        assert_eq!(weighted_quantile(std::iter::empty(), 0.5), None);
    }

    #[test]
    fn scale_grows_no_faster_than_distance() {
        let scene = localprt_scenes::builtin::scene("cornell").unwrap();
        let caster = RayCaster::new(&scene).unwrap();
        let scale = LocalScale::of(measure(&caster, 4000), scene.extent(), Vec::new());
        assert!(scale.finest_m > 0.01 && scale.finest_m < scale.finest_of_probes_m, "{}", scale.finest_m);
        let at = |x: f32| Vec3::new(x, 0.7 + 0.1 * x, 0.3);
        for step in 0..100 {
            let (a, b) = (at(-0.9 + 0.018 * step as f32), at(-0.9 + 0.018 * (step + 1) as f32));
            assert!((scale.at(a) - scale.at(b)).abs() <= a.distance(b) * 1.0001 + 1e-6);
            assert!(scale.of_texels(a) >= scale.finest_m);
        }
        let area: f32 = scale.samples().iter().map(|sample| sample.area_m2).sum();
        let whole: f64 = scene.faces().map(|(mesh, triangle)| scene.area_m2(mesh, triangle)).sum();
        assert!((area / whole as f32 - 1.0).abs() < 1e-3, "{area} of {whole}");
    }

    #[test]
    fn a_focus_halves_texels_and_spacings_and_fades() {
        let sample = Sample { position: Vec3::ZERO, normal: Vec3::Y, scale_m: 1.0, area_m2: 1.0, face: 0, seen: 1.0 };
        let focus = Focus { center: Vec3::ZERO, radius_m: 0.01 };
        let scale = LocalScale::of(vec![sample], 100.0, vec![focus]);
        let texel = |x: f32| scale.texel(scale.of_texels(Vec3::X * x), 1.0);
        // Probes follow no scale finer than EVEN times 1 m.
        assert!((texel(0.0) - 0.5).abs() < 1e-6 && (scale.spacing(0) - EVEN.powf(POWERS[0]) / 2.0).abs() < 1e-6);
        assert!((texel(0.015) - 1.015f32.powf(2.0 / 3.0) / 1.5).abs() < 1e-4);
        assert!((texel(1.0) - 2.0f32.powf(2.0 / 3.0)).abs() < 1e-6);
    }

    #[test]
    fn what_nobody_sees_is_not_important() {
        use crate::{settings::BakeSettings, voxels::VoxelGrid};
        let scene = localprt_scenes::builtin::scene("two-rooms").unwrap();
        let caster = RayCaster::new(&scene).unwrap();
        let mut scale = LocalScale::of(measure(&caster, 4000), scene.extent(), Vec::new());
        let grid = VoxelGrid::build(&scene, &caster, 0.5, &scale, &BakeSettings::default()).unwrap();
        let hits = importance(&scale, &grid, &caster);
        assert_eq!(hits.len(), scene.face_count());
        assert_eq!(hits, importance(&scale, &grid, &caster));
        assert!(hits.iter().sum::<u32>() > 100_000);
        scale.look(&scene, &hits);
        assert!(scale.samples().iter().all(|sample| sample.seen > 0.0 && sample.seen.is_finite()));
    }
}
