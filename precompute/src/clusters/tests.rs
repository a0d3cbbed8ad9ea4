//! Refinement on rows whose structure is known.

use super::*;
use crate::transport::{Metric, TransportRows};
use glam::Vec3;
use localprt_formats::directions::counter_uniform;

const N_SH: usize = 4;

fn settings(threshold: f64, max_coefficients: usize) -> RefineSettings {
    RefineSettings { threshold, max_coefficients, n_sh: N_SH, n_sky: 0 }
}

/// Rows of `n` receivers on a line over ten probes: `rank` smooth functions of the place, plus `noise`.
fn rows(n: usize, rank: usize, noise: f32) -> (Vec<u32>, Vec<Vec3>, TransportRows) {
    let n_columns = 10 * N_SH;
    let random = |stream: usize, counter: usize| counter_uniform(4, stream as u64, counter as u64) as f32 - 0.5;
    let mut values = Vec::new();
    for row in 0..n {
        for column in 0..n_columns {
            let smooth: f32 =
                (0..rank).map(|k| (k as f32 * row as f32 / n as f32 * 3.0).cos() * random(1 + k, column)).sum();
            values.push(smooth + noise * random(1000 + row, column));
        }
    }
    let rows = TransportRows {
        probes: (0..10).collect(),
        n_columns,
        n_k: 1,
        rows: values,
        unseen: vec![0.0; n],
        ..TransportRows::default()
    };
    let places = (0..n).map(|row| Vec3::X * row as f32).collect();
    ((0..n as u32).collect(), places, rows)
}

fn rms(clusters: &[Cluster]) -> f64 {
    let errors: Vec<f64> = clusters.iter().flat_map(|cluster| cluster.rows.row_error_squared.iter().copied()).collect();
    (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn every_member_is_in_one_cluster_and_the_threshold_holds() {
    for (noise, threshold) in [(0.0, 0.005), (0.02, 0.005), (0.02, 0.05), (0.5, 0.01)] {
        let (members, places, rows) = rows(300, 12, noise);
        let clusters = refine(&members, &places, rows, &settings(threshold, 32));
        assert!(rms(&clusters) <= threshold, "noise {noise}: {}", rms(&clusters));
        let mut all: Vec<u32> = clusters.iter().flat_map(|cluster| cluster.members.clone()).collect();
        all.sort_unstable();
        assert_eq!(all, members);
        assert!(clusters.iter().all(|cluster| cluster.rows.n_coefficients <= 32));
    }
}

#[test]
fn rows_of_low_rank_stay_one_cluster() {
    let (members, places, rows) = rows(500, 5, 0.0);
    let clusters = refine(&members, &places, rows, &settings(0.005, 32));
    assert_eq!(clusters.len(), 1);
    assert!(clusters[0].rows.n_coefficients <= 5);
}

#[test]
fn stored_factors_rebuild_the_rows_to_the_reported_error() {
    let (members, places, rows) = rows(200, 20, 0.01);
    let values = rows.rows.clone();
    let n_columns = rows.n_columns;
    for cluster in refine(&members, &places, rows, &settings(0.02, 32)) {
        let n_c = cluster.rows.n_coefficients;
        let columns = cluster.probes.len() * N_SH;
        for (at, &member) in cluster.members.iter().enumerate() {
            let mut error = 0.0;
            for probe in 0..10u32 {
                let slot = cluster.probes.iter().position(|&held| held == probe);
                for j in 0..N_SH {
                    let rebuilt: f32 = slot.map_or(0.0, |slot| {
                        (0..n_c)
                            .map(|c| {
                                cluster.rows.reconstruction[at * n_c + c].to_f32()
                                    * cluster.rows.projection[c * columns + slot * N_SH + j].to_f32()
                            })
                            .sum()
                    });
                    let exact = values[member as usize * n_columns + probe as usize * N_SH + j];
                    error += f64::from(exact - rebuilt).powi(2);
                }
            }
            // The same sum in another order, f32 products.
            assert!((error - cluster.rows.row_error_squared[at]).abs() <= 1e-5 * error + 1e-9, "{error}");
        }
    }
}

#[test]
fn errors_count_as_the_metric_has_them() {
    // Three measures of a row, of which the last columns say nothing.
    let (members, places, mut rows) = rows(300, 12, 0.02);
    let n_columns = rows.n_columns;
    let random = |column: usize, k: usize| counter_uniform(9, column as u64, k as u64) as f32 - 0.5;
    let matrix: Vec<f32> = (0..n_columns)
        .flat_map(|column| (0..3).map(move |k| if column < n_columns / 2 { random(column, k) } else { 0.0 }))
        .collect();
    rows.metric = Some(Metric { n: 3, matrix: matrix.clone() });
    let values = rows.rows.clone();
    let clusters = refine(&members, &places, rows, &settings(0.002, 32));
    assert!(rms(&clusters) <= 0.002, "{}", rms(&clusters));
    for cluster in &clusters {
        // What three measures tell apart takes no more than three values.
        let n_c = cluster.rows.n_coefficients;
        assert!(n_c <= 3, "{n_c}");
        let columns = cluster.probes.len() * N_SH;
        assert_eq!(columns, n_columns, "all probes are used");
        for (at, &member) in cluster.members.iter().enumerate() {
            let error = |column: usize| {
                let rebuilt: f32 = (0..n_c)
                    .map(|c| {
                        cluster.rows.reconstruction[at * n_c + c].to_f32()
                            * cluster.rows.projection[c * columns + column].to_f32()
                    })
                    .sum();
                values[member as usize * n_columns + column] - rebuilt
            };
            let measured = |k: usize| (0..n_columns).map(|column| error(column) * matrix[3 * column + k]).sum::<f32>();
            let squared: f64 = (0..3).map(|k| f64::from(measured(k)).powi(2)).sum();
            // f32 sums of 40 terms below 1 in another order.
            assert!((squared - cluster.rows.row_error_squared[at]).abs() < 1e-9 + 1e-2 * squared, "{squared}");
        }
    }
}

#[test]
fn rows_without_a_common_probe_never_mix() {
    // Two sealed rooms, five probes each, in light that the metric takes for the same: by it all rows are one.
    let (members, places, mut rows) = rows(40, 1, 0.0);
    let n_columns = rows.n_columns;
    for (member, row) in rows.rows.chunks_exact_mut(n_columns).enumerate() {
        let first = if member % 2 == 0 { 0 } else { n_columns / 2 };
        row.fill(0.0);
        row[first..first + n_columns / 2].fill(1.0);
    }
    rows.metric = Some(Metric { n: 1, matrix: vec![1.0; n_columns] });
    let clusters = refine(&members, &places, rows, &settings(0.005, 32));
    assert_eq!(clusters.iter().map(|cluster| cluster.members.len()).sum::<usize>(), 40);
    for cluster in &clusters {
        let room = cluster.members[0] % 2;
        assert!(cluster.members.iter().all(|member| member % 2 == room), "{:?}", cluster.members);
        assert!(cluster.probes.iter().all(|&probe| (probe >= 5) == (room == 1)), "{:?}", cluster.probes);
    }
}

#[test]
fn receivers_that_see_nothing_cost_nothing() {
    let (members, places, mut rows) = rows(40, 3, 0.0);
    rows.rows.fill(0.0);
    let clusters = refine(&members, &places, rows, &settings(0.005, 32));
    assert_eq!(clusters.iter().map(|cluster| cluster.members.len()).sum::<usize>(), 40);
    assert!(clusters.iter().all(|cluster| cluster.rows.n_coefficients == 0 && cluster.probes.is_empty()));
    let nothing = TransportRows { n_k: 1, unseen: vec![1.0; 3], ..TransportRows::default() };
    assert_eq!(refine(&[0, 1, 2], &places, nothing, &settings(0.005, 32)).len(), 1);
}
