//! Links of the receivers to the arrays of a file: runs of receivers share their nodes.

use crate::transport::Links;
use localprt_formats::{NEAR_NODES, NEAR_TILE, NearArrays, NearTile, quantize};
use std::collections::BTreeMap;

/// Near light of a block; `links` are those of its receivers in stored order, at most 255 of each. Empty if none has any.
pub(super) fn near_tiles(links: &[&Links], n_k: usize) -> NearArrays {
    let mut near = NearArrays::default();
    if links.iter().all(|links| links.nodes.is_empty()) {
        return near;
    }
    let mut first = 0;
    while first < links.len() {
        let mut places: BTreeMap<u32, u8> = BTreeMap::new();
        let mut end = first;
        while end < links.len() && end - first < NEAR_TILE as usize {
            let new = links[end].nodes.iter().filter(|node| !places.contains_key(node)).count();
            if places.len() + new > NEAR_NODES as usize {
                break;
            }
            places.extend(links[end].nodes.iter().map(|&node| (node, 0)));
            end += 1;
        }
        push_tile(&mut near, &links[first..end], places, n_k);
        first = end;
    }
    near
}

/// Weights are rounded from the smallest up, each with what the rounding of those before has left over: a receiver's sum stays,
/// and no small weight takes the error of a large one.
fn push_tile(near: &mut NearArrays, links: &[&Links], mut places: BTreeMap<u32, u8>, n_k: usize) {
    let scale = links.iter().flat_map(|links| &links.weights).fold(0.0f32, |most, weight| most.max(weight.abs()));
    near.tiles.push(NearTile {
        n_receivers: links.len() as u32,
        n_nodes: places.len() as u32,
        n_links: links.iter().map(|links| links.nodes.len() as u32).sum(),
        scale,
    });
    places.values_mut().enumerate().for_each(|(place, number)| *number = place as u8);
    near.nodes.extend(places.keys());
    for links in links {
        near.counts.push(links.nodes.len() as u8);
        near.links.extend(links.nodes.iter().map(|node| places[node]));
        let first = near.weights.len();
        near.weights.resize(first + links.weights.len(), 0);
        for k in 0..n_k {
            let mut order: Vec<usize> = (k..links.weights.len()).step_by(n_k).collect();
            order.sort_by(|&a, &b| links.weights[a].abs().total_cmp(&links.weights[b].abs()));
            let mut left = 0.0;
            for at in order {
                let weight = links.weights[at];
                let code = quantize::near_code(weight + left, scale);
                left += weight - quantize::near_weight(code, scale);
                near.weights[first + at] = code;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Receivers with `count` links each, to nodes that neighbors share.
    fn some(n_receivers: usize, count: usize, n_k: usize) -> Vec<Links> {
        let links = |receiver: usize| Links {
            nodes: (0..count).map(|link| (3 * receiver + 7 * link) as u32).collect(),
            weights: (0..count * n_k).map(|at| ((receiver + at) as f32).sin() * 0.25).collect(),
            gains: vec![0.0; count],
        };
        (0..n_receivers).map(links).collect()
    }

    #[test]
    fn tiles_hold_every_link_of_every_receiver() {
        for (n_receivers, count, n_k) in [(0, 3, 1), (1, 0, 1), (200, 9, 1), (130, 40, 4), (5, 255, 1)] {
            let links = some(n_receivers, count, n_k);
            let near = near_tiles(&links.iter().collect::<Vec<_>>(), n_k);
            if count == 0 || n_receivers == 0 {
                assert_eq!(near, NearArrays::default());
                continue;
            }
            let (mut link, mut receiver, mut nodes) = (0, 0, &near.nodes[..]);
            for tile in &near.tiles {
                let of_tile;
                (of_tile, nodes) = nodes.split_at(tile.n_nodes as usize);
                assert!(of_tile.len() <= NEAR_NODES as usize);
                for _ in 0..tile.n_receivers {
                    let expected = &links[receiver];
                    let of_receiver = link..link + usize::from(near.counts[receiver]);
                    let found: Vec<u32> =
                        near.links[of_receiver.clone()].iter().map(|&at| of_tile[at as usize]).collect();
                    assert_eq!(found, expected.nodes);
                    for (at, &weight) in expected.weights.iter().enumerate() {
                        let scale = tile.scale;
                        let stored = quantize::near_weight(near.weights[of_receiver.start * n_k + at], scale);
                        // Its own rounding and that of a smaller one.
                        let allowed = 2.0 * ((scale * weight.abs()).sqrt() / 127.0 + scale / 254.0 / 254.0);
                        assert!((stored - weight).abs() <= allowed, "{stored} instead of {weight}");
                    }
                    for k in 0..n_k {
                        let stored = |link: usize| quantize::near_weight(near.weights[link * n_k + k], tile.scale);
                        let sum: f32 = of_receiver.clone().map(stored).sum();
                        let wanted: f32 = expected.weights.iter().skip(k).step_by(n_k).sum();
                        // The last weight's rounding is left: half of the widest step, 0.25 (2 / 127) / 2.
                        assert!((sum - wanted).abs() <= 2.1e-3, "{sum} instead of {wanted}");
                    }
                    (link, receiver) = (of_receiver.end, receiver + 1);
                }
            }
            assert_eq!((link, near.counts.len()), (n_receivers * count, n_receivers));
        }
    }
}
