//! Relight rays: where the fixed rays of every probe look in the direct light map (section 4.2).
//!
//! All probes share one spherical Fibonacci set. A ray that meets a face stores the position in the lightmap layout and
//! a mip level whose texels are about as large as the ray's footprint, lowered until every texel that the bilinear
//! lookup touches belongs to the ray's own chart, so that no mip mixes charts. Rays that leave the scene read the sky;
//! rays that meet the back of a one-sided surface are black. How far each ray goes is kept as well.

use crate::{
    lightmap::{Atlas, ChartPyramid, as_stored},
    rays::{FacePoint, RayCaster},
};
use glam::Vec3;
use half::f16;
use localprt_formats::{
    LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL,
    directions::spherical_fibonacci,
    quantize::{distance_to_f16, pack_uv},
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

/// Traces the relight rays of all probes. `charts` are those of the direct light map, laid out by `atlas`.
pub fn trace(
    caster: &RayCaster<'_>,
    atlas: &Atlas,
    charts: &ChartPyramid,
    probes: &[Vec3],
    n_rays: u32,
    basis: &sh::Basis,
) -> RelightRays {
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
                            lookup(caster, atlas, charts, &point, footprint_m2, &mut seen.counts)
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
    // As stored, so that the checks see what the lookup will.
    let mut uv = as_stored(atlas.at(point));
    let chart = atlas.chart[point.face.0 as usize];
    if !charts.is_pure(uv, 0, chart) {
        let Some(nearest) = charts.nearest(uv, chart) else {
            counts.unmapped += 1;
            return (0, LEVEL_BLACK);
        };
        counts.moved += 1;
        uv = nearest;
    }
    counts.surface += 1;
    let texel_m2 = charts.texel_m2(caster.scene(), atlas, point);
    let wanted = (0.5 * (footprint_m2 / texel_m2).max(1.0).log2()).floor() as u32;
    let mut level = wanted.min(u32::from(MAX_LEVEL)).min(charts.n_levels() - 1);
    while level > 0 && !charts.is_pure(uv, level, chart) {
        level -= 1;
    }
    (pack_uv(uv.to_array()), level as u8)
}
