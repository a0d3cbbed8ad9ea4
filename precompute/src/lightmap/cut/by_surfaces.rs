//! Faces are cut where other surfaces stand on them, so that texels on the two sides can belong to different charts.
//!
//! A wall's polygon goes on beyond the floor and out of doors, a floor goes on below the wall: what an engine reads at the edge
//! between two texels would be the light of both sides. A cut goes along the line on which the other surface stands; where it
//! meets the border of a face, the neighbor is cut there too.

use super::{
    EdgeKey, Walls, add_vertex,
    crossings::{Crossing, Standing},
    key, place, sorted,
    split::{Frame, On, SAME, Split},
};
use crate::rays::RayCaster;
use glam::{DVec2, Vec3};
use localprt_scenes::{Mesh, Scene};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap, HashSet};

/// A surface stands on an edge if it does for so many texels, in all...
const LEAST_WALL: f64 = 1.0;
/// ...or for this share of the edge.
const LEAST_WALL_SHARE: f64 = 0.5;
/// It stands on it if it is no farther away than so many texels...
const BESIDE: f64 = 0.35;
/// ...and is no more aslant than this: the sine of 20 degrees.
const ASLANT: f64 = 0.342;

/// Where edges are cut, from their lower ends, as bits: rising numbers from 0 to 1 have rising bits.
type Cuts = HashMap<EdgeKey, BTreeSet<u64>>;

/// A face of the scene with what stands on it, its corners sorted by their places: the two sides of a triangle have the same parts.
struct Face {
    /// What stands on its own side.
    crossings: Vec<Crossing>,
    /// Edge of a texel at the longest line along which it is split; 0 if it is whole.
    texel_m: f64,
    split: Split,
    /// Edges by the places of their ends.
    edges: [EdgeKey; 3],
    /// Which corner of the triangle each is.
    order: [usize; 3],
    /// Its own normal is the other one.
    is_flipped: bool,
}

/// Cuts the scene's triangles where other surfaces stand on them, and gives the edges on which they do. `caster` holds the same
/// surfaces, cut into faces as finely or not; `texel_m` is the edge of a texel at a place.
pub fn by_surfaces(scene: &mut Scene, caster: &RayCaster<'_>, texel_m: &(dyn Fn(Vec3) -> f32 + Sync)) -> Walls {
    let standing = Standing::of(scene, caster);
    let places: Vec<(usize, usize)> = scene.faces().collect();
    let mut faces: Vec<Option<Box<Face>>> = places
        .par_iter()
        .enumerate()
        .map(|(face, &(mesh, triangle))| {
            Face::of(&standing, face, scene.corners(mesh, triangle), texel_m).map(Box::new)
        })
        .collect();
    if faces.iter().all(Option::is_none) {
        return Walls::default();
    }
    let cuts = agree(&mut faces);
    faces.par_iter_mut().zip(&places).for_each(|(face, &(mesh, triangle))| {
        cut_like_neighbors(face, scene.corners(mesh, triangle), &cuts);
    });

    let mut cut = faces.into_iter();
    let of_meshes: Vec<Vec<Option<Box<Face>>>> =
        scene.meshes.iter().map(|mesh| cut.by_ref().take(mesh.triangles.len()).collect()).collect();
    let edges = scene
        .meshes
        .par_iter_mut()
        .zip(of_meshes)
        .map(|(mesh, faces)| {
            let mut walls = HashSet::new();
            rebuild(mesh, faces, &mut walls);
            walls
        })
        .collect();
    Walls { edges }
}

impl Face {
    /// A face that is cut: something stands on it, or on its other side.
    fn of(standing: &Standing<'_>, face: usize, corners: [Vec3; 3], texel_m: &dyn Fn(Vec3) -> f32) -> Option<Self> {
        let frame = Frame::of(sorted(corners))?;
        let whole = Self::whole(corners, &frame);
        let own_side = if whole.is_flipped { -1.0 } else { 1.0 };
        let lines_of = |side: f64| standing.on(face, &frame, side, texel_m);
        let mut lines: [Vec<Crossing>; 2] = Default::default();
        if standing.has_two_sides(face) {
            lines = [1.0, -1.0].map(lines_of);
        } else {
            lines[usize::from(whole.is_flipped)] = lines_of(own_side);
        }
        let texel_m = lines.iter().flatten().next()?.texel_m;
        let mut face = Self { texel_m, ..whole };
        lines.iter().flatten().for_each(|line| face.split.along(line));
        face.split.close();
        let [front, back] = lines;
        Some(Self { crossings: if face.is_flipped { back } else { front }, ..face })
    }

    fn whole(corners: [Vec3; 3], frame: &Frame) -> Self {
        let mut order = [0, 1, 2];
        order.sort_by_key(|&corner| place(corners[corner]));
        let is_flipped = matches!(order, [0, 2, 1] | [1, 0, 2] | [2, 1, 0]);
        let corners = sorted(corners);
        let split = Split::new(corners.map(|corner| frame.flat(corner.as_dvec3())), [true, true, false]);
        Self { crossings: Vec::new(), texel_m: 0.0, split, edges: edges(corners), order, is_flipped }
    }

    /// Cuts of an edge are one within this share of it.
    fn same(&self, edge: usize) -> f64 {
        (SAME * self.texel_m / self.split.edge_m(edge)).min(SAME)
    }

    /// Whether surfaces stand on the line between two points of the face.
    fn has_wall(&self, ends: [DVec2; 2]) -> bool {
        let [a, b] = ends;
        let length = a.distance(b);
        let Some(way) = (b - a).try_normalize() else { return false };
        let mut stretches: Vec<[f64; 2]> = Vec::new();
        let mut texel_m: f64 = 0.0;
        for line in &self.crossings {
            let mut line_ends = [line.from, line.to].map(|end| DVec2::new((end - a).dot(way), (end - a).perp_dot(way)));
            line_ends.sort_by(|a, b| a.x.total_cmp(&b.x));
            let [low, high] = line_ends;
            let [first, last] = [low.x.max(0.0), high.x.min(length)];
            let is_aslant = (high.y - low.y).abs() > ASLANT * low.distance(high);
            if last <= first || is_aslant {
                continue;
            }
            let away = |at: f64| (low.y + (high.y - low.y) * (at - low.x) / (high.x - low.x)).abs();
            if away(first).max(away(last)) <= BESIDE * line.texel_m {
                stretches.push([first, last]);
                texel_m = texel_m.max(line.texel_m);
            }
        }
        stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (mut walls_m, mut reached) = (0.0, 0.0f64);
        for [first, last] in stretches {
            walls_m += (last - first.max(reached)).max(0.0);
            reached = reached.max(last);
        }
        walls_m > 0.0 && walls_m >= (LEAST_WALL * texel_m).min(LEAST_WALL_SHARE * length)
    }
}

fn edges(corners: [Vec3; 3]) -> [EdgeKey; 3] {
    [0, 1, 2].map(|corner| key([corners[corner], corners[(corner + 1) % 3]]))
}

/// Makes faces that share an edge cut it at the same points.
fn agree(faces: &mut [Option<Box<Face>>]) -> Cuts {
    let mut cuts = Cuts::new();
    for face in faces.iter_mut().flatten() {
        for point in 0..face.split.points.len() {
            let On::Edge(edge, along) = face.split.points[point].on else { continue };
            let same = face.same(edge);
            let known = cuts.entry(face.edges[edge]).or_default();
            let around = (along - same).max(0.0).to_bits()..=(along + same).to_bits();
            let apart = |&other: &f64| (other - along).abs();
            let nearest = known.range(around).map(|&bits| f64::from_bits(bits));
            let agreed = nearest.min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(along);
            known.insert(agreed.to_bits());
            face.split.move_to(point, edge, agreed);
        }
    }
    cuts
}

/// Cuts the edges of a face where others are cut that share them.
fn cut_like_neighbors(face: &mut Option<Box<Face>>, corners: [Vec3; 3], cuts: &Cuts) {
    for (edge, key) in edges(sorted(corners)).iter().enumerate() {
        let Some(cuts) = cuts.get(key) else { continue };
        if face.is_none() {
            *face = Frame::of(sorted(corners)).map(|frame| Box::new(Face::whole(corners, &frame)));
        }
        for &bits in cuts {
            if let Some(face) = face {
                face.split.add_on_edge(edge, f64::from_bits(bits));
            }
        }
    }
}

/// The mesh with its faces cut, in their order; what stands on the new edges and the old ones goes into `walls`.
fn rebuild(mesh: &mut Mesh, faces: Vec<Option<Box<Face>>>, walls: &mut HashSet<EdgeKey>) {
    let triangles = std::mem::take(&mut mesh.triangles);
    let mut cut = Vec::with_capacity(triangles.len());
    let mut on_edges: HashMap<([u32; 2], u64), u32> = HashMap::new();
    for (triangle, face) in triangles.into_iter().zip(faces) {
        let Some(face) = face else {
            cut.push(triangle);
            continue;
        };
        let split = &face.split;
        let corners = face.order.map(|corner| triangle[corner]);
        let vertices: Vec<u32> = split
            .points
            .iter()
            .map(|point| match point.on {
                On::Corner(corner) => corners[corner],
                On::Edge(edge, along) => {
                    let ends = [corners[edge], corners[(edge + 1) % 3]];
                    // From the lower end, so that all faces and meshes round alike.
                    let [low, high] = if split.is_upward(edge) { ends } else { [ends[1], ends[0]] };
                    *on_edges.entry(([low, high], along.to_bits())).or_insert_with(|| {
                        add_vertex(mesh, [low, high, low], Vec3::new((1.0 - along) as f32, along as f32, 0.0))
                    })
                }
                On::Inside => add_vertex(mesh, corners, split.weights(point.at).as_vec3()),
            })
            .collect();
        if !face.crossings.is_empty() {
            for ends in split.borders() {
                if face.has_wall(ends.map(|point| split.points[point as usize].at)) {
                    walls.insert(key(ends.map(|point| mesh.positions[vertices[point as usize] as usize])));
                }
            }
        }
        if split.is_whole() {
            cut.push(triangle);
        } else {
            let parts = split.triangles().into_iter().map(|part| part.map(|point| vertices[point as usize]));
            let parts = parts.map(|[a, b, c]| if face.is_flipped { [a, c, b] } else { [a, b, c] });
            // Cuts that were made one leave nothing between them.
            cut.extend(parts.filter(|[a, b, c]| a != b && b != c && c != a));
        }
    }
    mesh.triangles = cut;
}
