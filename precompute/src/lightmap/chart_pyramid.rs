//! The charts of the direct light map by mip level: no lookup may mix two of them.

use super::{Atlas, TexelMap};
use crate::rays::FacePoint;
use glam::Vec2;
use localprt_formats::quantize::{pack_uv, unpack_uv};
use localprt_scenes::Scene;

/// A coordinate as a file stores it.
pub fn as_stored(uv: Vec2) -> Vec2 {
    unpack_uv(pack_uv(uv.to_array())).into()
}

/// Which chart the texels of each mip level belong to.
pub struct ChartPyramid {
    size: u32,
    /// `(texels per side, chart of each texel)`, level 0 first.
    levels: Vec<(u32, Vec<u32>)>,
}

/// How far [`ChartPyramid::texel_near`] looks, in texels along each axis.
pub const NEAREST_TEXEL: u32 = 2;

/// No covered texel below.
const EMPTY: u32 = u32::MAX;
/// Texels of several charts below.
const MIXED: u32 = u32::MAX - 1;

impl ChartPyramid {
    /// Of the covered texels of the map.
    pub fn of(map: &TexelMap) -> Self {
        let mut level = vec![EMPTY; (map.size * map.size) as usize];
        for texel in &map.texels {
            level[texel.index as usize] = texel.chart;
        }
        let mut levels = vec![(map.size, level)];
        while let Some((size, below)) = levels.last().filter(|(size, _)| *size > 1) {
            let half = size.div_ceil(2);
            let mut level = vec![EMPTY; (half * half) as usize];
            for y in 0..*size {
                for x in 0..*size {
                    let held = &mut level[((y / 2) * half + x / 2) as usize];
                    *held = match (*held, below[(y * size + x) as usize]) {
                        (EMPTY, other) | (other, EMPTY) => other,
                        (a, b) if a == b => a,
                        _ => MIXED,
                    };
                }
            }
            levels.push((half, level));
        }
        Self { size: map.size, levels }
    }

    /// Texels per side of the map.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// Mip levels, the map itself counted.
    pub fn n_levels(&self) -> u32 {
        self.levels.len() as u32
    }

    /// Texels per side of a level.
    pub fn level_size(&self, level: u32) -> u32 {
        self.levels[level as usize].0
    }

    /// Whether a texel of a level holds texels of the chart and of no other.
    pub fn is_of(&self, level: u32, x: u32, y: u32, chart: u32) -> bool {
        let (size, charts) = &self.levels[level as usize];
        charts[(y * size + x) as usize] == chart
    }

    /// The texel at a coordinate, or the nearest within [`NEAREST_TEXEL`], that holds the chart's texels.
    pub fn texel_near(&self, uv: Vec2, chart: u32) -> Option<[u32; 2]> {
        let at = self.nearest_texel(uv, chart, 0, &|_| true);
        at.or_else(|| self.nearest_texel(uv, chart, NEAREST_TEXEL, &|_| true))
    }

    /// Center of the nearest texel of a chart within four texels whose lookup is pure, as stored.
    pub fn nearest(&self, uv: Vec2, chart: u32) -> Option<Vec2> {
        let center = |[x, y]: [u32; 2]| as_stored(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / self.size as f32);
        self.nearest_texel(uv, chart, 4, &|texel| self.is_pure(center(texel), 0, chart)).map(center)
    }

    /// The nearest texel of a chart that is good, at most so many texels away along each axis; of several the first by rows.
    fn nearest_texel(&self, uv: Vec2, chart: u32, reach: u32, is_good: &dyn Fn([u32; 2]) -> bool) -> Option<[u32; 2]> {
        let at = uv * self.size as f32;
        let last = i64::from(self.size) - 1;
        let around = |center: f32| {
            let center = (center.floor() as i64).clamp(0, last);
            (center - i64::from(reach)).max(0)..=(center + i64::from(reach)).min(last)
        };
        around(at.y)
            .flat_map(|y| around(at.x).map(move |x| [x as u32, y as u32]))
            .filter(|&[x, y]| self.is_of(0, x, y, chart) && is_good([x, y]))
            .min_by(|a, b| {
                let distance = |[x, y]: [u32; 2]| Vec2::new(x as f32 + 0.5, y as f32 + 0.5).distance_squared(at);
                distance(*a).total_cmp(&distance(*b))
            })
    }

    /// Area of a texel of the map at a surface point, m^2; infinite where the face is a point of the map.
    pub fn texel_m2(&self, scene: &Scene, atlas: &Atlas, point: &FacePoint) -> f32 {
        atlas.texel_m2(scene, point, self.size)
    }

    /// The four texels of a bilinear lookup hold the chart's texels or nothing, and not nothing alone.
    pub fn is_pure(&self, uv: Vec2, level: u32, chart: u32) -> bool {
        let (size, charts) = &self.levels[level as usize];
        // Level sizes round up, so a texel of level l spans 2^l texels of level 0 exactly.
        let at = uv * self.size as f32 / (1u32 << level) as f32 - 0.5;
        let base = at.floor();
        let fraction = at - base;
        let mut found = false;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = |step: i64, fraction: f32| if step == 0 { 1.0 - fraction } else { fraction };
            if weight(dx, fraction.x) * weight(dy, fraction.y) == 0.0 {
                continue;
            }
            let x = (base.x as i64 + dx).clamp(0, i64::from(*size) - 1) as usize;
            let y = (base.y as i64 + dy).clamp(0, i64::from(*size) - 1) as usize;
            match charts[y * *size as usize + x] {
                EMPTY => {}
                held if held == chart => found = true,
                _ => return false,
            }
        }
        found
    }
}
