//! An eight-wide tree and its traversal: the eight boxes of a node side by side, and the triangles of a leaf.
//!
//! Tests of boxes and blocks are there for every processor, and with AVX2 (`avx2.rs`); which are taken is chosen when a tree is made. All
//! triangles are tested by the same arithmetic without fused operations, and boxes hold more than they must: what is met does not depend on the
//! processor.

use super::TriangleHit;
#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::triangles::{LANES, Shear, Triangle, TriangleBlock};
use glam::Vec3;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Nodes and leaves that may wait at once.
pub(super) const MAX_STACK: usize = 160;
/// In the number of a child: the rest is that of a block of triangles.
const LEAF: u32 = 1 << 31;
/// Of a distance to a box's far side, for the roundings on the way to it (Ize 2013, Robust BVH Ray Traversal).
pub(super) const FAR_SIDE: f32 = 1.0 + 4.0 * f32::EPSILON;
/// Least component of a direction for box tests: a ray is off by less than a rounding within a billion metres, and no box test divides by
/// zero.
const LEAST_COMPONENT: f32 = 1e-18;

/// Boxes of the children, `[axis][low, high][child]`, and what they are. Boxes of children that are not there are inside out.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Node {
    pub bounds: [[[f32; WIDTH]; 2]; 3],
    children: [u32; WIDTH],
}

/// A box with what is in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    pub low: Vec3,
    pub high: Vec3,
    number: u32,
}

impl Child {
    /// Of a node.
    pub fn number(&self) -> u32 {
        self.number
    }
}

/// A tree over triangles in its own order.
pub(super) struct WideTree {
    nodes: Vec<Node>,
    blocks: Vec<TriangleBlock>,
    /// If this processor has them.
    #[cfg(target_arch = "x86_64")]
    avx2: Option<Avx2>,
}

/// How boxes and triangles are tested, side by side.
pub(super) trait Tests: Copy {
    /// Where the ray meets the boxes of a node, and which of them it meets before `reach`, a bit each.
    fn boxes(self, slabs: &Slabs, node: &Node, reach: f32) -> ([f32; WIDTH], u32);

    /// [`Shear::candidates`].
    fn candidates(self, shear: &Shear, block: &TriangleBlock) -> u32;
}

/// With what every processor of this kind has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl Tests for Portable {
    #[inline(always)]
    fn boxes(self, slabs: &Slabs, node: &Node, reach: f32) -> ([f32; WIDTH], u32) {
        let mut nears = [0.0f32; WIDTH];
        let mut fars = [reach; WIDTH];
        for axis in 0..3 {
            let (origin, inverse) = (slabs.origin[axis], slabs.inverse[axis]);
            let first = &node.bounds[axis][slabs.first[axis]];
            let last = &node.bounds[axis][1 - slabs.first[axis]];
            for child in 0..WIDTH {
                let near = (first[child] - origin) * inverse;
                let far = (last[child] - origin) * inverse * FAR_SIDE;
                nears[child] = if near > nears[child] { near } else { nears[child] };
                fars[child] = if far < fars[child] { far } else { fars[child] };
            }
        }
        let met = (0..WIDTH).fold(0, |met, child| met | u32::from(nears[child] <= fars[child]) << child);
        (nears, met)
    }

    #[inline(always)]
    fn candidates(self, shear: &Shear, block: &TriangleBlock) -> u32 {
        shear.candidates(block)
    }
}

impl Node {
    const EMPTY: Self =
        Self { bounds: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3], children: [0; WIDTH] };
}

impl WideTree {
    /// Over nothing.
    pub fn empty() -> Self {
        let mut empty = Self::with_capacity(0);
        empty.add_node();
        empty
    }

    /// The same without what some processors have.
    #[cfg(all(test, target_arch = "x86_64"))]
    pub fn portable(self) -> Self {
        Self { avx2: None, ..self }
    }

    /// Without nodes, for so many triangles.
    pub fn with_capacity(n_triangles: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(n_triangles / 8),
            blocks: Vec::with_capacity(n_triangles / 2),
            #[cfg(target_arch = "x86_64")]
            avx2: Avx2::of_this_processor(),
        }
    }

    /// One more node, empty; the first is the root.
    pub fn add_node(&mut self) -> u32 {
        self.nodes.push(Node::EMPTY);
        self.nodes.len() as u32 - 1
    }

    /// A child that is a node.
    pub fn inner(&mut self, (low, high): (Vec3, Vec3)) -> Child {
        Child { low, high, number: self.add_node() }
    }

    /// A child that is a leaf of at most [`LANES`] triangles.
    pub fn leaf(&mut self, (low, high): (Vec3, Vec3), triangles: impl Iterator<Item = Triangle>) -> Child {
        let number = LEAF | self.blocks.len() as u32;
        let mut block = TriangleBlock::EMPTY;
        for (lane, triangle) in triangles.enumerate() {
            block.set(lane, &triangle);
        }
        self.blocks.push(block);
        Child { low, high, number }
    }

    /// Gives a node its children, at most [`WIDTH`].
    pub fn set_children(&mut self, node: u32, children: &[Child]) {
        let node = &mut self.nodes[node as usize];
        for (slot, child) in children.iter().enumerate() {
            for axis in 0..3 {
                node.bounds[axis][0][slot] = child.low[axis];
                node.bounds[axis][1][slot] = child.high[axis];
            }
            node.children[slot] = child.number;
        }
    }

    /// Block and lane of a place in the tree's order; `None` beyond it.
    pub fn at(&self, place: u32) -> Option<(&TriangleBlock, usize)> {
        let place = place as usize;
        Some((self.blocks.get(place / LANES)?, place % LANES))
    }

    /// The most that can wait while a ray is on its way.
    pub fn stack_need(&self) -> usize {
        let mut most = 0;
        let mut open = vec![(0u32, 0usize)];
        while let Some((number, waiting)) = open.pop() {
            let Some(node) = self.nodes.get(number as usize) else { continue };
            let children = (0..WIDTH).filter(|&child| node.bounds[0][0][child] <= node.bounds[0][1][child]);
            let beside = waiting + children.clone().count();
            most = most.max(beside);
            let inner = children.map(|child| node.children[child]).filter(|number| number & LEAF == 0);
            // The child that is taken waits no longer.
            open.extend(inner.map(|number| (number, beside - 1)));
        }
        most
    }

    /// As [`super::bvh::Tree::closest_hit`].
    pub fn closest_hit(
        &self,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<TriangleHit> {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = self.avx2 {
            return avx2.run(|| self.closest(avx2, origin, dir, t_max, confirm));
        }
        self.closest(Portable, origin, dir, t_max, confirm)
    }

    /// As [`super::bvh::Tree::occluder`], but for the hint.
    pub fn occluder(
        &self,
        shear: &Shear,
        dir: Vec3,
        t_max: f32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<u32> {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = self.avx2 {
            return avx2.run(|| self.any(avx2, shear, dir, t_max, confirm));
        }
        self.any(Portable, shear, dir, t_max, confirm)
    }

    #[inline(always)]
    fn closest(
        &self,
        tests: impl Tests,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<TriangleHit> {
        let shear = Shear::new(origin, dir);
        let slabs = Slabs::new(origin, dir);
        let mut nearest: Option<TriangleHit> = None;
        let mut reach = t_max;
        let mut stack = [(0.0f32, 0u32); MAX_STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (near, number) = stack[waiting];
            if near > reach {
                continue;
            }
            if number & LEAF == 0 {
                let node = &self.nodes[number as usize];
                let (nears, met) = tests.boxes(&slabs, node, reach);
                waiting = push(&mut stack, waiting, node, &nears, met);
                continue;
            }
            let block = &self.blocks[(number & !LEAF) as usize];
            let mut candidates = tests.candidates(&shear, block);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                // A tie has to pass for the comparison.
                let t_max = nearest.map_or(t_max, |nearest| nearest.t.next_up());
                let Some(hit) = shear.intersect(block, lane, t_max) else { continue };
                let precedes = nearest.is_none_or(|nearest| (hit.t, hit.triangle) < (nearest.t, nearest.triangle));
                if precedes && (!block.is_masked(lane) || confirm(&hit)) {
                    nearest = Some(hit);
                    reach = hit.t;
                }
            }
        }
        nearest
    }

    #[inline(always)]
    fn any(
        &self,
        tests: impl Tests,
        shear: &Shear,
        dir: Vec3,
        t_max: f32,
        confirm: impl Fn(&TriangleHit) -> bool,
    ) -> Option<u32> {
        let slabs = Slabs::new(shear.origin, dir);
        let mut stack = [(0.0f32, 0u32); MAX_STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (_, number) = stack[waiting];
            if number & LEAF == 0 {
                let node = &self.nodes[number as usize];
                let (nears, met) = tests.boxes(&slabs, node, t_max);
                waiting = push(&mut stack, waiting, node, &nears, met);
                continue;
            }
            let number = number & !LEAF;
            let block = &self.blocks[number as usize];
            let mut candidates = tests.candidates(shear, block);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                let hit = shear.intersect(block, lane, t_max);
                if hit.is_some_and(|hit| !block.is_masked(lane) || confirm(&hit)) {
                    return Some(number * LANES as u32 + lane as u32);
                }
            }
        }
        None
    }
}

/// Adds the children that are met, the nearest on top. Returns how many wait.
#[inline(always)]
fn push(stack: &mut [(f32, u32); MAX_STACK], first: usize, node: &Node, nears: &[f32; WIDTH], mut met: u32) -> usize {
    let mut waiting = first;
    while met != 0 {
        let child = met.trailing_zeros() as usize;
        met &= met - 1;
        let near = nears[child];
        let mut place = waiting;
        while place > first && stack[place - 1].0 < near {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = (near, node.children[child]);
        waiting += 1;
    }
    waiting
}

/// Per-ray constants of the box test.
pub(super) struct Slabs {
    pub origin: Vec3,
    pub inverse: Vec3,
    /// Which bound of each axis a ray meets first: 0 the low one, 1 the high one.
    pub first: [usize; 3],
}

impl Slabs {
    #[inline(always)]
    fn new(origin: Vec3, dir: Vec3) -> Self {
        let component = |axis: usize| {
            let size = dir[axis].abs().max(LEAST_COMPONENT);
            if dir[axis] < 0.0 { -size } else { size }
        };
        let inverse = Vec3::new(1.0 / component(0), 1.0 / component(1), 1.0 / component(2));
        Self { origin, inverse, first: [0, 1, 2].map(|axis| usize::from(dir[axis] < 0.0)) }
    }
}
