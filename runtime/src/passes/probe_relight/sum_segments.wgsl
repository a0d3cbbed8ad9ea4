// Adds up the partial sums of probe_relight in the order of the segments.
// Dispatch: one invocation per probe and SH function. Twin: the f64 sums of reference.rs, probe_relight().

override N_SH: u32;

struct Params {
    n_probes: u32,
    n_segments: u32,
    // First probe of this page among all.
    first_probe: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> partial_sums: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> probe_radiance: array<vec4f>;

@compute @workgroup_size(64)
fn sum_segments(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let at = linear_group(group, groups) * 64u + local;
    let probe = at / N_SH;
    if (probe >= params.n_probes) {
        return;
    }
    var sum = vec4f(0.0);
    for (var segment = 0u; segment < params.n_segments; segment += 1u) {
        sum += partial_sums[(probe * params.n_segments + segment) * N_SH + at % N_SH];
    }
    probe_radiance[params.first_probe * N_SH + at] = sum;
}
