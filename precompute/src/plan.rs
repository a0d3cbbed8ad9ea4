//! The plan of a bake: where its charts, probes and leaves are and with which constants its rows were made. It lies in the baked file.
//! A bake that keeps to the plan of an earlier one leaves all that an edit does not touch where it was, to the bit.

use crate::lightmap::sides::BACK;
use crate::{
    clusters::LeafTree,
    digest::{Digest, Digester},
    error::BakeError,
    lightmap::unwrap::Fineness,
    probes::{KeptProbes, Spread},
    scene_digests::digest_of_shape,
    settings::BakeSettings,
    transport::FitConstants,
};
use glam::{DVec3, Vec3};
use localprt_formats::{Baked, directions::counter_uniform};
use localprt_scenes::{Mesh, Scene};
use localprt_tools::hex;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
};

/// Stream of random numbers of this file.
const STREAM: u64 = 0x706c_616e;
/// Of the content of [`BakePlan`].
const VERSION: u32 = 1;
/// A mesh that has moved has its vertices where they were from its first within this share of their distance from the origin: some
/// roundings.
const SAME: f64 = 5e-7;
/// Weighted sums of vertices that tell a mesh that has moved from one that is another.
const SUMS: usize = 4;

/// What a bake leaves to the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakePlan {
    /// Of the content.
    pub version: u32,
    /// Digest of the options that it depends on.
    pub options: String,
    /// Charts of the meshes; absent where the scene brought its own layout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub charts: Option<ChartPlan>,
    /// How the probes, which the file has, were spread.
    pub spread: Spread,
    /// Constants of the fit; absent for rows of the paper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<FitConstants>,
    /// Least gain of near light; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_least_gain: Option<f32>,
    /// Support radius of the cells of the volume, metres; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume_radius_m: Option<f32>,
    /// Planes between the leaves of receivers.
    pub leaves: LeafTree,
}

/// Which charts are whose, and how fine others have to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChartPlan {
    /// How fine the charts are.
    pub fineness: Fineness,
    /// Meshes of the scene as it was given, in its order.
    pub meshes: Vec<MeshPlan>,
}

/// A mesh as it was given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshPlan {
    /// Digest of all but where it is.
    shape: String,
    /// Digest of where its vertices are.
    places: String,
    /// Its first vertex, metres.
    first: Vec3,
    /// Sums over its vertices, from the first, with weights of their own, metres.
    sums: [[f32; 3]; SUMS],
    /// Vertices are no farther than this from the origin, metres.
    reach: f32,
    /// Meshes with charts that became of it, in order: whether they are backs.
    pub parts: Vec<bool>,
}

impl BakePlan {
    /// Of a bake by these options; the rest is left to its stages.
    pub fn new(settings: &BakeSettings, charts: Option<ChartPlan>, spread: Spread) -> Self {
        let options = options(settings);
        Self {
            version: VERSION,
            options,
            charts,
            spread,
            fit: None,
            near_least_gain: None,
            volume_radius_m: None,
            leaves: LeafTree::default(),
        }
    }

    /// That in a file; `None` if it has none that this version reads.
    pub fn of_file(text: &str) -> Option<Self> {
        let plan: Self = serde_json::from_str(text).ok()?;
        let numbers = [plan.spread.gap, plan.near_least_gain.unwrap_or(1.0)];
        let fit = plan.fit.map_or([1.0; 2], |fit| [fit.spacing_m, fit.usual_scale]);
        let fit = [fit[0], fit[1], plan.volume_radius_m.unwrap_or(1.0)];
        let is_sound = plan.version == VERSION
            && plan.charts.as_ref().is_none_or(ChartPlan::is_sound)
            && plan.leaves.is_sound()
            && numbers.iter().all(|value| value.is_finite() && *value >= 0.0)
            && fit.iter().all(|value| value.is_finite() && *value > 0.0);
        is_sound.then_some(plan)
    }

    /// As stored.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("numbers and strings")
    }

    /// Whether a bake by these options can keep to it.
    pub fn is_for(&self, settings: &BakeSettings) -> bool {
        self.options == options(settings)
    }
}

impl ChartPlan {
    /// Whether its numbers are those of a layout: nothing else can be written, and read again.
    pub fn is_sound(&self) -> bool {
        let Fineness { finest, receivers, light_map } = self.fineness;
        let of_mesh = |mesh: &MeshPlan| {
            mesh.first.is_finite()
                && mesh.reach.is_finite()
                && mesh.sums.as_flattened().iter().all(|sum| sum.is_finite())
        };
        [finest, receivers, light_map].iter().all(|value| value.is_finite() && *value > 0.0)
            && self.meshes.iter().all(of_mesh)
    }
}

impl MeshPlan {
    /// Of a mesh of a scene.
    pub fn of(scene: &Scene, mesh: &Mesh, parts: Vec<bool>) -> Self {
        let first = mesh.positions.first().copied().unwrap_or_default();
        let places = hex(&Digester::new("places").all(&mesh.positions).finish());
        let mut sums = [DVec3::ZERO; SUMS];
        for (place, number) in mesh.positions.iter().zip(0..) {
            for (sum, stream) in sums.iter_mut().zip(0..) {
                let weight = 2.0 * counter_uniform(STREAM, number, stream) - 1.0;
                *sum += (place.as_dvec3() - first.as_dvec3()) * weight;
            }
        }
        let reach = mesh.positions.iter().map(|place| place.abs().max_element()).fold(0.0, f32::max);
        let sums = sums.map(|sum| sum.as_vec3().to_array());
        Self { shape: hex(&digest_of_shape(scene, mesh)), places, first, sums, reach, parts }
    }
}

impl MeshPlan {
    /// Whether vertices lie to each other as those of another mesh of this shape do.
    fn has_moved_from(&self, other: &Self, mesh: &Mesh) -> bool {
        let step = SAME * f64::from(self.reach.max(other.reach));
        let most = step * (mesh.positions.len() as f64).sqrt().max(1.0);
        self.first != other.first
            && self
                .sums
                .iter()
                .flatten()
                .zip(other.sums.iter().flatten())
                .all(|(a, b)| f64::from((a - b).abs()) <= most)
    }
}

/// Digest of the options on which charts, probes and leaves depend: none of those that only say how light is transported.
fn options(settings: &BakeSettings) -> String {
    let default = BakeSettings::default();
    let of_plan = BakeSettings {
        probe_degree: default.probe_degree,
        sky_degree: default.sky_degree,
        gather_rays: default.gather_rays,
        relight_rays: default.relight_rays,
        volume: default.volume,
        volume_degree: default.volume_degree,
        threshold: default.threshold,
        coefficients: default.coefficients,
        max_unseen: default.max_unseen,
        ..settings.clone()
    };
    hex(&Digester::new("plan").all(of_plan.to_toml().as_bytes()).finish())
}

/// An earlier bake whose plan is kept to.
#[derive(Debug)]
pub struct Previous {
    /// The baked file.
    pub path: PathBuf,
    /// Its plan.
    pub plan: BakePlan,
    /// Its scene, with the charts; `None` where the scene brought its own layout.
    scene: Option<Scene>,
    /// Probe positions, metres.
    probes: Vec<Vec3>,
    radius_m: f32,
    size: u32,
    /// Where its receivers stand, metres.
    receivers: Vec<Vec3>,
}

/// A mesh of a scene beside the layout of an earlier bake.
#[derive(Debug)]
pub enum Laid {
    /// It has charts: these meshes, and whether they are backs.
    Kept(Vec<Mesh>, Vec<bool>),
    /// It is new, or another than it was.
    New,
}

impl Previous {
    /// The bake at a path: a baked file, or the scene beside one.
    ///
    /// # Errors
    /// [`BakeError::Option`] if there is no such bake or it has no plan.
    pub fn open(path: &Path) -> Result<Self, BakeError> {
        let is_scene = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
        let baked = if is_scene { baked_of(path) } else { path.to_owned() };
        let refused = |what: String, remedy: &str| BakeError::Option {
            what: format!("no layout can be kept from {}: {what}", path.display()),
            remedy: remedy.into(),
        };
        let bake_again = "bake it again, or leave out --layout";
        let file = Baked::open(&baked)
            .map_err(|error| refused(error.to_string(), "name OUT.glb of a bake whose OUT.lprt lies beside it"))?;
        let view = file.view();
        let plan = BakePlan::of_file(view.plan).ok_or_else(|| refused("it has no plan".into(), bake_again))?;
        let radius_m = view.probes.first().map_or(0.0, |probe| probe.support_radius_m);
        let folder = baked.parent().unwrap_or(Path::new("."));
        let scene = match plan.charts {
            None => None,
            Some(_) => {
                let scene = if is_scene { path.to_owned() } else { folder.join(&view.metadata.scene_path) };
                let scene = localprt_scenes::load(&scene).map_err(|error| refused(error.to_string(), bake_again))?;
                if scene.hash != view.metadata.scene_hash {
                    return Err(refused("scene and baked file do not belong together".into(), bake_again));
                }
                Some(scene)
            }
        };
        let probes = view.probes.iter().map(|probe| Vec3::from(probe.position)).collect();
        let receivers = view.receiver_position.iter().map(|&position| Vec3::from(position)).collect();
        let size = view.metadata.lightmap_size;
        Ok(Self { path: path.to_owned(), plan, scene, probes, radius_m, size, receivers })
    }

    /// Whether most receivers stand where it had one: of a scene that brings its own layout, which tells nothing of what has changed.
    pub fn is_of(&self, receivers: &[Vec3]) -> bool {
        let place = |position: Vec3| position.to_array().map(f32::to_bits);
        let there: HashSet<_> = self.receivers.iter().map(|&position| place(position)).collect();
        2 * receivers.iter().filter(|position| there.contains(&place(**position))).count() > receivers.len()
    }

    /// Its probes.
    pub fn probes(&self) -> KeptProbes<'_> {
        KeptProbes { positions: &self.probes, radius_m: self.radius_m, spread: self.plan.spread }
    }

    /// Texels per side of its receiver map.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// TEXCOORD set of its light map.
    pub fn light_map_set(&self) -> Option<usize> {
        self.scene.as_ref()?.light_map_set
    }

    /// Digest of all that a bake keeps of it.
    pub fn digest(&self) -> Digest {
        let mut digester = Digester::new("previous");
        let scene = self.scene.as_ref().map_or([0; 32], |scene| scene.hash);
        digester.one(scene).all(&self.probes).one(self.radius_m).one(self.size);
        digester.all(self.plan.to_json().as_bytes()).finish()
    }

    /// `[meshes]` of a scene: those that are what they were, wherever they have moved to without turning, with their charts. `None` if
    /// it had no charts of its own, or its scene has lost some.
    pub fn laid(&self, scene: &Scene) -> Option<Vec<Laid>> {
        let (charts, former) = (self.plan.charts.as_ref()?, self.scene.as_ref()?);
        let n_parts: usize = charts.meshes.iter().map(|mesh| mesh.parts.len()).sum();
        if n_parts != former.meshes.len() {
            return None;
        }
        let mut first = 0;
        // Meshes of each shape, by where they were: those that nobody has taken.
        let mut of_shape: HashMap<&str, Vec<(&MeshPlan, &[Mesh])>> = HashMap::new();
        for plan in &charts.meshes {
            let parts = &former.meshes[first..first + plan.parts.len()];
            first += parts.len();
            of_shape.entry(&plan.shape).or_default().push((plan, parts));
        }
        let plans: Vec<MeshPlan> = scene.meshes.par_iter().map(|mesh| MeshPlan::of(scene, mesh, Vec::new())).collect();
        let mut laid: Vec<Laid> = plans.iter().map(|_| Laid::New).collect();
        for has_moved in [false, true] {
            for ((mesh, plan), laid) in scene.meshes.iter().zip(&plans).zip(&mut laid) {
                let Some(others) = of_shape.get_mut(&*plan.shape).filter(|_| matches!(laid, Laid::New)) else {
                    continue;
                };
                let is_it = |(other, parts): &(&MeshPlan, &[Mesh])| match has_moved {
                    false => other.places == plan.places,
                    true => plan.has_moved_from(other, mesh) && is_at(mesh, parts, plan.first - other.first),
                };
                let Some(place) = others.iter().position(is_it) else { continue };
                let (other, parts) = others.remove(place);
                let moved = if has_moved { plan.first - other.first } else { Vec3::ZERO };
                let part = |(part, is_back): (&Mesh, &bool)| of_now(part, *is_back, mesh, moved);
                *laid = Laid::Kept(parts.iter().zip(&other.parts).map(part).collect(), other.parts.clone());
            }
        }
        Some(laid)
    }
}

/// The baked file whose scene this is: `OUT.lprt` of `OUT.glb` and of `OUT.lightmap.glb`.
fn baked_of(scene: &Path) -> PathBuf {
    let stem = scene.with_extension("");
    let is_beside = stem.extension().is_some_and(|extension| extension == "lightmap");
    if is_beside { stem.with_extension("lprt") } else { scene.with_extension("lprt") }
}

/// Whether all vertices of a mesh are those of its former parts, moved.
fn is_at(mesh: &Mesh, parts: &[Mesh], moved: Vec3) -> bool {
    let reach = mesh.positions.iter().map(|position| position.abs().max_element()).fold(1e-3, f32::max);
    let step = 2.0 * SAME as f32 * (reach + moved.abs().max_element());
    let cell = |position: Vec3| (position / step).floor().as_i64vec3();
    let there: HashSet<_> = parts.iter().flat_map(|part| &part.positions).map(|&at| cell(at + moved)).collect();
    let used: HashSet<u32> = mesh.triangles.iter().flatten().copied().collect();
    used.iter().all(|&vertex| {
        let position = mesh.positions[vertex as usize];
        // On the border between two cells it may be in either.
        (0..8).any(|corner| {
            let side = [1, 2, 4].map(|bit| if corner & bit == 0 { -0.5 } else { 0.5 });
            there.contains(&cell(position + Vec3::from(side) * step))
        })
    })
}

/// A part of a mesh as it was laid out, with names and material of the mesh as it is now.
fn of_now(part: &Mesh, is_back: bool, mesh: &Mesh, moved: Vec3) -> Mesh {
    let back = if is_back { BACK } else { "" };
    let mut part = Mesh {
        name: format!("{}{back}", mesh.name),
        source: mesh.source.clone(),
        material: mesh.material,
        variants: mesh.variants.clone(),
        lightmap: mesh.lightmap,
        ..part.clone()
    };
    if moved != Vec3::ZERO {
        part.positions.iter_mut().for_each(|position| *position += moved);
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_scenes::builtin;

    #[test]
    fn a_moved_mesh_is_known_and_one_with_a_vertex_elsewhere_is_not() {
        let scene = builtin::scene("cornell").expect("a scene");
        let mesh = &scene.meshes[scene.meshes.len() - 1];
        let moved = Vec3::new(0.3, 0.0, -0.2);
        let mut other = mesh.clone();
        other.positions.iter_mut().for_each(|position| *position += moved);
        let parts = [mesh.clone()];
        assert!(is_at(&other, &parts, moved));
        assert_eq!(of_now(&parts[0], false, &other, moved).positions, other.positions);
        let plan = |mesh: &Mesh| MeshPlan::of(&scene, mesh, vec![false]);
        assert!(plan(&other).has_moved_from(&plan(mesh), &other));
        // Two vertices in each other's place are where vertices were.
        let mut turned = other.clone();
        turned.positions.swap(1, 2);
        assert!(is_at(&turned, &parts, moved) && !plan(&turned).has_moved_from(&plan(mesh), &turned));
        other.positions[2].y += 1e-3;
        assert!(!is_at(&other, &parts, moved) && !plan(&other).has_moved_from(&plan(mesh), &other));
    }

    #[test]
    fn the_file_of_a_scene_lies_beside_it() {
        for (scene, baked) in
            [("a/hall.glb", "a/hall.lprt"), ("hall.lightmap.glb", "hall.lprt"), ("b.c.glb", "b.c.lprt")]
        {
            assert_eq!(baked_of(Path::new(scene)), Path::new(baked));
        }
    }

    #[test]
    fn a_plan_is_read_as_it_was_written_and_not_if_it_is_damaged() {
        let settings = BakeSettings::default();
        let plan = BakePlan {
            fit: Some(FitConstants { spacing_m: 0.1 + 0.2, usual_scale: 1.0 / 3.0 }),
            near_least_gain: Some(1e-7 / 3.0),
            ..BakePlan::new(&settings, None, Spread { is_even: false, gap: 1.7 })
        };
        let text = plan.to_json();
        assert_eq!(BakePlan::of_file(&text), Some(plan.clone()));
        assert!(plan.is_for(&BakeSettings { threshold: 0.5, ..settings.clone() }));
        assert!(!plan.is_for(&BakeSettings { receivers: 17, ..settings }));
        for (from, to) in
            [("\"version\":1", "\"version\":2"), ("1.7", "-1.7"), ("\"leaves\":[]", "\"leaves\":[[4,1.0]]")]
        {
            assert!(text.contains(from), "{text}");
            assert_eq!(BakePlan::of_file(&text.replace(from, to)), None, "{to}");
        }
    }

    /// What is infinite as f32 would be written as nothing, and not be read again.
    #[test]
    fn numbers_of_a_plan_that_are_none_are_refused() {
        let scene = builtin::scene("plane").expect("a scene");
        let charts = ChartPlan {
            fineness: Fineness { finest: 0.5, receivers: 11.3, light_map: 9.0 },
            meshes: vec![MeshPlan::of(&scene, &scene.meshes[0], vec![false])],
        };
        let text = BakePlan::new(&BakeSettings::default(), Some(charts), Spread { is_even: true, gap: 1.7 }).to_json();
        assert!(BakePlan::of_file(&text).is_some());
        for key in ["\"finest\":", "\"light_map\":", "\"gap\":", "\"first\":[", "\"sums\":[[", "\"reach\":"] {
            let (before, rest) = text.split_once(key).expect("a plan has it");
            let (_, behind) = rest.split_at(rest.find([',', ']', '}']).expect("more follows"));
            let infinite = format!("{before}{key}1e39{behind}");
            assert_eq!(BakePlan::of_file(&infinite), None, "{infinite}");
        }
    }
}
