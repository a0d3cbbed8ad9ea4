//! Every rule of SPEC.md has a file that breaks it and is refused by that rule's number; nothing panics.

#[path = "../common/mod.rs"]
mod common;

mod arrays;
mod optional;
mod structure;

use common::{change_block, change_volume_block, entry, minimal, n_sections, payload, seal, seal_all, u64_at};
use localprt_formats::directions::counter_hash;
use localprt_formats::header::{ENTRY_BYTES, HEADER_BYTES};
use localprt_formats::{
    Baked, BakedArrays, BlockArrays, BlockRecord, ClusterRecord, NearArrays, NearTile, OpenError, TransportBlock,
    VolumeArrays, WriteError, check_bytes, to_bytes,
};

fn sound() -> Vec<u8> {
    to_bytes(&minimal()).unwrap()
}

/// The rule by which the bytes are refused when they are opened, or when their blocks are used; `check` must name it too.
fn refused(file: Vec<u8>) -> u16 {
    let listed: Vec<u16> = check_bytes(&file).iter().map(|violation| violation.rule).collect();
    let refusal = Baked::from_bytes(file).and_then(|baked| baked.checked().map(drop));
    let error = refusal.expect_err("must be refused");
    assert!(!error.to_string().contains(error.help()) && !error.to_string().contains(';'), "{error}");
    let rule = error.rule().expect("not a failure of the file system");
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
                let Ok(checked) = baked.checked() else { continue };
                let transports = [Some(checked.transport()), checked.volume_transport()];
                let clusters = transports.iter().flatten().flat_map(|transport| &transport.clusters);
                let probes = clusters.flat_map(|cluster| cluster.probes);
                assert!(probes.clone().all(|probe| (*probe as usize) < checked.n_probes()));
                assert!(probes.count() >= 2);
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
                if let Ok(checked) = baked.checked() {
                    let last = checked.transport().clusters.last().map(|cluster| cluster.receivers.end);
                    assert_eq!(last, Some(checked.n_receivers()));
                }
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
fn messages_name_place_found_and_allowed() {
    let mut arrays = minimal();
    change_block(&mut arrays, 0, |block| block.cluster_probes[1] = 9);
    let text = to_bytes(&arrays).unwrap_err().to_string();
    assert_eq!(text, "the baked arrays break rule 56: block 0, cluster 0: probe 9, there are 2");
    let error = Baked::open("/nonexistent/hall.lprt").unwrap_err();
    assert!(matches!(error, OpenError::Io { .. }) && error.rule().is_none());
    assert!(error.to_string().starts_with("cannot read /nonexistent/hall.lprt: "));
}
