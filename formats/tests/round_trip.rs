//! What is written is what is read, in every way of opening, and the same arrays give the same bytes.

mod common;

use common::{Sizes, arrays, minimal};
use localprt_formats::{
    Baked, BakedArrays, BakedView, BlockArrays, Blocks, VolumeArrays, WriteError, check, check_bytes, to_bytes, write,
};
use proptest::prelude::*;

fn owned(view: &BakedView<'_>) -> BakedArrays {
    let blocks = |blocks: Blocks<'_>| BlockArrays { records: blocks.records.to_vec(), data: blocks.data.to_vec() };
    BakedArrays {
        metadata: view.metadata.clone(),
        probes: view.probes.to_vec(),
        ray_dirs: view.ray_dirs.to_vec(),
        ray_sh: view.ray_sh.to_vec(),
        ray_uv: view.ray_uv.to_vec(),
        ray_level: view.ray_level.to_vec(),
        ray_distance: view.ray_distance.to_vec(),
        receiver_texel: view.receiver_texel.to_vec(),
        receiver_position: view.receiver_position.to_vec(),
        receiver_normal: view.receiver_normal.to_vec(),
        receiver_unseen: view.receiver_unseen.to_vec(),
        blocks: blocks(view.blocks),
        gutters: view.gutters.to_vec(),
        seams: view.seams.to_vec(),
        volume: view.volume.map(|volume| VolumeArrays {
            grid: *volume.grid,
            cells: volume.cells.to_vec(),
            blocks: blocks(volume.blocks),
            fill: volume.fill.to_vec(),
        }),
        report: view.report.to_owned(),
        plan: view.plan.to_owned(),
    }
}

fn sizes() -> impl Strategy<Value = Sizes> {
    let degrees = (0u32..=10, 0u32..=1, 0u32..=10);
    let clusters = proptest::collection::vec(1u32..=7, 0..5);
    (any::<u64>(), 0u32..6, 1u32..20, clusters, degrees, any::<bool>()).prop_map(
        |(seed, n_probes, n_rays, cluster_receivers, (probe_degree, receiver_degree, sky_degree), report)| Sizes {
            seed,
            n_probes,
            n_rays,
            cluster_receivers,
            probe_degree,
            receiver_degree,
            sky_degree,
            report,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn written_arrays_come_back(sizes in sizes()) {
        let written = arrays(&sizes);
        let bytes = to_bytes(&written).unwrap();
        prop_assert_eq!(check_bytes(&bytes), []);
        prop_assert_eq!(&bytes, &to_bytes(&written).unwrap());
        let baked = Baked::from_bytes(bytes.clone()).unwrap();
        let read = owned(&baked.view());
        prop_assert_eq!(&read, &written);
        prop_assert_eq!(baked.file_bytes(), bytes.len() as u64);
        for section in baked.sections() {
            prop_assert!(section.is_known() && section.offset % 256 == 0);
        }
        prop_assert_eq!(to_bytes(&read).unwrap(), bytes);
    }
}

#[test]
fn a_file_on_disk_opens_mapped_and_copied_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("minimal.lprt");
    write(&path, &minimal()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), to_bytes(&minimal()).unwrap());
    let (mapped, copied) = (Baked::open(&path).unwrap(), Baked::open_copied(&path).unwrap());
    assert_eq!(owned(&mapped.view()), minimal());
    assert_eq!(owned(&copied.view()), minimal());
    assert_eq!(mapped.content_hash(), copied.content_hash());
    assert_eq!(mapped.version(), (2, 1));
    assert_eq!(check(&path).unwrap(), []);
}

#[test]
fn one_changed_number_changes_the_content_hash() {
    let hash = |arrays: &BakedArrays| Baked::from_bytes(to_bytes(arrays).unwrap()).unwrap().content_hash();
    let mut changed = minimal();
    changed.receiver_unseen[1] = 0.25;
    assert_ne!(hash(&minimal()), hash(&changed));
    let mut changed = minimal();
    changed.metadata.tool_version.push('1');
    assert_ne!(hash(&minimal()), hash(&changed));
}

#[test]
fn a_mapped_file_can_be_replaced_while_it_is_open() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.lprt");
    write(&path, &minimal()).unwrap();
    let open = Baked::open(&path).unwrap();
    let mut changed = minimal();
    changed.receiver_unseen = vec![1.0; 3];
    write(&path, &changed).unwrap();
    assert_eq!(owned(&open.view()), minimal());
    assert_eq!(owned(&Baked::open(&path).unwrap().view()), changed);
}

#[test]
fn a_refused_write_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.lprt");
    write(&path, &minimal()).unwrap();
    let mut broken = minimal();
    broken.blocks.records[0].n_clusters = 2000;
    let error = write(&path, &broken).unwrap_err();
    assert!(matches!(&error, WriteError::Invalid(violation) if violation.rule == 51), "{error}");
    assert_eq!(owned(&Baked::open(&path).unwrap().view()), minimal());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_write_that_the_file_system_refuses_names_step_path_and_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let error = write(folder.path().join("absent/hall.lprt"), &minimal()).unwrap_err();
    let text = error.to_string();
    let needed = to_bytes(&minimal()).unwrap().len();
    assert!(text.contains("absent/hall.lprt") && text.contains(&format!("{needed} bytes needed")), "{text}");
    assert!(matches!(write(folder.path(), &minimal()), Err(WriteError::NotAFile { .. })));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[cfg(unix)]
#[test]
fn a_device_is_neither_replaced_nor_read() {
    assert!(matches!(write("/dev/null", &minimal()), Err(WriteError::NotAFile { .. })));
    for result in [Baked::open("/dev/zero"), Baked::open_copied("/dev/zero")] {
        assert!(result.unwrap_err().to_string().contains("not a regular file"));
    }
}

#[cfg(unix)]
#[test]
fn a_written_file_has_the_permissions_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (ours, other) = (folder.path().join("ours"), folder.path().join("other"));
    write(&ours, &minimal()).unwrap();
    std::fs::write(&other, "").unwrap();
    let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(ours), mode(other));
}

/// A child process with a file size limit of a few blocks stands in for the full disk.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_old_file_and_says_how_many_bytes_are_needed() {
    const TARGET: &str = "LOCALPRT_TEST_FULL_DISK";
    let mut large = minimal();
    large.report = format!("\"{}\"", "x".repeat(100_000));
    if let Some(path) = std::env::var_os(TARGET) {
        let error = write(&path, &large).unwrap_err();
        let needed = to_bytes(&large).unwrap().len() as u64;
        let as_expected =
            matches!(&error, WriteError::Io { action: "write", needed_bytes, .. } if *needed_bytes == needed);
        assert!(as_expected, "{error:?}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.lprt");
    write(&path, &minimal()).unwrap();
    // Ignoring the signal makes the system answer with an error instead of ending the process.
    let output = std::process::Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 40; exec \"$0\" --exact \"$1\""])
        .arg(std::env::current_exe().unwrap())
        .arg("a_full_disk_leaves_the_old_file_and_says_how_many_bytes_are_needed")
        .env(TARGET, &path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
    assert_eq!(owned(&Baked::open(&path).unwrap().view()), minimal());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the temporary file is gone");
}
