//! A face in its own plane, split along lines into convex parts and those into triangles.

use super::crossings::Crossing;
use glam::{DVec2, DVec3, Vec3};

/// Parts thinner than this many texels are not split off...
const THINNEST: f64 = 0.35;
/// ...nor those thinner than this share of what is split.
const THINNEST_SHARE: f64 = 0.2;
/// A part is split where a line goes through it for so many texels...
const LEAST_CUT: f64 = 0.5;
/// ...or for this share of its own length.
const LEAST_CUT_SHARE: f64 = 0.3;
/// Parts smaller than this many texels stay whole.
const SMALLEST: f64 = 0.5;
/// Points closer than this many texels are one.
pub(super) const SAME: f64 = 0.02;
/// Parts of a face, at most.
const MOST_PARTS: usize = 2000;
/// A point is on a line that it leaves by no more than this share of the line's length.
const ROUNDING: f64 = 1e-6;
/// Area of a triangle over the square of its longest edge, at least: flatter ones are rounding.
const FLATTEST: f64 = 1e-10;

/// The plane of a face, with axes of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    origin: DVec3,
    axes: [DVec3; 2],
    pub normal: DVec3,
}

impl Frame {
    /// Of a face; `None` without area.
    pub(super) fn of(corners: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a).try_normalize()?;
        let x = (b - a).try_normalize()?;
        Some(Self { origin: a, axes: [x, normal.cross(x)], normal })
    }

    pub(super) fn flat(&self, place: DVec3) -> DVec2 {
        DVec2::from(self.axes.map(|axis| (place - self.origin).dot(axis)))
    }

    pub(super) fn height(&self, place: DVec3) -> f64 {
        (place - self.origin).dot(self.normal)
    }

    pub(super) fn place(&self, flat: DVec2) -> DVec3 {
        self.origin + self.axes[0] * flat.x + self.axes[1] * flat.y
    }
}

/// Where a point of a split face lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum On {
    /// A corner of the face.
    Corner(usize),
    /// The edge that starts at that corner, and how far along it from its lower end, 0 to 1.
    Edge(usize, f64),
    Inside,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub at: DVec2,
    pub on: On,
}

/// A convex part: points counter-clockwise, and of each side that starts at a point the edge of the face that it lies on.
#[derive(Clone, Debug)]
struct Part {
    points: Vec<u32>,
    sides: Vec<Option<usize>>,
}

/// A face and its parts.
#[derive(Clone, Debug)]
pub(super) struct Split {
    pub points: Vec<Point>,
    parts: Vec<Part>,
    corners: [DVec2; 3],
    /// Whether each edge starts at its lower end.
    is_upward: [bool; 3],
}

impl Split {
    /// The face whole; `is_upward` tells of each edge whether its lower end, as all faces agree on it, is where it starts.
    pub(super) fn new(corners: [DVec2; 3], is_upward: [bool; 3]) -> Self {
        let points = [0, 1, 2].map(|corner| Point { at: corners[corner], on: On::Corner(corner) });
        let whole = Part { points: vec![0, 1, 2], sides: vec![Some(0), Some(1), Some(2)] };
        Self { points: points.to_vec(), parts: vec![whole], corners, is_upward }
    }

    /// Whether it is whole.
    pub(super) fn is_whole(&self) -> bool {
        self.parts.len() == 1 && self.points.len() == 3
    }

    /// Splits the parts that a line goes through, each from side to side.
    pub(super) fn along(&mut self, line: &Crossing) {
        let Some(along) = (line.to - line.from).try_normalize() else { return };
        let before = self.parts.len();
        for index in 0..before {
            if self.parts.len() >= MOST_PARTS {
                return;
            }
            if let Some([left, right]) = self.halves(index, line, along) {
                self.parts[index] = left;
                self.parts.push(right);
            }
        }
    }

    /// The parts on the two sides of a line, if it goes through a part far enough and leaves no thin ones.
    fn halves(&mut self, index: usize, line: &Crossing, along: DVec2) -> Option<[Part; 2]> {
        let depth = |at: DVec2| along.perp_dot(at - line.from);
        let on_line = |at: DVec2| along.dot(at - line.from);
        let same = SAME * line.texel_m;
        let of_part = || self.parts[index].points.iter().map(|&point| self.points[point as usize].at);
        let (least, most) = span(of_part().map(depth));
        let (low, high) = span(of_part().map(on_line));
        let thinnest = (THINNEST * line.texel_m).min(THINNEST_SHARE * (most - least));
        let is_small = (most - least).max(high - low) < SMALLEST * line.texel_m;
        if most < thinnest || -least < thinnest || is_small {
            return None;
        }
        let depths: Vec<f64> = of_part().map(depth).map(|depth| if depth.abs() < same { 0.0 } else { depth }).collect();
        let part = self.parts[index].clone();
        // Where the line enters and leaves the part.
        let mut ends: Vec<(usize, DVec2)> = Vec::new();
        let n = part.points.len();
        for side in 0..n {
            let next = (side + 1) % n;
            let [a, b] = [side, next].map(|point| self.points[part.points[point] as usize].at);
            if depths[side] == 0.0 {
                ends.push((side, a));
            } else if depths[side] * depths[next] < 0.0 {
                ends.push((side, a.lerp(b, depths[side] / (depths[side] - depths[next]))));
            }
        }
        let [first, second] = ends[..] else { return None };
        let (enters, leaves) = span([first.1, second.1].map(on_line).into_iter());
        let cut_m = on_line(line.to).min(leaves) - enters.max(0.0);
        if cut_m < (LEAST_CUT * line.texel_m).min(LEAST_CUT_SHARE * (high - low)) {
            return None;
        }
        let mut halves = [(); 2].map(|()| Part { points: Vec::new(), sides: Vec::new() });
        let ends = [first, second].map(|(side, at)| {
            let point = if depths[side] == 0.0 { part.points[side] } else { self.point_on(at, part.sides[side], same) };
            (side, point)
        });
        for side in 0..n {
            let (point, edge) = (part.points[side], part.sides[side]);
            let is_left = depths[side] > 0.0;
            if depths[side] != 0.0 {
                halves[usize::from(!is_left)].add(point, edge);
            }
            if let Some(&(_, end)) = ends.iter().find(|end| end.0 == side) {
                // From here on the border is the other half's.
                let next_is_left = depths[(side + 1) % n] > 0.0;
                halves[usize::from(!next_is_left)].add(end, edge);
                halves[usize::from(next_is_left)].add(end, None);
            }
        }
        halves.iter().all(|half| half.points.len() >= 3).then_some(halves)
    }

    /// The point there, or a new one.
    fn point_on(&mut self, at: DVec2, edge: Option<usize>, same: f64) -> u32 {
        let is_here = |point: &Point| point.at.distance(at) < 1e-3 * same;
        if let Some(known) = self.points.iter().position(is_here) {
            return known as u32;
        }
        let on = edge.map_or(On::Inside, |edge| {
            let [low, high] = self.edge(edge);
            On::Edge(edge, ((at - low).dot(high - low) / (high - low).length_squared()).clamp(0.0, 1.0))
        });
        self.points.push(Point { at, on });
        self.points.len() as u32 - 1
    }

    /// Lower and higher end of an edge.
    fn edge(&self, edge: usize) -> [DVec2; 2] {
        let [from, to] = [edge, (edge + 1) % 3].map(|corner| self.corners[corner]);
        if self.is_upward[edge] { [from, to] } else { [to, from] }
    }

    /// Whether an edge starts at its lower end.
    pub(super) fn is_upward(&self, edge: usize) -> bool {
        self.is_upward[edge]
    }

    /// Length of an edge, metres.
    pub(super) fn edge_m(&self, edge: usize) -> f64 {
        let [low, high] = self.edge(edge);
        low.distance(high)
    }

    /// Moves a point of an edge along it.
    pub(super) fn move_to(&mut self, point: usize, edge: usize, along: f64) {
        let [low, high] = self.edge(edge);
        self.points[point] = Point { at: low.lerp(high, along), on: On::Edge(edge, along) };
    }

    /// Weights of the face's corners at a point.
    pub(super) fn weights(&self, at: DVec2) -> DVec3 {
        let [a, b, c] = self.corners;
        let area = (b - a).perp_dot(c - a);
        let (u, v) = ((b - at).perp_dot(c - at) / area, (c - at).perp_dot(a - at) / area);
        DVec3::new(u, v, 1.0 - u - v)
    }

    /// Adds a point of an edge where another face is cut there, if there is none.
    pub(super) fn add_on_edge(&mut self, edge: usize, along: f64) {
        let on = On::Edge(edge, along);
        if !self.points.iter().any(|point| point.on == on) {
            let [low, high] = self.edge(edge);
            self.points.push(Point { at: low.lerp(high, along), on });
        }
    }

    /// Takes the points of other parts that lie on the sides of a part into its border. No part is split after that.
    pub(super) fn close(&mut self) {
        for index in 0..self.parts.len() {
            let Part { points, sides } = &self.parts[index];
            let mut closed = Part { points: Vec::new(), sides: Vec::new() };
            for (side, &edge) in sides.iter().enumerate() {
                let ends = [points[side], points[(side + 1) % points.len()]];
                closed.add(ends[0], edge);
                let inside = |point: &u32| edge.is_none() && self.points[*point as usize].on == On::Inside;
                for point in self.between(ends, inside) {
                    closed.add(point, None);
                }
            }
            self.parts[index] = closed;
        }
    }

    /// Points on the straight line between two others, in order, of those that `may` be there.
    fn between(&self, ends: [u32; 2], may: impl Fn(&u32) -> bool) -> Vec<u32> {
        let [a, b] = ends.map(|point| self.points[point as usize].at);
        let (way, length) = (b - a, a.distance(b));
        let mut between: Vec<(f64, u32)> = (0..self.points.len() as u32)
            .filter(|point| !ends.contains(point) && may(point))
            .filter_map(|point| {
                let at = self.points[point as usize].at - a;
                let along = at.dot(way) / length;
                let is_on = at.perp_dot(way).abs() < ROUNDING * length * length;
                (is_on && along > 0.0 && along < length).then_some((along, point))
            })
            .collect();
        between.sort_by(|a, b| a.0.total_cmp(&b.0));
        between.into_iter().map(|(_, point)| point).collect()
    }

    /// Sides of all parts, between points that follow each other.
    pub(super) fn borders(&self) -> Vec<[u32; 2]> {
        let closed = |part: &Part| {
            let border = self.border(part);
            (0..border.len()).map(|side| [border[side], border[(side + 1) % border.len()]]).collect::<Vec<_>>()
        };
        self.parts.iter().flat_map(closed).collect()
    }

    /// Points of a part's border, with those at which other faces are cut.
    fn border(&self, part: &Part) -> Vec<u32> {
        let mut border = Vec::new();
        for (side, &from) in part.points.iter().enumerate() {
            border.push(from);
            if let Some(edge) = part.sides[side] {
                let to = part.points[(side + 1) % part.points.len()];
                let on_edge = |point: &u32| matches!(self.points[*point as usize].on, On::Edge(own, _) if own == edge);
                border.extend(self.between([from, to], on_edge));
            }
        }
        border
    }

    /// Triangles of all parts, counter-clockwise, with every point of their borders.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        self.parts.iter().flat_map(|part| self.of_border(self.border(part))).collect()
    }

    /// Ears of a convex border, the best first; what is left always has area.
    fn of_border(&self, mut border: Vec<u32>) -> Vec<[u32; 3]> {
        let at = |point: u32| self.points[point as usize].at;
        let area = |[a, b, c]: [u32; 3]| 0.5 * (at(b) - at(a)).perp_dot(at(c) - at(a));
        let shape = |triangle: [u32; 3]| {
            let [a, b, c] = triangle.map(at);
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            area(triangle) / longest.max(f64::MIN_POSITIVE)
        };
        let mut left: f64 =
            (1..border.len().saturating_sub(1)).map(|i| area([border[0], border[i], border[i + 1]])).sum();
        let whole = left;
        let mut triangles = Vec::new();
        while border.len() > 3 {
            let n = border.len();
            let ear = |i: usize| [border[(i + n - 1) % n], border[i], border[(i + 1) % n]];
            let leaves_area = |i: &usize| left - area(ear(*i)) > 1e-9 * whole;
            let best = (0..n).filter(leaves_area).max_by(|&a, &b| shape(ear(a)).total_cmp(&shape(ear(b))));
            let Some(best) = best else { break };
            let triangle = ear(best);
            left -= area(triangle);
            if shape(triangle) > FLATTEST {
                triangles.push(triangle);
            }
            border.remove(best);
        }
        if let [a, b, c] = border[..] {
            triangles.push([a, b, c]);
        }
        triangles
    }
}

impl Part {
    fn add(&mut self, point: u32, side: Option<usize>) {
        if self.points.last() == Some(&point) {
            // The side to it had no length.
            *self.sides.last_mut().expect("as many sides as points") = side;
            return;
        }
        self.points.push(point);
        self.sides.push(side);
    }
}

fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}
