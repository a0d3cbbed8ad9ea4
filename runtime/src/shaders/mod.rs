//! Joins the parts that passes share and a pass into one shader source.

#[cfg(test)]
pub(crate) mod layout_test;

/// Functions for the host's own shaders: sampling the maps, irradiance about a normal map's normal, approximate indirect
/// mirror reflection. Joins any module; all names begin with `localprt_`. Twin: [`crate::host_shading`].
pub const HOST_WGSL: &str = include_str!("host.wgsl");

/// Placeholder in WGSL for the storage format of a map.
const FORMAT: &str = "MAP_FORMAT";
/// Placeholder for the largest value that a map may hold: what f16 can store, and in f32 so much that sums over rays stay
/// finite. Infinities would turn to NaN where they meet a weight of 0.
const LARGEST: &str = "MAP_LARGEST";

/// `common.wgsl`, then the pass.
pub(crate) fn source(pass: &str) -> String {
    [include_str!("common.wgsl"), pass].join("\n")
}

/// The same for a pass that writes texels of a map.
pub(crate) fn source_with_format(pass: &str, format: wgpu::TextureFormat) -> String {
    let (name, largest) = match format {
        wgpu::TextureFormat::Rgba16Float => ("rgba16float", "65504.0"),
        _ => ("rgba32float", "1.0e30"),
    };
    source(pass).replace(FORMAT, name).replace(LARGEST, largest)
}
