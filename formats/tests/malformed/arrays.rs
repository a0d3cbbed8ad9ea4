//! Rules 30 to 62: metadata, and the arrays that every file has.

use super::*;

#[test]
fn metadata_rules_refuse() {
    assert_eq!(refused_payload(b"META", 0, &u64::MAX.to_le_bytes()), 30);
    assert_eq!(refused_payload(b"META", 8, &[0xff]), 30);
    for degree in [11, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.metadata.probe_degree = degree), 31);
        assert_eq!(invariant(|arrays| arrays.metadata.sky_degree = degree), 31);
    }
    assert_eq!(invariant(|arrays| arrays.metadata.receiver_degree = 2), 31);
    assert_eq!(invariant(|arrays| arrays.metadata.direct_size = 12), 32);
    for size in [0, 16385, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.metadata.lightmap_size = size), 32);
        assert_eq!(invariant(|arrays| arrays.metadata.direct_size = size), 32);
    }
    assert_eq!(invariant(|arrays| arrays.metadata.n_rays = 0), 33);
    assert_eq!(invariant(|arrays| arrays.metadata.n_rays = u32::MAX), 33);
    assert_eq!(invariant(|arrays| arrays.metadata.bounds[0][1] = f32::NAN), 34);
    assert_eq!(invariant(|arrays| arrays.metadata.bounds[1][2] = f32::INFINITY), 34);
    assert_eq!(invariant(|arrays| arrays.metadata.bounds[0][0] = 1.5), 34);
    for path in ["/etc/passwd", "C:\\a.glb", "c:a.glb", "a\\b.glb", "a\0b", "\\\\server\\a.glb"] {
        assert_eq!(invariant(|arrays| arrays.metadata.scene_path = path.into()), 35, "{path:?}");
    }
    for path in ["", "../scenes/a.glb", "builtin:cornell", "a b/\u{fc}.glb"] {
        let mut arrays = minimal();
        arrays.metadata.scene_path = path.into();
        assert!(to_bytes(&arrays).is_ok(), "{path:?}");
    }
}

#[test]
fn lengths_must_agree() {
    assert_eq!(invariant(|arrays| arrays.metadata.n_rays = 5), 40);
    assert_eq!(invariant(|arrays| arrays.metadata.probe_degree = 2), 40);
    assert_eq!(invariant(|arrays| arrays.probes.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.ray_dirs.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.ray_sh.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.ray_uv.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.ray_level.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.ray_distance.truncate(11)), 40);
    assert_eq!(invariant(|arrays| arrays.receiver_texel.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.receiver_position.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.receiver_normal.truncate(1)), 40);
    assert_eq!(invariant(|arrays| arrays.receiver_unseen.truncate(1)), 40);
}

#[test]
fn probe_and_ray_rules_refuse() {
    assert_eq!(invariant(|arrays| arrays.probes[1].position[2] = f32::NAN), 41);
    for radius in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        assert_eq!(invariant(|arrays| arrays.probes[0].support_radius_m = radius), 41);
    }
    for direction in [[0.0; 4], [1.01, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0], [f32::NAN, 1.0, 0.0, 0.0]] {
        assert_eq!(invariant(|arrays| arrays.ray_dirs[5] = direction), 42);
    }
    assert_eq!(invariant(|arrays| arrays.ray_sh[23] = f32::NEG_INFINITY), 43);
    // A map of 8 x 8 texels has the levels 0 to 3.
    for level in [4, 15, 16, 253] {
        assert_eq!(invariant(|arrays| arrays.ray_level[11] = level), 44);
    }
    for distance in [-0.0, -1.0, f32::NEG_INFINITY, f32::NAN, -f32::NAN] {
        assert_eq!(invariant(|arrays| arrays.ray_distance[7] = half::f16::from_f32(distance)), 49, "{distance}");
    }
    assert_eq!(refused_payload(b"PROB", 0, &f32::NAN.to_le_bytes()), 41);
    assert_eq!(refused_payload(b"RDIR", 0, &2f32.to_le_bytes()), 42);
    assert_eq!(refused_payload(b"RASH", 0, &f32::INFINITY.to_le_bytes()), 43);
    assert_eq!(refused_payload(b"RALV", 11, &[200]), 44);
    assert_eq!(refused_payload(b"RADS", 22, &half::f16::NAN.to_le_bytes()), 49);
}

#[test]
fn receiver_rules_refuse() {
    assert_eq!(invariant(|arrays| arrays.receiver_texel[0] = 16), 45);
    assert_eq!(invariant(|arrays| arrays.receiver_texel[0] = 9), 45);
    assert_eq!(invariant(|arrays| arrays.receiver_position[2][0] = f32::INFINITY), 46);
    assert_eq!(invariant(|arrays| arrays.receiver_normal[2] = [0.0; 3]), 47);
    for unseen in [-0.001, 1.001, f32::NAN] {
        assert_eq!(invariant(|arrays| arrays.receiver_unseen[1] = unseen), 48);
    }
    assert_eq!(refused_payload(b"RTEX", 8, &u32::MAX.to_le_bytes()), 45);
    assert_eq!(refused_payload(b"RPOS", 0, &f32::NAN.to_le_bytes()), 46);
    assert_eq!(refused_payload(b"RNRM", 0, &f32::MAX.to_le_bytes()), 47);
    assert_eq!(refused_payload(b"RUNS", 0, &2f32.to_le_bytes()), 48);
}

#[test]
fn block_table_rules_refuse() {
    let record = |change: &dyn Fn(&mut BlockRecord)| invariant(|arrays| change(&mut arrays.blocks.records[0]));
    for count in [0, 4, u32::MAX] {
        assert_eq!(record(&|block| block.n_receivers = count), 50);
    }
    assert_eq!(invariant(|arrays| arrays.blocks = BlockArrays::default()), 50);
    assert_eq!(invariant(|arrays| arrays.blocks.records.push(arrays.blocks.records[0])), 50);
    assert_eq!(record(&|block| block.n_receivers = 2), 52);
    for offset in [[256, 0], [0, 1], [1, 0], [u32::MAX; 2]] {
        assert_eq!(record(&|block| block.offset = offset), 51);
    }
    assert_eq!(record(&|block| block.n_clusters = u32::MAX), 51);
    assert_eq!(record(&|block| block.projection_pairs += 64), 51);
    assert_eq!(record(&|block| block.reconstruction_pairs = u32::MAX), 51);
    assert_eq!(record(&|block| block.n_cluster_probes = u32::MAX), 51);
    assert_eq!(record(&|block| block.n_links = u32::MAX), 51);
    assert_eq!(invariant(|arrays| arrays.blocks.data.truncate(63)), 51);
    assert_eq!(invariant(|arrays| arrays.blocks.data.push(0)), 51);
    assert_eq!(invariant(|arrays| arrays.blocks.data.extend([0; 64])), 51);
    assert_eq!(record(&|block| block.bounds[1][2] = 0.25), 52);
    assert_eq!(record(&|block| block.bounds[0][0] = f32::NAN), 52);
    assert_eq!(record(&|block| block.reserved[5] = 1), 53);
    assert_eq!(record(&|block| block.n_tiles = 0), 54);
    // More than there are receivers, though there are bytes for them.
    assert_eq!(record(&|block| block.n_clusters = 4), 55);
    assert_eq!(record(&|block| block.n_tiles = 4), 81);
    assert_eq!(record(&|block| block.checksum ^= 1), 88);
    assert_eq!(record(&|block| block.hash[31] ^= 1), 89);
    assert_eq!(refused_payload(b"BLOK", 0, &u32::MAX.to_le_bytes()), 50);
    assert_eq!(refused_payload(b"BLOK", 40, &4u32.to_le_bytes()), 51);
    assert_eq!(refused_payload(b"BLOK", 4, &u32::MAX.to_le_bytes()), 51);
    assert_eq!(refused_payload(b"BLOK", 48, &9f32.to_le_bytes()), 52);
    assert_eq!(refused_payload(b"BLOK", 124, &[1]), 53);
}

/// Opening leaves what is in blocks unread; it is refused when a block is first used, and by `check`.
#[test]
fn blocks_are_checked_when_they_are_used() {
    let mut file = sound();
    let at = payload(&file, b"BDAT");
    put(&mut file, at, &u32::MAX.to_le_bytes());
    seal_all(&mut file);
    let baked = Baked::from_bytes(file.clone()).unwrap();
    assert_eq!(baked.checked().unwrap_err().rule(), Some(55));
    assert_eq!(baked.block(0).unwrap_err().rule(), Some(55));
    assert!(check_bytes(&file).iter().any(|violation| violation.rule == 55));
    // Sound numbers that are not those of the checksum: only `check` reads it.
    let mut file = sound();
    put(&mut file, at + 24, &half::f16::ONE.to_le_bytes());
    seal_all(&mut file);
    assert!(Baked::from_bytes(file.clone()).unwrap().checked().is_ok());
    assert_eq!(check_bytes(&file).iter().map(|violation| violation.rule).collect::<Vec<_>>(), [88]);
}

#[test]
fn cluster_rules_refuse() {
    let block = |change: &dyn Fn(&mut TransportBlock)| invariant(|arrays| change_block(arrays, 0, change));
    let cluster = |change: &dyn Fn(&mut ClusterRecord)| block(&|block| change(&mut block.clusters[0]));
    for count in [0, 2, 4, u32::MAX] {
        assert_eq!(cluster(&|cluster| cluster.n_receivers = count), 55, "{count}");
    }
    assert_eq!(block(&|block| block.clusters.clear()), 55);
    assert_eq!(block(&|block| block.clusters.push(block.clusters[0])), 55);
    for count in [3, u32::MAX] {
        assert_eq!(cluster(&|cluster| cluster.n_probes = count), 56);
    }
    assert_eq!(block(&|block| block.cluster_probes.push(1)), 56);
    for probes in [[1, 0], [1, 1], [0, 2], [0, u32::MAX]] {
        assert_eq!(block(&|block| block.cluster_probes = probes.to_vec()), 56);
    }
    for count in [1, 3, 5, u32::MAX] {
        assert_eq!(cluster(&|cluster| cluster.n_sky = count), 57);
    }
    for count in [256, u32::MAX] {
        assert_eq!(cluster(&|cluster| cluster.n_coefficients = count), 57);
    }
    assert_eq!(invariant(|arrays| arrays.blocks.records[0].n_lights = 2), 57);
    assert_eq!(block(&|block| block.projection.truncate(10)), 58);
    assert_eq!(block(&|block| block.projection.extend_from_within(..2)), 58);
    assert_eq!(cluster(&|cluster| cluster.n_coefficients = 2), 58);
    assert_eq!(block(&|block| block.reconstruction.truncate(2)), 58);
    assert_eq!(block(&|block| block.reconstruction.extend_from_within(..2)), 58);
    assert_eq!(block(&|block| block.reconstruction[3] = half::f16::ONE), 58);
    assert_eq!(block(&|block| block.reconstruction[3] = half::f16::NEG_ZERO), 58);
    for value in [half::f16::NAN, half::f16::INFINITY, half::f16::NEG_INFINITY] {
        assert_eq!(block(&|block| block.projection[11] = value), 59);
        assert_eq!(block(&|block| block.reconstruction[0] = value), 59);
    }
    // In the block: one cluster of 16 bytes, two probes, the matrices.
    assert_eq!(refused_payload(b"BDAT", 0, &u32::MAX.to_le_bytes()), 55);
    assert_eq!(refused_payload(b"BDAT", 4, &u32::MAX.to_le_bytes()), 56);
    assert_eq!(refused_payload(b"BDAT", 20, &7u32.to_le_bytes()), 56);
    assert_eq!(refused_payload(b"BDAT", 12, &255u32.to_le_bytes()), 58);
    assert_eq!(refused_payload(b"BDAT", 24, &half::f16::NAN.to_le_bytes()), 59);
    assert_eq!(refused_payload(b"BDAT", 255, &[1]), 87);
}

#[test]
fn gutter_seam_and_report_rules_refuse() {
    assert_eq!(invariant(|arrays| arrays.gutters[0] = [16, 0]), 60);
    assert_eq!(invariant(|arrays| arrays.gutters[0] = [4, 3]), 60);
    assert_eq!(invariant(|arrays| arrays.gutters[0] = [7, 0]), 60);
    assert_eq!(invariant(|arrays| arrays.gutters[0] = [5, 0]), 60);
    assert_eq!(invariant(|arrays| arrays.seams[0] = [0, 3]), 61);
    assert_eq!(invariant(|arrays| arrays.seams[0] = [3, 0]), 61);
    assert_eq!(invariant(|arrays| arrays.seams[0] = [1, 1]), 61);
    assert_eq!(invariant(|arrays| arrays.report = "{\"receivers\":".into()), 62);
    assert_eq!(invariant(|arrays| arrays.report = "[".repeat(100_000)), 62);
    assert_eq!(invariant(|arrays| arrays.plan = "{]".into()), 62);
    assert_eq!(refused_payload(b"GUTR", 0, &u32::MAX.to_le_bytes()), 60);
    assert_eq!(refused_payload(b"SEAM", 4, &u32::MAX.to_le_bytes()), 61);
    assert_eq!(refused_payload(b"REPT", 3, &[0xff]), 62);
    assert_eq!(refused_payload(b"PLAN", 3, &[0xff]), 62);
}
