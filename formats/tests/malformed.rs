//! Every rule of SPEC.md has a file that breaks it and is refused by that rule's number; nothing panics.

mod common;

use common::{entry, minimal, n_sections, payload, seal, seal_all, u64_at};
use localprt_formats::directions::counter_hash;
use localprt_formats::header::{ENTRY_BYTES, HEADER_BYTES};
use localprt_formats::{
    Baked, BakedArrays, ClusterRecord, NearArrays, NearTile, OpenError, VolumeArrays, WriteError, check_bytes, to_bytes,
};

fn sound() -> Vec<u8> {
    to_bytes(&minimal()).unwrap()
}

/// The rule by which `Baked::open` refuses the bytes; `check` must name it too.
fn refused(file: Vec<u8>) -> u16 {
    let listed: Vec<u16> = check_bytes(&file).iter().map(|violation| violation.rule).collect();
    let rule = Baked::from_bytes(file).expect_err("must be refused").rule().expect("not a failure of the file system");
    assert!(listed.contains(&rule), "check found {listed:?}, open {rule}");
    rule
}

/// The rule by which a file is refused whose bytes were changed and whose checksums are right again.
fn refused_after(change: impl FnOnce(&mut Vec<u8>)) -> u16 {
    let mut file = sound();
    change(&mut file);
    seal(&mut file);
    refused(file)
}

fn put(file: &mut [u8], at: usize, bytes: &[u8]) {
    file[at..at + bytes.len()].copy_from_slice(bytes);
}

/// The rule that a change to the arrays breaks: the writer refuses them, and so does the reader when the same numbers
/// come in a file with sound checksums.
fn invariant(change: impl Fn(&mut BakedArrays)) -> u16 {
    let mut arrays = minimal();
    change(&mut arrays);
    match to_bytes(&arrays) {
        Err(WriteError::Invalid(violation)) => violation.rule,
        other => panic!("must be refused by the writer: {other:?}"),
    }
}

/// The same for a payload: `bytes` at `at` of section `kind`.
fn refused_payload(kind: &[u8; 4], at: usize, bytes: &[u8]) -> u16 {
    let mut file = sound();
    let start = payload(&file, kind);
    put(&mut file, start + at, bytes);
    seal_all(&mut file);
    refused(file)
}

#[test]
fn the_sound_file_is_accepted() {
    assert_eq!(check_bytes(&sound()), []);
    let mut file = sound();
    seal_all(&mut file);
    assert_eq!(file, sound(), "sealing a sound file must not change it");
}

#[test]
fn every_prefix_and_every_longer_file_is_refused() {
    let file = sound();
    for length in 0..file.len() {
        let rule = refused(file[..length].to_vec());
        assert_eq!(rule, if length < HEADER_BYTES { 1 } else { 5 }, "{length} bytes");
        // Even if the header is made to agree with the shorter file.
        if length >= HEADER_BYTES {
            let mut shorter = file[..length].to_vec();
            put(&mut shorter, 16, &(length as u64).to_le_bytes());
            seal(&mut shorter);
            assert!([1, 15, 16].contains(&refused(shorter)), "{length} bytes");
        }
    }
    for more in [1, 255, 256, 4096] {
        let mut longer = file.clone();
        longer.resize(file.len() + more, 0);
        assert_eq!(refused(longer.clone()), 5);
        put(&mut longer, 16, &((file.len() + more) as u64).to_le_bytes());
        seal(&mut longer);
        assert_eq!(refused(longer), 16);
    }
}

#[test]
fn every_flipped_bit_is_found() {
    let file = sound();
    for at in 0..file.len() {
        for bit in [0, 3, 7] {
            let mut flipped = file.clone();
            flipped[at] ^= 1 << bit;
            assert!(!check_bytes(&flipped).is_empty(), "bit {bit} of byte {at}");
            // Opening leaves payload checksums out, so it may accept some; what it accepts can be read.
            if let Ok(baked) = Baked::from_bytes(flipped) {
                let view = baked.view();
                let volume_probes = view.volume.iter().flat_map(|volume| volume.cluster_probes);
                assert!(volume_probes.clone().all(|probe| (*probe as usize) < view.probes.len()));
                let last = view.cluster_probes.iter().map(|probe| view.probes[*probe as usize].support_radius_m);
                assert!(last.count() == 2);
            }
        }
    }
}

#[test]
fn every_flipped_byte_with_sound_checksums_is_refused_or_readable() {
    let file = sound();
    for at in 0..file.len() {
        for value in [0x00, 0x01, 0x7f, 0x80, 0xff] {
            let mut changed = file.clone();
            changed[at] = value;
            seal(&mut changed);
            if let Ok(baked) = Baked::from_bytes(changed.clone()) {
                let view = baked.view();
                assert!(view.receiver_texel.iter().all(|texel| *texel < view.metadata.lightmap_size.pow(2)));
                assert!(view.gutters.iter().all(|gutter| (gutter[1] as usize) < view.receiver_texel.len()));
            }
            // As open, and it must not panic either.
            check_bytes(&changed);
        }
    }
}

/// Several bytes at once, with all checksums made right again: what a deliberate attacker sends.
#[test]
fn files_with_forged_numbers_are_refused_or_readable() {
    let values = [0u64, 1, 2, 255, 256, 0x7fff_ffff, 0xffff_ffff, 1 << 32, 1 << 63, u64::MAX];
    let mut runs = 0;
    for seed in 0..20_000u64 {
        let mut file = sound();
        for change in 0..1 + counter_hash(seed, 0, 0) % 3 {
            let at = counter_hash(seed, 1, change) as usize % (file.len() - 8);
            // Mostly header and table, where the structure is.
            let at = if seed % 4 == 0 { at } else { at % (HEADER_BYTES + n_sections(&file) * ENTRY_BYTES) };
            let value = values[counter_hash(seed, 2, change) as usize % values.len()].to_le_bytes();
            let width = [1, 2, 4, 8][counter_hash(seed, 3, change) as usize % 4];
            put(&mut file, at, &value[..width]);
        }
        seal(&mut file);
        let listed = check_bytes(&file);
        match Baked::from_bytes(file) {
            Ok(baked) => assert_eq!(baked.view().receiver_normal.len(), baked.view().receiver_texel.len()),
            Err(error) => assert!(listed.iter().any(|violation| Some(violation.rule) == error.rule())),
        }
        runs += 1;
    }
    assert_eq!(runs, 20_000);
}

#[test]
fn header_rules_refuse() {
    let mut text = sound();
    text[4..6].copy_from_slice(b"\n\n");
    assert_eq!(refused(text), 2);
    assert_eq!(refused(b"glTF".repeat(100)), 2);
    for (major, minor) in [(2u16, 0u16), (0, 9), (u16::MAX, 0)] {
        let mut newer = sound();
        put(&mut newer, 8, &major.to_le_bytes());
        put(&mut newer, 10, &minor.to_le_bytes());
        let error = Baked::from_bytes(newer.clone()).unwrap_err().to_string();
        assert!(error.contains(&format!("{major}.{minor}")), "{error}");
        assert_eq!(refused(newer), 3);
    }
    for count in [0u32, 257, u32::MAX] {
        assert_eq!(refused_after_without_seal(12, &count.to_le_bytes()), 4);
    }
    // 256 sections: the table would end behind the file.
    assert_eq!(refused_after_without_seal(12, &256u32.to_le_bytes()), 1);
    for length in [0u64, 64, 1 << 40, u64::MAX] {
        assert_eq!(refused_after_without_seal(16, &length.to_le_bytes()), 5);
    }
    assert_eq!(refused_after(|file| file[56] = 1), 6);
    assert_eq!(refused_after(|file| file[HEADER_BYTES + 40] = 1), 6);
    assert_eq!(refused_after_without_seal(60, &[1, 2, 3, 4]), 7);
    assert_eq!(refused_after_without_seal(HEADER_BYTES + 20, &[9]), 7);
}

fn refused_after_without_seal(at: usize, bytes: &[u8]) -> u16 {
    let mut file = sound();
    put(&mut file, at, bytes);
    refused(file)
}

#[test]
fn a_newer_minor_version_is_read() {
    let mut file = sound();
    file[10] = 7;
    seal(&mut file);
    assert_eq!(check_bytes(&file), []);
    assert_eq!(Baked::from_bytes(file).unwrap().version(), (1, 7));
}

#[test]
fn checksum_rules_are_checked_by_check_alone() {
    let mut file = sound();
    file[24] ^= 1;
    seal(&mut file);
    assert!(Baked::from_bytes(file.clone()).is_ok());
    let rules = |file: &[u8]| check_bytes(file).iter().map(|violation| violation.rule).collect::<Vec<_>>();
    assert_eq!(rules(&file), [8]);

    let mut file = sound();
    let at = payload(&file, b"RPOS");
    file[at] ^= 1;
    assert!(Baked::from_bytes(file.clone()).is_ok());
    assert_eq!(rules(&file), [22, 8]);
    assert!(check_bytes(&file)[0].message.contains("RPOS"));
}

#[test]
fn table_rules_refuse() {
    let field = |kind: &'static [u8; 4], at: usize, bytes: &[u8]| {
        let bytes = bytes.to_vec();
        refused_after(move |file| {
            let at = entry(file, kind) + at;
            put(file, at, &bytes);
        })
    };
    for kind in [b"prob", b"PR B", b"PRO\0", b"\xff\xff\xff\xff"] {
        assert_eq!(field(b"PROB", 0, kind), 10);
    }
    assert_eq!(field(b"PROB", 0, b"META"), 11);
    assert_eq!(field(b"PROB", 6, &2u16.to_le_bytes()), 12);
    assert_eq!(field(b"PROB", 6, &0x8001u16.to_le_bytes()), 12);
    for scalar in [0u16, 6, u16::MAX] {
        assert_eq!(field(b"PROB", 8, &scalar.to_le_bytes()), 13);
    }
    assert_eq!(field(b"PROB", 10, &0u16.to_le_bytes()), 13);
    for count in [0u64, 1, 3, 1 << 32, 1 << 60, u64::MAX] {
        assert_eq!(field(b"PROB", 16, &count.to_le_bytes()), 14);
    }
    for length in [0u64, 31, 33, u64::MAX] {
        assert_eq!(field(b"PROB", 32, &length.to_le_bytes()), 14);
    }
    // Overlap, a gap, no alignment, before the start, beyond the end, wrapping around.
    for shift in [-256i64, 256, 4, 1, -1] {
        let offset = u64_at(&sound(), entry(&sound(), b"RDIR") + 24).wrapping_add_signed(shift);
        assert_eq!(field(b"RDIR", 24, &offset.to_le_bytes()), 15);
    }
    for offset in [0u64, 1 << 40, u64::MAX, u64::MAX - 255] {
        assert_eq!(field(b"RDIR", 24, &offset.to_le_bytes()), 15);
    }
    // Huge counts whose lengths agree.
    for count in [1u64 << 20, 1 << 59, u64::MAX / 16] {
        let rule = refused_after(|file| {
            let at = entry(file, b"PROB");
            put(file, at + 16, &count.to_le_bytes());
            put(file, at + 32, &(count * 16).to_le_bytes());
        });
        assert_eq!(rule, 16);
    }
    let file = sound();
    let padding = HEADER_BYTES + n_sections(&file) * ENTRY_BYTES;
    for at in [padding, payload(&file, b"META") - 1, payload(&file, b"RDIR") - 1] {
        assert_eq!(refused_after(|file| file[at] = 1), 17, "{at}");
    }
}

#[test]
fn known_sections_must_be_as_described() {
    let rename = |kind: &'static [u8; 4], required: bool| {
        move |file: &mut Vec<u8>| {
            let at = entry(file, kind);
            put(file, at, b"NEW1");
            put(file, at + 6, &u16::from(required).to_le_bytes());
        }
    };
    assert_eq!(refused_after(rename(b"SEAM", true)), 18);
    let mut file = sound();
    rename(b"SEAM", true)(&mut file);
    seal(&mut file);
    assert!(Baked::from_bytes(file).unwrap_err().to_string().contains("NEW1"));
    assert_eq!(refused_after(rename(b"SEAM", false)), 21);

    let field = |kind: &'static [u8; 4], at: usize, value: u16| {
        refused_after(move |file| {
            let at = entry(file, kind) + at;
            put(file, at, &value.to_le_bytes());
        })
    };
    assert_eq!(field(b"PROJ", 4, 2), 19);
    assert_eq!(field(b"PROJ", 6, 0), 20);
    assert_eq!(field(b"REPT", 6, 1), 20);
    // u16 instead of f16, and f32 instead of u32: same size, other meaning.
    assert_eq!(field(b"PROJ", 8, 2), 20);
    assert_eq!(field(b"RTEX", 8, 5), 20);
}

#[test]
fn unknown_optional_sections_are_skipped() {
    let mut file = sound();
    let at = entry(&file, b"REPT");
    put(&mut file, at, b"NEW1");
    put(&mut file, at + 4, &9u16.to_le_bytes());
    seal_all(&mut file);
    assert_eq!(check_bytes(&file), []);
    let baked = Baked::from_bytes(file.clone()).unwrap();
    assert_eq!(baked.view().report, "");
    let skipped: Vec<_> = baked.sections().iter().filter(|section| !section.is_known()).collect();
    assert_eq!(skipped.len(), 1);
    assert_eq!(skipped[0].kind.to_string(), "NEW1");
    // So is a newer version of the optional report, whatever its type.
    put(&mut file, at, b"REPT");
    seal_all(&mut file);
    assert_eq!(Baked::from_bytes(file).unwrap().view().report, "");
}

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
    // Clusters obey the rules of the lightmap's.
    assert_eq!(volume(&|volume| volume.cells.truncate(1)), 50);
    assert_eq!(volume(&|volume| volume.clusters.clear()), 50);
    assert_eq!(volume(&|volume| volume.clusters[0].n_probes = 2), 51);
    assert_eq!(volume(&|volume| volume.cluster_probes[0] = 2), 51);
    assert_eq!(volume(&|volume| volume.clusters[0].n_sky = 3), 52);
    assert_eq!(volume(&|volume| volume.clusters[0].n_coefficients = 256), 53);
    assert_eq!(volume(&|volume| volume.clusters[0].first_light = 1), 54);
    assert_eq!(volume(&|volume| volume.projection.truncate(6)), 55);
    // Degree 2 needs nine rows a receiver.
    assert_eq!(volume(&|volume| volume.grid.degree = 2), 56);
    assert_eq!(volume(&|volume| volume.clusters[0].reserved = 1), 57);
    assert_eq!(volume(&|volume| volume.reconstruction[0] = half::f16::NAN), 58);
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
    assert_eq!(refused_payload(b"VCLU", 4, &3u32.to_le_bytes()), 50);
    assert_eq!(refused_payload(b"VCPR", 0, &2u32.to_le_bytes()), 51);
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
    for kind in [b"VOLU", b"VCEL", b"VCLU", b"VCPR", b"VPRJ", b"VREC", b"VFIL"] {
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
    let near = |change: &dyn Fn(&mut NearArrays)| invariant(|arrays| change(arrays.near.as_mut().unwrap()));
    assert_eq!(near(&|near| near.tiles.clear()), 80);
    assert_eq!(near(&|near| near.counts.truncate(2)), 81);
    assert_eq!(near(&|near| near.tiles.truncate(2)), 81);
    assert_eq!(near(&|near| near.tiles[0].first_link = 1), 81);
    assert_eq!(near(&|near| near.nodes.push(0)), 81);
    assert_eq!(near(&|near| near.links.push(0)), 81);
    // A tile without receivers, one that goes back, and nodes that go back.
    assert_eq!(near(&|near| near.tiles[1].first_receiver = 3), 82);
    assert_eq!(near(&|near| near.tiles[1].first_receiver = 4), 82);
    assert_eq!(near(&|near| near.tiles[1].first_node = 3), 82);
    let more = |near: &mut NearArrays, nodes: u32| {
        near.nodes.resize(2 + nodes as usize, 0);
        near.tiles[2].first_node += nodes;
    };
    assert_eq!(near(&|near| more(near, 257)), 82);
    assert_eq!(near(&|near| near.counts[0] = 1), 83);
    assert_eq!(near(&|near| near.tiles[1].first_link = 2), 83);
    for scale in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(near(&|near| near.tiles[0].scale = scale), 84);
    }
    assert_eq!(near(&|near| near.tiles[2].scale = 0.5), 84);
    // Level 4 of a map of 8 texels, and texels beyond their level.
    for node in [4 << 28, 64, 1 << 28 | 16, u32::MAX] {
        assert_eq!(near(&|near| near.nodes[0] = node), 85);
    }
    assert_eq!(near(&|near| near.links[0] = 2), 86);
    assert_eq!(near(&|near| near.weights.truncate(2)), 86);
    assert_eq!(refused_payload(b"NTIL", 16, &9u32.to_le_bytes()), 82);
    assert_eq!(refused_payload(b"NTIL", 12, &f32::NAN.to_le_bytes()), 84);
    assert_eq!(refused_payload(b"NNOD", 0, &u32::MAX.to_le_bytes()), 85);
    assert_eq!(refused_payload(b"NCNT", 0, &[9]), 83);
    assert_eq!(refused_payload(b"NIDX", 1, &[255]), 86);
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
    let end = NearTile { first_receiver: 65, ..NearTile::default() };
    arrays.near =
        Some(NearArrays { tiles: vec![NearTile::default(), end], counts: vec![0; 65], ..NearArrays::default() });
    assert!(matches!(to_bytes(&arrays), Err(WriteError::Invalid(violation)) if violation.rule == 82));
}

#[test]
fn near_light_is_whole_or_absent_and_never_skipped() {
    for kind in [b"NTIL", b"NNOD", b"NCNT", b"NIDX", b"NWGT"] {
        let change = |at: usize, bytes: &[u8]| {
            let mut file = sound();
            let at = entry(&file, kind) + at;
            put(&mut file, at, bytes);
            seal_all(&mut file);
            refused(file)
        };
        // Another name, flagged optional, is a missing section; a reader that does not know it, or its version, refuses.
        assert_eq!(change(0, &[b'N', b'E', b'W', b'1', 1, 0, 0, 0]), 80);
        assert_eq!(change(0, b"NEW1"), 18);
        assert_eq!(change(4, &[2]), 19);
        assert_eq!(change(6, &[0]), 20);
    }
}

#[test]
fn messages_name_place_found_and_allowed() {
    let mut arrays = minimal();
    arrays.cluster_probes[1] = 9;
    let text = to_bytes(&arrays).unwrap_err().to_string();
    assert_eq!(text, "the baked arrays break rule 51: cluster 0: probe 9, there are 2");
    let error = Baked::open("/nonexistent/hall.lprt").unwrap_err();
    assert!(matches!(error, OpenError::Io { .. }) && error.rule().is_none());
    assert!(error.to_string().starts_with("cannot read /nonexistent/hall.lprt: "));
}
