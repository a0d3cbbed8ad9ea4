//! Rules 1 to 22: header, section table, checksums.

use super::*;

#[test]
fn header_rules_refuse() {
    let mut text = sound();
    text[4..6].copy_from_slice(b"\n\n");
    assert_eq!(refused(text), 2);
    assert_eq!(refused(b"glTF".repeat(100)), 2);
    for (major, minor) in [(3u16, 0u16), (1, 2), (0, 9), (u16::MAX, 0)] {
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
    assert_eq!(Baked::from_bytes(file).unwrap().version(), (2, 7));
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
    let at = payload(&file, b"RUNS");
    file[at] ^= 1;
    assert!(Baked::from_bytes(file.clone()).is_ok());
    assert_eq!(rules(&file), [22, 8]);
    assert!(check_bytes(&file)[0].message.contains("RUNS"));
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
    assert_eq!(field(b"BDAT", 4, 2), 19);
    assert_eq!(field(b"BDAT", 6, 0), 20);
    assert_eq!(field(b"REPT", 6, 1), 20);
    // u16 instead of f16, and f32 instead of u32: same size, other meaning.
    assert_eq!(field(b"RADS", 8, 2), 20);
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
