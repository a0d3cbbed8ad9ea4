//! Walls, floors, arcades, columns and balustrades.

use super::super::shapes::{Shape, Wall, arches};
use super::{BAY, EMBED, FLOOR, LEVELS, LINE, PAVING, STONE, WALL};
use crate::scene::Mesh;
use glam::{Vec2, Vec3};

/// Outer and inner faces of the outer walls.
const WALL_OUTER: Vec2 = Vec2::new(12.0, 7.2);
const WALL_INNER: Vec2 = Vec2::new(11.6, 6.8);
/// How far slabs reach into the walls.
const SLAB_OUTER: Vec2 = Vec2::new(11.8, 7.0);
/// Edge of the gallery and roof slabs over the court.
pub(super) const SLAB_INNER: Vec2 = Vec2::new(8.05, 3.25);
const SLAB_THICKNESS: [f32; 2] = [0.4, 0.3];
/// Height of the springing of the arches above their floors.
const SPRINGING: [f32; 2] = [4.0, 2.9];
const ARCH_RADIUS: f32 = 1.0;
const HALF_ARCADE: f32 = 0.2;
const BALUSTER_SEGMENTS: usize = 10;
/// Upper side of the handrail above the gallery.
pub(super) const RAIL_HEIGHT: f32 = 0.97;

/// How finely the parts are made.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Detail {
    /// Of a court that one stands in.
    Fine,
    /// Of one among many: round parts have few sides, and plain slabs stand for small parts.
    Coarse,
}

impl Detail {
    fn arch_segments(self) -> usize {
        if self == Self::Fine { 20 } else { 6 }
    }

    fn column_segments(self) -> usize {
        if self == Self::Fine { 24 } else { 8 }
    }
}

pub(super) fn build(detail: Detail) -> Vec<Mesh> {
    vec![
        floor().into_mesh("floor", FLOOR, Some(1.6)),
        paving(detail).into_mesh("paving", PAVING, None),
        outer_walls().into_mesh("outer walls", WALL, Some(2.0)),
        slabs().into_mesh("slabs", STONE, None),
        pilasters().into_mesh("pilasters", STONE, None),
        arcades(detail).into_mesh("arcades", WALL, Some(2.0)),
        columns(detail).into_mesh("columns", STONE, None),
        balustrades(detail).into_mesh("balustrades", STONE, None),
    ]
}

fn floor() -> Shape {
    let mut shape = Shape::default();
    shape.block(Vec3::new(-SLAB_OUTER.x, -0.25, -SLAB_OUTER.y), Vec3::new(SLAB_OUTER.x, LEVELS[0], SLAB_OUTER.y));
    // The gallery's tiles lie on its slab as a thin plate of their own.
    let top = LEVELS[1];
    shape.frame(WALL_INNER + 0.1, Vec2::new(LINE[0] + 0.3, LINE[1] + 0.3), [top - EMBED, top + 0.02]);
    shape
}

/// A kerb and slabs in the court, with joints.
fn paving(detail: Detail) -> Shape {
    let mut shape = Shape::default();
    let (half, joint) = (Vec2::new(7.5, 2.7), 0.012);
    let (columns, rows) = if detail == Detail::Fine { (25, 9) } else { (1, 1) };
    let size = 2.0 * half / Vec2::new(columns as f32, rows as f32);
    for row in 0..rows {
        for column in 0..columns {
            let low = -half + size * Vec2::new(column as f32, row as f32) + joint;
            let high = low + size - 2.0 * joint;
            let rise = 0.03 + 0.012 * super::noise(row * columns + column);
            shape.block(Vec3::new(low.x, -EMBED, low.y), Vec3::new(high.x, rise, high.y));
        }
    }
    shape.frame(half + 0.18, half, [-EMBED, 0.07]);
    shape
}

fn outer_walls() -> Shape {
    let mut shape = Shape::default();
    shape.frame(WALL_OUTER, WALL_INNER, [-0.3, 12.0]);
    shape
}

fn slabs() -> Shape {
    let mut shape = Shape::default();
    for (level, thickness) in LEVELS[1..].iter().zip(SLAB_THICKNESS) {
        shape.frame(SLAB_OUTER, SLAB_INNER, [level - thickness, *level]);
    }
    // A molding below each slab's edge, and the roof's inner parapet.
    let line = Vec2::from_array(LINE);
    shape.frame(line, line - 0.28, [LEVELS[1] - 0.52, LEVELS[1] - 0.38]);
    shape.frame(line, line - 0.28, [LEVELS[2] - 0.42, LEVELS[2] - 0.28]);
    shape.frame(line + 0.1, line - 0.15, [LEVELS[2] - EMBED, LEVELS[2] + 0.55]);
    shape.frame(line + 0.16, line - 0.22, [LEVELS[2] + 0.53, LEVELS[2] + 0.65]);
    shape
}

/// Flat piers on the outer walls behind every column, on both floors.
fn pilasters() -> Shape {
    let mut shape = Shape::default();
    for (story, springing) in SPRINGING.iter().enumerate() {
        let foot = LEVELS[story];
        let top = LEVELS[story + 1] - SLAB_THICKNESS[story] + EMBED;
        let mut pilaster = |at: Vec2, size: Vec2| {
            let foot = Vec3::new(at.x, foot - EMBED, at.y);
            shape.block_at(foot, Vec3::new(size.x, top - foot.y, size.y));
            shape.block_at(foot, Vec3::new(size.x + 0.1, 0.3, size.y + 0.1));
            shape.block_at(foot + Vec3::Y * (springing - 0.1), Vec3::new(size.x + 0.1, 0.22, size.y + 0.1));
        };
        for side in [-1.0, 1.0] {
            for x in stations(LINE[0]) {
                pilaster(Vec2::new(x, side * WALL_INNER.y), Vec2::new(0.45, 0.36));
            }
            for z in stations(LINE[1]) {
                pilaster(Vec2::new(side * WALL_INNER.x, z), Vec2::new(0.36, 0.45));
            }
        }
    }
    shape
}

/// Walls on arches around the court, on both floors, and the piers at their corners.
fn arcades(detail: Detail) -> Shape {
    let mut shape = Shape::default();
    for (story, springing) in SPRINGING.iter().enumerate() {
        let top = LEVELS[story + 1] - SLAB_THICKNESS[story] - LEVELS[story] + EMBED;
        for (along_z, half_length, offset) in [(false, LINE[0], LINE[1]), (true, LINE[1], LINE[0])] {
            let bays = (2.0 * half_length / BAY).round() as usize;
            let lower_edge = arches(half_length, bays, ARCH_RADIUS, *springing, detail.arch_segments());
            for side in [-offset, offset] {
                let origin = if along_z { Vec3::new(side, 0.0, 0.0) } else { Vec3::new(0.0, 0.0, side) };
                let origin = origin + Vec3::Y * LEVELS[story];
                let half_thickness = HALF_ARCADE;
                shape.wall(&Wall { origin, along_z, half_thickness, lower_edge: &lower_edge, top });
            }
        }
    }
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let foot = Vec3::new(x * LINE[0], -EMBED, z * LINE[1]);
        shape.block_at(foot, Vec3::new(0.7, LEVELS[2] - SLAB_THICKNESS[1] + 2.0 * EMBED, 0.7));
        shape.block_at(foot, Vec3::new(0.84, 0.35, 0.84));
    }
    shape
}

fn columns(detail: Detail) -> Shape {
    let mut shape = Shape::default();
    for (story, springing) in SPRINGING.iter().enumerate() {
        // The upper order is more slender.
        let width = if story == 0 { 1.0 } else { 0.88 };
        for at in column_places() {
            let foot = Vec3::new(at.x, LEVELS[story], at.y);
            let (plinth, abacus) = (0.14, springing - 0.26);
            shape.block_at(foot - Vec3::Y * EMBED, Vec3::new(0.56 * width, plinth + EMBED, 0.56 * width));
            let profile = match detail {
                Detail::Fine => column_profile(abacus - plinth + 2.0 * EMBED, width),
                Detail::Coarse => coarse_profile(abacus - plinth + 2.0 * EMBED, width),
            };
            shape.lathe(foot + Vec3::Y * (plinth - EMBED), &profile, detail.column_segments());
            shape.block_at(foot + Vec3::Y * abacus, Vec3::new(0.5, 0.16, 0.5));
            shape.block_at(foot + Vec3::Y * (abacus + 0.16 - EMBED / 2.0), Vec3::new(0.56, 0.1 + 1.5 * EMBED, 0.56));
        }
    }
    shape
}

/// Base, shaft with entasis, necking ring and bell, between heights 0 and `height`.
fn column_profile(height: f32, width: f32) -> Vec<Vec2> {
    let mut profile = vec![Vec2::ZERO];
    let torus = |profile: &mut Vec<Vec2>, radius: f32, low: f32, thickness: f32| {
        for step in 0..=4 {
            let (sin, cos) = (std::f64::consts::PI * (f64::from(step) / 4.0 - 0.5)).sin_cos();
            let half = thickness / 2.0;
            profile.push(Vec2::new(radius + half * cos as f32, low + half + half * sin as f32));
        }
    };
    torus(&mut profile, 0.2, 0.0, 0.11);
    torus(&mut profile, 0.195, 0.13, 0.06);
    let (shaft_low, shaft_high) = (0.22, height - 0.42);
    for step in 0..=5 {
        let along = step as f32 / 5.0;
        profile.push(Vec2::new(0.2 - 0.035 * along * along, shaft_low + (shaft_high - shaft_low) * along));
    }
    torus(&mut profile, 0.165, height - 0.4, 0.06);
    for (radius, below) in [(0.17, 0.3), (0.185, 0.18), (0.215, 0.08), (0.235, 0.0)] {
        profile.push(Vec2::new(radius, height - below));
    }
    profile.push(Vec2::new(0.0, height));
    profile.into_iter().map(|point| Vec2::new(point.x * width, point.y)).collect()
}

/// The same without entasis and with its rings as steps.
fn coarse_profile(height: f32, width: f32) -> Vec<Vec2> {
    let outline =
        [(0.0, 0.0), (0.24, 0.0), (0.24, 0.18), (0.2, 0.22), (0.165, height - 0.4), (0.235, height), (0.0, height)];
    outline.map(|(radius, at)| Vec2::new(radius * width, at)).to_vec()
}

fn balustrades(detail: Detail) -> Shape {
    let mut shape = Shape::default();
    let gallery = LEVELS[1];
    for (axis, side) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
        let place = |along: f32, height: f32| match axis {
            0 => Vec3::new(along, gallery + height, side * LINE[1]),
            _ => Vec3::new(side * LINE[0], gallery + height, along),
        };
        let half_length = LINE[axis];
        let size = |width: f32, height: f32| match axis {
            0 => Vec3::new(2.0 * half_length, height, width),
            _ => Vec3::new(width, height, 2.0 * half_length),
        };
        shape.block_at(place(0.0, -EMBED), size(0.2, 0.12));
        shape.block_at(place(0.0, RAIL_HEIGHT - 0.12), size(0.22, 0.12));
        if detail == Detail::Coarse {
            shape.block_at(place(0.0, 0.1 - EMBED), size(0.1, RAIL_HEIGHT - 0.12 - 0.1 + 2.0 * EMBED));
            continue;
        }
        let profile = baluster_profile(RAIL_HEIGHT - 0.12 - 0.1 + 2.0 * EMBED);
        let spacing = BAY / 8.0;
        let count = (2.0 * half_length / spacing).round() as usize;
        // Every eighth place is a column's.
        for index in (1..count).filter(|index| index % 8 != 0) {
            let along = -half_length + index as f32 * spacing;
            shape.lathe(place(along, 0.1 - EMBED), &profile, BALUSTER_SEGMENTS);
        }
    }
    shape
}

fn baluster_profile(height: f32) -> Vec<Vec2> {
    let outline = [
        (0.0, 0.0),
        (0.065, 0.0),
        (0.065, 0.08),
        (0.04, 0.12),
        (0.075, 0.26),
        (0.07, 0.38),
        (0.04, 0.6),
        (0.035, 0.78),
        (0.06, 0.86),
        (0.06, 1.0),
        (0.0, 1.0),
    ];
    outline.map(|(radius, share)| Vec2::new(radius, share * height)).to_vec()
}

/// Places along a side from one corner to the other, a bay apart, without the corners.
fn stations(half_length: f32) -> impl Iterator<Item = f32> {
    let bays = (2.0 * half_length / BAY).round() as usize;
    (1..bays).map(move |index| -half_length + index as f32 * BAY)
}

/// Columns in x and z; the corners have piers.
fn column_places() -> Vec<Vec2> {
    let mut places = vec![];
    for side in [-1.0, 1.0] {
        places.extend(stations(LINE[0]).map(|x| Vec2::new(x, side * LINE[1])));
        places.extend(stations(LINE[1]).map(|z| Vec2::new(side * LINE[0], z)));
    }
    places
}
