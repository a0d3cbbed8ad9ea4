//! The smallest of scale plus distance over many samples.

use glam::Vec3;

/// Samples of a leaf.
const LEAF: usize = 8;

/// Samples in a tree of boxes, each with the smallest scale below it.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    /// Of a node's two children the second follows all nodes of the first.
    nodes: Vec<Node>,
    /// Positions and scales in tree order.
    points: Vec<(Vec3, f32)>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    least: f32,
    first: u32,
    count: u32,
    /// Second child; 0 for a leaf.
    second: u32,
}

impl Tree {
    /// `None` of nothing.
    pub(super) fn new(mut points: Vec<(Vec3, f32)>) -> Option<Self> {
        if points.is_empty() {
            return None;
        }
        let mut nodes = Vec::new();
        let count = points.len();
        build(&mut nodes, &mut points, 0, count);
        Some(Self { nodes, points })
    }

    /// min over samples of scale + distance, metres.
    pub(super) fn scale(&self, position: Vec3) -> f32 {
        let mut best = f32::INFINITY;
        self.visit(0, position, &mut best);
        best
    }

    fn visit(&self, index: usize, position: Vec3, best: &mut f32) {
        let node = &self.nodes[index];
        if node.bound(position) >= *best {
            return;
        }
        if node.second == 0 {
            for &(point, scale) in &self.points[node.first as usize..(node.first + node.count) as usize] {
                *best = best.min(scale + point.distance(position));
            }
            return;
        }
        let (first, second) = (index + 1, node.second as usize);
        let is_nearer = self.nodes[second].bound(position) < self.nodes[first].bound(position);
        let order = if is_nearer { [second, first] } else { [first, second] };
        order.into_iter().for_each(|child| self.visit(child, position, best));
    }
}

impl Node {
    /// No sample below gives less.
    fn bound(&self, position: Vec3) -> f32 {
        self.least + (self.low - position).max(position - self.high).max(Vec3::ZERO).length()
    }
}

/// Halves `points[first..end]` along the longest side of their box until few are left.
fn build(nodes: &mut Vec<Node>, points: &mut [(Vec3, f32)], first: usize, end: usize) {
    let own = &mut points[first..end];
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY, f32::INFINITY);
    let (low, high, least) = own
        .iter()
        .fold(start, |(low, high, least), &(point, scale)| (low.min(point), high.max(point), least.min(scale)));
    let index = nodes.len();
    nodes.push(Node { low, high, least, first: first as u32, count: own.len() as u32, second: 0 });
    if own.len() <= LEAF {
        return;
    }
    let axis = (high - low).max_position();
    let middle = own.len() / 2;
    own.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    build(nodes, points, first, first + middle);
    nodes[index].second = nodes.len() as u32;
    build(nodes, points, first + middle, end);
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_uniform;

    #[test]
    fn the_tree_finds_what_a_loop_finds() {
        let point = |index: u64| Vec3::from([0, 1, 2].map(|axis| counter_uniform(1, index, axis) as f32));
        let points: Vec<(Vec3, f32)> =
            (0..500).map(|index| (point(index), counter_uniform(2, index, 0) as f32 * 0.3)).collect();
        let tree = Tree::new(points.clone()).unwrap();
        for query in 1000..1100 {
            let position = point(query) * 1.5;
            let expected =
                points.iter().map(|&(at, scale)| scale + at.distance(position)).fold(f32::INFINITY, f32::min);
            assert_eq!(tree.scale(position), expected);
        }
        assert!(Tree::new(Vec::new()).is_none());
    }
}
