//! From Bevy's lights, sky and materials to localprt's, in the space of the baked scene.
//!
//! Bevy's lamps have lumens, over 4 pi sr for points and spots alike; localprt's have candela, as glTF has. Suns have lux in both.

use crate::relit::SkyRadiance;
use bevy::color::{Color, LinearRgba};
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::math::{Affine3A, Vec3};
use localprt_runtime::VolumeTextures;
use localprt_scenes::{Light, LightKind, MaterialOverride, Sky};
use std::f32::consts::PI;

/// From lumens of a lamp to candela.
pub(crate) const CANDELA_PER_LUMEN: f32 = 1.0 / (4.0 * PI);

/// What emission may differ by from the scene's own and still be it: two products of the same two factors.
const SAME_EMISSION: f32 = 1e-6;

/// `place` is in the space of the baked scene; so for the others. `None` for a light that is off or not finite.
pub(crate) fn point(light: &PointLight, place: &Affine3A) -> Option<Light> {
    lamp(LightKind::Point, place, light.color, light.intensity, light.range)
}

pub(crate) fn spot(light: &SpotLight, place: &Affine3A) -> Option<Light> {
    let kind = LightKind::Spot { inner_cone: light.inner_angle.min(light.outer_angle), outer_cone: light.outer_angle };
    lamp(kind, place, light.color, light.intensity, light.range)
}

pub(crate) fn directional(light: &DirectionalLight, place: &Affine3A) -> Option<Light> {
    finished(LightKind::Directional, place, light.color, light.illuminance, None)
}

fn lamp(kind: LightKind, place: &Affine3A, color: Color, lumens: f32, range_m: f32) -> Option<Light> {
    let range = range_m.is_finite().then_some(range_m);
    finished(kind, place, color, lumens * CANDELA_PER_LUMEN, range)
}

fn finished(kind: LightKind, place: &Affine3A, color: Color, intensity: f32, range: Option<f32>) -> Option<Light> {
    let position = vec3(place.translation.into());
    // Bevy's lights shine along -Z.
    let direction = vec3((place.matrix3 * -Vec3::Z).normalize_or(Vec3::NEG_Y));
    let color = rgb(color.to_linear());
    let is_on = intensity > 0.0 && intensity.is_finite() && range.is_none_or(|range| range > 0.0);
    let light = Light { name: String::new(), kind, position, direction, color, intensity, range };
    (is_on && position.is_finite() && direction.is_finite() && color.is_finite()).then_some(light)
}

/// The override of a material with an emission in cd/m², given the scene's own; none if it is that, or not finite.
pub(crate) fn emission(emissive: LinearRgba, own: glam::Vec3) -> MaterialOverride {
    let now = rgb(emissive);
    let is_own = (now - own).abs().max_element() <= SAME_EMISSION * own.abs().max_element();
    MaterialOverride { emission: (!is_own && now.is_finite()).then_some(now), ..MaterialOverride::default() }
}

pub(crate) fn sky(sky: &SkyRadiance) -> Sky {
    let radiance =
        [sky.zenith, sky.horizon, sky.ground].map(|radiance| if radiance.is_finite() { radiance } else { Vec3::ZERO });
    let [zenith, horizon, ground] = radiance.map(vec3);
    Sky::Gradient { zenith, horizon, ground }
}

/// Center and size, metres, of the box that Bevy stretches a volume's cells over: half a cell beyond the outermost ones.
pub(crate) fn volume_box(origin: [f32; 3], spacing_m: f32, dims: [u32; 3]) -> (Vec3, Vec3) {
    let cells = Vec3::from_array(dims.map(|dim| dim as f32));
    (Vec3::from_array(origin) + 0.5 * spacing_m * (cells - 1.0), spacing_m * cells)
}

/// Texels of Bevy's layout of ambient cubes, for so many cells.
pub(crate) fn voxel_texels([x, y, z]: [u32; 3]) -> [u32; 3] {
    [x, 2 * y, 3 * z]
}

/// The four textures of degree 1, whatever the degree is.
pub(crate) fn of_degree_1<'a>(volume: &VolumeTextures<'a>) -> Option<[&'a wgpu::TextureView; 4]> {
    volume.coefficients.first_chunk::<4>().map(<[wgpu::TextureView; 4]>::each_ref)
}

/// Of Bevy's glam, which is another version.
fn vec3(vector: Vec3) -> glam::Vec3 {
    glam::Vec3::from_array(vector.to_array())
}

fn rgb(color: LinearRgba) -> glam::Vec3 {
    glam::Vec3::new(color.red, color.green, color.blue)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Quat;

    fn place() -> Affine3A {
        Affine3A::from_rotation_translation(Quat::from_rotation_y(PI / 2.0), Vec3::new(1.0, 2.0, 3.0))
    }

    #[test]
    fn a_lamp_of_4_pi_lumens_has_one_candela() {
        let light = PointLight { intensity: 4.0 * PI, range: 7.0, ..PointLight::default() };
        let found = point(&light, &place()).unwrap();
        assert!((found.intensity - 1.0).abs() < 1e-6, "{}", found.intensity);
        assert_eq!((found.kind, found.range), (LightKind::Point, Some(7.0)));
        assert_eq!(found.position, glam::Vec3::new(1.0, 2.0, 3.0));
        // At one metre a candela is a lux, but for the window of the range.
        let lux = found.incident(found.position + glam::Vec3::X).unwrap().irradiance.x;
        assert!((lux - (1.0 - (1.0f32 / 7.0).powi(4))).abs() < 1e-5, "{lux}");
    }

    #[test]
    fn spots_and_suns_shine_along_their_minus_z() {
        let light = SpotLight { intensity: 8.0 * PI, inner_angle: 0.5, outer_angle: 0.4, ..SpotLight::default() };
        let found = spot(&light, &place()).unwrap();
        assert!((found.intensity - 2.0).abs() < 1e-6, "{}", found.intensity);
        // An inner cone wider than the outer one ends with it.
        assert_eq!(found.kind, LightKind::Spot { inner_cone: 0.4, outer_cone: 0.4 });
        let sun = DirectionalLight { illuminance: 1e5, ..DirectionalLight::default() };
        let found_sun = directional(&sun, &place()).unwrap();
        assert_eq!((found_sun.intensity, found_sun.range), (1e5, None));
        for direction in [found.direction, found_sun.direction] {
            assert!((direction - glam::Vec3::NEG_X).length() < 1e-6, "{direction}");
        }
    }

    #[test]
    fn colors_are_linear() {
        let light = PointLight { color: Color::srgb(0.5, 1.0, 0.0), ..PointLight::default() };
        let color = point(&light, &place()).unwrap().color;
        // ((0.5 + 0.055) / 1.055)^2.4.
        assert!((color - glam::Vec3::new(0.214_041, 1.0, 0.0)).abs().max_element() < 1e-5, "{color}");
    }

    #[test]
    fn lights_that_are_off_or_broken_are_left_out() {
        let is_taken =
            |intensity, range| point(&PointLight { intensity, range, ..PointLight::default() }, &place()).is_some();
        assert!(is_taken(1.0, 20.0) && is_taken(1.0, f32::INFINITY));
        assert!(!is_taken(0.0, 20.0) && !is_taken(-1.0, 20.0) && !is_taken(f32::NAN, 20.0) && !is_taken(1.0, 0.0));
        let nowhere = Affine3A::from_translation(Vec3::splat(f32::NAN));
        assert!(point(&PointLight::default(), &nowhere).is_none());
    }

    #[test]
    fn only_changed_emission_overrides() {
        let own = glam::Vec3::new(0.8 * 3.7, 0.1 * 3.7, 0.0);
        let same = LinearRgba::rgb(0.8, 0.1, 0.0) * 3.7;
        assert_eq!(emission(same, own).emission, None);
        assert_eq!(emission(LinearRgba::rgb(3.0, 0.37, 0.0), own).emission, Some(glam::Vec3::new(3.0, 0.37, 0.0)));
        assert_eq!(emission(LinearRgba::BLACK, own).emission, Some(glam::Vec3::ZERO));
        assert_eq!(emission(LinearRgba::BLACK, glam::Vec3::ZERO).emission, None);
        assert_eq!(emission(LinearRgba::rgb(f32::NAN, 0.0, 0.0), own).emission, None);
        assert_eq!(emission(LinearRgba::rgb(f32::INFINITY, 0.0, 0.0), own).emission, None);
    }

    #[test]
    fn cells_lie_in_the_middle_of_their_voxels() {
        let (center, size) = volume_box([-1.0, 0.0, 2.0], 0.5, [5, 3, 1]);
        assert_eq!((center, size), (Vec3::new(0.0, 0.5, 2.0), Vec3::new(2.5, 1.5, 0.5)));
        // The middle of the first voxel is the first cell.
        assert_eq!(center - 0.5 * size + 0.25, Vec3::new(-1.0, 0.0, 2.0));
        assert_eq!(voxel_texels([5, 3, 1]), [5, 6, 3]);
    }
}
