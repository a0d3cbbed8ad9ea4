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
