//! Fitted transport: rows that best predict a receiver's light from the probes, instead of the paper's blend (Eq. 4).
//!
//! A row has a weight for every SH coefficient of every supporting probe. The paper sets them by distance and visibility;
//! the limited degree of the probes is then most of the error. Here the same weights are fitted, so the file, the memory
//! and the time per frame stay what they are. Radiance that leaves surfaces is taken as a smooth random field f times the
//! openness and albedo of the surface, L(y) = s(y) f(y); the fitted row is the paper's plus the correction that lowers the expected
//! squared error most, while each probe's part costs more the less weight the probe has:
//!
//! ```text
//! e[p]         solid angle of patch p at the receiver, weighted with s: its gather rays, and samples of what emits, that a
//!              probe sees
//! u_i[j, c]    SH coefficient j at probe i of what all surfaces have in common: a field of 1, and radiance that is the same
//!              everywhere; each times its standard deviation; e_u[c] the same at the receiver, with σ⁴ times the surfaces that
//!              no probe sees
//! Λ_i[j, p]    SH coefficient j at probe i of that patch: sum of the probe's relight rays
//! B            K ≈ B Bᵀ, prior covariance of f between patches                                    (field.rs)
//! M_i = [Λ_i B, u_i], A_i = M_iᵀ M_i                                                              per leaf
//! y = [Bᵀ e, e_u] - sum_i M_iᵀ a0_i          what the paper's row a0 gets wrong of each mode      (F1)
//! S = μ t I + sum_i w_i A_i          w_i = weight kernel times the share of what is seen          (F2)
//! a_i = a0_i + w_i M_i z,  S z = y                                                                (F3)
//! v = μ t y·z                        predicted variance of what is left, for a field of variance 1 (F4)
//! ```
//!
//! t is the sum of the variances of a probe's coefficients, on average over the probes by w_i, of what the patches reflect;
//! σ the share of the surfaces in view that some supporting probe sees. Light that none sees is no part of v: it is mostly dark.
//!
//! (F3) is ridge regression of the row with penalty μ t / w_i, in the space of field modes (matrix inversion lemma), so
//! that one small matrix is factored for a receiver, whatever its probes; the tests hold it against the long form. A probe that
//! sees nothing of what the receiver sees has w_i = 0: sealed rooms stay sealed, and rows change smoothly with the place.
//!
//! Sky columns are left as they are: the sky's SH coefficients are exact, and under a prior that prefers no direction the
//! best estimate of what they leave out is zero, which is the paper's row already. See `docs/fitted-transport.md`.

mod field;
mod mode_sums;
mod openness;
mod patches;
mod solve;
#[cfg(test)]
mod tests;

use super::{
    Metric,
    found::{COMMON, Found, OutputSums, Surface},
};
use crate::{
    digest::Digester,
    emitters::Emitters,
    lightmap::{Atlas, ReceiverSet},
    output::OutputError,
    probe_views::ProbeDirections,
    probes::ProbeSet,
    rays::{FacePoint, RayCaster, SurfaceHit},
    scratch::{Scratch, Stowed},
};
use bytemuck::{Pod, Zeroable};
use field::Modes;
use glam::Vec3;
use localprt_scenes::{FaceId, Lighting, SurfaceShading};
use openness::Openness;
use patches::{Cut, Patches};
use serde::{Deserialize, Serialize};
use std::{borrow::Cow, f32::consts::PI};

/// Edge of the finest patches, as a share of the probe spacing.
const FINEST: f32 = 0.1;
/// Edge of a patch over its distance from the leaf, at most, where there are few patches.
const ANGLE: f32 = 0.3;
/// The same where there are many.
const WIDEST: f32 = 4.0;
/// Patches of a leaf, at most: they are made coarser until there are as few.
const MOST_PATCHES: usize = 1000;
/// Correlation length of the field, as a share of the probe spacing.
const CORRELATION: f32 = 0.5;
/// Distance at which openness is one half, in probe spacings.
const HALF_OPEN: f32 = 3.0;
/// Modes are kept down to this share of the penalty, as it would be where all probes have weight 1 and lamps count too.
const LEAST: f32 = 0.01;
/// Variance of the field that all surfaces have in common: high, so that a constant field is reproduced.
const CONSTANT: f32 = 10.0;
/// Variance of radiance that all surfaces have in common, whatever their scale, over the square of the usual scale.
const EVEN: f32 = 0.3;
/// Surfaces that no supporting probe sees count in those modes times this power of the share of the view that some probe sees.
const EXTRAPOLATION: i32 = 4;
/// μ of (F2) with patches of the edge `FINEST`. It grows with their area: what a patch does not resolve is an error of the
/// model.
const RIDGE: f32 = 2e-4;

/// Steps of an octave in which spacing and usual scale are told; `docs/cache.md` has what that changes.
const STEPS: f32 = 16.0;

/// Points of what emits that every receiver looks for.
const EMITTER_SAMPLES: u32 = 256;

/// Constants that all leaves are fitted with. Those of an earlier bake do as well, and leave its leaves as they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitConstants {
    /// Median distance from a probe to the nearest other, metres.
    pub spacing_m: f32,
    /// Root mean square of s over what the probes see.
    pub usual_scale: f32,
}

/// What rows are fitted with; the same for all leaves of a bake.
pub struct FitScene {
    /// Median distance from a probe to the nearest other, metres.
    spacing_m: f32,
    /// Root mean square of s over what the probes see.
    usual_scale: f32,
    /// `[n_rays][n_sh]` SH of the relight rays times 4 pi / n_rays.
    table: Vec<f32>,
    /// `[n_probes]` what the relight rays of each see, by rising ray.
    views: Vec<Stowed<SeenPoint>>,
    openness: Openness,
    emitters: Emitters,
    /// Points of what emits, with their faces: the same for all receivers.
    emitter_samples: Vec<(FaceId, Vec3)>,
}

/// What is known of the light on surfaces before any of it is seen.
pub struct FitPrior {
    /// Median distance from a probe to the nearest other, metres.
    spacing_m: f32,
    kept: Option<FitConstants>,
    openness: Openness,
}

/// A surface point that a relight ray meets.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SeenPoint {
    ray: u32,
    position: Vec3,
    normal: Vec3,
    scale: f32,
    /// 1 or 0.
    glows: u32,
}

/// What a probe sees, and what the prior's usual scale takes of it.
pub struct SeenByProbe {
    points: Stowed<SeenPoint>,
    /// Sum of the squares of s of what does not glow, and how many that are.
    squares: f64,
    count: usize,
}

impl SeenByProbe {
    fn of(points: Vec<SeenPoint>, scratch: &Scratch) -> Result<Self, OutputError> {
        let scales = || points.iter().filter(|point| point.glows == 0).map(|point| f64::from(point.scale));
        let (squares, count) = (scales().map(|scale| scale.powi(2)).sum(), scales().count());
        Ok(Self { squares, count, points: scratch.stow(points)? })
    }
}

/// What the rows of a leaf are fitted with.
pub struct LeafFit {
    /// Union of the supporting probes, rising.
    probes: Vec<u32>,
    n_sh: usize,
    /// μ.
    ridge: f32,
    /// Root mean square of s over what the probes see.
    usual_scale: f32,
    patches: Patches,
    modes: Modes,
    /// By place in `probes`.
    views: Vec<ProbeModes>,
}

/// A probe's view of the field modes.
struct ProbeModes {
    /// M_i, `[n_sh][n_modes + COMMON]`.
    matrix: Vec<f32>,
    /// A_i, `[n_modes + COMMON][n_modes + COMMON]`.
    gram: Vec<f32>,
    /// Sum of the variances of its coefficients, but for what surfaces emit.
    variance: f32,
}

/// What became of the rows of one receiver.
pub(super) struct Correction {
    /// `[n_k]` predicted variance (F4) of each output.
    pub variance: Vec<f32>,
    /// Whether rows were corrected; else they are the paper's still.
    pub is_made: bool,
}

impl FitPrior {
    /// Measures the openness of all receivers. Constants are the `kept` ones, if there are any.
    pub fn of(
        caster: &RayCaster<'_>,
        atlas: &Atlas,
        receivers: &ReceiverSet,
        probes: &ProbeSet,
        kept: Option<FitConstants>,
    ) -> Self {
        let spacing_m = kept.map_or_else(|| spacing(probes), |kept| kept.spacing_m);
        Self { spacing_m, kept, openness: Openness::of(caster, atlas, receivers, HALF_OPEN * spacing_m) }
    }

    /// What a probe sees, of what its rays meet.
    ///
    /// # Errors
    /// Those of the scratch.
    pub fn seen(
        &self,
        caster: &RayCaster<'_>,
        hits: &[Option<SurfaceHit>],
        scratch: &Scratch,
    ) -> Result<SeenByProbe, OutputError> {
        let point = |(ray, hit): (usize, &Option<SurfaceHit>)| {
            let hit = hit.as_ref()?;
            let Surface { scale, glows } = self.openness.surface(caster, &hit.point?);
            let glows = u32::from(glows);
            Some(SeenPoint { ray: ray as u32, position: hit.position, normal: hit.normal, scale, glows })
        };
        SeenByProbe::of(hits.iter().enumerate().filter_map(point).collect(), scratch)
    }
}

impl FitScene {
    /// `views` is what each probe sees.
    pub fn of(
        caster: &RayCaster<'_>,
        FitPrior { spacing_m, kept, openness }: FitPrior,
        directions: &ProbeDirections,
        views: Vec<SeenByProbe>,
    ) -> Self {
        let usual_scale = kept.map_or_else(|| usual_scale(&views), |kept| kept.usual_scale);
        let emitters = Emitters::of(caster.scene(), &SurfaceShading::new(caster.scene(), &Lighting::default()));
        let emitter_samples = if emitters.is_empty() {
            Vec::new()
        } else {
            (0..EMITTER_SAMPLES).map(|index| emitter_sample(&emitters, index)).collect()
        };
        let views = views.into_iter().map(|seen| seen.points).collect();
        Self { spacing_m, usual_scale, table: directions.sh.clone(), views, openness, emitters, emitter_samples }
    }

    /// The same, with probe views of its own: so many rays of each probe.
    ///
    /// # Errors
    /// None: the views stay in memory.
    pub fn new(
        caster: &RayCaster<'_>,
        atlas: &Atlas,
        receivers: &ReceiverSet,
        probes: &ProbeSet,
        directions: &ProbeDirections,
        kept: Option<FitConstants>,
    ) -> Result<Self, OutputError> {
        let (prior, scratch) = (FitPrior::of(caster, atlas, receivers, probes, kept), Scratch::default());
        let views = directions.views(caster, &probes.positions, |hits| prior.seen(caster, hits, &scratch));
        Ok(Self::of(caster, prior, directions, views.into_iter().collect::<Result<_, _>>()?))
    }

    /// Constants that all leaves are fitted with.
    pub fn constants(&self) -> FitConstants {
        FitConstants { spacing_m: self.spacing_m, usual_scale: self.usual_scale }
    }

    /// Points at which receivers look for what emits; none where nothing does.
    pub(super) fn emitter_samples(&self) -> &[(FaceId, Vec3)] {
        &self.emitter_samples
    }

    /// Which share of its light a gather ray keeps, as samples of what emits bring the rest: 1 where nothing emits.
    ///
    /// Balance heuristic (Veach and Guibas 1995); `density` counts gather rays per steradian.
    pub(super) fn share_of_gather(&self, hit: &SurfaceHit, dir: Vec3, density: f32) -> f32 {
        if self.emitter_samples.is_empty() {
            return 1.0;
        }
        balance(density, self.emitters.density(hit, dir))
    }

    /// What a receiver sees of a sample, and the share of a gather ray's weight in that direction that it brings.
    pub(super) fn meet_emitter(
        &self,
        caster: &RayCaster<'_>,
        origin: Vec3,
        dir: Vec3,
        sample: (FaceId, Vec3),
        density: f32,
    ) -> Option<(SurfaceHit, f32)> {
        let (hit, by_emitter) = self.emitters.meet(caster, origin, dir, sample)?;
        Some((hit, balance(density, by_emitter)))
    }

    /// Light of a surface in the modes that all surfaces have in common.
    pub(super) fn common_light(&self, surface: Surface) -> [f32; COMMON] {
        common(surface.scale, self.usual_scale)
    }

    /// What the prior knows of a surface point.
    pub(super) fn surface(&self, caster: &RayCaster<'_>, point: &FacePoint) -> Surface {
        self.openness.surface(caster, point)
    }

    /// Takes in what all leaves are fitted with alike.
    pub(super) fn digest(&self, digester: &mut Digester) {
        digester.one([self.spacing_m, self.usual_scale]).all(&self.table);
        self.emitters.digest(&mut |values| {
            digester.all(values);
        });
        self.emitter_samples.iter().for_each(|&(_, point)| {
            digester.one(point);
        });
    }

    /// Takes in what a probe sees.
    ///
    /// # Errors
    /// Those of the scratch that holds it.
    pub(super) fn digest_of_probe(&self, probe: u32, digester: &mut Digester) -> Result<(), OutputError> {
        for &SeenPoint { ray, position, normal, scale, glows } in self.views[probe as usize].get()?.iter() {
            digester.one(ray).one(position).one(normal).one(scale).one(glows as u8);
        }
        Ok(())
    }

    /// Takes in what is read of a part of a face beside its material: see [`Openness::digest`].
    pub(super) fn digest_of_face(&self, face: FaceId, part: &[Vec3], digester: &mut Digester) {
        self.openness.digest(face, part, digester);
    }

    /// What the rows of receivers within a box are fitted with. A pure function of its arguments.
    ///
    /// # Errors
    /// Those of the scratch that holds the views.
    pub(super) fn leaf(
        &self,
        bounds: (Vec3, Vec3),
        probes: &[u32],
        weights: &[f32],
        n_sh: usize,
    ) -> Result<LeafFit, OutputError> {
        let seen: Vec<Cow<'_, [SeenPoint]>> =
            probes.iter().map(|&id| self.views[id as usize].get()).collect::<Result<_, _>>()?;
        let (patches, places) = self.patches(bounds, &seen);
        // Λ_i transposed, [n_patches][n_sh].
        let views: Vec<Vec<f32>> = seen
            .iter()
            .zip(&places)
            .map(|(points, places)| {
                let mut lambda = vec![0.0; patches.len() * n_sh];
                for (seen, &patch) in points.iter().zip(places) {
                    let values = &self.table[seen.ray as usize * n_sh..][..n_sh];
                    for (sum, value) in lambda[patch as usize * n_sh..][..n_sh].iter_mut().zip(values) {
                        *sum += seen.scale * value;
                    }
                }
                lambda
            })
            .collect();
        let ridge = RIDGE * (patches.cut().finest_m / (FINEST * self.spacing_m)).powi(2);
        let least = f64::from(LEAST * ridge) * n_sh as f64;
        let modes = Modes::of(&patches, CORRELATION * self.spacing_m, &views, weights, n_sh, least);
        let glowing = patches.places().iter().map(|place| place.glows).collect::<Vec<_>>();
        let views = views
            .into_iter()
            .zip(&seen)
            .map(|(mut lambda, points)| {
                let matrix = modes.project(&lambda, n_sh);
                let variance = if glowing.contains(&true) {
                    for (values, &glows) in lambda.chunks_exact_mut(n_sh).zip(&glowing) {
                        if glows {
                            values.fill(0.0);
                        }
                    }
                    let dark = modes.project(&lambda, n_sh);
                    dot(&dark, &dark)
                } else {
                    dot(&matrix, &matrix)
                };
                let matrix = beside(&matrix, &self.common(points, n_sh), n_sh);
                ProbeModes { gram: solve::gram(&matrix, n_sh), matrix, variance }
            })
            .collect();
        let probes = probes.to_vec();
        Ok(LeafFit { probes, n_sh, ridge, usual_scale: self.usual_scale, patches, modes, views })
    }

    /// u_i, `[n_sh][COMMON]`, of a probe that sees some points.
    fn common(&self, points: &[SeenPoint], n_sh: usize) -> Vec<f32> {
        let mut sums = vec![0.0; n_sh * COMMON];
        for point in points {
            let values = &self.table[point.ray as usize * n_sh..][..n_sh];
            let common = common(point.scale, self.usual_scale);
            for (sums, value) in sums.as_chunks_mut::<COMMON>().0.iter_mut().zip(values) {
                sums.iter_mut().zip(common).for_each(|(sum, common)| *sum += common * value);
            }
        }
        sums
    }

    /// Patches around a box as probes see them, by the points that each sees, and the patch of each point: coarser until they are
    /// few enough.
    fn patches(&self, bounds: (Vec3, Vec3), seen: &[Cow<'_, [SeenPoint]>]) -> (Patches, Vec<Vec<u32>>) {
        let mut cut = Cut { low: bounds.0, high: bounds.1, finest_m: FINEST * self.spacing_m, angle: ANGLE };
        loop {
            let mut patches = Patches::new(cut);
            let mut of_point = |seen: &SeenPoint| patches.add(seen.position, seen.normal, seen.glows != 0);
            let places: Vec<Vec<u32>> = seen.iter().map(|points| points.iter().map(&mut of_point).collect()).collect();
            if patches.len() <= MOST_PATCHES {
                return (patches, places);
            }
            cut = Cut { finest_m: 1.2 * cut.finest_m, angle: (1.2 * cut.angle).min(WIDEST), ..cut };
        }
    }
}

impl LeafFit {
    /// What errors of the leaf's rows do, as a share of the irradiance that a field of 1 and usual scale gives, π s: W of probe
    /// i are its M_i / π s, and of a sky column 1, as for a sky of variance 1. `None` where the fit knows no light.
    pub(super) fn metric(&self, n_sky: usize) -> Option<Metric> {
        if self.modes.len() == 0 {
            return None;
        }
        let n_modes = self.modes.len() + COMMON;
        let n = n_modes + n_sky;
        let usual_irradiance = PI * self.usual_scale;
        let mut matrix = vec![0.0; (self.views.len() * self.n_sh + n_sky) * n];
        let (of_probes, of_sky) = matrix.split_at_mut(self.views.len() * self.n_sh * n);
        let modes = self.views.iter().flat_map(|view| view.matrix.chunks_exact(n_modes));
        for (row, modes) in of_probes.chunks_exact_mut(n).zip(modes) {
            row.iter_mut().zip(modes).for_each(|(value, mode)| *value = mode / usual_irradiance);
        }
        for (column, row) in of_sky.chunks_exact_mut(n).enumerate() {
            row[n_modes + column] = 1.0;
        }
        Some(Metric { n, matrix })
    }

    /// Adds the correction (F3) to the rows of one receiver, whose rays found `found`, for its supporting probes.
    pub(super) fn correct(&self, support: &[u32], found: &Found, outputs: &mut [OutputSums]) -> Correction {
        let n_sh = self.n_sh;
        // With what all surfaces have in common, which comes last.
        let n_modes = self.modes.len() + COMMON;
        let n_k = outputs.len();
        let weights = &found.seen_weights;
        let total: f32 = weights.iter().sum();
        if total <= 0.0 {
            return Correction { variance: vec![0.0; n_k], is_made: false };
        }
        // Probes that count: their columns in the row, weight and view.
        let probes: Vec<(usize, f32, &ProbeModes)> = support
            .iter()
            .zip(weights)
            .enumerate()
            .filter(|(_, (_, weight))| **weight > 0.0)
            .filter_map(|(slot, (id, &weight))| {
                let place = self.probes.binary_search(id).ok()?;
                Some((slot * n_sh, weight, &self.views[place]))
            })
            .collect();

        // (F1)
        let mut sums = self.mode_sums(n_k);
        for (hit, of_outputs) in found.hits.iter().zip(found.hit_weights.chunks_exact(n_k)) {
            sums.add(hit.position, hit.normal, hit.surface, of_outputs);
        }
        let mut y = sums.into_values();
        let extrapolated = found.seen_share.powi(EXTRAPOLATION);
        for (y, unseen) in y.chunks_exact_mut(n_modes).zip(&found.unseen_common) {
            y[n_modes - COMMON..].iter_mut().zip(unseen).for_each(|(y, unseen)| *y += extrapolated * unseen);
        }
        for (y, output) in y.chunks_exact_mut(n_modes).zip(outputs.iter()) {
            for &(first, _, view) in &probes {
                for (&weight, modes) in output.probes[first..first + n_sh].iter().zip(view.matrix.chunks_exact(n_modes))
                {
                    y.iter_mut().zip(modes).for_each(|(y, mode)| *y -= weight * mode);
                }
            }
        }

        // (F2)
        let mut system = vec![0.0f32; n_modes * n_modes];
        let mut variance = 0.0;
        for &(_, weight, view) in &probes {
            // What is above the diagonal is not asked for.
            for (row, (sums, gram)) in system.chunks_exact_mut(n_modes).zip(view.gram.chunks_exact(n_modes)).enumerate()
            {
                sums[..=row].iter_mut().zip(&gram[..=row]).for_each(|(sum, value)| *sum += weight * value);
            }
            variance += weight / total * view.variance;
        }
        let ridge = self.ridge * variance;
        let of_the_papers_row =
            || Correction { variance: y.chunks_exact(n_modes).map(|y| dot(y, y)).collect(), is_made: false };
        if ridge <= 0.0 {
            return of_the_papers_row();
        }
        (0..n_modes).for_each(|mode| system[mode * n_modes + mode] += ridge);

        // (F3)
        let Some(z) = solve::solve(&system, &y, n_modes) else {
            // Next to nothing but lamps: too ill-conditioned for f32. The paper's row stays.
            return of_the_papers_row();
        };
        for (z, output) in z.chunks_exact(n_modes).zip(outputs.iter_mut()) {
            for &(first, weight, view) in &probes {
                let row = &mut output.probes[first..first + n_sh];
                for (value, modes) in row.iter_mut().zip(view.matrix.chunks_exact(n_modes)) {
                    *value += weight * dot(modes, z);
                }
            }
        }
        // (F4)
        let of_outputs = y.chunks_exact(n_modes).zip(z.chunks_exact(n_modes));
        Correction { variance: of_outputs.map(|(y, z)| (ridge * dot(y, z)).max(0.0)).collect(), is_made: true }
    }
}

/// Radiance of a surface of scale `scale` in the modes that all surfaces have in common, at one standard deviation.
fn common(scale: f32, usual_scale: f32) -> [f32; COMMON] {
    [CONSTANT.sqrt() * scale, EVEN.sqrt() * usual_scale]
}

/// Two row-major matrices side by side.
fn beside(left: &[f32], right: &[f32], n_rows: usize) -> Vec<f32> {
    let row_of = |matrix: &[f32], row: usize| {
        let width = matrix.len() / n_rows;
        row * width..(row + 1) * width
    };
    (0..n_rows).flat_map(|row| left[row_of(left, row)].iter().chain(&right[row_of(right, row)])).copied().collect()
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    // Eight sums, so that the compiler may use vectors.
    let mut sums = [0.0f32; 8];
    let (a_chunks, b_chunks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f32>() + rest
}

/// Root mean square of s over what relight rays meet, but for what emits; 1 where they meet nothing else.
fn usual_scale(views: &[SeenByProbe]) -> f32 {
    let squares: f64 = views.iter().map(|seen| seen.squares).sum();
    let mean = squares / views.iter().map(|seen| seen.count).sum::<usize>().max(1) as f64;
    if mean > 0.0 { in_steps(mean.sqrt() as f32) } else { 1.0 }
}

/// Light found in a direction counts this much of what a gather ray there counts, from either way of sampling.
fn balance(gather_density: f32, emitter_density: f32) -> f32 {
    // A cosine may round to just below zero.
    let gather_density = gather_density.max(0.0);
    gather_density / (gather_density + EMITTER_SAMPLES as f32 * emitter_density).max(f32::MIN_POSITIVE)
}

/// An additive recurrence in the plane (Roberts 2018) over triangles in order.
fn emitter_sample(emitters: &Emitters, index: u32) -> (FaceId, Vec3) {
    let which = (f64::from(index) + 0.5) / f64::from(EMITTER_SAMPLES);
    let place = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|step| (step * f64::from(index + 1)).fract());
    emitters.sample(which, place)
}

/// Median distance from a probe to the nearest other, metres; of a single probe half of its support radius.
fn spacing(probes: &ProbeSet) -> f32 {
    let mut distances = probes.nearest_m();
    distances.sort_unstable_by(f32::total_cmp);
    in_steps(distances.get(distances.len() / 2).copied().unwrap_or(0.5 * probes.radius_m).max(f32::MIN_POSITIVE))
}

/// A constant of all leaves, to the nearest of [`STEPS`] in an octave: it is still the same after most edits of a scene.
fn in_steps(value: f32) -> f32 {
    ((STEPS * value.log2()).round() / STEPS).exp2().max(f32::MIN_POSITIVE)
}
