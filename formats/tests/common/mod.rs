//! Consistent arrays for the tests of the file format.
#![allow(dead_code)]

use half::f16;
use localprt_formats::directions::{counter_hash, counter_uniform};
use localprt_formats::header::{ENTRY_BYTES, HEADER_BYTES};
use localprt_formats::{
    BakedArrays, BlockArrays, ClusterRecord, LEVEL_BLACK, LEVEL_SKY, Metadata, NearArrays, NearTile, Probe,
    TransportBlock, VolumeArrays, VolumeGrid,
};

/// Two probes, three receivers, one cluster, six rays, degree 1. All numbers are literals, so that every machine makes
/// the same bytes.
pub fn minimal() -> BakedArrays {
    // Y_0 and Y_1 of the six axis directions, times 4 pi / 6.
    let (y0, y1) = (0.590_817_9, 1.023_326_7);
    let f16s = |values: &[f32]| values.iter().map(|value| f16::from_f32(*value)).collect::<Vec<_>>();
    let cluster = |n_receivers, n_probes| ClusterRecord { n_receivers, n_probes, n_sky: 4, n_coefficients: 1 };
    let positions = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]];
    let mut block = TransportBlock::default();
    let projection = f16s(&[0.5, 0.25, 0.0, -0.125, 0.5, 0.25, 0.0, 0.125, 1.0, 0.5, 0.0, 0.0]);
    block.push(cluster(3, 2), &[0, 1], &projection, &f16s(&[1.0, 0.75, -0.5]));
    block.near = NearArrays {
        tiles: vec![tile(2, 2, 3, 0.5), tile(1, 0, 0, 0.25)],
        nodes: vec![13, 1 << 28 | 5],
        counts: vec![2, 1, 0],
        links: vec![0, 1, 1],
        weights: vec![127, 64, -32],
    };
    let grid = VolumeGrid { origin: [-0.5, 0.25, 0.0], spacing_m: 0.5, dims: [3, 2, 1], degree: 1 };
    let cells = [4, 1];
    let mut of_volume = TransportBlock::default();
    let projection = f16s(&[0.25, 0.0, 0.125, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let reconstruction = f16s(&[1.0, 0.0, 0.5, 0.0, 0.75, -0.25, 0.0, 0.0]);
    of_volume.push(cluster(2, 1), &[1], &projection, &reconstruction);
    BakedArrays {
        metadata: Metadata {
            tool_version: "0.1.0".into(),
            scene_path: "minimal.glb".into(),
            scene_hash: std::array::from_fn(|i| i as u8),
            lightmap_size: 4,
            direct_size: 8,
            probe_degree: 1,
            receiver_degree: 0,
            sky_degree: 1,
            n_rays: 6,
            bounds: [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]],
            options: "spacing = 1.0\n".into(),
        },
        probes: vec![
            Probe { position: [-0.5, 1.0, 0.0], support_radius_m: 2.0 },
            Probe { position: [0.5, 1.0, 0.0], support_radius_m: 2.5 },
        ],
        ray_dirs: vec![
            [1.0, 0.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, -1.0, 0.0],
        ],
        ray_sh: [[y0, 0.0, 0.0, y1], [y0, 0.0, 0.0, -y1], [y0, y1, 0.0, 0.0], [y0, -y1, 0.0, 0.0]]
            .into_iter()
            .chain([[y0, 0.0, y1, 0.0], [y0, 0.0, -y1, 0.0]])
            .flatten()
            .collect(),
        ray_uv: vec![0x8000_4000, 0, 0, 0xffff_ffff, 0x2000_1000, 0x0000_ffff, 0x1234_5678, 1, 2, 3, 4, 5],
        ray_level: vec![0, LEVEL_BLACK, LEVEL_SKY, 1, 2, 3, 0, 1, LEVEL_SKY, 1, 0, 2],
        ray_distance: f16s(&[1.5, 0.5, f32::INFINITY, 1.0, 1.0, 1.0, 0.5, 1.5, f32::INFINITY, 1.0, 0.0, 65504.0]),
        receiver_texel: vec![5, 6, 9],
        receiver_position: positions.to_vec(),
        receiver_normal: vec![[0.0, 1.0, 0.0]; 3],
        receiver_unseen: vec![0.0, 0.125, 1.0],
        blocks: BlockArrays::of_one(&block, &positions, 1),
        gutters: vec![[4, 0], [7, 1]],
        seams: vec![[0, 2]],
        volume: Some(VolumeArrays {
            grid,
            cells: cells.to_vec(),
            blocks: BlockArrays::of_one(&of_volume, &cells.map(|cell| grid.position(cell as usize)), grid.n_k()),
            fill: vec![[0, 1], [5, 4]],
        }),
        report: r#"{"receivers":3}"#.into(),
        plan: r#"{"version":1}"#.into(),
    }
}

fn tile(n_receivers: u32, n_nodes: u32, n_links: u32, scale: f32) -> NearTile {
    NearTile { n_receivers, n_nodes, n_links, scale }
}

/// Changes a block of the lightmap's transport and stores all blocks anew.
pub fn change_block(arrays: &mut BakedArrays, index: usize, change: impl FnOnce(&mut TransportBlock)) {
    let n_k = arrays.metadata.n_k();
    arrays.blocks = changed(&arrays.blocks, index, n_k, &arrays.receiver_position, change);
}

/// The same of the volume's transport.
pub fn change_volume_block(volume: &mut VolumeArrays, index: usize, change: impl FnOnce(&mut TransportBlock)) {
    let positions: Vec<_> = volume.cells.iter().map(|&cell| volume.grid.position(cell as usize)).collect();
    volume.blocks = changed(&volume.blocks, index, volume.grid.n_k(), &positions, change);
}

fn changed(
    blocks: &BlockArrays,
    index: usize,
    n_k: usize,
    positions: &[[f32; 3]],
    change: impl FnOnce(&mut TransportBlock),
) -> BlockArrays {
    let mut all: Vec<TransportBlock> =
        (0..blocks.records.len()).map(|at| blocks.view().to_block(at, n_k).expect("a sound block")).collect();
    let counts: Vec<usize> = blocks.records.iter().map(|record| record.n_receivers as usize).collect();
    change(&mut all[index]);
    let mut stored = BlockArrays::default();
    let mut first = 0;
    for (block, count) in all.iter().zip(counts) {
        stored.push(block, &positions[first..first + count], n_k);
        first += count;
    }
    stored
}

/// Sizes of generated arrays.
#[derive(Clone, Debug)]
pub struct Sizes {
    pub seed: u64,
    pub n_probes: u32,
    pub n_rays: u32,
    pub cluster_receivers: Vec<u32>,
    pub probe_degree: u32,
    pub receiver_degree: u32,
    pub sky_degree: u32,
    pub report: bool,
}

/// Consistent arrays with arbitrary numbers.
pub fn arrays(sizes: &Sizes) -> BakedArrays {
    let Sizes { seed, n_probes, n_rays, .. } = *sizes;
    let n_receivers: u32 = sizes.cluster_receivers.iter().sum();
    let direct_size = 1 << (counter_hash(seed, 1, 0) as u32 % 7);
    let metadata = Metadata {
        tool_version: "0.1.0".into(),
        scene_path: "../scenes/hall \u{fc}.glb".into(),
        scene_hash: std::array::from_fn(|i| counter_hash(seed, 2, i as u64) as u8),
        lightmap_size: 2 * (n_receivers + 4).isqrt(),
        direct_size,
        probe_degree: sizes.probe_degree,
        receiver_degree: sizes.receiver_degree,
        sky_degree: sizes.sky_degree,
        n_rays,
        bounds: [[-1.0, -2.0, -3.0], [4.0, 5.0, 6.0]],
        options: format!("seed = {seed}\n"),
    };
    let number = |stream: u64, i: usize| counter_uniform(seed, stream, i as u64) as f32 * 2.0 - 1.0;
    let point = |stream: u64, i: usize| [number(stream, 3 * i), number(stream, 3 * i + 1), number(stream, 3 * i + 2)];
    let unit = |stream: u64, i: usize| {
        localprt_formats::directions::spherical_fibonacci(counter_hash(seed, stream, i as u64) as u32 % 1000, 1000)
    };
    let lookups = (n_probes * n_rays) as usize;
    let texels: Vec<u32> = (0..n_receivers).map(|i| 2 * i).collect();
    let mut out = BakedArrays {
        probes: (0..n_probes as usize)
            .map(|i| Probe { position: point(3, i), support_radius_m: 0.5 + i as f32 })
            .collect(),
        ray_dirs: (0..n_rays as usize).map(|i| unit(4, i)).map(|[x, y, z]| [x, y, z, 0.0]).collect(),
        ray_sh: (0..n_rays as usize * metadata.n_sh()).map(|i| number(5, i)).collect(),
        ray_uv: (0..lookups).map(|i| counter_hash(seed, 6, i as u64) as u32).collect(),
        ray_level: (0..lookups)
            .map(|i| match counter_hash(seed, 7, i as u64) % 5 {
                0 => LEVEL_SKY,
                1 => LEVEL_BLACK,
                other => (other as u32 % (direct_size.ilog2() + 1)) as u8,
            })
            .collect(),
        ray_distance: (0..if sizes.report { lookups } else { 0 })
            .map(|i| if i % 7 == 3 { f16::INFINITY } else { f16::from_f32(number(13, i).abs()) })
            .collect(),
        receiver_position: (0..texels.len()).map(|i| point(8, i)).collect(),
        receiver_normal: (0..texels.len()).map(|i| unit(9, i)).collect(),
        receiver_unseen: (0..texels.len()).map(|i| number(10, i).abs()).collect(),
        gutters: texels.iter().take(3).enumerate().map(|(i, texel)| [texel + 1, i as u32]).collect(),
        seams: (1..n_receivers.min(4)).map(|i| [i - 1, i]).collect(),
        receiver_texel: texels,
        report: if sizes.report { format!(r#"{{"seed":{seed}}}"#) } else { String::new() },
        plan: if sizes.report { format!("[{seed}]") } else { String::new() },
        metadata,
        ..BakedArrays::default()
    };
    // Two clusters to a block. Every third file has near light.
    let n_k = out.metadata.n_k();
    out.blocks = blocks(sizes, &out.metadata, n_k, 0, &out.receiver_position, seed.is_multiple_of(3));
    // Every other file has a volume, with clusters of the same sizes.
    if seed.is_multiple_of(2) {
        let degree = 1 + (seed / 2 % 2) as u32;
        let grid = VolumeGrid { origin: point(14, 0), spacing_m: 0.25, dims: [3, n_receivers + 1, 2], degree };
        let cells: Vec<u32> = (0..n_receivers).map(|i| 2 * i + 1).collect();
        let positions: Vec<_> = cells.iter().map(|&cell| grid.position(cell as usize)).collect();
        let blocks = blocks(sizes, &out.metadata, grid.n_k(), 1000, &positions, false);
        let fill = if n_receivers > 0 { vec![[0, 1], [2, 1]] } else { Vec::new() };
        out.volume = Some(VolumeArrays { grid, cells, blocks, fill });
    }
    out
}

/// A tile for every receiver, some nodes in each, links to all of them.
fn near(seed: u64, metadata: &Metadata, receivers: std::ops::Range<u32>) -> NearArrays {
    let mut near = NearArrays::default();
    let n_k = metadata.n_k();
    for receiver in receivers {
        let count = counter_hash(seed, 20, receiver.into()) as u8 % 5;
        near.tiles.push(tile(1, count.into(), count.into(), 0.75));
        for link in 0..count {
            let place = u64::from(receiver) << 32 | near.nodes.len() as u64;
            let level = counter_hash(seed, 21, place) as u32 % (metadata.direct_size.ilog2() + 1);
            let texels = (metadata.direct_size >> level).pow(2);
            near.nodes.push(localprt_formats::node_at(level, counter_hash(seed, 22, place) as u32 % texels));
            near.links.push(link);
            near.weights.extend((0..n_k as u64).map(|k| counter_hash(seed, 23 + k, place) as i8));
        }
        near.counts.push(count);
    }
    near
}

/// Clusters of `sizes.cluster_receivers`, with their probes and matrices, two to a block.
fn blocks(
    sizes: &Sizes,
    metadata: &Metadata,
    n_k: usize,
    first_stream: u64,
    positions: &[[f32; 3]],
    has_near: bool,
) -> BlockArrays {
    let hash = |stream: u64, i: u64| counter_hash(sizes.seed, first_stream + stream, i);
    let values = |stream: u64, count: usize| -> Vec<f16> {
        let number = |i: usize| counter_uniform(sizes.seed, first_stream + stream, i as u64) * 2.0 - 1.0;
        (0..count).map(|i| f16::from_f64(number(i))).collect()
    };
    let mut stored = BlockArrays::default();
    let (mut number, mut first) = (0u64, 0);
    for of_block in sizes.cluster_receivers.chunks(2) {
        let mut block = TransportBlock::default();
        for &n_receivers in of_block {
            let listed = |probe: &u32| hash(100 + number, u64::from(*probe)).is_multiple_of(2);
            let probes: Vec<u32> = (0..sizes.n_probes).filter(listed).collect();
            let n_sky = if hash(11, number).is_multiple_of(2) { 0 } else { metadata.n_sky() as u32 };
            let n_coefficients = hash(12, number) as u32 % 4;
            let columns = probes.len() * metadata.n_sh() + n_sky as usize;
            let record = ClusterRecord { n_receivers, n_probes: probes.len() as u32, n_sky, n_coefficients };
            let projection = values(200 + number, n_coefficients as usize * columns);
            let reconstruction = values(300 + number, n_coefficients as usize * n_receivers as usize * n_k);
            block.push(record, &probes, &projection, &reconstruction);
            number += 1;
        }
        let end = first + block.n_receivers();
        if has_near {
            // None, where no receiver has a link.
            let near = near(sizes.seed, metadata, first as u32..end as u32);
            block.near = if near.links.is_empty() { NearArrays::default() } else { near };
        }
        stored.push(&block, &positions[first..end], n_k);
        first = end;
    }
    stored
}

/// Makes the header's checksum right again after a change to header or table.
pub fn seal(file: &mut [u8]) {
    let table_end = (HEADER_BYTES + n_sections(file) * ENTRY_BYTES).min(file.len());
    let checksum = crc32c::crc32c_append(crc32c::crc32c(&file[..60]), &file[HEADER_BYTES..table_end]);
    file[60..64].copy_from_slice(&checksum.to_le_bytes());
}

/// Makes every checksum and the content hash right again after a change anywhere.
pub fn seal_all(file: &mut [u8]) {
    let mut hasher = blake3::Hasher::new();
    for i in 0..n_sections(file) {
        let at = HEADER_BYTES + i * ENTRY_BYTES;
        let (offset, length) = (u64_at(file, at + 24) as usize, u64_at(file, at + 32) as usize);
        hasher.update(&file[offset..offset + length]);
        let checksum = crc32c::crc32c(&file[offset..offset + length]);
        file[at + 12..at + 16].copy_from_slice(&checksum.to_le_bytes());
    }
    hasher.update(&file[HEADER_BYTES..HEADER_BYTES + n_sections(file) * ENTRY_BYTES]);
    let hash = *hasher.finalize().as_bytes();
    file[24..56].copy_from_slice(&hash);
    seal(file);
}

pub fn n_sections(file: &[u8]) -> usize {
    u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize
}

pub fn u64_at(file: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(file[at..at + 8].try_into().unwrap())
}

/// Start of a section's entry in the table.
pub fn entry(file: &[u8], kind: &[u8; 4]) -> usize {
    let at = |i: usize| HEADER_BYTES + i * ENTRY_BYTES;
    (0..n_sections(file)).map(at).find(|at| file[*at..at + 4] == *kind).expect("section is present")
}

/// Start of a section's payload.
pub fn payload(file: &[u8], kind: &[u8; 4]) -> usize {
    u64_at(file, entry(file, kind) + 24) as usize
}
