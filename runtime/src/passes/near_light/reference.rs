//! CPU twin of near light.

use crate::coverage_map::CoverageMap;
use crate::passes::split_ranges;
use glam::Vec3;
use localprt_formats::{Transport, node_level_and_texel, quantize::near_weight};
use rayon::prelude::*;

/// Adds to the coefficients of every receiver the sum of weight times radiance over its links, RGB (N1). `light_map` holds
/// the levels of outgoing radiance; a node that nothing covers is black.
///
/// Lights do not shine through anything on the way that was there when the scene was baked, but objects that have come
/// since do not block links.
///
/// # Panics
/// If the arrays do not have the lengths of a checked file.
pub fn near_light(transport: &Transport<'_>, light_map: &[CoverageMap], coefficients: &mut [Vec3]) {
    let n_k = transport.n_k;
    let ranges = transport.tiles.iter().map(|tile| tile.receivers.start * n_k..tile.receivers.end * n_k);
    let outputs = split_ranges(coefficients, ranges);
    outputs.into_par_iter().zip(&transport.tiles).for_each(|(outputs, tile)| {
        let radiance = |&node: &u32| {
            let (level, texel) = node_level_and_texel(node);
            light_map[level as usize].color(texel as usize)
        };
        let radiance: Vec<Vec3> = tile.nodes.iter().map(radiance).collect();
        let mut link = 0;
        for (sums, &count) in outputs.chunks_exact_mut(n_k).zip(tile.counts) {
            for _ in 0..count {
                let light = radiance[tile.links[link] as usize];
                for (sum, &code) in sums.iter_mut().zip(&tile.weights[link * n_k..]) {
                    *sum += near_weight(code, tile.scale) * light;
                }
                link += 1;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;

    #[test]
    fn agrees_with_a_plain_sum_in_double_precision() {
        for receiver_degree in [0, 1] {
            let arrays = test_bake::with_near(test_bake::random(2, receiver_degree, 2));
            let baked = arrays.checked().unwrap();
            let (transport, n_k) = (baked.transport(), baked.n_k());
            let light_map = test_bake::light_map(arrays.metadata.direct_size);
            let before: Vec<Vec3> = (0..baked.n_receivers() * n_k).map(|i| Vec3::splat(i as f32)).collect();
            let mut found = before.clone();
            near_light(transport, &light_map, &mut found);
            let mut links = 0;
            for tile in &transport.tiles {
                let mut link = 0;
                for (receiver, &count) in tile.receivers.clone().zip(tile.counts) {
                    let mut expected = vec![glam::DVec3::ZERO; n_k];
                    for _ in 0..count {
                        let node = tile.nodes[tile.links[link] as usize];
                        let map = &light_map[(node >> 28) as usize];
                        let texel = map.texels()[(node & 0xfff_ffff) as usize].as_dvec4();
                        let light = if texel.w > 0.0 { texel.truncate() / texel.w } else { glam::DVec3::ZERO };
                        for (k, sum) in expected.iter_mut().enumerate() {
                            let root = f64::from(tile.weights[link * n_k + k]) / 127.0;
                            *sum += f64::from(tile.scale) * root * root.abs() * light;
                        }
                        link += 1;
                    }
                    for (k, expected) in expected.iter().enumerate() {
                        let at = receiver * n_k + k;
                        let found = found[at].as_dvec3() - before[at].as_dvec3();
                        // Sums of a few terms of order 1 in f32, on top of numbers below 100.
                        assert!((found - *expected).abs().max_element() < 2e-5, "{receiver}, {k}: {found} {expected}");
                    }
                }
                links += link;
            }
            assert!(links > baked.n_receivers(), "{links} links");
        }
    }
}
