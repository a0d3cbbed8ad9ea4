//! Openings to the sky as receivers see them: where a single receiver's rays are too few.
//!
//! A window that fills a hundredth of the view gets 5 rays of 512, and under a gray sky that is most of the noise. So the sky columns are
//! sums over a lattice [`SKY_TIMES`](super::gather::SKY_TIMES) times as fine, whose rays need to know no more than whether they escape.
//! Most of them need not be traced: neighbors that face the same way look in a part of the directions each, and where all that they saw
//! around a direction was sky, or none of it was, so is the rest, but where the receiver's own gather rays say otherwise. What is left are
//! the borders of what they see the sky through.

use super::{TransportScene, traced::Traced};
use crate::rays::OccluderHint;
use glam::Vec3;

/// Cells per side of an octahedron unfolded to a square.
const SIDE: usize = 32;
const CELLS: usize = SIDE * SIDE;
/// Receivers that share what they see: so many that face the same way and follow each other in a leaf, or fewer.
const GROUP: usize = 32;
/// Of the lattice the first of a group looks in one in so many directions; where the firsts see no sky there is none.
const FIRST_ONE_IN: u32 = 2;
/// The same of the others, each in directions of its own. A part of a Fibonacci lattice is a lattice as good as the multiple of the golden
/// ratio is hard to approximate; of 16, say, directions lie on nine arms.
const ONE_IN: u32 = 15;
/// Rays that have to agree around a direction.
const LEAST_RAYS: u32 = 8;

/// Directions in which the receivers of a leaf see the sky through openings.
#[derive(Clone, Debug)]
pub(super) struct Openings {
    /// `[n_members]` receivers, rising, and the group of each.
    groups: Vec<(u32, u32)>,
    /// `[n_groups][CELLS]` whether there is sky; `None` where that is not known.
    is_sky: Vec<Option<bool>>,
}

impl Openings {
    /// Of a leaf's receivers; `None` if they see no sky.
    pub fn of(scene: &TransportScene<'_>, members: &[u32], traced: &mut Traced) -> Option<Self> {
        let groups = groups(scene, members);
        // Rays that met a surface, and those that met none.
        let mut counts = vec![[0u32; 2]; groups.len() * CELLS];
        let mut look = |group: usize, number: usize, one_in: u32| {
            let sites = scene.receivers.sites(groups[group][number] as usize);
            let counts = &mut counts[group * CELLS..][..CELLS];
            let mut hint = OccluderHint::default();
            let mut sees_sky = false;
            for ray in scene.gather.rays_to_sky(sites, scene.caster.offset_m(), [number as u32, one_in]) {
                let escapes = traced.escapes(scene.caster, ray.origin, ray.dir, &mut hint);
                counts[cell(ray.dir)][usize::from(escapes)] += 1;
                sees_sky |= escapes;
            }
            sees_sky
        };
        // All of them look: what they see counts for their groups.
        let see_sky = (0..groups.len()).filter(|&group| look(group, 0, FIRST_ONE_IN)).count();
        if see_sky == 0 {
            return None;
        }
        for (group, members) in groups.iter().enumerate() {
            (1..members.len()).for_each(|number| {
                look(group, number, ONE_IN);
            });
        }
        let known = |counts: &[[u32; 2]], at: usize| {
            let [met, escaped] =
                around(at).fold([0, 0], |sums, cell| [sums[0] + counts[cell][0], sums[1] + counts[cell][1]]);
            match (met, escaped) {
                (LEAST_RAYS.., 0) => Some(false),
                (0, LEAST_RAYS..) => Some(true),
                _ => None,
            }
        };
        let is_sky = counts.chunks_exact(CELLS).flat_map(|counts| (0..CELLS).map(|at| known(counts, at))).collect();
        let of_group = |(group, members): (usize, &Vec<u32>)| {
            members.iter().map(move |&member| (member, group as u32)).collect::<Vec<_>>()
        };
        let mut groups: Vec<(u32, u32)> = groups.iter().enumerate().flat_map(of_group).collect();
        groups.sort_unstable();
        Some(Self { groups, is_sky })
    }

    /// What a receiver of the leaf sees.
    ///
    /// # Panics
    /// If it is none of the leaf.
    pub fn of_receiver(&self, receiver: u32) -> View<'_> {
        let at = self.groups.binary_search_by_key(&receiver, |of| of.0).expect("receiver is in the leaf");
        let is_sky = &self.is_sky[self.groups[at].1 as usize * CELLS..][..CELLS];
        View { is_sky, doubted: [false; CELLS] }
    }
}

/// Openings as one receiver sees them.
#[derive(Clone, Debug)]
pub(super) struct View<'a> {
    /// `[CELLS]` what its group saw.
    is_sky: &'a [Option<bool>],
    /// Around what it saw otherwise.
    doubted: [bool; CELLS],
}

impl View<'_> {
    /// Takes in that the receiver's own ray in a direction escapes, or does not.
    pub fn show(&mut self, dir: Vec3, escapes: bool) {
        let at = cell(dir);
        if self.is_sky[at].is_some_and(|is_sky| is_sky != escapes) {
            around(at).for_each(|cell| self.doubted[cell] = true);
        }
    }

    /// Whether there is sky in a direction; `None` if a ray has to look.
    pub fn is_sky(&self, dir: Vec3) -> Option<bool> {
        let at = cell(dir);
        self.is_sky[at].filter(|_| !self.doubted[at])
    }
}

/// Groups of a leaf's receivers. Points in the open, which stand far apart, have one each.
fn groups(scene: &TransportScene<'_>, members: &[u32]) -> Vec<Vec<u32>> {
    if scene.gather.is_sphere() {
        return members.iter().map(|&member| vec![member]).collect();
    }
    let mut by_facing = vec![Vec::new(); 6];
    for &member in members {
        let normal = scene.receivers.normal(member as usize).unwrap_or_default();
        let axis = normal.abs().max_position();
        by_facing[2 * axis + usize::from(normal[axis] > 0.0)].push(member);
    }
    by_facing.iter().flat_map(|members: &Vec<u32>| members.chunks(GROUP).map(<[u32]>::to_vec)).collect()
}

fn cell(dir: Vec3) -> usize {
    let flat = dir / (dir.x.abs() + dir.y.abs() + dir.z.abs());
    let (x, z) = match flat.y >= 0.0 {
        true => (flat.x, flat.z),
        false => ((1.0 - flat.z.abs()).copysign(flat.x), (1.0 - flat.x.abs()).copysign(flat.z)),
    };
    let within = |place: f32| (((0.5 * place + 0.5) * SIDE as f32) as usize).min(SIDE - 1);
    within(z) * SIDE + within(x)
}

/// A cell and the eight around it.
fn around(at: usize) -> impl Iterator<Item = usize> {
    let (x, y) = ((at % SIDE) as i32, (at / SIDE) as i32);
    (-1..=1).flat_map(move |down| (-1..=1).map(move |right| beside(x + right, y + down)))
}

/// The cell of a place up to one cell beyond the square: beyond an edge lies the other half of that edge.
fn beside(x: i32, y: i32) -> usize {
    let last = SIDE as i32 - 1;
    let is_out = |place: i32| !(0..=last).contains(&place);
    let within = |place: i32| place.clamp(0, last) as usize;
    let (x, y) = match (is_out(x), is_out(y)) {
        (true, false) => (within(x), within(last - y)),
        (false, true) => (within(last - x), within(y)),
        (true, true) => (within(last - x), within(last - y)),
        (false, false) => (within(x), within(y)),
    };
    y * SIDE + x
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::spherical_fibonacci;

    #[test]
    fn a_receivers_own_rays_overrule_its_group() {
        let groups = vec![(3, 0), (8, 1)];
        let is_sky = [vec![Some(false); CELLS], vec![Some(true); CELLS]].concat();
        let openings = Openings { groups, is_sky };
        for (receiver, of_group) in [(3, false), (8, true)] {
            let mut view = openings.of_receiver(receiver);
            view.show(Vec3::Y, of_group);
            assert_eq!(view.is_sky(Vec3::Y), Some(of_group), "a ray that agrees changes nothing");
            view.show(Vec3::X, !of_group);
            // A cell is 3 to 6 degrees wide.
            let beside = Vec3::new(1.0, 0.05, 0.05);
            assert_eq!([Vec3::X, beside, Vec3::Z].map(|dir| view.is_sky(dir)), [None, None, Some(of_group)]);
        }
        assert_eq!(openings.of_receiver(3).is_sky(Vec3::X), Some(false), "others are not told");
    }

    #[test]
    fn cells_beside_a_cell_hold_the_directions_around() {
        let directions: Vec<Vec3> = (0..20_000).map(|i| Vec3::from(spherical_fibonacci(i, 20_000))).collect();
        let mut middle = vec![Vec3::ZERO; CELLS];
        directions.iter().for_each(|&dir| middle[cell(dir)] += dir);
        for at in 0..CELLS {
            let (x, y) = ((at % SIDE) as i32, (at / SIDE) as i32);
            for (right, down) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let angle = middle[at].angle_between(middle[beside(x + right, y + down)]);
                // An edge of 90 degrees has 32 cells, narrower ones at its ends; the largest are 1.7 times as wide.
                assert!(angle > 0.01 && angle < 0.17, "{x}, {y}: {angle}");
            }
        }
    }
}
