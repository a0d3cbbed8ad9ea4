//! CPU twin of near light.

use crate::coverage_map::CoverageMap;
use crate::passes::split_ranges;
use glam::Vec3;
use localprt_formats::{NearView, node_level_and_texel, quantize::near_weight};
use rayon::prelude::*;

/// Adds to the coefficients of every receiver the sum of weight times radiance over its links, RGB (N1). `light_map` holds
/// the levels of outgoing radiance; a node that nothing covers is black.
///
/// Lights do not shine through anything on the way that was there when the scene was baked, but objects that have come
/// since do not block links.
///
/// # Panics
/// If the arrays do not have the lengths of a checked file.
pub fn near_light(near: &NearView<'_>, light_map: &[CoverageMap], coefficients: &mut [Vec3]) {
    let n_k = near.weights.len() / near.links.len().max(1);
    if n_k == 0 {
        return;
    }
    let tile_pairs = || near.tiles.windows(2);
    let ranges = tile_pairs().map(|pair| pair[0].first_receiver as usize * n_k..pair[1].first_receiver as usize * n_k);
    let outputs = split_ranges(coefficients, ranges);
    outputs.into_par_iter().zip(tile_pairs().collect::<Vec<_>>()).for_each(|(outputs, pair)| {
        let [tile, next] = [pair[0], pair[1]];
        let nodes = &near.nodes[tile.first_node as usize..next.first_node as usize];
        let radiance = |&node: &u32| {
            let (level, texel) = node_level_and_texel(node);
            light_map[level as usize].color(texel as usize)
        };
        let radiance: Vec<Vec3> = nodes.iter().map(radiance).collect();
        let counts = &near.counts[tile.first_receiver as usize..next.first_receiver as usize];
        let mut link = tile.first_link as usize;
        for (sums, &count) in outputs.chunks_exact_mut(n_k).zip(counts) {
            for _ in 0..count {
                let light = radiance[near.links[link] as usize];
                for (sum, &code) in sums.iter_mut().zip(&near.weights[link * n_k..]) {
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
    use crate::checked_bake::CheckedBake;
    use crate::error::RelightError;
    use crate::test_bake;

    #[test]
    fn agrees_with_a_plain_sum_in_double_precision() {
        for receiver_degree in [0, 1] {
            let arrays = test_bake::with_near(test_bake::random(2, receiver_degree, 2));
            let baked = CheckedBake::new(arrays.view()).unwrap();
            let near = baked.near().unwrap();
            let light_map = test_bake::light_map(arrays.metadata.direct_size);
            let before: Vec<Vec3> = (0..baked.n_receivers() * baked.n_k()).map(|i| Vec3::splat(i as f32)).collect();
            let mut found = before.clone();
            near_light(near, &light_map, &mut found);
            let mut link = 0;
            for receiver in 0..baked.n_receivers() {
                let tile = near.tiles.iter().rposition(|tile| tile.first_receiver as usize <= receiver).unwrap();
                let tile = near.tiles[tile];
                let mut expected = vec![glam::DVec3::ZERO; baked.n_k()];
                for _ in 0..near.counts[receiver] {
                    let node = near.nodes[tile.first_node as usize + near.links[link] as usize];
                    let map = &light_map[(node >> 28) as usize];
                    let texel = map.texels()[(node & 0xfff_ffff) as usize].as_dvec4();
                    let light = if texel.w > 0.0 { texel.truncate() / texel.w } else { glam::DVec3::ZERO };
                    for (k, sum) in expected.iter_mut().enumerate() {
                        let root = f64::from(near.weights[link * baked.n_k() + k]) / 127.0;
                        *sum += f64::from(tile.scale) * root * root.abs() * light;
                    }
                    link += 1;
                }
                for (k, expected) in expected.iter().enumerate() {
                    let at = receiver * baked.n_k() + k;
                    let found = found[at].as_dvec3() - before[at].as_dvec3();
                    // Sums of a few terms of order 1 in f32, on top of numbers below 100.
                    assert!((found - *expected).abs().max_element() < 2e-5, "{receiver}, {k}: {found} {expected}");
                }
            }
            assert!(link > baked.n_receivers(), "{link} links");
        }
    }

    #[test]
    fn wrong_links_are_refused() {
        let mut arrays = test_bake::with_near(test_bake::random(2, 0, 2));
        assert!(CheckedBake::new(arrays.view()).is_ok());
        arrays.near.as_mut().unwrap().links[0] = 255;
        let refused = CheckedBake::new(arrays.view()).err();
        assert!(matches!(refused, Some(RelightError::Bake { ref place, .. }) if place == "near light"), "{refused:?}");
    }
}
