//! Fuzz targets: what reads files, records and options, held against damaged bytes. Each takes any bytes, says whether it read
//! something in them, and panics if a promise is broken. `scripts/fuzz.sh` runs them under libFuzzer; the tests of the workspace hold each against its seeds and a few
//! thousand mutations of them, without it.

pub mod mutate;
pub mod seeds;

use glam::Vec3;
use localprt_formats::{Baked, Checked, OpenError, check_bytes};
use localprt_precompute::{
    BakeSettings, Preset, cache::Place, clusters::leaves, pipeline::fuzzing, plan::BakePlan, settings::SettingsError,
    shards::ShardPlan,
};
use localprt_runtime::{CpuRelighter, RelightInputs, SurfaceTexels};
use localprt_scenes::{Lighting, Limits, Scene, Sky, load_bytes_within};
use serde_json::Value;
use std::{path::Path, sync::OnceLock};
use toml::Table;

/// Something that is held against bytes.
pub struct Target {
    /// Of its binary.
    pub name: &'static str,
    /// What takes the bytes: whether it read something.
    pub run: fn(&[u8]) -> bool,
    /// How they are damaged.
    pub mutation: mutate::Mutation,
    /// What it reads without complaint.
    pub seeds: Vec<Vec<u8>>,
}

/// All of them.
pub fn targets() -> Vec<Target> {
    let bake = seeds::bake();
    vec![
        Target { name: "file", run: file, mutation: mutate::file, seeds: seeds::files(&bake) },
        Target { name: "cache_record", run: cache_record, mutation: mutate::record, seeds: seeds::records(&bake) },
        Target { name: "plan", run: plan, mutation: mutate::json, seeds: seeds::plans(&bake) },
        Target { name: "gltf", run: gltf, mutation: mutate::gltf, seeds: seeds::scenes(&bake) },
        Target { name: "lighting", run: lighting, mutation: mutate::json, seeds: seeds::lightings() },
        Target { name: "settings", run: settings, mutation: mutate::plain, seeds: seeds::settings() },
    ]
}

/// A baked file. What opens is read to its end, and relit.
pub fn file(bytes: &[u8]) -> bool {
    let listed: Vec<u16> = check_bytes(bytes).iter().map(|violation| violation.rule).collect();
    let refused = |error: OpenError| {
        assert!(!error.to_string().is_empty() && !error.help().is_empty());
        let rule = error.rule().expect("not a failure of the file system");
        assert!(listed.contains(&rule), "check found {listed:?}, open {rule}: {error}");
    };
    let baked = match Baked::from_bytes(bytes.to_vec()) {
        Ok(baked) => baked,
        Err(error) => {
            refused(error);
            return false;
        }
    };
    let view = baked.view();
    for section in baked.sections() {
        assert!(section.offset + section.length <= baked.file_bytes() && !section.kind.to_string().is_empty());
    }
    let n_k = view.metadata.n_k();
    let are_sound = (0..view.blocks.records.len()).all(|index| {
        view.blocks.to_block(index, n_k).expect("its bytes are there");
        baked.block(index).is_ok_and(|block| {
            assert!(block.receivers.end <= view.receiver_texel.len());
            true
        })
    });
    match baked.checked() {
        Ok(checked) => {
            assert!(are_sound, "a block is refused that is checked");
            checked_file(&checked);
            true
        }
        Err(error) => {
            refused(error);
            false
        }
    }
}

/// Maps and grids of more than this are left alone: they take memory, which is allowed, and time.
const MOST_TEXELS: u32 = 256;
const MOST_CELLS: u64 = 1 << 14;

fn checked_file(checked: &Checked<'_>) {
    let view = checked.view();
    let transport = checked.transport();
    for receiver in 0..checked.n_receivers() {
        let cluster = transport.cluster_of(receiver).expect("every receiver is in one");
        assert!(transport.clusters[cluster].receivers.contains(&receiver));
        transport.links_of(receiver);
    }
    let is_small = view.metadata.lightmap_size.max(view.metadata.direct_size) <= MOST_TEXELS
        && view.volume.is_none_or(|volume| volume.grid.n_cells() <= MOST_CELLS);
    if is_small {
        let surface = SurfaceTexels { size: view.metadata.direct_size, ..SurfaceTexels::default() };
        let sky_sh = vec![Vec3::ONE; view.metadata.n_sky()];
        let mut relighter = CpuRelighter::new(checked.clone());
        let inputs = RelightInputs { sky_sh: &sky_sh, ..RelightInputs::new(&surface) };
        let relit = relighter.relight(&inputs).expect("inputs fit the file");
        assert_eq!(relit.irradiance.len(), checked.n_receivers());
    }
}

/// Bytes before the arrays of a record: its kind, and for a leaf the number of its receivers and of its probes.
pub const RECORD_HEAD: usize = 3;

/// Kinds of records.
pub(crate) const CELLS: u8 = 0;
pub(crate) const LEAF: u8 = 1;
pub(crate) const LAYOUT: u8 = 2;
pub(crate) const BAKE: u8 = 3;

/// A record of a cache, behind its head. What is read and packed is read again, to the same.
pub fn cache_record(bytes: &[u8]) -> bool {
    let Some((&[kind, n_members, n_probes], content)) = bytes.split_first_chunk::<RECORD_HEAD>() else { return false };
    assert!(fuzzing::open(content).is_none() && fuzzing::open(&fuzzing::seal(content)) == Some(content));
    let read = |content: &[u8]| match kind % 4 {
        CELLS => fuzzing::cells(content, seeds::scene().bounds().unwrap_or_default()),
        LEAF => fuzzing::leaf(content, n_members, n_probes),
        LAYOUT => fuzzing::layout(content, seeds::scene()).map(|(scene, packed)| {
            sound_scene(&scene);
            packed
        }),
        _ => fuzzing::bake(content).map(|report| report.to_json().into_bytes()),
    };
    let Some(packed) = read(content) else { return false };
    assert!(kind % 4 == BAKE || read(&packed).is_some_and(|again| again == packed), "another record than was read");
    true
}

/// Stands for this program in a plan of shards.
pub(crate) const PROGRAM: &str = "PROGRAM";

fn program() -> &'static str {
    static PROGRAM: OnceLock<String> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let plan = ShardPlan::new(String::new(), String::new(), String::new(), &[], 1);
        let plan: Value = serde_json::from_str(&plan.to_json()).expect("JSON");
        plan["program"].as_str().expect("a name").into()
    })
}

/// The plan of a bake, or of shards. What is read is written, and read again to the same.
pub fn plan(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let of_bake = BakePlan::of_file(text);
    if let Some(plan) = &of_bake {
        assert_eq!(BakePlan::of_file(&plan.to_json()).as_ref(), Some(plan));
        plan.is_for(&BakeSettings::default());
        let places: Vec<Vec3> = (0..40).map(|number| Vec3::new(1.0, number as f32 * 0.1, -(number as f32))).collect();
        let (members, tree) = leaves(&places, 8, Some(&plan.leaves));
        assert!(members.iter().map(Vec::len).sum::<usize>() == places.len() && tree.is_sound());
    }
    match ShardPlan::of_json(&text.replacen(PROGRAM, program(), 1)) {
        Ok(plan) => {
            assert_eq!(ShardPlan::of_json(&plan.to_json()).ok().as_ref(), Some(&plan));
            assert!(plan.shards_of(&[0]).len() <= 1 && plan.n_leaves() >= plan.shards_of(&[0]).len());
            drop(BakeSettings::of_file(&plan.options));
            drop(plan.cache.map(|place| Place::parse(place.into())));
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            of_bake.is_some()
        }
    }
}

/// Little enough that no scene is slow or large.
const LIMITS: Limits = Limits {
    file_bytes: 1 << 20,
    json_bytes: 1 << 19,
    buffer_bytes: 1 << 20,
    image_bytes: 1 << 19,
    image_side: 512,
    image_pixels: 1 << 18,
    triangles: 1 << 14,
    instances: 1 << 12,
    implicit_count: 1 << 12,
    depth: 32,
};

/// A glTF scene in memory. What loads is sound.
pub fn gltf(bytes: &[u8]) -> bool {
    match load_bytes_within("fuzz.glb", bytes, &LIMITS) {
        Ok(scene) => {
            sound_scene(&scene);
            true
        }
        Err(error) => {
            assert!(error.to_string().contains("fuzz.glb") && !error.help.is_empty(), "{error}");
            false
        }
    }
}

/// Arrays agree, indices are in range, numbers are finite; and what is looked up everywhere in it.
fn sound_scene(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(mesh.is_sound() && mesh.material < scene.materials.len(), "{}", mesh.name);
        assert!(scene.light_map_set.is_none_or(|set| mesh.uv_set(set).is_some()));
    }
    for image in &scene.images {
        assert_eq!(image.rgba.len() as u64, 4 * u64::from(image.width) * u64::from(image.height));
    }
    assert!(scene.textures.iter().all(|texture| texture.image < scene.images.len()));
    scene.bounds();
    for (mesh, triangle) in scene.faces().take(64) {
        let middle = Vec3::splat(1.0 / 3.0);
        let color = scene.base_color(mesh, triangle, middle);
        assert!(color.is_finite(), "base color {color}");
        scene.is_present(mesh, triangle, middle);
        scene.emission(mesh, triangle, middle);
        scene.surface_point(mesh, triangle, middle);
        scene.area_m2(mesh, triangle);
    }
}

/// A lighting file, but for images of skies. What is read is written, and read again to the same.
pub fn lighting(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let names_file = |value: Value| value["sky"]["file"].is_string();
    if serde_json::from_str(text.trim_start_matches('\u{feff}')).is_ok_and(names_file) {
        return false;
    }
    let read = |text: &str| Lighting::from_json_for(text, Path::new("/nowhere"), seeds::scene());
    match read(text) {
        Ok(lighting) => {
            // What plays no part, such as the place of a directional light, is not written.
            let text = lighting.to_json().to_string();
            let again = read(&text).expect("as it was written");
            assert_eq!(again.to_json().to_string(), text);
            for dir in [Vec3::X, Vec3::Y, Vec3::NEG_Y] {
                let radiance = lighting.sky.radiance(dir);
                assert!(radiance.is_finite() && again.sky.radiance(dir) == radiance, "{radiance}");
            }
            assert!(!matches!(lighting.sky, Sky::Equirect { .. }));
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty() && !error.help().is_empty());
            false
        }
    }
}

/// Options, of a configuration and of a baked file. What is read is written, and read again to the same.
pub fn settings(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let configured = |text: &str| BakeSettings::resolve(Preset::Preview, Some(("fuzz.toml", text)), &Table::new());
    let of = |read: &dyn Fn(&str) -> Result<BakeSettings, SettingsError>| match read(text) {
        Ok(settings) => {
            assert_eq!(read(&settings.to_toml()).as_ref().ok(), Some(&settings));
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty() && !error.help().is_empty());
            false
        }
    };
    of(&configured) | of(&BakeSettings::of_file)
}
