//! A camera for scenes without one.

use glam::{Mat4, Vec3, camera::rh::view::look_at_mat4};
use localprt_scenes::Camera;
use localprt_surfaces::rays::RayCaster;

/// Vertical field of view, radians: that of a 28 mm lens on 36 x 24 mm, as for interiors.
const FOV_Y: f32 = 0.81;
/// Half width over half height of the cone of test rays.
const TEST_ASPECT: f32 = 4.0 / 3.0;
/// Test rays across and down a view.
const TEST_RAYS: [u32; 2] = [9, 7];

/// A view of a scene: from within if there is a space that walls enclose for the most part, from outside and above a
/// corner of its box otherwise. `None` for a scene without triangles.
pub fn default_camera(caster: &RayCaster<'_>) -> Option<Camera> {
    let (low, high) = caster.scene().bounds()?;
    let view = inside(caster, low, high).unwrap_or_else(|| outside(caster, low, high));
    Some(view.camera())
}

#[derive(Clone, Copy)]
struct View {
    eye: Vec3,
    target: Vec3,
}

impl View {
    fn camera(self) -> Camera {
        Camera { name: "default".into(), to_world: self.to_world(), fov_y: FOV_Y, aspect: None }
    }

    fn to_world(self) -> Mat4 {
        look_at_mat4(self.eye, self.target, Vec3::Y).inverse()
    }

    /// Distances at which rays over the whole view meet surfaces that show something; 0 for black backs, `None` for none.
    fn test(self, caster: &RayCaster<'_>) -> Vec<Option<f32>> {
        let half = (FOV_Y * 0.5).tan();
        let to_world = self.to_world();
        let [across, down] = TEST_RAYS;
        let ray = |index: u32| {
            let step = |index: u32, count: u32| 2.0 * (index as f32 + 0.5) / count as f32 - 1.0;
            let x = step(index % across, across) * half * TEST_ASPECT;
            let dir = to_world.transform_vector3(Vec3::new(x, step(index / across, down) * half, -1.0)).normalize();
            caster.closest_hit(self.eye, dir).map(|hit| if hit.point.is_some() { hit.t } else { 0.0 })
        };
        (0..across * down).map(ray).collect()
    }
}

/// Best of eight level directions at points of a coarse grid over the box: the deepest view in which nine rays of ten
/// meet the front of a surface. Points that see out in four directions of ten, or see backs, are not inside.
fn inside(caster: &RayCaster<'_>, low: Vec3, high: Vec3) -> Option<View> {
    let size = high - low;
    let mut best: Option<(f32, View)> = None;
    for cell in 0..5 * 3 * 5 {
        let cell = Vec3::new((cell % 5) as f32, (cell / 5 % 3) as f32, (cell / 15) as f32);
        let eye = low + size * (cell + 0.5) / Vec3::new(5.0, 3.0, 5.0);
        if !is_inside(caster, eye) {
            continue;
        }
        for turn in 0..8 {
            let angle = turn as f32 * std::f32::consts::FRAC_PI_4;
            // Slightly down: floors tell more than ceilings.
            let view = View { eye, target: eye + Vec3::new(angle.sin(), -0.1, angle.cos()) };
            let rays = view.test(caster);
            let shown = rays.iter().flatten().filter(|&&distance| distance > 0.0).count();
            // Something close to the eye hides the rest.
            let nearest = rays.iter().flatten().copied().fold(f32::INFINITY, f32::min);
            if shown * 10 < rays.len() * 9 || nearest < 0.01 * size.max_element() {
                continue;
            }
            // The mean of square roots prefers an even depth to one long ray.
            let score = rays.iter().flatten().map(|distance| distance.sqrt()).sum::<f32>();
            if best.is_none_or(|(held, _)| score > held) {
                best = Some((score, view));
            }
        }
    }
    best.map(|(_, view)| view)
}

fn is_inside(caster: &RayCaster<'_>, point: Vec3) -> bool {
    const RAYS: u32 = 64;
    let (mut fronts, mut backs) = (0, 0);
    for index in 0..RAYS {
        // Spherical Fibonacci points.
        let z = 1.0 - (2.0 * index as f32 + 1.0) / RAYS as f32;
        let angle = index as f32 * 2.399_963_2;
        let radius = (1.0 - z * z).sqrt();
        let dir = Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
        match caster.closest_hit(point, dir) {
            Some(hit) if hit.point.is_some() => fronts += 1,
            Some(_) => backs += 1,
            None => {}
        }
    }
    fronts * 10 >= RAYS * 6 && backs * 20 <= RAYS
}

/// From above the corner of the box whose view shows most.
fn outside(caster: &RayCaster<'_>, low: Vec3, high: Vec3) -> View {
    let center = (low + high) * 0.5;
    // The sphere around the box fills the view's height.
    let distance = (0.5 * (high - low).length()).max(f32::MIN_POSITIVE) / (FOV_Y * 0.5).sin();
    let view = |(x, z): (f32, f32)| View { eye: center + Vec3::new(x, 0.8, z).normalize() * distance, target: center };
    let mut best = view((1.0, 1.0));
    let mut most = 0;
    for corner in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let view = view(corner);
        let shown = view.test(caster).iter().flatten().filter(|&&distance| distance > 0.0).count();
        if shown > most {
            (best, most) = (view, shown);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::tests::floor;
    use glam::Vec4Swizzles;
    use localprt_scenes::{Material, Mesh, Scene};

    /// A box of 6 m x 3 m x 4 m whose faces look in or out.
    fn walls(inwards: bool) -> Scene {
        let positions: Vec<Vec3> = (0..8)
            .map(|corner| {
                Vec3::new((corner & 1) as f32 * 6.0, (corner >> 1 & 1) as f32 * 3.0, (corner >> 2) as f32 * 4.0)
            })
            .collect();
        // Counter-clockwise seen from outside.
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]: &[u32; 4]| {
            let pair = [[a, b, c], [a, c, d]];
            pair.map(|[a, b, c]| if inwards { [a, c, b] } else { [a, b, c] })
        });
        let mesh = Mesh { triangles: triangles.collect(), normals: vec![Vec3::Y; 8], positions, ..Mesh::default() };
        Scene { meshes: vec![mesh], materials: vec![Material::default()], ..Scene::default() }
    }

    fn eye(scene: &Scene) -> Vec3 {
        let caster = RayCaster::new(scene).expect("a tree");
        let camera = default_camera(&caster).expect("a camera");
        let eye = camera.to_world.w_axis.xyz();
        let ahead = camera.to_world.transform_vector3(Vec3::NEG_Z);
        let hit = caster.closest_hit(eye, ahead).expect("something in the middle of the picture");
        assert!(hit.point.is_some(), "not a black back");
        eye
    }

    #[test]
    fn a_room_is_seen_from_within_along_its_length() {
        let eye = eye(&walls(true));
        assert!(eye.cmpgt(Vec3::ZERO).all() && eye.cmplt(Vec3::new(6.0, 3.0, 4.0)).all(), "{eye}");
        assert!(!(2.0..=4.0).contains(&eye.x), "from one end: {eye}");
    }

    #[test]
    fn a_solid_and_a_floor_are_seen_from_outside_and_above() {
        assert!(eye(&walls(false)).y > 3.0);
        assert!(eye(&floor()).y > 0.0);
    }

    #[test]
    fn an_empty_scene_has_no_view() {
        let scene = Scene::default();
        if let Ok(caster) = RayCaster::new(&scene) {
            assert!(default_camera(&caster).is_none());
        }
    }
}
