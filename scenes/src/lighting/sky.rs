//! Radiance of the sky by direction, and sums over all directions.

use super::Sky;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Heights per hemisphere of the quadrature for skies without pixels.
const GAUSS_NODES: usize = 16;
/// Azimuths of the same: uniform ones are exact for trigonometric degrees below their number.
const AZIMUTHS: usize = 32;
/// Equirect images are read at this many columns at least, so that small ones are summed as finely as they are shown.
const LEAST_COLUMNS: u32 = 1024;

impl Sky {
    /// Whether no light comes from anywhere.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Black => true,
            Self::Constant(radiance) => *radiance == Vec3::ZERO,
            Self::Gradient { zenith, horizon, ground } => *zenith + *horizon + *ground == Vec3::ZERO,
            Self::Equirect { pixels, scale, .. } => *scale == 0.0 || pixels.iter().all(|pixel| *pixel == Vec3::ZERO),
        }
    }

    /// Radiance arriving from `dir` (unit, pointing at the sky), W sr^-1 m^-2.
    ///
    /// Gradients are linear in the direction's height. Equirect images are filtered bilinearly between pixel centers,
    /// wrapped around and clamped at the poles; column 0 begins at -Z, a quarter of the way to the right is +X. A
    /// positive rotation turns the picture about +Y by the right-hand rule, counter-clockwise seen from above: at 90
    /// degrees what was at +X is at -Z.
    pub fn radiance(&self, dir: Vec3) -> Vec3 {
        match self {
            Self::Black => Vec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Gradient { zenith, horizon, ground } => {
                let height = dir.y.clamp(-1.0, 1.0);
                horizon.lerp(if height >= 0.0 { *zenith } else { *ground }, height.abs())
            }
            Self::Equirect { width, height, pixels, scale, rotation } => {
                let dir = dir.as_dvec3();
                let turns = dir.x.atan2(-dir.z) / TAU + f64::from(*rotation) / 360.0;
                let v = dir.x.hypot(dir.z).atan2(dir.y) / PI;
                *scale * bilinear(*width, *height, pixels, turns.rem_euclid(1.0), v)
            }
        }
    }

    /// Directions that cover the sphere, for sums over the sky: `(dir, solid angle in sr, radiance)`, in a fixed order.
    /// The solid angles sum to 4 pi; nothing is returned for a black sky.
    ///
    /// For constant and gradient skies the sum of radiance times a polynomial in the direction is exact up to degree 30
    /// (1024 directions). Equirect images give one direction per pixel, at the pixel's solid angle and, for images less
    /// than 1024 pixels wide, as many per pixel as make up for that.
    pub fn quadrature(&self) -> impl Iterator<Item = (Vec3, f32, Vec3)> + '_ {
        let rings = match self {
            Self::Black => vec![],
            Self::Constant(_) | Self::Gradient { .. } => gauss_rings(),
            Self::Equirect { width, height, rotation, .. } => image_rings(*width, *height, *rotation),
        };
        rings.into_iter().flat_map(move |ring| {
            (0..ring.columns).map(move |column| {
                let turns = (f64::from(column) + 0.5) / f64::from(ring.columns) + ring.offset;
                let (sin, cos) = (turns * TAU).sin_cos();
                let across = (1.0 - ring.height * ring.height).max(0.0).sqrt();
                let dir = DVec3::new(across * sin, ring.height, -across * cos).normalize().as_vec3();
                let solid_angle = ring.solid_angle / f64::from(ring.columns);
                (dir, solid_angle as f32, self.radiance(dir))
            })
        })
    }
}

fn bilinear(width: u32, height: u32, pixels: &[Vec3], u: f64, v: f64) -> Vec3 {
    let (x, y) = (u * f64::from(width) - 0.5, v * f64::from(height) - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (along, down) = ((x - left) as f32, (y - top) as f32);
    let column = |offset: i64| (left as i64 + offset).rem_euclid(i64::from(width)) as usize;
    let row = |offset: i64| (top as i64 + offset).clamp(0, i64::from(height) - 1) as usize;
    let pixel = |x: i64, y: i64| pixels[row(y) * width as usize + column(x)];
    pixel(0, 0).lerp(pixel(1, 0), along).lerp(pixel(0, 1).lerp(pixel(1, 1), along), down)
}

/// Directions of one height, evenly spaced in azimuth.
struct Ring {
    height: f64,
    solid_angle: f64,
    columns: u32,
    /// Turns by which the first direction is moved to the right.
    offset: f64,
}

/// Gauss-Legendre in the height, for each hemisphere by itself because a gradient has a bend at the horizon.
fn gauss_rings() -> Vec<Ring> {
    let nodes = gauss_legendre(GAUSS_NODES);
    let ring = |height: f64, weight: f64| Ring {
        height,
        solid_angle: weight / 2.0 * TAU,
        columns: AZIMUTHS as u32,
        offset: 0.0,
    };
    let upper = nodes.iter().map(|&(node, weight)| ring((node + 1.0) / 2.0, weight));
    let lower = nodes.iter().map(|&(node, weight)| ring((node - 1.0) / 2.0, weight));
    upper.chain(lower).collect()
}

fn image_rings(width: u32, height: u32, rotation: f32) -> Vec<Ring> {
    let parts = LEAST_COLUMNS.div_ceil(width.max(1));
    let rows = height * parts;
    let edge = |row: u32| (PI * f64::from(row) / f64::from(rows)).cos();
    let ring = |row: u32| Ring {
        // The mean height over the ring's area.
        height: (edge(row) + edge(row + 1)) / 2.0,
        solid_angle: (edge(row) - edge(row + 1)) * TAU,
        columns: width * parts,
        offset: -f64::from(rotation) / 360.0,
    };
    (0..rows).map(ring).collect()
}

/// Nodes and weights on -1..1 by Newton's method on the Legendre polynomial.
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    let node = |index: usize| {
        let mut x = (PI * (index as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 0.0;
        // Converges quadratically from this start: 8 steps are more than f64 needs.
        for _ in 0..8 {
            let (mut previous, mut value) = (1.0, x);
            for degree in 2..=count {
                let k = degree as f64;
                (previous, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k);
            }
            slope = n * (x * value - previous) / (x * x - 1.0);
            x -= value / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRADIENT: Sky = Sky::Gradient {
        zenith: Vec3::new(1.0, 2.0, 3.0),
        horizon: Vec3::new(5.0, 5.0, 1.0),
        ground: Vec3::new(0.5, 0.25, 0.0),
    };

    /// 8 x 4 pixels, every one of its own.
    fn image(rotation: f32) -> Sky {
        let pixels = (0..32).map(|i| Vec3::new((i % 8) as f32, (i / 8) as f32, 1.0)).collect();
        Sky::Equirect { width: 8, height: 4, pixels, scale: 2.0, rotation }
    }

    /// Sum of radiance times `weight` over the sphere.
    fn sum(sky: &Sky, weight: impl Fn(DVec3) -> f64) -> DVec3 {
        sky.quadrature().fold(DVec3::ZERO, |sum, (dir, solid_angle, radiance)| {
            sum + radiance.as_dvec3() * f64::from(solid_angle) * weight(dir.as_dvec3())
        })
    }

    /// Center of a pixel of the 8 x 4 image, unrotated.
    fn center(column: f64, row: f64) -> Vec3 {
        let (azimuth, polar) = ((column + 0.5) / 8.0 * TAU, (row + 0.5) / 4.0 * PI);
        DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()).as_vec3()
    }

    fn assert_close(found: Vec3, expected: Vec3, tolerance: f32) {
        assert!((found - expected).abs().max_element() <= tolerance, "{found} instead of {expected}");
    }

    #[test]
    fn gradient_is_linear_in_height() {
        assert_eq!(GRADIENT.radiance(Vec3::Y), Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(GRADIENT.radiance(Vec3::NEG_Z), Vec3::new(5.0, 5.0, 1.0));
        assert_eq!(GRADIENT.radiance(Vec3::NEG_Y), Vec3::new(0.5, 0.25, 0.0));
        // Rounding of a sum of two products below 8: a few 2^-21.
        assert_close(GRADIENT.radiance(Vec3::new(0.8, 0.6, 0.0)), Vec3::new(2.6, 3.2, 2.2), 2e-6);
        assert_close(GRADIENT.radiance(Vec3::new(0.0, -0.6, 0.8)), Vec3::new(2.3, 2.15, 0.4), 2e-6);
    }

    #[test]
    fn pixel_centers_give_their_pixels() {
        for row in 0..4 {
            for column in 0..8 {
                let expected = 2.0 * Vec3::new(column as f32, row as f32, 1.0);
                // An f32 direction is off by 2^-24 rad, times 8 / tau pixels, a step of up to 7, a scale of 2.
                assert_close(image(0.0).radiance(center(f64::from(column), f64::from(row))), expected, 1e-5);
            }
        }
        // Half-way between columns 7 and 0 (-Z), and rows 1 and 2.
        assert_close(image(0.0).radiance(Vec3::NEG_Z), Vec3::new(7.0, 3.0, 2.0), 1e-5);
        // Columns 1 and 2 at +X: u grows to the right.
        assert_close(image(0.0).radiance(Vec3::X), Vec3::new(3.0, 3.0, 2.0), 1e-5);
        assert_close(image(0.0).radiance(Vec3::Z), Vec3::new(7.0, 3.0, 2.0), 1e-5);
        assert_close(image(0.0).radiance(Vec3::NEG_X), Vec3::new(11.0, 3.0, 2.0), 1e-5);
        assert_eq!(image(0.0).radiance(Vec3::Y).y, 0.0);
        assert_eq!(image(0.0).radiance(Vec3::NEG_Y).y, 6.0);
    }

    #[test]
    fn positive_rotation_is_counter_clockwise_seen_from_above() {
        for degrees in [90.0, -270.0, 30.0, 725.0] {
            let turn = glam::Quat::from_rotation_y(f32::to_radians(degrees));
            for i in 0..32 {
                let dir = center(f64::from(i % 8) + 0.3, f64::from(i / 8));
                // 725 degrees in f32 radians are off by 5e-7, times 8 / tau pixels, a step of up to 7, a scale of 2.
                assert_close(image(degrees).radiance(turn * dir), image(0.0).radiance(dir), 3e-5);
            }
        }
        // What was at +X is at -Z after a quarter turn.
        assert_close(image(90.0).radiance(Vec3::NEG_Z), image(0.0).radiance(Vec3::X), 1e-5);
    }

    #[test]
    fn quadrature_covers_the_sphere_once() {
        for sky in [Sky::Constant(Vec3::ONE), GRADIENT, image(25.0)] {
            let (area, first) = sky.quadrature().fold((0.0, DVec3::ZERO), |(area, first), (dir, solid_angle, _)| {
                assert!((dir.length() - 1.0).abs() < 1e-6);
                let solid_angle = f64::from(solid_angle);
                (area + solid_angle, first + solid_angle * dir.as_dvec3())
            });
            // Each f32 solid angle is off by 2^-24 of itself, each direction by 2^-24.
            assert!((area - 4.0 * PI).abs() < 4.0 * PI * 1e-7 && first.length() < 4.0 * PI * 2e-7, "{area} {first}");
        }
        assert_eq!(Sky::Black.quadrature().count(), 0);
    }

    #[test]
    fn gradient_sums_match_their_integrals() {
        let Sky::Gradient { zenith, horizon, ground } = GRADIENT else { unreachable!() };
        let (zenith, horizon, ground) = (zenith.as_dvec3(), horizon.as_dvec3(), ground.as_dvec3());
        // Integrals over y of each half times 2 pi. Tolerance: rounding to f32, 2^-24 of each term and direction.
        let total = TAU * ((horizon + zenith) / 2.0 + (horizon + ground) / 2.0);
        assert!((sum(&GRADIENT, |_| 1.0) / total - 1.0).abs().max_element() < 1e-6);
        let lit = TAU * (horizon / 6.0 + zenith / 3.0);
        assert!((sum(&GRADIENT, |dir| dir.y.max(0.0)) / lit - 1.0).abs().max_element() < 1e-6);
        // x^8 averages 35 / 128 (1 - y^2)^4 over a ring; of a constant sky its integral is 4 pi / 9.
        let eighth = sum(&Sky::Constant(Vec3::ONE), |dir| dir.x.powi(8));
        assert!((eighth * 9.0 / (4.0 * PI) - 1.0).abs().max_element() < 1e-6);
    }

    #[test]
    fn image_sums_agree_with_fine_sampling() {
        let sky = image(40.0);
        let (rows, columns) = (500, 1000);
        for weight in [|_: DVec3| 1.0, |dir: DVec3| dir.y.max(0.0), |dir: DVec3| dir.x * dir.z] {
            let mut expected = DVec3::ZERO;
            for row in 0..rows {
                let polar = PI * (f64::from(row) + 0.5) / f64::from(rows);
                for column in 0..columns {
                    let azimuth = TAU * (f64::from(column) + 0.5) / f64::from(columns);
                    let dir = DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), polar.sin() * azimuth.cos());
                    let area = polar.sin() * PI / f64::from(rows) * TAU / f64::from(columns);
                    expected += sky.radiance(dir.as_vec3()).as_dvec3() * area * weight(dir);
                }
            }
            // Both are midpoint rules: (pi / 500)^2 / 24 = 1.6e-6 of the second derivative, which is a few times the
            // total of about 4 pi * 14.
            assert!((sum(&sky, weight) - expected).abs().max_element() < 2e-3, "{} {expected}", sum(&sky, weight));
        }
    }

    #[test]
    fn black_is_noticed() {
        assert!(Sky::Black.is_black() && Sky::Constant(Vec3::ZERO).is_black());
        assert!(!GRADIENT.is_black() && !image(0.0).is_black());
        let Sky::Equirect { width, height, pixels, rotation, .. } = image(0.0) else { unreachable!() };
        assert!(Sky::Equirect { width, height, pixels, scale: 0.0, rotation }.is_black());
    }
}
