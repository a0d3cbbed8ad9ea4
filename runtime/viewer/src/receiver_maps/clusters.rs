//! Colors of clusters, in which neighbors differ.

use localprt_formats::{Checked, directions::counter_hash};

/// Colors that are told apart easily, after Trubetskoy 2017, "List of 20 Simple, Distinct Colors". Neither white nor black.
pub(super) const PALETTE: [[u8; 3]; 16] = [
    [230, 25, 75],
    [60, 180, 75],
    [255, 225, 25],
    [0, 130, 200],
    [245, 130, 48],
    [145, 30, 180],
    [70, 240, 240],
    [240, 50, 230],
    [210, 245, 60],
    [250, 190, 212],
    [0, 128, 128],
    [220, 190, 255],
    [170, 110, 40],
    [128, 0, 0],
    [170, 255, 195],
    [128, 128, 0],
];
const SEED: u64 = 9;

/// Cluster of each receiver.
pub(super) fn of_receivers(baked: &Checked<'_>) -> Vec<u32> {
    let mut of_receiver = vec![u32::MAX; baked.view().receiver_texel.len()];
    for (index, cluster) in baked.transport().clusters.iter().enumerate() {
        of_receiver[cluster.receivers.clone()].fill(index as u32);
    }
    of_receiver
}

/// `[n_clusters]`: the same for the same file. Clusters whose texels touch, or that meet at a seam, have different colors
/// as long as they do not have neighbors in all of them.
pub(super) fn colors(baked: &Checked<'_>) -> Vec<[u8; 3]> {
    let pairs = neighbors(baked);
    let mut chosen: Vec<usize> = Vec::with_capacity(baked.transport().clusters.len());
    for cluster in 0..baked.transport().clusters.len() {
        let first = pairs.partition_point(|&[from, _]| (from as usize) < cluster);
        let around = pairs[first..].iter().take_while(|&&[from, _]| from as usize == cluster);
        let taken: Vec<usize> = around.filter_map(|&[_, to]| chosen.get(to as usize).copied()).collect();
        let start = counter_hash(SEED, cluster as u64, 0) as usize % PALETTE.len();
        let mut candidates = (0..PALETTE.len()).map(|step| (start + step) % PALETTE.len());
        chosen.push(candidates.find(|color| !taken.contains(color)).unwrap_or(start));
    }
    chosen.into_iter().map(|color| PALETTE[color]).collect()
}

/// Pairs of clusters side by side, in both orders, sorted.
fn neighbors(baked: &Checked<'_>) -> Vec<[u32; 2]> {
    let size = baked.view().metadata.lightmap_size as usize;
    let of_receiver = of_receivers(baked);
    let mut at_texel = vec![u32::MAX; size * size];
    for (&texel, &cluster) in baked.view().receiver_texel.iter().zip(&of_receiver) {
        if let Some(slot) = at_texel.get_mut(texel as usize) {
            *slot = cluster;
        }
    }
    let cluster = |receiver: u32| of_receiver.get(receiver as usize).copied().unwrap_or(u32::MAX);
    let mut pairs: Vec<[u32; 2]> = baked.view().seams.iter().map(|pair| pair.map(cluster)).collect();
    for row in at_texel.chunks_exact(size.max(1)) {
        pairs.extend(row.windows(2).map(|pair| [pair[0], pair[1]]));
    }
    pairs.extend(at_texel.iter().zip(at_texel.iter().skip(size)).map(|(&above, &below)| [above, below]));
    pairs.retain(|&[a, b]| a != b && a != u32::MAX && b != u32::MAX);
    pairs.sort_unstable();
    pairs.dedup();
    let turned: Vec<[u32; 2]> = pairs.iter().map(|&[a, b]| [b, a]).collect();
    pairs.extend(turned);
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
