//! Sample points of a texel: direct light is its mean over them.

use glam::{Vec2, Vec3};
use localprt_scenes::SurfacePoint;

/// A sample point of a texel in 16 bytes, as the shaders read it.
///
/// Its offset from the texel's own point is off by at most 2^-17 of each coordinate, the geometric normal by 0.4 degrees,
/// which decides about horizons and lifts points off their surface, the shading normal by 1e-4 radians.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
pub struct TexelSample {
    /// Words x, y, z: the upper 24 bits of the offset's f32, and the geometric normal in 8 bits, -127..=127. The last word: the
    /// shading normal on the octahedron, two times 16 bits (Meyer et al. 2010).
    words: [u32; 4],
}

const OFFSET_BITS: u32 = !0xff;

impl TexelSample {
    /// A point of a texel whose own point lies at `texel_position`.
    pub fn new(point: &SurfacePoint, texel_position: Vec3) -> Self {
        let offset = (point.position - texel_position).to_array();
        let geometric_normal = (127.0 * point.geometric_normal).round().to_array();
        let word = |axis: usize| rounded(offset[axis]) | u32::from(geometric_normal[axis] as i8 as u8);
        let [u, v] = octahedral(point.normal).to_array().map(|value| (32767.0 * value).round() as i16 as u16);
        Self { words: [word(0), word(1), word(2), u32::from(u) | u32::from(v) << 16] }
    }

    /// The point, given that of its texel.
    pub fn point(self, texel_position: Vec3) -> SurfacePoint {
        let [x, y, z, shading] = self.words;
        let offset = Vec3::from([x, y, z].map(|word| f32::from_bits(word & OFFSET_BITS)));
        let geometric_normal = Vec3::from([x, y, z].map(|word| f32::from(word as u8 as i8)));
        let normal = Vec2::new(f32::from(shading as u16 as i16), f32::from((shading >> 16) as u16 as i16)) / 32767.0;
        SurfacePoint {
            position: texel_position + offset,
            normal: from_octahedral(normal),
            geometric_normal: geometric_normal.normalize_or_zero(),
        }
    }

    /// Whether the offset is finite.
    pub(crate) fn is_finite(self) -> bool {
        self.words[..3].iter().all(|word| f32::from_bits(word & OFFSET_BITS).is_finite())
    }
}

/// Bits of the nearest f32 whose last 8 bits are 0.
fn rounded(value: f32) -> u32 {
    let half = if value.is_finite() { 0x80 } else { 0 };
    (value.to_bits() + half) & OFFSET_BITS
}

/// A unit vector on the octahedron, folded into a square of -1..=1.
fn octahedral(normal: Vec3) -> Vec2 {
    let sum = normal.abs().element_sum();
    if sum == 0.0 {
        return Vec2::ZERO;
    }
    let flat = normal.truncate() / sum;
    if normal.z >= 0.0 { flat } else { (1.0 - Vec2::new(flat.y, flat.x).abs()) * flat.signum() }
}

fn from_octahedral(flat: Vec2) -> Vec3 {
    let z = 1.0 - flat.abs().element_sum();
    let fold = (-z).max(0.0);
    let folded = flat - Vec2::select(flat.cmpge(Vec2::ZERO), Vec2::splat(fold), Vec2::splat(-fold));
    folded.extend(z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_as_they_were() {
        let texel = Vec3::new(3.0, -20.0, 7.0);
        let spread = |seed: f32| Vec3::new((12.9 * seed).sin(), (7.3 * seed).sin(), (3.1 * seed + 1.0).sin());
        for seed in 0..1000 {
            let seed = seed as f32;
            let offset = 0.05 * spread(seed);
            let (normal, geometric_normal) = (spread(seed + 0.3).normalize(), spread(seed + 0.7).normalize());
            let point = SurfacePoint { position: texel + offset, normal, geometric_normal };
            let back = TexelSample::new(&point, texel).point(texel);
            // Rounded offset, and two sums of f32 of at most 32: 2^-19 each.
            let apart = (back.position - point.position).abs();
            assert!(apart.cmple(offset.abs() * 2.0f32.powi(-17) + 4e-6).all(), "{seed}: {apart}");
            // Half a step of each coordinate: sqrt(3) / 254; and half a step on the octahedron, stretched by at most 3.
            assert!(back.geometric_normal.distance(geometric_normal) < 0.0069, "{seed}");
            assert!(back.normal.distance(normal) < 1e-4, "{seed}: {} {normal}", back.normal);
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            let point = SurfacePoint { position: texel, normal: axis, geometric_normal: axis };
            assert_eq!(TexelSample::new(&point, texel).point(texel), point);
        }
    }

    #[test]
    fn offsets_without_end_are_told() {
        let at = |x: f32| SurfacePoint { position: Vec3::new(x, 0.0, 0.0), normal: Vec3::Y, geometric_normal: Vec3::Y };
        for (x, is_finite) in [(1.0, true), (1e30, true), (f32::INFINITY, false), (f32::NAN, false), (f32::MAX, false)]
        {
            assert_eq!(TexelSample::new(&at(x), Vec3::ZERO).is_finite(), is_finite, "{x}");
        }
    }
}
