//! A camera that is flown or led around a point.

use crate::options::View;
use glam::{Mat4, Quat, Vec3, Vec4Swizzles};
use localprt_scenes::Camera;

/// Steepest angle between the view and the horizon that turning leads to, radians.
const STEEPEST: f32 = 1.55;

/// Where the viewer looks from, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Camera to world, no scale; looks along -Z.
    pub to_world: Mat4,
    /// Vertical field of view, radians.
    pub fov_y: f32,
    /// Distance of the point that orbiting leads around, metres ahead.
    pub focus_m: f32,
}

impl Viewpoint {
    /// The place of a scene's camera.
    pub fn of_camera(camera: &Camera, focus_m: f32) -> Self {
        Self { to_world: camera.to_world, fov_y: camera.fov_y, focus_m }
    }

    /// For the passes, in a scene of this size in metres.
    pub fn view(&self, extent_m: f32) -> View {
        View { to_world: self.to_world, fov_y: self.fov_y, near_m: 5e-4 * extent_m }
    }

    /// Position, metres.
    pub fn eye(&self) -> Vec3 {
        self.to_world.w_axis.xyz()
    }

    /// Unit direction of the middle of the picture.
    pub fn ahead(&self) -> Vec3 {
        -self.to_world.z_axis.xyz().normalize_or(Vec3::Z)
    }

    /// Unit direction to the right of the picture.
    pub fn right(&self) -> Vec3 {
        self.to_world.x_axis.xyz().normalize_or(Vec3::X)
    }

    /// Unit direction up in the picture.
    pub fn up(&self) -> Vec3 {
        self.to_world.y_axis.xyz().normalize_or(Vec3::Y)
    }

    /// The point that orbiting leads around.
    pub fn focus(&self) -> Vec3 {
        self.eye() + self.focus_m * self.ahead()
    }

    /// Moves the eye: metres to the right, up in the world, ahead.
    pub fn fly(&mut self, right: f32, up: f32, ahead: f32) {
        let step = right * self.right() + up * Vec3::Y + ahead * self.ahead();
        self.to_world.w_axis += step.extend(0.0);
    }

    /// Turns about the eye: radians to the left and up.
    pub fn look(&mut self, left: f32, up: f32) {
        let eye = self.eye();
        self.turn(left, up, eye);
    }

    /// Leads around the focus, which stays in the middle of the picture: radians to the left and up.
    pub fn orbit(&mut self, left: f32, up: f32) {
        let focus = self.focus();
        self.turn(left, up, focus);
    }

    /// Moves along with the picture: pixels of a picture of this height, as seen at the focus.
    pub fn pan(&mut self, right_px: f32, down_px: f32, height_px: f32) {
        let metres = 2.0 * (0.5 * self.fov_y).tan() * self.focus_m / height_px.max(1.0);
        let step = metres * (down_px * self.up() - right_px * self.right());
        self.to_world.w_axis += step.extend(0.0);
    }

    /// Goes toward the focus, to this share of its distance.
    pub fn approach(&mut self, share: f32, nearest_m: f32) {
        let focus = self.focus();
        self.focus_m = (self.focus_m * share).max(nearest_m);
        self.to_world.w_axis = (focus - self.focus_m * self.ahead()).extend(1.0);
    }

    fn turn(&mut self, left: f32, up: f32, about: Vec3) {
        let pitch = self.ahead().y.clamp(-1.0, 1.0).asin();
        // Never over the top; a view that is already steeper only comes back.
        let up = (pitch + up).clamp(-STEEPEST.max(-pitch), STEEPEST.max(pitch)) - pitch;
        let turn = Quat::from_rotation_y(left) * Quat::from_axis_angle(self.right(), up);
        let move_to = Mat4::from_translation(about) * Mat4::from_quat(turn) * Mat4::from_translation(-about);
        let turned = move_to * self.to_world;
        // Roundings of many small turns must not add up.
        let axes = Quat::from_mat4(&turned).normalize();
        self.to_world = Mat4::from_rotation_translation(axes, turned.w_axis.xyz());
    }

    /// Origin and unit direction of the ray through a point of the picture: x to the right, y down, both 0..=1.
    pub fn ray(&self, x: f32, y: f32, aspect: f32) -> (Vec3, Vec3) {
        let half = (0.5 * self.fov_y).tan();
        let local = Vec3::new((2.0 * x - 1.0) * half * aspect, (1.0 - 2.0 * y) * half, -1.0);
        (self.eye(), self.to_world.transform_vector3(local).normalize_or(Vec3::NEG_Z))
    }

    /// Where a point is in the picture, x to the right, y down, both 0..=1 inside of it. `None` behind the eye.
    pub fn project(&self, point: Vec3, aspect: f32) -> Option<(f32, f32)> {
        let local = self.to_world.inverse().transform_point3(point);
        if local.z >= 0.0 {
            return None;
        }
        let half = (0.5 * self.fov_y).tan() * -local.z;
        Some((0.5 + 0.5 * local.x / (half * aspect), 0.5 - 0.5 * local.y / half))
    }

    /// Between two viewpoints: 0 is `self`, 1 the other.
    pub fn mix(&self, other: &Self, share: f32) -> Self {
        let axes = |viewpoint: &Self| Quat::from_mat4(&viewpoint.to_world).normalize();
        let rotation = axes(self).slerp(axes(other), share);
        Self {
            to_world: Mat4::from_rotation_translation(rotation, self.eye().lerp(other.eye(), share)),
            fov_y: self.fov_y + share * (other.fov_y - self.fov_y),
            focus_m: self.focus_m + share * (other.focus_m - self.focus_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::camera::rh::view::look_at_mat4;

    fn viewpoint() -> Viewpoint {
        let to_world = look_at_mat4(Vec3::new(0.0, 1.0, 5.0), Vec3::Y, Vec3::Y).inverse();
        Viewpoint { to_world, fov_y: 1.0, focus_m: 5.0 }
    }

    #[test]
    fn flying_follows_the_view_and_looking_keeps_the_place() {
        let mut at = viewpoint();
        at.fly(1.0, 2.0, 3.0);
        assert!(at.eye().abs_diff_eq(Vec3::new(1.0, 3.0, 2.0), 1e-5), "{}", at.eye());
        let eye = at.eye();
        at.look(std::f32::consts::FRAC_PI_2, 0.0);
        assert!(at.ahead().abs_diff_eq(Vec3::NEG_X, 1e-5), "{}", at.ahead());
        assert!(at.eye().abs_diff_eq(eye, 1e-5));
    }

    #[test]
    fn orbiting_keeps_the_focus_and_its_distance() {
        let mut at = viewpoint();
        let focus = at.focus();
        for _ in 0..1000 {
            at.orbit(0.3, 0.01);
        }
        // A thousand turns, each rounded to f32 at 5 m.
        assert!(at.focus().abs_diff_eq(focus, 1e-2), "{}", at.focus());
        assert!(at.ahead().y.asin() <= STEEPEST + 1e-3, "not over the top");
        assert!(at.right().y.abs() < 1e-3, "the horizon stays level");
    }

    #[test]
    fn rays_and_projection_are_inverse() {
        let mut at = viewpoint();
        at.look(0.4, -0.3);
        for (x, y) in [(0.5, 0.5), (0.1, 0.9), (0.8, 0.2)] {
            let (origin, dir) = at.ray(x, y, 1.5);
            let (u, v) = at.project(origin + 3.0 * dir, 1.5).expect("before the eye");
            assert!((u - x).abs() < 1e-5 && (v - y).abs() < 1e-5, "{u} {v} for {x} {y}");
            assert_eq!(at.project(origin - 3.0 * dir, 1.5), None);
        }
    }

    #[test]
    fn approaching_keeps_the_focus() {
        let mut at = viewpoint();
        let focus = at.focus();
        at.approach(0.5, 0.1);
        assert!(at.focus().abs_diff_eq(focus, 1e-5));
        assert!((at.eye().distance(focus) - 2.5).abs() < 1e-5);
    }
}
