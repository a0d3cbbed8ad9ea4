//! The system: maps that are lit anew in every frame, and three ways from them to irradiance.

use super::{
    denoise::{self, Histories},
    geometry::Geometry,
    prefilter::Prefiltered,
    settings::Settings,
    trace::{Answer, Traced},
};
use crate::{Frame, Query, Setup, Shaded, ShaderLight, System, Work, World};
use glam::{Quat, Vec3};
use localprt_formats::directions::{cosine_hemisphere, counter_hash, counter_uniform, fibonacci_square};
use localprt_scenes::SurfacePoint;
use localprt_surfaces::rays;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Most that rays start above a surface, metres.
const MOST_LIFT_M: f32 = 0.2;
/// Kinds of averages over frames.
const LAMBERTIAN: u64 = 1;
const GLOSSY: u64 = 2;

/// How irradiance at points comes from the maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gather {
    /// By [`Settings::rays`] rays per point: brute force.
    Exact,
    /// By a ray per point and frame, averaged over frames and, in pictures, filtered.
    Traced,
    /// From prefiltered irradiance, without rays.
    Prefiltered,
}

/// Light field probes of one scene.
pub struct LightField {
    /// What the probes see.
    pub geometry: Geometry,
    /// Resolutions and thresholds.
    pub settings: Settings,
    gather: Gather,
    seed: u64,
    /// Radiance from each texel of each probe, W sr^-1 m^-2.
    radiance: Vec<Vec3>,
    pub(super) prefiltered: Prefiltered,
    histories: Histories,
    /// Frames so far.
    frames: u64,
    /// Rays for points since the last frame.
    query_rays: AtomicU64,
    last_work: Work,
}

impl LightField {
    /// Probes for a scene, without light.
    pub fn new(world: &World<'_>, setup: &Setup<'_>, settings: Settings, gather: Gather) -> Self {
        let geometry = Geometry::new(world, setup, &settings);
        let prefiltered = Prefiltered::new(&geometry, &settings);
        let texels = geometry.grid.len() * geometry.texels();
        Self {
            radiance: vec![Vec3::ZERO; texels],
            query_rays: AtomicU64::new(0),
            prefiltered,
            geometry,
            settings,
            gather,
            seed: setup.seed,
            histories: Histories::default(),
            frames: 0,
            last_work: Work::default(),
        }
    }

    /// Radiance of the texels of a probe, row by row, W sr^-1 m^-2.
    pub fn radiance(&self, probe: usize) -> &[Vec3] {
        &self.radiance[probe * self.geometry.texels()..][..self.geometry.texels()]
    }

    /// Traces a ray; `dir` is unit length.
    pub fn trace(&self, origin: Vec3, dir: Vec3) -> Traced {
        self.geometry.trace(&self.settings, origin, dir)
    }

    /// Radiance along a ray from a surface point, W sr^-1 m^-2; nothing from below the surface.
    ///
    /// Of a ray that nobody could follow the paper assumes that it "hit the occluder at the last observed location" (sec. 4.1).
    fn incoming(&self, world: &World<'_>, point: &SurfacePoint, dir: Vec3) -> Vec3 {
        if dir.dot(point.geometric_normal) <= 0.0 {
            return Vec3::ZERO;
        }
        let traced = self.trace(point.position + point.geometric_normal * self.lift_m(), dir);
        match traced.answer {
            Answer::Miss => world.sky(dir),
            Answer::Hit | Answer::Unknown => self.radiance(traced.probe)[traced.texel],
        }
    }

    /// How far above a surface rays start, metres. At a lateral distance d from a probe a texel of angle a holds distances of points up
    /// to `d * a` behind or in front of the surface, so that nearer rays would be hidden by their own.
    fn lift_m(&self) -> f32 {
        (self.settings.texel_angle() * self.geometry.grid.spacing.length()).min(MOST_LIFT_M)
    }

    /// Irradiance of a point by so many cosine-weighted rays, W m^-2: E = pi / n sum L.
    fn gathered(&self, world: &World<'_>, point: &SurfacePoint, rays: u32, stream: u64) -> Vec3 {
        let shift = [0, 1].map(|axis| counter_uniform(self.seed, stream, axis));
        let (tangent, bitangent) = rays::frame(point.normal);
        let sum: Vec3 = (0..rays)
            .map(|ray| {
                let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, rays, shift));
                self.incoming(world, point, (tangent * x + bitangent * y + point.normal * z).normalize())
            })
            .sum();
        sum * (PI / rays as f32)
    }

    /// Irradiance of all points by so many rays each.
    fn all_gathered(&self, world: &World<'_>, points: &[Shaded], rays: u32, frame: u64) -> Vec<Vec3> {
        self.query_rays.fetch_add(points.len() as u64 * u64::from(rays), Ordering::Relaxed);
        let stream = |index: usize| counter_hash(LAMBERTIAN, frame, index as u64);
        let points = points.par_iter().enumerate();
        points.map(|(index, shaded)| self.gathered(world, &shaded.point, rays, stream(index))).collect()
    }

    /// Glossy light at points: radiance of a lobe around the mirrored view, `cos^power` (infinite for a mirror), W sr^-1 m^-2. A ray
    /// per point and frame, averaged and filtered as sec. 5.1 says, with its narrower filters.
    pub fn glossy(&self, world: &World<'_>, query: &Query<'_>, power: f32) -> Vec<Vec3> {
        let trace = || {
            self.query_rays.fetch_add(query.points.len() as u64, Ordering::Relaxed);
            let points = query.points.par_iter().enumerate();
            points.map(|(index, shaded)| self.mirrored(world, shaded, power, index)).collect()
        };
        let key = denoise::key(GLOSSY + (u64::from(power.to_bits()) << 8), query.points, true);
        let values = self.histories.average(key, self.frames, &self.settings.glossy, trace);
        self.filtered(query, values, &self.settings.glossy)
    }

    fn mirrored(&self, world: &World<'_>, shaded: &Shaded, power: f32, index: usize) -> Vec3 {
        let stream = counter_hash(GLOSSY, self.frames, index as u64);
        let [height, turn] = [0, 1].map(|axis| counter_uniform(self.seed, stream, axis) as f32);
        // Density (power + 1) / 2 pi cos^power.
        let cosine = (1.0 - height).powf(1.0 / (power + 1.0));
        let across = (1.0 - cosine * cosine).max(0.0).sqrt();
        let mirror = (-shaded.to_eye).reflect(shaded.point.normal);
        let (tangent, _) = rays::frame(mirror);
        let tangent = Quat::from_axis_angle(mirror, 2.0 * PI * turn) * tangent;
        self.incoming(world, &shaded.point, (mirror * cosine + tangent * across).normalize())
    }

    fn filtered(&self, query: &Query<'_>, values: Vec<Vec3>, filter: &super::Filter) -> Vec<Vec3> {
        match query.width {
            Some(width) if filter.radius > 0 => denoise::bilateral(query.points, width, &values, filter),
            _ => values,
        }
    }

    fn prefiltered_irradiance(&self, points: &[Shaded]) -> Vec<Vec3> {
        let irradiance = |shaded: &Shaded| self.prefiltered.irradiance(&self.geometry.grid, &shaded.point);
        points.par_iter().map(irradiance).collect()
    }

    /// Radiance of all texels of a probe under a frame's light, and the shadow rays that it took.
    fn lit(&self, frame: &Frame<'_>, probe: usize) -> (Vec<Vec3>, u64) {
        let texels = self.geometry.texels();
        let mut radiance = vec![Vec3::ZERO; texels];
        let (mut surfels, mut places, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for (texel, radiance) in radiance.iter_mut().enumerate() {
            let dir = self.geometry.dir(texel);
            match self.geometry.hit(probe, texel) {
                None => *radiance = frame.world.sky(dir),
                // Black backs stay black.
                Some(hit) => {
                    if let Some(surfel) = frame.world.surfel(&hit) {
                        places.push(texel);
                        points.push(Shaded { point: surfel.point, to_eye: -dir });
                        surfels.push(surfel);
                    }
                }
            }
        }
        let indirect = frame.feedback.irradiance(self, frame.world, &points);
        let mut shadow_rays = 0;
        for ((texel, surfel), indirect) in places.into_iter().zip(&surfels).zip(indirect) {
            let (direct, rays) = frame.world.direct(&surfel.point);
            shadow_rays += rays;
            radiance[texel] = surfel.sent(direct + indirect);
        }
        (radiance, shadow_rays)
    }
}

impl System for LightField {
    /// Lights every texel and filters; no rays but those to lights.
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        self.histories.keep(self.frames);
        self.frames += 1;
        // The same light on the same surfaces.
        if frame.still && self.last_work.texels > 0 {
            return Work { query_rays: std::mem::take(self.query_rays.get_mut()), ..self.last_work };
        }
        let lit: Vec<(Vec<Vec3>, u64)> =
            (0..self.probes()).into_par_iter().map(|probe| self.lit(frame, probe)).collect();
        let shadow_rays = lit.iter().map(|probe| probe.1).sum();
        self.radiance = lit.into_iter().flat_map(|probe| probe.0).collect();
        self.prefiltered.filter(&self.geometry, &self.radiance);
        self.last_work = Work {
            // Those that the maps were made with were traced before the first frame.
            rays: 0,
            query_rays: std::mem::take(self.query_rays.get_mut()),
            shadow_rays,
            texels: self.radiance.len() as u64 + self.prefiltered.texels(),
            probes: self.probes() as u64,
        };
        self.last_work
    }

    /// From the prefiltered maps, without rays, whatever the way to irradiance.
    fn feedback(&self, _: &World<'_>, points: &[Shaded]) -> Vec<Vec3> {
        self.prefiltered_irradiance(points)
    }

    /// For [`Gather::Traced`] it has to be asked once a frame: every frame adds a ray per point.
    fn irradiance(&self, world: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        match self.gather {
            Gather::Prefiltered => self.prefiltered_irradiance(query.points),
            Gather::Exact => self.all_gathered(world, query.points, self.settings.rays, 0),
            Gather::Traced => {
                let filter = &self.settings.lambertian;
                let key = denoise::key(LAMBERTIAN, query.points, false);
                let trace = || self.all_gathered(world, query.points, 1, self.frames);
                self.filtered(query, self.histories.average(key, self.frames, filter, trace), filter)
            }
        }
    }

    /// Of prefiltered maps alone: rays would be hundreds per pixel, or an average over frames.
    fn shader_light(&self) -> Option<ShaderLight> {
        let is_read = self.gather == Gather::Prefiltered;
        is_read.then(|| ShaderLight::Octahedral(self.prefiltered.shader_probes(&self.geometry.grid)))
    }

    fn probes(&self) -> usize {
        self.geometry.grid.len()
    }

    /// Maps of all probes, and a R16G16B16A16F per point of the averages over frames.
    fn bytes(&self) -> u64 {
        self.probes() as u64 * self.settings.probe_bytes() + 8 * self.histories.points() as u64
    }
}
