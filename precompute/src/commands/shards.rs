//! `precompute plan`, `bake --plan` and `merge`: a bake in shards.

use super::{bake, check_output, grouped, print_data, to_json, write_text};
use crate::cli::{Merge, Plan};
use localprt_precompute::{
    cache::{Cache, CacheOptions, NoPlace, Place, PlaceError},
    error::{BakeError, CommandError, Exit},
    inputs,
    output::{OutputError, check_writable, folder_of, write_file},
    pipeline::{self, Reuse},
    plan::Previous,
    progress::Progress,
    scratch::Scratch,
    settings::BakeSettings,
    shards::ShardPlan,
};
use localprt_scenes::Scene;
use localprt_tools::hex;
use serde::Serialize;
use std::path::Path;

/// What `bake --plan --shard` reports.
#[derive(Serialize)]
struct ShardReport {
    shard: u32,
    shards: usize,
    leaves: usize,
    reused: u64,
    baked: u64,
    seconds: f64,
}

/// Runs `plan`.
pub fn plan(command: &Plan, progress: &Progress) -> Result<(), CommandError> {
    let settings = bake::settings(command.config.as_deref(), command.preset, &command.flags)?;
    let path = &command.output;
    inputs::check_scene(&command.scene)?;
    let is_input =
        |input: &Path| path.canonicalize().is_ok_and(|path| input.canonicalize().is_ok_and(|input| input == path));
    if is_input(Path::new(&command.scene)) || command.layout.as_deref().is_some_and(is_input) {
        let help = "give -o another name";
        return Err(CommandError::new(Exit::Usage, "the plan would overwrite the input").in_file(path).help(help));
    }
    check_writable(path)?;
    let scene = load(&command.scene, progress)?;
    let named = command.layout.as_deref().map(Previous::open).transpose()?;
    let place = command.cache.clone().unwrap_or_else(|| Place::Folder(ShardPlan::parts(path)));
    let cache = open(&place)?;
    let hash = hex(&scene.hash);
    let scratch = Scratch::in_folder(&std::env::temp_dir())?;
    let reuse = Reuse { cache: Some(&cache), previous: named.as_ref(), scratch: Some(&scratch), ..Reuse::default() };
    let costs =
        pipeline::costs(scene, &settings, reuse, progress).map_err(|error| bake::of_scene(error, &command.scene))?;
    cache.finish(progress);

    let relative = |to: &Path| from_plan(path, to);
    let source = match command.scene.starts_with(inputs::BUILTIN) {
        true => command.scene.clone(),
        false => relative(Path::new(&command.scene))?,
    };
    let layout = match (&command.layout, &named) {
        (Some(layout), Some(named)) => Some([relative(layout)?, hex(&named.digest())]),
        _ => None,
    };
    let kept = match &command.cache {
        Some(Place::Folder(folder)) => Some(relative(folder)?),
        place => place.as_ref().map(Place::to_string),
    };
    let mut plan = ShardPlan::new(source, hash, settings.to_toml(), &costs, command.shards);
    (plan.layout, plan.cache) = (layout, kept);
    write_file(path, plan.to_json().as_bytes())?;
    let largest = plan.shards.iter().map(|shard| shard.share).fold(0.0, f64::max);
    progress.note(&format!(
        "wrote {}: {} leaves in {} shards, the largest {:.1} % of the work",
        path.display(),
        grouped(costs.len() as u64),
        command.shards,
        100.0 * largest
    ));
    Ok(())
}

/// Runs `bake --plan PLAN --shard I`.
pub fn shard(path: &Path, number: u32, report: Option<&Path>, progress: &Progress) -> Result<(), CommandError> {
    check_output(report)?;
    let planned = Planned::open(path, progress)?;
    let Some(shard) = planned.plan.shards.get(number as usize) else {
        let what = format!("there is no shard {number}: shards are 0 to {}", planned.plan.shards.len() - 1);
        return Err(CommandError::new(Exit::Usage, what).in_file(path).help("give --shard one of these numbers"));
    };
    let leaves = shard.leaves.clone();
    let (n_shards, source, cache) = (planned.plan.shards.len(), planned.source, planned.cache);
    // The folder of the plan may be far away, or not to be written to.
    let scratch = Scratch::in_folder(&std::env::temp_dir())?;
    let previous = planned.previous.as_ref();
    let reuse = Reuse { cache: Some(&cache), previous, scratch: Some(&scratch), ..Reuse::default() };
    let kept =
        pipeline::keep_leaves(planned.scene, &planned.settings, reuse, (&leaves, planned.plan.n_leaves()), progress)
            .map_err(|error| bake::of_scene(error, &source))?;
    if cache.failed() > 0 {
        let what = format!("{} results could not be kept", cache.failed());
        return Err(CommandError::new(Exit::Io, what)
            .in_file(Path::new(&planned.place.to_string()))
            .help("free some space there, and bake the shard again: what is kept is not made again"));
    }
    let seconds = progress.seconds();
    let facts = ShardReport {
        shard: number,
        shards: n_shards,
        leaves: leaves.len(),
        reused: kept.reused,
        baked: kept.baked,
        seconds,
    };
    if let Some(report) = report {
        write_text(report, &to_json(&facts))?;
    }
    progress.note(&format!(
        "shard {number} of {n_shards}: {} leaves baked, {} were there, {seconds:.1} s",
        kept.baked, kept.reused
    ));
    Ok(())
}

/// Runs `merge`.
pub fn merge(command: &Merge, progress: &Progress) -> Result<(), CommandError> {
    check_output(command.report.as_deref())?;
    let planned = Planned::open(&command.plan, progress)?;
    let scene_output = bake::scene_output(&planned.source, &command.output)?;
    bake::check_baked_output(&command.output)?;
    let scratch = Scratch::in_folder(folder_of(&command.output))?;
    let (cache, previous) = (Some(&planned.cache), planned.previous.as_ref());
    let reuse = Reuse { cache, previous, scratch: Some(&scratch), ..Reuse::default() };
    let baked = pipeline::merge(planned.scene, &planned.settings, reuse, planned.plan.n_leaves(), progress).map_err(
        |error| match error {
            BakeError::Missing { leaves } => missing(&planned.plan, &leaves).in_file(&command.plan),
            error => bake::of_scene(error, &planned.source),
        },
    )?;
    let report = bake::write(baked, &planned.source, [&command.output, &scene_output], progress)?.report;
    match command.report.as_deref() {
        Some(path) if path == Path::new("-") => print_data(&report.to_json()),
        Some(path) => write_text(path, &report.to_json()),
        None => Ok(()),
    }
}

fn missing(plan: &ShardPlan, leaves: &[usize]) -> CommandError {
    let shards = plan.shards_of(leaves);
    let names: Vec<String> = shards.iter().map(usize::to_string).collect();
    let what = format!(
        "{} of {} shards are not baked: {} ({} of {} leaves are missing)",
        shards.len(),
        plan.shards.len(),
        names.join(", "),
        leaves.len(),
        plan.n_leaves()
    );
    CommandError::new(Exit::Incomplete, what)
        .help("bake them with `bake --plan PLAN --shard I`, on machines with the same kind of processor as this one")
}

/// A plan with what it names.
struct Planned {
    plan: ShardPlan,
    source: String,
    scene: Scene,
    settings: BakeSettings,
    previous: Option<Previous>,
    place: Place,
    cache: Cache,
}

impl Planned {
    fn open(path: &Path, progress: &Progress) -> Result<Self, CommandError> {
        let plan = ShardPlan::of_json(&inputs::text(path)?).map_err(|error| CommandError::from(error).in_file(path))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let source = match plan.scene.starts_with(inputs::BUILTIN) {
            true => plan.scene.clone(),
            false => folder.join(&plan.scene).to_string_lossy().into_owned(),
        };
        inputs::check_scene(&source)?;
        let scene = load(&source, progress)?;
        let changed = |what: &str, file: &str| {
            CommandError::new(Exit::InvalidInput, format!("the {what} is another than when the bake was planned"))
                .in_file(Path::new(file))
                .help("plan again: what has not changed is not baked again")
        };
        if hex(&scene.hash) != plan.scene_hash {
            return Err(changed("scene", &source));
        }
        let settings = BakeSettings::of_file(&plan.options)?;
        let previous = match &plan.layout {
            None => None,
            Some([layout, digest]) => {
                let layout = folder.join(layout);
                let previous = Previous::open(&layout)?;
                if hex(&previous.digest()) != *digest {
                    return Err(changed("layout", &layout.to_string_lossy()));
                }
                Some(previous)
            }
        };
        let place = match &plan.cache {
            None => Place::Folder(ShardPlan::parts(path)),
            Some(place) => match Place::parse(place.into()).map_err(|error| no_place(&error, path))? {
                Place::Folder(place) => Place::Folder(folder.join(place)),
                place => place,
            },
        };
        let cache = open(&place)?;
        Ok(Self { plan, source, scene, settings, previous, place, cache })
    }
}

fn no_place(error: &NoPlace, plan: &Path) -> CommandError {
    CommandError::of(Exit::Usage, error).in_file(plan).help("plan again with a --cache that this program knows")
}

fn load(source: &str, progress: &Progress) -> Result<Scene, CommandError> {
    let _stage = progress.stage("load", 0);
    inputs::scene(source)
}

/// Nothing of a bake in shards is trimmed before it is merged.
fn open(place: &Place) -> Result<Cache, PlaceError> {
    Cache::open_place(place, CacheOptions { limit_bytes: u64::MAX, ..CacheOptions::default() })
}

/// A path as it is from the folder of a plan.
fn from_plan(plan: &Path, to: &Path) -> Result<String, CommandError> {
    let folder = folder_of(plan);
    Ok(inputs::relative_path(folder, to).map_err(|cause| OutputError::write(plan, cause))?)
}
