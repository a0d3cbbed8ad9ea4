// Near light: every receiver adds up texels of the light map's levels, its links (N1).
// Dispatch: one workgroup per tile, one invocation per receiver. Twin: reference.rs, near_light().
//
// The receivers of a tile share its nodes: each is fetched once, by the whole group.

override N_K: u32;

struct Params {
    n_tiles: u32,
    // Of the page; receivers of a tile outside of them are another page's.
    n_receivers: u32,
    light_map_size: u32,
    pad: u32,
}

struct Tile {
    first_receiver: u32,
    n_receivers: u32,
    first_node: u32,
    n_nodes: u32,
    first_link: u32,
    scale: f32,
    // Its first receiver among the page's; wraps if it is before them.
    place: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read> nodes: array<u32>;
// Four to a word.
@group(0) @binding(3) var<storage, read> counts: array<u32>;
@group(0) @binding(4) var<storage, read> links: array<u32>;
@group(0) @binding(5) var<storage, read> weights: array<u32>;
@group(0) @binding(6) var light_map: texture_2d<f32>;
@group(0) @binding(7) var<storage, read_write> coefficients: array<vec4f>;

// NEAR_NODES and NEAR_TILE of the format.
var<workgroup> radiance: array<vec3f, 256>;
var<workgroup> link_counts: array<u32, 64>;

fn byte_of(word: u32, at: u32) -> u32 {
    return (word >> (8u * (at % 4u))) & 0xffu;
}

@compute @workgroup_size(64)
fn near_light(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let number = linear_group(group, groups);
    let is_tile = number < params.n_tiles;
    let tile = tiles[min(number, params.n_tiles - 1u)];
    for (var node = local; node < tile.n_nodes; node += 64u) {
        let address = nodes[tile.first_node + node];
        let level = address >> 28u;
        let texel = address & 0x0fffffffu;
        // Levels halve rounded up; the texture's own are wider or equal.
        let size = (params.light_map_size + (1u << level) - 1u) >> level;
        let at = vec2u(texel % size, texel / size);
        radiance[node] = divide_by_coverage(textureLoad(light_map, at, level));
    }
    let receiver = tile.first_receiver + local;
    var count = 0u;
    if (local < tile.n_receivers) {
        count = byte_of(counts[receiver / 4u], receiver);
    }
    link_counts[local] = count;
    workgroupBarrier();
    let place = tile.place + local;
    if (!is_tile || local >= tile.n_receivers || place >= params.n_receivers) {
        return;
    }
    var link = tile.first_link;
    for (var before = 0u; before < local; before += 1u) {
        link += link_counts[before];
    }
    var sums = array<vec3f, 4>();
    let end = link + count;
    for (; link < end; link += 1u) {
        let light = radiance[byte_of(links[link / 4u], link)];
        for (var k = 0u; k < N_K; k += 1u) {
            let at = link * N_K + k;
            // Two's complement.
            let code = extractBits(i32(weights[at / 4u]), 8u * (at % 4u), 8u);
            let root = f32(code) / 127.0;
            sums[k] += tile.scale * root * abs(root) * light;
        }
    }
    for (var k = 0u; k < N_K; k += 1u) {
        coefficients[place * N_K + k] += vec4f(sums[k], 0.0);
    }
}
