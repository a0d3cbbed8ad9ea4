//! Geometry that the scenes are made of. Triangles are counter-clockwise seen from the front; every flat face has its
//! own vertices, so that shading normals are those of the faces. Shared edges have bit-equal end points.

use crate::scene::Mesh;
use glam::{Vec2, Vec3};
use std::f64::consts::TAU;

/// A mesh in the making. Texture coordinates are the metres of a projection along the axis nearest to the normal.
#[derive(Default)]
pub(super) struct Shape {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

/// A face of an axis-aligned box.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Face {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// At the upper end of the axis.
    pub high: bool,
    /// Cell along the axis that follows cyclically.
    pub u: usize,
    /// Cell along the one after.
    pub v: usize,
}

/// A wall standing on a line, for [`Shape::wall`].
pub(super) struct Wall<'a> {
    /// A point of the line; y is the zero of all heights.
    pub origin: Vec3,
    /// Runs along z instead of x.
    pub along_z: bool,
    /// Metres to either side of the line.
    pub half_thickness: f32,
    /// Distance along the line and height of the lower edge, by growing distance.
    pub lower_edge: &'a [Vec2],
    /// Height of the upper edge.
    pub top: f32,
}

impl Shape {
    /// The finished mesh; texture coordinates in units of `texture_size` metres, or none.
    pub fn into_mesh(self, name: &str, material: usize, texture_size: Option<f32>) -> Mesh {
        let uv_sets = texture_size.map(|size| vec![self.uvs.iter().map(|uv| uv / size).collect()]);
        Mesh {
            name: name.into(),
            material,
            positions: self.positions,
            normals: self.normals,
            uv_sets: uv_sets.unwrap_or_default(),
            triangles: self.triangles,
            ..Mesh::default()
        }
    }

    /// A flat quad, counter-clockwise.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let [a, b, c, d] = corners.map(|corner| corner.as_dvec3());
        let normal = (c - a).cross(d - b).normalize().as_vec3();
        let axis = normal.abs().max_position();
        let uvs = corners.map(|corner| match axis {
            0 => Vec2::new(corner.z, -corner.y),
            1 => Vec2::new(corner.x, corner.z),
            _ => Vec2::new(corner.x, -corner.y),
        });
        self.quad_with(corners, [normal; 4], uvs);
    }

    /// A quad with given normals and texture coordinates.
    pub fn quad_with(&mut self, corners: [Vec3; 4], normals: [Vec3; 4], uvs: [Vec2; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend(normals);
        self.uvs.extend(uvs);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// A triangle with given normals; texture coordinates are zero.
    pub fn triangle_with(&mut self, corners: [Vec3; 3], normals: [Vec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend(normals);
        self.uvs.extend([Vec2::ZERO; 3]);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// The surface of an axis-aligned box, split at the given coordinates (growing, at least two per axis), without the
    /// cells for which `keep` is false.
    pub fn grid_box(&mut self, splits: [&[f32]; 3], inward: bool, keep: impl Fn(Face) -> bool) {
        for axis in 0..3 {
            let (u_axis, v_axis) = ((axis + 1) % 3, (axis + 2) % 3);
            for high in [false, true] {
                let ends = splits[axis];
                let at = if high { ends[ends.len() - 1] } else { ends[0] };
                for (u, us) in splits[u_axis].windows(2).enumerate() {
                    for (v, vs) in splits[v_axis].windows(2).enumerate() {
                        if !keep(Face { axis, high, u, v }) {
                            continue;
                        }
                        let corner = |u: f32, v: f32| {
                            let mut corner = Vec3::ZERO;
                            (corner[axis], corner[u_axis], corner[v_axis]) = (at, u, v);
                            corner
                        };
                        // Counter-clockwise seen from the axis' upper end.
                        let mut corners =
                            [corner(us[0], vs[0]), corner(us[1], vs[0]), corner(us[1], vs[1]), corner(us[0], vs[1])];
                        if high == inward {
                            corners.reverse();
                        }
                        self.quad(corners);
                    }
                }
            }
        }
    }

    /// A closed solid box.
    pub fn block(&mut self, low: Vec3, high: Vec3) {
        let splits = [[low.x, high.x], [low.y, high.y], [low.z, high.z]];
        self.grid_box([&splits[0], &splits[1], &splits[2]], false, |_| true);
    }

    /// A closed solid box standing on the middle of its lower side.
    pub fn block_at(&mut self, foot: Vec3, size: Vec3) {
        let half = Vec3::new(size.x / 2.0, 0.0, size.z / 2.0);
        self.block(foot - half, foot + half + Vec3::new(0.0, size.y, 0.0));
    }

    /// A closed solid frame: the box from `-outer` to `outer` in x and z less the one from `-inner` to `inner`, between
    /// two heights.
    pub fn frame(&mut self, outer: Vec2, inner: Vec2, heights: [f32; 2]) {
        let xs = [-outer.x, -inner.x, inner.x, outer.x];
        let zs = [-outer.y, -inner.y, inner.y, outer.y];
        self.grid_box([&xs, &heights, &zs], false, |face| face.axis != 1 || face.u != 1 || face.v != 1);
        self.grid_box([&xs[1..3], &heights, &zs[1..3]], true, |face| face.axis != 1);
    }

    /// The surface of a solid: the union of boxes, each from its low to its high corner, less the holes. Closed but for
    /// the faces, given by middle and normal, for which `keep` is false. Every face is cut wherever a box or hole has a
    /// side, so that neighbors share whole edges.
    pub fn solid(&mut self, boxes: &[[Vec3; 2]], holes: &[[Vec3; 2]], keep: impl Fn(Vec3, Vec3) -> bool) {
        let splits: [Vec<f32>; 3] = [0, 1, 2].map(|axis| {
            let mut at: Vec<f32> = boxes.iter().chain(holes).flatten().map(|corner| corner[axis]).collect();
            at.sort_by(f32::total_cmp);
            at.dedup();
            at
        });
        let cell = |at: [usize; 3]| {
            let [low, high] = [0, 1].map(|end| Vec3::from_array([0, 1, 2].map(|axis| splits[axis][at[axis] + end])));
            [low, high]
        };
        let holds =
            |all: &[[Vec3; 2]], at: Vec3| all.iter().any(|[low, high]| low.cmple(at).all() && at.cmple(*high).all());
        let is_solid = |at: [usize; 3]| {
            let [low, high] = cell(at);
            let middle = (low + high) / 2.0;
            holds(boxes, middle) && !holds(holes, middle)
        };
        let cells = [0, 1, 2].map(|axis| splits[axis].len() - 1);
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let at = [x, y, z];
                    if !is_solid(at) {
                        continue;
                    }
                    for axis in 0..3 {
                        for high in [false, true] {
                            let mut next = at;
                            next[axis] = if high { at[axis] + 1 } else { at[axis].wrapping_sub(1) };
                            if next[axis] < cells[axis] && is_solid(next) {
                                continue;
                            }
                            self.cell_face(cell(at), axis, high, &keep);
                        }
                    }
                }
            }
        }
    }

    fn cell_face(&mut self, ends: [Vec3; 2], axis: usize, high: bool, keep: impl Fn(Vec3, Vec3) -> bool) {
        let (u_axis, v_axis) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |u: usize, v: usize| {
            let mut corner = ends[usize::from(high)];
            (corner[u_axis], corner[v_axis]) = (ends[u][u_axis], ends[v][v_axis]);
            corner
        };
        let mut corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        let mut normal = Vec3::AXES[axis];
        if !high {
            corners.reverse();
            normal = -normal;
        }
        if keep((corners[0] + corners[2]) / 2.0, normal) {
            self.quad(corners);
        }
    }

    /// A closed solid wall whose lower edge may rise into arches.
    pub fn wall(&mut self, wall: &Wall) {
        let place =
            |u: f32, y: f32, w: f32| wall.origin + if wall.along_z { Vec3::new(-w, y, u) } else { Vec3::new(u, y, w) };
        let (h, top) = (wall.half_thickness, wall.top);
        for edge in wall.lower_edge.windows(2) {
            let (a, b) = (edge[0], edge[1]);
            self.quad([place(a.x, a.y, h), place(b.x, b.y, h), place(b.x, top, h), place(a.x, top, h)]);
            self.quad([place(b.x, b.y, -h), place(a.x, a.y, -h), place(a.x, top, -h), place(b.x, top, -h)]);
            self.quad([place(a.x, a.y, -h), place(b.x, b.y, -h), place(b.x, b.y, h), place(a.x, a.y, h)]);
            self.quad([place(a.x, top, h), place(b.x, top, h), place(b.x, top, -h), place(a.x, top, -h)]);
        }
        if let (Some(a), Some(b)) = (wall.lower_edge.first(), wall.lower_edge.last()) {
            self.quad([place(a.x, a.y, -h), place(a.x, a.y, h), place(a.x, top, h), place(a.x, top, -h)]);
            self.quad([place(b.x, b.y, h), place(b.x, b.y, -h), place(b.x, top, -h), place(b.x, top, h)]);
        }
    }

    /// A body turned about a vertical axis through `foot`. The profile holds radius and height from bottom to top, the
    /// solid being on the axis' side; closed if it starts and ends at radius 0. Bends below 40 degrees are smooth.
    pub fn lathe(&mut self, foot: Vec3, profile: &[Vec2], segments: usize) {
        let circle: Vec<Vec2> = (0..segments)
            .map(|segment| {
                let (sin, cos) = (TAU * segment as f64 / segments as f64).sin_cos();
                Vec2::new(cos as f32, sin as f32)
            })
            .collect();
        let position = |point: Vec2, on: Vec2| foot + Vec3::new(point.x * on.x, point.y, point.x * on.y);
        let direction = |normal: Vec2, on: Vec2| Vec3::new(normal.x * on.x, normal.y, normal.x * on.y).normalize();
        let flat: Vec<Vec2> = profile.windows(2).map(|pair| -(pair[1] - pair[0]).perp().normalize()).collect();
        let smooth = |own: usize, other: Option<usize>| match other.and_then(|other| flat.get(other)) {
            Some(other) if flat[own].dot(*other) > 0.766 => (flat[own] + *other).normalize(),
            _ => flat[own],
        };
        for (index, pair) in profile.windows(2).enumerate() {
            let (low, high) = (smooth(index, index.checked_sub(1)), smooth(index, Some(index + 1)));
            for segment in 0..segments {
                let (on, next) = (circle[segment], circle[(segment + 1) % segments]);
                let middle = (on + next).normalize();
                if pair[0].x == 0.0 {
                    let corners = [position(pair[0], on), position(pair[1], on), position(pair[1], next)];
                    self.triangle_with(corners, [direction(low, middle), direction(high, on), direction(high, next)]);
                } else if pair[1].x == 0.0 {
                    let corners = [position(pair[0], on), position(pair[1], on), position(pair[0], next)];
                    self.triangle_with(corners, [direction(low, on), direction(high, middle), direction(low, next)]);
                } else {
                    let corners = [
                        position(pair[0], on),
                        position(pair[1], on),
                        position(pair[1], next),
                        position(pair[0], next),
                    ];
                    let normals =
                        [direction(low, on), direction(high, on), direction(high, next), direction(low, next)];
                    let uvs = corners.map(|corner| Vec2::new(corner.x, -corner.y));
                    self.quad_with(corners, normals, uvs);
                }
            }
        }
    }
}

/// Lower edge of an arcade from `-half_length` to `half_length`: `bays` half-circle arches of the given radius that
/// spring at height `springing`, `segments` straight pieces each.
pub(super) fn arches(half_length: f32, bays: usize, radius: f32, springing: f32, segments: usize) -> Vec<Vec2> {
    let bay = 2.0 * half_length / bays as f32;
    let mut edge = vec![Vec2::new(-half_length, springing)];
    for index in 0..bays {
        let center = -half_length + (index as f32 + 0.5) * bay;
        for segment in 0..=segments {
            let (sin, cos) = (TAU / 2.0 * segment as f64 / segments as f64).sin_cos();
            // The end lies on the springing line exactly.
            let rise = if segment == segments { 0.0 } else { radius * sin as f32 };
            edge.push(Vec2::new(center - radius * cos as f32, springing + rise));
        }
    }
    edge.push(Vec2::new(half_length, springing));
    edge
}

/// Numbers in 0..1 that look random and are the same everywhere (PCG's output permutation as a hash).
pub(super) fn noise(seed: u32) -> f32 {
    let state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (((word >> 22) ^ word) >> 8) as f32 / (1 << 24) as f32
}

/// Sine and cosine, rounded from f64 so that the scene is bit-equal on machines whose f32 functions differ.
pub(super) fn sin_cos(angle: f32) -> (f32, f32) {
    let (sin, cos) = f64::from(angle).sin_cos();
    (sin as f32, cos as f32)
}
