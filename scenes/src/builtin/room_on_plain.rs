//! A furnished room on a wide plain: 8 x 3 x 10 m of detail, down to legs of 4 cm, in a scene of 200 x 200 m.
//!
//! Walls, floor slab and roof are one solid with thickness, open only where it stands on the plain; so is every piece of
//! furniture where it stands. What hangs or is fitted in lacks the faces with which it touches. Nothing coincides, and
//! nothing reaches into anything else.
//!
//! The scene has a sun, and no sky as no scene has one. With both, as a lighting file:
//!
//! ```json
//! {
//!   "lights": [{"type": "directional", "direction": [-0.9, -0.38, 0.22], "color": [1, 0.95, 0.85], "intensity": 20}],
//!   "sky": {"type": "gradient", "zenith": [0.35, 0.55, 1], "horizon": [0.8, 0.85, 0.9], "ground": [0.2, 0.2, 0.2]}
//! }
//! ```

use super::shapes::{Shape, noise, sin_cos};
use super::{camera, matte, sun};
use crate::scene::{Material, Mesh, Scene};
use glam::{Vec2, Vec3};

/// Half of the plain's sides.
const PLAIN: f32 = 100.0;
/// Height of the plain; the room's floor is at 0.
const GROUND: f32 = -0.1;
/// Room within the walls, and the outside.
const INSIDE: [Vec3; 2] = [Vec3::new(-4.0, 0.0, -5.0), Vec3::new(4.0, 3.0, 5.0)];
const OUTSIDE: [Vec3; 2] = [Vec3::new(-4.25, GROUND, -5.25), Vec3::new(4.25, 3.25, 5.25)];
const SILL: f32 = 0.8;
const WINDOW_HEAD: f32 = 2.4;
const DOOR: [Vec3; 2] = [Vec3::new(-4.25, 0.0, -3.3), Vec3::new(-4.0, 2.1, -2.3)];
/// Windows toward +X by their ends along z, and the one toward -Z along x.
const SUNNY_WINDOWS: [[f32; 2]; 2] = [[-3.2, -1.2], [0.6, 2.6]];
const FAR_WINDOW: [f32; 2] = [0.9, 2.7];
/// Width and depth of the bars in the windows.
const BAR: f32 = 0.05;
/// Thickness of the legs of chairs.
const LEG: f32 = 0.04;
const TABLE_TOP: f32 = 0.76;

const GRASS: usize = 0;
const RENDER: usize = 1;
const PLASTER: usize = 2;
const CLAY: usize = 3;
const BOARDS: usize = 4;
const OAK: usize = 5;
const WALNUT: usize = 6;
const PAINT: usize = 7;
const CERAMIC: usize = 8;
const CARDBOARD: usize = 9;
const BOOKS: [usize; 3] = [10, 11, 12];

pub(super) fn build() -> Scene {
    let mut meshes = vec![plain()];
    meshes.extend(house());
    meshes.extend(windows());
    meshes.push(beams());
    meshes.push(table());
    // Where a chair stands, and where it looks: degrees from +Z toward +X.
    let chairs = [
        (0.2, -1.15, 93.0),
        (0.17, 0.3, 86.0),
        (1.6, -1.1, -88.0),
        (1.72, 0.32, -101.0),
        (0.85, -2.0, 4.0),
        (1.05, 1.3, 162.0),
    ];
    for (index, (x, z, degrees)) in chairs.into_iter().enumerate() {
        meshes.push(placed(chair(&format!("chair {}", index + 1)), Vec3::new(x, 0.0, z), degrees));
    }
    meshes.extend(shelf());
    meshes.push(sideboard());
    meshes.push(jar());
    Scene {
        meshes,
        materials: materials(),
        // Through the windows toward +X, over the table.
        lights: vec![sun(Vec3::new(-0.9, -0.38, 0.22))],
        cameras: vec![camera("room", Vec3::new(-2.7, 1.6, 3.9), Vec3::new(0.75, 0.95, -1.4), 56.0)],
        ..Scene::default()
    }
}

fn materials() -> Vec<Material> {
    vec![
        matte("grass", [0.24, 0.3, 0.2]),
        matte("render", [0.6, 0.57, 0.5]),
        matte("plaster", [0.76, 0.74, 0.7]),
        matte("clay", [0.6, 0.28, 0.2]),
        matte("boards", [0.48, 0.34, 0.23]),
        matte("oak", [0.56, 0.42, 0.27]),
        matte("walnut", [0.3, 0.23, 0.2]),
        matte("paint", [0.8, 0.8, 0.78]),
        matte("ceramic", [0.25, 0.42, 0.52]),
        matte("cardboard", [0.5, 0.4, 0.29]),
        matte("linen red", [0.5, 0.21, 0.2]),
        matte("linen blue", [0.2, 0.27, 0.48]),
        matte("linen cream", [0.7, 0.65, 0.52]),
    ]
}

fn plain() -> Mesh {
    let mut shape = Shape::default();
    let corner = |x: f32, z: f32| Vec3::new(x * PLAIN, GROUND, z * PLAIN);
    shape.quad([corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]);
    shape.into_mesh("plain", GRASS, None)
}

/// The solid around the room, by what its faces are.
fn house() -> Vec<Mesh> {
    let holes = [
        INSIDE,
        DOOR,
        [Vec3::new(4.0, SILL, SUNNY_WINDOWS[0][0]), Vec3::new(4.25, WINDOW_HEAD, SUNNY_WINDOWS[0][1])],
        [Vec3::new(4.0, SILL, SUNNY_WINDOWS[1][0]), Vec3::new(4.25, WINDOW_HEAD, SUNNY_WINDOWS[1][1])],
        [Vec3::new(FAR_WINDOW[0], SILL, -5.25), Vec3::new(FAR_WINDOW[1], WINDOW_HEAD, -5.0)],
    ];
    let part = |middle: Vec3, normal: Vec3| {
        let within = |[low, high]: [Vec3; 2]| low.cmple(middle).all() && middle.cmple(high).all();
        match () {
            () if middle.y == GROUND => None,
            () if middle.y > INSIDE[1].y => Some("roof"),
            () if within(INSIDE) && normal == Vec3::Y => Some("floor"),
            () if within(INSIDE) && normal == Vec3::NEG_Y => Some("ceiling"),
            () if within(INSIDE) && middle.z == INSIDE[0].z => Some("clay wall"),
            () if within(INSIDE) => Some("walls"),
            () if within([OUTSIDE[0] + 0.01, OUTSIDE[1] - 0.01]) => Some("reveals"),
            () => Some("facade"),
        }
    };
    let parts = [
        ("facade", RENDER),
        ("roof", CLAY),
        ("reveals", PLASTER),
        ("walls", PLASTER),
        ("clay wall", CLAY),
        ("ceiling", PAINT),
        ("floor", BOARDS),
    ];
    let mesh = |(name, material)| {
        let mut shape = Shape::default();
        shape.solid(&[OUTSIDE], &holes, |middle, normal| part(middle, normal) == Some(name));
        shape.into_mesh(name, material, None)
    };
    parts.map(mesh).into()
}

/// A lattice of bars in the middle of the wall in each window, without the faces toward the reveals.
fn windows() -> Vec<Mesh> {
    let lattice = |name: &str, ends: [f32; 2], panes: usize, place: &dyn Fn(f32, f32, f32) -> Vec3| {
        let block = |low: Vec3, high: Vec3| [low.min(high), low.max(high)];
        let [us, ys] = [pane_ends(ends, panes), pane_ends([SILL, WINDOW_HEAD], 2)];
        let mut holes = Vec::new();
        for u in &us {
            for y in &ys {
                holes.push(block(place(u[0], y[0], 0.0), place(u[1], y[1], BAR)));
            }
        }
        let whole = block(place(ends[0], SILL, 0.0), place(ends[1], WINDOW_HEAD, BAR));
        let mut shape = Shape::default();
        shape.solid(&[whole], &holes, |middle, normal| {
            // Only on the reveals are faces both on the side of the whole and turned along the wall.
            let depth_dir = place(0.0, 0.0, 1.0) - place(0.0, 0.0, 0.0);
            let on_side = (middle.cmpeq(whole[0]) | middle.cmpeq(whole[1])) & normal.abs().cmpgt(Vec3::splat(0.5));
            normal.dot(depth_dir) != 0.0 || !on_side.any()
        });
        shape.into_mesh(name, PAINT, None)
    };
    let sunny = |u: f32, y: f32, depth: f32| Vec3::new(4.1 + depth, y, u);
    let far = |u: f32, y: f32, depth: f32| Vec3::new(u, y, -5.1 - depth);
    vec![
        lattice("window 1", SUNNY_WINDOWS[0], 3, &sunny),
        lattice("window 2", SUNNY_WINDOWS[1], 3, &sunny),
        lattice("window 3", FAR_WINDOW, 3, &far),
    ]
}

/// Ends of equal panes between bars.
fn pane_ends(ends: [f32; 2], panes: usize) -> Vec<[f32; 2]> {
    let pitch = (ends[1] - ends[0] - BAR) / panes as f32;
    (0..panes).map(|pane| [ends[0] + pane as f32 * pitch + BAR, ends[0] + (pane + 1) as f32 * pitch]).collect()
}

/// Below the ceiling from wall to wall, without the faces that touch them.
fn beams() -> Mesh {
    let mut shape = Shape::default();
    for z in [-3.75, -1.25, 1.25, 3.75] {
        let low = Vec3::new(INSIDE[0].x, INSIDE[1].y - 0.18, z - 0.07);
        let high = Vec3::new(INSIDE[1].x, INSIDE[1].y, z + 0.07);
        shape.solid(&[[low, high]], &[], |_, normal| normal.y <= 0.0 && normal.x == 0.0);
    }
    shape.into_mesh("beams", WALNUT, None)
}

/// Four legs, the rails between them and the top, 1.1 x 2.6 m.
fn table() -> Mesh {
    let (middle, half, leg) = (Vec2::new(0.9, -0.4), Vec2::new(0.55, 1.3), 0.07);
    // Outer sides of legs and rails.
    let frame = half - 0.06;
    let at = |x: f32, y: f32, z: f32| Vec3::new(middle.x + x, y, middle.y + z);
    let under = TABLE_TOP - 0.035;
    let mut boxes = vec![[at(-half.x, under, -half.y), at(half.x, TABLE_TOP, half.y)]];
    for (x, z) in corners() {
        boxes.push(between(at(x * frame.x, 0.0, z * frame.y), at(x * (frame.x - leg), under, z * (frame.y - leg))));
    }
    for side in [-1.0, 1.0] {
        let rail = |[x, z]: [f32; 2], [to_x, to_z]: [f32; 2]| between(at(x, under - 0.09, z), at(to_x, under, to_z));
        boxes.push(rail([side * frame.x, -frame.y], [side * (frame.x - 0.025), frame.y]));
        boxes.push(rail([-frame.x, side * frame.y], [frame.x, side * (frame.y - 0.025)]));
    }
    standing("table", OAK, &boxes, &[])
}

/// Stands on the origin and looks toward +Z.
fn chair(name: &str) -> Mesh {
    let (half, seat, top) = (0.22, 0.46, 0.95);
    let mut boxes = vec![[Vec3::new(-half, seat - 0.03, -half), Vec3::new(half, seat, half)]];
    for (x, z) in corners() {
        let height = if z < 0.0 { top } else { seat };
        let inner = Vec3::new(x * (half - LEG), height, z * (half - LEG));
        boxes.push(between(Vec3::new(x * half, 0.0, z * half), inner));
    }
    for low in [0.6, 0.72, 0.84] {
        boxes.push([Vec3::new(-half, low, -half), Vec3::new(half, low + 0.06, LEG / 2.0 - half)]);
    }
    standing(name, WALNUT, &boxes, &[])
}

/// A shelf with a back, a little off the wall, and what stands in it.
fn shelf() -> Vec<Mesh> {
    let (low, high) = (Vec3::new(-3.4, 0.0, -4.97), Vec3::new(-1.2, 2.16, -4.62));
    let (board, rows, columns) = (0.025, 5, 2);
    let pitch = Vec2::new((high.x - low.x - board) / columns as f32, (high.y - low.y - board - 0.06) / rows as f32);
    // The lower left corner of a compartment in front of the back, and the opposite one.
    let compartment = |row: usize, column: usize| {
        let corner = Vec3::new(low.x + board, low.y + board + 0.06, low.z + 0.015);
        let corner = corner + Vec3::new(column as f32 * pitch.x, row as f32 * pitch.y, 0.0);
        [corner, Vec3::new(corner.x + pitch.x - board, corner.y + pitch.y - board, high.z)]
    };
    let holes: Vec<[Vec3; 2]> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(r, c)| compartment(r, c))
        .collect();
    let mut meshes = vec![standing("shelf", OAK, &[[low, high]], &holes)];

    let mut books = BOOKS.map(|_| Shape::default());
    for (row, column) in [(1, 0), (2, 0), (2, 1), (3, 1), (4, 0)] {
        let [foot, end] = compartment(row, column);
        let mut x = foot.x + 0.02;
        for index in 0.. {
            let random = |channel: u32| noise(((row * columns + column) as u32 * 64 + index) * 4 + channel);
            let size = Vec3::new(0.02 + 0.035 * random(0), 0.2 + 0.13 * random(1), 0.15 + 0.08 * random(2));
            if x + size.x > end.x - 0.25 * random(3) {
                break;
            }
            let back = foot.z + 0.03;
            let book = [Vec3::new(x, foot.y, back), Vec3::new(x + size.x, foot.y + size.y, back + size.z)];
            books[(random(3) * 3.0) as usize % 3].solid(&[book], &[], |_, normal| normal.y >= 0.0);
            x += size.x + 0.004;
        }
    }
    for ((shape, material), color) in books.into_iter().zip(BOOKS).zip(["red", "blue", "cream"]) {
        meshes.push(shape.into_mesh(&format!("books {color}"), material, None));
    }

    let mut cartons = Shape::default();
    for (row, column, along, size) in [
        (0, 0, 0.1, Vec3::new(0.4, 0.26, 0.26)),
        (0, 1, 0.3, Vec3::new(0.5, 0.3, 0.28)),
        (1, 1, 0.08, Vec3::new(0.34, 0.2, 0.25)),
        (3, 0, 0.4, Vec3::new(0.45, 0.24, 0.27)),
    ] {
        let foot = compartment(row, column)[0] + Vec3::new(along, 0.0, 0.03);
        cartons.solid(&[[foot, foot + size]], &[], |_, normal| normal.y >= 0.0);
    }
    meshes.push(cartons.into_mesh("cartons", CARDBOARD, None));
    meshes
}

/// A cupboard on four feet along the wall with the door.
fn sideboard() -> Mesh {
    let (low, high, foot, under) = (Vec3::new(-3.96, 0.0, -0.9), Vec3::new(-3.5, 0.82, 0.9), 0.05, 0.14);
    let mut boxes = vec![[Vec3::new(low.x, under, low.z), high]];
    for (x, z) in corners() {
        let corner = Vec3::new(if x < 0.0 { low.x } else { high.x }, 0.0, if z < 0.0 { low.z } else { high.z });
        boxes.push(between(corner, corner + Vec3::new(-x * foot, under, -z * foot)));
    }
    standing("sideboard", PAINT, &boxes, &[])
}

/// A jar with a lid on the table, without a bottom.
fn jar() -> Mesh {
    let profile = [
        (0.07, 0.0),
        (0.1, 0.05),
        (0.115, 0.11),
        (0.11, 0.17),
        (0.085, 0.22),
        (0.06, 0.25),
        (0.06, 0.28),
        (0.075, 0.285),
        (0.075, 0.3),
        (0.03, 0.32),
        (0.0, 0.325),
    ];
    let mut shape = Shape::default();
    shape.lathe(Vec3::new(1.0, TABLE_TOP, -0.9), &profile.map(|(radius, y)| Vec2::new(radius, y)), 32);
    shape.into_mesh("jar", CERAMIC, None)
}

/// A solid without the faces that stand on the floor.
fn standing(name: &str, material: usize, boxes: &[[Vec3; 2]], holes: &[[Vec3; 2]]) -> Mesh {
    let mut shape = Shape::default();
    shape.solid(boxes, holes, |middle, _| middle.y > 0.0);
    shape.into_mesh(name, material, None)
}

/// Turned about +Y, from +Z toward +X, and moved.
fn placed(mut mesh: Mesh, to: Vec3, degrees: f32) -> Mesh {
    let (sin, cos) = sin_cos(degrees.to_radians());
    let turned = |at: Vec3| Vec3::new(at.x * cos + at.z * sin, at.y, at.z * cos - at.x * sin);
    for position in &mut mesh.positions {
        *position = turned(*position) + to;
    }
    for normal in &mut mesh.normals {
        *normal = turned(*normal);
    }
    mesh
}

/// Signs of x and z.
fn corners() -> [(f32, f32); 4] {
    [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
}

/// The box between opposite corners.
fn between(a: Vec3, b: Vec3) -> [Vec3; 2] {
    [a.min(b), a.max(b)]
}
