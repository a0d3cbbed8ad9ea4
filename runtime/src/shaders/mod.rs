//! Joins the parts that passes share and a pass into one shader source.

/// Placeholder in WGSL for the storage format of a map.
const FORMAT: &str = "MAP_FORMAT";

/// `common.wgsl`, then the pass.
pub(crate) fn source(pass: &str) -> String {
    [include_str!("common.wgsl"), pass].join("\n")
}

/// The same for a pass that writes texels of a map.
pub(crate) fn source_with_format(pass: &str, format: wgpu::TextureFormat) -> String {
    let name = match format {
        wgpu::TextureFormat::Rgba16Float => "rgba16float",
        _ => "rgba32float",
    };
    source(pass).replace(FORMAT, name)
}
