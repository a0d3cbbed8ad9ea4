//! Stored files of every released version open to known values.
//!
//! `UPDATE_GOLDEN=1 cargo test` writes the file of the current version; those of earlier versions never change.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::minimal;
use half::f16;
use localprt_formats::{Baked, LEVEL_SKY, check, to_bytes, write};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn golden_2_1() -> PathBuf {
    let path = data("minimal_v2_1.lprt");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        write(&path, &minimal()).unwrap();
    }
    path
}

#[test]
fn files_of_version_1_are_refused_with_what_to_do() {
    let error = Baked::open(data("minimal_v1_2.lprt")).unwrap_err();
    assert_eq!(error.rule(), Some(3));
    let text = error.to_string();
    assert!(text.contains("version 1.2") && error.help() == "bake the scene again", "{text}");
}

#[test]
fn the_file_of_version_2_0_opens_without_a_plan() {
    let baked = Baked::open(data("minimal_v2.lprt")).unwrap();
    assert_eq!((baked.version(), baked.sections().len(), baked.view().plan), ((2, 0), 21, ""));
    assert_known_values(&baked);
}

#[test]
fn the_file_of_version_2_1_opens_to_known_values() {
    let path = golden_2_1();
    assert_eq!(check(&path).unwrap(), []);
    let baked = Baked::open(&path).unwrap();
    assert_eq!(baked.version(), (2, 1));
    assert_eq!(baked.sections().len(), 22);
    assert_eq!(baked.view().plan, r#"{"version":1}"#);
    assert_known_values(&baked);
    let checked = baked.checked().unwrap();
    let view = checked.view();
    let tile = &checked.transport().tiles[1];
    assert_eq!((tile.receivers.clone(), tile.nodes.len(), tile.links.len(), tile.scale), (2..3, 0, 0, 0.25));
    let tile = &checked.transport().tiles[0];
    assert_eq!((tile.receivers.clone(), tile.scale), (0..2, 0.5));
    assert_eq!(tile.nodes, [13, 1 << 28 | 5]);
    assert_eq!(localprt_formats::node_level_and_texel(tile.nodes[1]), (1, 5));
    assert_eq!((tile.counts, tile.links, tile.weights), (&[2, 1][..], &[0, 1, 1][..], &[127, 64, -32][..]));
    let links = [0, 1, 2, 3].map(|receiver| checked.transport().links_of(receiver));
    assert_eq!(links[0], [(13, 0.5), (tile.nodes[1], 0.5 * (64.0f32 / 127.0).powi(2))]);
    assert_eq!((links[1].len(), links[1][0].0, links[2].len(), links[3].len()), (1, tile.nodes[1], 0, 0));
    assert_eq!(view.ray_distance[..4], [1.5, 0.5, f32::INFINITY, 1.0].map(f16::from_f32));
    assert_eq!(view.ray_distance[11], f16::MAX);
    let volume = view.volume.unwrap();
    assert_eq!((volume.grid.dims, volume.grid.degree, volume.grid.spacing_m), ([3, 2, 1], 1, 0.5));
    assert_eq!((volume.grid.n_cells(), volume.grid.n_k()), (6, 4));
    assert_eq!(volume.grid.coordinates(4), [1, 1, 0]);
    assert_eq!(volume.grid.index([1, 1, 0]), 4);
    assert_eq!(volume.grid.position(4), [0.0, 0.75, 0.0]);
    assert_eq!(volume.cells, [4, 1]);
    assert_eq!(volume.fill, [[0, 1], [5, 4]]);
    let cluster = &checked.volume_transport().unwrap().clusters[0];
    assert_eq!((cluster.n_sky, cluster.probes), (4, &[1][..]));
    assert_eq!(cluster.projection[2], f16::from_f32(0.125));
    assert_eq!(cluster.reconstruction[5], f16::from_f32(-0.25));
}

fn assert_known_values(baked: &Baked) {
    let view = baked.view();
    assert_eq!(view.metadata.scene_path, "minimal.glb");
    assert_eq!(view.metadata.scene_hash[31], 31);
    assert_eq!(view.metadata.bounds, [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]);
    assert_eq!((view.metadata.n_sh(), view.metadata.n_k(), view.metadata.n_sky()), (4, 1, 4));
    assert_eq!(view.probes[1].position, [0.5, 1.0, 0.0]);
    assert_eq!(view.probes[1].support_radius_m, 2.5);
    assert_eq!(view.ray_dirs[3], [0.0, -1.0, 0.0, 0.0]);
    assert_eq!(view.ray_uv[0], 0x8000_4000);
    assert_eq!(view.ray_level[2], LEVEL_SKY);
    assert_eq!(view.receiver_texel, [5, 6, 9]);
    assert_eq!(view.receiver_unseen, [0.0, 0.125, 1.0]);
    assert_eq!(view.blocks.records[0].bounds, [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.5]]);
    let block = baked.block(0).unwrap();
    assert_eq!((block.receivers, block.clusters.len()), (0..3, 1));
    let cluster = &block.clusters[0];
    assert_eq!((cluster.receivers.clone(), cluster.lights.clone(), cluster.probes), (0..3, 0..1, &[0, 1][..]));
    assert_eq!((cluster.projection.len(), cluster.projection[3]), (12, f16::from_f32(-0.125)));
    assert_eq!(cluster.reconstruction, [1.0, 0.75, -0.5].map(f16::from_f32));
    assert_eq!(view.gutters, [[4, 0], [7, 1]]);
    assert_eq!(view.seams, [[0, 2]]);
    assert_eq!(view.report, r#"{"receivers":3}"#);
}

#[test]
fn the_file_of_version_2_1_is_written_byte_for_byte() {
    let stored = std::fs::read(golden_2_1()).unwrap();
    assert!(stored.len() < 10_240, "{} bytes", stored.len());
    assert_eq!(stored, to_bytes(&minimal()).unwrap());
}

/// Rows of the SH table must be what `sh.rs` says: the golden file holds its values as literals.
#[test]
fn the_stored_sh_table_matches_the_basis() {
    let arrays = minimal();
    let basis = localprt_formats::sh::Basis::new(1);
    for (direction, stored) in arrays.ray_dirs.iter().zip(arrays.ray_sh.chunks(4)) {
        let mut values = [0.0; 4];
        basis.evaluate([direction[0], direction[1], direction[2]], &mut values);
        for (value, stored) in values.iter().zip(stored) {
            // Three roundings of numbers near 1.
            assert!((value * 4.0 * std::f32::consts::PI / 6.0 - stored).abs() < 3.0 * f32::EPSILON);
        }
    }
}

/// A reader written from SPEC.md alone, in another language, finds the same counts, and relights to the same numbers.
#[test]
fn an_independent_reader_agrees() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_lprt.py");
    let output = match Command::new("python3").arg(&script).arg(golden_2_1()).output() {
        Ok(output) => output,
        Err(error) => {
            eprintln!("skipped an_independent_reader_agrees: python3 does not start: {error}");
            return;
        }
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let hash: String = (0..32).map(|byte| format!("{byte:02x}")).collect();
    let expected = serde_json::json!({
        "version": [2, 1],
        "tool_version": "0.1.0",
        "scene_path": "minimal.glb",
        "scene_hash": hash,
        "lightmap_size": 4,
        "direct_size": 8,
        "degrees": [1, 0, 1],
        "options": "spacing = 1.0\n",
        "probes": 2,
        "rays": 6,
        "receivers": 3,
        "blocks": 1,
        "clusters": 1,
        "cluster_lights": 1,
        "projection": 12,
        "reconstruction": 4,
        "ray_distances": 12,
        "volume": {"origin": [-0.5, 0.25, 0.0], "spacing": 0.5, "dims": [3, 2, 1], "degree": 1, "receivers": 2, "filled": 2},
        "near": {"tiles": 2, "nodes": 2, "links": 3},
        "gutters": 2,
        "seams": 1,
        "report": true,
        "plan": true,
    });
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(&found[key], value, "{key}");
    }
    // Radiance 1 everywhere that is mapped and a sky of radiance 1: probe 0 has one black ray, toward -x.
    let y0 = 0.590_817_95f64;
    let y1 = 1.023_326_7f64;
    let probe_0 = [5.0 * y0, 0.0, 0.0, y1];
    let probe_1 = [6.0 * y0, 0.0, 0.0, 0.0];
    let sky_0 = (4.0 * std::f64::consts::PI).sqrt();
    let light = 0.5 * probe_0[0] - 0.125 * probe_0[3] + 0.5 * probe_1[0] + sky_0;
    let weight = |code: f64| 0.5 * (code / 127.0) * (code / 127.0).abs();
    let near = [weight(127.0) + weight(64.0), weight(-32.0), 0.0];
    for (receiver, factor) in [1.0, 0.75, -0.5f64].into_iter().enumerate() {
        let irradiance = found["irradiance"][receiver].as_f64().unwrap();
        let expected = (factor * light + near[receiver]).max(0.0);
        // The table's f32 rounding, summed over a few terms of size 4.
        assert!((irradiance - expected).abs() < 1e-5, "{receiver}: {irradiance} instead of {expected}");
    }
    // Probe 1 sees radiance 1 from everywhere, without any direction.
    let light = 0.25 * probe_1[0] + sky_0;
    let cells = found["volume_radiance"].as_array().unwrap();
    let expected = [(1, 0.75, -0.25), (0, 0.75, -0.25), (4, 1.0, 0.0), (5, 1.0, 0.0)];
    assert_eq!((cells.len(), &cells[2], &cells[3]), (6, &serde_json::Value::Null, &serde_json::Value::Null));
    for (cell, constant, first) in expected {
        for (k, factor) in [(0, constant), (1, first)] {
            let radiance = cells[cell][k].as_f64().unwrap();
            assert!((radiance - factor * light).abs() < 1e-5, "{cell} {k}: {radiance}");
        }
    }
}
