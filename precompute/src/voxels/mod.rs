//! The scene as voxels: solid, open (the space to light) or enclosed.
//!
//! First step of section 4.1. [`spacing`] settles the probe spacing rho, [`VoxelGrid::build`] rasterizes every triangle
//! and decides which empty regions are part of the space to light. Probes are placed by [`crate::probes`].
//!
//! Triangles with an alpha mask count as solid throughout: a voxel is far coarser than a mask's holes, and probes are
//! better off outside of foliage and grilles.

mod flood_fill;
mod rasterize;
mod spacing;
#[cfg(test)]
pub(crate) mod test_scenes;
#[cfg(test)]
mod tests;

pub use flood_fill::{MAX_BACK_SHARE, Surroundings, surroundings};
pub use spacing::{DEFAULT_PROBES, grid_points, spacing, spacing_for};

use crate::{rays::RayCaster, settings::BakeSettings};
use glam::{DVec3, UVec3, Vec3};
use localprt_scenes::Scene;

/// Most voxels of a grid: one byte each, 64 MiB.
pub const MAX_VOXELS: u64 = 64 << 20;
/// Empty voxels around the scene box. The half puts the lower faces of the box in the middle of a layer, so that an
/// axis-aligned wall there fills one layer and not two.
const PADDING: f64 = 2.5;
/// Default voxels per probe spacing (ANCHORS leave it open; 6 resolves a doorway of half a spacing).
const VOXELS_PER_SPACING: f64 = 6.0;
/// Default voxels along the longest side of the scene box, at least, so that a bake with two probes still sees rooms.
const LEAST_VOXELS_LONGEST: f64 = 32.0;
/// Default voxels along the shortest side that is not flat, at least, so that a wide low level keeps its open space.
const LEAST_VOXELS_SHORTEST: f64 = 8.0;
/// That rule makes voxels no smaller than this fraction of the longest side.
const MOST_VOXELS_LONGEST: f64 = 256.0;
/// Where probes stand closer than rho, the grid takes at most this share of [`MAX_VOXELS`] for it.
const MOST_FOR_CLOSER: u64 = 16;
/// Voxels are at least this many roundings of the largest coordinate, so that neighboring centers differ.
const LEAST_ROUNDINGS: f64 = 8.0;

/// What a voxel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Voxel {
    /// A triangle touches it.
    Solid,
    /// Empty, and part of the space to light.
    Open,
    /// Empty, but inside closed geometry or behind surfaces.
    Enclosed,
}

/// A regular grid over the scene box and its padding.
#[derive(Clone, Debug)]
pub struct VoxelGrid {
    /// Lowest corner, metres.
    pub origin: Vec3,
    /// Edge of a voxel, metres.
    pub voxel_m: f32,
    /// Voxels per axis.
    pub size: UVec3,
    /// `[z][y][x]`.
    pub voxels: Vec<Voxel>,
}

/// Why a scene could not be made into voxels.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VoxelError {
    /// Nothing to place probes around.
    #[error("the scene has no triangles, so there is no space to place probes in")]
    EmptyScene,
    /// The scene box is not finite.
    #[error("the scene reaches from {low} to {high}, which is not finite")]
    NotFinite {
        /// Lowest corner of the scene box.
        low: Vec3,
        /// Highest corner of the scene box.
        high: Vec3,
    },
    /// A length option is zero, negative or not finite.
    #[error("{option} is {value} m, which is no length")]
    InvalidLength {
        /// The option's name.
        option: &'static str,
        /// What it was.
        value: f32,
    },
    /// The asked-for voxels would not fit the memory cap, or not be told apart in f32.
    #[error("voxel size {voxel_m} m is too small for this scene, which needs {smallest_m} m at least")]
    VoxelTooSmall {
        /// What was asked for, metres.
        voxel_m: f32,
        /// Smallest size that fits, metres.
        smallest_m: f32,
    },
    /// An interior point outside of the grid.
    #[error("interior point {index} at {point} is outside the scene, which reaches from {low} to {high}")]
    InteriorOutside {
        /// Which one, from 0.
        index: usize,
        /// Where.
        point: Vec3,
        /// Lowest corner of the grid.
        low: Vec3,
        /// Highest corner of the grid.
        high: Vec3,
    },
    /// An interior point in geometry.
    #[error(
        "interior point {index} at {point} is inside geometry: no empty voxel of {voxel_m} m beside it can be seen from it"
    )]
    InteriorSolid {
        /// Which one, from 0.
        index: usize,
        /// Where.
        point: Vec3,
        /// Voxel size, metres.
        voxel_m: f32,
    },
}

impl VoxelError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::EmptyScene => "export surfaces with the scene".into(),
            Self::NotFinite { .. } => "mend or remove the meshes whose coordinates are not finite".into(),
            Self::InvalidLength { .. } => "give a finite length above 0 m".into(),
            Self::VoxelTooSmall { smallest_m, .. } => format!("give a voxel size of {smallest_m} m or more"),
            Self::InteriorOutside { .. } => "move the point into the scene".into(),
            Self::InteriorSolid { .. } => "move the point into the open or use a smaller voxel size".into(),
        }
    }

    /// Whether the scene is to be mended, and not an option.
    pub(crate) fn is_of_scene(&self) -> bool {
        matches!(self, Self::EmptyScene | Self::NotFinite { .. })
    }
}

impl VoxelGrid {
    /// Rasterizes a scene and finds its open space.
    ///
    /// `rho` is the probe spacing in metres, `closest_m` the one where probes stand closest. A voxel measures `settings.voxel`, or
    /// rho / 6, less where that would not resolve the scene box (32 voxels along its longest side, 8 along its shortest), as small as
    /// `closest_m` / 6 as far as a sixteenth of [`MAX_VOXELS`] goes, and more where the grid would pass [`MAX_VOXELS`].
    ///
    /// # Errors
    ///
    /// [`VoxelError::EmptyScene`] and [`VoxelError::NotFinite`] for the scene, the others for the options.
    pub fn build(
        scene: &Scene,
        caster: &RayCaster,
        rho: f32,
        closest_m: f32,
        settings: &BakeSettings,
    ) -> Result<Self, VoxelError> {
        let (low, high) = scene.bounds().ok_or(VoxelError::EmptyScene)?;
        if !low.is_finite() || !high.is_finite() {
            return Err(VoxelError::NotFinite { low, high });
        }
        let voxel_m = voxel_size((low, high), rho, closest_m, settings)?;
        let origin = (low.as_dvec3() - PADDING * f64::from(voxel_m)).as_vec3();
        let cells = axis_voxels(high.as_dvec3() - low.as_dvec3(), f64::from(voxel_m));
        let size = UVec3::new(cells.x as u32, cells.y as u32, cells.z as u32);
        let solid = rasterize::solid_voxels(scene, origin, voxel_m, size);
        let mut grid = Self { origin, voxel_m, size, voxels: Vec::new() };
        grid.voxels = flood_fill::classify(&grid, solid, caster, settings)?;
        Ok(grid)
    }

    /// Voxel that holds a point; `None` outside of the grid.
    pub fn at(&self, point: Vec3) -> Option<Voxel> {
        self.cell_at(point).map(|cell| self.voxels[self.index(cell)])
    }

    /// Cell that holds a point; `None` outside of the grid.
    pub fn cell_at(&self, point: Vec3) -> Option<UVec3> {
        let cell = ((point - self.origin) / self.voxel_m).floor();
        if cell.cmplt(Vec3::ZERO).any() || !cell.is_finite() {
            return None;
        }
        let cell = cell.as_uvec3();
        if cell.cmpge(self.size).any() { None } else { Some(cell) }
    }

    /// Index of a cell in [`VoxelGrid::voxels`].
    pub fn index(&self, cell: UVec3) -> usize {
        ((cell.z as usize * self.size.y as usize) + cell.y as usize) * self.size.x as usize + cell.x as usize
    }

    /// Cell of an index in [`VoxelGrid::voxels`].
    pub fn cell(&self, index: usize) -> UVec3 {
        let (x, y) = (self.size.x as usize, self.size.y as usize);
        UVec3::new((index % x) as u32, (index / x % y) as u32, (index / (x * y)) as u32)
    }

    /// Center of a cell, metres.
    pub fn center(&self, cell: UVec3) -> Vec3 {
        self.origin + (cell.as_vec3() + 0.5) * self.voxel_m
    }

    /// Indices of the up to 26 neighbors of a cell, rising.
    pub fn neighbors(&self, cell: UVec3) -> impl Iterator<Item = usize> + '_ {
        let low = cell.saturating_sub(UVec3::ONE);
        let high = (cell + UVec3::ONE).min(self.size - UVec3::ONE);
        (low.z..=high.z)
            .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| UVec3::new(x, y, z))))
            .filter(move |&other| other != cell)
            .map(|other| self.index(other))
    }

    /// Number of voxels of a kind.
    pub fn count(&self, kind: Voxel) -> usize {
        self.voxels.iter().filter(|&&voxel| voxel == kind).count()
    }
}

/// Edge of a voxel in metres, by the rules of [`VoxelGrid::build`].
fn voxel_size((low, high): (Vec3, Vec3), rho: f32, closest_m: f32, settings: &BakeSettings) -> Result<f32, VoxelError> {
    let positive = |option, value: f32| {
        if value > 0.0 && value.is_finite() { Ok(value) } else { Err(VoxelError::InvalidLength { option, value }) }
    };
    let rho = f64::from(positive("spacing", rho)?);
    let extent = high.as_dvec3() - low.as_dvec3();
    let largest_coordinate = low.abs().max(high.abs()).max_element();
    let smallest_m = smallest_voxel(extent, largest_coordinate, MAX_VOXELS);
    if let Some(voxel_m) = settings.voxel {
        positive("voxel", voxel_m)?;
        if voxel_m < smallest_m {
            return Err(VoxelError::VoxelTooSmall { voxel_m, smallest_m });
        }
        return Ok(voxel_m);
    }
    let longest = extent.max_element();
    let mut voxel_m = rho / VOXELS_PER_SPACING;
    if longest > 0.0 {
        let flat = longest / MOST_VOXELS_LONGEST;
        let shortest = extent.to_array().into_iter().filter(|&side| side > flat).fold(longest, f64::min);
        voxel_m = voxel_m.min(longest / LEAST_VOXELS_LONGEST).min((shortest / LEAST_VOXELS_SHORTEST).max(flat));
    }
    let mut voxel_m = voxel_m as f32;
    let affordable_m = smallest_voxel(extent, largest_coordinate, MAX_VOXELS / MOST_FOR_CLOSER);
    voxel_m = voxel_m.min((closest_m / VOXELS_PER_SPACING as f32).max(affordable_m));
    Ok(voxel_m.max(smallest_m))
}

/// Smallest voxel that keeps a grid of at most so many voxels and its centers apart in f32, metres.
fn smallest_voxel(extent: DVec3, largest_coordinate: f32, most: u64) -> f32 {
    let fits = |voxel_m: f64| axis_voxels(extent, voxel_m).element_product() <= most as f64;
    // At the longest side as the voxel there are 6 voxels per axis at most; 2^26 times finer is always too much.
    let (mut small, mut large) = (extent.max_element() / MAX_VOXELS as f64, extent.max_element());
    for _ in 0..40 {
        let middle = (small * large).sqrt();
        if fits(middle) {
            large = middle;
        } else {
            small = middle;
        }
    }
    let apart = LEAST_ROUNDINGS * f64::from(f32::EPSILON) * f64::from(largest_coordinate);
    // Rounded up, so that the size printed by an error is accepted.
    (large.max(apart) as f32 * (1.0 + 2.0 * f32::EPSILON)).max(f32::MIN_POSITIVE)
}

/// Voxels per axis, padding included: scene box from 2.5 voxels above the origin, at least 2 whole voxels above it.
fn axis_voxels(extent: DVec3, voxel_m: f64) -> DVec3 {
    (extent / voxel_m + PADDING).floor() + 3.0
}
