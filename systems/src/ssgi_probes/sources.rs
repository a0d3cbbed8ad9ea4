//! Light that is injected into probes: emissive surfaces by points on them, and the sky by directions (sec. 5.2).
//!
//! Both are sampled whether or not they are on screen. Nothing says to the samples of the screen that a source lies behind them, nor to
//! the sources that a wall is in front of them, unless rays are traced. A surface is injected with its emission alone: where it reflects
//! as well and is on screen, both samples disagree.

use super::projection::{Arriving, SPHERE_SR};
use crate::World;
use glam::Vec3;
use localprt_formats::directions::{counter_hash, counter_uniform, fibonacci_square, uniform_sphere};
use localprt_scenes::{FaceId, SurfaceShading};
use localprt_surfaces::{
    emitters::Emitters,
    rays::{FacePoint, SurfaceHit},
};
use std::f32::consts::TAU;

/// Samples of sources per probe and frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSettings {
    /// Points on emissive surfaces.
    pub light_samples: u32,
    /// Directions to the sky.
    pub sky_samples: u32,
    /// The "magic number": factor on the sources' solid angles, against those of the screen.
    pub weight: f32,
}

/// What is injected in a frame.
pub struct Sources<'a> {
    world: &'a World<'a>,
    settings: SourceSettings,
    emitters: Emitters,
    /// First face of each mesh.
    mesh_starts: Vec<u32>,
}

/// A sample of a source, and the other end of the ray that tells whether it is seen.
struct Sample {
    arriving: Arriving,
    from: From,
}

enum From {
    /// A point off its surface.
    Point(Vec3),
    Sky,
}

impl<'a> Sources<'a> {
    /// Of a world as it is lit now.
    pub fn of(world: &'a World<'a>, settings: SourceSettings) -> Self {
        let scene = world.caster().scene();
        let emitters = Emitters::of(scene, &SurfaceShading::new(scene, world.lighting()));
        let start = |faces: &mut u32, triangles: usize| {
            *faces += triangles as u32;
            Some(*faces - triangles as u32)
        };
        let mesh_starts = scene.meshes.iter().map(|mesh| mesh.triangles.len()).scan(0, start).collect();
        Self { world, settings, emitters, mesh_starts }
    }

    /// What arrives at a probe, and the rays that it took: those that `occlusion` asks for. `key` is for random numbers.
    pub fn arriving(&self, probe: Vec3, key: u64, occlusion: bool) -> (Vec<Arriving>, u64) {
        let lights = if self.emitters.is_empty() { 0 } else { self.settings.light_samples };
        let sky = if self.world.lighting().sky.is_black() { 0 } else { self.settings.sky_samples };
        let samples = (0..lights).filter_map(|i| self.light(probe, key, i)).chain((0..sky).map(|i| self.sky(key, i)));
        let (mut arriving, mut rays) = (Vec::with_capacity((lights + sky) as usize), 0);
        for sample in samples {
            rays += u64::from(occlusion);
            if !occlusion || self.is_seen(probe, &sample) {
                let solid_angle_sr = sample.arriving.solid_angle_sr * self.settings.weight;
                arriving.push(Arriving { solid_angle_sr, ..sample.arriving });
            }
        }
        (arriving, rays)
    }

    /// A point on an emissive surface, drawn by area times radiance.
    fn light(&self, probe: Vec3, key: u64, number: u32) -> Option<Sample> {
        let uniform = |axis| counter_uniform(counter_hash(key, 0, u64::from(number)), 0, axis);
        let (face, position) = self.emitters.sample(uniform(0), [uniform(1), uniform(2)]);
        let way = position - probe;
        let (distance, dir) = (way.length(), way.normalize_or_zero());
        let hit = self.hit(face, position, distance, dir)?;
        let surfel = self.world.surfel(&hit)?;
        let density = self.emitters.density(&hit, dir);
        if density <= 0.0 {
            return None;
        }
        let solid_angle_sr = (1.0 / (density * self.settings.light_samples as f32)).min(TAU);
        let offset = hit.normal * self.world.caster().offset_m();
        Some(Sample {
            arriving: Arriving { dir, solid_angle_sr, radiance: surfel.emission },
            from: From::Point(position + offset),
        })
    }

    /// The sample as a ray from the probe would meet it; `None` from behind a one-sided surface.
    fn hit(&self, face: FaceId, position: Vec3, t: f32, dir: Vec3) -> Option<SurfaceHit> {
        let scene = self.world.caster().scene();
        let mesh = self.mesh_starts.partition_point(|&start| start <= face.0) - 1;
        let triangle = (face.0 - self.mesh_starts[mesh]) as usize;
        let normal = scene.geometric_normal(mesh, triangle);
        let is_front = normal.dot(dir) < 0.0;
        if !is_front && !scene.materials[scene.meshes[mesh].material].double_sided {
            return None;
        }
        let barycentrics = barycentrics(scene.corners(mesh, triangle), position);
        let point = Some(FacePoint { face, mesh, triangle, barycentrics });
        Some(SurfaceHit { t, position, normal: if is_front { normal } else { -normal }, point })
    }

    /// A direction of an even set, shifted at random.
    fn sky(&self, key: u64, number: u32) -> Sample {
        let shift = [counter_uniform(key, 1, 0), counter_uniform(key, 1, 1)];
        let dir = Vec3::from(uniform_sphere(fibonacci_square(number, self.settings.sky_samples, shift)));
        let solid_angle_sr = SPHERE_SR / self.settings.sky_samples as f32;
        Sample { arriving: Arriving { dir, solid_angle_sr, radiance: self.world.sky(dir) }, from: From::Sky }
    }

    fn is_seen(&self, probe: Vec3, sample: &Sample) -> bool {
        match sample.from {
            From::Point(point) => self.world.caster().visible(point, probe),
            From::Sky => self.world.caster().escapes(probe, sample.arriving.dir),
        }
    }
}

/// Weights of the corners at a point of a triangle.
fn barycentrics([a, b, c]: [Vec3; 3], point: Vec3) -> Vec3 {
    let normal = (b - a).cross(c - a);
    let of = |from: Vec3, to: Vec3| (to - from).cross(point - from).dot(normal) / normal.length_squared();
    let (at_b, at_c) = (of(c, a), of(a, b));
    Vec3::new(1.0 - at_b - at_c, at_b, at_c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ssgi_probes::tests::panel;
    use crate::test_worlds::in_world;
    use localprt_scenes::{Lighting, Sky};

    const SETTINGS: SourceSettings = SourceSettings { light_samples: 16, sky_samples: 16, weight: 1.0 };

    #[test]
    fn points_on_a_light_sum_to_its_solid_angle() {
        // A square of 2 m, 3 m up, that shines down.
        let scene = panel(4.0);
        in_world(&scene, &Lighting::default(), |world| {
            let sources = Sources::of(world, SETTINGS);
            let sum = |probe: Vec3, key: u64| {
                let (samples, rays) = sources.arriving(probe, key, false);
                assert!(rays == 0 && samples.iter().all(|sample| sample.radiance == Vec3::splat(4.0)));
                samples.iter().map(|sample| sample.solid_angle_sr).sum::<f32>()
            };
            let sums: Vec<f32> = (0..400).map(|key| sum(Vec3::new(0.0, 1.5, 0.0), key)).collect();
            let mean = sums.iter().sum::<f32>() / 400.0;
            let error = (sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f32>() / 399.0 / 400.0).sqrt();
            let whole = 4.0 * (1.0f32 / (1.0 + 1.5 * 1.5)).asin();
            assert!((mean - whole).abs() < 4.0 * error && error < 0.01 * whole, "{mean} {whole} {error}");
            // Nothing from behind.
            assert_eq!(sum(Vec3::new(0.0, 4.0, 0.0), 0), 0.0);
        });
    }

    #[test]
    fn the_magic_number_scales_solid_angles() {
        let scene = panel(1.0);
        let lighting = Lighting { sky: Sky::Constant(Vec3::ONE), ..Lighting::default() };
        in_world(&scene, &lighting, |world| {
            let of = |weight: f32| {
                let sources = Sources::of(world, SourceSettings { weight, ..SETTINGS });
                let samples = sources.arriving(Vec3::Y, 9, false).0;
                samples.iter().map(|sample| sample.solid_angle_sr).collect::<Vec<f32>>()
            };
            let (whole, quarter) = (of(1.0), of(0.25));
            assert_eq!(whole.len(), 32);
            assert_eq!(whole.iter().map(|sr| sr * 0.25).collect::<Vec<f32>>(), quarter);
        });
    }

    #[test]
    fn rays_keep_out_what_a_surface_hides() {
        // Above the panel, whose back is black, the sky is seen in the upper half and around the panel; the light is not.
        let scene = panel(1.0);
        let lighting = Lighting { sky: Sky::Constant(Vec3::ONE), ..Lighting::default() };
        in_world(&scene, &lighting, |world| {
            let sources = Sources::of(world, SETTINGS);
            let height = 0.2;
            let share = |key| {
                let (samples, rays) = sources.arriving(Vec3::new(0.0, 3.0 + height, 0.0), key, true);
                assert!(rays == 16 && samples.len() < 16);
                samples.len() as f32 / 16.0
            };
            let shares: Vec<f32> = (0..400).map(share).collect();
            let seen = shares.iter().sum::<f32>() / 400.0;
            let error = (shares.iter().map(|share| (share - seen).powi(2)).sum::<f32>() / 399.0 / 400.0).sqrt();
            let expected = 1.0 - 4.0 * (1.0f32 / (1.0 + height * height)).asin() / SPHERE_SR;
            assert!((seen - expected).abs() < 4.0 * error && error < 0.005, "{seen} {expected} {error}");
        });
    }

    #[test]
    fn corners_have_weights_of_their_own() {
        let corners = [Vec3::new(1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 2.0), Vec3::new(0.0, 4.0, -1.0)];
        let weights = Vec3::new(0.2, 0.3, 0.5);
        let point = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
        assert!((barycentrics(corners, point) - weights).abs().max_element() < 1e-6);
    }
}
