//! The passes of the runtime as SPIR-V, from the same WGSL by the same naga.
//!
//! Godot runs the entry point `main` of a module, so there is a module for each entry point; and its overrides have values, so there is
//! one for each value that files may have: the degree of the probes, the degree of the receivers.

use naga::back::{PipelineConstants, pipeline_constants::process_overrides, spv};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{ShaderStage, proc::BoundsCheckPolicy};
use std::error::Error;
use std::fs;
use std::path::Path;

macro_rules! pass {
    ($path:literal) => {
        include_str!(concat!("../../src/passes/", $path, ".wgsl"))
    };
}

const COMMON: &str = include_str!("../../src/shaders/common.wgsl");
const SH: &str = include_str!("../../src/shaders/sh.wgsl");
const SHADOW_VIEW: &str = pass!("shadow_map/shadow_view");
const SHADOW_MAP: &str = pass!("shadow_map/shadow_map");
const DIRECT_LIGHT: &str = pass!("direct_irradiance/direct_light");
const DIRECT_IRRADIANCE: &str = pass!("direct_irradiance/direct_irradiance");
/// What the engine samples, from what the relighter made: the add-on's own.
const ENGINE_MAP: &str = include_str!("engine_map.wgsl");
const ENGINE_DIRECTIONAL_MAP: &str = include_str!("engine_directional_map.wgsl");

/// Largest SH degree of probes that a file may have.
const MOST_PROBE_DEGREE: u32 = 10;

/// One module: the name of its file, its text, entry point, stage and overrides.
struct Module {
    name: String,
    text: String,
    entry_point: &'static str,
    stage: ShaderStage,
    overrides: Vec<(&'static str, f64)>,
}

impl Module {
    fn compute(entry_point: &'static str, text: String) -> Self {
        Self { name: entry_point.into(), text, entry_point, stage: ShaderStage::Compute, overrides: Vec::new() }
    }

    /// The same with a value of an override, which ends its name.
    fn with(self, name: &'static str, value: u32) -> Self {
        let overrides = self.overrides.into_iter().chain([(name, f64::from(value))]).collect();
        Self { name: format!("{}_{value}", self.name), overrides, ..self }
    }

    /// The same with an override that all files share.
    fn always(mut self, name: &'static str, value: f64) -> Self {
        self.overrides.push((name, value));
        self
    }
}

/// Writes every module as `NAME.spv`.
pub fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    for module in modules() {
        let words = spirv(&module).map_err(|error| format!("{}: {error}", module.name))?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        fs::write(folder.join(format!("{}.spv", module.name)), bytes)?;
    }
    Ok(())
}

fn modules() -> Vec<Module> {
    let joined = |parts: &[&str]| parts.join("\n");
    // As the runtime's own map formats, see its shaders/mod.rs.
    let light_map =
        |pass: &str| joined(&[COMMON, pass]).replace("MAP_FORMAT", "rgba32float").replace("MAP_LARGEST", "1.0e30");
    let gutters = joined(&[COMMON, SH, pass!("gutter_dilation/gutter_dilation")]).replace("MAP_FORMAT", "rgba16float");
    let shadow_map = joined(&[SHADOW_VIEW, SHADOW_MAP]);
    let direct = joined(&[SHADOW_VIEW, DIRECT_LIGHT, DIRECT_IRRADIANCE]);
    let raster =
        |entry_point: &'static str, stage| Module { stage, ..Module::compute(entry_point, shadow_map.clone()) };
    let mut modules = vec![
        raster("opaque_vertex", ShaderStage::Vertex),
        raster("masked_vertex", ShaderStage::Vertex),
        raster("masked_fragment", ShaderStage::Fragment),
        Module::compute("direct_irradiance", direct),
        Module::compute("direct_lightmap", light_map(pass!("direct_lightmap/direct_lightmap"))),
        Module::compute("lightmap_mips", light_map(pass!("lightmap_mips/lightmap_mips"))),
        Module::compute("engine_map", ENGINE_MAP.into()),
        Module::compute("engine_directional_map", ENGINE_DIRECTIONAL_MAP.into()),
    ];
    for n_sh in (0..=MOST_PROBE_DEGREE).map(|degree| (degree + 1).pow(2)) {
        let of = |entry_point, pass: &str| Module::compute(entry_point, joined(&[COMMON, pass])).with("N_SH", n_sh);
        modules.push(of("probe_relight", pass!("probe_relight/probe_relight")).always("OCCLUDERS", 0.0));
        modules.push(of("sum_segments", pass!("probe_relight/sum_segments")));
        modules.push(of("cluster_projection", pass!("cluster_projection/cluster_projection")));
    }
    for n_k in [1, 4] {
        let of = |entry_point, text: String| Module::compute(entry_point, text).with("N_K", n_k);
        let reconstruction = pass!("receiver_reconstruction/receiver_reconstruction");
        modules.push(of("receiver_reconstruction", joined(&[COMMON, reconstruction])));
        modules.push(of("near_light", joined(&[COMMON, pass!("near_light/near_light")])));
        modules.push(of("gutter_dilation", gutters.clone()));
    }
    modules
}

fn spirv(module: &Module) -> Result<Vec<u32>, Box<dyn Error>> {
    let parsed = naga::front::wgsl::parse_str(&module.text).map_err(|error| error.emit_to_string(&module.text))?;
    // That of unpack2x16float, which every device has.
    let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let validate = |parsed: &naga::Module| {
        let mut validator = Validator::new(ValidationFlags::all(), capabilities);
        validator.validate(parsed).map_err(|error| error.emit_to_string(&module.text))
    };
    let info = validate(&parsed)?;
    let constants: PipelineConstants = module.overrides.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    let wanted = Some((module.stage, module.entry_point));
    let (parsed, _) = process_overrides(&parsed, &info, wanted, &constants)?;
    let mut parsed = parsed.into_owned();
    parsed.entry_points.retain(|entry| entry.name == module.entry_point && entry.stage == module.stage);
    let [entry] = &mut parsed.entry_points[..] else { return Err("no such entry point".into()) };
    entry.name = "main".into();
    naga::compact::compact(&mut parsed, naga::compact::KeepUnused::No);
    let info = validate(&parsed)?;
    let options = spv::Options {
        lang_version: (1, 3),
        // Clip space as the runtime has it: y upwards.
        flags: spv::WriterFlags::ADJUST_COORDINATE_SPACE,
        // Reads beyond a buffer's end find something inside, as in wgpu.
        bounds_check_policies: naga::proc::BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Restrict,
            image_load: BoundsCheckPolicy::Restrict,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::Polyfill,
        ..spv::Options::default()
    };
    let pipeline = spv::PipelineOptions { shader_stage: module.stage, entry_point: "main".into() };
    Ok(spv::write_vec(&parsed, &info, &options, Some(&pipeline))?)
}
