use super::*;

fn example() -> ReferenceFile {
    let point = |receiver: u32| ReferencePoint {
        receiver,
        position: [1.0, -2.0, 3.5],
        reference: [0.25, receiver as f32, 1e-20],
        compressed: [-0.5, 1e20, 0.0],
    };
    ReferenceFile {
        content_hash: std::array::from_fn(|index| 7 * index as u8),
        state: "spot, evening – 2".into(),
        bounces: 8,
        points: [0, 3, 4_000_000_000].map(point).to_vec(),
    }
}

/// What reading says of bytes, which must be refused.
fn refusal(bytes: &[u8]) -> String {
    ReferenceFile::from_bytes(bytes).expect_err("refused").to_string()
}

#[test]
fn a_file_comes_back_as_it_was_written() {
    let folder = tempfile::tempdir().expect("folder");
    let path = ReferenceFile::path_beside(&folder.path().join("hall.lprt"));
    assert_eq!(path, folder.path().join("hall.reference.ply"));
    let file = example();
    file.write(&path).expect("written");
    assert_eq!(ReferenceFile::read(&path).expect("read"), file);
    let empty = ReferenceFile { points: Vec::new(), ..file };
    empty.write(&path).expect("written");
    assert_eq!(ReferenceFile::read(&path).expect("read"), empty);
}

#[test]
fn names_keep_what_is_not_the_extension() {
    let beside = |path: &str| ReferenceFile::path_beside(Path::new(path));
    assert_eq!(beside("a/hall.v2.lprt"), Path::new("a/hall.v2.reference.ply"));
    assert_eq!(beside("a/hall.v2"), Path::new("a/hall.v2.reference.ply"));
}

#[test]
fn every_prefix_and_every_longer_file_is_refused() {
    let bytes = example().to_bytes();
    for length in 0..bytes.len() {
        refusal(&bytes[..length]);
    }
    assert!(refusal(&[&bytes[..], &[0]].concat()).contains("121 bytes for 3 points of 40"));
}

#[test]
fn any_other_header_is_refused() {
    let bytes = example().to_bytes();
    let end = bytes.windows(10).position(|window| window == b"end_header").expect("a header") + 11;
    let (header, body) = (std::str::from_utf8(&bytes[..end]).expect("text"), &bytes[end..]);
    let changes = [
        ("ply\n", "plx\n", "precompute writes"),
        ("little", "big", "precompute writes"),
        ("reference 1", "reference 2", "no line `comment localprt reference 1`"),
        ("content_hash 00", "content_hash 0g", "64 hexadecimal digits"),
        ("content_hash 00", "content_hash 0", "64 hexadecimal digits"),
        ("content_hash", "hash", "no line `comment content_hash`"),
        ("bounces 8", "bounces -8", "not a number"),
        ("bounces 8", "bounces +8", "precompute writes"),
        ("vertex 3", "vertex 4294967296", "not a number"),
        ("vertex 3", "vertex 4294967295", "bytes for 4294967295 points"),
        ("vertex 3", "vertex 2", "bytes for 2 points"),
        ("property float x\n", "", "precompute writes"),
        ("uint receiver", "uint cluster", "precompute writes"),
        ("bounces 8\n", "bounces 8\nbounces 8\n", "precompute writes"),
    ];
    for (old, new, part) in changes {
        assert!(header.contains(old), "{old}");
        let changed = [header.replacen(old, new, 1).as_bytes(), body].concat();
        assert!(refusal(&changed).contains(part), "{old} to {new}: {}", refusal(&changed));
    }
    // Whatever stands in the header's place, nothing but a refusal comes of it.
    for at in 0..end {
        for byte in [0, b'\n', b' ', b'9', 0xff] {
            let mut changed = bytes.clone();
            changed[at] = byte;
            let _ = ReferenceFile::from_bytes(&changed);
        }
    }
    assert!(refusal(&vec![b' '; 100_000]).contains("no header"));
}

#[test]
fn receivers_rise_and_values_are_finite() {
    let mut file = example();
    file.points.swap(0, 1);
    assert!(refusal(&file.to_bytes()).contains("do not rise"));
    file.points[1].receiver = 3;
    assert!(refusal(&file.to_bytes()).contains("do not rise"));
    let mut file = example();
    file.points[2].compressed[1] = f32::NAN;
    assert!(refusal(&file.to_bytes()).contains("not finite"));
}

#[test]
fn odd_names_of_states_stay_in_their_line() {
    let state = format!("a\nelement vertex 9\r\u{1b}[31m{}", "ä".repeat(400));
    let file = ReferenceFile { state, ..example() };
    let read = ReferenceFile::from_bytes(&file.to_bytes()).expect("a file");
    assert!(read.state.starts_with("a element vertex 9  [31mää") && read.state.len() <= MOST_NAME, "{}", read.state);
    assert_eq!(read.points, file.points);
    // An empty name and one with spaces at its ends come back as well.
    for state in ["", " a "] {
        let file = ReferenceFile { state: state.into(), ..example() };
        assert_eq!(ReferenceFile::from_bytes(&file.to_bytes()).expect("a file"), file);
    }
}

#[test]
fn what_cannot_be_a_file_is_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let code = |path: &Path| CommandError::from(ReferenceFile::read(path).expect_err("refused")).exit.code();
    assert_eq!(code(&folder.path().join("none.ply")), 6);
    assert_eq!(code(folder.path()), 3);
    #[cfg(unix)]
    assert_eq!(code(Path::new("/dev/zero")), 3);
}

#[test]
fn another_bake_is_told_apart() {
    use localprt_formats::{
        BakedArrays, BlockArrays, ClusterRecord, Metadata, Probe, TransportBlock, directions::spherical_fibonacci,
    };

    let n_rays = 16;
    let mut block = TransportBlock::default();
    let record = ClusterRecord { n_receivers: 1, n_probes: 0, n_sky: 0, n_coefficients: 0 };
    block.push(record, &[], &[], &[]);
    let arrays = BakedArrays {
        metadata: Metadata { lightmap_size: 1, direct_size: 1, n_rays, ..Metadata::default() },
        probes: vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }],
        ray_dirs: (0..n_rays).map(|i| spherical_fibonacci(i, n_rays)).map(|[x, y, z]| [x, y, z, 0.0]).collect(),
        ray_sh: vec![0.0; 16],
        ray_uv: vec![0; 16],
        ray_level: vec![0; 16],
        receiver_texel: vec![0],
        receiver_position: vec![[0.0; 3]],
        receiver_normal: vec![[0.0, 1.0, 0.0]],
        receiver_unseen: vec![0.0],
        blocks: BlockArrays::of_one(&block, &[[0.0; 3]], 1),
        ..BakedArrays::default()
    };
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.lprt");
    localprt_formats::write(&path, &arrays).expect("written");
    let baked = Baked::open(&path).expect("a file");
    let mut file = example();
    let error = CommandError::from(file.matches(&baked).expect_err("another hash"));
    assert!(error.what.contains("another bake") && error.help.expect("help").contains("validate"));
    file.content_hash = baked.content_hash();
    let error = file.matches(&baked).expect_err("more receivers than there are").to_string();
    assert!(error.contains("receiver 4000000000 of 1"), "{error}");
    file.points.truncate(1);
    file.matches(&baked).expect("the same bake");
}
