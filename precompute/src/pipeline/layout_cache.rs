//! Layouts by the scene and the options that they are made from, kept from bake to bake: the meshes of the scene as it is written,
//! cut and with their coordinates, and which materials are still double-sided. All else of the scene is what it was.

use super::leaf_cache::code;
use crate::{
    cache::{Cache, Packer, Unpacker},
    digest::{Digest, Digester},
    lightmap::LayoutReport,
    plan::ChartPlan,
    scene_digests::digest_of_scene,
    settings::BakeSettings,
};
use glam::Vec2;
use localprt_formats::check::MAX_MAP_SIZE;
use localprt_scenes::{LightmapWish, Mesh, Scene};
use localprt_surfaces::atlas::LIGHTMAP_SET;

/// Records of layouts.
const LAYOUT: &str = "layout";

/// A cache with the place of one layout.
pub(super) struct LayoutCache<'a> {
    cache: &'a Cache,
    digest: Digest,
}

impl<'a> LayoutCache<'a> {
    pub(super) fn of(cache: &'a Cache, scene: &Scene, settings: &BakeSettings) -> Self {
        let mut digester = Digester::new("layout");
        code(&mut digester);
        digester.one(digest_of_scene(scene)).all(of_layout(settings).to_toml().as_bytes());
        Self { cache, digest: digester.finish() }
    }

    /// The scene with the kept layout, if there is one.
    pub(super) fn find(&self, scene: &Scene) -> Option<(Scene, LayoutReport, ChartPlan)> {
        unpack(&self.cache.get(LAYOUT, &self.digest)?, scene)
    }

    /// Keeps the layout of a scene.
    pub(super) fn keep(&self, scene: &Scene, layout: &LayoutReport, charts: &ChartPlan) {
        self.cache.put(LAYOUT, &self.digest, &pack(scene, layout, charts));
    }
}

/// The options without those that come into play only once receivers stand.
fn of_layout(settings: &BakeSettings) -> BakeSettings {
    let default = BakeSettings::default();
    BakeSettings {
        overlap: default.overlap,
        min_overlap: default.min_overlap,
        repair: default.repair,
        standoff: default.standoff,
        probe_degree: default.probe_degree,
        receiver_degree: default.receiver_degree,
        sky_degree: default.sky_degree,
        gather_rays: default.gather_rays,
        relight_rays: default.relight_rays,
        transport: default.transport,
        near_bytes: default.near_bytes,
        volume: default.volume,
        volume_degree: default.volume_degree,
        leaf: default.leaf,
        threshold: default.threshold,
        coefficients: default.coefficients,
        max_unseen: default.max_unseen,
        ..settings.clone()
    }
}

pub(super) fn pack(scene: &Scene, layout: &LayoutReport, plan: &ChartPlan) -> Vec<u8> {
    let LayoutReport { kept: _, reason, back_faces, size, charts } = layout;
    let mut packer = Packer::default();
    packer
        .put(&[
            *back_faces as u64,
            (*size).into(),
            (*charts).into(),
            scene.light_map_set.map_or(u64::MAX, |set| set as u64),
        ])
        .put(reason.as_deref().unwrap_or_default().as_bytes())
        .put(&serde_json::to_vec(plan).expect("numbers and strings"))
        .put(&scene.materials.iter().map(|material| u8::from(material.double_sided)).collect::<Vec<_>>())
        .put(&[scene.meshes.len() as u64]);
    for mesh in &scene.meshes {
        let Mesh {
            name,
            source,
            material,
            positions,
            normals,
            tangents,
            uv_sets,
            colors,
            triangles,
            variants,
            lightmap,
        } = mesh;
        packer
            .put(name.as_bytes())
            .put(source.as_bytes())
            .put(&[*material as u64, lightmap.bake.into(), lightmap.texel_scale.to_bits().into(), uv_sets.len() as u64])
            .put(positions)
            .put(normals)
            .put(tangents)
            .put(colors)
            .put(triangles)
            .put(&variants.iter().map(|pair| pair.map(|index| index as u64)).collect::<Vec<_>>());
        uv_sets.iter().for_each(|set| {
            packer.put(set);
        });
    }
    packer.finish()
}

pub(super) fn unpack(record: &[u8], scene: &Scene) -> Option<(Scene, LayoutReport, ChartPlan)> {
    let mut record = Unpacker::new(record);
    let text = |record: &mut Unpacker<'_>| String::from_utf8(record.take()?).ok();
    let [back_faces, size, charts, set]: [u64; 4] = record.take()?.try_into().ok()?;
    let reason = Some(text(&mut record)?).filter(|reason| !reason.is_empty());
    let plan: ChartPlan = serde_json::from_slice(&record.take::<u8>()?).ok()?;
    let layout = LayoutReport {
        kept: false,
        reason,
        back_faces: back_faces as usize,
        size: size.try_into().ok()?,
        charts: charts.try_into().ok()?,
    };
    let mesh = |record: &mut Unpacker<'_>| -> Option<Mesh> {
        let (name, source) = (text(record)?, text(record)?);
        let [material, bake, texel_scale, n_sets]: [u64; 4] = record.take()?.try_into().ok()?;
        let lightmap = LightmapWish { texel_scale: f32::from_bits(texel_scale as u32), bake: bake != 0 };
        Some(Mesh {
            name,
            source,
            material: material as usize,
            lightmap,
            positions: record.take()?,
            normals: record.take()?,
            tangents: record.take()?,
            colors: record.take()?,
            triangles: record.take()?,
            variants: record.take::<[u64; 2]>()?.into_iter().map(|pair| pair.map(|index| index as usize)).collect(),
            uv_sets: (0..n_sets).map(|_| record.take()).collect::<Option<_>>()?,
        })
    };
    let double_sided: Vec<u8> = record.take()?;
    if double_sided.len() != scene.materials.len() {
        return None;
    }
    let mut scene = Scene { meshes: Vec::new(), ..scene.clone() };
    for (material, double_sided) in scene.materials.iter_mut().zip(double_sided) {
        material.double_sided = double_sided != 0;
    }
    let n_meshes: u64 = record.one()?;
    let meshes = (0..n_meshes).map(|_| mesh(&mut record)).collect::<Option<Vec<_>>>()?;
    let is_known = |mesh: &Mesh| {
        let [variants, materials] = [scene.variants.len(), scene.materials.len()];
        mesh.material < materials
            && mesh.variants.iter().all(|&[variant, material]| variant < variants && material < materials)
    };
    if !meshes.iter().all(is_known) {
        return None;
    }
    let light_map_set = (set != u64::MAX).then_some(set as usize);
    let scene = Scene { meshes, light_map_set, ..scene };
    (record.is_done() && is_sound(&scene, &layout, &plan)).then_some((scene, layout, plan))
}

/// Whether it is a layout that can be used: whoever can write into a cache can write other records than a bake does.
fn is_sound(scene: &Scene, layout: &LayoutReport, plan: &ChartPlan) -> bool {
    let sets = [LIGHTMAP_SET, scene.light_map_set.unwrap_or(LIGHTMAP_SET)];
    let is_on_map = |uv: &Vec2| uv.min_element() >= 0.0 && uv.max_element() <= 1.0;
    let is_laid_out = |mesh: &Mesh| {
        mesh.is_sound() && sets.iter().all(|&set| mesh.uv_set(set).is_some_and(|uv| uv.iter().all(is_on_map)))
    };
    (1..=MAX_MAP_SIZE).contains(&layout.size) && plan.is_sound() && scene.meshes.iter().all(is_laid_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cache::CacheOptions, lightmap::unwrap::Fineness, pipeline::bake, plan::MeshPlan, progress::Progress};
    use localprt_scenes::builtin;

    #[test]
    fn a_kept_layout_is_the_same_scene_and_another_scene_or_option_has_another() {
        let folder = tempfile::tempdir().expect("folder");
        let cache = Cache::open(folder.path(), CacheOptions::default()).expect("opens");
        let mut scene = builtin::scene("blinds").expect("a scene");
        // Faces of both sides become two.
        scene.materials[0].double_sided = true;
        let settings = BakeSettings {
            probes: Some(8),
            receivers: 400,
            direct_map: 64,
            gather_rays: 8,
            relight_rays: 64,
            ..BakeSettings::default()
        };
        let laid_out = bake(scene.clone(), &settings, &Progress::silent()).expect("bakes").scene;
        let layout = LayoutReport { reason: Some("none".into()), back_faces: 3, size: 64, charts: 9, kept: false };
        let charts = ChartPlan {
            fineness: Fineness { finest: 0.5, receivers: 11.3, light_map: 1.0 / 3.0 },
            meshes: scene.meshes.iter().map(|mesh| MeshPlan::of(&scene, mesh, vec![false, true])).collect(),
        };
        LayoutCache::of(&cache, &scene, &settings).keep(&laid_out, &layout, &charts);
        let (found, report, plan) = LayoutCache::of(&cache, &scene, &settings).find(&scene).expect("kept");
        assert_eq!(format!("{found:?}"), format!("{laid_out:?}"));
        assert_eq!(format!("{report:?}"), format!("{layout:?}"));
        assert_eq!(plan, charts);

        let is_known =
            |scene: &Scene, settings: &BakeSettings| LayoutCache::of(&cache, scene, settings).find(scene).is_some();
        assert!(is_known(&scene, &BakeSettings { threshold: 0.1, gather_rays: 9, ..settings.clone() }));
        assert!(!is_known(&scene, &BakeSettings { receivers: 401, ..settings.clone() }));
        let mut moved = scene.clone();
        moved.meshes[0].positions[0].x += 1e-3;
        assert!(!is_known(&moved, &settings));
        let mut other = scene.clone();
        other.materials.push(other.materials[0].clone());
        other.meshes[0].material = other.materials.len() - 1;
        assert!(!is_known(&other, &settings), "materials go by their numbers");
        let mut named = scene.clone();
        named.materials[0].name = "another".into();
        assert!(is_known(&named, &settings));
    }
}
