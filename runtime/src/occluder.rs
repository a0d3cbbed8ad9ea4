//! Objects that move and block relight rays (sec. 5.1, "Dynamic Occluders"): analytic shapes in world space.

use crate::error::RelightError;
use glam::{Quat, Vec3};

/// Most occluders at a time.
pub const MAX_OCCLUDERS: usize = 64;

/// A solid that stands between probes and what they see. Lengths in metres.
///
/// It changes what probes see, not the precomputed way from probes to receivers: large shadows move, contact shadows
/// need another technique. A probe inside of one sees nothing but it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occluder {
    /// Its surface.
    pub shape: OccluderShape,
    /// Radiance that leaves it in all directions, W sr^-1 m^-2; zero for something black.
    pub radiance: Vec3,
}

/// Shape and place of an occluder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OccluderShape {
    /// A ball.
    Sphere {
        /// Middle.
        center: Vec3,
        /// Radius.
        radius: f32,
    },
    /// A box with any orientation, such as a door.
    Box {
        /// Middle.
        center: Vec3,
        /// Half of its size along its own axes.
        half_extents: Vec3,
        /// From its own axes to the world's.
        rotation: Quat,
    },
    /// All points within a distance of a line segment, such as a person.
    Capsule {
        /// One end of the segment.
        a: Vec3,
        /// The other end.
        b: Vec3,
        /// Distance.
        radius: f32,
    },
}

impl Occluder {
    /// Distance along a unit ray to its surface, 0 from inside, `None` if the ray misses it.
    pub fn hit(&self, origin: Vec3, dir: Vec3) -> Option<f32> {
        match self.shape {
            OccluderShape::Sphere { center, radius } => hit_sphere(origin, dir, center, radius),
            OccluderShape::Box { center, half_extents, rotation } => {
                let inverse = rotation.inverse();
                hit_box(inverse * (origin - center), inverse * dir, half_extents)
            }
            OccluderShape::Capsule { a, b, radius } => hit_capsule(origin, dir, a, b, radius),
        }
    }

    /// Middle and radius of a sphere around it.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        match self.shape {
            OccluderShape::Sphere { center, radius } => (center, radius),
            OccluderShape::Box { center, half_extents, .. } => (center, half_extents.length()),
            OccluderShape::Capsule { a, b, radius } => (0.5 * (a + b), 0.5 * (b - a).length() + radius),
        }
    }

    /// Whether all its numbers are finite and its sizes not negative.
    pub fn is_valid(&self) -> bool {
        let shape = match self.shape {
            OccluderShape::Sphere { center, radius } => center.is_finite() && radius.is_finite() && radius >= 0.0,
            OccluderShape::Box { center, half_extents, rotation } => {
                center.is_finite()
                    && half_extents.is_finite()
                    && half_extents.min_element() >= 0.0
                    && rotation.is_normalized()
            }
            OccluderShape::Capsule { a, b, radius } => {
                a.is_finite() && b.is_finite() && radius.is_finite() && radius >= 0.0
            }
        };
        shape && self.radiance.is_finite() && self.radiance.min_element() >= 0.0
    }
}

/// Refuses lists that the passes cannot use.
pub(crate) fn check_occluders(occluders: &[Occluder], has_distances: bool) -> Result<(), RelightError> {
    let fail = |problem: String| Err(RelightError::Occluders { problem });
    if occluders.len() > MAX_OCCLUDERS {
        return fail(format!("there are {}, at most {MAX_OCCLUDERS} can be used", occluders.len()));
    }
    if !occluders.is_empty() && !has_distances {
        return fail("the file does not hold how far its relight rays go".into());
    }
    match occluders.iter().position(|occluder| !occluder.is_valid()) {
        Some(index) => fail(format!("number {index} has a size or a color that is negative or not finite")),
        None => Ok(()),
    }
}

fn hit_sphere(origin: Vec3, dir: Vec3, center: Vec3, radius: f32) -> Option<f32> {
    let to_center = center - origin;
    let along = to_center.dot(dir);
    let beside = to_center - along * dir;
    let half_chord_2 = radius * radius - beside.length_squared();
    if half_chord_2 < 0.0 {
        return None;
    }
    let half_chord = half_chord_2.sqrt();
    (along + half_chord >= 0.0).then(|| (along - half_chord).max(0.0))
}

/// Slabs in the box's own axes.
fn hit_box(origin: Vec3, dir: Vec3, half_extents: Vec3) -> Option<f32> {
    let safe = Vec3::select(dir.cmpeq(Vec3::ZERO), Vec3::splat(1e-30), dir);
    let near = ((-safe.signum() * half_extents - origin) / safe).max_element();
    let far = ((safe.signum() * half_extents - origin) / safe).min_element();
    (near <= far && far >= 0.0).then(|| near.max(0.0))
}

fn hit_capsule(origin: Vec3, dir: Vec3, a: Vec3, b: Vec3, radius: f32) -> Option<f32> {
    let axis = b - a;
    let length_2 = axis.length_squared();
    let tube = || {
        // The ray and the origin with their parts along the axis removed.
        let from_a = origin - a;
        let o = from_a - axis * (from_a.dot(axis) / length_2);
        let d = dir - axis * (dir.dot(axis) / length_2);
        let (qa, qb, qc) = (d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
        let discriminant = qb * qb - qa * qc;
        if qa <= 0.0 || discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        let t = ((-qb - root) / qa).max(0.0);
        let place = (from_a + t * dir).dot(axis);
        ((-qb + root) / qa >= 0.0 && (0.0..=length_2).contains(&place)).then_some(t)
    };
    let ends = [hit_sphere(origin, dir, a, radius), hit_sphere(origin, dir, b, radius)];
    let tube = if length_2 > 0.0 { tube() } else { None };
    ends.into_iter().chain([tube]).flatten().min_by(f32::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::{counter_uniform, spherical_fibonacci};

    fn occluder(shape: OccluderShape) -> Occluder {
        Occluder { shape, radiance: Vec3::ZERO }
    }

    /// Signed distance to the surface, negative inside: what ray marching needs, and nothing of the code above.
    fn distance(shape: OccluderShape, point: Vec3) -> f32 {
        match shape {
            OccluderShape::Sphere { center, radius } => point.distance(center) - radius,
            OccluderShape::Box { center, half_extents, rotation } => {
                let q = (rotation.inverse() * (point - center)).abs() - half_extents;
                q.max(Vec3::ZERO).length() + q.max_element().min(0.0)
            }
            OccluderShape::Capsule { a, b, radius } => {
                let t = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                point.distance(a + t * (b - a)) - radius
            }
        }
    }

    #[test]
    fn rays_hit_where_marching_along_them_does() {
        let shapes = [
            OccluderShape::Sphere { center: Vec3::new(0.3, -0.2, 0.1), radius: 0.8 },
            OccluderShape::Box {
                center: Vec3::new(-0.2, 0.4, 0.3),
                half_extents: Vec3::new(0.9, 0.2, 0.5),
                rotation: Quat::from_euler(glam::EulerRot::XYZ, 0.4, -0.9, 0.2),
            },
            OccluderShape::Capsule { a: Vec3::new(-0.4, -0.6, 0.2), b: Vec3::new(0.5, 0.7, -0.1), radius: 0.4 },
        ];
        for shape in shapes {
            let (mut hits, mut misses) = (0, 0);
            for ray in 0..2000u32 {
                let random = |k| 4.0 * counter_uniform(3, u64::from(ray), k) as f32 - 2.0;
                let origin = Vec3::new(random(0), random(1), random(2));
                let dir = Vec3::from_array(spherical_fibonacci(ray, 2000));
                let mut t = 0.0f32;
                let mut closest = f32::INFINITY;
                for _ in 0..2000 {
                    let step = distance(shape, origin + t * dir);
                    closest = closest.min(step);
                    t += step.max(1e-4);
                    if step < 1e-5 || t > 12.0 {
                        break;
                    }
                }
                match occluder(shape).hit(origin, dir) {
                    // Marching stops 1e-5 short of the surface, along it far less short of the hit unless it grazes.
                    Some(found) if closest < 1e-5 => {
                        hits += 1;
                        assert!(distance(shape, origin + found * dir) < 2e-5, "{shape:?}, ray {ray}");
                        assert!(found < t + 2e-2, "{shape:?}, ray {ray}: {found}, marched to {t}");
                    }
                    Some(found) => assert!(closest < 1e-3, "{shape:?}, ray {ray}: hit at {found}, passes at {closest}"),
                    None => {
                        misses += 1;
                        assert!(closest > -1e-5 && (closest > 0.0 || t < 1e-3), "{shape:?}, ray {ray}: {closest}");
                    }
                }
            }
            assert!(hits > 50 && misses > 500, "{hits} hits, {misses} misses");
        }
    }

    #[test]
    fn from_inside_the_distance_is_zero_and_behind_is_no_hit() {
        let sphere = occluder(OccluderShape::Sphere { center: Vec3::ZERO, radius: 1.0 });
        assert_eq!(sphere.hit(Vec3::new(0.2, 0.1, 0.0), Vec3::X), Some(0.0));
        assert_eq!(sphere.hit(Vec3::new(2.0, 0.0, 0.0), Vec3::X), None);
        assert_eq!(sphere.hit(Vec3::new(-3.0, 0.0, 0.0), Vec3::X), Some(2.0));
        let door = OccluderShape::Box { center: Vec3::ZERO, half_extents: Vec3::ONE, rotation: Quat::IDENTITY };
        // A ray within a face's plane direction: components of zero.
        assert_eq!(occluder(door).hit(Vec3::new(-3.0, 0.5, 0.5), Vec3::X), Some(2.0));
        assert_eq!(occluder(door).hit(Vec3::new(-3.0, 1.5, 0.5), Vec3::X), None);
    }
}
