//! The scene as voxels: solid, open (the space to light) or enclosed.

use glam::{UVec3, Vec3};

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

impl VoxelGrid {
    /// Voxel that holds a point; `None` outside of the grid.
    pub fn at(&self, point: Vec3) -> Option<Voxel> {
        let cell = ((point - self.origin) / self.voxel_m).floor();
        if cell.cmplt(Vec3::ZERO).any() || !cell.is_finite() {
            return None;
        }
        let cell = cell.as_uvec3();
        if cell.cmpge(self.size).any() {
            return None;
        }
        Some(self.voxels[self.index(cell)])
    }

    /// Index of a cell in [`VoxelGrid::voxels`].
    pub fn index(&self, cell: UVec3) -> usize {
        ((cell.z as usize * self.size.y as usize) + cell.y as usize) * self.size.x as usize + cell.x as usize
    }

    /// Centre of a cell, metres.
    pub fn center(&self, cell: UVec3) -> Vec3 {
        self.origin + (cell.as_vec3() + 0.5) * self.voxel_m
    }
}
