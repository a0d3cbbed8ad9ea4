//! A layout that keeps to the plan of an earlier bake: meshes that are what they were keep their charts, others get new ones beside
//! them, as fine as those.

use super::{
    failures::{tree_error, unwrap_error},
    lay_out::{LaidOut, Space, place_receivers, texel_edge},
};
use crate::{
    error::BakeError,
    lightmap::{
        Atlas, LayoutReport, cut, hidden,
        sides::{self, Sides},
        unwrap::{self, Beside, Fineness, UnwrapError, Wanted, on_another_map},
    },
    plan::{ChartPlan, Laid, MeshPlan, Previous},
    progress::Progress,
    rays::RayCaster,
    scale::{self, Seen},
    settings::BakeSettings,
};
use localprt_scenes::{Mesh, Scene};
use localprt_surfaces::atlas::LIGHTMAP_SET;

/// The layout; `None` where the earlier one has no charts that can be kept, or no room for others.
pub(super) fn keep_layout(
    scene: &Scene,
    space: &Space,
    previous: &Previous,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<Option<LaidOut>, BakeError> {
    let (Some(laid), Some(charts)) = (previous.laid(scene), &previous.plan.charts) else { return Ok(None) };
    let (fineness, set) = (charts.fineness, previous.light_map_set());
    let n_kept = laid.iter().filter(|laid| matches!(laid, Laid::Kept(..))).count();
    // The set of the light map may be one that a new mesh has for its textures.
    let is_taken = |(mesh, laid): (&Mesh, &Laid)| {
        matches!(laid, Laid::New) && scene.light_map_set != set && set.is_some_and(|set| mesh.uv_set(set).is_some())
    };
    if n_kept == 0 || scene.meshes.iter().zip(&laid).any(is_taken) {
        return Ok(None);
    }

    // What is kept has its sides already; each new mesh gets them.
    let stage = progress.stage("unwrap", 0);
    let mut combined = Scene { meshes: Vec::new(), light_map_set: set, ..scene.clone() };
    let mut is_kept = Vec::new();
    for (mesh, laid) in scene.meshes.iter().zip(&laid) {
        match laid {
            Laid::Kept(parts, _) => combined.meshes.extend_from_slice(parts),
            Laid::New => combined.meshes.push(mesh.clone()),
        }
        is_kept.resize(combined.meshes.len(), matches!(laid, Laid::Kept(..)));
    }
    let caster = RayCaster::new(&combined).map_err(tree_error)?;
    let is_live = |_: &Scene, mesh: usize, triangle, front| match is_kept[mesh] {
        true => front,
        false => sides::is_live(&caster, &space.grid, mesh, triangle, front),
    };
    let Sides { scene: split, parts, back_faces } = sides::split(combined.clone(), &is_live);
    drop(stage);
    let is_kept: Vec<bool> =
        is_kept.iter().zip(&parts).flat_map(|(is_kept, parts)| parts.iter().map(move |_| *is_kept)).collect();
    let mut parts = parts.into_iter();
    let mut plan_of = |(mesh, laid): (&Mesh, &Laid)| {
        let of_mesh = match laid {
            Laid::Kept(meshes, backs) => {
                parts.by_ref().take(meshes.len()).for_each(drop);
                backs.clone()
            }
            Laid::New => parts.next().unwrap_or_default(),
        };
        MeshPlan::of(scene, mesh, of_mesh)
    };
    let plan = ChartPlan { fineness, meshes: scene.meshes.iter().zip(&laid).map(&mut plan_of).collect() };

    let (split, size) = if is_kept.contains(&false) {
        match lay_out_others(split, &is_kept, space, previous, fineness, settings, progress) {
            Ok(laid_out) => laid_out,
            Err(Refusal::NoRoom) => return Ok(None),
            Err(Refusal::Failed(error)) => return Err(error),
        }
    } else {
        (split, previous.size())
    };
    let atlas = Atlas::of(&split);
    let receivers = place_receivers(&split, &atlas, size, progress)?;
    let (kept, all) = (n_kept, scene.meshes.len());
    progress.note(&format!(
        "layout of {}: {kept} of {all} meshes have the charts that they had{}",
        previous.path.display(),
        if size == previous.size() { "" } else { "; the map has grown" }
    ));
    let layout = LayoutReport {
        kept: false,
        reason: Some(format!("{kept} of {all} meshes have the charts that they had")),
        back_faces,
        size,
        charts: atlas.n_charts,
    };
    Ok(Some(LaidOut { scene: split, layout, receivers, charts: Some(plan), is_kept: true }))
}

enum Refusal {
    NoRoom,
    Failed(BakeError),
}

impl From<UnwrapError> for Refusal {
    fn from(error: UnwrapError) -> Self {
        match error {
            UnwrapError::TooManyCharts { .. } => Self::NoRoom,
            error => Self::Failed(unwrap_error(error)),
        }
    }
}

/// Charts for the meshes that are not kept, and the size of the receiver map.
fn lay_out_others(
    split: Scene,
    is_kept: &[bool],
    Space { grid, scale, .. }: &Space,
    previous: &Previous,
    fineness: Fineness,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<(Scene, u32), Refusal> {
    let watch = |_: &str, _: usize, _: usize| !progress.is_cancelled();
    let stage = progress.stage("unwrap", 0);
    let caster = RayCaster::new(&split).map_err(|error| Refusal::Failed(tree_error(error)))?;
    let mut cut_scene = split.clone();
    cut::by_scale(&mut cut_scene, scale);
    // What is kept is cut already, as it was.
    let restore = |cut_scene: &mut Scene| {
        for ((mesh, kept), is_kept) in cut_scene.meshes.iter_mut().zip(&split.meshes).zip(is_kept) {
            if *is_kept {
                mesh.clone_from(kept);
            }
        }
    };
    restore(&mut cut_scene);
    let edge_m = texel_edge(scale, &cut_scene, settings);
    let walls = cut::by_surfaces(&mut cut_scene, &caster, &edge_m);
    restore(&mut cut_scene);
    let is_new: Vec<bool> = is_kept.iter().map(|is_kept| !is_kept).collect();
    let walls = walls.of_meshes(&is_new);
    let (seen, hidden) = match scale.is_uniform() {
        true => (Seen::default(), Vec::new()),
        false => {
            let caster = RayCaster::new(&cut_scene).map_err(|error| Refusal::Failed(tree_error(error)))?;
            let seen = scale::importance(scale, grid, &caster);
            let hidden = hidden::faces(&caster, grid, &seen, &edge_m);
            let of_new: Vec<bool> = cut_scene.faces().map(|(mesh, _)| is_new[mesh]).collect();
            let hits = seen.hits.iter().zip(&of_new).filter_map(|(hits, is_new)| is_new.then_some(*hits)).collect();
            let hidden = hidden.into_iter().zip(&of_new).filter_map(|(hidden, is_new)| is_new.then_some(hidden));
            (Seen { hits, ..seen }, hidden.collect())
        }
    };
    let (kept, new): (Vec<Mesh>, Vec<Mesh>) = {
        let (kept, new): (Vec<_>, Vec<_>) =
            std::mem::take(&mut cut_scene.meshes).into_iter().zip(is_kept).partition(|(_, is_kept)| **is_kept);
        let meshes = |pairs: Vec<(Mesh, &bool)>| pairs.into_iter().map(|(mesh, _)| mesh).collect();
        (meshes(kept), meshes(new))
    };
    let mut new = Scene { meshes: new, ..cut_scene };
    let backend = unwrap::backend(settings.unwrap)?;
    let wanted =
        Wanted { scale, seen: &seen, hidden: &hidden, walls: &walls, texel_m: &edge_m, finest: Some(fineness.finest) };
    let charts = unwrap::charts(&new, wanted, backend.as_ref(), &watch)?;
    drop(stage);

    let beside = |set, size, density: f32, may_grow| Beside {
        others: &kept,
        set,
        size,
        density: f64::from(density),
        finest_m: settings.texel.filter(|_| may_grow),
        may_grow,
    };
    if let Some(set) = previous.light_map_set() {
        let _stage = progress.stage("light map", 0);
        let beside = beside(set, settings.direct_map, fineness.light_map, false);
        new = charts.lay_out_beside(new, &caster, beside, &watch)?.0;
    }
    let _stage = progress.stage("layout", 0);
    let may_grow = settings.lightmap.is_none();
    let beside = beside(LIGHTMAP_SET, previous.size(), fineness.receivers, may_grow);
    let (new, size) = charts.lay_out_beside(new, &caster, beside, &watch)?;

    let (mut kept, mut new) = (kept.into_iter(), new.meshes.into_iter());
    let mesh = |is_kept: &bool| match is_kept {
        true => kept.next().map(|mesh| on_another_map(mesh, LIGHTMAP_SET, [previous.size(), size])),
        false => new.next(),
    };
    let meshes = is_kept.iter().filter_map(mesh).collect();
    Ok((Scene { meshes, ..split }, size))
}

#[cfg(test)]
mod tests {
    use super::super::{BakeOutput, Reuse, bake, bake_with};
    use super::*;
    use crate::settings::Density;
    use glam::{Vec2, Vec3};
    use localprt_scenes::builtin;
    use std::{collections::HashSet, path::Path};

    fn small() -> BakeSettings {
        BakeSettings {
            probes: Some(16),
            receivers: 1200,
            direct_map: 128,
            gather_rays: 16,
            relight_rays: 64,
            leaf: 128,
            ..BakeSettings::default()
        }
    }

    fn plain(scene: &Scene, settings: &BakeSettings) -> BakeOutput {
        bake(scene.clone(), settings, &Progress::silent()).expect("bakes")
    }

    fn keeping(scene: &Scene, settings: &BakeSettings, previous: &Previous) -> BakeOutput {
        let reuse = Reuse { previous: Some(previous), ..Reuse::default() };
        bake_with(scene.clone(), settings, reuse, &Progress::silent()).expect("bakes")
    }

    /// The bake of a scene as an earlier one.
    fn written(scene: &Scene, settings: &BakeSettings, folder: &Path) -> (Previous, BakeOutput) {
        let path = folder.join("a.lprt");
        let progress = Progress::silent();
        let output = plain(scene, settings);
        output.write(&path, &path.with_extension("glb"), None, &progress).expect("writes");
        (Previous::open(&path).expect("has a plan"), plain(scene, settings))
    }

    /// Cornell's back wall, so much smaller and so far in front of where it is.
    fn panel(scene: &Scene, zoom: f32, ahead_m: f32) -> Mesh {
        let mut panel = scene.meshes.iter().find(|mesh| mesh.name == "back wall").expect("a wall").clone();
        let middle = panel.positions.iter().sum::<Vec3>() / panel.positions.len() as f32;
        panel.positions.iter_mut().for_each(|at| *at = middle + zoom * (*at - middle) + ahead_m * Vec3::Z);
        panel.name = "panel".into();
        panel
    }

    #[test]
    fn a_map_without_room_grows_and_receivers_of_others_stay_to_the_bit() {
        let folder = tempfile::tempdir().expect("folder");
        let mut scene = builtin::scene("cornell").expect("a scene");
        // Backs of faces with one side are seen as the inside of things.
        scene.materials.iter_mut().for_each(|material| material.double_sided = true);
        let settings = BakeSettings { density: Density::Uniform, ..small() };
        let (previous, first) = written(&scene, &settings, folder.path());
        let mut edited = scene.clone();
        edited.meshes.extend((0..8).map(|place| panel(&scene, 0.9, 0.2 + 0.1 * place as f32)));
        let second = keeping(&edited, &settings, &previous);
        let [before, now] = [&first, &second].map(|bake| bake.arrays.metadata.lightmap_size);
        assert!(now > before, "{before} and {now} texels");
        let there: HashSet<_> = second.arrays.receiver_position.iter().map(|at| at.map(f32::to_bits)).collect();
        // Beside the panels some are moved out of their way, as in any bake.
        let mut away = first.arrays.receiver_position.iter().filter(|at| at[2] > 0.2).peekable();
        assert!(away.peek().is_some() && away.all(|at| there.contains(&at.map(f32::to_bits))));
        let [before, now] = [&first, &second].map(|bake| bake.arrays.receiver_position.len());
        assert!(2 * now > 3 * before, "{before} and {now} receivers");
    }

    #[test]
    fn the_plan_of_another_scene_is_of_no_use() {
        let folder = tempfile::tempdir().expect("folder");
        let (previous, _) = written(&builtin::scene("cornell").expect("a scene"), &small(), folder.path());
        let other = builtin::scene("two-rooms").expect("a scene");
        assert!(keeping(&other, &small(), &previous).arrays == plain(&other, &small()).arrays);
    }

    #[test]
    fn coordinates_of_a_new_mesh_for_its_textures_are_not_those_of_the_light_map() {
        let folder = tempfile::tempdir().expect("folder");
        let scene = builtin::scene("cornell").expect("a scene");
        let (previous, first) = written(&scene, &small(), folder.path());
        let set = first.scene.light_map_set.expect("a light map");
        let mut edited = scene.clone();
        let mut panel = panel(&scene, 0.3, 0.2);
        panel.uv_sets.resize(set + 1, vec![Vec2::new(0.25, 0.75); panel.positions.len()]);
        edited.meshes.push(panel);
        let found = keeping(&edited, &small(), &previous).scene;
        let panel = found.meshes.iter().find(|mesh| mesh.name == "panel").expect("is there");
        assert!(panel.uv_set(set).expect("coordinates").iter().all(|uv| *uv == Vec2::new(0.25, 0.75)));
        assert_ne!(found.light_map_set, Some(set));
    }

    #[test]
    fn a_scene_that_brings_its_layout_keeps_its_probes() {
        let folder = tempfile::tempdir().expect("folder");
        let settings = BakeSettings { density: Density::Uniform, ..small() };
        let laid_out = plain(&builtin::scene("cornell").expect("a scene"), &settings).scene;
        let path = folder.path().join("own.lprt");
        let own = plain(&laid_out, &settings);
        assert!(!own.unwrapped);
        let (probes, progress) = (own.arrays.probes.clone(), Progress::silent());
        let scene_file = path.with_extension("glb");
        localprt_scenes::export_glb(&laid_out, &scene_file).expect("writes");
        own.write(&path, &path.with_extension("other.glb"), Some(&scene_file), &progress).expect("writes");
        let previous = Previous::open(&path).expect("has a plan");
        let mut edited = laid_out.clone();
        let tall = edited.meshes.iter_mut().find(|mesh| mesh.name.starts_with("tall block")).expect("a box");
        tall.positions.iter_mut().for_each(|at| at.x += 0.05);
        let [kept, anew] = [keeping(&edited, &settings, &previous), plain(&edited, &settings)];
        assert!(!kept.unwrapped && kept.arrays.probes == probes && anew.arrays.probes != probes);
    }
}
