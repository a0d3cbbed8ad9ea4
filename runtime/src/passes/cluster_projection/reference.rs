//! CPU twin of the cluster projection.

use crate::passes::split_ranges;
use glam::Vec3;
use half::slice::HalfFloatSliceExt;
use localprt_formats::Transport;
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
    transport: &Transport<'_>,
    probe_radiance: &[Vec3],
    sky_sh: &[Vec3],
    cluster_lights: &mut [Vec3],
) {
    let n_sh = transport.n_sh;
    assert_eq!(probe_radiance.len(), transport.n_probes * n_sh);
    assert!(sky_sh.is_empty() || sky_sh.len() == transport.n_sky);
    assert_eq!(cluster_lights.len(), transport.n_lights);
    // Each band for itself, once: clusters then copy runs of it.
    let planes = [0, 1, 2].map(|band| probe_radiance.iter().map(|color| color[band]).collect::<Vec<f32>>());
    let sky_planes = [0, 1, 2].map(|band| sky_sh.iter().map(|color| color[band]).collect::<Vec<f32>>());
    let lights = split_ranges(cluster_lights, transport.clusters.iter().map(|cluster| cluster.lights.clone()));
    lights.into_par_iter().zip(&transport.clusters).for_each_init(Scratch::default, |scratch, (lights, cluster)| {
        // A cluster without columns has no rows to write its lights.
        lights.fill(Vec3::ZERO);
        scratch.input.iter_mut().for_each(Vec::clear);
        for &probe in cluster.probes {
            scratch.push(&planes, probe as usize * n_sh, n_sh);
        }
        // A black sky adds nothing: its columns are left out of the sum.
        if cluster.n_sky > 0 {
            scratch.push(&sky_planes, 0, sky_sh.len());
        }
        let n_columns = cluster.probes.len() * n_sh + cluster.n_sky;
        let n_used = scratch.input[0].len();
        scratch.row.resize(n_used, 0.0);
        for (light, row) in lights.iter_mut().zip(cluster.projection.chunks_exact(n_columns.max(1))) {
            row[..n_used].convert_to_f32_slice(&mut scratch.row);
            *light = dot(&scratch.row, &scratch.input);
        }
    });
}

/// Decoded row and input vector, one per color band.
#[derive(Default)]
struct Scratch {
    row: Vec<f32>,
    input: [Vec<f32>; 3],
}

impl Scratch {
    fn push(&mut self, planes: &[Vec<f32>; 3], first: usize, n: usize) {
        for (band, plane) in self.input.iter_mut().zip(planes) {
            band.extend_from_slice(&plane[first..first + n]);
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bake;
    use half::f16;
    use localprt_formats::BakedArrays;

    fn project(arrays: &BakedArrays, probe_radiance: &[Vec3], sky_sh: &[Vec3]) -> Vec<Vec3> {
        let baked = arrays.checked().unwrap();
        let mut lights = vec![Vec3::NAN; baked.n_cluster_lights()];
        cluster_projection(baked.transport(), probe_radiance, sky_sh, &mut lights);
        lights
    }

    #[test]
    fn agrees_with_the_dense_product_in_double_precision() {
        for (probe_degree, sky_degree, black_sky) in [(2, 2, false), (3, 1, false), (7, 0, false), (2, 2, true)] {
            let arrays = test_bake::random(probe_degree, 0, sky_degree);
            let (n_sh, n_sky) = (arrays.metadata.n_sh(), arrays.metadata.n_sky());
            let lambda = test_bake::random_colors(1, 5 * n_sh);
            let sky = if black_sky { Vec::new() } else { test_bake::random_colors(2, n_sky) };
            let found = project(&arrays, &lambda, &sky);
            // The columns of all probes and the sky in one vector, as in Eq. (11) before zero columns are dropped.
            let mut dense = Vec::new();
            for cluster in &arrays.checked().unwrap().transport().clusters {
                let probes = cluster.probes;
                let n_columns = probes.len() * n_sh + cluster.n_sky;
                for row in 0..cluster.lights.len() {
                    let weights = &cluster.projection[row * n_columns..];
                    let (mut sum, mut magnitude) = ([0.0f64; 3], 0.0);
                    for (column, weight) in weights[..n_columns].iter().enumerate() {
                        let value = match probes.get(column / n_sh) {
                            Some(&probe) => lambda[probe as usize * n_sh + column % n_sh],
                            None => sky.get(column - probes.len() * n_sh).copied().unwrap_or(Vec3::ZERO),
                        };
                        for (sum, value) in sum.iter_mut().zip(value.to_array()) {
                            *sum += f64::from(*weight) * f64::from(value);
                            magnitude += (f64::from(*weight) * f64::from(value)).abs();
                        }
                    }
                    dense.push((sum, magnitude));
                }
            }
            assert_eq!(found.len(), dense.len());
            assert_eq!(found.len(), 6);
            for (value, (sum, magnitude)) in found.iter().zip(dense) {
                for (channel, sum) in value.to_array().into_iter().zip(sum) {
                    // (3 * 64 / 8 + 3) * 2^-24 = 1.6e-6.
                    assert!((f64::from(channel) - sum).abs() <= 1.6e-6 * magnitude, "{channel} instead of {sum}");
                }
            }
        }
    }

    #[test]
    fn half_precision_weights_are_decoded_exactly() {
        let mut arrays = test_bake::furnace(0);
        let ones = [Vec3::ONE, Vec3::ZERO];
        // Largest, smallest subnormal, one ulp above one, negative.
        for (bits, expected) in
            [(0x7bff, 65504.0), (0x0001, 2.0f32.powi(-24)), (0x3c01, 1.0 + 2.0f32.powi(-10)), (0xc500, -5.0)]
        {
            test_bake::change_block(&mut arrays, |block| block.projection[0] = f16::from_bits(bits));
            assert_eq!(project(&arrays, &ones, &[]), [Vec3::splat(expected)]);
        }
    }
}
