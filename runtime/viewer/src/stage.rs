//! The state at one moment: where everything is that moves.

use crate::objects::{MovingObject, ObjectShape};
use crate::state::{Ball, Door, LitObject, ViewState};
use glam::{Mat4, Quat, Vec3};
use localprt_runtime::{Occluder, OccluderShape};
use localprt_scenes::{Light, LightKind};

/// Seconds of one turn of what goes around.
const TURN_S: f32 = 8.0;
/// Radius of that turn, as a share of the shorter level side of the scene's box.
const TURN_SHARE: f32 = 0.15;
/// How far a swinging door opens, degrees.
const SWING: f32 = 100.0;

/// Lights and things at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Lights that shine.
    pub lights: Vec<Light>,
    /// What blocks relight rays.
    pub occluders: Vec<Occluder>,
    /// What is drawn and casts shadows.
    pub objects: Vec<MovingObject>,
}

impl Stage {
    /// The state after so many seconds of moving; all at rest at 0. `bounds`: corners of the scene's box, metres.
    pub fn new(state: &ViewState, bounds: (Vec3, Vec3), seconds: f32) -> Self {
        let turn = Turn::new(bounds, if state.animate { seconds } else { 0.0 });
        let mut stage = Self::default();
        for own in state.lights.iter().filter(|own| own.on) {
            let mut light = own.light.clone();
            if own.held {
                // Beside the eye: a light in it shows no shadows.
                light.position = state.viewpoint.eye() + 0.02 * state.viewpoint.focus_m * state.viewpoint.right();
                light.direction = state.viewpoint.ahead();
            } else if own.circles {
                match light.kind {
                    LightKind::Directional => light.direction = turn.rotation() * light.direction,
                    _ => light.position += turn.offset(),
                }
            }
            stage.lights.push(light);
        }
        for ball in &state.balls {
            stage.add_ball(ball, &turn);
        }
        if let Some(door) = &state.door {
            stage.add_door(door, &turn);
        }
        if let Some(object) = &state.object {
            stage.add_object(object, &turn);
        }
        stage
    }

    fn add_ball(&mut self, ball: &Ball, turn: &Turn) {
        let center = ball.center + if ball.circles { turn.offset() } else { Vec3::ZERO };
        let shape = OccluderShape::Sphere { center, radius: ball.radius_m };
        self.occluders.push(Occluder { shape, radiance: Vec3::ZERO });
        self.objects.push(MovingObject {
            shape: ObjectShape::Sphere,
            to_world: sphere(center, ball.radius_m),
            albedo: Vec3::splat(0.02),
            emission: Vec3::ZERO,
        });
    }

    fn add_door(&mut self, door: &Door, turn: &Turn) {
        let open = door.open + if door.swings { SWING * turn.there_and_back() } else { 0.0 };
        let rotation = Quat::from_rotation_y((door.direction + open).to_radians());
        let center = door.hinge + rotation * (0.5 * door.size_m * Vec3::new(1.0, 1.0, 0.0));
        let half_extents = 0.5 * door.size_m;
        self.occluders
            .push(Occluder { shape: OccluderShape::Box { center, half_extents, rotation }, radiance: Vec3::ZERO });
        self.objects.push(MovingObject {
            shape: ObjectShape::Box,
            to_world: Mat4::from_scale_rotation_translation(half_extents, rotation, center),
            albedo: door.albedo,
            emission: Vec3::ZERO,
        });
    }

    fn add_object(&mut self, object: &LitObject, turn: &Turn) {
        let center = object.center + if object.circles { turn.offset() } else { Vec3::ZERO };
        self.objects.push(MovingObject {
            shape: ObjectShape::Sphere,
            to_world: sphere(center, object.radius_m),
            albedo: object.albedo,
            emission: object.emission,
        });
    }
}

fn sphere(center: Vec3, radius_m: f32) -> Mat4 {
    Mat4::from_translation(center) * Mat4::from_scale(Vec3::splat(radius_m))
}

/// How far what goes around has come.
struct Turn {
    angle: f32,
    radius_m: f32,
}

impl Turn {
    fn new((low, high): (Vec3, Vec3), seconds: f32) -> Self {
        let size = high - low;
        let angle = (seconds / TURN_S).fract() * std::f32::consts::TAU;
        Self { angle, radius_m: TURN_SHARE * size.x.min(size.z) }
    }

    /// From the place at rest, where it starts and ends.
    fn offset(&self) -> Vec3 {
        let (sin, cos) = self.angle.sin_cos();
        self.radius_m * Vec3::new(sin, 0.0, cos - 1.0)
    }

    fn rotation(&self) -> Quat {
        Quat::from_rotation_y(self.angle)
    }

    /// 0 at rest, 1 half a turn later.
    fn there_and_back(&self) -> f32 {
        0.5 - 0.5 * self.angle.cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_starts_and_ends_at_rest() {
        let bounds = (Vec3::ZERO, Vec3::new(10.0, 3.0, 4.0));
        for seconds in [0.0, TURN_S, 3.0 * TURN_S] {
            let turn = Turn::new(bounds, seconds);
            assert!(turn.offset().length() < 1e-4 && turn.there_and_back() < 1e-4);
        }
        let half = Turn::new(bounds, 0.5 * TURN_S);
        // Twice the radius away, which is a share of the shorter side.
        assert!((half.offset().length() - 2.0 * TURN_SHARE * 4.0).abs() < 1e-4);
        assert!((half.there_and_back() - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_door_turns_about_its_hinge() {
        let door = Door {
            hinge: Vec3::new(1.0, 0.0, 2.0),
            size_m: Vec3::new(0.8, 2.0, 0.1),
            direction: 0.0,
            open: 90.0,
            albedo: Vec3::ONE,
            swings: false,
        };
        let mut stage = Stage::default();
        stage.add_door(&door, &Turn::new((Vec3::ZERO, Vec3::ONE), 0.0));
        let OccluderShape::Box { center, .. } = stage.occluders[0].shape else { panic!("a box") };
        // Opened by 90 degrees from +X about +Y: toward -Z.
        assert!(center.abs_diff_eq(Vec3::new(1.0, 1.0, 1.6), 1e-5), "{center}");
        let end = stage.objects[0].to_world.transform_point3(Vec3::new(1.0, -1.0, 0.0));
        assert!(end.abs_diff_eq(Vec3::new(1.0, 0.0, 1.2), 1e-5), "{end}");
    }
}
