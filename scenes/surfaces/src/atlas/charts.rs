//! Charts: faces joined by edges that are joined in uv.

use super::{Atlas, LIGHTMAP_SET};
use crate::{Sets, rays::FacePoint};
use glam::{Vec2, Vec3};
use localprt_scenes::Scene;
use std::collections::HashMap;

impl Atlas {
    /// Reads TEXCOORD_1. Faces of one mesh belong to the same chart where they share an edge with equal positions and
    /// equal coordinates at both ends; charts are numbered by their first face. A face that lies in one point of the map
    /// belongs to the chart that has a corner there: it shares its texels. Meshes without TEXCOORD_1 get zero coordinates, which
    /// cover nothing.
    pub fn of(scene: &Scene) -> Self {
        Self::of_set(scene, LIGHTMAP_SET)
    }

    /// The layout of the direct light map: that of the set that the scene names, else the lightmap's.
    pub fn of_light_map(scene: &Scene) -> Self {
        Self::of_set(scene, scene.light_map_set.unwrap_or(LIGHTMAP_SET))
    }

    fn of_set(scene: &Scene, set: usize) -> Self {
        let mut corners = Vec::with_capacity(scene.face_count());
        let mut sets = Sets::new(scene.face_count());
        let mut edges: Vec<([CornerKey; 2], u32)> = Vec::new();
        // Faces that lie in one point of the map.
        let mut points = Vec::new();
        for mesh in &scene.meshes {
            let uv = mesh.uv_set(set);
            edges.clear();
            for triangle in &mesh.triangles {
                let face = corners.len() as u32;
                let uvs = triangle.map(|vertex| uv.map_or(Vec2::ZERO, |uv| uv[vertex as usize]));
                let keys: [CornerKey; 3] =
                    std::array::from_fn(|corner| corner_key(mesh.positions[triangle[corner] as usize], uvs[corner]));
                for corner in 0..3 {
                    let (a, b) = (keys[corner], keys[(corner + 1) % 3]);
                    edges.push((if a <= b { [a, b] } else { [b, a] }, face));
                }
                if uv.is_some() && uvs[0] == uvs[1] && uvs[1] == uvs[2] {
                    points.push(face);
                }
                corners.push(uvs);
            }
            edges.sort_unstable();
            for pair in edges.windows(2) {
                if pair[0].0 == pair[1].0 {
                    sets.join(pair[0].1, pair[1].1);
                }
            }
        }
        join_points(&corners, &points, &mut sets);
        let mut n_charts = 0;
        let mut chart = vec![0u32; corners.len()];
        for face in 0..corners.len() {
            // The lowest face of a chart comes first, so it has its number before the others ask.
            let lowest = sets.lowest(face as u32) as usize;
            if lowest == face {
                chart[face] = n_charts;
                n_charts += 1;
            } else {
                chart[face] = chart[lowest];
            }
        }
        Self { corners, chart, n_charts }
    }
}

impl Atlas {
    /// Coordinate of a surface point.
    pub fn at(&self, point: &FacePoint) -> Vec2 {
        let [a, b, c] = self.corners[point.face.0 as usize];
        a * point.barycentrics.x + b * point.barycentrics.y + c * point.barycentrics.z
    }

    /// `[n_faces]` whether the face's chart has an area in the map, and so texels; the face itself may be one point of it.
    pub fn faces_with_texels(&self) -> Vec<bool> {
        let mut has_area = vec![false; self.n_charts as usize];
        for (uv, &chart) in self.corners.iter().zip(&self.chart) {
            has_area[chart as usize] |= (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]) != 0.0;
        }
        self.chart.iter().map(|&chart| has_area[chart as usize]).collect()
    }

    /// Area of a texel at a surface point, in a map of `size` texels per side, m^2; infinite where the face is a point of the
    /// map.
    pub fn texel_m2(&self, scene: &Scene, point: &FacePoint, size: u32) -> f32 {
        let [a, b, c] = self.corners[point.face.0 as usize];
        let corners = scene.corners(point.mesh, point.triangle);
        let area_m2 = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        let area_uv = (b - a).perp_dot(c - a).abs();
        if area_uv > 0.0 { area_m2 / (area_uv * (size * size) as f32) } else { f32::INFINITY }
    }
}

/// Joins faces that lie in one point of the map with the lowest face with area that has a corner there.
fn join_points(corners: &[[Vec2; 3]], points: &[u32], sets: &mut Sets) {
    let key = |uv: Vec2| [uv.x, uv.y].map(|value| (value + 0.0).to_bits());
    let place = |&face: &u32| key(corners[face as usize][0]);
    let mut owners: HashMap<[u32; 2], Option<u32>> = points.iter().map(|face| (place(face), None)).collect();
    if owners.is_empty() {
        return;
    }
    for (face, uv) in corners.iter().enumerate().filter(|(_, uv)| (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]) != 0.0) {
        for &corner in uv {
            if let Some(owner) = owners.get_mut(&key(corner)) {
                owner.get_or_insert(face as u32);
            }
        }
    }
    for face in points {
        if let Some(&Some(owner)) = owners.get(&place(face)) {
            sets.join(*face, owner);
        }
    }
}

/// Position and coordinate as bits, both zeros alike.
type CornerKey = [u32; 5];

fn corner_key(position: Vec3, uv: Vec2) -> CornerKey {
    [position.x, position.y, position.z, uv.x, uv.y].map(|value| (value + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{plane, scene};

    #[test]
    fn faces_joined_in_uv_are_one_chart_and_others_are_not() {
        let mut joined = plane("a", Vec3::ZERO, Vec3::X, Vec3::Z, 2, 1);
        joined.uv_sets = vec![Vec::new(), joined.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect()];
        let mut other = joined.clone();
        other.name = "b".into();
        let atlas = Atlas::of(&scene(vec![joined.clone(), other]));
        assert_eq!((atlas.chart.as_slice(), atlas.n_charts), ([0, 0, 0, 0, 1, 1, 1, 1].as_slice(), 2));

        // The same plane with its second quad cut off in uv.
        let mut cut = joined;
        let uv = cut.uv_sets[1].clone();
        let first_new = cut.positions.len() as u32;
        cut.positions.extend_from_within(..);
        cut.normals.extend_from_within(..);
        cut.uv_sets[1].extend(uv.iter().map(|&uv| uv + 2.0));
        for triangle in &mut cut.triangles[2..] {
            *triangle = triangle.map(|vertex| vertex + first_new);
        }
        let atlas = Atlas::of(&scene(vec![cut]));
        assert_eq!((atlas.chart.as_slice(), atlas.n_charts), ([0, 0, 1, 1].as_slice(), 2));
    }
}
