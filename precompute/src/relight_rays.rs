//! Relight rays: where the fixed rays of every probe look in the direct light map (section 4.2).
//!
//! All probes share one spherical Fibonacci set. A ray that meets a face stores the position in the lightmap layout and
//! a mip level whose texels are about as large as the ray's footprint, lowered until every texel that the bilinear
//! lookup touches belongs to the ray's own chart, so that no mip mixes charts. Rays that leave the scene read the sky;
//! rays that meet the back of a one-sided surface are black. How far each ray goes is kept as well.

use crate::{
    lightmap::{Atlas, ChartPyramid, as_stored},
    probe_views::ProbeDirections,
    rays::{FacePoint, RayCaster, SurfaceHit},
    report::RelightFacts,
};
use half::f16;
use localprt_formats::{
    LEVEL_BLACK, LEVEL_SKY, MAX_LEVEL,
    quantize::{distance_to_f16, pack_uv},
};

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
    pub counts: RelightFacts,
}

/// Where relight rays look things up: the direct light map of a scene.
pub struct LightMapLookups<'a> {
    /// Of the scene.
    pub caster: &'a RayCaster<'a>,
    /// Layout of the direct light map.
    pub atlas: &'a Atlas,
    /// Its charts.
    pub charts: &'a ChartPyramid,
}

impl LightMapLookups<'_> {
    /// Lookups of one probe: `hits` is what its rays meet.
    pub fn of_probe(&self, directions: &ProbeDirections, hits: &[Option<SurfaceHit>]) -> RelightRays {
        let mut rays = RelightRays::default();
        for (&dir, hit) in directions.dirs.iter().zip(hits) {
            rays.distance.push(distance_to_f16(hit.as_ref().map_or(f32::INFINITY, |hit| hit.t)));
            let (uv, level) = match hit {
                None => {
                    rays.counts.sky += 1;
                    (0, LEVEL_SKY)
                }
                Some(hit) => match hit.point {
                    None => {
                        rays.counts.black += 1;
                        (0, LEVEL_BLACK)
                    }
                    Some(point) => {
                        let cosine = -hit.normal.dot(dir);
                        let footprint_m2 = hit.t * hit.t * directions.steradians() / cosine.max(0.05);
                        self.lookup(&point, footprint_m2, &mut rays.counts)
                    }
                },
            };
            rays.uv.push(uv);
            rays.level.push(level);
        }
        rays
    }

    /// Stored position and level for a surface point.
    fn lookup(&self, point: &FacePoint, footprint_m2: f32, counts: &mut RelightFacts) -> (u32, u8) {
        let Self { caster, atlas, charts } = *self;
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
}

impl RelightRays {
    /// Those of all probes, from those of each.
    pub fn of_all(directions: ProbeDirections, of_probes: Vec<RelightRays>) -> Self {
        let mut rays = Self {
            dirs: directions.dirs.iter().map(|dir| dir.extend(0.0).to_array()).collect(),
            sh: directions.sh,
            ..Self::default()
        };
        for of_probe in of_probes {
            rays.uv.extend(of_probe.uv);
            rays.level.extend(of_probe.level);
            rays.distance.extend(of_probe.distance);
            rays.counts.surface += of_probe.counts.surface;
            rays.counts.moved += of_probe.counts.moved;
            rays.counts.sky += of_probe.counts.sky;
            rays.counts.black += of_probe.counts.black;
            rays.counts.unmapped += of_probe.counts.unmapped;
        }
        rays
    }
}
