//! Small baked files made by hand for tests.

use crate::coverage_map::CoverageMap;
use crate::passes::lightmap_mips::{level_sizes, lightmap_mips};
use glam::Vec3;
use half::f16;
use localprt_formats::directions::{counter_hash, counter_uniform, spherical_fibonacci};
use localprt_formats::sh::{Basis, function_count};
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, NEAR_NODES, NEAR_TILE, NearArrays, NearTile, Probe, TransportBlock,
    VolumeArrays, VolumeGrid, node_at,
};

/// Relight rays of the bakes here.
pub const N_RAYS: u32 = 1000;

/// Rays and maps only: `n_probes` probes whose rays read level 0 of a `direct_size` map at the given uv.
pub fn rays(n_probes: usize, probe_degree: u32, direct_size: u32, uv: impl Fn(Vec3) -> [f32; 2]) -> BakedArrays {
    let mut arrays = BakedArrays::default();
    let n_sh = function_count(probe_degree);
    arrays.metadata.n_rays = N_RAYS;
    arrays.metadata.probe_degree = probe_degree;
    arrays.metadata.direct_size = direct_size;
    arrays.metadata.lightmap_size = 4;
    arrays.probes = vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }; n_probes];
    let basis = Basis::new(probe_degree);
    let mut values = vec![0.0; n_sh];
    for ray in 0..N_RAYS {
        let direction = spherical_fibonacci(ray, N_RAYS);
        basis.evaluate(direction, &mut values);
        arrays.ray_dirs.push([direction[0], direction[1], direction[2], 0.0]);
        arrays.ray_sh.extend(values.iter().map(|value| value * (4.0 * std::f32::consts::PI / N_RAYS as f32)));
    }
    for _ in 0..n_probes {
        arrays.ray_uv.extend(arrays.ray_dirs.iter().map(|d| pack_uv(uv(Vec3::new(d[0], d[1], d[2])))));
    }
    arrays.ray_level = vec![0; n_probes * N_RAYS as usize];
    // From 1 to 4 metres, and every eleventh ray out of the scene.
    arrays.ray_distance = (0..n_probes as u64 * u64::from(N_RAYS))
        .map(|ray| match ray % 11 {
            0 => f16::INFINITY,
            _ => f16::from_f64(1.0 + 3.0 * counter_uniform(9, 0, ray)),
        })
        .collect();
    arrays
}

/// Two unorm16, u low.
pub fn pack_uv([u, v]: [f32; 2]) -> u32 {
    ((u * 65535.0).round() as u32) | (((v * 65535.0).round() as u32) << 16)
}

/// A closed box: two probes see covered surface everywhere, the 16 receivers of a 4 x 4 map get the mean of both.
///
/// The direct map has 8 x 8 texels, rays read levels 0 to 3. The transport of irradiance from a constant radiance is
/// [`furnace_gain`] times pi.
pub fn furnace(probe_degree: u32) -> BakedArrays {
    let mut arrays = rays(2, probe_degree, 8, |d| [0.5 * d.x + 0.5, 0.5 * d.y + 0.5]);
    arrays.ray_level.iter_mut().enumerate().for_each(|(ray, level)| *level = (ray % 4) as u8);
    let n_sh = function_count(probe_degree);
    let mut projection = vec![f16::ZERO; 2 * n_sh];
    projection[0] = furnace_weight();
    projection[n_sh] = furnace_weight();
    arrays.receiver_texel = (0..16).collect();
    arrays.receiver_position = vec![[0.0; 3]; 16];
    arrays.receiver_normal = vec![[0.0, 1.0, 0.0]; 16];
    arrays.receiver_unseen = vec![0.0; 16];
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 16, n_probes: 2, n_sky: 0, n_coefficients: 1 };
    block.push(record, &[0, 1], &projection, &[f16::ONE; 16]);
    arrays.blocks = BlockArrays::of_one(&block, &arrays.receiver_position, 1);
    arrays
}

/// The blocks of a file, owned.
pub fn blocks(arrays: &BakedArrays) -> Vec<TransportBlock> {
    let view = arrays.blocks.view();
    (0..view.records.len()).map(|block| view.to_block(block, arrays.metadata.n_k()).unwrap()).collect()
}

/// Stores blocks in place of those of the file.
pub fn set_blocks(arrays: &mut BakedArrays, blocks: &[TransportBlock]) {
    arrays.blocks = BlockArrays::default();
    let mut first = 0;
    for block in blocks {
        let end = first + block.n_receivers();
        arrays.blocks.push(block, &arrays.receiver_position[first..end], arrays.metadata.n_k());
        first = end;
    }
}

/// Changes the first block of a file.
pub fn change_block(arrays: &mut BakedArrays, change: impl FnOnce(&mut TransportBlock)) {
    let mut all = blocks(arrays);
    change(&mut all[0]);
    set_blocks(arrays, &all);
}

/// The same file with near light: some links for every receiver, to any node.
pub fn with_near(mut arrays: BakedArrays) -> BakedArrays {
    let n_k = arrays.metadata.n_k();
    let sizes = level_sizes(arrays.metadata.direct_size);
    let random = |stream: u64, i: usize| counter_hash(77, stream, i as u64) as u32;
    let mut all = blocks(&arrays);
    let (mut receiver, mut n_links, mut n_all_nodes) = (0, 0, 0);
    for block in &mut all {
        let end = receiver + block.n_receivers();
        let mut near = NearArrays::default();
        while receiver < end {
            let in_tile = (1 + random(0, receiver) as usize % NEAR_TILE as usize).min(end - receiver);
            let n_nodes = 1 + random(1, receiver) % NEAR_NODES;
            for _ in 0..n_nodes {
                let level = random(2, n_all_nodes) % sizes.len() as u32;
                let size = sizes[level as usize];
                near.nodes.push(node_at(level, random(3, n_all_nodes) % (size * size)));
                n_all_nodes += 1;
            }
            let first = near.links.len();
            for _ in 0..in_tile {
                let count = random(4, receiver) % 6;
                near.counts.push(count as u8);
                for _ in 0..count {
                    near.weights.extend((0..n_k).map(|k| random(5, n_links * n_k + k) as i8));
                    near.links.push((random(6, n_links) % n_nodes) as u8);
                    n_links += 1;
                }
                receiver += 1;
            }
            let in_links = (near.links.len() - first) as u32;
            near.tiles.push(NearTile { n_receivers: in_tile as u32, n_nodes, n_links: in_links, scale: 0.5 });
        }
        block.near = if near.links.is_empty() { NearArrays::default() } else { near };
    }
    // Some blocks have none.
    if let [first, _, ..] = &mut all[..] {
        first.near = NearArrays::default();
    }
    set_blocks(&mut arrays, &all);
    arrays
}

/// Levels of a light map of arbitrary colors, some of them uncovered.
pub fn light_map(size: u32) -> Vec<CoverageMap> {
    let mut levels: Vec<CoverageMap> = level_sizes(size).into_iter().map(CoverageMap::uncovered).collect();
    for (i, texel) in levels[0].texels_mut().iter_mut().enumerate() {
        if !counter_hash(78, 0, i as u64).is_multiple_of(4) {
            *texel = Vec3::from([0, 1, 2].map(|band| counter_uniform(79, band, i as u64) as f32)).extend(1.0);
        }
    }
    lightmap_mips(&mut levels);
    levels
}

/// The furnace with a volume of 2 x 2 x 2 cells, a metre apart: cells 1 to 6 get the mean radiance of both probes and, in
/// the function 3 (x), `0.25 * cell` times it; cell 0 takes the values of cell 4; cell 7 holds nothing.
///
/// The factor is `f16(1 / 2) + f16(1 / 2) = 1`, exactly.
pub fn furnace_volume(probe_degree: u32, degree: u32) -> BakedArrays {
    let mut arrays = furnace(probe_degree);
    let (n_sh, n_k) = (function_count(probe_degree), function_count(degree));
    let cells = vec![2u32, 1, 6, 3, 4, 5];
    let mut projection = vec![f16::ZERO; 2 * n_sh];
    projection[0] = f16::from_f32(0.5);
    projection[n_sh] = f16::from_f32(0.5);
    let mut reconstruction = vec![f16::ZERO; cells.len() * n_k];
    for (row, &cell) in reconstruction.chunks_exact_mut(n_k).zip(&cells) {
        row[0] = f16::ONE;
        row[3] = f16::from_f32(0.25 * cell as f32);
    }
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 6, n_probes: 2, n_sky: 0, n_coefficients: 1 };
    block.push(record, &[0, 1], &projection, &reconstruction);
    let grid = VolumeGrid { origin: [-1.0, 0.0, 1.0], spacing_m: 1.0, dims: [2, 2, 2], degree };
    arrays.volume = Some(volume(grid, cells, &block, vec![[0, 4]]));
    arrays
}

/// A volume of one block.
pub fn volume(grid: VolumeGrid, cells: Vec<u32>, block: &TransportBlock, fill: Vec<[u32; 2]>) -> VolumeArrays {
    let positions: Vec<_> = cells.iter().map(|&cell| grid.position(cell as usize)).collect();
    VolumeArrays { grid, blocks: BlockArrays::of_one(block, &positions, grid.n_k()), cells, fill }
}

/// Half of `pi / (sqrt(4 pi))`, rounded to f16: two probes with `lambda_00 = sqrt(4 pi) L` give `pi L`.
fn furnace_weight() -> f16 {
    f16::from_f64(std::f64::consts::PI.sqrt() / 4.0)
}

/// How much of the light comes back in the furnace: 1 but for the rounding of [`furnace_weight`].
pub fn furnace_gain() -> f64 {
    f64::from(furnace_weight()) * 4.0 / std::f64::consts::PI.sqrt()
}

/// A bake of random weights: several clusters of odd sizes with and without sky, one that sees nothing, in two blocks.
pub fn random(probe_degree: u32, receiver_degree: u32, sky_degree: u32) -> BakedArrays {
    let mut arrays = rays(5, probe_degree, 8, |d| [0.5 * d.x + 0.5, 0.5 * d.z + 0.5]);
    arrays.metadata.receiver_degree = receiver_degree;
    arrays.metadata.sky_degree = sky_degree;
    let (n_sh, n_k, n_sky) = (arrays.metadata.n_sh(), arrays.metadata.n_k(), arrays.metadata.n_sky() as u32);
    let mut counter = 0;
    let mut weights = |len: usize| -> Vec<f16> {
        let first = counter;
        counter += len as u64;
        (first..counter).map(|at| f16::from_f64(counter_uniform(7, 0, at + 1) - 0.5)).collect()
    };
    let mut blocks = vec![TransportBlock::default(); 2];
    for (block, n_receivers, probes, n_sky, n_coefficients) in
        [(0, 3u32, &[0u32, 2, 4][..], n_sky, 3u32), (0, 2, &[], 0, 0), (1, 5, &[1], 0, 1), (1, 1, &[], n_sky, 2)]
    {
        let n_columns = probes.len() * n_sh + n_sky as usize;
        let record = ClusterRecord { n_receivers, n_probes: probes.len() as u32, n_sky, n_coefficients };
        let projection = weights(n_coefficients as usize * n_columns);
        let reconstruction = weights(n_receivers as usize * n_k * n_coefficients as usize);
        blocks[block].push(record, probes, &projection, &reconstruction);
    }
    let n_receivers = 11;
    arrays.receiver_texel = (0..n_receivers).collect();
    arrays.receiver_normal = (0..n_receivers).map(|receiver| spherical_fibonacci(receiver, n_receivers)).collect();
    arrays.receiver_position = vec![[0.0; 3]; n_receivers as usize];
    arrays.receiver_unseen = vec![0.0; n_receivers as usize];
    arrays.gutters = vec![[13, 0], [14, 4]];
    set_blocks(&mut arrays, &blocks);
    arrays
}

/// Repeatable colors in -0.5..0.5.
pub fn random_colors(stream: u64, n: usize) -> Vec<Vec3> {
    let random = |counter: u64| counter_uniform(counter_hash(3, stream, 0), 1, counter) as f32 - 0.5;
    (0..n as u64).map(|i| Vec3::new(random(3 * i), random(3 * i + 1), random(3 * i + 2))).collect()
}
