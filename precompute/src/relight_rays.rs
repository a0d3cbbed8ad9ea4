//! Relight rays: where the fixed rays of every probe look in the direct light map (section 4.2).
//!
//! All probes share one spherical Fibonacci set. A ray that meets a face stores the position in the lightmap layout and
//! a mip level whose texels are about as large as the ray's footprint, lowered until every texel that the bilinear
//! lookup touches belongs to the ray's own chart, so that no mip mixes charts. Rays that leave the scene read the sky;
//! rays that meet the back of a one-sided surface are black. How far each ray goes is kept as well.

use crate::{
    lightmap::{Atlas, TexelMap},
    rays::{FacePoint, RayCaster},
};
use glam::{Vec2, Vec3};
use half::f16;
use localprt_formats::{
    LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL,
    directions::spherical_fibonacci,
    quantize::{distance_to_f16, pack_uv, unpack_uv},
    sh,
};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Relight rays of all probes, as stored in a baked file.
#[derive(Clone, Debug, Default)]
pub struct RelightRays {
    /// `[n_rays]` unit directions, w = 0.
    pub dirs: Vec<[f32; 4]>,
    /// `[n_rays][n_sh]` SH values times `4 pi / n_rays`.
    pub sh: Vec<f32>,
    /// `[n_probes][n_rays]` two unorm16, u low.
    pub uv: Vec<u32>,
    /// `[n_probes][n_rays]`.
    pub level: Vec<u8>,
    /// `[n_probes][n_rays]` metres to what the ray meets, infinite where it leaves the scene.
    pub distance: Vec<f16>,
    /// What the rays met.
    pub counts: RelightCounts,
}

/// Relight rays by what they met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RelightCounts {
    /// A face with lightmap texels.
    pub surface: u64,
    /// Of those, rays whose place has no covered texel of the face's chart beside it and that read the nearest one.
    pub moved: u64,
    /// Nothing: they read the sky.
    pub sky: u64,
    /// The back of a one-sided surface.
    pub black: u64,
    /// A face that no texel near by belongs to: black.
    pub unmapped: u64,
}

/// Traces the relight rays of all probes. `direct` is the layout covered at the size of the direct light map.
pub fn trace(
    caster: &RayCaster<'_>,
    atlas: &Atlas,
    direct: &TexelMap,
    probes: &[Vec3],
    n_rays: u32,
    basis: &sh::Basis,
) -> RelightRays {
    let charts = ChartPyramid::of(direct);
    let dirs: Vec<[f32; 3]> = (0..n_rays).map(|ray| spherical_fibonacci(ray, n_rays)).collect();
    let mut table = vec![0.0; dirs.len() * basis.len()];
    let steradians = 4.0 * PI / n_rays as f32;
    for (dir, values) in dirs.iter().zip(table.chunks_exact_mut(basis.len())) {
        basis.evaluate(*dir, values);
        for value in values {
            *value *= steradians;
        }
    }
    let probes: Vec<RelightRays> = probes
        .par_iter()
        .map(|&probe| {
            let mut seen = RelightRays::default();
            for dir in &dirs {
                let dir = Vec3::from(*dir);
                let hit = caster.closest_hit(probe, dir);
                seen.distance.push(distance_to_f16(hit.as_ref().map_or(f32::INFINITY, |hit| hit.t)));
                let (uv, level) = match hit {
                    None => {
                        seen.counts.sky += 1;
                        (0, LEVEL_SKY)
                    }
                    Some(hit) => match hit.point {
                        None => {
                            seen.counts.black += 1;
                            (0, LEVEL_BLACK)
                        }
                        Some(point) => {
                            let cosine = -hit.normal.dot(dir);
                            let footprint_m2 = hit.t * hit.t * steradians / cosine.max(0.05);
                            lookup(caster, atlas, &charts, &point, footprint_m2, &mut seen.counts)
                        }
                    },
                };
                seen.uv.push(uv);
                seen.level.push(level);
            }
            seen
        })
        .collect();
    let mut rays = RelightRays {
        dirs: dirs.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect(),
        sh: table,
        ..RelightRays::default()
    };
    for seen in probes {
        rays.uv.extend(seen.uv);
        rays.level.extend(seen.level);
        rays.distance.extend(seen.distance);
        rays.counts.surface += seen.counts.surface;
        rays.counts.moved += seen.counts.moved;
        rays.counts.sky += seen.counts.sky;
        rays.counts.black += seen.counts.black;
        rays.counts.unmapped += seen.counts.unmapped;
    }
    rays
}

/// Stored position and level for a surface point.
fn lookup(
    caster: &RayCaster<'_>,
    atlas: &Atlas,
    charts: &ChartPyramid,
    point: &FacePoint,
    footprint_m2: f32,
    counts: &mut RelightCounts,
) -> (u32, u8) {
    let face = point.face.0 as usize;
    let [a, b, c] = atlas.corners[face];
    // As stored, so that the checks see what the lookup will.
    let mut uv = stored(a * point.barycentrics.x + b * point.barycentrics.y + c * point.barycentrics.z);
    let chart = atlas.chart[face];
    if !charts.is_pure(uv, 0, chart) {
        let Some(nearest) = charts.nearest(uv, chart) else {
            counts.unmapped += 1;
            return (0, LEVEL_BLACK);
        };
        counts.moved += 1;
        uv = nearest;
    }
    counts.surface += 1;
    let corners = caster.scene().corners(point.mesh, point.triangle);
    let area_m2 = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
    let area_uv = (b - a).perp_dot(c - a).abs();
    let texel_m2 = if area_uv > 0.0 { area_m2 / (area_uv * (charts.size * charts.size) as f32) } else { f32::INFINITY };
    let wanted = (0.5 * (footprint_m2 / texel_m2).max(1.0).log2()).floor() as u32;
    let mut level = wanted.min(u32::from(MAX_LEVEL)).min(charts.levels.len() as u32 - 1);
    while level > 0 && !charts.is_pure(uv, level, chart) {
        level -= 1;
    }
    (pack_uv(uv.to_array()), level as u8)
}

fn stored(uv: Vec2) -> Vec2 {
    unpack_uv(pack_uv(uv.to_array())).into()
}

/// Which chart the texels of each mip level belong to.
struct ChartPyramid {
    size: u32,
    /// `(texels per side, chart of each texel)`, level 0 first.
    levels: Vec<(u32, Vec<u32>)>,
}

/// No covered texel below.
const EMPTY: u32 = u32::MAX;
/// Texels of several charts below.
const MIXED: u32 = u32::MAX - 1;

impl ChartPyramid {
    fn of(map: &TexelMap) -> Self {
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

    /// The four texels of a bilinear lookup hold the chart's texels or nothing, and not nothing alone.
    fn is_pure(&self, uv: Vec2, level: u32, chart: u32) -> bool {
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

    /// Center of the nearest texel of a chart within four texels whose lookup is pure, as stored.
    fn nearest(&self, uv: Vec2, chart: u32) -> Option<Vec2> {
        let (size, charts) = &self.levels[0];
        let size = i64::from(*size);
        let at = uv * self.size as f32;
        let (cx, cy) = (at.x.floor() as i64, at.y.floor() as i64);
        let mut nearest: Option<(f32, Vec2)> = None;
        for y in (cy - 4).max(0)..=(cy + 4).min(size - 1) {
            for x in (cx - 4).max(0)..=(cx + 4).min(size - 1) {
                if charts[(y * size + x) as usize] == chart {
                    let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let distance = center.distance_squared(at);
                    let center = stored(center / self.size as f32);
                    if nearest.is_none_or(|(held, _)| distance < held) && self.is_pure(center, 0, chart) {
                        nearest = Some((distance, center));
                    }
                }
            }
        }
        nearest.map(|(_, center)| center)
    }
}
