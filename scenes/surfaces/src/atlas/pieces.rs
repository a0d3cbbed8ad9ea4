//! Which texels of the light map's levels are one piece of surface: all that they cover is joined along the surface, so that no
//! wall stands between two parts of it.

use super::TexelMap;
use crate::{Sets, rays::RayCaster};
use glam::Vec3;
use rayon::prelude::*;

/// How far above the surface neighbors look for each other, over their distance.
const LIFT: f32 = 0.02;
/// How far above the middle they may look around an edge of the surface, over their distance: around bends of 49 degrees,
/// where 0.25 cos(x) = 0.5 tan(x), x half of it.
const AROUND: f32 = 0.25;
/// No covered texel.
const NOBODY: u32 = u32::MAX;

/// Whether a texel of a level is one piece.
pub struct Pieces {
    /// `[texels]` of each level.
    is_one: Vec<Vec<bool>>,
}

impl Pieces {
    /// Of the covered texels of a map whose size is a power of two. Neighbors of one chart are joined if they see each other from
    /// just above the surface.
    pub fn of(caster: &RayCaster<'_>, map: &TexelMap) -> Self {
        let size = map.size as usize;
        let mut at = vec![NOBODY; size * size];
        for (number, texel) in map.texels.iter().enumerate() {
            at[texel.index as usize] = number as u32;
        }
        let scene = caster.scene();
        let places: Vec<(Vec3, Vec3)> = map
            .texels
            .par_iter()
            .map(|texel| {
                let (mesh, triangle, weights) = (texel.mesh as usize, texel.triangle as usize, texel.barycentrics);
                (scene.position(mesh, triangle, weights), scene.geometric_normal(mesh, triangle))
            })
            .collect();
        // Joined neighbors, and the first level on which one texel holds both.
        let joined_from = |number: usize| {
            let texel = &map.texels[number];
            let (x, y) = (texel.index as usize % size, texel.index as usize / size);
            let neighbors = [(x + 1, y), (x, y + 1)].into_iter().filter(|&(x, y)| x < size && y < size);
            let (at, places) = (&at, &places);
            neighbors.filter_map(move |(to_x, to_y)| {
                let other = at[to_y * size + to_x];
                let is_joined = other != NOBODY
                    && map.texels[other as usize].chart == texel.chart
                    && see_each_other(caster, places[number], places[other as usize]);
                let apart = (x ^ to_x) | (y ^ to_y);
                is_joined.then_some((usize::BITS - apart.leading_zeros(), number as u32, other))
            })
        };
        let mut joined: Vec<(u32, u32, u32)> =
            (0..map.texels.len()).into_par_iter().flat_map_iter(joined_from).collect();
        joined.sort_unstable();

        let mut sets = Sets::new(map.texels.len());
        let mut next = joined.into_iter().peekable();
        let mut pieces: Vec<u32> = at.iter().map(|&texel| u32::from(texel != NOBODY)).collect();
        let mut is_one = vec![pieces.iter().map(|&pieces| pieces == 1).collect()];
        for level in 1..=map.size.ilog2() {
            let half = size >> level;
            let mut above = vec![0; half * half];
            for (texel, &pieces) in pieces.iter().enumerate() {
                let (x, y) = (texel % (2 * half), texel / (2 * half));
                above[y / 2 * half + x / 2] += pieces;
            }
            while let Some((_, a, b)) = next.next_if(|link| link.0 == level) {
                if sets.lowest(a) != sets.lowest(b) {
                    sets.join(a, b);
                    let index = map.texels[a as usize].index as usize;
                    above[((index / size) >> level) * half + ((index % size) >> level)] -= 1;
                }
            }
            is_one.push(above.iter().map(|&pieces| pieces == 1).collect());
            pieces = above;
        }
        Self { is_one }
    }

    /// All of a map of `size` texels per side is one piece, whatever stands on it.
    pub fn whole(size: u32) -> Self {
        let texels = |level: u32| 1 << (2 * (size.ilog2() - level));
        Self { is_one: (0..=size.ilog2()).map(|level| vec![true; texels(level)]).collect() }
    }

    /// Whether a texel of a level, by `y * size of the level + x`, covers one piece of surface.
    pub fn is_one(&self, level: u32, texel: u32) -> bool {
        self.is_one[level as usize][texel as usize]
    }
}

/// Straight above the surface, or over a point higher above the middle, where the surface bends.
pub fn see_each_other(caster: &RayCaster<'_>, a: (Vec3, Vec3), b: (Vec3, Vec3)) -> bool {
    let (from, to) = lifted(caster, a, b);
    if caster.visible(from, to) {
        return true;
    }
    let above = (AROUND * a.0.distance(b.0)).max(caster.offset_m());
    let middle = 0.5 * (a.0 + b.0) + 0.5 * (a.1 + b.1) * above;
    caster.visible(from, middle) && caster.visible(middle, to)
}

/// Straight above the surface only: between points of one plane.
pub fn see_straight(caster: &RayCaster<'_>, a: (Vec3, Vec3), b: (Vec3, Vec3)) -> bool {
    let (from, to) = lifted(caster, a, b);
    caster.visible(from, to)
}

/// Where two points of a surface, given with their normals, look for each other from.
pub fn lifted(caster: &RayCaster<'_>, a: (Vec3, Vec3), b: (Vec3, Vec3)) -> (Vec3, Vec3) {
    let lift = (LIFT * a.0.distance(b.0)).max(caster.offset_m());
    (a.0 + lift * a.1, b.0 + lift * b.1)
}

#[cfg(test)]
mod tests {
    use super::super::{Atlas, texels};
    use super::*;
    use crate::test_scenes::{plane, scene};
    use glam::Vec2;
    use localprt_scenes::{Mesh, Scene};

    const SIZE: u32 = 64;

    /// A floor of 4 x 4 m over the whole map, and something on it.
    fn pieces(mut floor: Mesh, others: Vec<Mesh>) -> Pieces {
        floor.uv_sets = vec![Vec::new(), floor.positions.iter().map(|at| Vec2::new(at.x, at.z) / 4.0).collect()];
        let mut meshes = vec![floor];
        meshes.extend(others);
        let scene: Scene = scene(meshes);
        Pieces::of(&RayCaster::new(&scene).expect("tree"), &texels::cover(&scene, &Atlas::of(&scene), SIZE))
    }

    fn floor(columns: u32) -> Mesh {
        plane("floor", Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Z, columns, 1)
    }

    #[test]
    fn an_open_floor_is_one_piece_on_every_level() {
        let pieces = pieces(floor(1), Vec::new());
        let levels = SIZE.ilog2();
        assert!((0..=levels).all(|level| (0..(SIZE >> level).pow(2)).all(|texel| pieces.is_one(level, texel))));
    }

    #[test]
    fn a_wall_parts_the_texels_on_its_two_sides_and_no_others() {
        // Between the centers of columns 24 and 25, at 1.531 and 1.594 m: column 12 of level 1 holds both.
        let wall = plane("wall", Vec3::new(1.57, -0.1, -0.1), 4.2 * Vec3::Z, Vec3::Y, 1, 1);
        let parted = pieces(floor(1), vec![wall]);
        for (level, column) in [(1, 12), (2, 6), (3, 3), (4, 1), (5, 0), (6, 0)] {
            let size = SIZE >> level;
            for texel in 0..size * size {
                assert_eq!(parted.is_one(level, texel), texel % size != column, "level {level}, texel {texel}");
            }
        }
        // A wall that ends in the middle of the floor can be walked around.
        let short = plane("wall", Vec3::new(1.57, -0.1, -0.1), 2.1 * Vec3::Z, Vec3::Y, 1, 1);
        let around = pieces(floor(1), vec![short]);
        assert!(around.is_one(6, 0) && !around.is_one(3, 3) && around.is_one(3, 7 * 8 + 3));
    }

    #[test]
    fn a_bent_surface_is_one_piece() {
        // A ridge of 44 degrees along z, and a valley: slopes of 0.4.
        for height in [0.4, -0.4] {
            let mut bent = floor(4);
            for at in &mut bent.positions {
                at.y = height * (2.0 - (at.x - 2.0).abs());
            }
            assert!(pieces(bent, Vec::new()).is_one(6, 0), "height {height}");
        }
    }
}
