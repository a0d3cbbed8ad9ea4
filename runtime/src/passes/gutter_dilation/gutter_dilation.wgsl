// Gutter dilation: irradiance of every receiver into its texel and into the gutter texels that take their value from
// it. Dispatch: one invocation per texel that is written. Twin: reference.rs, gutter_dilation(), and
// receiver_reconstruction/reference.rs, receiver_irradiance().

override N_K: u32;

struct Params {
    n_texels: u32,
    size: u32,
    pad_0: u32,
    pad_1: u32,
}

struct Fill {
    texel: u32,
    // Among the receivers of this page.
    receiver: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> fills: array<Fill>;
@group(0) @binding(2) var<storage, read> coefficients: array<vec4f>;
// xyz of each receiver; read for degree 1 only.
@group(0) @binding(3) var<storage, read> normals: array<f32>;
@group(0) @binding(4) var irradiance_map: texture_storage_2d<MAP_FORMAT, write>;
// SH radiance, one coefficient a layer; written for degree 1 only.
@group(0) @binding(5) var radiance_map: texture_storage_2d_array<rgba16float, write>;

// Largest number of f16: brighter values would become infinite and stay so.
const LARGEST: f32 = 65504.0;

@compute @workgroup_size(64)
fn gutter_dilation(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let entry = linear_group(group, groups) * 64u + local;
    if (entry >= params.n_texels) {
        return;
    }
    let fill = fills[entry];
    let texel = vec2u(fill.texel % params.size, fill.texel / params.size);
    var irradiance = coefficients[fill.receiver * N_K].rgb;
    if (N_K == 4u) {
        let normal = vec3f(normals[3u * fill.receiver], normals[3u * fill.receiver + 1u], normals[3u * fill.receiver + 2u]);
        let weights = irradiance_weights_degree_1(normal);
        irradiance *= weights.x;
        for (var k = 1u; k < 4u; k += 1u) {
            irradiance += weights[k] * coefficients[fill.receiver * N_K + k].rgb;
        }
        for (var k = 0u; k < 4u; k += 1u) {
            let radiance = clamp(coefficients[fill.receiver * N_K + k].rgb, vec3f(-LARGEST), vec3f(LARGEST));
            textureStore(radiance_map, texel, k, vec4f(radiance, 1.0));
        }
    }
    textureStore(irradiance_map, texel, vec4f(clamp(irradiance, vec3f(0.0), vec3f(LARGEST)), 1.0));
}
