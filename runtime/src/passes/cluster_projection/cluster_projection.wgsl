// Cluster projection: one workgroup computes eight of the lights of one cluster, P lambda, RGB (sec. 4.2, Eq. 11).
// Dispatch: x and y clusters, z eight rows of each. Twin: reference.rs, cluster_projection().
//
// Every f16 pair of P is read once, neighbors by neighbors, for all three bands. An invocation holds the inputs of a pair
// of columns and uses them for eight rows; probe radiance, read once per workgroup, comes from cache and needs no staging.
// The sums of the 64 invocations are added in a fixed order.

override N_SH: u32;

const LANES: u32 = 64u;
const ROWS: u32 = 8u;
// One more than LANES, so that sums of neighboring rows lie in different banks.
const STRIDE: u32 = 65u;

struct Params {
    n_clusters: u32,
    has_sky: u32,
    pad_0: u32,
    pad_1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> cluster_probes: array<u32>;
@group(0) @binding(3) var<storage, read> projection: array<u32>;
@group(0) @binding(4) var<storage, read> probe_radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read> sky_sh: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> cluster_lights: array<vec4f>;

var<workgroup> sums: array<f32, 3u * ROWS * STRIDE>;
var<workgroup> halves: array<f32, 6u * ROWS>;

// Input of a column: lambda of the cluster's probes one after the other, then the sky; 0 outside.
fn input(cluster: Cluster, column: u32, n_used: u32) -> vec3f {
    if (column >= n_used) {
        return vec3f(0.0);
    }
    let slot = column / N_SH;
    if (slot >= cluster.n_probes) {
        return sky_sh[column - cluster.n_probes * N_SH].rgb;
    }
    return probe_radiance[cluster_probes[cluster.first_probe + slot] * N_SH + column - slot * N_SH].rgb;
}

// Inputs of a pair of columns, and of the column before it.
struct Inputs {
    before: vec3f,
    low: vec3f,
    high: vec3f,
}

// A pair of one row, which starts at value `start` of the projection at `first_pair`, times its inputs.
fn weighted(first_pair: u32, start: u32, is_row: bool, pair: u32, n_used: u32, inputs: Inputs) -> vec3f {
    if (!is_row) {
        return vec3f(0.0);
    }
    let weights = unpack2x16float(projection[first_pair + start / 2u + pair]);
    // What lies beyond the row may be padding: it is not multiplied.
    if (start % 2u == 0u) {
        return select(0.0, weights.x, 2u * pair < n_used) * inputs.low
            + select(0.0, weights.y, 2u * pair + 1u < n_used) * inputs.high;
    }
    return select(0.0, weights.x, pair > 0u && 2u * pair - 1u < n_used) * inputs.before
        + select(0.0, weights.y, 2u * pair < n_used) * inputs.low;
}

fn keep(row: u32, lane: u32, sum: vec3f) {
    sums[(3u * row) * STRIDE + lane] = sum.r;
    sums[(3u * row + 1u) * STRIDE + lane] = sum.g;
    sums[(3u * row + 2u) * STRIDE + lane] = sum.b;
}

@compute @workgroup_size(64)
fn cluster_projection(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let number = linear_group(group, groups);
    // The same for the whole workgroup.
    if (number >= params.n_clusters) {
        return;
    }
    let cluster = clusters[number];
    let first_row = group.z * ROWS;
    if (first_row >= cluster.n_coefficients) {
        return;
    }
    let n_probe_columns = cluster.n_probes * N_SH;
    let n_columns = n_probe_columns + cluster.n_sky;
    // A black sky adds nothing: its columns are not read.
    let n_used = select(n_probe_columns, n_columns, params.has_sky != 0u);
    // Rows of an odd number of columns start in the middle of a pair every other time.
    let odd = n_columns % 2u;
    let n_pairs = (n_used + odd + 1u) / 2u;

    let n_rows = min(ROWS, cluster.n_coefficients - first_row);
    // Eight rows by name, not in an array: one with a running index lies in memory, since loops are not unrolled.
    var row_0 = vec3f(0.0);
    var row_1 = vec3f(0.0);
    var row_2 = vec3f(0.0);
    var row_3 = vec3f(0.0);
    var row_4 = vec3f(0.0);
    var row_5 = vec3f(0.0);
    var row_6 = vec3f(0.0);
    var row_7 = vec3f(0.0);
    for (var pair = local; pair < n_pairs; pair += LANES) {
        var inputs: Inputs;
        inputs.low = input(cluster, 2u * pair, n_used);
        inputs.high = input(cluster, 2u * pair + 1u, n_used);
        inputs.before = vec3f(0.0);
        if (odd != 0u && pair > 0u) {
            inputs.before = input(cluster, 2u * pair - 1u, n_used);
        }
        let at = cluster.projection_pair;
        let start = first_row * n_columns;
        row_0 += weighted(at, start, 0u < n_rows, pair, n_used, inputs);
        row_1 += weighted(at, start + n_columns, 1u < n_rows, pair, n_used, inputs);
        row_2 += weighted(at, start + 2u * n_columns, 2u < n_rows, pair, n_used, inputs);
        row_3 += weighted(at, start + 3u * n_columns, 3u < n_rows, pair, n_used, inputs);
        row_4 += weighted(at, start + 4u * n_columns, 4u < n_rows, pair, n_used, inputs);
        row_5 += weighted(at, start + 5u * n_columns, 5u < n_rows, pair, n_used, inputs);
        row_6 += weighted(at, start + 6u * n_columns, 6u < n_rows, pair, n_used, inputs);
        row_7 += weighted(at, start + 7u * n_columns, 7u < n_rows, pair, n_used, inputs);
    }
    keep(0u, local, row_0);
    keep(1u, local, row_1);
    keep(2u, local, row_2);
    keep(3u, local, row_3);
    keep(4u, local, row_4);
    keep(5u, local, row_5);
    keep(6u, local, row_6);
    keep(7u, local, row_7);
    workgroupBarrier();
    if (local < 6u * ROWS) {
        var sum = 0.0;
        let first = local / 2u * STRIDE + local % 2u * (LANES / 2u);
        for (var i = 0u; i < LANES / 2u; i += 1u) {
            sum += sums[first + i];
        }
        halves[local] = sum;
    }
    workgroupBarrier();
    if (local < n_rows) {
        let at = 6u * local;
        let light = vec3f(halves[at] + halves[at + 1u], halves[at + 2u] + halves[at + 3u],
            halves[at + 4u] + halves[at + 5u]);
        cluster_lights[cluster.first_light + first_row + local] = vec4f(light, 0.0);
    }
}
