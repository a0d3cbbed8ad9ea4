//! Cuts where surfaces stand on each other: what is cut, that it stays closed, and that charts end there.

use super::*;
use crate::{
    lightmap::{
        Atlas, receivers,
        test_scenes::{cuboid, inward, merged, plane, scene, sphere},
        unwrap::{self, LayoutSize, Wanted},
    },
    rays::RayCaster,
    scale::{LocalScale, Seen},
    settings::UnwrapBackend,
};
use glam::{Quat, Vec2};
use localprt_scenes::Scene;
use std::collections::BTreeMap;

const TEXEL_M: f32 = 0.25;

fn cut(before: &Scene) -> (Scene, Walls) {
    let caster = RayCaster::new(before).unwrap();
    let mut after = before.clone();
    let walls = by_surfaces(&mut after, &caster, &|_| TEXEL_M);
    (after, walls)
}

/// A floor of 10 x 10 m in a few quads and of two meshes, and a wall of no thickness, from `below` the floor to 2 m above it and from x =
/// -2 m to `to`, turned about y.
fn floor_and_wall(turn: f32, below: f32, to: f32) -> Scene {
    let left = plane("left", Vec3::new(-5.0, 0.0, -5.0), Vec3::X * 5.0, Vec3::Z * 10.0, 1, 2);
    let right = plane("right", Vec3::new(0.0, 0.0, -5.0), Vec3::X * 5.0, Vec3::Z * 10.0, 1, 2);
    let mut wall = plane("wall", Vec3::new(-2.0, -below, 0.3), Vec3::X * (to + 2.0), Vec3::Y * (2.0 + below), 1, 1);
    for position in &mut wall.positions {
        *position = Quat::from_rotation_y(turn) * *position;
    }
    scene(vec![left, right, wall])
}

/// How often each edge is used in each direction.
fn uses(scene: &Scene) -> BTreeMap<EdgeKey, [u32; 2]> {
    let mut uses = BTreeMap::new();
    for (mesh, triangle) in scene.faces() {
        let corners = scene.corners(mesh, triangle);
        for corner in 0..3 {
            let ends = [corners[corner], corners[(corner + 1) % 3]];
            let key = key(ends);
            uses.entry(key).or_insert([0; 2])[usize::from(key[0] != place(ends[0]))] += 1;
        }
    }
    uses
}

fn area_m2(scene: &Scene) -> f64 {
    scene.faces().map(|(mesh, triangle)| scene.area_m2(mesh, triangle)).sum()
}

/// Both sides of every edge, but for those of the border before.
#[track_caller]
fn assert_closed(before: &Scene, after: &Scene) {
    let on_border = |uses: &BTreeMap<EdgeKey, [u32; 2]>| -> f32 {
        let length = |key: &EdgeKey| {
            let [a, b] = key.map(|end| Vec3::from(end.map(f32::from_bits)));
            a.distance(b)
        };
        uses.iter().filter(|(_, uses)| uses[0] + uses[1] == 1).map(|(key, _)| length(key)).sum()
    };
    let [of_before, of_after] = [before, after].map(|scene| on_border(&uses(scene)));
    // A T-junction is a border on both sides.
    assert!((of_after - of_before).abs() < 1e-3, "{of_before} {of_after}");
    assert!((area_m2(after) / area_m2(before) - 1.0).abs() < 1e-5);
}

#[test]
fn a_floor_is_cut_where_a_wall_stands_on_it_and_stays_closed() {
    for degrees in [0.0f32, 1.0, 10.0, 45.0, 90.0, 137.0] {
        // Through the floor, and just on it.
        for below in [0.4, 0.0] {
            let before = floor_and_wall(degrees.to_radians(), below, 2.5);
            let (after, walls) = cut(&before);
            assert!(!walls.is_empty(), "{degrees} {below}");
            assert_closed(&before, &after);
            // The wall stands where it was on the edges, all along.
            let length: f32 = (0..2)
                .flat_map(|mesh| &walls.edges[mesh])
                .map(|key| {
                    let [a, b] = key.map(|end| Vec3::from(end.map(f32::from_bits)));
                    let at = |place: Vec3| Quat::from_rotation_y(-degrees.to_radians()) * place;
                    assert!((at(a).z - 0.3).abs() < 0.01 && (at(b).z - 0.3).abs() < 0.01, "{} {}", at(a), at(b));
                    a.distance(b)
                })
                .sum();
            assert!(length >= 4.4, "{degrees} {below}: {length}");
            // Every normal and texture coordinate is that of the plane.
            assert!(after.meshes[0].normals.iter().all(|normal| normal.distance(Vec3::Y) < 1e-6));
        }
    }
}

#[test]
fn what_hovers_is_low_or_is_behind_cuts_nothing() {
    let floor = || plane("floor", Vec3::new(-5.0, 0.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, 1, 1);
    let on_floor = |low: Vec3, high: Vec3| scene(vec![floor(), cuboid("thing", low, high)]);
    for before in [
        // Light passes below.
        on_floor(Vec3::new(-1.0, 0.1, -1.0), Vec3::new(1.0, 2.0, 1.0)),
        // A carpet.
        on_floor(Vec3::new(-1.0, -0.01, -1.0), Vec3::new(1.0, 0.03, 1.0)),
        // In the cellar.
        on_floor(Vec3::new(-1.0, -2.0, -1.0), Vec3::new(1.0, 0.0, 1.0)),
        // A leg, thinner than half a texel.
        on_floor(Vec3::new(0.0, -0.1, 0.0), Vec3::new(0.1, 2.0, 0.1)),
    ] {
        let (after, walls) = cut(&before);
        assert!(walls.edges.first().is_none_or(HashSet::is_empty));
        assert_eq!(after.meshes[0].triangles, before.meshes[0].triangles);
    }
}

#[test]
fn nothing_is_cut_where_nothing_stands() {
    // Neighbors that share edges, at all angles.
    let ball = sphere("ball", Vec3::ZERO, 2.0, 12);
    let bowl = inward(ball.clone());
    for mesh in [ball, bowl, cuboid("box", Vec3::ZERO, Vec3::ONE * 2.0)] {
        let before = scene(vec![mesh]);
        let (after, walls) = cut(&before);
        assert_eq!(walls, Walls::NONE);
        assert_eq!(after.meshes[0].triangles, before.meshes[0].triangles);
    }
}

/// Charts of the receivers on the floor of a cut scene, with their places.
fn charts_of_floor(before: &Scene) -> Vec<(Vec3, u32)> {
    let caster = RayCaster::new(before).unwrap();
    let mut after = before.clone();
    let walls = by_surfaces(&mut after, &caster, &|_| TEXEL_M);
    let backend = unwrap::backend(UnwrapBackend::Uvunwrap).unwrap();
    let (scale, seen) = (LocalScale::uniform(), Seen::default());
    let wanted = Wanted { scale: &scale, seen: &seen, hidden: &[], walls: &walls, texel_m: &|_| TEXEL_M, finest: None };
    let charts = unwrap::charts(&after, wanted, backend.as_ref(), &|_, _, _| true).unwrap();
    let size = LayoutSize { texels: 1 << 20, lightmap: None, finest_m: Some(TEXEL_M) };
    let (laid_out, texels, _) = charts.lay_out(after, &caster, size, &|_, _, _| true).unwrap();
    let caster = RayCaster::new(&laid_out).unwrap();
    let receivers = receivers::place(&laid_out, &Atlas::of(&laid_out), &caster, texels, &|_, _, _| true).unwrap();
    (0..receivers.len())
        .filter(|&receiver| receivers.normal[receiver].y > 0.9 && receivers.position[receiver].y.abs() < 0.01)
        .map(|receiver| (receivers.position[receiver], receivers.chart[receiver]))
        .collect()
}

#[test]
fn texels_on_two_sides_of_a_wall_belong_to_different_charts() {
    for degrees in [0.0f32, 10.0, 45.0] {
        // There is a way around the wall.
        let turn = degrees.to_radians();
        let floor = charts_of_floor(&floor_and_wall(turn, 0.2, 2.5));
        let at = |place: Vec3| Quat::from_rotation_y(-turn) * place;
        let beside = |place: Vec3, side: f32| {
            let place = at(place);
            let across = (place.z - 0.3) * side;
            place.x > -1.9 && place.x < 2.4 && across > 0.0 && across < 2.0 * TEXEL_M
        };
        let [near, far] = [1.0, -1.0].map(|side| {
            let mut charts: Vec<u32> =
                floor.iter().filter(|(place, _)| beside(*place, side)).map(|(_, chart)| *chart).collect();
            charts.sort_unstable();
            charts.dedup();
            charts
        });
        assert!(!near.is_empty() && !far.is_empty());
        assert!(near.iter().all(|chart| !far.contains(chart)), "{degrees}: {near:?} {far:?}");
    }
}

/// Whether receivers on the floor of `floor_and_wall`, turned by nothing, to both sides of what stands from z = `low` to `high` are of
/// different charts.
#[track_caller]
fn assert_sides_are_apart(before: &Scene, low: f32, high: f32) {
    let floor = charts_of_floor(before);
    let of_side = |from: f32, to: f32| {
        let is_there = |place: &Vec3| place.z > from && place.z < to && place.x.abs() < 1.5;
        floor.iter().filter(|(place, _)| is_there(place)).map(|(_, chart)| *chart).collect::<HashSet<u32>>()
    };
    let (near, far) = (of_side(low - 2.0 * TEXEL_M, low), of_side(high, high + 2.0 * TEXEL_M));
    assert!(!near.is_empty() && !far.is_empty() && near.is_disjoint(&far), "{near:?} {far:?}");
}

#[test]
fn sides_of_thick_walls_of_fine_walls_and_of_walls_that_share_an_edge_are_apart() {
    let floor =
        |columns, rows| plane("floor", Vec3::new(-5.0, 0.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, columns, rows);
    // One texel thick, with a way around.
    let thick = cuboid("thick", Vec3::new(-2.0, -0.2, 0.3), Vec3::new(2.5, 2.0, 0.5));
    assert_sides_are_apart(&scene(vec![floor(1, 1), thick]), 0.3, 0.5);
    // Of small faces: no line of one of them is half a texel long.
    let fine = plane("fine", Vec3::new(-2.0, -0.1, 0.3), Vec3::X * 4.5, Vec3::Y * 2.0, 40, 20);
    assert_sides_are_apart(&scene(vec![floor(1, 1), fine]), 0.3, 0.3);
    // With a low first row.
    let mut base = plane("base", Vec3::new(-2.0, 0.0, 0.3), Vec3::X * 4.5, Vec3::Y * 0.02, 1, 1);
    base = merged("wall", &[base, plane("", Vec3::new(-2.0, 0.02, 0.3), Vec3::X * 4.5, Vec3::Y * 2.0, 1, 1)]);
    assert_sides_are_apart(&scene(vec![floor(1, 1), base]), 0.3, 0.3);
    // On an edge that the faces of the floor share, with both of its ends.
    let shared = plane("shared", Vec3::new(-5.0, 0.0, 0.0), Vec3::X * 10.0, Vec3::Y * 2.0, 1, 1);
    assert_sides_are_apart(&scene(vec![floor(1, 2), shared]), 0.0, 0.0);
}

#[test]
fn tilted_floors_stay_closed_where_lines_meet_their_edge_apart() {
    let tilt = Quat::from_rotation_z(0.17);
    let left = plane("left", Vec3::new(-4.0, 0.0, -4.0), Vec3::X * 4.0, Vec3::Z * 8.0, 1, 1);
    let right = plane("right", Vec3::new(0.0, 0.0, -4.0), tilt * Vec3::X * 4.0, Vec3::Z * 8.0, 1, 1);
    let mut thing = cuboid("thing", Vec3::new(-2.0, -1.0, -1.0), Vec3::new(1.5, 2.0, 1.0));
    for position in &mut thing.positions {
        *position = Quat::from_rotation_y(0.35) * *position;
    }
    let before = scene(vec![left, right, thing]);
    let (after, walls) = cut(&before);
    assert!(!walls.is_empty());
    assert_closed(&before, &after);
}

#[test]
fn two_sides_of_a_face_are_cut_into_the_same_triangles() {
    let floor = plane("floor", Vec3::new(-5.0, 0.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, 2, 1);
    let back = inward(floor.clone());
    // Above and below, in different places.
    let above = plane("above", Vec3::new(-2.0, 0.0, 0.3), Vec3::X * 4.5, Vec3::Y * 2.0, 1, 1);
    let below = plane("below", Vec3::new(0.5, 0.0, -3.0), Vec3::new(1.0, 0.0, 5.0), Vec3::NEG_Y * 2.0, 1, 1);
    let before = scene(vec![floor, back, above, below]);
    let (after, walls) = cut(&before);
    assert!(walls.edges[0].len() > 1 && walls.edges[1].len() > 1 && walls.edges[0] != walls.edges[1]);
    let triangles = |mesh: usize| -> Vec<[[u32; 3]; 3]> {
        let of = |triangle| sorted(after.corners(mesh, triangle)).map(place);
        let mut triangles: Vec<_> = (0..after.meshes[mesh].triangles.len()).map(of).collect();
        triangles.sort_unstable();
        triangles
    };
    assert!(triangles(0).len() > 6);
    assert_eq!(triangles(0), triangles(1));
    let up = |mesh: usize| (0..after.meshes[mesh].triangles.len()).map(move |face| (mesh, face));
    assert!(up(0).all(|(mesh, face)| after.geometric_normal(mesh, face).y > 0.99));
    assert!(up(1).all(|(mesh, face)| after.geometric_normal(mesh, face).y < -0.99));
}

#[test]
fn meshes_of_many_small_faces_are_cut_alike() {
    let floor = plane("floor", Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, 33, 31);
    let mut floor = floor;
    floor.uv_sets = vec![floor.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect()];
    let turned = |mesh: &mut Mesh| {
        for position in &mut mesh.positions {
            *position = Quat::from_rotation_y(0.3) * *position;
        }
    };
    let mut crates = merged(
        "crates",
        &[
            cuboid("a", Vec3::new(-1.0, -0.2, -1.0), Vec3::new(0.0, 1.0, 0.2)),
            cuboid("b", Vec3::new(0.5, 0.0, 0.5), Vec3::new(1.5, 1.0, 1.5)),
        ],
    );
    turned(&mut crates);
    let before = scene(vec![floor, crates]);
    let (after, walls) = cut(&before);
    assert!(walls.edges[0].len() > 30, "{}", walls.edges[0].len());
    assert_closed(&before, &after);
    for (position, uv) in after.meshes[0].positions.iter().zip(&after.meshes[0].uv_sets[0]) {
        assert!(Vec2::new(position.x, position.z).distance(*uv) < 1e-5);
    }
    // The same on any number of threads.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| cut(&before));
    assert!(alone.1 == walls && alone.0.meshes[0].triangles == after.meshes[0].triangles);
}
