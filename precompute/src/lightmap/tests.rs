//! From scene to receivers: what must hold whatever the layout.

use super::test_scenes::{cuboid, inward, merged, plane, room, scene, sphere, with_uv};
use super::texels::ReceiverMap;
use super::unwrap::{LayoutSize, UnwrapError, Wanted, backend, charts, check_size, usable_layout};
use super::*;
use crate::rays::RayCaster;
use crate::scale::{LocalScale, Seen};
use crate::settings::UnwrapBackend;
use glam::Vec2;
use localprt_scenes::{AlphaMode, Image, Mesh, Scene, Texture, TextureRef, Wrap};

fn quiet(_: &str, _: usize, _: usize) -> bool {
    true
}

/// As many texels as fit a map of this size.
fn full(texels: u32) -> LayoutSize {
    LayoutSize { texels: u32::MAX, lightmap: Some(texels), finest_m: None }
}

/// Texels of that many metres, as far as the number of texels goes.
fn of_texel(texel_m: f32) -> LayoutSize {
    LayoutSize { texels: 1 << 22, lightmap: None, finest_m: Some(texel_m) }
}

/// Charts of even density that end at no walls.
fn even(scale: &LocalScale) -> Wanted<'_> {
    const NO_WALLS: &cut::Walls = &cut::Walls::NONE;
    const UNSEEN: &Seen = &Seen { hits: Vec::new(), typical: 0.0 };
    Wanted { scale, seen: UNSEEN, hidden: &[], walls: NO_WALLS, texel_m: &|_| 1.0, finest: None }
}

/// A layout at even density, whatever the scene has, and the size of its map.
fn unwrapped(scene: Scene, size: LayoutSize, progress: Progress) -> Result<(Scene, u32), UnwrapError> {
    check_size(size)?;
    let backend = backend(UnwrapBackend::Uvunwrap)?;
    let scale = LocalScale::uniform();
    let charts = charts(&scene, even(&scale), backend.as_ref(), progress)?;
    // Of a scene without triangles there is no tree to build, and nobody asks.
    let copy = scene.clone();
    let caster = RayCaster::new(&copy).unwrap();
    charts.lay_out(scene, &caster, size, progress).map(|(scene, texels, _)| (scene, texels))
}

fn laid_out(scene: Scene, texels: u32) -> Scene {
    unwrapped(scene, full(texels), &quiet).unwrap().0
}

fn receivers(scene: &Scene, size: u32) -> ReceiverSet {
    let caster = RayCaster::new(scene).unwrap();
    receivers::place(scene, &Atlas::of(scene), &caster, size, &quiet).unwrap()
}

/// Charts of a map's texels; `u32::MAX` where there is none.
fn chart_map(map: &TexelMap) -> Vec<u32> {
    let mut charts = vec![u32::MAX; (map.size * map.size) as usize];
    for texel in &map.texels {
        charts[texel.index as usize] = texel.chart;
    }
    charts
}

fn neighbors(texel: u32, size: u32, reach: i64) -> impl Iterator<Item = u32> {
    let (x, y, size) = (i64::from(texel % size), i64::from(texel / size), i64::from(size));
    (-reach..=reach)
        .flat_map(move |dy| (-reach..=reach).map(move |dx| (x + dx, y + dy)))
        .filter(move |&(x, y)| (0..size).contains(&x) && (0..size).contains(&y))
        .map(move |(x, y)| (y * size + x) as u32)
}

#[test]
fn charts_are_two_texels_apart_and_no_two_faces_share_a_texel() {
    for texels in [128, 300] {
        let before = room();
        let after = laid_out(before.clone(), texels);
        let atlas = Atlas::of(&after);
        let map = texels::cover(&after, &atlas, texels);
        let charts = chart_map(&map);
        for texel in &map.texels {
            for near in neighbors(texel.index, texels, 2) {
                let other = charts[near as usize];
                assert!(other == u32::MAX || other == texel.chart, "charts {other} and {} touch", texel.chart);
            }
        }
        // The check for overlap accepts what the unwrap made.
        assert_eq!(usable_layout(&after, full(texels)).unwrap(), Ok(texels));
        // Faces are the same ones in the same order.
        for (mesh, triangle) in before.faces() {
            assert_eq!(before.corners(mesh, triangle), after.corners(mesh, triangle));
        }
        let share = map.texels.len() as f32 / (texels * texels) as f32;
        assert!(share > 0.6, "only {share} of the map is used");
    }
}

#[test]
fn texels_are_of_one_size_on_the_surface_and_no_finer_than_asked_for() {
    let (after, size) = unwrapped(room(), of_texel(0.1), &quiet).unwrap();
    assert_eq!(size % 4, 0);
    let atlas = Atlas::of(&after);
    for ((mesh, triangle), uv) in after.faces().zip(&atlas.corners).filter(|((mesh, _), _)| *mesh < 3) {
        let [a, b, c] = after.corners(mesh, triangle);
        let area = (b - a).cross(c - a).length() / 2.0;
        let texels = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs() / 2.0 * (size as f32).powi(2);
        // Coordinates are rounded to 2^-24 of the map: far below a thousandth of a texel.
        assert!(((area / texels).sqrt() / 0.1 - 1.0).abs() < 2e-3);
    }
}

#[test]
fn a_mesh_has_as_fine_texels_as_its_author_wants() {
    let mut scene = scene(vec![
        plane("as it is", Vec3::ZERO, Vec3::X * 4.0, Vec3::Z * 4.0, 1, 1),
        plane("finer", Vec3::X * 10.0, Vec3::X * 4.0, Vec3::Z * 4.0, 1, 1),
        plane("not at all", Vec3::X * 20.0, Vec3::X * 4.0, Vec3::Z * 4.0, 8, 8),
    ]);
    scene.meshes[1].lightmap.texel_scale = 2.0;
    scene.meshes[2].lightmap.bake = false;
    let (after, size) = unwrapped(scene, LayoutSize { texels: 10_000, ..LayoutSize::default() }, &quiet).unwrap();
    let atlas = Atlas::of(&after);
    let mut texels = [0.0; 3];
    for ((mesh, _), uv) in after.faces().zip(&atlas.corners) {
        texels[mesh] += (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs() / 2.0 * (size as f32).powi(2);
    }
    assert!((texels[1] / texels[0] / 4.0 - 1.0).abs() < 0.05, "{texels:?}");
    assert!(texels[2] < 3.0, "{texels:?}");
    let found = receivers(&after, size).len() as f32;
    assert!((found / 10_000.0 - 1.0).abs() < 0.05, "{found}");
}

#[test]
fn hidden_surfaces_have_next_to_no_texels() {
    let scene = scene(vec![
        plane("seen", Vec3::ZERO, Vec3::X * 4.0, Vec3::Z * 4.0, 2, 2),
        plane("hidden", Vec3::X * 10.0, Vec3::X * 4.0, Vec3::Z * 4.0, 2, 2),
    ]);
    let hidden: Vec<bool> = scene.faces().map(|(mesh, _)| mesh == 1).collect();
    let scale = LocalScale::uniform();
    let wanted = Wanted { hidden: &hidden, ..even(&scale) };
    let charts = charts(&scene, wanted, backend(UnwrapBackend::Uvunwrap).unwrap().as_ref(), &quiet).unwrap();
    let copy = scene.clone();
    let caster = RayCaster::new(&copy).unwrap();
    let (after, size, _) =
        charts.lay_out(scene, &caster, LayoutSize { texels: 4000, ..LayoutSize::default() }, &quiet).unwrap();
    let mut texels = [0.0; 2];
    for ((mesh, _), uv) in after.faces().zip(&Atlas::of(&after).corners) {
        texels[mesh] += (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs() / 2.0 * (size as f32).powi(2);
    }
    // A 64th of the edge: a 4096th of the texels, or one.
    assert!((texels[0] / 4000.0 - 1.0).abs() < 0.05 && texels[1] < 2.0, "{texels:?}");
}

#[test]
fn the_light_map_is_full_and_knows_the_receivers_of_its_texels() {
    let scene = room();
    let backend = backend(UnwrapBackend::Uvunwrap).unwrap();
    let scale = LocalScale::uniform();
    let charts = charts(&scene, even(&scale), backend.as_ref(), &quiet).unwrap();
    let copy = scene.clone();
    let caster = RayCaster::new(&copy).unwrap();
    let (after, _) = charts.lay_out_light_map(scene, &caster, 256, &quiet).unwrap();
    assert_eq!(after.light_map_set, Some(2));
    let (after, size, _) = charts.lay_out(after, &caster, of_texel(0.1), &quiet).unwrap();
    let (light_map, lightmap) = (Atlas::of_light_map(&after), Atlas::of(&after));
    assert!(light_map.n_charts == lightmap.n_charts && light_map.corners != lightmap.corners);
    let has_receiver = vec![true; (size * size) as usize];
    let receivers = ReceiverMap { atlas: &lightmap, size, has_receiver: &has_receiver };
    let (map, places) = texels::cover_visible(&after, &light_map, 256, &receivers);
    let share = map.texels.len() as f32 / (256.0 * 256.0);
    assert!(share > 0.55, "{share} of the light map is used");
    // At its place in the receiver map a texel finds a texel of the same surface: it samples it within its diagonal, 0.1 m sqrt(2).
    let at_receivers: std::collections::BTreeMap<u32, Texel> =
        texels::cover(&after, &lightmap, size).texels.into_iter().map(|texel| (texel.index, texel)).collect();
    let position = |texel: &Texel| {
        let corners = after.corners(texel.mesh as usize, texel.triangle as usize);
        (0..3).map(|corner| corners[corner] * texel.barycentrics[corner]).sum::<Vec3>()
    };
    for (texel, place) in map.texels.iter().zip(&places) {
        let [x, y] = (*place * size as f32).to_array().map(|at| (at as u32).min(size - 1));
        let found = at_receivers.get(&(y * size + x)).expect("a covered texel");
        let apart_m = position(texel).distance(position(found));
        assert!(apart_m < 0.1 * 2.0f32.sqrt() + 1e-3, "{apart_m}");
    }
    // Charts are two texels apart there, too.
    let charts = chart_map(&map);
    for texel in &map.texels {
        assert!(neighbors(texel.index, 256, 2).all(|near| [u32::MAX, texel.chart].contains(&charts[near as usize])));
    }
    // What has no receiver sends no light.
    let nowhere = ReceiverMap { has_receiver: &vec![false; has_receiver.len()], ..receivers };
    let (none, _) = texels::cover_visible(&after, &light_map, 256, &nowhere);
    assert!(none.texels.is_empty());
}

#[test]
fn as_many_texels_are_touched_as_were_asked_for() {
    // Walls of one height take one more row all at once: of 20 rows that is 5 %.
    for (texels, within) in [(2_000, 0.05), (20_000, 0.03)] {
        let (after, size) = unwrapped(room(), LayoutSize { texels, ..LayoutSize::default() }, &quiet).unwrap();
        let covered = texels::cover(&after, &Atlas::of(&after), size).texels.len();
        assert!((covered as f32 / texels as f32 - 1.0).abs() < within, "{covered} of {texels}");
        // The map's size follows: it is not much larger than what it holds.
        assert!(covered as f32 > 0.5 * (size as f32).powi(2), "{covered} of {size} squared");
    }
    // A map that cannot hold as many holds what it can.
    let (after, _) = unwrapped(room(), LayoutSize { texels: 20_000, ..full(64) }, &quiet).unwrap();
    let covered = texels::cover(&after, &Atlas::of(&after), 64).texels.len();
    assert!((2_000..4_096).contains(&covered), "{covered}");
}

#[test]
fn small_charts_share_texels_with_neighbors_that_they_see() {
    // 400 leaves of a square centimetre in a square metre, on either side of a wall that the texels are far too coarse for.
    let leaf = |i: u32| {
        let at = Vec3::new((i % 20) as f32 * 0.05 + 0.01, 1.0, (i / 20) as f32 * 0.05 + 0.01);
        plane("", at, Vec3::Z * 0.01, Vec3::X * 0.01, 1, 1)
    };
    let leaves = merged("leaves", &(0..400).map(leaf).collect::<Vec<_>>());
    let wall = cuboid("wall", Vec3::new(0.5, 0.5, -1.0), Vec3::new(0.52, 1.5, 2.0));
    let (after, size) =
        unwrapped(scene(vec![leaves, wall]), LayoutSize { texels: 200, ..LayoutSize::default() }, &quiet).unwrap();
    let atlas = Atlas::of(&after);
    let of_leaves: Vec<u32> = atlas.chart[..800].to_vec();
    let mut charts = of_leaves.clone();
    charts.sort_unstable();
    charts.dedup();
    assert!((2..60).contains(&charts.len()), "{} charts of 400 leaves", charts.len());
    // No chart reaches through the wall.
    for chart in charts {
        let sides = |face: usize| after.corners(0, face)[0].x < 0.5;
        let mut members = (0..800).filter(|&face| of_leaves[face] == chart).map(sides);
        let first = members.next();
        assert!(members.all(|side| Some(side) == first));
    }
    // Every chart has a texel.
    let map = texels::cover(&after, &atlas, size);
    assert!(of_leaves.iter().all(|chart| map.texels.iter().any(|texel| texel.chart == *chart)));
}

#[test]
fn a_layout_of_the_scene_is_kept_where_it_can_be_used() {
    let left = with_uv(plane("left", Vec3::ZERO, Vec3::X, Vec3::Z, 4, 4), |p| Vec2::new(p.x * 0.45, p.z * 0.9));
    let right = with_uv(plane("right", Vec3::Y, Vec3::X, Vec3::Z, 4, 4), |p| Vec2::new(p.x * 0.45 + 0.5, p.z * 0.9));
    let kept = scene(vec![left.clone(), right.clone()]);
    assert_eq!(usable_layout(&kept, full(64)).unwrap(), Ok(64));
    // 2 m^2 on 0.81 of the map: a texel of 1 cm takes 157.1 texels a side.
    assert_eq!(usable_layout(&kept, of_texel(0.01)).unwrap(), Ok(160));
    // 0.81 of 112 squared are 10,160.
    assert_eq!(usable_layout(&kept, LayoutSize { texels: 10_000, ..LayoutSize::default() }).unwrap(), Ok(112));

    let refused = |mesh: Mesh| usable_layout(&scene(vec![left.clone(), mesh]), full(64)).unwrap().unwrap_err();
    // Each mesh in its own 0..1, as engines with one map per mesh lay them out.
    assert!(refused(with_uv(right.clone(), |p| Vec2::new(p.x, p.z))).contains("overlaps"));
    // Folded onto itself.
    assert!(refused(with_uv(right.clone(), |p| Vec2::new((p.x - 0.5).abs() + 0.5, p.z))).contains("overlaps"));
    assert!(refused(with_uv(right.clone(), |p| Vec2::new(p.x + 0.5, p.z))).contains("leaves 0..1"));
    assert!(refused(with_uv(right.clone(), |_| Vec2::ONE)).contains("no area"));
    assert!(refused(Mesh { uv_sets: Vec::new(), ..right.clone() }).contains("no TEXCOORD_1"));
    assert!(refused(with_uv(right, |_| Vec2::NAN)).contains("leaves 0..1"));
}

#[test]
fn meshes_with_degenerate_faces_are_unwrapped_around_them() {
    let mut mesh = cuboid("block", Vec3::ZERO, Vec3::ONE);
    mesh.uv_sets = vec![mesh.positions.iter().map(|p| Vec2::new(p.x, p.y + p.z)).collect()];
    mesh.triangles.insert(3, [0, 0, 1]);
    mesh.triangles.push([4, 4, 4]);
    // Three points on a line.
    let middle = mesh.positions.len() as u32;
    mesh.positions.push((mesh.positions[0] + mesh.positions[1]) / 2.0);
    mesh.normals.push(mesh.normals[0]);
    mesh.uv_sets[0].push(Vec2::ZERO);
    mesh.triangles.push([0, middle, 1]);
    let before = scene(vec![mesh, Mesh { name: "empty".into(), ..Mesh::default() }]);
    let after = laid_out(before.clone(), 64);
    assert_eq!(after.face_count(), 15);
    for (mesh, triangle) in before.faces() {
        assert_eq!(before.corners(mesh, triangle), after.corners(mesh, triangle));
        let set = |scene: &Scene| {
            let mesh = &scene.meshes[mesh];
            mesh.triangles[triangle].map(|vertex| (mesh.uv_sets[0][vertex as usize], mesh.normals[vertex as usize]))
        };
        assert_eq!(set(&before), set(&after));
    }
    let set = receivers(&after, 64);
    assert!(set.len() > 1000 && set.invalid.is_empty());
    // A scene of nothing is nothing.
    let nothing = laid_out(scene(Vec::new()), 64);
    assert!(receivers(&nothing, 64).is_empty());
}

#[test]
fn sizes_that_cannot_work_are_refused_before_any_work() {
    let never = |_: &str, _: usize, _: usize| -> bool { panic!("unwrapping has begun") };
    let ask = |size| unwrapped(room(), size, &never).unwrap_err();
    for texel_m in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(ask(of_texel(texel_m)), UnwrapError::BadTexel { .. }));
    }
    for texels in [0, 15, 8193] {
        assert!(matches!(ask(full(texels)), UnwrapError::SizeOutOfRange { .. }));
    }
    let stop = |_: &str, _: usize, _: usize| false;
    assert!(matches!(unwrapped(room(), full(64), &stop), Err(UnwrapError::Cancelled)));
    let mut broken = room();
    broken.meshes[1].positions[0].x = f32::NAN;
    assert!(matches!(unwrapped(broken, full(64), &quiet), Err(UnwrapError::NotFinite { vertex: 0, .. })));
}

#[test]
fn charts_that_are_too_many_for_a_map_are_joined() {
    // 1600 separate quads take at least 9 texels each: 64 squared has room for 455.
    let quads: Vec<Mesh> = (0..1600)
        .map(|i| plane("", Vec3::new((i % 40) as f32, 0.0, (i / 40) as f32), Vec3::X * 0.5, Vec3::Z * 0.5, 1, 1))
        .collect();
    let after = laid_out(scene(vec![merged("quads", &quads)]), 64);
    let charts = Atlas::of(&after).n_charts;
    assert!((50..455).contains(&charts), "{charts}");
    assert!(receivers(&after, 64).len() >= charts as usize);
}

#[test]
fn a_texel_belongs_to_the_face_at_its_center_or_the_nearest() {
    // A quad from (1, 1) to (3.25, 3) texels of an 8 x 8 map.
    let quad = with_uv(plane("quad", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |p| {
        Vec2::new(0.125 + p.x * 2.25 / 8.0, 0.125 + p.z * 0.25)
    });
    let scene = scene(vec![quad]);
    let map = texels::cover(&scene, &Atlas::of(&scene), 8);
    let indices: Vec<u32> = map.texels.iter().map(|texel| texel.index).collect();
    assert_eq!(indices, [9, 10, 11, 17, 18, 19]);
    for texel in &map.texels {
        let [a, b, c] = scene.corners(0, texel.triangle as usize);
        let weights = texel.barycentrics;
        let point = a * weights.x + b * weights.y + c * weights.z;
        let (x, y) = (texel.index % 8, texel.index / 8);
        let center = Vec2::new((x as f32 - 0.5) / 2.25, (y as f32 - 0.5) / 2.0);
        if x < 3 {
            // The diagonal passes through one center; the first face has it.
            assert!(point.distance(Vec3::new(center.x, 0.0, center.y)) < 1e-6);
        } else {
            // The center lies off the quad, whose last quarter of a texel spans x from 0.889 to 1: its middle.
            assert!((point.x - 0.9444).abs() < 1e-3, "{point}");
        }
    }
}

#[test]
fn receivers_under_a_box_are_invalid_and_those_beside_it_are_not() {
    let floor = plane("floor", Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, 1, 1);
    let block = cuboid("block", Vec3::new(-0.52, 0.0, -0.52), Vec3::new(0.52, 1.0, 0.52));
    let walls = inward(cuboid("walls", Vec3::new(-2.0, -1e-3, -2.0), Vec3::new(2.0, 3.0, 2.0)));
    let after = laid_out(scene(vec![floor, block, walls]), 256);
    let atlas = Atlas::of(&after);
    let set = receivers(&after, 256);
    let map = texels::cover(&after, &atlas, 256);
    let (mut under, mut beside) = (0, 0);
    for texel in map.texels.iter().filter(|texel| texel.mesh == 0) {
        let [a, b, c] = after.corners(0, texel.triangle as usize);
        let weights = texel.barycentrics;
        let point = a * weights.x + b * weights.y + c * weights.z;
        let out = point.abs().max_element() - 0.52;
        // A texel's diagonal off the box's border all of the texel is on one side; 0.04 m is a texel here.
        if out > 0.06 {
            assert!(set.texel.binary_search(&texel.index).is_ok(), "{point} is free");
            beside += 1;
        } else if out < -0.06 {
            assert!(set.invalid.binary_search(&texel.index).is_ok(), "{point} is under the box");
            under += 1;
        }
    }
    assert!(under > 300 && beside > 5000, "{under} under, {beside} beside");
    // Texels cut by the box's border have a receiver outside of it, moved within the texel or beyond.
    for (receiver, position) in set.position.iter().enumerate() {
        if after.meshes[0].normals[0] == set.geometric_normal[receiver] && position.y == 0.0 {
            assert!(position.abs().max_element() >= 0.52, "{position} is under the box");
        }
    }
}

#[test]
fn a_sample_inside_a_wall_moves_out_along_the_floor() {
    // One texel of 0.5 m spans the 0.4 m thick wall and a little floor on the right of it.
    let floor = with_uv(plane("floor", Vec3::ZERO, Vec3::X * 2.0, Vec3::Z * 2.0, 1, 1), |p| Vec2::new(p.x, p.z) / 4.0);
    let wall = cuboid("wall", Vec3::new(0.49, -0.1, -1.0), Vec3::new(0.98, 2.0, 3.0));
    let wall = with_uv(wall, |_| Vec2::ONE);
    let set = receivers(&scene(vec![floor, wall]), 8);
    assert!(set.pushed > 0 && set.invalid.is_empty(), "{} pushed, invalid: {:?}", set.pushed, set.invalid);
    for position in &set.position {
        assert!(position.x < 0.49 || position.x > 0.98, "{position} is inside the wall");
        assert_eq!(position.y, 0.0);
    }
}

#[test]
fn receivers_stand_on_the_surface_of_their_chart() {
    let after = laid_out(room(), 200);
    let atlas = Atlas::of(&after);
    let caster = RayCaster::new(&after).unwrap();
    let set = receivers(&after, 200);
    assert!(set.len() > 20_000);
    let mut faces_of = vec![Vec::new(); atlas.n_charts as usize];
    for (face, place) in after.faces().enumerate() {
        faces_of[atlas.chart[face] as usize].push(place);
    }
    for receiver in 0..set.len() {
        let position = set.position[receiver].as_dvec3();
        let off = faces_of[set.chart[receiver] as usize].iter().map(|&(mesh, triangle)| {
            let [a, b, c] = after.corners(mesh, triangle).map(Vec3::as_dvec3);
            let normal = (b - a).cross(c - a);
            let outside = [(a, b), (b, c), (c, a)]
                .map(|(from, to)| (position - from).dot((to - from).cross(normal).normalize()).max(0.0));
            (position - a).dot(normal.normalize()).abs().max(outside[0]).max(outside[1]).max(outside[2])
        });
        // Rounding of a point to f32, which the ray offset allows for.
        let off = off.fold(f64::INFINITY, f64::min);
        assert!(off < f64::from(caster.offset_m()), "receiver {receiver} is {off} m off its chart");
        assert!(set.normal[receiver].dot(set.geometric_normal[receiver]) > 0.9);
    }
}

#[test]
fn every_bilinear_tap_of_a_chart_meets_its_own_light() {
    let after = laid_out(room(), 160);
    let map = texels::cover(&after, &Atlas::of(&after), 160);
    let set = receivers(&after, 160);
    let mut shown = vec![u32::MAX; 160 * 160];
    for (receiver, &texel) in set.texel.iter().enumerate() {
        shown[texel as usize] = receiver as u32;
    }
    assert!(set.gutters.is_sorted());
    for &(texel, receiver) in &set.gutters {
        assert_eq!(shown[texel as usize], u32::MAX, "texel {texel} is filled twice");
        shown[texel as usize] = receiver;
    }
    let charts = chart_map(&map);
    let is_own = |texel: u32, receiver: u32| {
        neighbors(texel, 160, 1).any(|near| charts[near as usize] == set.chart[receiver as usize])
    };
    let mut continued = 0;
    // A coordinate on a covered texel is filtered from it and the texels around it.
    for texel in &map.texels {
        for near in neighbors(texel.index, 160, 1) {
            let receiver = shown[near as usize];
            assert_ne!(receiver, u32::MAX);
            if set.chart[receiver as usize] != texel.chart {
                // Beyond a seam of a smooth surface: what the chart ends in is next to it. Texels are of 0.1 m and less.
                let position = after.position(texel.mesh as usize, texel.triangle as usize, texel.barycentrics);
                assert!(set.position[receiver as usize].distance(position) < 0.4, "{position}");
                continued += 1;
            }
        }
    }
    assert!(continued > 0);
    // The nearest one, for gutters of valid texels.
    let distance = |a: u32, b: u32| {
        let (dx, dy) = (a % 160, a / 160);
        (i64::from(dx) - i64::from(b % 160)).pow(2) + (i64::from(dy) - i64::from(b / 160)).pow(2)
    };
    for &(texel, receiver) in set.gutters.iter().filter(|gutter| is_own(gutter.0, gutter.1)).step_by(17) {
        let chart = set.chart[receiver as usize];
        let members = (0..set.len()).filter(|&other| set.chart[other] == chart);
        let least = members.map(|other| distance(texel, set.texel[other])).min().unwrap();
        let held = distance(texel, set.texel[receiver as usize]);
        let exact = (least as f64).sqrt() <= 3.0;
        assert!(held == least || !exact && (held as f64).sqrt() < (least as f64).sqrt() + 1.5);
    }
}

#[test]
fn seams_join_the_two_sides_of_a_smooth_surface_and_no_others() {
    let ball = sphere("ball", Vec3::new(5.0, 0.0, 0.0), 1.0, 16);
    let block = cuboid("block", Vec3::ZERO, Vec3::ONE);
    let after = laid_out(scene(vec![ball, block]), 256);
    let atlas = Atlas::of(&after);
    let on_map: f32 = atlas.corners.iter().map(|uv| (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs() / 2.0).sum();
    // The ball's surface and the block's.
    let texel_m = ((4.0 * std::f32::consts::PI + 6.0) / on_map).sqrt() / 256.0;
    let set = receivers(&after, 256);
    assert!(set.seams.len() > 100, "{} seams", set.seams.len());
    assert!(set.seams.is_sorted() && set.seams.windows(2).all(|pair| pair[0] != pair[1]));
    for &(a, b) in &set.seams {
        assert!(a < b);
        let (a, b) = (a as usize, b as usize);
        assert!(set.position[a].x > 2.0 && set.position[b].x > 2.0, "a block's edge is no seam");
        // Each within 1.5 texels of the seam's point; texels are up to sqrt 2 longer or shorter than the mean.
        let reach = 3.0 * 2f32.sqrt() * texel_m;
        assert!(set.position[a].distance(set.position[b]) < reach);
    }
    // A plane cut in two in the map: every receiver beside the cut has a partner straight across.
    let left = with_uv(plane("", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |p| Vec2::new(p.x * 0.25, p.z * 0.5));
    let right = with_uv(plane("", Vec3::X, Vec3::X, Vec3::Z, 1, 1), |p| Vec2::new(p.x * 0.25 + 0.5, p.z * 0.5));
    let set = receivers(&scene(vec![left, right]), 64);
    let across: Vec<(Vec3, Vec3)> =
        set.seams.iter().map(|&(a, b)| (set.position[a as usize], set.position[b as usize])).collect();
    assert_eq!(across.len(), 32);
    for (a, b) in across {
        // Texels of 1/16 m by 1/32 m, centers half a texel off the cut.
        assert!((b - a - Vec3::X / 16.0).length() < 1e-5, "{a} {b}");
    }
}

#[test]
fn gutters_go_on_over_seams_but_not_through_walls() {
    // A plane of two charts: 16 texels of the map to a meter, the right half turned by 90 degrees; and a wall on a half of the cut.
    let left = with_uv(plane("", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |p| Vec2::new(p.x, p.z) * 0.25);
    let right = with_uv(plane("", Vec3::X, Vec3::X, Vec3::Z, 1, 1), |p| Vec2::new(p.z, p.x - 1.0) * 0.25 + 0.5);
    let wall = with_uv(cuboid("", Vec3::new(0.999, -0.1, -0.1), Vec3::new(1.001, 1.0, 0.5)), |_| Vec2::new(0.9, 0.1));
    let set = receivers(&scene(vec![left, right, wall]), 64);
    let shown = |x: u32, y: u32| {
        let gutter = set.gutters.iter().find(|gutter| gutter.0 == y * 64 + x).expect("a gutter");
        set.position[gutter.1 as usize]
    };
    let center = |texel: u32| (texel as f32 + 0.5) / 16.0;
    for along in 0..16 {
        // Columns beyond the left half's edge, rows before the right half's.
        for beyond in 0..2 {
            let (x, own) = if along < 8 {
                (1.0 - center(0), 1.0 + center(0))
            } else {
                (1.0 + center(beyond), 1.0 - center(beyond))
            };
            assert!(shown(16 + beyond, along).distance(Vec3::new(x, 0.0, center(along))) < 1e-4, "{along} {beyond}");
            assert!(
                shown(32 + along, 31 - beyond).distance(Vec3::new(own, 0.0, center(along))) < 1e-4,
                "{along} {beyond}"
            );
        }
        // The plane's end is none.
        assert!(shown(along, 16).distance(Vec3::new(center(along), 0.0, center(15))) < 1e-4);
    }
}

#[test]
fn holes_of_alpha_masks_have_no_receivers() {
    let mut sheet = with_uv(plane("sheet", Vec3::ZERO, Vec3::X, Vec3::Z, 1, 1), |p| Vec2::new(p.x, p.z) * 0.5);
    sheet.uv_sets[0] = sheet.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect();
    let mut scene = scene(vec![sheet]);
    // Left half opaque, right half cut out.
    let rgba = vec![255, 255, 255, 255, 255, 255, 255, 0];
    scene.images.push(Image { name: "mask".into(), width: 2, height: 1, rgba, encoded: None });
    let clamp = Wrap::ClampToEdge;
    scene.textures.push(Texture { image: 0, wrap_u: clamp, wrap_v: clamp, nearest: true });
    scene.materials[0].base_color_texture =
        Some(TextureRef { texture: 0, uv_set: 0, transform: glam::Affine2::IDENTITY });
    scene.materials[0].alpha = AlphaMode::Mask { cutoff: 0.5 };
    let set = receivers(&scene, 32);
    assert_eq!((set.len(), set.invalid.len()), (8 * 16, 0));
    assert!(set.position.iter().all(|position| position.x < 0.5));
    // Holes show the light of the sheet's own texels.
    assert!(set.gutters.iter().any(|&(texel, _)| texel == 15));
}

#[test]
fn the_same_layout_and_receivers_on_any_number_of_threads() {
    let run = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let after = laid_out(room(), 128);
            let uv: Vec<Vec<Vec<Vec2>>> = after.meshes.iter().map(|mesh| mesh.uv_sets.clone()).collect();
            (uv, format!("{:?}", receivers(&after, 128)))
        })
    };
    assert!(run(1) == run(4));
}

#[test]
fn rays_along_the_axes_hit_whatever_the_sign_of_their_zeros() {
    let floor = plane("floor", Vec3::ZERO, Vec3::X * 2.0, Vec3::Z * 2.0, 1, 1);
    let wall = cuboid("wall", Vec3::new(0.49, -0.1, -1.0), Vec3::new(0.98, 2.0, 3.0));
    let scene = scene(vec![floor, wall]);
    let caster = RayCaster::new(&scene).unwrap();
    for signs in 0..4 {
        let zero = |bit: u32| if signs >> bit & 1 == 0 { 0.0 } else { -0.0 };
        let along_x = caster.closest_hit(Vec3::new(0.75, 1e-4, 0.25), Vec3::new(1.0, zero(0), zero(1)));
        assert!((along_x.unwrap().t - 0.23).abs() < 1e-6);
        let down = caster.closest_hit(Vec3::new(1.5, 0.5, 0.25), Vec3::new(zero(0), -1.0, zero(1)));
        assert!((down.unwrap().t - 0.5).abs() < 1e-6);
        assert!(!caster.visible(Vec3::new(0.75, 1e-4, 0.25), Vec3::new(1.75, 1e-4 + zero(0), 0.25)));
    }
}
