//! Texels that small parts share: which faces lie in one point of the map, and where samples of all of them stand.

use super::{Atlas, Texel};
use crate::{rays::FacePoint, subdivision};
use glam::Vec3;
use localprt_scenes::{FaceId, Scene};

/// Parts of a face that samples fall on in turn: the middles of four equal triangles.
const PARTS: usize = 4;

/// Faces that lie in one point of a map, by the texel that holds it.
pub(super) struct SharedTexels {
    /// By rising texel, then face.
    faces: Vec<SharedFace>,
    /// Texels per side.
    size: u32,
}

struct SharedFace {
    texel: u32,
    face: u32,
    mesh: u32,
    triangle: u32,
}

impl SharedTexels {
    /// Of a map of `size` texels per side.
    pub(super) fn of(scene: &Scene, atlas: &Atlas, size: u32) -> Self {
        let mut faces = Vec::new();
        for (face, ((mesh, triangle), uv)) in scene.faces().zip(&atlas.corners).enumerate() {
            if uv[0] == uv[1] && uv[1] == uv[2] {
                let at = |place: f32| ((place * size as f32).max(0.0) as u32).min(size - 1);
                let texel = at(uv[0].y) * size + at(uv[0].x);
                faces.push(SharedFace { texel, face: face as u32, mesh: mesh as u32, triangle: triangle as u32 });
            }
        }
        faces.sort_by_key(|shared| (shared.texel, shared.face));
        Self { faces, size }
    }

    /// Points spread by area over the texel's own face and those that share the texel with it, in two rounds of `count`; none where
    /// there are no others, and where the own face is more than a part of the texel: needles are one point of a large face's chart.
    pub(super) fn points(&self, scene: &Scene, atlas: &Atlas, texel: &Texel, count: usize) -> Vec<FacePoint> {
        let first = self.faces.partition_point(|shared| shared.texel < texel.index);
        let of_texel = self.faces[first..].iter().take_while(|shared| shared.texel == texel.index);
        let others: Vec<(u32, u32, u32)> = of_texel
            .filter(|shared| atlas.chart[shared.face as usize] == texel.chart)
            .map(|shared| (shared.face, shared.mesh, shared.triangle))
            .collect();
        let own = atlas.corners[texel.face.0 as usize];
        let extent = own[0].max(own[1]).max(own[2]) - own[0].min(own[1]).min(own[2]);
        if others.is_empty() || extent.max_element() * self.size as f32 > 1.0 {
            return Vec::new();
        }
        let faces: Vec<(u32, u32, u32)> =
            std::iter::once((texel.face.0, texel.mesh, texel.triangle)).chain(others).collect();
        let mut sum_m2 = 0.0;
        let sums: Vec<f64> = faces
            .iter()
            .map(|&(_, mesh, triangle)| {
                sum_m2 += scene.area_m2(mesh as usize, triangle as usize);
                sum_m2
            })
            .collect();
        let parts: Vec<[f32; 3]> = subdivision(2).collect();
        (0..2 * count)
            .map(|number| {
                let share = ((number % count) as f64 + if number < count { 0.5 } else { 0.0 }) / count as f64;
                let place = sums.partition_point(|&sum| sum <= share * sum_m2).min(faces.len() - 1);
                let (face, mesh, triangle) = faces[place];
                FacePoint {
                    face: FaceId(face),
                    mesh: mesh as usize,
                    triangle: triangle as usize,
                    barycentrics: Vec3::from(parts[number % PARTS]),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{samples::SampledMap, texels};
    use super::*;
    use crate::{rays::RayCaster, test_scenes};
    use glam::Vec2;
    use localprt_scenes::Mesh;

    /// A triangle of half a square metre that covers most of the first texel of 4 x 4, and a square metre that lies in one of its
    /// corners there, a metre beside it; and something between them.
    fn samples(between: Option<Mesh>) -> Vec<Vec3> {
        let mut own = test_scenes::plane("own", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1);
        own.triangles.truncate(1);
        let own = test_scenes::with_uv(own, |at| Vec2::new(0.01, 0.01) + 0.2 * Vec2::new(at.x, at.z));
        let corner = own.uv_sets[1][own.triangles[0][0] as usize];
        let other = test_scenes::plane("other", 2.0 * Vec3::X, Vec3::X, Vec3::Z, 1, 1);
        let other = test_scenes::with_uv(other, |_| corner);
        let scene = test_scenes::scene([own, other].into_iter().chain(between).collect());
        let atlas = Atlas::of(&scene);
        let map = texels::cover(&scene, &atlas, 4);
        let caster = RayCaster::new(&scene).expect("tree");
        let sampled = SampledMap { caster: &caster, atlas: &atlas, map: &map, is_wanted: &|_| true };
        let own = |texel: &Texel| Some(texel.point().surface_point(&scene));
        let texels = sampled.visit(Vec::with_capacity, own, |texels: &mut Vec<Vec<Vec3>>, texel, samples| {
            assert!(!samples.is_whole && texel.index == 0);
            texels.push(samples.points.iter().map(|point| point.surface_point(&scene).position).collect());
        });
        texels.concat().pop().expect("one texel")
    }

    #[test]
    fn samples_are_spread_over_all_parts_by_area() {
        let samples = samples(None);
        assert_eq!(samples.iter().map(|at| at.x > 1.0).collect::<Vec<_>>(), [false, true, true, true]);
        assert!((0..4).all(|a| (0..a).all(|b| samples[a].distance(samples[b]) > 0.1)), "{samples:?}");
    }

    #[test]
    fn parts_behind_a_wall_have_no_samples() {
        let wall = test_scenes::cuboid("wall", Vec3::new(1.4, -1.0, -9.0), Vec3::new(1.6, 9.0, 9.0));
        let samples = samples(Some(wall));
        assert!(!samples.is_empty() && samples.iter().all(|at| at.x < 1.0), "{samples:?}");
    }

    #[test]
    fn a_needle_at_a_corner_leaves_a_large_face_its_texels() {
        let floor = test_scenes::plane("floor", Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Z, 1, 1);
        let floor = test_scenes::with_uv(floor, |at| 0.01 + 0.2 * Vec2::new(at.x, at.z));
        let corner = floor.uv_sets[1][0];
        let needle = test_scenes::plane("needle", Vec3::ZERO, 1e-3 * Vec3::X, Vec3::Z, 1, 1);
        let needle = test_scenes::with_uv(needle, |_| corner);
        let scene = test_scenes::scene(vec![floor, needle]);
        let atlas = Atlas::of(&scene);
        let map = texels::cover(&scene, &atlas, 16);
        let shared = SharedTexels::of(&scene, &atlas, 16);
        assert!(map.texels.iter().all(|texel| shared.points(&scene, &atlas, texel, 4).is_empty()));
    }
}
