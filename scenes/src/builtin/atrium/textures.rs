//! Textures computed in code: ashlar masonry, checkered tiles, and a twig with leaves.

use super::noise;
use crate::builtin::drawn::draw;
use crate::scene::Image;
use glam::{Vec2, Vec3};

/// Courses of stone, 2 x 2 m: four courses of two stones, every other course shifted.
pub(super) fn ashlar() -> Image {
    draw("ashlar", 128, |at| {
        let row = (at.y * 4.0).floor();
        let x = at.x * 2.0 + if row as u32 % 2 == 1 { 0.5 } else { 0.0 };
        let inside = Vec2::new(x.fract() * 1.0, at.y * 4.0 - row) * Vec2::new(64.0, 32.0);
        let joint = inside.min_element() < 1.0;
        let stone = noise(row as u32 * 16 + x as u32 % 2 + 7);
        let grain = noise((at.x * 128.0) as u32 * 997 + (at.y * 128.0) as u32 * 13 + 1_000_000);
        let color = Vec3::new(208.0, 192.0, 165.0) * (0.9 + 0.1 * stone) * (0.96 + 0.04 * grain);
        (if joint { color * 0.72 } else { color }, 1.0)
    })
}

/// Tiles of 0.8 m in two colors.
pub(super) fn checker() -> Image {
    draw("checker", 64, |at| {
        let cell = (at * 2.0).floor();
        let inside = (at * 2.0 - cell) * 32.0;
        let light = ((cell.x + cell.y) as u32).is_multiple_of(2);
        let grain = noise((at.x * 64.0) as u32 * 499 + (at.y * 64.0) as u32 * 7 + 2_000_000);
        let color = if light { Vec3::new(205.0, 190.0, 170.0) } else { Vec3::new(148.0, 84.0, 62.0) };
        let color = color * (0.94 + 0.06 * grain);
        (if inside.min_element() < 1.0 { Vec3::new(120.0, 110.0, 100.0) } else { color }, 1.0)
    })
}

/// A stem with seven leaves, transparent around them. The color goes on under the transparent part, so that filtering
/// finds no rim.
pub(super) fn leaf() -> Image {
    // Root, direction in turns, length.
    let leaves: [(Vec2, f32, f32); 7] = [
        (Vec2::new(0.5, 0.45), 0.25, 0.44),
        (Vec2::new(0.5, 0.5), 0.16, 0.4),
        (Vec2::new(0.5, 0.5), 0.34, 0.4),
        (Vec2::new(0.5, 0.66), 0.1, 0.42),
        (Vec2::new(0.5, 0.66), 0.4, 0.42),
        (Vec2::new(0.5, 0.82), 0.03, 0.4),
        (Vec2::new(0.5, 0.82), 0.47, 0.4),
    ];
    draw("leaf", 64, |at| {
        let mut shade = None;
        for (index, (root, turns, length)) in leaves.into_iter().enumerate() {
            let (sin, cos) = f64::from(turns * std::f32::consts::TAU).sin_cos();
            let along_dir = Vec2::new(cos as f32, -sin as f32);
            let (along, aside) = ((at - root).dot(along_dir) / length, (at - root).dot(along_dir.perp()) / length);
            // A lens: widest in the middle, pointed at both ends.
            let half_width = 0.85 * along * (1.0 - along);
            if (0.0..=1.0).contains(&along) && aside.abs() <= half_width {
                let rib = if aside.abs() < 0.03 { 1.25 } else { 1.0 };
                shade = Some(rib * (0.75 + 0.35 * noise(index as u32 + 40)));
            }
        }
        let stem = (at.x - 0.5).abs() < 0.02 && at.y > 0.4;
        let alpha = if shade.is_some() || stem { 1.0 } else { 0.0 };
        (Vec3::new(98.0, 142.0, 58.0) * shade.unwrap_or(0.8), alpha)
    })
}
