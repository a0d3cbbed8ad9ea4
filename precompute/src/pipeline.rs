//! The bake: the only file that knows the order of the stages. Reads like section 4.1 of the paper.

mod assemble;
mod facts;
mod failures;
mod lay_out;
mod leaf;
mod near_tiles;
mod write;

pub use write::Written;

use crate::{
    budget::{self, Spent},
    clusters::RefineSettings,
    error::BakeError,
    lightmap::{Atlas, ChartPyramid, ReceiverSet, texels, texels::ReceiverMap},
    probes,
    progress::Progress,
    rays::RayCaster,
    relight_rays,
    report::{BakeReport, Bytes, LinkFacts, RelightFacts, VolumeFacts, peak_rss_bytes},
    settings::{BakeSettings, Transport},
    transport::{FitScene, GatherSet, NearField, RayCounts, TransportScene},
    volume::{self, VolumeCells},
    voxels::{self, VoxelGrid},
};
use assemble::{assemble, stored_blocks};
use facts::{atlas_facts, fill_results, placement_facts, scene_facts};
use failures::{placement_error, tree_error};
use glam::Vec3;
use lay_out::{LaidOut, Space, lay_out};
use leaf::{local_transport, stored_members};
use localprt_formats::{BakedArrays, BlockRecord, VolumeArrays, VolumeGrid, check::MAX_VOLUME_CELLS, sh};
use localprt_scenes::{Scene, SurfacePoint};

/// What a bake makes.
#[derive(Debug)]
pub struct BakeOutput {
    /// Content of the baked file, which knows its scene once it is [written](BakeOutput::write).
    pub arrays: BakedArrays,
    /// The scene with its lightmap coordinates as TEXCOORD_1.
    pub scene: Scene,
    /// Whether those coordinates are new, so that the scene has to be written beside the baked file.
    pub unwrapped: bool,
    /// Facts and figures, but for what writing adds.
    pub report: BakeReport,
}

/// Help for options out of range.
const RANGES_HELP: &str = "see `precompute bake --help` for the ranges";

/// Bakes a scene. The same scene and settings give the same bytes on any number of threads.
///
/// # Errors
/// Those of the stages, by who can act; see [`BakeError`].
pub fn bake(scene: Scene, settings: &BakeSettings, progress: &Progress) -> Result<BakeOutput, BakeError> {
    settings.check().map_err(|range| BakeError::Option { what: range.to_string(), remedy: RANGES_HELP.into() })?;
    let source = scene_facts(&scene);
    if scene.face_count() == 0 {
        return Err(BakeError::Scene {
            what: "the scene has no triangles".into(),
            place: None,
            remedy: "export meshes, not only points, lines or cameras".into(),
        });
    }

    // Space: which side of a surface light can reach.
    let bounds = scene.bounds().unwrap_or_default();
    let rho = voxels::spacing(bounds, settings);
    let volume_grid = volume_grid(bounds, settings)?;
    let (space, laid_out) = {
        let caster = RayCaster::new(&scene).map_err(tree_error)?;
        let space = Space::of(&caster, rho, settings, progress)?;
        let laid_out = lay_out(&scene, &caster, &space, settings, progress)?;
        (space, laid_out)
    };
    progress.check()?;

    // Receivers: texels of the lightmap.
    let LaidOut { scene, layout, receivers } = laid_out;
    let caster = RayCaster::new(&scene).map_err(tree_error)?;
    let atlas = Atlas::of(&scene);
    // Of the scene as it is written, with its cut and split faces: baked again from there, it gets the same probes.
    let Space { grid, scale } =
        if layout.kept || space.scale.is_uniform() { space } else { Space::of(&caster, rho, settings, progress)? };
    if receivers.is_empty() {
        return Err(BakeError::Scene {
            what: "no texel of the lightmap is a receiver: every surface lies inside or behind geometry".into(),
            place: None,
            remedy: "check that front faces look into the space to light".into(),
        });
    }

    // Probes, their radius, and who supports whom.
    let (probes, support, placement) = {
        let _stage = progress.stage("probes", 0);
        probes::place(&caster, &grid, rho, &scale, &receivers.position, &receivers.geometric_normal, settings)
            .map_err(placement_error)?
    };
    let volume = match volume_grid {
        Some(volume) => {
            let _stage = progress.stage("volume", 0);
            Some(volume_cells(volume, &grid, &caster)?)
        }
        None => None,
    };
    drop(grid);
    progress.check()?;
    let probe_basis = sh::Basis::new(settings.probe_degree);
    let (rays, direct_texels, light_map) = {
        let _stage = progress.stage("relight rays", 0);
        let mut has_receiver = vec![false; layout.size as usize * layout.size as usize];
        for &texel in &receivers.texel {
            has_receiver[texel as usize] = true;
        }
        let light_map = Atlas::of_light_map(&scene);
        let map = ReceiverMap { atlas: &atlas, size: layout.size, has_receiver: &has_receiver };
        let (direct, _) = texels::cover_visible(&scene, &light_map, settings.direct_map, &map);
        let charts = ChartPyramid::of(&direct);
        let rays =
            relight_rays::trace(&caster, &light_map, &charts, &probes.positions, settings.relight_rays, &probe_basis);
        (rays, direct.texels.len(), (light_map, direct))
    };
    progress.check()?;

    // Local transport: one leaf at a time to finished clusters; no type holds all rows.
    let sky_basis = sh::Basis::new(settings.sky_degree);
    let gather = GatherSet::new(settings.gather_rays, settings.receiver_degree, settings.seed);
    let fit = match settings.transport {
        Transport::Paper => None,
        Transport::Fitted => {
            let _stage = progress.stage("fit", 0);
            Some(FitScene::new(&caster, &atlas, &receivers, &probes, settings.relight_rays, &probe_basis))
        }
    };
    progress.check()?;
    let transport = TransportScene {
        caster: &caster,
        receivers: &receivers,
        probes: &probes,
        support: &support,
        gather: &gather,
        probe_basis: &probe_basis,
        sky_basis: &sky_basis,
        fit: fit.as_ref(),
        near: None,
    };
    let near = settings.near_bytes_in_force().map(|bytes| {
        let _stage = progress.stage("near light", 0);
        let (atlas, map) = &light_map;
        NearField::new(&caster, atlas.clone(), map, &probes, &support).within(bytes, &transport)
    });
    drop(light_map);
    let transport = TransportScene { near: near.as_ref(), ..transport };
    let refining = RefineSettings {
        threshold: f64::from(settings.threshold),
        max_coefficients: settings.coefficients as usize,
        n_sh: probe_basis.len(),
        n_sky: sky_basis.len(),
    };
    let leaves = local_transport(&transport, &refining, settings.leaf, "transport and clusters", progress)?;
    let mut traced = leaves.iter().map(|leaf| leaf.rays).sum::<RayCounts>();
    let volume = match &volume {
        Some(cells) => {
            let gather = GatherSet::sphere(settings.gather_rays, settings.volume_degree, settings.seed);
            let (volume, rays) = volume_transport(
                cells,
                &TransportScene { gather: &gather, near: None, ..transport },
                &refining,
                settings,
                progress,
            )?;
            traced += rays;
            Some(volume)
        }
        None => None,
    };

    let _stage = progress.stage("assemble", 0);
    let mut report = BakeReport {
        scene: source,
        options: settings.clone(),
        rays: traced.gather + traced.visibility + probes.positions.len() as u64 * u64::from(settings.relight_rays),
        atlas: atlas_facts(&layout, &receivers, settings),
        placement: placement_facts(&placement),
        relight: RelightFacts::of(&rays.counts),
        ..BakeReport::default()
    };
    report.gather_rays = traced.gather;
    report.visibility_rays = traced.visibility;
    fill_results(&mut report, &receivers, &probes, &support, &leaves);
    let mut unseen = vec![0.0; receivers.len()];
    for leaf in &leaves {
        leaf.members.iter().zip(&leaf.unseen).for_each(|(&member, &share)| unseen[member as usize] = share);
    }
    let spent = Spent {
        caster: &caster,
        atlas: &atlas,
        receivers: &receivers,
        probes: &probes,
        unseen: &unseen,
        direct_texels,
    };
    report.budget = spent.facts(settings.receivers);
    budget::warnings(&report.budget.views).iter().for_each(|warning| progress.warn(warning));
    let mut arrays = assemble(&scene, settings, &layout, &receivers, &probes, rays, &leaves);
    let counts = leaves.iter().flat_map(|leaf| leaf.block.near.counts.iter().copied());
    report.links = LinkFacts::of(counts, receivers.len());
    let pairs = |count: fn(&BlockRecord) -> u32| 4 * arrays.blocks.view().total(count);
    report.bytes = Bytes {
        projection: pairs(|block| block.projection_pairs),
        reconstruction: pairs(|block| block.reconstruction_pairs),
        relight: (16 * arrays.ray_dirs.len()
            + 4 * arrays.ray_sh.len()
            + 4 * arrays.ray_uv.len()
            + arrays.ray_level.len()
            + 2 * arrays.ray_distance.len()) as u64,
        near_light: arrays.blocks.view().near_byte_count(gather.n_outputs()),
        file: 0,
    };
    arrays.volume = volume;
    report.volume = arrays.view().volume.map(|volume| VolumeFacts::of(&volume));
    drop(_stage);
    report.warnings = progress.warnings();
    arrays.report = report.to_embedded_json();
    report.stages = progress.stages();
    report.seconds = progress.seconds();
    report.peak_rss_bytes = peak_rss_bytes().unwrap_or(0);
    report.threads = rayon::current_num_threads() as u64;
    if let Some(allowed) = settings.max_unseen.filter(|&allowed| report.unseen.mean > f64::from(allowed)) {
        return Err(BakeError::Quality {
            measure: "mean unseen share",
            measured: report.unseen.mean,
            allowed: f64::from(allowed),
            remedy: "use more probes, a larger overlap or a larger repair share".into(),
        });
    }
    Ok(BakeOutput { arrays, unwrapped: !layout.kept, scene, report })
}

/// Grid of the volume that the settings ask for.
fn volume_grid(bounds: (Vec3, Vec3), settings: &BakeSettings) -> Result<Option<VolumeGrid>, BakeError> {
    let Some(spacing_m) = settings.volume else { return Ok(None) };
    let grid = volume::grid(bounds, spacing_m, settings.volume_degree).map_err(|error| BakeError::Limit {
        what: format!("a volume of {spacing_m} m spacing over the scene box"),
        needed: error.to_string(),
        allowed: format!("{MAX_VOLUME_CELLS} cells"),
        remedy: "use a larger --volume spacing".into(),
    })?;
    Ok(Some(grid))
}

/// Its cells in the open.
fn volume_cells(grid: VolumeGrid, voxels: &VoxelGrid, caster: &RayCaster<'_>) -> Result<VolumeCells, BakeError> {
    let cells = volume::cells(grid, voxels, caster);
    if cells.cells.is_empty() {
        return Err(BakeError::Option {
            what: format!("none of the {} cells of the volume is in the open", grid.n_cells()),
            remedy: "use a smaller --volume spacing, or leave the volume out".into(),
        });
    }
    Ok(cells)
}

/// The volume as stored, by the same way as the lightmap: support, rows, clusters. `lightmap` gives what both share.
fn volume_transport(
    cells: &VolumeCells,
    lightmap: &TransportScene<'_>,
    refining: &RefineSettings,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<(VolumeArrays, RayCounts), BakeError> {
    let sees = |receiver: usize, probe: Vec3| lightmap.caster.visible(cells.positions[receiver], probe);
    let (_, support, _) =
        probes::support(&cells.positions, &lightmap.probes.positions, &sees, settings).map_err(placement_error)?;
    let in_the_open = |&position: &Vec3| SurfacePoint { position, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO };
    let receivers = ReceiverSet::of_points(&cells.positions.iter().map(in_the_open).collect::<Vec<_>>());
    let transport = TransportScene { receivers: &receivers, support: &support, ..*lightmap };
    // As many rows to a leaf as in a lightmap of irradiance: cells lie far apart, so a leaf has many probes, and memory
    // grows with their product.
    let leaf = (settings.leaf / cells.grid.n_k() as u32).max(2);
    let leaves = local_transport(&transport, refining, leaf, "volume transport", progress)?;
    let cell = |member: u32| cells.cells[member as usize];
    let volume = VolumeArrays {
        grid: cells.grid,
        cells: stored_members(&leaves).into_iter().map(cell).collect(),
        blocks: stored_blocks(&leaves, |member| cells.grid.position(cell(member) as usize)),
        fill: cells.fill.clone(),
    };
    Ok((volume, leaves.iter().map(|leaf| leaf.rays).sum()))
}
