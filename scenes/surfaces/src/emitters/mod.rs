//! Emissive triangles, to be sampled by area and brightness.

pub mod distribution;

use crate::rays::{RayCaster, SurfaceHit};
use distribution::Distribution;
use glam::Vec3;
use localprt_scenes::{FaceId, Scene, SurfaceShading};

/// Points of a triangle, per edge, at which a textured emission is looked up to weigh the triangle.
const LOOKUPS: u32 = 4;
/// A joining ray has to end this near to the sampled point, times the ray offset.
pub const SAME_POINT: f32 = 4.0;

/// All emissive triangles under one lighting state.
pub struct Emitters {
    triangles: Vec<Emitter>,
    /// Of the triangles.
    choice: Distribution,
    /// `[n_faces]` density of a sample on the face, m^-2; 0 for faces that are not sampled. Empty without emitters.
    density: Vec<f32>,
}

struct Emitter {
    face: FaceId,
    mesh: usize,
    triangle: usize,
    corners: [Vec3; 3],
}

impl Emitters {
    /// Triangles are drawn in proportion to area times emission, its brightest band.
    pub fn of(scene: &Scene, shading: &SurfaceShading<'_>) -> Self {
        let mut emitters = Self { triangles: Vec::new(), choice: Distribution::default(), density: Vec::new() };
        if !shading.any_emission() {
            return emitters;
        }
        let mut weights: Vec<f64> = Vec::new();
        let mut areas: Vec<f64> = Vec::new();
        for (face, (mesh, triangle)) in scene.faces().enumerate() {
            let corners = scene.corners(mesh, triangle);
            let area = (corners[1] - corners[0]).as_dvec3().cross((corners[2] - corners[0]).as_dvec3()).length() / 2.0;
            let mean = mean_emission(shading, mesh, triangle);
            if area * mean > 0.0 {
                emitters.triangles.push(Emitter { face: FaceId(face as u32), mesh, triangle, corners });
                weights.push(area * mean);
                areas.push(area);
            }
        }
        emitters.density = vec![0.0; scene.face_count()];
        emitters.choice = Distribution::of(weights.into_iter());
        for (index, (emitter, area)) in emitters.triangles.iter().zip(areas).enumerate() {
            emitters.density[emitter.face.0 as usize] = (emitters.choice.probability(index) / area) as f32;
        }
        emitters
    }

    /// True where nothing emits.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Shows what triangles there are, and how densely each is sampled.
    pub fn digest(&self, show: &mut dyn FnMut(&[f32])) {
        for Emitter { face, corners, .. } in &self.triangles {
            let [a, b, c] = corners.map(|corner| corner.to_array());
            show(&[&a[..], &b, &c, &[self.density[face.0 as usize]]].concat());
        }
    }

    /// A point of an emissive triangle.
    pub fn sample(&self, which: f64, [u, v]: [f64; 2]) -> (FaceId, Vec3) {
        let index = self.choice.choose(which);
        let [a, b, c] = self.triangles[index].corners;
        // Uniform over the triangle (Turk 1990).
        let root = u.sqrt();
        let weights = [1.0 - root, root * (1.0 - v), root * v].map(|weight| weight as f32);
        (self.triangles[index].face, a * weights[0] + b * weights[1] + c * weights[2])
    }

    /// What a ray toward a sample meets, and the density per steradian of samples there; `None` where something else is
    /// in the way, or the face does not emit toward `origin`. Traces one ray.
    pub fn meet(
        &self,
        caster: &RayCaster<'_>,
        origin: Vec3,
        dir: Vec3,
        (face, target): (FaceId, Vec3),
    ) -> Option<(SurfaceHit, f32)> {
        let hit = caster.closest_hit(origin, dir)?;
        // Rounding may lead to the triangle beside it, of which this side glows as well.
        let is_beside = || {
            let index = self.triangles.partition_point(|emitter| emitter.face < face).min(self.triangles.len() - 1);
            let Emitter { mesh, triangle, .. } = self.triangles[index];
            hit.position.distance(target) <= SAME_POINT * caster.offset_m()
                && caster.scene().geometric_normal(mesh, triangle).dot(dir) < 0.0
        };
        if hit.point?.face != face && !is_beside() {
            return None;
        }
        let density = self.density(&hit, dir);
        (density > 0.0).then_some((hit, density))
    }

    /// Density, per steradian, with which [`Emitters::sample`] would have led from the ray's origin to its hit.
    pub fn density(&self, hit: &SurfaceHit, dir: Vec3) -> f32 {
        let Some(point) = hit.point else { return 0.0 };
        let by_area = self.density.get(point.face.0 as usize).copied().unwrap_or(0.0);
        let cosine = hit.normal.dot(dir).abs();
        if by_area > 0.0 && cosine > 0.0 { by_area * hit.t * hit.t / cosine } else { 0.0 }
    }
}

fn mean_emission(shading: &SurfaceShading<'_>, mesh: usize, triangle: usize) -> f64 {
    let mut sum = 0.0;
    let mut count = 0.0;
    for i in 0..LOOKUPS {
        for j in 0..LOOKUPS - i {
            let place = |index: u32| (index as f32 + 1.0 / 3.0) / LOOKUPS as f32;
            let (u, v) = (place(i), place(j));
            sum += f64::from(shading.emission(mesh, triangle, Vec3::new(1.0 - u - v, u, v)).max_element());
            count += 1.0;
        }
    }
    sum / count
}
