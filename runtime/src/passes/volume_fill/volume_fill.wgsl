// Volume fill: up to four coefficients of every volume receiver into its cell and into the cells that take their values
// from it. Dispatch: one invocation per cell that is written, once per four coefficients. Twin: reference.rs,
// volume_fill().
//
// Texels hold coefficient times weight, weight: 1 for a cell of its own, FILLED for one that borrows. Divided after a
// trilinear read, cells of their own count alone wherever one is near, as in sampler.rs.

struct Params {
    n_fills: u32,
    n_k: u32,
    first_k: u32,
    size_x: u32,
    size_y: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

struct Fill {
    // Cell x + size_x (y + size_y z).
    cell: u32,
    // Receiver within the page; the highest bit is set where the cell borrows.
    receiver: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> fills: array<Fill>;
@group(0) @binding(2) var<storage, read> coefficients: array<vec4f>;
@group(0) @binding(3) var map_0: texture_storage_3d<rgba16float, write>;
@group(0) @binding(4) var map_1: texture_storage_3d<rgba16float, write>;
@group(0) @binding(5) var map_2: texture_storage_3d<rgba16float, write>;
@group(0) @binding(6) var map_3: texture_storage_3d<rgba16float, write>;

const BORROWED: u32 = 0x80000000u;
// A power of two, so that dividing by it is exact; small enough that cells of their own outweigh it, and large enough that
// dim light does not fall below the normal numbers of f16.
const FILLED: f32 = 0.125;
// Largest number of f16.
const LARGEST: f32 = 65504.0;

@compute @workgroup_size(64)
fn volume_fill(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let entry = linear_group(group, groups) * 64u + local;
    if (entry >= params.n_fills) {
        return;
    }
    let fill = fills[entry];
    let weight = select(1.0, FILLED, (fill.receiver & BORROWED) != 0u);
    let first = (fill.receiver & ~BORROWED) * params.n_k;
    let row = fill.cell / params.size_x;
    let texel = vec3u(fill.cell % params.size_x, row % params.size_y, row / params.size_y);
    for (var i = 0u; i < min(4u, params.n_k - params.first_k); i += 1u) {
        let value = coefficients[first + params.first_k + i].rgb;
        let stored = vec4f(clamp(value, vec3f(-LARGEST), vec3f(LARGEST)) * weight, weight);
        switch (i) {
            case 0u: { textureStore(map_0, texel, stored); }
            case 1u: { textureStore(map_1, texel, stored); }
            case 2u: { textureStore(map_2, texel, stored); }
            default: { textureStore(map_3, texel, stored); }
        }
    }
}
