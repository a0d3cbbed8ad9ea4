// Shared by all passes.

// PageCluster of transport_pages.rs; offsets within the page, of matrices in pairs of f16.
struct Cluster {
    first_receiver: u32,
    n_receivers: u32,
    first_probe: u32,
    n_probes: u32,
    n_sky: u32,
    n_coefficients: u32,
    first_light: u32,
    projection_pair: u32,
    reconstruction_pair: u32,
}

// Number of the workgroup in a dispatch that may have two dimensions.
fn linear_group(group: vec3u, groups: vec3u) -> u32 {
    return group.x + group.y * groups.x;
}

// Color of texels stored times coverage; zero where nothing is covered. Twin: CoverageMap::sample.
fn divide_by_coverage(sum: vec4f) -> vec3f {
    return select(vec3f(0.0), sum.rgb / sum.a, sum.a > 0.0);
}

// Lower tap of a bilinear read of a map of `size` texels per side, and the share of the upper tap.
struct BilinearTap {
    lower: vec2u,
    upper: vec2u,
    fraction: vec2f,
}

fn bilinear_tap(uv: vec2f, size: u32) -> BilinearTap {
    let position = max(uv * f32(size) - 0.5, vec2f(0.0));
    let last = size - 1u;
    let lower = min(vec2u(position), vec2u(last));
    let fraction = clamp(position - vec2f(lower), vec2f(0.0), vec2f(1.0));
    return BilinearTap(lower, min(lower + 1u, vec2u(last)), fraction);
}

fn bilinear(tap: BilinearTap, a: vec4f, b: vec4f, c: vec4f, d: vec4f) -> vec4f {
    let top = a * (1.0 - tap.fraction.x) + b * tap.fraction.x;
    let bottom = c * (1.0 - tap.fraction.x) + d * tap.fraction.x;
    return top * (1.0 - tap.fraction.y) + bottom * tap.fraction.y;
}
