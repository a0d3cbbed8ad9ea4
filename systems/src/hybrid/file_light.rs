//! A baked file as a system: relit on the CPU, read at surface points of its scene.

use crate::{Feedback, Frame, Query, Shaded, System, Work, World};
use glam::{Vec2, Vec3};
use localprt_formats::{Checked, quantize::unpack_uv};
use localprt_runtime::scene_light::{scene_texels, traced_irradiance};
use localprt_runtime::{CpuRelighter, RelightError, SceneLight, SceneTexels};
use localprt_scenes::{Lighting, SurfacePoint};
use localprt_surfaces::{atlas::Atlas, rays::RayCaster};
use rayon::prelude::*;

/// Ray offsets above a surface from which it is looked for; it is found twice as far away at most.
const LIFT: f32 = 4.0;
/// A face is the point's own if the cosine between their normals is above this: coincident faces look to opposite sides.
const SAME_SIDE: f32 = 0.5;

/// A baked file with its scene.
pub struct FileLight<'a> {
    caster: &'a RayCaster<'a>,
    atlas: Atlas,
    has_texels: Vec<bool>,
    texels: SceneTexels,
    /// Direct irradiance of the texels in the last frame.
    direct: Vec<Vec3>,
    relighter: CpuRelighter<'a>,
    refused: Option<RelightError>,
}

impl<'a> FileLight<'a> {
    /// Of a file and rays against the scene that was baked, with its lightmap coordinates. All light is zero.
    pub fn new(baked: Checked<'a>, caster: &'a RayCaster<'a>) -> Self {
        let atlas = Atlas::of(caster.scene());
        let has_texels = atlas.faces_with_texels();
        let texels = scene_texels(caster, baked.view());
        let relighter = CpuRelighter::new(baked);
        Self { caster, atlas, has_texels, texels, direct: Vec::new(), relighter, refused: None }
    }

    /// Rays against what stands still.
    pub fn caster(&self) -> &'a RayCaster<'a> {
        self.caster
    }

    /// Why the last lighting was refused; the light then stays as it was.
    pub fn refused(&self) -> Option<&RelightError> {
        self.refused.as_ref()
    }

    /// Irradiance about a point's shading normal, W m^-2; `None` where it is not on a surface of the file with texels, as on something that moves.
    pub fn at(&self, point: &SurfacePoint) -> Option<Vec3> {
        let lift = LIFT * self.caster.offset_m();
        let normal = point.geometric_normal;
        let hit = self.caster.closest_hit(point.position + normal * lift, -normal)?;
        let face = hit.point.filter(|_| hit.t <= 2.0 * lift && hit.normal.dot(normal) > SAME_SIDE)?;
        let has_texels = self.has_texels.get(face.face.0 as usize).copied().unwrap_or_default();
        if !has_texels {
            return None;
        }
        let uv = self.atlas.at(&face);
        self.relighter.relit().maps.irradiance_about(point.normal, |map| map.sample(uv))
    }

    /// The same at points that are looked at.
    pub(super) fn lights(&self, points: &[Shaded]) -> Vec<Option<Vec3>> {
        points.par_iter().with_min_len(256).map(|shaded| self.at(&shaded.point)).collect()
    }

    /// Points and present light of the texels that the file is relit by.
    pub(super) fn texel_lights(&self) -> Vec<(SurfacePoint, Vec3)> {
        let map = &self.relighter.relit().maps.irradiance;
        let size = self.texels.size;
        let of_texel = |texel: usize| {
            let point = SurfacePoint {
                position: self.texels.position[texel],
                normal: self.texels.normal[texel],
                geometric_normal: self.texels.geometric_normal[texel],
            };
            let index = self.texels.index[texel];
            let uv = match self.texels.lightmap_uv.get(texel) {
                Some(&packed) => Vec2::from(unpack_uv(packed)),
                None => (Vec2::new((index % size) as f32, (index / size) as f32) + 0.5) / size as f32,
            };
            (point, map.sample(uv).unwrap_or_default())
        };
        (0..self.texels.len()).into_par_iter().map(of_texel).collect()
    }

    /// One gather, with shadows of the surfaces of `shadows`. `added` is irradiance of texels beside that of lamps, or none: light of
    /// another system, or a change of its own. It starts from its light of the gather before if it `goes_on`, from darkness otherwise.
    pub(super) fn gather(
        &mut self,
        frame: &Frame<'_>,
        shadows: &RayCaster<'_>,
        added: Option<&[Vec3]>,
        goes_on: bool,
    ) -> Work {
        let lighting: &Lighting = frame.world.lighting();
        if !frame.still || self.direct.len() != self.texels.len() {
            self.direct = traced_irradiance(shadows, &self.texels, &lighting.lights);
        }
        let mut direct = self.direct.clone();
        for (direct, added) in direct.iter_mut().zip(added.unwrap_or_default()) {
            *direct += *added;
        }
        let view = *self.relighter.baked().view();
        let light = SceneLight::new(self.caster.scene(), &self.texels, lighting, direct, &view);
        let inputs = light.inputs(1);
        let relit = if goes_on { self.relighter.step(&inputs) } else { self.relighter.relight(&inputs) };
        self.refused = relit.err();
        let baked = self.relighter.baked();
        Work {
            rays: 0,
            query_rays: 0,
            shadow_rays: (self.texels.samples.len() * lighting.lights.len()) as u64,
            texels: (baked.n_receivers() + baked.n_probes() * baked.n_sh()) as u64,
            probes: baked.n_probes() as u64,
        }
    }
}

/// The file alone: it knows nothing of what moves.
impl System for FileLight<'_> {
    fn update(&mut self, frame: &Frame<'_>) -> Work {
        let added = match frame.feedback {
            Feedback::Of(other) => {
                let points: Vec<_> = self.texel_lights().iter().map(|&(point, _)| Shaded::from_above(point)).collect();
                Some(other.feedback(frame.world, &points))
            }
            _ => None,
        };
        let goes_on = matches!(frame.feedback, Feedback::Own);
        self.gather(frame, self.caster, added.as_deref(), goes_on)
    }

    fn irradiance(&self, _: &World<'_>, query: &Query<'_>) -> Vec<Vec3> {
        self.lights(query.points).into_iter().map(Option::unwrap_or_default).collect()
    }

    fn probes(&self) -> usize {
        self.relighter.baked().n_probes()
    }

    /// What relighting reads every frame: transport, near light and relight rays.
    fn bytes(&self) -> u64 {
        self.relighter.baked().view().transport_bytes().total()
    }
}
