//! Patches: cells of the surfaces around a leaf, fine near it and coarse far away, one for each way that a surface faces.
//!
//! A patch is a cell of a grid whose edge doubles with the distance from the leaf's box, so that all patches fill about the
//! same solid angle there, times the axis and sign along which the surface's normal is longest: the two sides of a wall are
//! two patches, even where the wall is thinner than the cell.

use glam::{IVec3, Vec3};
use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
};

/// Doublings of the finest edge, at most.
const MOST_LEVELS: u32 = 15;
/// Grids start beside the planes that walls like to stand on.
const SHIFT: f32 = 0.371;

/// How fine patches are, by place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    /// Lower corner of the leaf's box.
    pub low: Vec3,
    /// Upper corner.
    pub high: Vec3,
    /// Edge of the finest patches, metres.
    pub finest_m: f32,
    /// Edge of a patch over its distance from the leaf, at most.
    pub angle: f32,
}

/// The patches of a leaf.
pub(super) struct Patches {
    cut: Cut,
    index: HashMap<u64, u32, BuildHasherDefault<KeyHasher>>,
    patches: Vec<Patch>,
}

/// Sums over the points of a patch.
struct Patch {
    position: Vec3,
    normal: Vec3,
    count: f32,
    glows: bool,
}

/// Where a patch is and which way it faces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Mean of its points, metres.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// It emits light.
    pub glows: bool,
}

/// Spreads keys, which are bits side by side, over the table.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }
}

impl Patches {
    pub(super) fn new(cut: Cut) -> Self {
        Self { cut, index: HashMap::default(), patches: Vec::new() }
    }

    /// How fine they are.
    pub(super) fn cut(&self) -> Cut {
        self.cut
    }

    pub(super) fn len(&self) -> usize {
        self.patches.len()
    }

    /// The patch of a surface point, new if need be; its place and way of facing are the means of the points added.
    pub(super) fn add(&mut self, position: Vec3, normal: Vec3, glows: bool) -> u32 {
        let (level, class) = (self.cut.level(position), class(normal, glows));
        let next = self.patches.len() as u32;
        let patch = *self.index.entry(key(level, class, self.cut.cell(level, position))).or_insert(next);
        if patch == next {
            self.patches.push(Patch { position: Vec3::ZERO, normal: Vec3::ZERO, count: 0.0, glows });
        }
        let sums = &mut self.patches[patch as usize];
        sums.position += position;
        sums.normal += normal;
        sums.count += 1.0;
        patch
    }

    /// The patch of a surface point, or one beside it that faces the same way.
    pub(super) fn find(&self, position: Vec3, normal: Vec3, glows: bool) -> Option<u32> {
        let (level, class) = (self.cut.level(position), class(normal, glows));
        let cell = self.cut.cell(level, position);
        let at = |cell: IVec3| self.index.get(&key(level, class, cell)).copied();
        at(cell).or_else(|| BESIDE.iter().find_map(|&step| at(cell + IVec3::from(step))))
    }

    /// Where they are.
    pub(super) fn places(&self) -> Vec<Place> {
        let place = |patch: &Patch| Place {
            position: patch.position / patch.count,
            normal: patch.normal.normalize_or_zero(),
            glows: patch.glows,
        };
        self.patches.iter().map(place).collect()
    }
}

/// Steps to the cells that share a face with a cell.
const BESIDE: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

impl Cut {
    fn level(&self, position: Vec3) -> u32 {
        let distance = (self.low - position).max(position - self.high).max(Vec3::ZERO).length();
        let wanted = self.angle * distance / self.finest_m;
        if wanted > 1.0 { (wanted.log2() as u32).min(MOST_LEVELS) } else { 0 }
    }

    fn cell(&self, level: u32, position: Vec3) -> IVec3 {
        let edge_m = self.finest_m * (1u32 << level) as f32;
        (position / edge_m + SHIFT).floor().as_ivec3()
    }
}

/// Axis and sign along which a normal is longest, and whether the surface emits, 0..12.
fn class(normal: Vec3, glows: bool) -> u64 {
    let axis = normal.abs().max_position();
    6 * u64::from(glows) + 2 * axis as u64 + u64::from(normal[axis] > 0.0)
}

fn key(level: u32, class: u64, cell: IVec3) -> u64 {
    let low = |value: i32| u64::from(value as u32 & 0x3_ffff);
    u64::from(level) << 58 | class << 54 | low(cell.x) << 36 | low(cell.y) << 18 | low(cell.z)
}
