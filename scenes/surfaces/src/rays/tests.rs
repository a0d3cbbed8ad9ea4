//! Watertightness, agreement with brute force, duplicates, sides and masks.

use super::{RayCaster, bvh::brute_force};
use glam::{Vec2, Vec3, Vec4};
use localprt_formats::directions::{counter_uniform, spherical_fibonacci};
use localprt_scenes::{AlphaMode, Image, Material, Mesh, Scene, Texture, TextureRef, Wrap};
use rayon::prelude::*;
use std::time::Instant;

fn scene_of(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: Material) -> Scene {
    let normals = vec![Vec3::Y; positions.len()];
    Scene {
        meshes: vec![Mesh { positions, normals, triangles, ..Mesh::default() }],
        materials: vec![material],
        ..Scene::default()
    }
}

/// A closed surface: the cube's faces in `n` by `n` squares, each vertex passed through `shape`.
fn closed(n: u32, shape: impl Fn(Vec3) -> Vec3) -> Scene {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let first = positions.len() as u32;
            for y in 0..=n {
                for x in 0..=n {
                    let at = |i: u32| i as f32 / n as f32 * 2.0 - 1.0;
                    let mut point = [0.0; 3];
                    point[axis] = sign;
                    point[(axis + 1) % 3] = at(x);
                    point[(axis + 2) % 3] = at(y);
                    positions.push(shape(Vec3::from(point)));
                }
            }
            for y in 0..n {
                for x in 0..n {
                    let corner = first + y * (n + 1) + x;
                    let [a, b, c, d] = [corner, corner + 1, corner + n + 1, corner + n + 2];
                    triangles.extend(if sign > 0.0 { [[a, b, d], [a, d, c]] } else { [[a, d, b], [a, c, d]] });
                }
            }
        }
    }
    scene_of(positions, triangles, Material::default())
}

/// Rays from inside aimed at vertices, at points of edges, along the axes and anywhere: how many leave.
fn escapes(scene: &Scene, center: Vec3, inner: f32, n_rays: u64) -> usize {
    let caster = RayCaster::new(scene).expect("tree");
    let mesh = &scene.meshes[0];
    (0..n_rays)
        .into_par_iter()
        .filter(|&ray| {
            let random = |k| counter_uniform(5, ray, k) as f32;
            let offset = Vec3::new(random(0), random(1), random(2)) * 2.0 - 1.0;
            let origin = center + offset * inner;
            let triangle = mesh.triangles[(random(3) * mesh.triangles.len() as f32) as usize % mesh.triangles.len()];
            let [a, b, _] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            let dir = match ray % 4 {
                0 => a - origin,
                1 => a.lerp(b, random(4)) - origin,
                2 => Vec3::AXES[(ray / 4 % 3) as usize] * if ray / 12 % 2 == 0 { 1.0 } else { -1.0 },
                _ => Vec3::from(spherical_fibonacci((ray / 4 % 4096) as u32, 4096)),
            };
            // Half of the axis rays start on the mesh's own grid planes.
            let origin = if ray % 4 == 2 && ray / 24 % 2 == 0 { center } else { origin };
            caster.closest_hit(origin, dir.normalize()).is_none()
        })
        .count()
}

#[test]
fn no_ray_escapes_from_a_closed_mesh() {
    // 10 million rays over five closed meshes.
    let far = Vec3::new(1000.0, -2000.0, 500.0);
    let cases: [(&str, Scene, Vec3, f32); 5] = [
        ("sphere", closed(36, Vec3::normalize), Vec3::ZERO, 0.5),
        ("cube", closed(32, |p| p), Vec3::ZERO, 0.9),
        ("needle box", closed(16, |p| p * Vec3::new(50.0, 0.05, 0.05)), Vec3::ZERO, 0.04),
        (
            "crumpled sphere",
            closed(24, |p| p.normalize() * (1.0 + 0.3 * (7.0 * p).x.sin() * (9.0 * p).y.cos())),
            Vec3::ZERO,
            0.3,
        ),
        ("sphere far from the origin", closed(24, |p| p.normalize() + far), far, 0.5),
    ];
    for (name, scene, center, inner) in &cases {
        assert_eq!(escapes(scene, *center, *inner, 2_000_000), 0, "{name}");
    }
}

#[test]
fn a_missing_triangle_lets_rays_out() {
    let mut scene = closed(8, |p| p);
    scene.meshes[0].triangles.pop();
    assert!(escapes(&scene, Vec3::ZERO, 0.9, 100_000) > 0);
}

#[test]
fn closest_hits_agree_with_brute_force() {
    let scene = closed(6, |p| p * (1.0 + 0.4 * (5.0 * p.x + 3.0 * p.y).sin()));
    let caster = RayCaster::new(&scene).expect("tree");
    let triangles: Vec<[Vec3; 3]> = scene.faces().map(|(mesh, triangle)| scene.corners(mesh, triangle)).collect();
    let wrong = (0..100_000u64)
        .into_par_iter()
        .filter(|&ray| {
            let random = |k| counter_uniform(11, ray, k) as f32;
            let origin = Vec3::new(random(0), random(1), random(2)) * 4.0 - 2.0;
            let dir = Vec3::from(spherical_fibonacci((ray % 5003) as u32, 5003));
            match (caster.closest_hit(origin, dir), brute_force(&triangles, origin, dir)) {
                (None, None) => false,
                // f32 distances of order 1 through a 1/dir.z shear: good to 1e-5 except at grazing incidence.
                (Some(hit), Some((t, index))) => {
                    let [a, b, c] = triangles[index];
                    let grazing = (b - a).cross(c - a).normalize().dot(dir).abs().max(1e-3);
                    (f64::from(hit.t) - t).abs() > 1e-5 / f64::from(grazing)
                }
                // Exactly on a silhouette the two may differ.
                (Some(hit), None) => hit.normal.dot(dir).abs() > 1e-3,
                (None, Some((_, index))) => {
                    let [a, b, c] = triangles[index];
                    (b - a).cross(c - a).normalize().dot(dir).abs() > 1e-3
                }
            }
        })
        .count();
    // A ray through the very edge of a silhouette is a hit to one and a miss to the other: none in this set.
    assert_eq!(wrong, 0);
}

#[test]
fn identical_triangles_are_one() {
    let scene = scene_of(vec![Vec3::ZERO, Vec3::X, Vec3::Z], vec![[0, 1, 2]; 200_000], Material::default());
    let start = Instant::now();
    let caster = RayCaster::new(&scene).expect("tree");
    assert_eq!(caster.triangle_count(), 1);
    assert!(start.elapsed().as_secs_f64() < 2.0, "{:?}", start.elapsed());
    assert!(caster.closest_hit(Vec3::new(0.2, 1.0, 0.2), Vec3::NEG_Y).is_some());
}

#[test]
fn sides_are_told_apart() {
    // A one-sided triangle with its front up: black from below.
    let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::X];
    let (above, below) = (Vec3::new(0.2, 1.0, 0.2), Vec3::new(0.2, -1.0, 0.2));
    let scene = scene_of(positions.clone(), vec![[0, 1, 2]], Material::default());
    let caster = RayCaster::new(&scene).expect("tree");
    let top = caster.closest_hit(above, Vec3::NEG_Y).expect("hit");
    assert!(top.point.is_some() && top.normal == Vec3::Y && top.t == 1.0);
    let bottom = caster.closest_hit(below, Vec3::Y).expect("hit");
    assert!(bottom.point.is_none() && bottom.normal == Vec3::NEG_Y);

    // Double-sided: the same face from below.
    let both = scene_of(positions.clone(), vec![[0, 1, 2]], Material { double_sided: true, ..Material::default() });
    let caster = RayCaster::new(&both).expect("tree");
    assert_eq!(caster.closest_hit(below, Vec3::Y).expect("hit").point.expect("face").face.0, 0);

    // Two faces of opposite winding: each its own, and barycentrics in the face's own corner order.
    let twins = scene_of(positions.clone(), vec![[0, 1, 2], [1, 0, 2]], Material::default());
    let caster = RayCaster::new(&twins).expect("tree");
    assert_eq!(caster.triangle_count(), 1);
    for (origin, dir, face) in [(above, Vec3::NEG_Y, 0), (below, Vec3::Y, 1)] {
        let point = caster.closest_hit(origin, dir).expect("hit").point.expect("face");
        assert_eq!(point.face.0, face);
        let corners = twins.corners(point.mesh, point.triangle);
        let at =
            corners[0] * point.barycentrics.x + corners[1] * point.barycentrics.y + corners[2] * point.barycentrics.z;
        // Coordinates of order 1: a few f32 roundings.
        assert!(at.distance(Vec3::new(0.2, 0.0, 0.2)) < 1e-6, "{at}");
    }
}

#[test]
fn holes_of_a_mask_let_rays_through() {
    // Left half of the texture is a hole.
    let image = Image {
        name: "mask".into(),
        width: 2,
        height: 1,
        rgba: vec![255, 255, 255, 0, 255, 255, 255, 255],
        encoded: None,
    };
    let texture = Texture { image: 0, wrap_u: Wrap::ClampToEdge, wrap_v: Wrap::ClampToEdge, nearest: true };
    let reference = TextureRef { texture: 0, uv_set: 0, transform: Default::default() };
    let material = Material {
        base_color: Vec4::ONE,
        base_color_texture: Some(reference),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    };
    let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)];
    let positions = corners.map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec();
    let mut scene = scene_of(positions, vec![[0, 1, 2], [0, 2, 3]], material);
    scene.meshes[0].uv_sets = vec![corners.map(|(x, z)| Vec2::new(x, z)).to_vec()];
    scene.images.push(image);
    scene.textures.push(texture);
    let caster = RayCaster::new(&scene).expect("tree");
    let (hole, solid) = (Vec3::new(0.25, 1.0, 0.4), Vec3::new(0.75, 1.0, 0.4));
    assert!(caster.closest_hit(hole, Vec3::NEG_Y).is_none());
    assert!(caster.closest_hit(solid, Vec3::NEG_Y).is_some());
    assert!(caster.visible(hole, hole - 2.0 * Vec3::Y) && caster.escapes(hole, Vec3::NEG_Y));
    assert!(!caster.visible(solid, solid - 2.0 * Vec3::Y) && !caster.escapes(solid, Vec3::NEG_Y));
}

#[test]
fn an_empty_scene_stops_no_ray() {
    let scene = Scene::default();
    let caster = RayCaster::new(&scene).expect("tree");
    assert!(caster.closest_hit(Vec3::ZERO, Vec3::X).is_none());
    assert!(caster.visible(Vec3::ZERO, Vec3::ONE));
}

#[test]
fn of_equally_near_triangles_the_first_is_met_whatever_else_there_is() {
    // Squares of two triangles in one plane, each with a copy of another split; and some that only change the tree.
    let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    let stacked = |others: u32| {
        let mut positions = corners.to_vec();
        let mut triangles = vec![[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]];
        for other in 0..others {
            let place = Vec3::new(2.0 + other as f32, counter_uniform(9, other.into(), 0) as f32, -0.5);
            triangles.push([0, 1, 2].map(|corner| positions.len() as u32 + corner));
            positions.extend([place, place + Vec3::X, place + Vec3::Y]);
        }
        scene_of(positions, triangles, Material { double_sided: true, ..Material::default() })
    };
    for others in [0, 1, 5, 40] {
        let scene = stacked(others);
        let caster = RayCaster::new(&scene).expect("tree");
        for i in 0..500 {
            let [x, y] = [0, 1].map(|axis| 0.02 + 0.96 * counter_uniform(8, i, axis) as f32);
            if (x - y).abs() < 0.01 {
                continue;
            }
            let hit = caster.closest_hit(Vec3::new(x, y, 1.0), -Vec3::Z).expect("a hit").point.expect("a face");
            assert_eq!(hit.triangle, usize::from(y > x), "{x} {y} among {others}");
        }
    }
}
