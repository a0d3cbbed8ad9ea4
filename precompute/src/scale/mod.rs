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
//! W being how much is seen of an area, relative to what is typical ([`importance`]). Texels and the distances between probes follow
//! it; where large faces are cut goes with R alone.
//!
//! In crevices R goes to zero, and there are always more of them the closer one looks. It is followed down to a finest scale ε, of which
//! the texels there are a fixed share (S1): what is finer than texels cannot be told. With n squares of edge t in all and k² of them on
//! a square of ε,
//!
//! ```text
//! ∫ t^-2 dA = n / k²,   t = ε (max(R, ε) / ε)^(4/6) W^(-1/6)                          (S2)
//! ```

mod importance;
mod samples;
mod tree;

pub use importance::{Seen, importance};
pub use samples::measure;

use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use localprt_scenes::Scene;
use tree::Tree;

/// Coarsest over finest texel.
pub const RANGE: f32 = 64.0;
/// Powers of R and W that texels go with (S1).
const POWERS: [f32; 2] = [4.0 / 6.0, -1.0 / 6.0];
/// Receivers on a square of the finest scale that texels follow: with fewer, light cannot be told to vary.
const RECEIVERS_OF_TEXELS: f64 = 8.0;
/// The same for the finest scale that charts are cut for, and that somebody stands before.
const RECEIVERS_OF_CHARTS: f64 = 32.0;
/// Probes over a square of the finest scale that they follow.
const PROBES_OF_SPACING: f64 = 1.0;
/// Scales finer than this share of the coarsest are not followed.
const FINEST_OF_COARSEST: f64 = 1e-6;
/// Spacings within this factor count as even.
const MOST_EVEN: f32 = 4.0;
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
    /// W: how often its face is seen, per square metre, relative to what is typical; 1 before anybody has looked.
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
    /// Receivers that there will be, for (S2).
    receivers: u32,
    /// Finest scale for texels, metres.
    finest_m: f32,
    /// Finest scale for charts, metres.
    finest_of_charts_m: f32,
}

impl LocalScale {
    /// The same scale everywhere: even densities.
    pub fn uniform() -> Self {
        Self {
            samples: Vec::new(),
            tree: None,
            focus: Vec::new(),
            receivers: 0,
            finest_m: 1.0,
            finest_of_charts_m: 1.0,
        }
    }

    /// Of samples, for so many receivers; `extent_m` is the diagonal of the scene box.
    pub fn of(samples: Vec<Sample>, extent_m: f32, receivers: u32, focus: Vec<Focus>) -> Self {
        let points = samples.iter().map(|sample| (sample.position, sample.scale_m.min(extent_m))).collect();
        let Some(tree) = Tree::new(points) else { return Self::uniform() };
        let mut scale = Self { samples, tree: Some(tree), focus, receivers, finest_m: 1.0, finest_of_charts_m: 1.0 };
        scale.find_finest();
        scale
    }

    fn find_finest(&mut self) {
        let receivers = f64::from(self.receivers);
        self.finest_m = self.finest(receivers / RECEIVERS_OF_TEXELS);
        self.finest_of_charts_m = self.finest(receivers / RECEIVERS_OF_CHARTS);
    }

    /// Takes in how much of each face of the scene is seen.
    pub fn look(&mut self, scene: &Scene, seen: &Seen) {
        let faces: Vec<(usize, usize)> = scene.faces().collect();
        for sample in &mut self.samples {
            let (mesh, triangle) = faces[sample.face as usize];
            sample.seen = seen.density([(sample.face as usize, scene.area_m2(mesh, triangle))].into_iter());
        }
        self.find_finest();
    }

    /// ε of (S2) for so many squares of its own edge, metres.
    fn finest(&self, squares: f64) -> f32 {
        let weighted =
            |sample: &Sample| f64::from(sample.area_m2) * f64::from(sample.seen).powf(-2.0 * f64::from(POWERS[1]));
        let areas: Vec<(f64, f64)> = self
            .samples
            .iter()
            .map(|sample| (f64::from(self.at(sample.position)), weighted(sample)))
            .filter(|(_, area_m2)| *area_m2 > 0.0)
            .collect();
        let count = |finest_m: f64| -> f64 {
            let edge_m = |scale_m: f64| finest_m * (scale_m.max(finest_m) / finest_m).powf(f64::from(POWERS[0]));
            areas.iter().map(|&(scale_m, area_m2)| area_m2 / edge_m(scale_m).powi(2)).sum()
        };
        let whole_m2: f64 = areas.iter().map(|(_, area_m2)| area_m2).sum();
        let coarsest_m = areas.iter().map(|(scale_m, _)| *scale_m).fold((whole_m2 / squares).sqrt(), f64::max);
        // Rises with what is counted: by halving the range of its logarithm.
        let (mut low, mut high) = (coarsest_m * FINEST_OF_COARSEST, coarsest_m);
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            if count(middle) > squares { low = middle } else { high = middle }
        }
        (high as f32).max(f32::MIN_POSITIVE)
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

    /// R at a place, metres, but not below the finest scale of charts; lower within a focus. Where this differs much, charts are cut.
    pub fn of_charts(&self, position: Vec3) -> f32 {
        self.not_below(self.finest_of_charts_m, position)
    }

    fn not_below(&self, least_m: f32, position: Vec3) -> f32 {
        self.at(position).max(least_m) / self.focus(position).powf(1.0 / POWERS[0])
    }

    /// What the edge of a texel is in proportion to (S1), where the scale is `scale_m` and people see `seen` of each area.
    pub fn texel(&self, scale_m: f32, seen: f32) -> f32 {
        if self.is_uniform() { 1.0 } else { scale_m.powf(POWERS[0]) * seen.powf(POWERS[1]) }
    }

    /// Edge of a texel over (S1), metres, for so many of them: about, as if all surfaces were seen alike.
    pub fn texel_unit_m(&self, scene: &Scene, texels: f64) -> f64 {
        let in_units: f64 = match self.is_uniform() {
            true => scene.faces().map(|(mesh, triangle)| scene.area_m2(mesh, triangle)).sum(),
            false => {
                let edge = |sample: &Sample| f64::from(self.texel(self.of_texels(sample.position), 1.0));
                self.samples.iter().map(|sample| f64::from(sample.area_m2) / edge(sample).powi(2)).sum()
            }
        };
        (in_units / texels.max(1.0)).sqrt()
    }

    /// ε of so many probes: how close they stand where they stand closest, metres.
    pub fn closest(&self, probes: usize) -> f32 {
        if self.is_uniform() { f32::INFINITY } else { self.finest(probes as f64 / PROBES_OF_SPACING) }
    }

    /// `[n_samples]` what the distance between so many probes is in proportion to (S1) near each sample, less within a focus; `None` if
    /// they are as well spread evenly: of what is seen, nine tenths ask for spacings within a factor.
    pub fn spacing(&self, probes: usize) -> Option<Vec<f32>> {
        let spacing = self.relative_spacing(probes);
        let of_seen = || {
            let seen = self.samples.iter().map(|sample| f64::from(sample.area_m2) * f64::from(sample.seen));
            spacing.iter().copied().zip(seen)
        };
        let [close, far] = [0.05, 0.95].map(|share| weighted_quantile(of_seen(), share));
        (far? >= MOST_EVEN * close?).then_some(spacing)
    }

    /// The same, however even.
    pub fn relative_spacing(&self, probes: usize) -> Vec<f32> {
        let finest_m = self.closest(probes);
        let spacing = |sample: &Sample| {
            let scale_m = self.at(sample.position).max(finest_m);
            scale_m.powf(POWERS[0]) * sample.seen.powf(POWERS[1]) / self.focus(sample.position)
        };
        self.samples.iter().map(spacing).collect()
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

    /// Finest scale for charts, metres.
    pub fn finest_of_charts_m(&self) -> f32 {
        self.finest_of_charts_m
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
    fn texels_of_the_estimated_edge_are_as_many_as_asked_for() {
        let scene = localprt_scenes::builtin::scene("two-rooms").unwrap();
        let caster = RayCaster::new(&scene).unwrap();
        let measured = LocalScale::of(measure(&caster, 2000), scene.extent(), 5000, Vec::new());
        let area_m2: f64 = scene.faces().map(|(mesh, triangle)| scene.area_m2(mesh, triangle)).sum();
        assert!((LocalScale::uniform().texel_unit_m(&scene, 400.0) - (area_m2 / 400.0).sqrt()).abs() < 1e-9);
        let unit_m = measured.texel_unit_m(&scene, 400.0);
        // Elsewhere than where it was measured: three standard errors of 2000 samples of what varies no more than its mean.
        let texels: f64 = scene
            .faces()
            .map(|(mesh, triangle)| {
                let of_parts = localprt_surfaces::subdivision(8).map(|[u, v, w]| {
                    let place = scene.position(mesh, triangle, Vec3::new(u, v, w));
                    (unit_m * f64::from(measured.texel(measured.of_texels(place), 1.0))).powi(-2)
                });
                scene.area_m2(mesh, triangle) * of_parts.sum::<f64>() / 64.0
            })
            .sum();
        assert!((texels / 400.0 - 1.0).abs() < 3.0 / 2000.0f64.sqrt(), "{texels}");
    }

    #[test]
    fn scale_grows_no_faster_than_distance() {
        let scene = localprt_scenes::builtin::scene("cornell").unwrap();
        let caster = RayCaster::new(&scene).unwrap();
        let scale = LocalScale::of(measure(&caster, 4000), scene.extent(), 60_000, Vec::new());
        assert!(scale.finest_m < scale.finest_of_charts_m, "{} {}", scale.finest_m, scale.finest_of_charts_m);
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
    fn the_finest_scale_is_that_of_a_few_texels() {
        let sample = |scale_m, area_m2| Sample {
            position: Vec3::X * 1000.0 * scale_m,
            normal: Vec3::Y,
            scale_m,
            area_m2,
            face: 0,
            seen: 1.0,
        };
        // Squares of (S2) at a finest scale of 0.125 m: 64 of a crevice and 4 of each square metre at a scale of 1 m.
        let squares = 64.0 * 2.0 + 4.0 * 3.0;
        let scale = LocalScale::of(vec![sample(0.001, 2.0), sample(1.0, 3.0)], 1e4, 1120, Vec::new());
        assert!((scale.finest(squares) - 0.125).abs() < 1e-6);
        assert!((scale.finest_m - 0.125).abs() < 1e-6);
        // What is never seen counts for nothing.
        let mut unseen = scale.clone();
        unseen.samples[0].seen = 0.0;
        assert!((unseen.finest(4.0 * 3.0) - 0.125).abs() < 1e-6);
    }

    #[test]
    fn a_focus_halves_texels_and_spacings_and_fades() {
        let sample = Sample { position: Vec3::ZERO, normal: Vec3::Y, scale_m: 1.0, area_m2: 1.0, face: 0, seen: 1.0 };
        let focus = Focus { center: Vec3::ZERO, radius_m: 0.01 };
        let scale = LocalScale::of(vec![sample], 100.0, 60_000, vec![focus]);
        let texel = |x: f32| scale.texel(scale.of_texels(Vec3::X * x), 1.0);
        assert!((texel(0.0) - 0.5).abs() < 1e-6);
        assert!((texel(0.015) - 1.015f32.powf(2.0 / 3.0) / 1.5).abs() < 1e-4);
        assert!((texel(1.0) - 2.0f32.powf(2.0 / 3.0)).abs() < 1e-6);
    }

    #[test]
    fn what_people_stand_before_is_seen_and_a_far_plain_hardly() {
        use crate::{settings::BakeSettings, voxels::VoxelGrid};
        let scene = localprt_scenes::builtin::scene("room-on-plain").unwrap();
        let caster = RayCaster::new(&scene).unwrap();
        let mut scale = LocalScale::of(measure(&caster, 4000), scene.extent(), 60_000, Vec::new());
        let grid = VoxelGrid::build(&scene, &caster, 16.0, scale.closest(150), &BakeSettings::default()).unwrap();
        let seen = importance(&scale, &grid, &caster);
        assert_eq!(seen, importance(&scale, &grid, &caster), "by chance");
        let of_mesh = |name: &str| {
            let faces = scene.faces().enumerate().filter(|(_, (mesh, _))| scene.meshes[*mesh].name == name);
            seen.density(faces.map(|(face, (mesh, triangle))| (face, scene.area_m2(mesh, triangle))))
        };
        let [floor, table, plain] = ["floor", "table", "plain"].map(of_mesh);
        assert!(floor > 50.0 * plain && table > 50.0 * plain, "{floor} {table} {plain}");
        scale.look(&scene, &seen);
        assert!(scale.spacing(150).is_some());
        // A face far too small to be hit counts as typical, not as the brightest of all.
        let speck = seen.density([(0, 1e-12)].into_iter());
        let hits = f64::from(seen.hits[0]) as f32;
        assert!((speck / ((hits + 4.0) / 4.0) - 1.0).abs() < 1e-3);
    }
}
