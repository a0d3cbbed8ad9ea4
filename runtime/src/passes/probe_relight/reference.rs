//! CPU twin of the probe relight.

use crate::coverage_map::CoverageMap;
use crate::occluder::Occluder;
use glam::{Vec2, Vec3};
use half::f16;
use localprt_formats::{Checked, sh::MAX_FUNCTIONS};
use localprt_formats::{LEVEL_BLACK, LEVEL_SKY};
use rayon::prelude::*;

/// Rays summed in f32 before they are added to the f64 sums: an error of at most 64 * 2^-24 = 4e-6 relative to the sum
/// of absolute terms.
const BLOCK: usize = 64;
/// SH functions summed together, so that the sums stay in registers.
const LANES: usize = 8;

/// Sets `probe_radiance[probe * n_sh + j] = sum over rays of ray_sh[ray][j] * radiance(probe, ray)`, RGB.
///
/// A ray with level l reads level l of `light_map` bilinearly at its uv: texel centers at `(i + 0.5) / size_l`, clamped
/// at the border, taps weighted by coverage. It is black if none of its taps is covered; a level beyond the last reads
/// the last. Rays that leave the scene read `sky_rays[ray]`, W sr^-1 m^-2, or are black if `sky_rays` is empty; rays that
/// hit something without light are black. A ray that meets an occluder before what it was baked to hit has the radiance
/// of the nearest one.
///
/// # Panics
/// If `light_map` has no level, or `sky_rays` (unless empty) or `probe_radiance` do not have the lengths of the file, or if there are
/// occluders and the file has no ray distances.
pub fn probe_relight(
    baked: &Checked<'_>,
    light_map: &[CoverageMap],
    sky_rays: &[Vec3],
    occluders: &[Occluder],
    probe_radiance: &mut [Vec3],
) {
    assert!(!light_map.is_empty(), "light map without level");
    assert!(sky_rays.is_empty() || sky_rays.len() == baked.n_rays(), "sky radiance is needed for every ray");
    assert_eq!(probe_radiance.len(), baked.n_probes() * baked.n_sh());
    let (view, n_rays, n_sh) = (baked.view(), baked.n_rays(), baked.n_sh());
    probe_radiance.par_chunks_mut(n_sh).enumerate().for_each(|(probe, lambda)| {
        let uvs = &view.ray_uv[probe * n_rays..][..n_rays];
        let levels = &view.ray_level[probe * n_rays..][..n_rays];
        let blockers = Blockers::new(baked, probe, occluders);
        let mut sums = [[0.0; 3]; MAX_FUNCTIONS];
        for begin in (0..n_rays).step_by(BLOCK) {
            let rays = begin..n_rays.min(begin + BLOCK);
            let mut radiance = [[0.0; 3]; BLOCK];
            for (radiance, ray) in radiance.iter_mut().zip(rays.clone()) {
                let seen = || match levels[ray] {
                    LEVEL_BLACK => Vec3::ZERO,
                    LEVEL_SKY => sky_rays.get(ray).copied().unwrap_or(Vec3::ZERO),
                    level => read_light_map(light_map, level, uvs[ray]),
                };
                *radiance = blockers.radiance(ray).unwrap_or_else(seen).to_array();
            }
            let table = &view.ray_sh[rays.start * n_sh..rays.end * n_sh];
            add_products(table, n_sh, &radiance[..rays.len()], &mut sums);
        }
        for (lambda, sum) in lambda.iter_mut().zip(sums) {
            *lambda = Vec3::from_array(sum.map(|channel| channel as f32));
        }
    });
}

/// Occluders that a probe may see, and how far its rays go.
struct Blockers<'a> {
    near: Vec<&'a Occluder>,
    origin: Vec3,
    dirs: &'a [[f32; 4]],
    distances: &'a [f16],
}

impl<'a> Blockers<'a> {
    /// Leaves out what begins beyond the farthest hit of the probe.
    fn new(baked: &Checked<'a>, probe: usize, occluders: &'a [Occluder]) -> Self {
        let view = baked.view();
        let origin = Vec3::from_array(view.probes[probe].position);
        if occluders.is_empty() {
            return Self { near: Vec::new(), origin, dirs: view.ray_dirs, distances: &[] };
        }
        let distances = &baked.view().ray_distance[probe * baked.n_rays()..][..baked.n_rays()];
        let farthest = distances.iter().fold(0.0f32, |far, distance| far.max(distance.to_f32()));
        let may_be_seen = |occluder: &&Occluder| {
            let (center, radius) = occluder.bounding_sphere();
            origin.distance(center) - radius < farthest
        };
        Self { near: occluders.iter().filter(may_be_seen).collect(), origin, dirs: view.ray_dirs, distances }
    }

    /// Of the nearest occluder in front of what the ray was baked to hit.
    fn radiance(&self, ray: usize) -> Option<Vec3> {
        if self.near.is_empty() {
            return None;
        }
        let [x, y, z, _] = self.dirs[ray];
        let mut nearest = self.distances[ray].to_f32();
        let mut radiance = None;
        for occluder in &self.near {
            if let Some(distance) = occluder.hit(self.origin, Vec3::new(x, y, z)).filter(|&hit| hit < nearest) {
                nearest = distance;
                radiance = Some(occluder.radiance);
            }
        }
        radiance
    }
}

fn read_light_map(light_map: &[CoverageMap], level: u8, packed_uv: u32) -> Vec3 {
    let level = usize::from(level).min(light_map.len() - 1);
    light_map[level].sample(unpack_uv(packed_uv)).unwrap_or(Vec3::ZERO)
}

/// Two unorm16: u low, v high.
fn unpack_uv(packed: u32) -> Vec2 {
    Vec2::new((packed & 0xffff) as f32, (packed >> 16) as f32) / 65535.0
}

/// `sums[j][channel] += sum over rays of table[ray][j] * radiance[ray][channel]`, one block of rays.
fn add_products(table: &[f32], n_sh: usize, radiance: &[[f32; 3]], sums: &mut [[f64; 3]; MAX_FUNCTIONS]) {
    for group in 0..n_sh / LANES {
        let mut block = [[0.0f32; LANES]; 3];
        for (row, color) in table.chunks_exact(n_sh).zip(radiance) {
            let weights = &row.as_chunks::<LANES>().0[group];
            for (lanes, &channel) in block.iter_mut().zip(color) {
                for (sum, weight) in lanes.iter_mut().zip(weights) {
                    *sum += weight * channel;
                }
            }
        }
        for lane in 0..LANES {
            for channel in 0..3 {
                sums[group * LANES + lane][channel] += f64::from(block[channel][lane]);
            }
        }
    }
    for j in n_sh / LANES * LANES..n_sh {
        let mut block = [0.0f32; 3];
        for (row, color) in table.chunks_exact(n_sh).zip(radiance) {
            for (sum, &channel) in block.iter_mut().zip(color) {
                *sum += row[j] * channel;
            }
        }
        for (sum, block) in sums[j].iter_mut().zip(block) {
            *sum += f64::from(block);
        }
    }
}

#[cfg(test)]
mod tests;
