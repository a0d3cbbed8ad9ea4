//! Closed forms, directions, taps, and a plain f64 sum.

use super::*;
use crate::passes::lightmap_mips::{level_sizes, lightmap_mips};
use crate::test_bake::{self, N_RAYS, pack_uv};
use localprt_formats::BakedArrays;
use std::f32::consts::PI;

const WHITE: Vec3 = Vec3::new(1.0, 0.5, 0.25);

/// Levels over a map whose texel i holds `color(i)`; `None` is uncovered.
fn levels(size: u32, color: impl Fn(usize) -> Option<Vec3>) -> Vec<CoverageMap> {
    let mut levels: Vec<_> = level_sizes(size).into_iter().map(CoverageMap::uncovered).collect();
    for (i, texel) in levels[0].texels_mut().iter_mut().enumerate() {
        *texel = color(i).map_or(glam::Vec4::ZERO, |color| color.extend(1.0));
    }
    lightmap_mips(&mut levels);
    levels
}

fn relight(arrays: &BakedArrays, light_map: &[CoverageMap], sky_rays: &[Vec3]) -> Vec<Vec3> {
    let baked = arrays.checked().unwrap();
    let mut probe_radiance = vec![Vec3::NAN; baked.n_probes() * baked.n_sh()];
    probe_relight(&baked, light_map, sky_rays, &[], &mut probe_radiance);
    probe_radiance
}

/// Left half of the map for one hemisphere about `axis`, right half for the other.
fn two_sides(axis: Vec3) -> BakedArrays {
    test_bake::rays(1, 2, 8, move |direction| [if direction.dot(axis) < 0.0 { 0.25 } else { 0.75 }, 0.5])
}

#[test]
fn constant_radiance_gives_the_constant_function_only() {
    let mut arrays = test_bake::rays(3, 7, 8, |d| [0.5 * d.x + 0.5, 0.5 * d.y + 0.5]);
    arrays.ray_level.iter_mut().enumerate().for_each(|(ray, level)| *level = (ray % 4) as u8);
    // A checkerboard of covered texels: uncovered ones must not show.
    let light_map = levels(8, |i| ((i + i / 8) % 2 == 0).then_some(WHITE));
    for lambda in relight(&arrays, &light_map, &[]).chunks(64) {
        for (j, value) in lambda.iter().enumerate() {
            let expected = if j == 0 { (4.0 * PI).sqrt() * WHITE } else { Vec3::ZERO };
            // The Gram matrix of 64 functions over 1000 spherical Fibonacci directions is off by up to 2e-3; its first
            // row is lambda / sqrt(4 pi).
            assert!((*value - expected).abs().max_element() < 2e-3 * (4.0 * PI).sqrt(), "{j}: {value}");
        }
        // Y_00 is constant: exact but for f32 sums of blocks of 64.
        assert!((lambda[0].x - (4.0 * PI).sqrt()).abs() < 4e-6 * (4.0 * PI).sqrt());
    }
}

#[test]
fn degree_one_points_to_the_bright_side() {
    // Y_1 = sqrt(3/4pi) (y, z, x): the hemisphere about an axis integrates its own function to sqrt(3/4pi) pi.
    for (axis, bright) in [(Vec3::X, 3), (Vec3::Y, 1), (Vec3::Z, 2)] {
        for side in [-1.0, 1.0] {
            let light_map = levels(8, |i| Some(if i % 8 >= 4 { WHITE } else { Vec3::ZERO }));
            let lambda = relight(&two_sides(side * axis), &light_map, &[]);
            let expected = side * (3.0 / (4.0 * PI)).sqrt() * PI;
            for (j, value) in lambda.iter().enumerate().take(4).skip(1) {
                let expected = if j == bright { expected } else { 0.0 };
                // 1000 directions cut in two by a plane: a few percent of one hemisphere's solid angle at most.
                assert!((value.x - expected).abs() < 0.05, "axis {axis} side {side} function {j}: {value}");
                assert!((value.y - 0.5 * value.x).abs() < 1e-5 && (value.z - 0.25 * value.x).abs() < 1e-5);
            }
        }
    }
}

#[test]
fn level_zero_is_exact_at_texel_centers() {
    let light_map = levels(8, |i| Some(Vec3::new(i as f32, 0.0, 1.0)));
    for texel in 0..64u32 {
        let center = [((texel % 8) as f32 + 0.5) / 8.0, ((texel / 8) as f32 + 0.5) / 8.0];
        let lambda = relight(&test_bake::rays(1, 0, 8, |_| center), &light_map, &[]);
        // unorm16 moves the tap by up to 8 * 0.5 / 65535 = 6e-5 texels each way: 9 * 6e-5 of these values; the sum over
        // rays adds 4e-6 relative.
        let found = lambda[0].x / (4.0 * PI).sqrt();
        assert!((found - texel as f32).abs() < 6e-4 + 4e-6 * 64.0, "{texel}: {found}");
    }
}

#[test]
fn rays_read_their_own_level() {
    // 4 x 4, one bright texel of 16 in the corner; rays look at the corner.
    let light_map = levels(4, |i| Some(if i == 0 { 16.0 * WHITE } else { Vec3::ZERO }));
    for (level, expected) in [(0, 16.0), (1, 4.0), (2, 1.0)] {
        let mut arrays = test_bake::rays(1, 0, 4, |_| [0.0, 0.0]);
        arrays.ray_level.fill(level);
        let found = relight(&arrays, &light_map, &[])[0].x / (4.0 * PI).sqrt();
        assert!((found - expected).abs() < 1e-5 * expected, "level {level}: {found}");
    }
}

#[test]
fn a_ray_without_covered_tap_is_black() {
    // A coarser level may hold other charts: their light must not come in.
    let only_last = levels(4, |i| (i == 15).then_some(WHITE));
    let found = relight(&test_bake::rays(1, 0, 4, |_| [0.0, 0.0]), &only_last, &[])[0];
    assert_eq!(found, Vec3::ZERO);
    let nothing = levels(4, |_| None);
    assert_eq!(relight(&test_bake::rays(1, 0, 4, |_| [0.0, 0.0]), &nothing, &[])[0], Vec3::ZERO);
}

#[test]
fn sky_rays_read_the_sky_of_their_direction_and_black_rays_nothing() {
    let mut arrays = test_bake::rays(1, 1, 1, |_| [0.5, 0.5]);
    let light_map = levels(1, |_| Some(100.0 * WHITE));
    // A sky 1 + y: lambda_00 = sqrt(4 pi), lambda of y = sqrt(4 pi / 3), within the Gram error of 2e-3.
    let sky: Vec<_> = arrays.ray_dirs.iter().map(|direction| WHITE * (1.0 + direction[1])).collect();
    arrays.ray_level.fill(LEVEL_SKY);
    let lambda = relight(&arrays, &light_map, &sky);
    let expected = [(4.0 * PI).sqrt(), (4.0 * PI / 3.0).sqrt(), 0.0, 0.0];
    for (value, expected) in lambda.iter().zip(expected) {
        assert!((*value - expected * WHITE).abs().max_element() < 2e-3 * (4.0 * PI).sqrt(), "{value}, {expected}");
    }
    assert_eq!(relight(&arrays, &light_map, &[]), [Vec3::ZERO; 4]);
    arrays.ray_level.fill(LEVEL_BLACK);
    assert_eq!(relight(&arrays, &light_map, &sky), [Vec3::ZERO; 4]);
}

#[test]
fn packed_coordinates_are_u_low_v_high() {
    assert_eq!(unpack_uv(pack_uv([1.0, 0.0])), Vec2::new(1.0, 0.0));
    assert_eq!(unpack_uv(0xffff_0000), Vec2::new(0.0, 1.0));
}

/// The same in f64, ray by ray, tap by tap, from the definition.
fn plain_relight(arrays: &BakedArrays, light_map: &[CoverageMap], sky: &[Vec3]) -> Vec<([f64; 3], f64)> {
    let n_sh = arrays.metadata.n_sh();
    let mut sums = vec![([0.0; 3], 0.0); arrays.probes.len() * n_sh];
    for (hit, (&uv, &level)) in arrays.ray_uv.iter().zip(&arrays.ray_level).enumerate() {
        let (probe, ray) = (hit / N_RAYS as usize, hit % N_RAYS as usize);
        let radiance = match level {
            LEVEL_SKY => sky[ray].to_array().map(f64::from),
            LEVEL_BLACK => [0.0; 3],
            _ => plain_read(&light_map[usize::from(level)], uv).unwrap_or([0.0; 3]),
        };
        for j in 0..n_sh {
            let weight = f64::from(arrays.ray_sh[ray * n_sh + j]);
            let (sum, magnitude) = &mut sums[probe * n_sh + j];
            for channel in 0..3 {
                sum[channel] += weight * radiance[channel];
                *magnitude += (weight * radiance[channel]).abs();
            }
        }
    }
    sums
}

fn plain_read(map: &CoverageMap, uv: u32) -> Option<[f64; 3]> {
    let size = f64::from(map.size());
    let [x, y] = [uv & 0xffff, uv >> 16].map(|part| f64::from(part) / 65535.0 * size - 0.5);
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (tap_x, tap_y) = (x.floor() + dx, y.floor() + dy);
        let weight = (1.0 - (x - tap_x).abs()) * (1.0 - (y - tap_y).abs());
        let texel = (tap_y.clamp(0.0, size - 1.0) * size + tap_x.clamp(0.0, size - 1.0)) as usize;
        let weight = weight * f64::from(map.coverage(texel));
        total += weight;
        for (sum, value) in sum.iter_mut().zip(map.color(texel).to_array()) {
            *sum += weight * f64::from(value);
        }
    }
    (total > 0.0).then(|| sum.map(|value| value / total))
}

#[test]
fn agrees_with_a_plain_sum_in_double_precision() {
    // Degree 4 has 25 functions: three groups of lanes and a rest. 1000 rays are 15 blocks and a rest.
    let mut arrays = test_bake::rays(3, 4, 16, |d| [(0.5 * d.x + 0.5).sqrt(), 0.5 * d.z + 0.5]);
    let kinds = [0, 1, 2, 3, 4, LEVEL_SKY, LEVEL_BLACK];
    arrays.ray_level.iter_mut().enumerate().for_each(|(hit, level)| *level = kinds[hit % kinds.len()]);
    let colors = test_bake::random_colors(5, 256);
    let light_map = levels(16, |i| (i % 5 < 3).then(|| colors[i] + 0.5));
    let sky = test_bake::random_colors(6, N_RAYS as usize);
    let found = relight(&arrays, &light_map, &sky);
    for (value, (sum, magnitude)) in found.iter().zip(plain_relight(&arrays, &light_map, &sky)) {
        for (channel, sum) in value.to_array().into_iter().zip(sum) {
            // Blocks of 64 terms: 4e-6 of the sum of absolute terms; taps: f32 uv within 1e-6 texels and a division.
            assert!((f64::from(channel) - sum).abs() < 6e-6 * magnitude, "{channel} instead of {sum}");
        }
    }
}
