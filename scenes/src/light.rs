//! Punctual lights, and what they send to a point, by the formulas of KHR_lights_punctual.

use glam::Vec3;

/// A punctual light as in KHR_lights_punctual.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name for messages.
    pub name: String,
    /// Type with its own parameters.
    pub kind: LightKind,
    /// World position in metres (not used by directional lights).
    pub position: Vec3,
    /// Unit direction in which the light travels (not used by point lights).
    pub direction: Vec3,
    /// Linear color.
    pub color: Vec3,
    /// Candela for point and spot, lux for directional.
    pub intensity: f32,
    /// Distance in metres at which the light is cut off; `None` is infinite.
    pub range: Option<f32>,
}

/// Type of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines everywhere alike.
    Point,
    /// A cone; half angles in radians.
    Spot {
        /// Full intensity inside.
        inner_cone: f32,
        /// None outside.
        outer_cone: f32,
    },
    /// Parallel light.
    Directional,
}

/// Light that arrives at a point, if nothing is in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit direction from the point to the light.
    pub dir_to_light: Vec3,
    /// Metres to the light; infinite for directional ones.
    pub distance: f32,
    /// Irradiance on a surface that faces the light, per color band. Times the cosine gives a surface's irradiance.
    pub irradiance: Vec3,
}

impl Light {
    /// Light arriving at `point` (metres). `None` where there is none: out of range, outside of the cone, at the light
    /// itself, or from a light of no intensity.
    ///
    /// Source: KHR_lights_punctual, "Range Property" and "Inner and Outer Cone Angles".
    pub fn incident(&self, point: Vec3) -> Option<Incident> {
        let emitted = self.color * self.intensity;
        let (dir_to_light, distance, attenuation) = match self.kind {
            LightKind::Directional => (-self.direction, f32::INFINITY, 1.0),
            LightKind::Point | LightKind::Spot { .. } => {
                let to_light = self.position - point;
                let distance = to_light.length();
                if distance == 0.0 {
                    return None;
                }
                let dir_to_light = to_light / distance;
                let window = self.range.map_or(1.0, |range| (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0));
                (dir_to_light, distance, window * self.cone(-dir_to_light) / (distance * distance))
            }
        };
        let irradiance = emitted * attenuation;
        // Also false for the NaN of a point at an infinite distance.
        (irradiance.max_element() > 0.0).then_some(Incident { dir_to_light, distance, irradiance })
    }

    /// Share of the intensity that goes in a direction (unit, away from the light).
    fn cone(&self, dir_from_light: Vec3) -> f32 {
        let LightKind::Spot { inner_cone, outer_cone } = self.kind else {
            return 1.0;
        };
        // The least width 0.001 is part of the specification's formula.
        let scale = 1.0 / (inner_cone.cos() - outer_cone.cos()).max(0.001);
        let offset = -outer_cone.cos() * scale;
        let ramp = (self.direction.dot(dir_from_light) * scale + offset).clamp(0.0, 1.0);
        ramp * ramp
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: LightKind) -> Light {
        Light {
            name: String::new(),
            kind,
            position: Vec3::new(1.0, 3.0, 0.0),
            direction: Vec3::NEG_Y,
            color: Vec3::new(1.0, 0.5, 0.0),
            intensity: 8.0,
            range: None,
        }
    }

    #[test]
    fn point_light_falls_with_the_square() {
        let incident = light(LightKind::Point).incident(Vec3::new(1.0, 1.0, 0.0)).unwrap();
        assert_eq!(incident, Incident { dir_to_light: Vec3::Y, distance: 2.0, irradiance: Vec3::new(2.0, 1.0, 0.0) });
        assert_eq!(light(LightKind::Point).incident(Vec3::new(1.0, 3.0, 0.0)), None);
    }

    #[test]
    fn range_windows_the_falloff() {
        let light = Light { range: Some(4.0), ..light(LightKind::Point) };
        // (1 - (2/4)^4) / 2^2 of 8 cd.
        assert_eq!(light.incident(Vec3::new(1.0, 1.0, 0.0)).unwrap().irradiance.x, 8.0 * 0.9375 / 4.0);
        assert_eq!(light.incident(Vec3::new(1.0, -1.0, 0.0)), None);
        assert_eq!(light.incident(Vec3::new(1.0, -9.0, 0.0)), None);
    }

    #[test]
    fn spot_ramps_between_its_cones() {
        let (inner_cone, outer_cone) = (0.3f32, 0.8f32);
        let light = light(LightKind::Spot { inner_cone, outer_cone });
        let at = |angle: f32| {
            let from_light = Vec3::new(angle.sin(), -angle.cos(), 0.0);
            light.incident(light.position + from_light).map_or(0.0, |incident| incident.irradiance.x / 8.0)
        };
        // Rounding of the unit vector and of the distance: a few 2^-24, times the ramp's slope of at most 4.
        assert!((at(0.0) - 1.0).abs() < 1e-5 && (at(0.29) - 1.0).abs() < 1e-5);
        let middle = ((inner_cone.cos() + outer_cone.cos()) / 2.0).acos();
        assert!((at(middle) - 0.25).abs() < 1e-5, "{}", at(middle));
        assert_eq!(at(0.81), 0.0);
        assert_eq!(at(3.0), 0.0);
    }

    #[test]
    fn directional_light_is_the_same_everywhere() {
        let light = Light { range: Some(1.0), ..light(LightKind::Directional) };
        for point in [Vec3::ZERO, Vec3::splat(1e6)] {
            let incident = light.incident(point).unwrap();
            assert_eq!(incident.dir_to_light, Vec3::Y);
            assert_eq!(incident.distance, f32::INFINITY);
            assert_eq!(incident.irradiance, Vec3::new(8.0, 4.0, 0.0));
        }
    }

    #[test]
    fn a_light_that_is_off_sends_nothing() {
        let off = Light { intensity: 0.0, ..light(LightKind::Directional) };
        assert_eq!(off.incident(Vec3::ZERO), None);
    }
}
