//! The bake: the only file that knows the order of the stages. Reads like section 4.1 of the paper.

use crate::{
    budget::{self, Spent},
    clusters::{Cluster, RefineSettings, leaves, refine},
    error::BakeError,
    lightmap::{
        Atlas, LayoutReport, ReceiverSet, cut, receivers, sides, texels,
        unwrap::{self, LayoutSize, UnwrapError, Wanted},
    },
    probes::{self, PlacementReport, ProbeSet, Support},
    progress::{Cancelled, Progress},
    rays::{RayCaster, TreeError},
    relight_rays::{self, RelightRays},
    report::{
        AtlasFacts, BakeReport, BudgetFacts, Bytes, Compression, Overlap, PlacementFacts, RelightFacts, SceneFacts,
        Unseen, VolumeFacts, hex, peak_rss_bytes,
    },
    scale::{self, Focus, LocalScale},
    settings::{BakeSettings, Density, Transport},
    transport::{FitScene, GatherSet, RayCounts, TransportScene},
    volume::{self, VolumeCells},
    voxels::{self, VoxelGrid},
};
use glam::Vec3;
use half::f16;
use localprt_formats::{
    BakedArrays, ClusterRecord, Metadata, Probe, VolumeArrays, VolumeGrid, check::MAX_VOLUME_CELLS, sh,
};
use localprt_scenes::Scene;
use rayon::prelude::*;
use std::time::Instant;

/// What a bake makes.
#[derive(Debug)]
pub struct BakeOutput {
    /// Content of the baked file; `scene_path` and `scene_hash` are the caller's to fill in, as it knows where the scene
    /// with the lightmap coordinates goes.
    pub arrays: BakedArrays,
    /// The scene with its lightmap coordinates as TEXCOORD_1.
    pub scene: Scene,
    /// Whether those coordinates are new, so that the scene has to be written beside the baked file.
    pub unwrapped: bool,
    /// Facts and figures; `bytes.file` is the caller's to fill in.
    pub report: BakeReport,
}

/// Samples of the local scale: one for so many receivers.
const RECEIVERS_PER_SAMPLE: usize = 4;
const LEAST_SAMPLES: usize = 4000;
/// Layouts that are made to meet the number of receivers, at most.
const LAYOUTS: usize = 4;
/// Share by which it may be missed.
const BUDGET_MISSED: f64 = 0.02;
/// Texels for a receiver, at most, where most of the surface is inside of geometry.
const MOST_EXTRA: f64 = 8.0;

/// Help for options out of range.
const RANGES_HELP: &str = "see `precompute bake --help` for the ranges";

/// Bakes a scene. The same scene and settings give the same bytes on any number of threads.
///
/// # Errors
/// Those of the stages, by who can act; see [`BakeError`].
pub fn bake(scene: Scene, settings: &BakeSettings, progress: &Progress) -> Result<BakeOutput, BakeError> {
    let started = Instant::now();
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
    let rays = {
        let _stage = progress.stage("relight rays", 0);
        let mut has_receiver = vec![false; layout.size as usize * layout.size as usize];
        for &texel in &receivers.texel {
            has_receiver[texel as usize] = true;
        }
        let direct = texels::cover_visible(&scene, &atlas, settings.direct_map, layout.size, &has_receiver);
        relight_rays::trace(&caster, &atlas, &direct, &probes.positions, settings.relight_rays, &probe_basis)
    };
    progress.check()?;

    let texels_per_receiver = rays.counts.texels as f64 / receivers.len() as f64;

    // Local transport: one leaf at a time to finished clusters; no type holds all rows.
    let sky_basis = sh::Basis::new(settings.sky_degree);
    let gather = GatherSet::new(settings.gather_rays, settings.receiver_degree, settings.seed);
    let fit = match settings.transport {
        Transport::Paper => None,
        Transport::Fitted => {
            let _stage = progress.stage("fit", 0);
            Some(FitScene::new(&caster, &atlas, &receivers, &probes, &support, settings.relight_rays, &probe_basis))
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
    };
    let refining = RefineSettings {
        threshold: f64::from(settings.threshold),
        max_coefficients: settings.coefficients as usize,
        n_sh: probe_basis.len(),
        n_sky: sky_basis.len(),
    };
    let (clusters, mut traced) =
        local_transport(&transport, &refining, settings.leaf, "transport and clusters", progress)?;
    let volume = match &volume {
        Some(cells) => {
            let gather = GatherSet::sphere(settings.gather_rays, settings.volume_degree, settings.seed);
            let (volume, rays) = volume_transport(
                cells,
                &TransportScene { gather: &gather, ..transport },
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
    fill_results(&mut report, &receivers, &probes, &support, &clusters);
    let mut unseen = vec![0.0; receivers.len()];
    for cluster in &clusters {
        cluster.members.iter().zip(&cluster.unseen).for_each(|(&member, &share)| unseen[member as usize] = share);
    }
    let spent = Spent { caster: &caster, atlas: &atlas, receivers: &receivers, probes: &probes, unseen: &unseen };
    report.budget = BudgetFacts {
        receivers_asked: settings.receivers,
        texel: spent.texels(),
        map_used: report.atlas.map_used,
        texels_per_receiver,
        views: spent.views(),
    };
    budget::warnings(&report.budget.views).iter().for_each(|warning| progress.warn(warning));
    let mut arrays = assemble(&scene, settings, &layout, &receivers, &probes, rays, clusters)?;
    arrays.volume = volume;
    report.volume = arrays.view().volume.map(|volume| VolumeFacts::of(&volume));
    report.bytes = Bytes {
        projection: 2 * arrays.projection.len() as u64,
        reconstruction: 2 * arrays.reconstruction.len() as u64,
        relight: (16 * arrays.ray_dirs.len()
            + 4 * arrays.ray_sh.len()
            + 4 * arrays.ray_uv.len()
            + arrays.ray_level.len()
            + 2 * arrays.ray_distance.len()) as u64,
        file: 0,
    };
    drop(_stage);
    report.warnings = progress.warnings();
    arrays.report = report.to_embedded_json();
    report.stages = progress.stages();
    report.seconds = started.elapsed().as_secs_f64();
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

/// What is known of the space around the surfaces.
struct Space {
    grid: VoxelGrid,
    scale: LocalScale,
}

impl Space {
    fn of(caster: &RayCaster<'_>, rho: f32, settings: &BakeSettings, progress: &Progress) -> Result<Self, BakeError> {
        let scene = caster.scene();
        let mut scale = {
            let _stage = progress.stage("local scale", 0);
            local_scale(caster, settings)
        };
        progress.check()?;
        let _stage = progress.stage("voxelize", 0);
        let grid = VoxelGrid::build(scene, caster, rho, &scale, settings).map_err(voxel_error)?;
        if !scale.is_uniform() {
            let hits = scale::importance(&scale, &grid, caster);
            scale.look(scene, &hits);
        }
        progress.check()?;
        Ok(Self { grid, scale })
    }
}

/// R of a scene, as the settings ask for it.
fn local_scale(caster: &RayCaster<'_>, settings: &BakeSettings) -> LocalScale {
    if settings.density == Density::Uniform {
        return LocalScale::uniform();
    }
    let most = (settings.receivers as usize / RECEIVERS_PER_SAMPLE).max(LEAST_SAMPLES);
    let focus = settings.focus.iter().map(|&[x, y, z, radius_m]| Focus { center: Vec3::new(x, y, z), radius_m });
    LocalScale::of(scale::measure(caster, most), caster.scene().extent(), focus.collect())
}

/// A scene with its layout, and the receivers on it.
struct LaidOut {
    scene: Scene,
    layout: LayoutReport,
    receivers: ReceiverSet,
}

/// The scene with lightmap coordinates and as many receivers as were asked for: its own coordinates if usable, else unwrapped,
/// with a face for each live side and large faces cut where they need very different densities.
fn lay_out(
    scene: &Scene,
    caster: &RayCaster<'_>,
    Space { grid, scale }: &Space,
    settings: &BakeSettings,
    progress: &Progress,
) -> Result<LaidOut, BakeError> {
    let stage = progress.stage("unwrap", 0);
    let mut size = LayoutSize { texels: settings.receivers, lightmap: settings.lightmap, finest_m: settings.texel };
    let watch = |_: &str, _: usize, _: usize| !progress.is_cancelled();
    let reason = match unwrap::usable_layout(scene, size).map_err(unwrap_error)? {
        Ok(texels) => {
            drop(stage);
            let _stage = progress.stage("receivers", 0);
            let atlas = Atlas::of(scene);
            let receivers = receivers::place(scene, &atlas, caster, texels, &watch).ok_or(Cancelled)?;
            let layout = LayoutReport { kept: true, size: texels, charts: atlas.n_charts, ..LayoutReport::default() };
            return Ok(LaidOut { scene: scene.clone(), layout, receivers });
        }
        Err(reason) => reason,
    };
    let (mut split, back_faces) =
        sides::split(scene.clone(), &|_, mesh, triangle, front| sides::is_live(caster, grid, mesh, triangle, front));
    cut::by_scale(&mut split, scale);
    let hits = match scale.is_uniform() {
        true => Vec::new(),
        false => scale::importance(scale, grid, &RayCaster::new(&split).map_err(tree_error)?),
    };
    let backend = unwrap::backend(settings.unwrap).map_err(unwrap_error)?;
    let wanted = Wanted { scale, hits: &hits };
    let charts = unwrap::charts(&split, wanted, backend.as_ref(), &watch).map_err(unwrap_error)?;
    drop(stage);
    let mut best: Option<(f64, LaidOut)> = None;
    for _ in 0..LAYOUTS {
        let stage = progress.stage("layout", 0);
        let (scene, texels) = charts.lay_out(split.clone(), caster, size, &watch).map_err(unwrap_error)?;
        drop(stage);
        let _stage = progress.stage("receivers", 0);
        let atlas = Atlas::of(&scene);
        let receivers = {
            let caster = RayCaster::new(&scene).map_err(tree_error)?;
            receivers::place(&scene, &atlas, &caster, texels, &watch).ok_or(Cancelled)?
        };
        let found = receivers.len();
        let miss = (found as f64 / f64::from(settings.receivers) - 1.0).abs();
        let layout = LayoutReport {
            kept: false,
            reason: Some(reason.clone()),
            back_faces,
            size: texels,
            charts: atlas.n_charts,
        };
        if best.as_ref().is_none_or(|best| miss < best.0) {
            best = Some((miss, LaidOut { scene, layout, receivers }));
        }
        // Texels inside of geometry and in the holes of masks hold none: as many more are needed. A map or a texel that is given
        // may not allow them.
        let wanted = f64::from(size.texels) * f64::from(settings.receivers) / found.max(1) as f64;
        let is_free = settings.lightmap.is_none() && settings.texel.is_none();
        if miss < BUDGET_MISSED || found == 0 || !is_free {
            break;
        }
        size.texels = wanted.min(MOST_EXTRA * f64::from(settings.receivers)) as u32;
    }
    best.map(|best| best.1).ok_or_else(|| BakeError::Internal { what: "no layout was made".into() })
}

/// Clusters of all receivers in leaf order, and the rays they cost. The rows of a leaf are made, compressed and dropped.
fn local_transport(
    transport: &TransportScene<'_>,
    refining: &RefineSettings,
    leaf: u32,
    stage: &str,
    progress: &Progress,
) -> Result<(Vec<Cluster>, RayCounts), BakeError> {
    let positions = &transport.receivers.position;
    let stage = progress.stage(stage, positions.len() as u64);
    let results: Vec<(Vec<Cluster>, RayCounts)> = leaves(positions, leaf as usize)
        .par_iter()
        .map(|members| {
            progress.check()?;
            let rows = transport.rows(&transport.leaf(members), members);
            let rays = rows.rays;
            let clusters = refine(members, positions, rows, refining);
            stage.inc(members.len() as u64);
            Ok((clusters, rays))
        })
        .collect::<Result<_, BakeError>>()?;
    let mut traced = RayCounts::default();
    results.iter().for_each(|(_, rays)| traced += *rays);
    Ok((results.into_iter().flat_map(|(clusters, _)| clusters).collect(), traced))
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
    let support = probes::link_points(&cells.positions, lightmap.probes, &sees, settings).map_err(placement_error)?;
    let receivers = ReceiverSet { position: cells.positions.clone(), ..ReceiverSet::default() };
    let transport = TransportScene { receivers: &receivers, support: &support, ..*lightmap };
    // As many rows to a leaf as in a lightmap of irradiance: cells lie far apart, so a leaf has many probes, and memory
    // grows with their product.
    let leaf = (settings.leaf / cells.grid.n_k() as u32).max(2);
    let (clusters, rays) = local_transport(&transport, refining, leaf, "volume transport", progress)?;
    let packed = Packed::of(clusters, "the matrices of the volume", "a larger --volume spacing")?;
    let volume = VolumeArrays {
        grid: cells.grid,
        cells: packed.members.iter().map(|&member| cells.cells[member as usize]).collect(),
        clusters: packed.clusters,
        cluster_probes: packed.cluster_probes,
        projection: packed.projection,
        reconstruction: packed.reconstruction,
        fill: cells.fill.clone(),
    };
    Ok((volume, rays))
}

/// Clusters as stored.
#[derive(Default)]
struct Packed {
    clusters: Vec<ClusterRecord>,
    cluster_probes: Vec<u32>,
    projection: Vec<f16>,
    reconstruction: Vec<f16>,
    /// Receivers in stored order.
    members: Vec<u32>,
    /// Unseen share of each.
    unseen: Vec<f32>,
}

impl Packed {
    /// # Errors
    /// More values than 32-bit offsets reach; `what` they are, and `remedy` beside a lower degree or a larger threshold.
    fn of(clusters: Vec<Cluster>, what: &str, remedy: &str) -> Result<Self, BakeError> {
        let values: usize =
            clusters.iter().map(|cluster| cluster.rows.projection.len() + cluster.rows.reconstruction.len()).sum();
        if u32::try_from(values / 2 + 2 * clusters.len()).is_err() {
            return Err(BakeError::Limit {
                what: what.into(),
                needed: format!("{} GB", values / 500_000_000),
                allowed: "17 GB".into(),
                remedy: format!("use {remedy}, a lower degree or a larger --threshold"),
            });
        }
        let mut packed = Self::default();
        let mut first_light = 0;
        for cluster in clusters {
            packed.clusters.push(ClusterRecord {
                first_receiver: packed.members.len() as u32,
                n_receivers: cluster.members.len() as u32,
                first_probe: packed.cluster_probes.len() as u32,
                n_probes: cluster.probes.len() as u32,
                n_sky: cluster.n_sky as u32,
                n_coefficients: cluster.rows.n_coefficients as u32,
                first_light,
                projection_pair: (packed.projection.len() / 2) as u32,
                reconstruction_pair: (packed.reconstruction.len() / 2) as u32,
                reserved: 0,
            });
            first_light += cluster.rows.n_coefficients as u32;
            packed.cluster_probes.extend_from_slice(&cluster.probes);
            extend_even(&mut packed.projection, &cluster.rows.projection);
            extend_even(&mut packed.reconstruction, &cluster.rows.reconstruction);
            packed.members.extend_from_slice(&cluster.members);
            packed.unseen.extend_from_slice(&cluster.unseen);
        }
        Ok(packed)
    }
}

/// Arrays of the file: receivers in cluster order.
///
/// # Errors
/// More values than 32-bit offsets reach.
fn assemble(
    scene: &Scene,
    settings: &BakeSettings,
    layout: &LayoutReport,
    receivers: &ReceiverSet,
    probes: &ProbeSet,
    rays: RelightRays,
    clusters: Vec<Cluster>,
) -> Result<BakedArrays, BakeError> {
    let packed = Packed::of(clusters, "the cluster matrices", "fewer --receivers")?;
    let mut arrays = BakedArrays {
        probes: probes
            .positions
            .iter()
            .zip(&probes.radius_m)
            .map(|(position, &support_radius_m)| Probe { position: position.to_array(), support_radius_m })
            .collect(),
        ray_dirs: rays.dirs,
        ray_sh: rays.sh,
        ray_uv: rays.uv,
        ray_level: rays.level,
        ray_distance: rays.distance,
        ..BakedArrays::default()
    };
    let mut stored = vec![u32::MAX; receivers.len()];
    for (place, &member) in packed.members.iter().enumerate() {
        let member = member as usize;
        stored[member] = place as u32;
        arrays.receiver_texel.push(receivers.texel[member]);
        arrays.receiver_position.push(receivers.position[member].to_array());
        arrays.receiver_normal.push(receivers.normal[member].to_array());
    }
    arrays.receiver_unseen = packed.unseen;
    arrays.clusters = packed.clusters;
    arrays.cluster_probes = packed.cluster_probes;
    arrays.projection = packed.projection;
    arrays.reconstruction = packed.reconstruction;
    arrays.gutters = receivers.gutters.iter().map(|&(texel, receiver)| [texel, stored[receiver as usize]]).collect();
    arrays.seams = receivers
        .seams
        .iter()
        .map(|&(a, b)| {
            let (a, b) = (stored[a as usize], stored[b as usize]);
            [a.min(b), a.max(b)]
        })
        .collect();
    arrays.seams.sort_unstable();
    let (low, high) = scene.bounds().unwrap_or_default();
    arrays.metadata = Metadata {
        tool_version: env!("CARGO_PKG_VERSION").into(),
        scene_path: String::new(),
        scene_hash: scene.hash,
        lightmap_size: layout.size,
        direct_size: settings.direct_map,
        probe_degree: settings.probe_degree,
        receiver_degree: settings.receiver_degree,
        sky_degree: settings.sky_degree,
        n_rays: settings.relight_rays,
        bounds: [low.to_array(), high.to_array()],
        options: settings.to_toml(),
    };
    Ok(arrays)
}

/// Appends values and a zero if their number is odd, so that every block starts at a pair.
fn extend_even(all: &mut Vec<f16>, block: &[f16]) {
    all.extend_from_slice(block);
    if !all.len().is_multiple_of(2) {
        all.push(f16::ZERO);
    }
}

fn scene_facts(scene: &Scene) -> SceneFacts {
    SceneFacts {
        triangles: scene.face_count() as u64,
        materials: scene.materials.len() as u64,
        hash: hex(&scene.hash),
        degenerate: scene.dropped.degenerate as u64,
        duplicate: scene.dropped.duplicate as u64,
    }
}

fn atlas_facts(layout: &LayoutReport, receivers: &ReceiverSet, settings: &BakeSettings) -> AtlasFacts {
    AtlasFacts {
        unwrapped: !layout.kept,
        reason: layout.reason.clone(),
        lightmap: layout.size,
        direct_map: settings.direct_map,
        charts: u64::from(layout.charts),
        map_used: (receivers.len() + receivers.invalid.len()) as f64 / f64::from(layout.size).powi(2),
        back_faces: layout.back_faces as u64,
        covered_texels: (receivers.len() + receivers.invalid.len()) as u64,
        pushed_receivers: receivers.pushed as u64,
    }
}

fn placement_facts(placement: &PlacementReport) -> PlacementFacts {
    PlacementFacts {
        spacing: placement.spacing_m,
        voxel: placement.voxel_m,
        candidates: placement.candidates as u64,
        rejected: placement.rejected as u64,
        repaired: placement.repaired as u64,
    }
}

fn fill_results(
    report: &mut BakeReport,
    receivers: &ReceiverSet,
    probes: &ProbeSet,
    support: &Support,
    clusters: &[Cluster],
) {
    report.receivers = receivers.len() as u64;
    report.invalid_receivers = receivers.invalid.len() as u64;
    report.probes = probes.positions.len() as u64;
    report.radius = probes.median_radius_m();
    let counts = support.start.windows(2).map(|run| run[1] - run[0]);
    report.overlap = Overlap {
        mean: (support.probes.len() as f64 / receivers.len().max(1) as f64) as f32,
        min: counts.clone().min().unwrap_or(0),
        max: counts.max().unwrap_or(0),
    };
    report.clusters = clusters.len() as u64;
    let weighted: usize = clusters.iter().map(|cluster| cluster.members.len() * cluster.rows.n_coefficients).sum();
    report.coefficients_per_receiver = weighted as f64 / receivers.len().max(1) as f64;
    let linked: usize = clusters.iter().map(|cluster| cluster.probes.len()).sum();
    report.probes_per_cluster = linked as f64 / clusters.len().max(1) as f64;
    let unseen: Vec<f32> = clusters.iter().flat_map(|cluster| cluster.unseen.iter().copied()).collect();
    report.unseen = Unseen::of(&unseen);
    let errors = || clusters.iter().flat_map(|cluster| cluster.rows.row_error_squared.iter().copied());
    let n_rows = errors().count().max(1);
    report.compression = Compression {
        rms_error: (errors().sum::<f64>() / n_rows as f64).sqrt(),
        max_error: errors().fold(0.0, f64::max).sqrt(),
    };
    report.seams = receivers.seams.len() as u64;
}

fn tree_error(error: TreeError) -> BakeError {
    BakeError::Scene {
        what: error.to_string(),
        place: None,
        remedy: "remove stray far-away or microscopic geometry".into(),
    }
}

fn voxel_error(error: voxels::VoxelError) -> BakeError {
    stage_error(
        &error.to_string(),
        matches!(error, voxels::VoxelError::EmptyScene | voxels::VoxelError::NotFinite { .. }),
    )
}

fn placement_error(error: probes::PlacementError) -> BakeError {
    use probes::PlacementError as E;
    let of_scene = matches!(error, E::NoOpenSpace { .. } | E::NoCandidate { .. } | E::NoReceivers);
    stage_error(&error.to_string(), of_scene)
}

fn unwrap_error(error: UnwrapError) -> BakeError {
    match error {
        UnwrapError::Cancelled => BakeError::Cancelled(Cancelled),
        UnwrapError::NotBuilt => {
            BakeError::Unsupported { what: error.to_string(), remedy: "use the default unwrap backend".into() }
        }
        UnwrapError::NotFinite { .. } | UnwrapError::Backend { .. } => stage_error(&error.to_string(), true),
        _ => stage_error(&error.to_string(), false),
    }
}

/// The stages' messages end in `: REMEDY`.
fn stage_error(message: &str, of_scene: bool) -> BakeError {
    let (what, remedy) = message.rsplit_once(": ").unwrap_or((message, "see precompute bake --help"));
    let (what, remedy) = (what.to_owned(), remedy.to_owned());
    if of_scene { BakeError::Scene { what, place: None, remedy } } else { BakeError::Option { what, remedy } }
}
