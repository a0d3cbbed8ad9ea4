// Receiver reconstruction: one invocation computes one output of one receiver, U times its cluster's lights, RGB
// (sec. 4.2). Dispatch: one invocation per receiver and output. Twin: reference.rs, receiver_reconstruction().
//
// Rows of neighboring invocations lie beside each other, so that whole cache lines are used.

override N_K: u32;

struct Params {
    n_receivers: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> receiver_cluster: array<u32>;
@group(0) @binding(3) var<storage, read> reconstruction: array<u32>;
@group(0) @binding(4) var<storage, read> cluster_lights: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> coefficients: array<vec4f>;

@compute @workgroup_size(64)
fn receiver_reconstruction(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let output = linear_group(group, groups) * 64u + local;
    let receiver = output / N_K;
    if (receiver >= params.n_receivers) {
        return;
    }
    let cluster = clusters[receiver_cluster[receiver]];
    let n = cluster.n_coefficients;
    let row = (receiver - cluster.first_receiver) * N_K + output % N_K;
    // The row in f16 values from the start of the matrix, which is a whole pair.
    let begin = row * n;
    let matrix = cluster.reconstruction_pair;
    var sum = vec3f(0.0);
    var pair = vec2f(0.0);
    if (begin % 2u != 0u && n > 0u) {
        pair = unpack2x16float(reconstruction[matrix + begin / 2u]);
    }
    for (var c = 0u; c < n; c += 1u) {
        let at = begin + c;
        if (at % 2u == 0u) {
            pair = unpack2x16float(reconstruction[matrix + at / 2u]);
        }
        sum += select(pair.x, pair.y, at % 2u != 0u) * cluster_lights[cluster.first_light + c].rgb;
    }
    coefficients[output] = vec4f(sum, 0.0);
}
