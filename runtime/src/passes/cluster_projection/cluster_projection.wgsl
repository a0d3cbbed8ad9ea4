// Cluster projection: one workgroup computes the lights of one cluster, P lambda, RGB (sec. 4.2, Eq. 11).
// Dispatch: one workgroup per cluster. Twin: reference.rs, cluster_projection().
//
// Every f16 pair of P is read once, neighbors by neighbors, for all three bands. An invocation holds the inputs of a pair
// of columns and uses them for eight rows, which is more rows than most clusters have, so that probe radiance is read
// once as well (from cache) and needs no staging. The sums of the 64 invocations are added in a fixed order.

override N_SH: u32;

const LANES: u32 = 64u;
const ROWS: u32 = 8u;
// One more than LANES, so that sums of neighbouring rows lie in different banks.
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
    let n_probe_columns = cluster.n_probes * N_SH;
    let n_columns = n_probe_columns + cluster.n_sky;
    // A black sky adds nothing: its columns are not read.
    let n_used = select(n_probe_columns, n_columns, params.has_sky != 0u);
    // Rows of an odd number of columns start in the middle of a pair every other time.
    let odd = n_columns % 2u;
    let n_pairs = (n_used + odd + 1u) / 2u;

    for (var first_row = 0u; first_row < cluster.n_coefficients; first_row += ROWS) {
        let n_rows = min(ROWS, cluster.n_coefficients - first_row);
        // Written out: Chromium starts a variable without a value at zero once, not in every turn of the loop.
        var row_sums = array<vec3f, ROWS>();
        for (var pair = local; pair < n_pairs; pair += LANES) {
            let low = input(cluster, 2u * pair, n_used);
            let high = input(cluster, 2u * pair + 1u, n_used);
            var before = vec3f(0.0);
            if (odd != 0u && pair > 0u) {
                before = input(cluster, 2u * pair - 1u, n_used);
            }
            for (var i = 0u; i < ROWS; i += 1u) {
                if (i < n_rows) {
                    let start = (first_row + i) * n_columns;
                    let weights = unpack2x16float(projection[cluster.projection_pair + start / 2u + pair]);
                    if (start % 2u == 0u) {
                        // What lies beyond the row may be padding: it is not multiplied.
                        row_sums[i] += select(0.0, weights.x, 2u * pair < n_used) * low
                            + select(0.0, weights.y, 2u * pair + 1u < n_used) * high;
                    } else {
                        row_sums[i] += select(0.0, weights.x, pair > 0u && 2u * pair - 1u < n_used) * before
                            + select(0.0, weights.y, 2u * pair < n_used) * low;
                    }
                }
            }
        }
        for (var i = 0u; i < ROWS; i += 1u) {
            sums[(3u * i) * STRIDE + local] = row_sums[i].r;
            sums[(3u * i + 1u) * STRIDE + local] = row_sums[i].g;
            sums[(3u * i + 2u) * STRIDE + local] = row_sums[i].b;
        }
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
        workgroupBarrier();
    }
}
