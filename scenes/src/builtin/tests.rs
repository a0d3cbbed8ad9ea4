//! What holds for every built-in scene: closed surfaces, normals that go with the winding, bounds, names, hashes.

use super::*;
use std::collections::{BTreeMap, BTreeSet};

fn bits(point: Vec3) -> [u32; 3] {
    // Plus 0 makes one zero of both.
    point.to_array().map(|value| (value + 0.0).to_bits())
}

/// Directed edges by how often they occur, less how often their opposites do: empty where everything is closed.
fn open_edges(scene: &Scene, counts: impl Fn(&crate::scene::Mesh) -> bool) -> Vec<[[f32; 3]; 2]> {
    let mut edges: BTreeMap<[[u32; 3]; 2], i32> = BTreeMap::new();
    for mesh in scene.meshes.iter().filter(|mesh| counts(mesh)) {
        for triangle in &mesh.triangles {
            let corners = triangle.map(|vertex| bits(mesh.positions[vertex as usize]));
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                let (from, to) = (corners[from], corners[to]);
                *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
            }
        }
    }
    let open = edges.into_iter().filter(|(_, count)| *count != 0);
    open.map(|(edge, _)| edge.map(|corner| corner.map(f32::from_bits))).collect()
}

/// Volume inside of the closed surfaces: positive for solids, negative for rooms.
fn signed_volume(scene: &Scene, counts: impl Fn(&crate::scene::Mesh) -> bool) -> f64 {
    let mut volume = 0.0;
    for (index, mesh) in scene.meshes.iter().enumerate().filter(|(_, mesh)| counts(mesh)) {
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] = scene.corners(index, triangle).map(|corner| corner.as_dvec3());
            volume += a.dot(b.cross(c)) / 6.0;
        }
    }
    volume
}

#[test]
fn every_name_builds_a_valid_scene() {
    assert!(scene("nowhere").is_none());
    for name in names() {
        let scene = scene(name).unwrap();
        assert_eq!(scene.name, *name);
        assert!(!scene.cameras.is_empty(), "{name}");
        let material_names: BTreeSet<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        let mesh_names: BTreeSet<&str> = scene.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
        assert_eq!((material_names.len(), mesh_names.len()), (scene.materials.len(), scene.meshes.len()), "{name}");
        let smallest = 1e-12 * f64::from(scene.extent()).powi(2);
        for (index, mesh) in scene.meshes.iter().enumerate() {
            let place = format!("{name}: {}", mesh.name);
            assert!(mesh.material < scene.materials.len() && !mesh.triangles.is_empty(), "{place}");
            assert_eq!(mesh.normals.len(), mesh.positions.len(), "{place}");
            assert!(mesh.lightmap_uv().is_none() && mesh.uv_sets.len() <= 1, "{place}");
            assert!(mesh.uv_sets.iter().all(|set| set.len() == mesh.positions.len()), "{place}");
            assert!(mesh.positions.iter().all(|position| position.is_finite()), "{place}");
            assert!(mesh.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5), "{place}");
            for (triangle, corners) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = scene.corners(index, triangle).map(|corner| corner.as_dvec3());
                assert!((b - a).cross(c - a).length() / 2.0 > smallest, "{place}: triangle {triangle} is degenerate");
                let geometric = scene.geometric_normal(index, triangle);
                // Smooth normals stay within 60 degrees of their faces.
                let agree = corners.iter().all(|&corner| mesh.normals[corner as usize].dot(geometric) > 0.5);
                assert!(agree, "{place}: normals of triangle {triangle} at {a}");
            }
        }
    }
}

#[test]
fn no_triangle_occurs_twice() {
    for name in names() {
        let scene = scene(name).unwrap();
        let mut seen = BTreeSet::new();
        for (mesh, triangle) in scene.faces() {
            let mut corners = scene.corners(mesh, triangle).map(bits);
            corners.sort_unstable();
            assert!(seen.insert(corners), "{name}: {} triangle {triangle}", scene.meshes[mesh].name);
        }
    }
}

#[test]
fn rooms_are_closed_and_face_inwards() {
    for (name, volume) in [
        ("furnace", 8.0),
        ("two-rooms", 2.0 * 2.9975 * 2.6 * 4.0),
        ("two-rooms-door", 2.0 * 2.9975 * 2.6 * 4.0 + 0.005 * 2.1),
    ] {
        let scene = scene(name).unwrap();
        assert_eq!(open_edges(&scene, |_| true), Vec::<[[f32; 3]; 2]>::new(), "{name}");
        // Coordinates below 4 are rounded to f32 by at most 2^-23, times a surface below 100 square metres.
        let found = signed_volume(&scene, |_| true);
        assert!((found + volume).abs() < 2e-5, "{name}: {found}");
    }
    let sphere = scene("sphere").unwrap();
    assert_eq!(open_edges(&sphere, |_| true), Vec::<[[f32; 3]; 2]>::new());
    // The icosphere lies within the sphere, its faces at most 0.12 % nearer.
    let share = signed_volume(&sphere, |_| true) / (-4.0 / 3.0 * std::f64::consts::PI);
    assert!((0.997..1.0).contains(&share), "{share}");
    for (mesh, triangle) in sphere.faces() {
        let [a, b, c] = sphere.corners(mesh, triangle);
        assert!(((a + b + c) / 3.0).length() > 0.9988);
    }
}

#[test]
fn two_rooms_are_each_closed_and_apart() {
    let rooms = scene("two-rooms").unwrap();
    for (side, low, high) in [("left", -3.0, -0.0025), ("right", 0.0025, 3.0)] {
        let of_room = |mesh: &crate::scene::Mesh| mesh.name.starts_with(side);
        assert!(open_edges(&rooms, of_room).is_empty());
        let xs = || rooms.meshes.iter().filter(|mesh| of_room(mesh)).flat_map(|mesh| &mesh.positions).map(|at| at.x);
        assert_eq!((xs().fold(f32::INFINITY, f32::min), xs().fold(f32::NEG_INFINITY, f32::max)), (low, high));
    }
    assert_eq!(rooms.lights.len(), 1);
    assert!(rooms.lights[0].position.x < 0.0);
    assert_eq!(scene("two-rooms:doorway").unwrap().hash, scene("two-rooms-door").unwrap().hash);
}

#[test]
fn an_open_edge_is_noticed() {
    let mut furnace = scene("furnace").unwrap();
    furnace.meshes[0].triangles.pop();
    assert_eq!(open_edges(&furnace, |_| true).len(), 3);
    let mut flipped = scene("furnace").unwrap();
    flipped.meshes[0].triangles[0].reverse();
    assert_eq!(open_edges(&flipped, |_| true).len(), 3);
}

#[test]
fn cornell_is_two_metres_and_open_to_the_front() {
    let cornell = scene("cornell").unwrap();
    assert_eq!(cornell.bounds().unwrap(), (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0)));
    let open = open_edges(&cornell, |mesh| !mesh.name.ends_with("block"));
    assert_eq!(open.len(), 4);
    assert!(open.iter().flatten().all(|corner| corner[2] == 1.0), "{open:?}");
    let blocks = open_edges(&cornell, |mesh| mesh.name.ends_with("block"));
    assert_eq!(blocks.len(), 8);
    assert!(blocks.iter().flatten().all(|corner| corner[1] == 0.0), "{blocks:?}");
    let material_at = |x: f32| {
        let wall = cornell.meshes.iter().find(|mesh| mesh.positions.iter().all(|at| at.x == x)).unwrap();
        (cornell.materials[wall.material].name.as_str(), wall.normals[0].x)
    };
    assert_eq!((material_at(-1.0), material_at(1.0)), (("red", 1.0), ("green", -1.0)));
    assert_eq!(cornell.lights[0].position, Vec3::new(0.0, 1.5, 0.0));
    // Blocks face outwards. About (0, 0, 0) the missing bottoms at y = 0 add nothing to the volume. Areas of the
    // measured plans by the shoelace formula; f32 coordinates below 1 on lengths above 0.5 are off by 2^-23 each.
    for (name, height, area) in [("short block", 165.0, 27_633.0), ("tall block", 330.0, 27_626.5)] {
        let volume = signed_volume(&cornell, |mesh| mesh.name == name) * (555.0f64 / 2.0).powi(3);
        assert!((volume / (height * area) - 1.0).abs() < 1e-6, "{name}: {volume}");
    }
}

#[test]
fn atrium_solids_are_closed_and_face_outwards() {
    let atrium = scene("atrium").unwrap();
    for mesh in &atrium.meshes {
        let sheet = atrium.materials[mesh.material].double_sided;
        let of_mesh = |other: &crate::scene::Mesh| other.name == mesh.name;
        assert_eq!(open_edges(&atrium, of_mesh).is_empty(), !sheet, "{}", mesh.name);
        assert!(sheet || signed_volume(&atrium, of_mesh) > 0.0, "{}", mesh.name);
    }
}

#[test]
fn cameras_are_rotations_with_up_upwards() {
    for name in names() {
        for camera in &scene(name).unwrap().cameras {
            assert!((camera.to_world.determinant() - 1.0).abs() < 1e-5);
            assert!(camera.to_world.y_axis.y > 0.0 && camera.to_world.transform_point3(Vec3::ZERO).is_finite());
        }
    }
}

#[test]
fn hash_follows_the_content_and_not_the_lights() {
    let hashes: BTreeSet<[u8; 32]> = names().iter().map(|name| scene(name).unwrap().hash).collect();
    assert_eq!(hashes.len(), names().len());
    let mut furnace = scene("furnace").unwrap();
    assert_eq!(content_hash(&furnace), furnace.hash);
    furnace.lights.push(point_light("lamp", Vec3::ONE, 1.0));
    assert_eq!(content_hash(&furnace), furnace.hash);
    furnace.materials[0].base_color.x = 0.25;
    assert_ne!(content_hash(&furnace), furnace.hash);
    let mut moved = scene("furnace").unwrap();
    moved.meshes[0].positions[0].x += 1e-6;
    assert_ne!(content_hash(&moved), moved.hash);
}

#[test]
fn closed_forms_of_the_furnace_agree() {
    assert_eq!(furnace_irradiance(Some(0)), 0.0);
    assert_eq!(furnace_irradiance(Some(1)), std::f64::consts::PI);
    assert_eq!(furnace_irradiance(Some(2)), 1.5 * std::f64::consts::PI);
    assert_eq!(furnace_irradiance(None), 2.0 * std::f64::consts::PI);
}

/// Distance to the nearest triangle along a ray, its mesh, and whether its front was hit.
fn first_hit(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(f64, usize, bool)> {
    let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
    let mut nearest: Option<(f64, usize, bool)> = None;
    for (mesh, triangle) in scene.faces() {
        let [a, b, c] = scene.corners(mesh, triangle).map(|corner| corner.as_dvec3());
        let (to_b, to_c, to_origin) = (b - a, c - a, origin - a);
        let normal = to_b.cross(to_c);
        let facing = -normal.dot(direction);
        if facing.abs() < 1e-12 {
            continue;
        }
        let distance = normal.dot(to_origin) / facing;
        let moment = to_origin.cross(direction);
        let (u, v) = (to_c.dot(moment) / facing, -to_b.dot(moment) / facing);
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 1e-6;
        if inside && nearest.is_none_or(|(so_far, ..)| distance < so_far) {
            nearest = Some((distance, mesh, facing > 0.0));
        }
    }
    nearest
}

#[test]
fn the_room_stands_on_the_plain_and_its_furniture_on_the_floor() {
    let scene = scene("room-on-plain").unwrap();
    assert_eq!(scene.bounds().unwrap(), (Vec3::new(-100.0, -0.1, -100.0), Vec3::new(100.0, 3.25, 100.0)));
    assert_eq!((scene.face_count(), scene.meshes.len()), (5378, 26), "as the README says");
    let house = ["facade", "roof", "reveals", "walls", "clay wall", "ceiling", "floor"];
    let open = open_edges(&scene, |mesh| house.contains(&mesh.name.as_str()));
    assert!(!open.is_empty() && open.iter().flatten().all(|corner| corner[1] == -0.1), "{open:?}");
    for mesh in scene.meshes.iter().filter(|mesh| mesh.name != "plain" && !house.contains(&mesh.name.as_str())) {
        let open = open_edges(&scene, |other| other.name == mesh.name);
        let on_plane = |axis: usize, at: f32| move |edge: &[[f32; 3]; 2]| edge.iter().all(|corner| corner[axis] == at);
        let touches: Vec<(usize, f32)> = match mesh.name.as_str() {
            "window 1" => vec![(1, 0.8), (1, 2.4), (2, -3.2), (2, -1.2)],
            "window 2" => vec![(1, 0.8), (1, 2.4), (2, 0.6), (2, 2.6)],
            "window 3" => vec![(1, 0.8), (1, 2.4), (0, 0.9), (0, 2.7)],
            "beams" => vec![(1, 3.0), (0, -4.0), (0, 4.0)],
            "jar" => vec![(1, 0.76)],
            // On the boards of the shelf.
            name if name.starts_with("books") || name == "cartons" => open.iter().map(|edge| (1, edge[0][1])).collect(),
            _ => vec![(1, 0.0)],
        };
        assert!(!open.is_empty(), "{}", mesh.name);
        let touching = |edge: &[[f32; 3]; 2]| touches.iter().any(|(axis, at)| on_plane(*axis, *at)(edge));
        assert!(open.iter().all(touching), "{}: {open:?}", mesh.name);
    }
    for color in scene.materials.iter().map(|material| material.base_color.truncate()) {
        assert!(color.min_element() >= 0.2 && color.max_element() <= 0.8, "{color}");
    }
}

#[test]
fn the_room_shows_no_back_of_a_face() {
    let scene = scene("room-on-plain").unwrap();
    let eye = scene.cameras[0].to_world.transform_point3(Vec3::ZERO);
    assert!(eye.y == 1.6 && eye.x.abs() < 4.0 && eye.z.abs() < 5.0, "{eye}");
    // At the camera, under the table, under a chair, before the shelf, behind the sideboard, outside.
    let places = [
        eye,
        Vec3::new(0.9, 0.3, -0.4),
        Vec3::new(0.2, 0.2, -1.15),
        Vec3::new(-2.3, 1.0, -4.5),
        Vec3::new(-3.98, 0.4, 0.1),
        Vec3::new(-9.0, 2.0, 12.0),
        Vec3::new(11.0, 6.0, -9.0),
    ];
    const N_RAYS: usize = 2000;
    let mut seen = BTreeSet::new();
    for place in places {
        for index in 0..N_RAYS {
            // A spherical Fibonacci set.
            let height = 1.0 - (2 * index + 1) as f32 / N_RAYS as f32;
            let (sin, cos) = shapes::sin_cos(index as f32 * 2.399_963);
            let ring = (1.0 - height * height).sqrt();
            let hit = first_hit(&scene, place, Vec3::new(ring * cos, height, ring * sin));
            let name = hit.map(|(_, mesh, _)| scene.meshes[mesh].name.as_str());
            assert!(hit.is_none_or(|(.., front)| front), "the back of {name:?} from {place} by ray {index}");
            seen.extend(name);
        }
    }
    assert_eq!(seen.len(), scene.meshes.len(), "{seen:?}");
    // The sun comes through the window on the table and on the floor.
    let sun = scene.lights[0].direction;
    for place in [Vec3::new(0.7, 0.77, -1.2), Vec3::new(1.3, 0.77, -1.4), Vec3::new(0.0, 0.01, 2.6)] {
        assert_eq!(first_hit(&scene, place, -sun), None, "{place}");
    }
}

#[test]
fn solids_behind_the_blinds_are_closed_and_run_through_each_other() {
    let scene = scene("blinds").unwrap();
    assert_eq!((scene.face_count(), scene.meshes.len()), (1238, 15), "as the README says");
    for mesh in &scene.meshes {
        let of_mesh = |other: &crate::scene::Mesh| other.name == mesh.name;
        let sheet = scene.materials[mesh.material].double_sided;
        assert_eq!(open_edges(&scene, of_mesh).is_empty(), !sheet, "{}", mesh.name);
        assert!(sheet || signed_volume(&scene, of_mesh) > 0.0, "{}", mesh.name);
    }
    let bounds = |name: &str| {
        let mesh = scene.meshes.iter().find(|mesh| mesh.name == name).unwrap();
        let at = || mesh.positions.iter().copied();
        (at().reduce(Vec3::min).unwrap(), at().reduce(Vec3::max).unwrap())
    };
    let (floor, ceiling) = (bounds("floor"), bounds("ceiling"));
    assert!(floor.0.cmple(Vec3::new(-3.25, -0.1, -2.75)).all() && floor.1.cmpge(Vec3::new(6.0, 0.0, 2.75)).all());
    for name in ["wall -x", "wall +x", "wall -z", "wall +z", "columns"] {
        let (low, high) = bounds(name);
        assert!(low.y < floor.0.y && high.y > ceiling.1.y, "{name} runs through floor and ceiling");
    }
    let slats = bounds("slats");
    assert!(slats.0.z < -1.5 && slats.1.z > 1.5 && slats.0.x > 3.0 && slats.1.x < 3.25, "{slats:?}");
    for color in scene.materials.iter().map(|material| material.base_color.truncate()) {
        assert!(color.min_element() >= 0.2 && color.max_element() <= 0.8, "{color}");
    }
}

#[test]
fn the_room_behind_blinds_shows_no_back_of_a_solid() {
    let scene = scene("blinds").unwrap();
    let eyes = scene.cameras.iter().map(|camera| camera.to_world.transform_point3(Vec3::ZERO));
    // Under the table, before the sideboard, behind the partition, between screen and wall, on the terrace.
    let places = [(0.7, 0.4, -0.3), (1.0, 0.05, -1.9), (-2.0, 1.2, 0.4), (2.3, 0.5, 1.8), (5.5, 1.5, 2.0)];
    const N_RAYS: usize = 2000;
    for place in eyes.chain(places.map(Vec3::from)) {
        for index in 0..N_RAYS {
            // A spherical Fibonacci set.
            let height = 1.0 - (2 * index + 1) as f32 / N_RAYS as f32;
            let (sin, cos) = shapes::sin_cos(index as f32 * 2.399_963);
            let ring = (1.0 - height * height).sqrt();
            let Some((_, mesh, front)) = first_hit(&scene, place, Vec3::new(ring * cos, height, ring * sin)) else {
                continue;
            };
            let name = &scene.meshes[mesh].name;
            assert!(front || name == "screen", "the back of {name} from {place} by ray {index}");
        }
    }
}

#[test]
fn a_part_of_the_sun_comes_between_the_slats() {
    let scene = scene("blinds").unwrap();
    let sun = scene.lights[0].direction;
    // 3.2 m and 1.5 m from the window, the height of some slats.
    let lit = |x: f32, middle: f32| {
        let lit = |step: &usize| {
            let place = Vec3::new(x, middle + *step as f32 / 1000.0, -0.3);
            first_hit(&scene, place, -sun).is_none()
        };
        (0..290).filter(lit).count() as f32 / 290.0
    };
    // The outline of a slat of 50 by 3 mm, tilted by 8 degrees, in light that falls 0.5 on 0.8; over the pitch.
    let fall = 0.5f32.atan2(0.8);
    let (sin, cos) = (fall + 8.0f32.to_radians()).sin_cos();
    let share = 1.0 - (0.05 * sin + 0.003 * cos) / (1.45 / 26.0 * fall.cos());
    for found in [lit(1.6, 0.8), lit(1.7, 1.0)] {
        assert!((found - share).abs() < 0.02, "{found} of {share}");
    }
}
