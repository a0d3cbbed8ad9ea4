//! `precompute doctor`: what this machine and this build have, what is missing, and how to get it.

use super::{print_data, size, to_json};
use crate::cli::Doctor;
use localprt_precompute::error::CommandError;
use localprt_precompute::forecast::Room;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Runs the subcommand.
pub fn run(command: &Doctor) -> Result<(), CommandError> {
    let findings = Findings::of_this_machine();
    print_data(&if command.json { to_json(&findings) } else { findings.to_text() })
}

/// What `doctor --json` prints.
#[derive(Serialize)]
struct Findings {
    version: &'static str,
    /// Parts that a build may lack, and whether this one has them.
    features: BTreeMap<&'static str, bool>,
    threads: usize,
    /// Widest instructions that bakes use.
    simd: &'static str,
    /// That this process may have; absent: nobody knows.
    #[serde(skip_serializing_if = "Option::is_none")]
    memory_bytes: Option<u64>,
    /// Free in the current folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    disk_bytes: Option<u64>,
    /// Graphics adapters, the one that `--backend gpu` takes first.
    adapters: Vec<Adapter>,
    /// What is missing, and what to do about each.
    missing: Vec<Missing>,
}

#[derive(Serialize)]
struct Adapter {
    name: String,
    backend: String,
    /// Discrete, integrated, virtual, or a CPU.
    kind: String,
    driver: String,
    /// Texels per side of the largest map.
    texture_side: u32,
    /// Bytes of the largest array that a shader reads.
    array_bytes: u64,
}

#[derive(Serialize)]
struct Missing {
    what: String,
    remedy: String,
}

/// Below this a bake of a whole building may not fit.
const LITTLE_MEMORY: u64 = 4 << 30;
/// Maps that bakes may have: `--lightmap` up to 8192 and `--direct-map` up to 16384 texels per side.
const LARGE_MAP: u32 = 8192;

impl Findings {
    fn of_this_machine() -> Self {
        let here = Room::for_file(PathBuf::from("here.lprt"));
        let mut findings = Self {
            version: env!("CARGO_PKG_VERSION"),
            features: BTreeMap::from([
                ("compressed", cfg!(feature = "compressed")),
                ("gpu", cfg!(feature = "gpu")),
                ("xatlas", cfg!(feature = "xatlas")),
                ("bucket", cfg!(feature = "bucket")),
            ]),
            threads: rayon::current_num_threads(),
            simd: simd(),
            memory_bytes: here.memory_bytes,
            disk_bytes: here.disk.map(|(_, free)| free),
            adapters: adapters(),
            missing: Vec::new(),
        };
        findings.missing = findings.missing();
        findings
    }

    fn missing(&self) -> Vec<Missing> {
        let mut missing = Vec::new();
        let mut add = |what: String, remedy: &str| missing.push(Missing { what, remedy: remedy.into() });
        let build = |feature: &str| format!("cargo install --path precompute --features {feature}");
        for (feature, what) in [
            ("compressed", "scenes with Draco meshes, Basis textures or WebP images are refused"),
            ("gpu", "no relight --backend gpu: the CPU does the same"),
        ] {
            if self.features.get(feature) == Some(&false) {
                add(what.into(), &build(feature));
            }
        }
        if cfg!(feature = "gpu") && self.adapters.is_empty() {
            let remedy = if cfg!(target_os = "linux") {
                "install the card's Vulkan driver, or mesa-vulkan-drivers, which draws on the CPU"
            } else {
                "install the driver of the graphics card"
            };
            add("no graphics adapter: no relight --backend gpu, and no viewer".into(), remedy);
        }
        if let Some(adapter) = self.adapters.first() {
            if adapter.kind == "Cpu" {
                let what = format!("{} draws on the CPU: right, and slow", adapter.name);
                add(what, "install the Vulkan driver of the graphics card, if there is one");
            }
            if adapter.texture_side < LARGE_MAP {
                let what = format!("{} takes maps of {} texels per side at most", adapter.name, adapter.texture_side);
                add(what, "bake with --lightmap and --direct-map no larger than that");
            }
        }
        if let Some(memory) = self.memory_bytes.filter(|&memory| memory < LITTLE_MEMORY) {
            let what = format!("only {} of memory", size(memory));
            add(what, "bake with --preset preview and fewer --threads, or on another machine (docs/farm.md)");
        }
        missing
    }

    fn to_text(&self) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "{name:<10} {value}");
        };
        let with = |has: bool| {
            let names = self.features.iter().filter(|feature| *feature.1 == has).map(|feature| *feature.0);
            names.collect::<Vec<_>>().join(", ")
        };
        let or_none = |text: String| if text.is_empty() { "nothing".into() } else { text };
        line("version", format!("{}, with {}, without {}", self.version, or_none(with(true)), or_none(with(false))));
        line("threads", format!("{}, {}", self.threads, self.simd));
        let known = |bytes: Option<u64>| bytes.map_or("unknown".into(), size);
        line("memory", format!("{} for this program", known(self.memory_bytes)));
        line("disk", format!("{} free here", known(self.disk_bytes)));
        for adapter in &self.adapters {
            let Adapter { name, backend, kind, driver, texture_side, array_bytes } = adapter;
            let of_driver = if driver.is_empty() { String::new() } else { format!(", {driver}") };
            let limits = format!("maps of {texture_side}² texels, arrays of {}", size(*array_bytes));
            line("adapter", format!("{name} ({backend}, {kind}{of_driver}): {limits}"));
        }
        for Missing { what, remedy } in &self.missing {
            line("missing", what.clone());
            line("", format!("-> {remedy}"));
        }
        if self.missing.is_empty() {
            line("missing", "nothing".into());
        }
        text
    }
}

fn simd() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "AVX-512";
        }
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            return "AVX2 with FMA";
        }
        "SSE2"
    }
    #[cfg(target_arch = "aarch64")]
    {
        "NEON"
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    {
        "no SIMD"
    }
}

#[cfg(feature = "gpu")]
fn adapters() -> Vec<Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let wanted =
        wgpu::RequestAdapterOptions { power_preference: wgpu::PowerPreference::HighPerformance, ..Default::default() };
    let first = pollster::block_on(instance.request_adapter(&wanted)).ok().map(|adapter| adapter.get_info());
    let mut all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    all.sort_by_key(|adapter| Some(adapter.get_info()) != first);
    let described = |adapter: &wgpu::Adapter| {
        let (info, limits) = (adapter.get_info(), adapter.limits());
        Adapter {
            name: info.name,
            backend: info.backend.to_string(),
            kind: format!("{:?}", info.device_type),
            driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
            texture_side: limits.max_texture_dimension_2d,
            array_bytes: limits.max_storage_buffer_binding_size,
        }
    };
    all.iter().map(described).collect()
}

#[cfg(not(feature = "gpu"))]
fn adapters() -> Vec<Adapter> {
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(adapters: Vec<Adapter>) -> Findings {
        let mut findings = Findings { adapters, ..Findings::of_this_machine() };
        findings.memory_bytes = Some(16 << 30);
        findings.features = BTreeMap::from([("compressed", true), ("gpu", true)]);
        findings.missing = findings.missing();
        findings
    }

    #[test]
    fn what_is_missing_is_named_with_a_remedy() {
        let adapter = |kind: &str, texture_side: u32| Adapter {
            name: "card".into(),
            backend: "vulkan".into(),
            kind: kind.into(),
            driver: String::new(),
            texture_side,
            array_bytes: 1 << 30,
        };
        let whole = findings(vec![adapter("DiscreteGpu", 16_384)]);
        assert!(whole.missing.is_empty() && whole.to_text().contains("missing    nothing"), "{}", whole.to_text());
        let small = findings(vec![adapter("Cpu", 4096)]).to_text();
        assert!(
            small.contains("draws on the CPU") && small.contains("maps of 4096 texels per side at most"),
            "{small}"
        );
        if cfg!(feature = "gpu") {
            assert!(findings(Vec::new()).to_text().contains("no graphics adapter"));
        }
        let little = Findings { memory_bytes: Some(1 << 30), ..findings(Vec::new()) };
        assert!(little.missing().iter().any(|missing| missing.what.contains("of memory")));
    }
}
