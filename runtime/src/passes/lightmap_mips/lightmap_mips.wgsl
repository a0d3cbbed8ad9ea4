// Up to four mip levels at once: coverage-weighted means of 2 x 2 texels of the level below.
// Dispatch: one workgroup per 16 x 16 texels of the level below. Twin: reference.rs, lightmap_mips().
//
// Texels hold color times coverage, coverage; a mean of four is a plain sum. Levels have half the size of the level
// below, rounded up, and live in a texture whose levels are at least that wide; texels beyond hold 0.

struct Params {
    // Texels per side of the level that is read.
    size: u32,
    // Levels to write, 1 to 4.
    n_levels: u32,
    pad_0: u32,
    pad_1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var below: texture_2d<f32>;
@group(0) @binding(2) var above_1: texture_storage_2d<MAP_FORMAT, write>;
@group(0) @binding(3) var above_2: texture_storage_2d<MAP_FORMAT, write>;
@group(0) @binding(4) var above_3: texture_storage_2d<MAP_FORMAT, write>;
@group(0) @binding(5) var above_4: texture_storage_2d<MAP_FORMAT, write>;

var<workgroup> tile: array<vec4f, 64>;

fn read(texel: vec2u) -> vec4f {
    if (any(texel >= vec2u(params.size))) {
        return vec4f(0.0);
    }
    return textureLoad(below, texel, 0);
}

fn mean_of_tile(local: vec2u, stride: u32) -> vec4f {
    let at = local * stride * 2u;
    return 0.25 * (tile[at.y * 8u + at.x] + tile[at.y * 8u + at.x + stride]
        + tile[(at.y + stride) * 8u + at.x] + tile[(at.y + stride) * 8u + at.x + stride]);
}

@compute @workgroup_size(8, 8)
fn lightmap_mips(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let texel = group.xy * 8u + local.xy;
    let value = 0.25 * (read(2u * texel) + read(2u * texel + vec2u(1u, 0u))
        + read(2u * texel + vec2u(0u, 1u)) + read(2u * texel + vec2u(1u, 1u)));
    var size = (params.size + 1u) / 2u;
    if (all(texel < vec2u(size))) {
        textureStore(above_1, texel, value);
    }
    tile[local.y * 8u + local.x] = value;
    workgroupBarrier();

    var next = vec4f(0.0);
    if (params.n_levels >= 2u && all(local.xy < vec2u(4u))) {
        next = mean_of_tile(local.xy, 1u);
        if (all(group.xy * 4u + local.xy < vec2u((size + 1u) / 2u))) {
            textureStore(above_2, group.xy * 4u + local.xy, next);
        }
    }
    workgroupBarrier();
    if (all(local.xy < vec2u(4u))) {
        tile[local.y * 16u + local.x * 2u] = next;
    }
    workgroupBarrier();
    size = (size + 1u) / 2u;
    if (params.n_levels >= 3u && all(local.xy < vec2u(2u))) {
        next = mean_of_tile(local.xy, 2u);
        if (all(group.xy * 2u + local.xy < vec2u((size + 1u) / 2u))) {
            textureStore(above_3, group.xy * 2u + local.xy, next);
        }
    }
    workgroupBarrier();
    if (all(local.xy < vec2u(2u))) {
        tile[local.y * 32u + local.x * 4u] = next;
    }
    workgroupBarrier();
    if (params.n_levels >= 4u && all(local.xy == vec2u(0u))) {
        textureStore(above_4, group.xy, mean_of_tile(local.xy, 4u));
    }
}
