//! Large faces are cut where they need very different densities, so that charts can have them: triangles are bisected along their
//! longest edges (Rivara 1984).

use super::{EdgeKey, add_vertex, key};
use crate::scale::LocalScale;
use glam::Vec3;
use localprt_scenes::{Mesh, Scene};
use localprt_surfaces::subdivision;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// Coarsest over finest scale that one triangle may have.
const MOST_UNEVEN: f32 = 16.0;
/// Steps across a triangle at which the scale is read.
const STEPS: u32 = 8;
/// Triangles shorter than this many of the finest scale stay whole.
const SHORTEST: f32 = 4.0;
/// Bisections of a triangle, at most.
const MOST_PASSES: usize = 48;

/// Cuts the scene's triangles; the number of triangles added.
pub fn by_scale(scene: &mut Scene, scale: &LocalScale) -> usize {
    let before = scene.face_count();
    if scale.is_uniform() {
        return 0;
    }
    // Triangles that are settled; new ones come behind them.
    let mut settled = vec![0usize; scene.meshes.len()];
    for _ in 0..MOST_PASSES {
        let marked: Vec<EdgeKey> = scene
            .meshes
            .par_iter()
            .zip(&settled)
            .flat_map_iter(|(mesh, &settled)| {
                let unsettled = &mesh.triangles[settled..];
                unsettled
                    .iter()
                    .filter(|triangle| is_uneven(mesh, triangle, scale))
                    .map(|triangle| longest(mesh, triangle).1)
            })
            .collect();
        if marked.is_empty() {
            break;
        }
        let marked = closed(scene, marked.into_iter().collect());
        scene.meshes.par_iter_mut().zip(&mut settled).for_each(|(mesh, settled)| *settled = bisect(mesh, &marked));
    }
    scene.face_count() - before
}

fn edge(mesh: &Mesh, a: u32, b: u32) -> EdgeKey {
    key([a, b].map(|vertex| mesh.positions[vertex as usize]))
}

/// Corner from which the longest edge starts, and that edge; of equals the one with the lowest key, so that all who share it agree.
fn longest(mesh: &Mesh, triangle: &[u32; 3]) -> (usize, EdgeKey) {
    let of = |corner: usize| {
        let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
        let length = mesh.positions[a as usize].distance_squared(mesh.positions[b as usize]);
        (length, edge(mesh, a, b), corner)
    };
    let (_, key, corner) = [of(1), of(2)].into_iter().fold(of(0), |best, other| {
        if other.0 > best.0 || other.0 == best.0 && other.1 < best.1 { other } else { best }
    });
    (corner, key)
}

/// Whether a triangle needs very different densities.
fn is_uneven(mesh: &Mesh, triangle: &[u32; 3], scale: &LocalScale) -> bool {
    let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
    let longest_m = a.distance(b).max(b.distance(c)).max(c.distance(a));
    if longest_m.is_nan() || longest_m < SHORTEST * scale.finest_of_charts_m() {
        return false;
    }
    let finest_m = scale.finest_of_charts_m();
    // The scale changes no faster than with distance, up to a focus.
    let spread = |middle: f32, reach: f32| (middle + reach) / (middle - reach).max(finest_m);
    if spread(scale.of_charts((a + b + c) / 3.0), longest_m) < MOST_UNEVEN {
        return false;
    }
    let at: Vec<f32> = subdivision(STEPS).map(|[u, v, w]| scale.of_charts(a * u + b * v + c * w)).collect();
    let (low, high) = at.iter().fold((f32::INFINITY, 0.0f32), |(low, high), &at| (low.min(at), high.max(at)));
    // Between the places looked at it may be finer.
    high / (low - longest_m / STEPS as f32).max(finest_m) > MOST_UNEVEN
}

/// Edges to cut so that every cut triangle is cut along its longest edge too.
fn closed(scene: &Scene, marked: HashSet<EdgeKey>) -> HashSet<EdgeKey> {
    // Edges by number; of each triangle its three and which is longest.
    let mut number: HashMap<EdgeKey, u32> = HashMap::new();
    let mut keys: Vec<EdgeKey> = Vec::new();
    let mut triangles: Vec<([u32; 3], u32)> = Vec::with_capacity(scene.face_count());
    for mesh in &scene.meshes {
        for triangle in &mesh.triangles {
            let edges = [0, 1, 2].map(|corner| {
                let key = edge(mesh, triangle[corner], triangle[(corner + 1) % 3]);
                *number.entry(key).or_insert_with(|| {
                    keys.push(key);
                    keys.len() as u32 - 1
                })
            });
            triangles.push((edges, edges[longest(mesh, triangle).0]));
        }
    }
    let mut is_marked: Vec<bool> = keys.iter().map(|key| marked.contains(key)).collect();
    loop {
        let mut is_closed = true;
        for (edges, longest) in &triangles {
            if edges.iter().any(|&edge| is_marked[edge as usize]) && !is_marked[*longest as usize] {
                is_marked[*longest as usize] = true;
                is_closed = false;
            }
        }
        if is_closed {
            return keys.into_iter().zip(is_marked).filter_map(|(key, is_marked)| is_marked.then_some(key)).collect();
        }
    }
}

/// Cuts a mesh at the middles of the marked edges. Triangles that are not cut come first, the others' parts behind them; how many
/// are not cut is returned. (A triangle that is too uneven is always cut, so they are settled.)
fn bisect(mesh: &mut Mesh, marked: &HashSet<EdgeKey>) -> usize {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let triangles = std::mem::take(&mut mesh.triangles);
    let mut whole = Vec::with_capacity(triangles.len());
    let mut parts = Vec::new();
    for triangle in triangles {
        let (start, key) = longest(mesh, &triangle);
        if !marked.contains(&key) {
            whole.push(triangle);
            continue;
        }
        let mut waiting = vec![turned(triangle, start)];
        while let Some([a, b, c]) = waiting.pop() {
            let turns = [[a, b, c], [b, c, a], [c, a, b]];
            let cut = turns.into_iter().find(|&[from, to, _]| marked.contains(&edge(mesh, from, to)));
            let Some([from, to, opposite]) = cut else {
                parts.push([a, b, c]);
                continue;
            };
            let middle = middle(mesh, &mut middles, from, to);
            // The first part is worked on first.
            waiting.push([middle, to, opposite]);
            waiting.push([from, middle, opposite]);
        }
    }
    let settled = whole.len();
    mesh.triangles = whole;
    mesh.triangles.extend(parts);
    settled
}

fn turned(triangle: [u32; 3], start: usize) -> [u32; 3] {
    [0, 1, 2].map(|corner| triangle[(corner + start) % 3])
}

/// The vertex in the middle of an edge.
fn middle(mesh: &mut Mesh, middles: &mut HashMap<[u32; 2], u32>, from: u32, to: u32) -> u32 {
    let ends = [from.min(to), from.max(to)];
    if let Some(&middle) = middles.get(&ends) {
        return middle;
    }
    let middle = add_vertex(mesh, [ends[0], ends[1], ends[0]], Vec3::new(0.5, 0.5, 0.0));
    middles.insert(ends, middle);
    middle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::test_scenes::{cuboid, merged, plane, scene};
    use crate::scale::Sample;
    use glam::Vec2;
    use std::collections::BTreeMap;

    fn scale_around(place: Vec3) -> LocalScale {
        LocalScale::of(
            vec![Sample { position: place, normal: Vec3::Y, scale_m: 0.5, area_m2: 1.0, face: 0, seen: 1.0 }],
            500.0,
            60_000,
            Vec::new(),
        )
    }

    #[test]
    fn a_plain_is_cut_around_what_stands_on_it_and_stays_closed() {
        // Two meshes that share an edge, and texture coordinates that must stay linear.
        let mut left = plane("left", Vec3::new(-100.0, 0.0, -100.0), Vec3::X * 100.0, Vec3::Z * 200.0, 1, 1);
        left.uv_sets = vec![left.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect()];
        let right = plane("right", Vec3::new(0.0, 0.0, -100.0), Vec3::X * 100.0, Vec3::Z * 200.0, 1, 1);
        let mut cut = scene(vec![left, right]);
        let scale = scale_around(Vec3::new(-3.0, 0.0, 10.0));
        let added = by_scale(&mut cut, &scale);
        assert!((20..3000).contains(&added), "{added}");
        let area: f32 = cut
            .faces()
            .map(|(mesh, triangle)| {
                let [a, b, c] = cut.corners(mesh, triangle);
                let normal = (b - a).cross(c - a);
                assert!(normal.normalize().y > 0.999);
                normal.length() * 0.5
            })
            .sum();
        assert!((area / 40_000.0 - 1.0).abs() < 1e-4, "{area}");
        for (position, uv) in cut.meshes[0].positions.iter().zip(&cut.meshes[0].uv_sets[0]) {
            assert_eq!([position.x, position.z], uv.to_array());
        }
        // Every edge belongs to two triangles, but for the border of the plain: no T-junctions, across meshes too.
        let mut edges: BTreeMap<EdgeKey, (u32, bool)> = BTreeMap::new();
        for mesh in &cut.meshes {
            for triangle in &mesh.triangles {
                for corner in 0..3 {
                    let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
                    let ends = [a, b].map(|vertex| mesh.positions[vertex as usize]);
                    let on_border =
                        |axis: usize| ends.iter().all(|end| end[axis].abs() == 100.0 && end[axis] == ends[0][axis]);
                    let entry = edges.entry(edge(mesh, a, b)).or_insert((0, on_border(0) || on_border(2)));
                    entry.0 += 1;
                }
            }
        }
        assert!(edges.values().all(|&(count, on_border)| count == if on_border { 1 } else { 2 }));
        // Near the place triangles are small.
        let place = Vec3::new(-3.0, 0.0, 10.0);
        let longest = |[a, b, c]: [Vec3; 3]| a.distance(b).max(b.distance(c)).max(c.distance(a));
        let near: Vec<[Vec3; 3]> = cut
            .faces()
            .map(|(mesh, triangle)| cut.corners(mesh, triangle))
            .filter(|corners| corners.iter().any(|corner| corner.distance(place) < 12.0))
            .collect();
        assert!(!near.is_empty() && near.iter().all(|&corners| longest(corners) < 30.0));
    }

    #[test]
    fn what_is_even_stays_as_it_is() {
        let boxes =
            merged("boxes", &[cuboid("a", Vec3::ZERO, Vec3::ONE), cuboid("b", Vec3::X * 3.0, Vec3::X * 3.0 + 1.0)]);
        let mut even = scene(vec![boxes]);
        let before = even.meshes[0].triangles.clone();
        assert_eq!(by_scale(&mut even, &scale_around(Vec3::ZERO)), 0);
        assert_eq!(even.meshes[0].triangles, before);
        assert_eq!(by_scale(&mut even, &LocalScale::uniform()), 0);
    }
}
