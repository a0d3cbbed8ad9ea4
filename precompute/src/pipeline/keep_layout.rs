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
        unwrap::{self, Beside, UnwrapError, Wanted, on_another_map},
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
    let Some(laid) = previous.laid(scene) else { return Ok(None) };
    // The set of the light map may be one that a new mesh has for its textures.
    let is_taken = |(mesh, laid): (&Mesh, &Laid)| {
        matches!(laid, Laid::New) && previous.light_map_set().is_some_and(|set| mesh.uv_set(set).is_some())
    };
    if scene.light_map_set != previous.light_map_set() && scene.meshes.iter().zip(&laid).any(is_taken) {
        return Ok(None);
    }
    let Some(fineness) = previous.plan.charts.as_ref().map(|charts| charts.fineness) else { return Ok(None) };
    let stage = progress.stage("unwrap", 0);
    let n_kept = laid.iter().filter(|laid| matches!(laid, Laid::Kept(_))).count();
    if n_kept == 0 {
        return Ok(None);
    }

    // Each mesh of the scene becomes one or more, of which those that are kept are whole.
    let mut combined = Scene { meshes: Vec::new(), light_map_set: previous.light_map_set(), ..scene.clone() };
    let mut is_kept = Vec::new();
    let mut of_mesh = Vec::new();
    for (mesh, laid) in scene.meshes.iter().zip(laid) {
        let (parts, kept) = match laid {
            Laid::Kept(parts) => (parts, true),
            Laid::New => (vec![mesh.clone()], false),
        };
        of_mesh.push(parts.len());
        is_kept.extend(parts.iter().map(|_| kept));
        combined.meshes.extend(parts);
    }
    let parts_caster = RayCaster::new(&combined).map_err(tree_error)?;
    let Sides { scene: split, parts, back_faces } = sides::split(combined.clone(), &|_, mesh, triangle, front| {
        if is_kept[mesh] { front } else { sides::is_live(&parts_caster, &space.grid, mesh, triangle, front) }
    });
    drop(parts_caster);
    let is_kept: Vec<bool> =
        is_kept.iter().zip(&parts).flat_map(|(kept, parts)| (0..*parts).map(move |_| *kept)).collect();
    let mut parts = parts.into_iter();
    let plans = |scene: &Scene| {
        let of = |(mesh, count): (&Mesh, usize)| MeshPlan::of(scene, mesh, parts.by_ref().take(count).sum());
        scene.meshes.iter().zip(of_mesh).map(of).collect::<Vec<_>>()
    };
    let plan = ChartPlan { fineness, meshes: plans(scene) };
    drop(stage);

    let (split, size) = if is_kept.contains(&false) {
        match lay_out_others(split, &is_kept, space, previous, settings, progress) {
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
    let new = Scene { meshes: new, ..cut_scene.clone() };
    let fineness = previous.plan.charts.as_ref().map(|charts| charts.fineness).ok_or(Refusal::NoRoom)?;
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
    let mut new = new;
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
