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

#[test]
fn every_shader_validates_with_what_webgpu_guarantees() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    wgsl_files(&src, &mut files);
    let shared = ["common.wgsl", "sh.wgsl"]
        .map(|name| std::fs::read_to_string(src.join("shaders").join(name)).expect("shared shader part"));
    let mut n_passes = 0;
    for file in files.iter().filter(|file| file.starts_with(src.join("passes"))) {
        let mut text = std::fs::read_to_string(file).expect("shader");
        // The lookup in a shadow map is shared by what draws the maps and what reads them.
        if text.contains("shadow_view.wgsl") {
            let view = src.join("passes/shadow_map/shadow_view.wgsl");
            text = [&text, &std::fs::read_to_string(view).expect("shared shader part")].map(String::as_str).join("\n");
        }
        for format in ["rgba16float", "rgba32float"] {
            let source = [shared.as_slice(), &[text.replace("MAP_FORMAT", format)]].concat().join("\n");
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
