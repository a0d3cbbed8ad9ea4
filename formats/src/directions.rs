//! Direction sets and counter-based random numbers: what makes a bake repeatable.

use std::f64::consts::PI;

/// The `i`-th of `n` spherical Fibonacci directions, uniform over the sphere, each worth `4 pi / n` steradians.
///
/// `z = 1 - (2 i + 1) / n`, azimuth `2 pi i / phi^2` with the golden ratio phi; computed in f64.
pub fn spherical_fibonacci(i: u32, n: u32) -> [f32; 3] {
    let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let azimuth = 2.0 * PI * fraction(f64::from(i) * GOLDEN_FRACTION);
    [(radius * azimuth.cos()) as f32, (radius * azimuth.sin()) as f32, z as f32]
}

/// `1 / phi^2 = 2 - phi`.
const GOLDEN_FRACTION: f64 = 0.381_966_011_250_105_1;

/// The `i`-th of `n` points of the Fibonacci lattice on the unit square, shifted by `shift` (toroidally).
pub fn fibonacci_square(i: u32, n: u32, shift: [f64; 2]) -> [f64; 2] {
    [fraction((f64::from(i) + 0.5) / f64::from(n) + shift[0]), fraction(f64::from(i) * GOLDEN_FRACTION + shift[1])]
}

/// Cosine-weighted direction about +Z from a point of the unit square (density `cos / pi`).
pub fn cosine_hemisphere(point: [f64; 2]) -> [f32; 3] {
    let radius = point[0].sqrt();
    let azimuth = 2.0 * PI * point[1];
    [(radius * azimuth.cos()) as f32, (radius * azimuth.sin()) as f32, (1.0 - point[0]).max(0.0).sqrt() as f32]
}

/// Uniform direction over the hemisphere about +Z from a point of the unit square (density `1 / 2 pi`).
pub fn uniform_hemisphere(point: [f64; 2]) -> [f32; 3] {
    let z = 1.0 - point[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let azimuth = 2.0 * PI * point[1];
    [(radius * azimuth.cos()) as f32, (radius * azimuth.sin()) as f32, z as f32]
}

/// Uniform direction over the sphere from a point of the unit square (density `1 / 4 pi`).
pub fn uniform_sphere(point: [f64; 2]) -> [f32; 3] {
    let z = 1.0 - 2.0 * point[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let azimuth = 2.0 * PI * point[1];
    [(radius * azimuth.cos()) as f32, (radius * azimuth.sin()) as f32, z as f32]
}

/// A random 64-bit number that depends on nothing but its three counters (SplitMix64 finaliser, applied in turn).
pub fn counter_hash(seed: u64, stream: u64, counter: u64) -> u64 {
    mix(mix(mix(seed ^ 0x6c70_7274_5eed_0001) ^ stream) ^ counter)
}

/// A uniform number in `[0, 1)` from [`counter_hash`].
pub fn counter_uniform(seed: u64, stream: u64, counter: u64) -> f64 {
    (counter_hash(seed, stream, counter) >> 11) as f64 / (1u64 << 53) as f64
}

fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn fraction(value: f64) -> f64 {
    value - value.floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length(direction: [f32; 3]) -> f64 {
        direction.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn all_directions_are_unit_vectors() {
        let n = 8000;
        for i in 0..n {
            let point = fibonacci_square(i, n, [0.3, 0.7]);
            let sphere = [spherical_fibonacci(i, n), uniform_sphere(point)];
            for direction in sphere.into_iter().chain([cosine_hemisphere(point), uniform_hemisphere(point)]) {
                // Three components rounded to 2^-24 of at most 1.
                assert!((length(direction) - 1.0).abs() < 2f64.powi(-23), "{direction:?}");
            }
            assert!(cosine_hemisphere(point)[2] >= 0.0 && uniform_hemisphere(point)[2] >= 0.0);
        }
        for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            assert!((length(cosine_hemisphere(corner)) - 1.0).abs() < 2f64.powi(-23));
            assert!((length(uniform_hemisphere(corner)) - 1.0).abs() < 2f64.powi(-23));
        }
        assert!((length(spherical_fibonacci(0, 1)) - 1.0).abs() < 2f64.powi(-23));
    }

    #[test]
    fn fibonacci_directions_cover_the_sphere_evenly() {
        let n = 8000;
        let directions: Vec<_> = (0..n).map(|i| spherical_fibonacci(i, n)).collect();
        // A cap of angle t holds (1 - cos t) / 2 of the sphere. The discrepancy of the set is known to fall like
        // n^(-3/4) = 1.2e-3 at n = 8000 (Aistleitner, Brauchart and Dick 2012); twice that.
        for center in (0..100).map(|i| spherical_fibonacci(i, 100)) {
            for cosine in [-0.5f32, 0.0, 0.5, 0.9, 0.99] {
                let inside = |d: &&[f32; 3]| (0..3).map(|axis| d[axis] * center[axis]).sum::<f32>() > cosine;
                let share = directions.iter().filter(inside).count() as f64 / f64::from(n);
                let expected = (1.0 - f64::from(cosine)) / 2.0;
                assert!((share - expected).abs() < 2.4e-3, "{center:?} {cosine}: {share} {expected}");
            }
        }
        // The mean direction is zero: z exactly by symmetry, x and y as turns of the golden angle cancel.
        for axis in 0..3 {
            let mean = directions.iter().map(|d| f64::from(d[axis])).sum::<f64>() / f64::from(n);
            assert!(mean.abs() < 1e-4, "{axis}: {mean}");
        }
    }

    #[test]
    fn hemisphere_densities_have_the_right_means() {
        let n = 4096;
        let points = (0..n).map(|i| fibonacci_square(i, n, [0.0, 0.0]));
        let mean = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>() / f64::from(n);
        // Cosine density: E[cos] = 2/3. The stratified first coordinate integrates sqrt(1 - u) with an error of the
        // order n^(-3/2) = 4e-6.
        let cosine = mean(&mut points.clone().map(|point| cosine_hemisphere(point)[2]));
        assert!((cosine - 2.0 / 3.0).abs() < 1e-5, "{cosine}");
        // Uniform density: E[cos] = 1/2; midpoints are exact for linear functions.
        let uniform = mean(&mut points.clone().map(|point| uniform_hemisphere(point)[2]));
        assert!((uniform - 0.5).abs() < 1e-6, "{uniform}");
        // Uniform over the sphere: E[z] = 0, E[z^2] = 1/3, with the midpoint error 1 / (3 n^2) of a square.
        let height = |power: i32| mean(&mut points.clone().map(|point| uniform_sphere(point)[2].powi(power)));
        assert!(height(1).abs() < 1e-6 && (height(2) - 1.0 / 3.0).abs() < 1e-6);
        // No preferred azimuth: bounded by the lattice's discrepancy, about log(n) / n = 2e-3.
        for axis in 0..2 {
            assert!(mean(&mut points.clone().map(|point| cosine_hemisphere(point)[axis])).abs() < 2e-3);
        }
    }

    #[test]
    fn square_lattice_shifts_around_the_edges() {
        for i in 0..1000 {
            let point = fibonacci_square(i, 1000, [0.999, 5.25]);
            assert!(point.iter().all(|value| (0.0..1.0).contains(value)), "{point:?}");
        }
        let mut columns: Vec<_> =
            (0..1000).map(|i| (fibonacci_square(i, 1000, [0.25, 0.0])[0] * 1000.0) as u32).collect();
        columns.sort_unstable();
        assert_eq!(columns, (0..1000).collect::<Vec<_>>(), "one point per column");
    }

    #[test]
    fn counters_alone_decide_a_random_number() {
        // Values of the first release: a bake must not change when this code does.
        assert_eq!(counter_hash(0, 0, 0), PINNED[0]);
        assert_eq!(counter_hash(1, 2, 3), PINNED[1]);
        assert_eq!(counter_hash(u64::MAX, u64::MAX, u64::MAX), PINNED[2]);
        let distinct = [[1, 2, 3], [1, 3, 2], [2, 1, 3], [2, 3, 1], [3, 1, 2], [3, 2, 1]];
        let mut hashes = distinct.map(|[a, b, c]| counter_hash(a, b, c)).to_vec();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), 6, "order of the counters matters");
    }

    const PINNED: [u64; 3] = [0x049f_5730_7e23_880f, 0x344b_e866_5bdf_69aa, 0x969a_dce0_d57e_0e21];

    #[test]
    fn counter_uniform_is_uniform_and_below_one() {
        let n = 1u64 << 16;
        let mut bins = [0u32; 64];
        let mut product = 0.0;
        for i in 0..n {
            let value = counter_uniform(7, 11, i);
            assert!((0.0..1.0).contains(&value));
            bins[(value * 64.0) as usize] += 1;
            product += (value - 0.5) * (counter_uniform(7, 12, i) - 0.5);
        }
        // Expected 1024 per bin; chi squared with 63 degrees of freedom has mean 63 and deviation 11.2: five of them.
        let chi: f64 = bins.iter().map(|bin| (f64::from(*bin) - 1024.0).powi(2) / 1024.0).sum();
        assert!(chi < 63.0 + 5.0 * 11.2, "{chi}");
        // Two streams are uncorrelated: deviation 1/12 / sqrt(n), five of them.
        assert!((product / n as f64).abs() < 5.0 / 12.0 / (n as f64).sqrt());
    }
}
