//! What a host computes in its own fragment shader from SH coefficients of degree 1: irradiance about a normal map's normal,
//! and an approximate mirror reflection of indirect light (sec. 5.1).
//!
//! A volume holds SH radiance. A receiver holds coefficients of the same form that are fitted to irradiance about the normals around its
//! own, a + b·n (`formats/SPEC.md`, Outputs): [`irradiance`] reads both, a light is taken out of them by [`dominant_light`] and
//! [`receiver_light`].
//!
//! The CPU twin of `shaders/host.wgsl`, whose text is `HOST_WGSL`. World axes; directions are unit length and point away
//! from the surface. Radiance in W sr^-1 m^-2, irradiance in W m^-2; diffuse reflection is albedo / pi times irradiance.

use glam::Vec3;
use localprt_formats::sh::irradiance_weights_degree_1;
use localprt_scenes::luminance;
use std::f32::consts::PI;

/// Y_00.
const SH_0: f32 = 0.282_094_8;
/// Y_1m over y, z, x.
const SH_1: f32 = 0.488_602_5;

/// Least roughness that [`specular`] uses. Below it GGX lobes are narrower than anything four coefficients can say, and
/// f32 loses their peaks.
pub const LEAST_ROUGHNESS: f32 = 0.1;

/// SH coefficients of degree 1, by SH index: Y_00, then Y_1-1, Y_10, Y_11, which point along y, z and x. Of radiance, or of a receiver.
pub type RadianceDegree1 = [Vec3; 4];

/// Irradiance about a shading normal, W m^-2; not negative.
///
/// Of a receiver it is exact about the surface's own normal, and best about those within 60° of it. Of SH radiance it is exact there for
/// constant light from the hemisphere, as degrees of 2 and more have no part in it; elsewhere as good as degree 1 can be.
///
/// Source: Ramamoorthi and Hanrahan 2001.
pub fn irradiance(radiance: &RadianceDegree1, normal: Vec3) -> Vec3 {
    let weights = irradiance_weights_degree_1(normal.to_array());
    let sum: Vec3 = radiance.iter().zip(weights).map(|(&coefficient, weight)| coefficient * weight).sum();
    sum.max(Vec3::ZERO)
}

/// Irradiance about a normal of something that light reaches from all around, W m^-2; not negative, and without the dark
/// spot that [`irradiance`] has opposite of a bright light.
///
/// Each band by itself has a curve about the axis of its linear terms: constant for light from everywhere, ((1 + cos) / 2)^3
/// of the light for a single one. The mean over all normals is that of the coefficients, the linear part within a tenth.
/// Degree 1 knows no surface: where one hides half of the directions, [`irradiance`] is exact and this is not.
///
/// Source: Hazel 2017, Converting SH Radiance to Irradiance, of the Enlighten solver.
pub fn irradiance_from_all_around(radiance: &RadianceDegree1, normal: Vec3) -> Vec3 {
    let [c0, cy, cz, cx] = *radiance;
    let band = |band: usize| {
        let mean = PI * SH_0 * c0[band];
        let axis = PI / 3.0 * SH_1 * Vec3::new(cx[band], cy[band], cz[band]);
        let length = axis.length();
        if mean <= 0.0 {
            return 0.0;
        }
        // More than 1 is no light's, but rounding's or the compression's.
        let ratio = (length / mean).min(1.0);
        let cosine = if length > 0.0 { axis.dot(normal) / length } else { 0.0 };
        let power = 1.0 + 2.0 * ratio;
        let constant = (1.0 - ratio) / (1.0 + ratio);
        let lobe = (power + 1.0) * (0.5 + 0.5 * cosine).clamp(0.0, 1.0).powf(power);
        mean * (constant + (1.0 - constant) * lobe)
    };
    Vec3::new(band(0), band(1), band(2))
}

/// SH radiance of degree 1 as one directional light in constant surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DominantLight {
    /// Unit, toward the light; zero if no direction is brighter than another.
    pub dir_to_light: Vec3,
    /// Of a surface that faces the light, W m^-2.
    pub irradiance: Vec3,
    /// Radiance of the surroundings, W sr^-1 m^-2.
    pub ambient: Vec3,
}

/// The linear terms as a directional light, the rest of the constant one as surroundings.
///
/// The direction is that of the linear terms' luminance. A light of irradiance E from d has the coefficients E Y_k(d), so
/// the linear terms give E, each color projected on d, and what they leave of the first is the surroundings'. The
/// vector irradiance of any light is no longer than its scalar irradiance, so both are positive for radiance that is.
///
/// Source: Sloan 2008, Stupid Spherical Harmonics Tricks, "Extracting Dominant Light Direction".
pub fn dominant_light(radiance: &RadianceDegree1) -> DominantLight {
    let [c0, cy, cz, cx] = *radiance;
    let axis = Vec3::from([cx, cy, cz].map(|color| luminance(color) as f32));
    let size = axis.length();
    let dir_to_light = if size > 0.0 { axis / size } else { Vec3::ZERO };
    let along = dir_to_light.x * cx + dir_to_light.y * cy + dir_to_light.z * cz;
    let irradiance = (along / SH_1).max(Vec3::ZERO);
    let ambient = ((c0 - SH_0 * irradiance) * SH_0).max(Vec3::ZERO);
    DominantLight { dir_to_light, irradiance, ambient }
}

/// What a receiver holds as one directional light in constant surroundings: b of a + b·n is the light and a is the irradiance of the
/// surroundings, so that a surface that faces the light gets the a + |b| that [`irradiance`] gives.
///
/// The direction is that of b's luminance, each color projected on it.
pub fn receiver_light(receiver: &RadianceDegree1) -> DominantLight {
    let [c0, cy, cz, cx] = *receiver;
    let axis = Vec3::from([cx, cy, cz].map(|color| luminance(color) as f32));
    let dir_to_light = axis.try_normalize().unwrap_or(Vec3::ZERO);
    let along = dir_to_light.x * cx + dir_to_light.y * cy + dir_to_light.z * cz;
    let irradiance = (2.0 / 3.0 * PI * SH_1 * along).max(Vec3::ZERO);
    DominantLight { dir_to_light, irradiance, ambient: (SH_0 * c0).max(Vec3::ZERO) }
}

/// Radiance that a directional light's mirror reflection sends to the eye: Cook-Torrance with GGX, height-correlated Smith
/// and Schlick's Fresnel term.
///
/// `irradiance` is that of a surface facing the light, `f0` the reflectance head on, `roughness` the square root of the
/// width alpha, 0..=1, as in glTF.
pub fn specular(
    dir_to_light: Vec3,
    irradiance: Vec3,
    normal: Vec3,
    dir_to_eye: Vec3,
    f0: Vec3,
    roughness: f32,
) -> Vec3 {
    let n_l = normal.dot(dir_to_light);
    let n_v = normal.dot(dir_to_eye).max(1e-4);
    if n_l <= 0.0 {
        return Vec3::ZERO;
    }
    // Light and eye opposite of each other have no half vector; the normal is one of many.
    let between = dir_to_light + dir_to_eye;
    let size = between.length();
    let half_dir = if size > 1e-6 { between / size } else { normal };
    let rough = roughness.clamp(LEAST_ROUGHNESS, 1.0);
    let alpha = rough * rough;
    let brdf = ggx(normal, half_dir, alpha) * smith(n_l, n_v, alpha);
    schlick(f0, dir_to_light.dot(half_dir)) * irradiance * (brdf * n_l)
}

/// The approximate indirect mirror reflection of sec. 5.1: that of a receiver's light.
pub fn indirect_specular(receiver: &RadianceDegree1, normal: Vec3, dir_to_eye: Vec3, f0: Vec3, roughness: f32) -> Vec3 {
    let light = receiver_light(receiver);
    specular(light.dir_to_light, light.irradiance, normal, dir_to_eye, f0, roughness)
}

/// Density of microfacet normals, sr^-1, for half vectors above the surface.
///
/// The sine comes from the cross product, as 1 - cos^2 has no digits left near the peak.
///
/// Source: D of Walter et al. 2007, Eq. (33).
pub fn ggx(normal: Vec3, half_dir: Vec3, alpha: f32) -> f32 {
    let n_h = normal.dot(half_dir);
    if n_h <= 0.0 {
        return 0.0;
    }
    let across = normal.cross(half_dir);
    let spread = alpha / (across.dot(across) + n_h * n_h * alpha * alpha);
    spread * spread / PI
}

/// Height-correlated Smith shadowing and masking over 4 n_l n_v.
///
/// Source: Heitz 2014, Understanding the Masking-Shadowing Function, Eq. (99).
pub fn smith(n_l: f32, n_v: f32, alpha: f32) -> f32 {
    let alpha_2 = alpha * alpha;
    let masking = n_l * (n_v * n_v * (1.0 - alpha_2) + alpha_2).sqrt();
    let shadowing = n_v * (n_l * n_l * (1.0 - alpha_2) + alpha_2).sqrt();
    0.5 / (masking + shadowing)
}

/// Reflectance at an angle to the half vector, from that head on.
///
/// Source: Schlick 1994.
pub fn schlick(f0: Vec3, cosine: f32) -> Vec3 {
    let rest = (1.0 - cosine).clamp(0.0, 1.0);
    let rest_2 = rest * rest;
    f0 + (Vec3::ONE - f0) * (rest_2 * rest_2 * rest)
}

#[cfg(test)]
mod tests;
