//! Where receivers, texels and probes went, as the scene's cameras see it; and what to do where that is not enough.

use crate::{
    lightmap::{Atlas, ReceiverSet},
    picture::camera_dir,
    probes::ProbeSet,
    rays::RayCaster,
    report::{BudgetFacts, TexelFacts, ViewFacts, median},
};
use glam::{Mat4, Vec3};
use localprt_formats::directions::spherical_fibonacci;
use localprt_scenes::Camera;
use rayon::prelude::*;

/// Cameras that are looked through.
const MOST_VIEWS: usize = 16;
/// Rays across and down a picture.
const RAYS: [u32; 2] = [96, 54];
/// Width over height of a picture without an aspect of its own.
const ASPECT: f32 = 16.0 / 9.0;
/// A texel is coarse where its edge is more than this share of its distance: two degrees.
const COARSE: f32 = 1.0 / 30.0;
/// Rays around a camera that tell how far it reaches, and the share of them that is within.
const RAYS_AROUND: u32 = 1024;
const WITHIN: f64 = 0.98;
/// Warned of: less than this share of the receivers within reach of the views...
const LEAST_IN_REACH: f64 = 0.5;
/// ...more than this share of a picture coarse...
const MOST_COARSE: f64 = 0.05;
/// ...or more light than this unseen.
const MOST_UNSEEN: f64 = 0.02;

/// A finished bake, as far as its budget goes.
pub struct Spent<'a> {
    /// Rays against the scene with its layout.
    pub caster: &'a RayCaster<'a>,
    /// The layout.
    pub atlas: &'a Atlas,
    /// All receivers.
    pub receivers: &'a ReceiverSet,
    /// All probes.
    pub probes: &'a ProbeSet,
    /// `[n_receivers]` unseen share of each.
    pub unseen: &'a [f32],
    /// Texels of the direct light map that relight rays may read.
    pub direct_texels: usize,
}

impl Spent<'_> {
    /// Where it went, of `asked` receivers.
    pub fn facts(&self, asked: u32) -> BudgetFacts {
        let edges = self.chart_texels();
        let of_receivers = || self.receivers.chart.iter().map(|&chart| edges[chart as usize]);
        let cameras = &self.caster.scene().cameras;
        BudgetFacts {
            receivers_asked: asked,
            texel: TexelFacts {
                finest: of_receivers().reduce(f32::min).unwrap_or_default(),
                median: median(of_receivers()),
                coarsest: of_receivers().reduce(f32::max).unwrap_or_default(),
            },
            map_used: (self.receivers.len() + self.receivers.invalid.len()) as f64
                / f64::from(self.receivers.size.max(1)).powi(2),
            texels_per_receiver: self.direct_texels as f64 / self.receivers.len().max(1) as f64,
            views: cameras.iter().take(MOST_VIEWS).map(|camera| self.view(camera, &edges)).collect(),
        }
    }

    /// Mean edge of the texels of each chart, metres.
    fn chart_texels(&self) -> Vec<f32> {
        let scene = self.caster.scene();
        let mut areas = vec![(0.0f64, 0.0f64); self.atlas.n_charts as usize];
        for (face, (mesh, triangle)) in scene.faces().enumerate() {
            let [a, b, c] = self.atlas.corners[face].map(|uv| uv.as_dvec2());
            let on_map = (b - a).perp_dot(c - a).abs();
            // Faces in one point of the map share the texels of others.
            if on_map > 0.0 {
                let sums = &mut areas[self.atlas.chart[face] as usize];
                *sums = (sums.0 + 2.0 * scene.area_m2(mesh, triangle), sums.1 + on_map);
            }
        }
        let edge = |(area, on_map): &(f64, f64)| ((area / on_map).sqrt() / f64::from(self.receivers.size)) as f32;
        areas.iter().map(|sums| if sums.1 > 0.0 { edge(sums) } else { 0.0 }).collect()
    }

    /// What a camera sees; `texels` are the edges of each chart's.
    fn view(&self, camera: &Camera, texels: &[f32]) -> ViewFacts {
        let lens = Lens::of(camera);
        let [across, down] = RAYS;
        let seen: Vec<(f32, f32)> = (0..across * down)
            .filter_map(|index| {
                let [u, v] = [(index % across) as f32 + 0.5, (index / across) as f32 + 0.5];
                let dir = camera_dir(camera, u / across as f32, v / down as f32, lens.aspect);
                let hit = self.caster.closest_hit(lens.eye, dir)?;
                Some((texels[self.atlas.chart[hit.point?.face.0 as usize] as usize], hit.t))
            })
            .collect();
        let coarse = seen.iter().filter(|(texel_m, distance)| *texel_m > COARSE * distance).count();
        let offset_m = self.caster.offset_m();
        let receivers: Vec<usize> = (0..self.receivers.len())
            .into_par_iter()
            .filter(|&index| {
                let (position, normal) = (self.receivers.position[index], self.receivers.geometric_normal[index]);
                normal.dot(lens.eye - position) > 0.0
                    && lens.holds(position)
                    && self.caster.visible(position + normal * offset_m, lens.eye)
            })
            .collect();
        let probes = self.probes.positions.iter();
        let probes = probes.filter(|&&probe| lens.holds(probe) && self.caster.visible(probe, lens.eye)).count();
        let unseen: f64 = receivers.iter().map(|&index| f64::from(self.unseen[index])).sum();
        let reach_m = self.reach_m(lens.eye);
        let near = self.receivers.position.iter().filter(|position| position.distance(lens.eye) <= reach_m).count();
        ViewFacts {
            name: camera.name.clone(),
            texel_median: median(seen.iter().map(|pixel| pixel.0)),
            receivers: receivers.len() as u64,
            probes: probes as u64,
            coarse: coarse as f64 / seen.len().max(1) as f64,
            unseen: unseen / receivers.len().max(1) as f64,
            reach: near as f64 / self.receivers.len().max(1) as f64,
        }
    }

    /// Distance within which most of what is seen from a place is.
    fn reach_m(&self, eye: Vec3) -> f32 {
        let hit = |ray| Some(self.caster.closest_hit(eye, Vec3::from(spherical_fibonacci(ray, RAYS_AROUND)))?.t);
        let mut distances: Vec<f32> = (0..RAYS_AROUND).filter_map(hit).collect();
        distances.sort_unstable_by(f32::total_cmp);
        distances.get((WITHIN * distances.len() as f64) as usize).copied().unwrap_or(f32::INFINITY)
    }
}

/// A camera's frustum.
struct Lens {
    eye: Vec3,
    to_camera: Mat4,
    /// Width over height.
    aspect: f32,
    /// Half height at distance 1.
    half: f32,
}

impl Lens {
    fn of(camera: &Camera) -> Self {
        Self {
            eye: camera.to_world.w_axis.truncate(),
            to_camera: camera.to_world.inverse(),
            aspect: camera.aspect.unwrap_or(ASPECT),
            half: (0.5 * camera.fov_y).tan(),
        }
    }

    fn holds(&self, position: Vec3) -> bool {
        let local = self.to_camera.transform_point3(position);
        let half = -local.z * self.half;
        local.z < 0.0 && local.x.abs() <= half * self.aspect && local.y.abs() <= half
    }
}

/// What a user should know of the views, each with a remedy.
pub fn warnings(views: &[ViewFacts]) -> Vec<String> {
    let mut warnings = Vec::new();
    let most = views.iter().map(|view| view.reach).fold(0.0, f64::max);
    if !views.is_empty() && most < LEAST_IN_REACH {
        warnings.push(format!(
            "only {:.0} % of the receivers are within the reach of a camera: give --focus x,y,z,radius where people look, or leave \
             out what is far away",
            100.0 * most
        ));
    }
    for view in views {
        if view.coarse > MOST_COARSE {
            warnings.push(format!(
                "{:.0} % of what camera {} sees has texels larger than 1/30 of its distance (median {:.3} m): use more \
                 --receivers, or --focus x,y,z,radius there",
                100.0 * view.coarse,
                view.name,
                view.texel_median
            ));
        }
        if view.unseen > MOST_UNSEEN {
            warnings.push(format!(
                "{:.1} % of the light that camera {} sees comes from surfaces that no probe sees: use more --probes, or \
                 --focus x,y,z,radius there",
                100.0 * view.unseen,
                view.name
            ));
        }
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_name_view_figure_and_remedy() {
        let good = ViewFacts { name: "door".into(), reach: 0.9, ..ViewFacts::default() };
        assert!(warnings(&[]).is_empty() && warnings(std::slice::from_ref(&good)).is_empty());
        let far = ViewFacts { reach: 0.2, ..good.clone() };
        assert!(warnings(std::slice::from_ref(&far))[0].contains("20 %"));
        // One view that reaches most is enough.
        assert!(warnings(&[far, good.clone()]).is_empty());
        let coarse = warnings(&[ViewFacts { coarse: 0.5, texel_median: 0.25, ..good.clone() }]);
        assert!(coarse.len() == 1 && coarse[0].contains("door") && coarse[0].contains("--receivers"), "{coarse:?}");
        let unseen = warnings(&[ViewFacts { unseen: 0.03, ..good }]);
        assert!(unseen.len() == 1 && unseen[0].contains("3.0 %") && unseen[0].contains("--probes"), "{unseen:?}");
    }

    #[test]
    fn a_lens_holds_what_it_looks_at() {
        let to_world = Mat4::from_translation(Vec3::new(0.0, 1.0, 5.0));
        let camera = Camera { name: "c".into(), to_world, fov_y: 1.0, aspect: Some(1.5) };
        let lens = Lens::of(&camera);
        assert!(lens.holds(Vec3::Y) && !lens.holds(Vec3::new(0.0, 1.0, 9.0)) && !lens.holds(Vec3::new(9.0, 1.0, 0.0)));
        let through = |u, v| lens.eye + 3.0 * camera_dir(&camera, u, v, lens.aspect);
        assert!(lens.holds(through(0.99, 0.01)) && !lens.holds(through(1.01, 0.5)) && !lens.holds(through(0.5, -0.01)));
    }
}
