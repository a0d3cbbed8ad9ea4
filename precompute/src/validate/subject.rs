//! What is validated: a baked file and its scene, with what the bake knew and the file leaves out brought back.
//!
//! A file holds compressed clusters only. Geometric normals, supporting probes and gather directions are functions of the
//! scene, the options and the probes, all of which it does hold; they are computed again here, by the bake's own stages,
//! and checked against the file.

use crate::{
    clusters::leaves,
    error::BakeError,
    lightmap::{Atlas, ReceiverSet, receivers, texels, texels::ReceiverMap},
    plan::BakePlan,
    probe_views::ProbeDirections,
    probes::{self, ProbeSet, Support},
    progress::{Cancelled, Progress},
    rays::RayCaster,
    settings::{BakeSettings, Transport},
    transport::{FitScene, GatherSet, NearField, Receivers, TransportLeaf, TransportScene},
};
use glam::{Vec2, Vec3};
use localprt_formats::{BakedView, Checked, sh};
use localprt_scenes::SurfacePoint;
use rayon::prelude::*;

/// A baked file under validation.
pub struct Subject<'a> {
    /// The file's arrays.
    pub view: BakedView<'a>,
    /// Rays against the file's scene.
    pub caster: &'a RayCaster<'a>,
    /// Options of the bake.
    pub settings: BakeSettings,
    /// Lightmap layout.
    pub atlas: Atlas,
    /// `[n_faces]` whether the face has texels, its own or those of faces that it shares with.
    pub has_texels: Vec<bool>,
    /// The file, checked for relighting.
    pub checked: Checked<'a>,
    /// Cluster of each receiver, in file order.
    pub cluster: Vec<u32>,
    /// Receiver of each texel of the receiver map; `u32::MAX` where there is none.
    pub at_texel: Vec<u32>,
    /// Receivers as the bake placed them.
    placed: ReceiverSet,
    /// Place in `placed` of each receiver in file order.
    place: Vec<u32>,
    probes: ProbeSet,
    support: Support,
    gather: GatherSet,
    probe_basis: sh::Basis,
    sky_basis: sh::Basis,
    fit: Option<FitScene>,
    near: Option<NearField>,
    /// Leaves of the bake; members by place in `placed`.
    leaves: Vec<Vec<u32>>,
    /// Leaf of each receiver by place in `placed`.
    leaf_of: Vec<u32>,
}

impl<'a> Subject<'a> {
    /// Brings back what the file leaves out. The caster's scene is the one that the file was baked from.
    ///
    /// # Errors
    /// [`BakeError::Scene`] if scene and file do not fit each other, as after a bake by another version of this program;
    /// [`BakeError::Cancelled`].
    pub fn new(checked: Checked<'a>, caster: &'a RayCaster<'a>, progress: &Progress) -> Result<Self, BakeError> {
        let _stage = progress.stage("receivers and probes", 0);
        let view = *checked.view();
        let metadata = view.metadata;
        let settings = BakeSettings::of_file(&metadata.options)?;
        let atlas = Atlas::of(caster.scene());
        let watch = |_: &str, _: usize, _: usize| !progress.is_cancelled();
        let placed =
            receivers::place(caster.scene(), &atlas, caster, metadata.lightmap_size, &watch).ok_or(Cancelled)?;

        let mut at_texel = vec![u32::MAX; metadata.lightmap_size as usize * metadata.lightmap_size as usize];
        for (place, &texel) in placed.texel.iter().enumerate() {
            at_texel[texel as usize] = place as u32;
        }
        let place: Vec<u32> = view.receiver_texel.iter().map(|&texel| at_texel[texel as usize]).collect();
        let stands_there = |(&place, position): (&u32, &[f32; 3])| {
            placed
                .position
                .get(place as usize)
                .is_some_and(|placed| placed.distance(Vec3::from(*position)) <= caster.offset_m())
        };
        let strays = place.iter().zip(view.receiver_position).filter(|&pair| !stands_there(pair)).count();
        if strays > 0 || placed.len() != view.receiver_texel.len() {
            let count = view.receiver_texel.len();
            return Err(does_not_fit(&format!("{strays} of its {count} receivers stand elsewhere on this scene")));
        }
        let plan = BakePlan::of_file(view.plan);
        let stored_m = view.probes.first().map_or(0.0, |probe| probe.support_radius_m);
        let positions: Vec<Vec3> = view.probes.iter().map(|probe| Vec3::from(probe.position)).collect();
        let (normals, given_m) = (&placed.geometric_normal, plan.as_ref().map(|_| stored_m));
        let (probes, support) = probes::link(caster, &positions, &placed.position, normals, &settings, given_m)
            .map_err(|error| does_not_fit(&error.to_string()))?;
        // Of a file without a plan the search ends on the same radius for the same receivers and probes.
        if (probes.radius_m - stored_m).abs() > 1e-5 * stored_m {
            return Err(does_not_fit(&format!("its support radius is {stored_m} m, not {} m", probes.radius_m)));
        }

        for (receiver, &texel) in view.receiver_texel.iter().enumerate() {
            at_texel[texel as usize] = receiver as u32;
        }
        let mut cluster = vec![0; place.len()];
        for (index, own) in checked.transport().clusters.iter().enumerate() {
            cluster[own.receivers.clone()].fill(index as u32);
        }
        let probe_basis = sh::Basis::new(metadata.probe_degree);
        let fit = match settings.transport {
            Transport::Paper => None,
            Transport::Fitted => {
                let directions = ProbeDirections::new(metadata.n_rays, &probe_basis);
                let constants = plan.as_ref().and_then(|plan| plan.fit);
                Some(FitScene::new(caster, &atlas, &placed, &probes, &directions, constants)?)
            }
        };
        let planes = plan.as_ref().map(|plan| &plan.leaves);
        let (leaves, _) = leaves(&placed.position, settings.leaf as usize, planes);
        let mut leaf_of = vec![0; placed.len()];
        for (index, members) in leaves.iter().enumerate() {
            members.iter().for_each(|&member| leaf_of[member as usize] = index as u32);
        }
        let mut subject = Self {
            gather: GatherSet::new(settings.gather_rays, settings.receiver_degree, settings.seed),
            probe_basis,
            sky_basis: sh::Basis::new(metadata.sky_degree),
            has_texels: atlas.faces_with_texels(),
            view,
            caster,
            checked,
            settings,
            atlas,
            cluster,
            at_texel,
            placed,
            place,
            probes,
            support,
            fit,
            near: None,
            leaves,
            leaf_of,
        };
        subject.near = subject.near_field(plan.and_then(|plan| plan.near_least_gain));
        Ok(subject)
    }

    /// What the receivers read near light from; `None` if they read none.
    fn near_field(&self, least_gain: Option<f32>) -> Option<NearField> {
        let bytes = self.settings.near_bytes_in_force().filter(|_| self.checked.has_near_light())?;
        let scene = self.caster.scene();
        let light_map = Atlas::of_light_map(scene);
        let has_receiver: Vec<bool> = self.at_texel.iter().map(|&receiver| receiver != u32::MAX).collect();
        let size = self.view.metadata.lightmap_size;
        let receivers = ReceiverMap { atlas: &self.atlas, size, has_receiver: &has_receiver };
        let (direct, _) = texels::cover_visible(scene, &light_map, self.view.metadata.direct_size, &receivers);
        let field = NearField::new(self.caster, light_map, &direct, &self.probes, &self.support);
        Some(match least_gain {
            Some(least) => field.with_least_gain(least),
            None => field.within(bytes, &self.transport()),
        })
    }

    /// Number of receivers.
    pub fn len(&self) -> usize {
        self.place.len()
    }

    /// True without receivers.
    pub fn is_empty(&self) -> bool {
        self.place.is_empty()
    }

    /// The transport stage of the bake. Its receivers are numbered by [`Subject::place`].
    pub fn transport(&self) -> TransportScene<'_> {
        TransportScene {
            caster: self.caster,
            receivers: Receivers::Surface(&self.placed),
            probes: &self.probes,
            support: &self.support,
            gather: &self.gather,
            probe_basis: &self.probe_basis,
            sky_basis: &self.sky_basis,
            fit: self.fit.as_ref(),
            near: self.near.as_ref(),
            cells: None,
        }
    }

    /// Results of `at(index, leaf)` for some receivers, given in file order: `[n_receivers]`, worked on leaf by leaf.
    ///
    /// # Errors
    /// [`BakeError::Cancelled`], and [`BakeError::Output`] of a scratch.
    pub fn each<T: Send + Clone + Default>(
        &self,
        name: &str,
        receivers: &[u32],
        progress: &Progress,
        at: impl Fn(usize, &TransportLeaf) -> T + Sync,
    ) -> Result<Vec<T>, BakeError> {
        let stage = progress.stage(name, receivers.len() as u64);
        let transport = self.transport();
        let mut by_leaf = vec![Vec::new(); self.leaves.len()];
        for (index, &receiver) in receivers.iter().enumerate() {
            by_leaf[self.leaf_of[self.place(receiver) as usize] as usize].push(index);
        }
        let asked_for = self.leaves.par_iter().zip(&by_leaf).filter(|(_, indices)| !indices.is_empty());
        let of_leaf = |(members, indices): (&Vec<u32>, &Vec<usize>)| {
            progress.check()?;
            let leaf = transport.leaf(members)?;
            let found = indices.par_iter().map(|&index| {
                progress.check()?;
                let found = at(index, &leaf);
                stage.inc(1);
                Ok((index, found))
            });
            found.collect::<Result<Vec<_>, BakeError>>()
        };
        let found = asked_for.map(of_leaf).collect::<Result<Vec<_>, BakeError>>()?;
        let mut results = vec![T::default(); receivers.len()];
        for (index, found) in found.into_iter().flatten() {
            results[index] = found;
        }
        Ok(results)
    }

    /// Number of a receiver, given in file order, in the transport stage.
    pub fn place(&self, receiver: u32) -> u32 {
        self.place[receiver as usize]
    }

    /// A receiver, in file order, as a point that receives light.
    pub fn point(&self, receiver: u32) -> SurfacePoint {
        let place = self.place(receiver) as usize;
        SurfacePoint {
            position: self.placed.position[place],
            normal: self.placed.normal[place],
            geometric_normal: self.placed.geometric_normal[place],
        }
    }

    /// Points over which what a receiver, in file order, gets is a mean.
    pub fn sites(&self, receiver: u32) -> &[SurfacePoint] {
        self.placed.sites(self.place(receiver) as usize)
    }

    /// The receiver, in file order, of the texel at a lightmap coordinate.
    pub fn receiver_at(&self, uv: Vec2) -> Option<u32> {
        let size = self.view.metadata.lightmap_size;
        let texel = (uv * size as f32).clamp(Vec2::ZERO, Vec2::splat(size as f32 - 1.0));
        let receiver = self.at_texel[(texel.y as u32 * size + texel.x as u32) as usize];
        (receiver != u32::MAX).then_some(receiver)
    }

    /// Chart of a receiver in file order.
    pub fn chart(&self, receiver: u32) -> u32 {
        self.placed.chart[self.place(receiver) as usize]
    }

    /// Supporting probes of a receiver in file order.
    pub fn supporting(&self, receiver: u32) -> &[u32] {
        self.support.of(self.place(receiver) as usize)
    }

    /// Radius of the weight kernel at a receiver in file order, metres.
    pub fn radius_m(&self, receiver: u32) -> f32 {
        self.support.radius_m[self.place(receiver) as usize]
    }

    /// Probe positions, metres.
    pub fn probe_positions(&self) -> &[Vec3] {
        &self.probes.positions
    }
}

fn does_not_fit(what: &str) -> BakeError {
    BakeError::Scene {
        what: format!("the file does not fit its scene: {what}"),
        place: None,
        remedy: "bake it again with this version of precompute".into(),
    }
}
