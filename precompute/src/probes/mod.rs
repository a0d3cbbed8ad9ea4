//! Probe placement (section 4.1): candidates in open voxels beside solid ones, or off the surfaces by their local scale, thinned
//! to the target count, one support radius found from the receivers, and a repair of what no supporting probe sees.
//!
//! [`place`] is the whole step: [`crate::voxels::VoxelGrid`] and receivers in, [`ProbeSet`] and [`Support`] out. World
//! space, metres. The same input gives the same probes on any number of threads.

mod by_scale;
mod candidates;
mod coverage;
mod extend;
pub(crate) mod point_grid;
mod radius;
mod reduce;
#[cfg(test)]
mod tests;

pub use candidates::{Candidates, candidates};
pub use coverage::{Coverage, SurfaceSample};
pub use extend::{KeptProbes, Spread};
pub use radius::{Overlap, support};
pub use reduce::{Reduction, reduce};

use crate::{
    rays::RayCaster,
    scale::LocalScale,
    settings::BakeSettings,
    voxels::{VoxelGrid, grid_points, spacing_for},
};
use extend::Places;
use glam::Vec3;
use point_grid::PointGrid;
use rayon::prelude::*;

pub use crate::settings::MAX_PROBES;

/// Voxels from a surface to its probes, at most: bounds the work of finding them.
const MOST_LAYERS: f32 = 64.0;

/// Radiance probes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProbeSet {
    /// World positions, metres.
    pub positions: Vec<Vec3>,
    /// Support radius r of all probes, metres: mean overlap over the receivers as asked.
    pub radius_m: f32,
}

impl ProbeSet {
    /// `[n_probes]` distance to the nearest other probe, metres; of a single probe half of the support radius.
    pub fn nearest_m(&self) -> Vec<f32> {
        if self.positions.len() < 2 {
            return vec![0.5 * self.radius_m; self.positions.len()];
        }
        let grid = PointGrid::new(&self.positions, 0.5 * self.radius_m);
        let nearest = |distances: &mut Vec<f32>, &place: &Vec3| {
            // The nearest of all is the probe itself.
            grid.nearest(place, 2, distances);
            distances[1]
        };
        self.positions.par_iter().map_init(Vec::new, nearest).collect()
    }
}

/// Supporting probes of every receiver, and the radius each receiver sees them with.
///
/// A receiver with too few probes within r uses `max(r, 1.05 x distance to its min_overlap-th nearest probe)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Support {
    /// `[n_receivers + 1]` start of each receiver's run in `probes`.
    pub start: Vec<u32>,
    /// Probe ids, rising within a run.
    pub probes: Vec<u32>,
    /// `[n_receivers]` radius used in the weight kernel, metres.
    pub radius_m: Vec<f32>,
}

impl Support {
    /// Probes that support a receiver.
    pub fn of(&self, receiver: usize) -> &[u32] {
        &self.probes[self.start[receiver] as usize..self.start[receiver + 1] as usize]
    }
}

/// What placement did, for the bake report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacementReport {
    /// Probe spacing rho, metres.
    pub spacing_m: f32,
    /// Voxel size, metres.
    pub voxel_m: f32,
    /// Probe count that thinning aims at.
    pub target: usize,
    /// Candidates before thinning.
    pub candidates: usize,
    /// Candidates rejected for back faces or clearance.
    pub rejected: usize,
    /// Probes added by the coverage repair.
    pub repaired: usize,
    /// Overlap: mean, least, most over receivers.
    pub overlap: (f32, u32, u32),
    /// Surface points, seen by sampled receivers, that coverage was measured on.
    pub coverage_samples: usize,
    /// Share of them that no supporting probe saw before the repair, 0..=1.
    pub unseen_before: f32,
    /// The same after it.
    pub unseen_after: f32,
    /// How probes are spread.
    pub spread: Spread,
}

/// Why no probes could be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// An option is out of range.
    #[error("{option} is {value}, which is out of range")]
    InvalidOption {
        /// The option's name.
        option: &'static str,
        /// What it was.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// More probes than a bake can hold.
    #[error("a spacing of {spacing_m} m asks for {count:.0} probes, more than {MAX_PROBES}")]
    TooManyProbes {
        /// Probe spacing, metres.
        spacing_m: f32,
        /// Probes asked for.
        count: f64,
    },
    /// No empty voxel is part of the space to light.
    #[error("no open space among {voxels} voxels of {voxel_m} m ({solid} solid, the rest behind surfaces)")]
    NoOpenSpace {
        /// Voxels of the grid.
        voxels: usize,
        /// Solid ones.
        solid: usize,
        /// Voxel size, metres.
        voxel_m: f32,
    },
    /// There are open voxels, but none of them is good for a probe.
    #[error(
        "each of {tested} possible probe positions, in voxels of {voxel_m} m, is behind surfaces, within a quarter voxel of \
         one, or sees none"
    )]
    NoCandidate {
        /// Voxels tried.
        tested: usize,
        /// Voxel size, metres.
        voxel_m: f32,
    },
    /// Nothing needs light.
    #[error("there are no receivers to place probes for")]
    NoReceivers,
    /// More receiver-probe pairs than 32-bit offsets reach.
    #[error("{pairs} pairs of receivers and supporting probes are more than {limit}")]
    TooManyPairs {
        /// Pairs needed.
        pairs: u64,
        /// Most that can be stored.
        limit: u64,
    },
}

impl PlacementError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::InvalidOption { allowed, .. } => format!("give a value {allowed}"),
            Self::TooManyProbes { .. } => "use a larger spacing or give the probe count".into(),
            Self::NoOpenSpace { .. } => {
                "use a smaller voxel size, name interior points, or turn one-sided surfaces to face the space to light"
                    .into()
            }
            Self::NoCandidate { .. } => {
                "use smaller voxels, or turn one-sided surfaces to face the space to light".into()
            }
            Self::NoReceivers => "let some surfaces face the space to light".into(),
            Self::TooManyPairs { .. } => "lower the overlap or the number of receivers".into(),
        }
    }

    /// Whether the scene is to be mended, and not an option.
    pub(crate) fn is_of_scene(&self) -> bool {
        matches!(self, Self::NoOpenSpace { .. } | Self::NoCandidate { .. } | Self::NoReceivers)
    }
}

/// Probe count that thinning aims at: `settings.probes`, or the points of a regular grid of spacing `rho` over the
/// scene box (section 4.1).
///
/// # Errors
///
/// [`PlacementError::InvalidOption`] for zero probes, [`PlacementError::TooManyProbes`] above [`MAX_PROBES`].
pub fn target_count(bounds: (Vec3, Vec3), rho: f32, settings: &BakeSettings) -> Result<usize, PlacementError> {
    match settings.probes {
        Some(count @ 1..=MAX_PROBES) => Ok(count as usize),
        Some(count) => Err(PlacementError::InvalidOption {
            option: "probes",
            value: f64::from(count),
            allowed: "from 1 to 262144",
        }),
        None => {
            let count = grid_points(bounds, rho);
            if count > f64::from(MAX_PROBES) {
                return Err(PlacementError::TooManyProbes { spacing_m: rho, count });
            }
            Ok(count as usize)
        }
    }
}

/// Places the probes of a scene and links every receiver to those that support it.
///
/// `rho` is the probe spacing in metres ([`crate::voxels::spacing`]); `receivers` and `normals` are `[n_receivers]`
/// positions in metres and unit geometric normals. Where `scale` asks for very different spacings, candidates stand where it was
/// measured and are spread by it; else they are spread evenly.
///
/// The coverage repair adds up to `settings.repair` times the target count. With an explicit `settings.probes` the
/// total stays what was asked for: thinning stops short by that share, and what the repair does not need goes to the
/// candidates that thinning removed last. A repair that does not lower the unseen share is undone.
///
/// Probes that are `kept` from an earlier bake stay where they stand in the open, with their radius; others join them only where
/// there are none around.
///
/// # Errors
///
/// By what has to change: the options ([`PlacementError::InvalidOption`], [`PlacementError::TooManyProbes`],
/// [`PlacementError::TooManyPairs`]), or the scene and its voxels (the others).
pub fn place(
    caster: &RayCaster,
    grid: &VoxelGrid,
    rho: f32,
    scale: &LocalScale,
    receivers: &[Vec3],
    normals: &[Vec3],
    settings: &BakeSettings,
    kept: Option<KeptProbes<'_>>,
) -> Result<(ProbeSet, Support, PlacementReport), PlacementError> {
    check(settings)?;
    let bounds = caster.scene().bounds().unwrap_or_default();
    let target = target_count(bounds, rho, settings)?;

    // A spacing given beside a count may have nothing to do with it; placement then follows the count.
    let kernel_m = if settings.probes.is_some() { spacing_for(bounds, target as u32) } else { rho };
    let uneven = match kept {
        Some(kept) if kept.spread.is_even => None,
        Some(_) => Some(scale.relative_spacing(target)),
        None => scale.spacing(target),
    };
    let (found, spacing) = match uneven {
        None => {
            let layer = (settings.standoff * kernel_m / grid.voxel_m).round().clamp(1.0, MOST_LAYERS);
            (candidates(grid, caster, target, layer as u8, settings.seed)?, None)
        }
        Some(spacing) => {
            let (found, spacing) = by_scale::candidates(scale, &spacing, grid, caster, target, settings.standoff);
            if found.positions.is_empty() && kept.is_none() {
                return Err(PlacementError::NoCandidate { tested: found.rejected, voxel_m: grid.voxel_m });
            }
            (found, Some(spacing))
        }
    };
    let places = Places { positions: &found.positions, spacing: spacing.as_deref() };
    let sees = sight(caster, receivers, normals);
    let coverage = Coverage::sample(caster, receivers, normals, settings.seed);
    let covered = |unseen| PlacementReport {
        spacing_m: rho,
        voxel_m: grid.voxel_m,
        target,
        candidates: found.positions.len(),
        rejected: found.rejected,
        coverage_samples: coverage.samples.len(),
        unseen_before: unseen,
        unseen_after: unseen,
        ..PlacementReport::default()
    };
    if let Some(kept) = kept {
        let positions = places.extend(&kept, caster, grid, MAX_PROBES as usize);
        if positions.is_empty() {
            return Err(PlacementError::NoCandidate { tested: kept.positions.len(), voxel_m: grid.voxel_m });
        }
        let (probes, support, overlap) = support(receivers, &positions, &sees, settings, Some(kept.radius_m))?;
        let overlap = (overlap.mean, overlap.least, overlap.most);
        let report =
            PlacementReport { overlap, spread: kept.spread, ..covered(coverage.unseen_share(&probes, &support)) };
        return Ok((probes, support, report));
    }
    // Of the candidates at these indices.
    let thin = |indices: &[u32], count: usize| {
        let positions: Vec<Vec3> = indices.iter().map(|&index| found.positions[index as usize]).collect();
        match &spacing {
            None => reduce(&positions, count, kernel_m),
            Some(spacing) => {
                let spacing: Vec<f32> = indices.iter().map(|&index| spacing[index as usize]).collect();
                by_scale::spread(&positions, &spacing, caster, count)
            }
        }
    };
    let budget = (f64::from(settings.repair) * target as f64) as usize;
    let exact = settings.probes.is_some();
    let all: Vec<u32> = (0..found.positions.len() as u32).collect();
    let thinned = thin(&all, target);
    let plain = placement(&found.positions, &thinned.kept, receivers, &sees, settings)?;

    let unseen_before = coverage.unseen_share(&plain.0, &plain.1);
    let mut report = covered(unseen_before);

    // An explicit count makes room for the repair first.
    let room = if exact { budget.min(target - 1) } else { 0 };
    let reduced = if room > 0 { thinned.further(target - room, thin) } else { thinned };
    let start =
        if room > 0 { placement(&found.positions, &reduced.kept, receivers, &sees, settings)? } else { plain.clone() };
    let budget = if exact { room } else { budget };
    let added = coverage.repair(&start.0, &start.1, receivers, &found.positions, &reduced.removed, budget);
    let mut best = plain;
    if !added.is_empty() {
        let repaired = reduced.with(&added);
        let total = if exact { target } else { repaired.kept.len() };
        let trial = placement(&found.positions, &repaired.padded(total), receivers, &sees, settings)?;
        let unseen = coverage.unseen_share(&trial.0, &trial.1);
        if unseen < unseen_before {
            report.unseen_after = unseen;
            report.repaired = added.len();
            best = trial;
        }
    }
    let (probes, support, overlap) = best;
    report.overlap = (overlap.mean, overlap.least, overlap.most);
    report.spread = places.spread(caster, &probes.positions);
    Ok((probes, support, report))
}

/// Links receivers to probes at given places, and with a given radius or the one that their overlap asks for, as [`place`] does with
/// those that it finds.
///
/// # Errors
///
/// [`PlacementError::InvalidOption`], [`PlacementError::NoReceivers`], [`PlacementError::TooManyPairs`].
pub fn link(
    caster: &RayCaster,
    probes: &[Vec3],
    receivers: &[Vec3],
    normals: &[Vec3],
    settings: &BakeSettings,
    radius_m: Option<f32>,
) -> Result<(ProbeSet, Support), PlacementError> {
    check(settings)?;
    let (probes, support, _) = support(receivers, probes, &sight(caster, receivers, normals), settings, radius_m)?;
    Ok((probes, support))
}

/// Whether a receiver, by index, and a probe see each other.
fn sight<'a>(
    caster: &'a RayCaster,
    receivers: &'a [Vec3],
    normals: &'a [Vec3],
) -> impl Fn(usize, Vec3) -> bool + Sync + 'a {
    |receiver, probe| {
        let (position, normal) = (receivers[receiver], normals[receiver]);
        normal.dot(probe - position) > caster.offset_m() && caster.visible(position + normal * caster.offset_m(), probe)
    }
}

/// Probes at some of the candidates, with their radius and support.
fn placement(
    candidates: &[Vec3],
    chosen: &[u32],
    receivers: &[Vec3],
    sees: &(dyn Fn(usize, Vec3) -> bool + Sync),
    settings: &BakeSettings,
) -> Result<(ProbeSet, Support, Overlap), PlacementError> {
    let positions: Vec<Vec3> = chosen.iter().map(|&index| candidates[index as usize]).collect();
    support(receivers, &positions, sees, settings, None)
}

fn check(settings: &BakeSettings) -> Result<(), PlacementError> {
    let check = |option, value: f32, valid: bool, allowed| {
        if valid { Ok(()) } else { Err(PlacementError::InvalidOption { option, value: f64::from(value), allowed }) }
    };
    let (overlap, repair) = (settings.overlap, settings.repair);
    check("overlap", overlap, overlap > 0.0 && overlap.is_finite(), "greater than 0")?;
    check("repair", repair, (0.0..=1.0).contains(&repair), "from 0 to 1")
}
