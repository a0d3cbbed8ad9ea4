//! Irradiance at many points, each sampled until its standard error is small enough.

use super::{PathTracer, Random, SurfacePoint};
use crate::progress::{Cancelled, Progress};
use glam::{DVec3, Vec3};
use localprt_formats::directions::{counter_uniform, fibonacci_square};
use localprt_scenes::luminance;
use rayon::prelude::*;

/// Paths of a batch: their first directions form a shifted Fibonacci lattice.
const BATCH: u32 = 64;
/// Batches of the first round; fewer tell too little about their own spread.
const FIRST_BATCHES: u32 = 8;
/// Points on either side in the list whose spread counts as well: one that has not yet met a rare bright path has
/// neighbors that have. Lists are in spatial order.
const NEIGHBORS: usize = 16;

/// When to stop sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathBudget {
    /// Standard error of a point to reach (luminance of the bands' errors), as a share of the mean luminance over all
    /// points.
    pub error: f64,
    /// Most paths per point, whatever its error.
    pub most_paths: u32,
}

impl Default for PathBudget {
    /// One percent of the mean, at most 16,384 paths a point.
    fn default() -> Self {
        Self { error: 0.01, most_paths: 16_384 }
    }
}

/// Estimates at `[n_points]`.
#[derive(Clone, Debug, Default)]
pub struct Estimates {
    /// Irradiance, W m^-2, linear RGB.
    pub irradiance: Vec<Vec3>,
    /// Standard error of each band.
    pub standard_error: Vec<Vec3>,
    /// Paths of each point.
    pub paths: Vec<u32>,
    /// Rays traced in all.
    pub rays: u64,
}

/// Batch means of one point.
#[derive(Clone, Copy, Default)]
struct Sums {
    batches: u32,
    sum: DVec3,
    squares: DVec3,
    rays: u64,
}

impl Sums {
    fn mean(&self) -> DVec3 {
        self.sum / f64::from(self.batches.max(1))
    }

    /// Of the mean over batches, which are independent of each other.
    fn standard_error(&self) -> DVec3 {
        let n = f64::from(self.batches);
        if n < 2.0 {
            return DVec3::INFINITY;
        }
        let mean = self.mean();
        ((self.squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0)).map(f64::sqrt)
    }
}

impl PathTracer<'_> {
    /// Irradiance at points, listed so that neighbors in space follow each other. Sampling goes on in rounds, each as large
    /// as all before, for the points whose standard error, or that of their neighbors in the list together, is above the
    /// budget's: a point that stopped by its own spread alone would stop too often where it has missed what is bright and
    /// rare. The same on any number of threads.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn estimate(
        &self,
        points: &[SurfacePoint],
        budget: PathBudget,
        progress: &Progress,
    ) -> Result<Estimates, Cancelled> {
        self.estimate_means(&points.iter().map(std::slice::from_ref).collect::<Vec<_>>(), budget, progress)
    }

    /// The same of means over some points each, at least one.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn estimate_means(
        &self,
        points: &[&[SurfacePoint]],
        budget: PathBudget,
        progress: &Progress,
    ) -> Result<Estimates, Cancelled> {
        let mut sums = vec![Sums::default(); points.len()];
        let mut open: Vec<u32> = (0..points.len() as u32).collect();
        let most_batches = (budget.most_paths / BATCH).max(FIRST_BATCHES);
        let mut batches = FIRST_BATCHES;
        while !open.is_empty() {
            let stage = progress.stage(&format!("path tracing, {} paths", batches * BATCH), open.len() as u64);
            let fresh: Vec<Sums> = open
                .par_iter()
                .map(|&index| {
                    if progress.is_cancelled() {
                        return Sums::default();
                    }
                    let index = index as usize;
                    let held = self.add_batches(points[index], index as u64, sums[index], batches);
                    stage.inc(1);
                    held
                })
                .collect();
            progress.check()?;
            for (&index, fresh) in open.iter().zip(fresh) {
                sums[index as usize] = fresh;
            }
            let mean = sums.iter().map(|sums| luminance(sums.mean())).sum::<f64>() / points.len() as f64;
            let allowed = budget.error * mean;
            let variances: Vec<f64> = sums.iter().map(|sums| luminance(sums.standard_error()).powi(2)).collect();
            open.retain(|&index| {
                let index = index as usize;
                let around = &variances[index.saturating_sub(NEIGHBORS)..points.len().min(index + NEIGHBORS + 1)];
                let pooled = around.iter().sum::<f64>() / around.len() as f64;
                variances[index].max(pooled) > allowed * allowed
            });
            if batches >= most_batches {
                break;
            }
            batches = (2 * batches).min(most_batches);
        }
        Ok(Estimates {
            irradiance: sums.iter().map(|sums| sums.mean().as_vec3()).collect(),
            standard_error: sums.iter().map(|sums| sums.standard_error().as_vec3()).collect(),
            paths: sums.iter().map(|sums| sums.batches * BATCH).collect(),
            rays: sums.iter().map(|sums| sums.rays).sum(),
        })
    }

    /// Adds batches until there are `wanted`.
    fn add_batches(&self, points: &[SurfacePoint], stream: u64, mut sums: Sums, wanted: u32) -> Sums {
        while sums.batches < wanted {
            let (mean, rays) = self.batch(points, stream, u64::from(sums.batches), BATCH);
            sums.batches += 1;
            sums.sum += mean;
            sums.squares += mean * mean;
            sums.rays += rays;
        }
        sums
    }

    /// Mean of `n` paths whose first directions form a lattice with a random shift of its own. The points take turns.
    pub(super) fn batch(&self, points: &[SurfacePoint], stream: u64, batch: u64, n: u32) -> (DVec3, u64) {
        let shift = [0, 1].map(|axis| counter_uniform(self.seed ^ 0x5eed, stream, 2 * batch + axis));
        // No path has as many random numbers as this.
        let mut random = Random { seed: self.seed, stream, counter: batch << 32 };
        let mut sum = DVec3::ZERO;
        let mut rays = 0;
        for i in 0..n {
            let point = points[(u64::from(i) + batch) as usize % points.len()];
            let (value, traced) = self.path(point, fibonacci_square(i, n, shift), &mut random);
            sum += value.as_dvec3();
            rays += u64::from(traced);
        }
        (sum / f64::from(n), rays)
    }
}
