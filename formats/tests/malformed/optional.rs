//! Rules 70 to 77 and 81 to 86: what some files have, a volume and near light.

use super::*;

#[test]
fn volume_rules_refuse() {
    let volume = |change: &dyn Fn(&mut VolumeArrays)| invariant(|arrays| change(arrays.volume.as_mut().unwrap()));
    for spacing in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX] {
        assert_eq!(volume(&|volume| volume.grid.spacing_m = spacing), 71);
    }
    assert_eq!(volume(&|volume| volume.grid.origin[2] = f32::NAN), 71);
    for dims in [[0, 2, 3], [1 << 22, 2, 1], [1 << 8, 1 << 8, 65], [1 << 31, 1 << 31, 4]] {
        assert_eq!(volume(&|volume| volume.grid.dims = dims), 72);
    }
    for degree in [0, 3, u32::MAX] {
        assert_eq!(volume(&|volume| volume.grid.degree = degree), 73);
    }
    assert_eq!(volume(&|volume| volume.cells[0] = 6), 74);
    assert_eq!(volume(&|volume| volume.cells[0] = 1), 74);
    // Blocks obey the rules of the lightmap's.
    assert_eq!(volume(&|volume| volume.cells.truncate(1)), 50);
    assert_eq!(volume(&|volume| volume.blocks.records.clear()), 50);
    assert_eq!(volume(&|volume| volume.blocks.data.clear()), 51);
    assert_eq!(volume(&|volume| volume.grid.origin[0] = 0.0), 52);
    assert_eq!(volume(&|volume| volume.blocks.records[0].reserved[0] = 1), 53);
    let block = |change: &dyn Fn(&mut TransportBlock)| volume(&|volume| change_volume_block(volume, 0, change));
    assert_eq!(block(&|block| block.clusters[0].n_receivers = 3), 55);
    assert_eq!(block(&|block| block.clusters[0].n_probes = 2), 56);
    assert_eq!(block(&|block| block.cluster_probes[0] = 2), 56);
    assert_eq!(block(&|block| block.clusters[0].n_sky = 3), 57);
    assert_eq!(block(&|block| block.projection.truncate(6)), 58);
    // Degree 2 needs nine rows a receiver.
    assert_eq!(volume(&|volume| volume.grid.degree = 2), 58);
    assert_eq!(block(&|block| block.reconstruction[0] = half::f16::NAN), 59);
    let tile = NearTile { n_receivers: 2, n_nodes: 1, n_links: 1, scale: 1.0 };
    let near =
        NearArrays { tiles: vec![tile], nodes: vec![0], counts: vec![1, 0], links: vec![0], weights: vec![0; 4] };
    assert_eq!(block(&|block| block.near = near.clone()), 77);
    assert_eq!(volume(&|volume| volume.blocks.records[0].checksum ^= 1), 88);
    assert_eq!(volume(&|volume| volume.blocks.records[0].hash[0] ^= 1), 89);
    for fill in [[6, 1], [0, 6], [0, 2], [0, 0], [0, u32::MAX], [u32::MAX, 1]] {
        assert_eq!(volume(&|volume| volume.fill[0] = fill), 75, "{fill:?}");
    }
    for fill in [[5, 1], [1, 4]] {
        assert_eq!(volume(&|volume| volume.fill[0] = fill), 76, "{fill:?}");
    }
    assert_eq!(refused_payload(b"VOLU", 12, &0f32.to_le_bytes()), 71);
    assert_eq!(refused_payload(b"VOLU", 16, &0u32.to_le_bytes()), 72);
    assert_eq!(refused_payload(b"VOLU", 28, &9u32.to_le_bytes()), 73);
    assert_eq!(refused_payload(b"VCEL", 0, &9u32.to_le_bytes()), 74);
    assert_eq!(refused_payload(b"VBLK", 0, &3u32.to_le_bytes()), 50);
    assert_eq!(refused_payload(b"VDAT", 16, &2u32.to_le_bytes()), 56);
    assert_eq!(refused_payload(b"VFIL", 4, &2u32.to_le_bytes()), 75);
    assert_eq!(refused_payload(b"VFIL", 0, &1u32.to_le_bytes()), 76);
}

#[test]
fn a_volume_is_whole_or_absent() {
    let change = |kind: &'static [u8; 4], at: usize, bytes: &'static [u8]| {
        let mut file = sound();
        let at = entry(&file, kind) + at;
        put(&mut file, at, bytes);
        seal_all(&mut file);
        file
    };
    for kind in [b"VOLU", b"VCEL", b"VBLK", b"VDAT", b"VFIL"] {
        // One section under another name is one that is missing.
        assert_eq!(refused(change(kind, 0, b"NEW1")), 70);
        // One of a later version is skipped, and the others with it.
        let file = change(kind, 4, &[2]);
        assert_eq!(check_bytes(&file), []);
        assert!(Baked::from_bytes(file).unwrap().view().volume.is_none());
    }
    // A table whose first and last entry swap their payloads: VOLU without an element.
    let mut arrays = minimal();
    arrays.volume.as_mut().unwrap().fill.clear();
    let mut file = to_bytes(&arrays).unwrap();
    let (grid, fill) = (entry(&file, b"VOLU"), entry(&file, b"VFIL"));
    put(&mut file, grid, b"VFIL");
    put(&mut file, grid + 10, &[2, 0]);
    put(&mut file, grid + 16, &[4]);
    put(&mut file, fill, b"VOLU");
    put(&mut file, fill + 10, &[8, 0]);
    seal_all(&mut file);
    assert_eq!(refused(file), 70);
}

#[test]
fn near_light_rules_refuse() {
    let tile = |n_receivers, n_nodes, n_links| NearTile { n_receivers, n_nodes, n_links, scale: 1.0 };
    let near =
        |change: &dyn Fn(&mut NearArrays)| invariant(|arrays| change_block(arrays, 0, |block| change(&mut block.near)));
    let without_tiles = |near: &mut NearArrays| (near.tiles.clear(), near.counts.clear());
    assert_eq!(near(&|near| without_tiles(near).0), 54);
    // Tiles of receivers without a link.
    let empty = NearArrays { tiles: vec![tile(3, 0, 0)], counts: vec![0; 3], ..NearArrays::default() };
    assert_eq!(near(&|near| *near = empty.clone()), 54);
    // A tile without receivers, one with more than there are, and one too few.
    assert_eq!(near(&|near| near.tiles[1].n_receivers = 0), 81);
    assert_eq!(near(&|near| near.tiles[1].n_receivers = 2), 81);
    assert_eq!(near(&|near| near.tiles.truncate(1)), 81);
    assert_eq!(near(&|near| near.tiles[1].n_nodes = 1), 82);
    assert_eq!(near(&|near| near.nodes.push(0)), 82);
    let more = |near: &mut NearArrays, nodes: u32| {
        near.nodes.resize(2 + nodes as usize, 0);
        near.tiles[1].n_nodes += nodes;
    };
    assert_eq!(near(&|near| more(near, 257)), 82);
    assert_eq!(near(&|near| near.counts[0] = 1), 83);
    assert_eq!(near(&|near| near.tiles[0].n_links = 2), 83);
    assert_eq!(near(&|near| (near.links.push(0), near.weights.push(0)).0), 83);
    for scale in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(near(&|near| near.tiles[0].scale = scale), 84);
    }
    // Level 4 of a map of 8 texels, and texels beyond their level.
    for node in [4 << 28, 64, 1 << 28 | 16, u32::MAX] {
        assert_eq!(near(&|near| near.nodes[0] = node), 85);
    }
    assert_eq!(near(&|near| near.links[0] = 2), 86);
    // Behind cluster, probes and matrices, 56 bytes: two tiles, two nodes, three counts and three links.
    assert_eq!(refused_payload(b"BDAT", 56, &9u32.to_le_bytes()), 81);
    assert_eq!(refused_payload(b"BDAT", 68, &f32::NAN.to_le_bytes()), 84);
    assert_eq!(refused_payload(b"BDAT", 88, &u32::MAX.to_le_bytes()), 85);
    assert_eq!(refused_payload(b"BDAT", 96, &[9]), 83);
    assert_eq!(refused_payload(b"BDAT", 100, &[255]), 86);
    // More receivers than a tile may have.
    let mut arrays = common::arrays(&common::Sizes {
        seed: 1,
        n_probes: 1,
        n_rays: 1,
        cluster_receivers: vec![65],
        probe_degree: 0,
        receiver_degree: 0,
        sky_degree: 0,
        report: false,
    });
    let tiles = vec![tile(65, 1, 1)];
    change_block(&mut arrays, 0, |block| {
        let (links, weights, nodes) = (vec![0], vec![0], vec![0]);
        let counts = (0..65).map(|receiver| u8::from(receiver == 0)).collect();
        block.near = NearArrays { tiles, nodes, counts, links, weights };
    });
    assert!(matches!(to_bytes(&arrays), Err(WriteError::Invalid(violation)) if violation.rule == 81));
}
