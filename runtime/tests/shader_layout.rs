//! Every WGSL file parses, validates, and is found. No GPU needed.

use std::path::{Path, PathBuf};

fn wgsl_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("folder of the crate") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            wgsl_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            found.push(path);
        }
    }
}

/// The parts that the head of a shader says it follows, in its order.
fn parts_before(text: &str, files: &[PathBuf]) -> String {
    let follows = text.lines().find_map(|line| line.strip_prefix("// Follows "));
    let names = follows.into_iter().flat_map(|names| names.split([' ', ','])).map(|name| name.trim_end_matches('.'));
    let part = |name: &str| {
        let file = files.iter().find(|file| file.file_name().is_some_and(|found| found == name));
        std::fs::read_to_string(file.unwrap_or_else(|| panic!("no {name}"))).expect("shader part")
    };
    names.filter(|name| name.ends_with(".wgsl")).map(part).collect()
}

#[test]
fn every_shader_validates_with_what_webgpu_guarantees() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    wgsl_files(&src, &mut files);
    let shared = ["common.wgsl", "sh.wgsl"]
        .map(|name| std::fs::read_to_string(src.join("shaders").join(name)).expect("shared shader part"));
    let host = std::fs::read_to_string(src.join("shaders/host.wgsl")).expect("host.wgsl");
    assert!(naga::front::wgsl::parse_str(&host).is_ok(), "host.wgsl stands alone");
    let mut n_passes = 0;
    for file in files.iter().filter(|file| file.starts_with(src.join("passes"))) {
        let text = std::fs::read_to_string(file).expect("shader");
        if !["@compute", "@vertex"].iter().any(|stage| text.contains(stage)) {
            // A part, checked with the shaders that follow it.
            continue;
        }
        let parts = parts_before(&text, &files);
        for format in ["rgba16float", "rgba32float"] {
            let text = [&parts, &text.replace("MAP_FORMAT", format).replace("MAP_LARGEST", "65504.0")]
                .map(String::as_str)
                .concat();
            let source = [shared.as_slice(), &[text]].concat().join("\n");
            let module = naga::front::wgsl::parse_str(&source)
                .unwrap_or_else(|error| panic!("{}: {}", file.display(), error.emit_to_string(&source)));
            // unpack2x16float is part of WebGPU; neither f16 nor subgroups nor anything else beyond it.
            let baseline = naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), baseline)
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}: {}", file.display(), error.emit_to_string(&source)));
            assert!(!module.entry_points.is_empty(), "{}: no entry point", file.display());
            let shared_bytes: u32 = module
                .global_variables
                .iter()
                .filter(|(_, variable)| variable.space == naga::AddressSpace::WorkGroup)
                .map(|(_, variable)| module.types[variable.ty].inner.size(module.to_ctx()))
                .sum();
            assert!(shared_bytes <= 16384, "{}: {shared_bytes} bytes of workgroup memory", file.display());
        }
        let head = text.lines().take_while(|line| line.starts_with("//")).collect::<Vec<_>>().join(" ");
        assert!(head.contains("Dispatch:") || head.contains("Draw:"), "{}: the head names no dispatch", file.display());
        n_passes += 1;
    }
    assert!(n_passes >= 8, "only {n_passes} shaders found");
}

#[test]
fn a_shader_with_a_mistake_is_refused() {
    assert!(naga::front::wgsl::parse_str("@compute @workgroup_size(1) fn f() { let a: u32 = 1.5; }").is_err());
}
