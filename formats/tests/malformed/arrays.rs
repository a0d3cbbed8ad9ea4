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
fn cluster_rules_refuse() {
    for count in [0, 2, 4, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.clusters[0].n_receivers = count), 50);
    }
    assert_eq!(invariant(|arrays| arrays.clusters[0].first_receiver = 1), 50);
    assert_eq!(invariant(|arrays| arrays.clusters.clear()), 50);
    assert_eq!(invariant(|arrays| arrays.clusters.push(arrays.clusters[0])), 50);
    for count in [3, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.clusters[0].n_probes = count), 51);
    }
    assert_eq!(invariant(|arrays| arrays.clusters[0].first_probe = 1), 51);
    assert_eq!(invariant(|arrays| arrays.cluster_probes.push(1)), 51);
    for probes in [[1, 0], [1, 1], [0, 2], [0, u32::MAX]] {
        assert_eq!(invariant(|arrays| arrays.cluster_probes = probes.to_vec()), 51);
    }
    for count in [1, 3, 5, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.clusters[0].n_sky = count), 52);
    }
    for count in [256, u32::MAX] {
        assert_eq!(invariant(|arrays| arrays.clusters[0].n_coefficients = count), 53);
    }
    assert_eq!(invariant(|arrays| arrays.clusters[0].first_light = 1), 54);
    assert_eq!(invariant(|arrays| arrays.clusters[0].projection_pair = 1), 55);
    assert_eq!(invariant(|arrays| arrays.projection.truncate(10)), 55);
    assert_eq!(invariant(|arrays| arrays.projection.extend_from_within(..2)), 55);
    assert_eq!(invariant(|arrays| arrays.projection.extend_from_within(..1)), 55);
    assert_eq!(invariant(|arrays| arrays.clusters[0].n_coefficients = 2), 55);
    assert_eq!(invariant(|arrays| arrays.clusters[0].reconstruction_pair = 1), 56);
    assert_eq!(invariant(|arrays| arrays.reconstruction.truncate(2)), 56);
    assert_eq!(invariant(|arrays| arrays.reconstruction.extend_from_within(..2)), 56);
    assert_eq!(invariant(|arrays| arrays.reconstruction[3] = half::f16::ONE), 56);
    assert_eq!(invariant(|arrays| arrays.reconstruction[3] = half::f16::NEG_ZERO), 56);
    assert_eq!(invariant(|arrays| arrays.clusters[0].reserved = 1), 57);
    for value in [half::f16::NAN, half::f16::INFINITY, half::f16::NEG_INFINITY] {
        assert_eq!(invariant(|arrays| arrays.projection[11] = value), 58);
        assert_eq!(invariant(|arrays| arrays.reconstruction[0] = value), 58);
    }
    assert_eq!(refused_payload(b"CLUS", 4, &u32::MAX.to_le_bytes()), 50);
    assert_eq!(refused_payload(b"CLUS", 12, &u32::MAX.to_le_bytes()), 51);
    assert_eq!(refused_payload(b"CPRB", 4, &7u32.to_le_bytes()), 51);
    assert_eq!(refused_payload(b"CLUS", 20, &255u32.to_le_bytes()), 55);
    assert_eq!(refused_payload(b"PROJ", 0, &half::f16::NAN.to_le_bytes()), 58);
}

#[test]
fn a_second_cluster_must_follow_the_first() {
    let generated = |seed| {
        common::arrays(&common::Sizes {
            seed,
            n_probes: 4,
            n_rays: 3,
            cluster_receivers: vec![2, 3],
            probe_degree: 1,
            receiver_degree: 1,
            sky_degree: 2,
            report: false,
        })
    };
    let full = |cluster: &ClusterRecord| cluster.n_coefficients > 0 && cluster.n_probes > 0;
    let sound = (0..100).map(generated).find(|arrays| arrays.clusters.iter().all(full)).unwrap();
    assert!(to_bytes(&sound).is_ok());
    let rule = |change: &dyn Fn(&mut ClusterRecord)| {
        let mut broken = sound.clone();
        change(&mut broken.clusters[1]);
        match to_bytes(&broken) {
            Err(WriteError::Invalid(violation)) => violation.rule,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(rule(&|cluster| cluster.first_receiver -= 1), 50);
    assert_eq!(rule(&|cluster| cluster.first_probe = 0), 51);
    assert_eq!(rule(&|cluster| cluster.first_light = 0), 54);
    assert_eq!(rule(&|cluster| cluster.projection_pair = 0), 55);
    assert_eq!(rule(&|cluster| cluster.projection_pair += 1), 55);
    assert_eq!(rule(&|cluster| cluster.reconstruction_pair -= 1), 56);
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
    assert_eq!(refused_payload(b"GUTR", 0, &u32::MAX.to_le_bytes()), 60);
    assert_eq!(refused_payload(b"SEAM", 4, &u32::MAX.to_le_bytes()), 61);
    assert_eq!(refused_payload(b"REPT", 3, &[0xff]), 62);
}
