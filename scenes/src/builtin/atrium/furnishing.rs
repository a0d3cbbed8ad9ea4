//! Fountain, plants and banners.

use super::super::shapes::Shape;
use super::masonry::{RAIL_HEIGHT, SLAB_INNER};
use super::{BARK, BAY, CLOTHS, EMBED, LEAVES, LEVELS, LINE, STONE, TERRACOTTA, WATER, noise, sin_cos};
use crate::scene::Mesh;
use glam::{Quat, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Trees stand here, in x and z.
const TREES: [Vec2; 4] = [Vec2::new(-5.9, -1.75), Vec2::new(-5.9, 1.75), Vec2::new(5.9, -1.75), Vec2::new(5.9, 1.75)];
/// Top of the paving's highest slab is below this.
const PAVING: f32 = 0.03;
/// What stands in the court starts this far below, between the floor and the underside of the paving.
const SINK: f32 = EMBED / 2.0;
const CARDS_PER_TREE: u32 = 260;
const CARDS_PER_BAY: u32 = 70;
const BANNER_CELLS: [usize; 2] = [16, 22];

pub(super) fn build() -> Vec<Mesh> {
    let mut meshes = vec![
        fountain().into_mesh("fountain", STONE, None),
        water().into_mesh("water", WATER, None),
        pots().into_mesh("pots", TERRACOTTA, None),
        trunks().into_mesh("trunks", BARK, None),
        leaves().into_mesh("leaves", LEAVES, Some(1.0)),
    ];
    meshes.extend(banners(BANNER_CELLS));
    meshes
}

/// Three colors of cloth, each cut into so many columns and rows.
pub(super) fn banners(cells: [usize; 2]) -> Vec<Mesh> {
    let of_color = |(index, (name, material)): (usize, (&str, usize))| {
        let mut shape = Shape::default();
        for side in [-1.0, 1.0] {
            // The colors run in opposite orders on both sides.
            let bay = if side < 0.0 { index } else { 2 - index };
            banner(&mut shape, -LINE[0] + (2 * bay) as f32 * BAY + 1.5 * BAY, side, cells);
        }
        shape.into_mesh(&format!("banners {name}"), material, None)
    };
    ["red", "blue", "ochre"].into_iter().zip(CLOTHS).enumerate().map(of_color).collect()
}

fn outline(points: &[(f32, f32)]) -> Vec<Vec2> {
    points.iter().map(|&(radius, height)| Vec2::new(radius, height)).collect()
}

fn fountain() -> Shape {
    let mut shape = Shape::default();
    let foot = Vec3::new(0.0, -SINK, 0.0);
    let basin = [
        (0.0, 0.0),
        (1.25, 0.0),
        (1.25, 0.12),
        (1.12, 0.16),
        (1.12, 0.48),
        (1.24, 0.54),
        (1.24, 0.62),
        (1.0, 0.62),
        (1.0, 0.2),
        (0.0, 0.2),
    ];
    shape.lathe(foot, &outline(&basin), 32);
    let stem = [
        (0.0, 0.15),
        (0.22, 0.15),
        (0.22, 0.55),
        (0.1, 0.68),
        (0.09, 1.05),
        (0.14, 1.15),
        (0.5, 1.32),
        (0.56, 1.42),
        (0.5, 1.42),
        (0.1, 1.3),
        (0.05, 1.7),
        (0.09, 1.76),
        (0.0, 1.85),
    ];
    shape.lathe(foot, &outline(&stem), 24);
    shape
}

fn water() -> Shape {
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &outline(&[(0.0, 0.3), (1.06, 0.3), (1.06, 0.5), (0.0, 0.5)]), 32);
    shape
}

fn pots() -> Shape {
    let mut shape = Shape::default();
    let profile =
        [(0.0, 0.0), (0.28, 0.0), (0.36, 0.42), (0.42, 0.44), (0.42, 0.56), (0.35, 0.56), (0.34, 0.48), (0.0, 0.48)];
    for at in TREES {
        shape.lathe(Vec3::new(at.x, -SINK, at.y), &outline(&profile), 20);
    }
    // Planters on the edge of the gallery, one per hanging plant.
    for (x, side) in hanging_places() {
        let foot = Vec3::new(x, LEVELS[1] - EMBED, side * (SLAB_INNER.y + 0.1));
        shape.block_at(foot, Vec3::new(1.5, 0.2, 0.17));
    }
    shape
}

fn trunks() -> Shape {
    let mut shape = Shape::default();
    for at in TREES {
        let profile = outline(&[(0.0, 0.45), (0.07, 0.45), (0.05, 0.7), (0.045, 1.6), (0.03, 2.3), (0.0, 2.32)]);
        shape.lathe(Vec3::new(at.x, PAVING, at.y), &profile, 10);
    }
    shape
}

fn leaves() -> Shape {
    let mut shape = Shape::default();
    for (tree, at) in TREES.iter().enumerate() {
        let seed = tree as u32 * 10_000;
        let crown = Vec3::new(at.x, 2.35, at.y);
        for index in 0..CARDS_PER_TREE {
            let random = |channel: u32| noise(seed + index * 8 + channel);
            // Evenly over directions, most of them near the surface of the crown.
            let height = 1.0 - (index as f32 + 0.5) * 2.0 / CARDS_PER_TREE as f32;
            let azimuth = index as f32 * PI * (3.0 - 5.0f32.sqrt());
            let across = (1.0 - height * height).sqrt();
            let (sin, cos) = sin_cos(azimuth);
            let outward = Vec3::new(across * cos, height, across * sin);
            let center = crown + outward * Vec3::new(0.8, 0.75, 0.8) * (0.45 + 0.55 * random(0).sqrt());
            let tilt = Vec3::new(random(1) - 0.5, random(2) - 0.2, random(3) - 0.5) * 1.6;
            card(&mut shape, center, outward + tilt, random(4) * TAU, 0.3 + 0.14 * random(5));
        }
    }
    for (place, (x, side)) in hanging_places().into_iter().enumerate() {
        let seed = 500_000 + place as u32 * 10_000;
        for index in 0..CARDS_PER_BAY {
            let random = |channel: u32| noise(seed + index * 8 + channel);
            let along = random(0) * 2.0 - 1.0;
            // Longest in the middle.
            let hang = random(1) * (0.35 + 0.95 * (1.0 - along * along));
            let out = 0.08 + 0.1 * random(2);
            let center = Vec3::new(x + 0.8 * along, LEVELS[1] + 0.2 - hang, side * (SLAB_INNER.y - out));
            let facing = Vec3::new(random(3) - 0.5, 0.5 * random(4), -side * 0.8);
            card(&mut shape, center, facing, PI + (random(5) - 0.5) * 1.6, 0.22 + 0.12 * random(6));
        }
    }
    shape
}

/// A square card with the leaf texture.
fn card(shape: &mut Shape, center: Vec3, facing: Vec3, turn: f32, size: f32) {
    let normal = facing.normalize_or(Vec3::Y);
    let (frame, (sin, cos)) = (Quat::from_rotation_arc(Vec3::Z, normal), sin_cos(turn));
    let corner = |x: f32, y: f32| center + frame * Vec3::new(x * cos - y * sin, x * sin + y * cos, 0.0) * (size / 2.0);
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    shape.quad_with(corners, [normal; 4], [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO]);
}

/// Middles of the bays between the banners, and the side of the court.
fn hanging_places() -> Vec<(f32, f32)> {
    let middle = |bay: usize| -LINE[0] + (bay as f32 + 0.5) * BAY;
    [-1.0, 1.0].into_iter().flat_map(|side| [0, 2, 4, 6].map(|bay| (middle(bay), side))).collect()
}

/// Cloth that hangs from the handrail over the gallery's edge into the court, with folds that open downwards.
fn banner(shape: &mut Shape, middle: f32, side: f32, [columns, rows]: [usize; 2]) {
    let (width, gallery) = (1.5, LEVELS[1]);
    // Height and distance from the middle of the court, from the rail's front down.
    let path = [
        Vec2::new(gallery + RAIL_HEIGHT - 0.06, LINE[1] - 0.1),
        Vec2::new(gallery + 0.02, SLAB_INNER.y - 0.07),
        Vec2::new(gallery - 2.0, SLAB_INNER.y - 0.12),
    ];
    let point = |column: usize, row: usize| {
        let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
        let along = v * 2.96;
        let first = path[0].distance(path[1]);
        let at = if along < first {
            path[0].lerp(path[1], along / first)
        } else {
            path[1].lerp(path[2], (along - first) / (2.96 - first))
        };
        let fold = 0.05 * v * sin_cos(u * TAU * 2.5 + 0.6 * v).0;
        Vec3::new(middle + (u - 0.5) * width, at.x, side * (at.y - fold.max(-0.04)))
    };
    // Faces the court.
    let flip = side < 0.0;
    for row in 0..rows {
        for column in 0..columns {
            let cells = [(column, row + 1), (column + 1, row + 1), (column + 1, row), (column, row)];
            let smooth = |(column, row): (usize, usize)| {
                let across = point((column + 1).min(columns), row) - point(column.saturating_sub(1), row);
                let up = point(column, row.saturating_sub(1)) - point(column, (row + 1).min(rows));
                across.cross(up).normalize() * if flip { 1.0 } else { -1.0 }
            };
            let mut corners = cells.map(|(column, row)| point(column, row));
            let mut normals = cells.map(smooth);
            if !flip {
                corners.reverse();
                normals.reverse();
            }
            shape.quad_with(corners, normals, [Vec2::ZERO; 4]);
        }
    }
}
