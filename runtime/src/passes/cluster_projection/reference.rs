//! CPU twin of the cluster projection.

use crate::checked_bake::CheckedBake;
use crate::passes::split_ranges;
use glam::Vec3;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Columns summed side by side; the sums of the lanes are added in f64.
const LANES: usize = 8;

/// Sets the cluster lights, cluster by cluster: `P [lambda of its probes, in listed order; sky]`, RGB.
///
/// P is the stored `S V^T`, `n_coefficients x (n_probes n_sh + n_sky)`, f16. An empty `sky_sh` is a black sky. Each row
/// is summed in eight f32 lanes, so the error of a light stays below `(columns / 8 + 3) 2^-24` of its sum of absolute
/// terms, whatever the number of threads.
///
/// # Panics
/// If the arrays do not have the lengths of the file.
pub fn cluster_projection(
    baked: &CheckedBake<'_>,
    probe_radiance: &[Vec3],
    sky_sh: &[Vec3],
    cluster_lights: &mut [Vec3],
) {
    let view = baked.view();
    let n_sh = baked.n_sh();
    assert_eq!(probe_radiance.len(), baked.n_probes() * n_sh);
    assert!(sky_sh.is_empty() || sky_sh.len() == view.metadata.n_sky());
    assert_eq!(cluster_lights.len(), baked.n_cluster_lights());
    let lights = split_ranges(cluster_lights, (0..view.clusters.len()).map(|cluster| baked.light_range(cluster)));
    lights.into_par_iter().enumerate().for_each_init(Scratch::default, |scratch, (cluster, lights)| {
        let record = &view.clusters[cluster];
        scratch.input.iter_mut().for_each(Vec::clear);
        let probes = &view.cluster_probes[record.first_probe as usize..][..record.n_probes as usize];
        for &probe in probes {
            scratch.push(&probe_radiance[probe as usize * n_sh..][..n_sh]);
        }
        // A black sky adds nothing: its columns are left out of the sum.
        if record.n_sky > 0 {
            scratch.push(sky_sh);
        }
        let n_columns = probes.len() * n_sh + record.n_sky as usize;
        let n_used = scratch.input[0].len();
        scratch.row.resize(n_used, 0.0);
        let rows = &view.projection[baked.projection_range(cluster)];
        for (light, row) in lights.iter_mut().zip(rows.chunks_exact(n_columns.max(1))) {
            row[..n_used].convert_to_f32_slice(&mut scratch.row);
            *light = dot(&scratch.row, &scratch.input);
        }
    });
}

/// Decoded row and input vector, one per colour band.
#[derive(Default)]
struct Scratch {
    row: Vec<f32>,
    input: [Vec<f32>; 3],
}

impl Scratch {
    fn push(&mut self, colors: &[Vec3]) {
        let [red, green, blue] = &mut self.input;
        red.extend(colors.iter().map(|color| color.x));
        green.extend(colors.iter().map(|color| color.y));
        blue.extend(colors.iter().map(|color| color.z));
    }
}

/// Products of one row with all three bands, so that the weights are read once.
fn dot(row: &[f32], input: &[Vec<f32>; 3]) -> Vec3 {
    let (row_groups, row_rest) = row.as_chunks::<LANES>();
    let [red, green, blue] = input.each_ref().map(|band| band.as_chunks::<LANES>());
    let mut sums = [[0.0f32; LANES]; 3];
    for (((weights, red), green), blue) in row_groups.iter().zip(red.0).zip(green.0).zip(blue.0) {
        for lane in 0..LANES {
            sums[0][lane] += weights[lane] * red[lane];
            sums[1][lane] += weights[lane] * green[lane];
            sums[2][lane] += weights[lane] * blue[lane];
        }
    }
    let total = |lanes: &[f32; LANES], rest: &[f32]| {
        let lanes: f64 = lanes.iter().copied().map(f64::from).sum();
        let rest: f64 = row_rest.iter().zip(rest).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
        (lanes + rest) as f32
    };
    Vec3::new(total(&sums[0], red.1), total(&sums[1], green.1), total(&sums[2], blue.1))
}
