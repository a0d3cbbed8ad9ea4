// Direct irradiance: one invocation adds the lights of one batch to one covered texel, RGB in W m^-2.
// Dispatch: ceil(n_texels / 64) workgroups in rows of at most the device's limit, per page of texels and batch of lights.
// Twin: reference.rs, add_light() for each light of the batch, in order.
// Follows shadow_view.wgsl and direct_light.wgsl.

// Nine per texel: position, shading normal, geometric normal.
@group(1) @binding(0) var<storage, read> texels: array<f32>;
@group(1) @binding(1) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(64)
fn direct_irradiance(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) n_workgroups: vec3u) {
    let texel = id.y * n_workgroups.x * 64u + id.x;
    if (texel >= arrayLength(&irradiance)) { return; }
    let position = texel_vector(9u * texel);
    let normal = texel_vector(9u * texel + 3u);
    let geometric_normal = texel_vector(9u * texel + 6u);
    var sum = vec3f(0.0);
    if (batch.is_first == 0u) { sum = irradiance[texel].rgb; }
    for (var index = batch.first_light; index < batch.first_light + batch.n_lights; index++) {
        let incident = incident_light(index, position, geometric_normal);
        sum += incident.irradiance * max(dot(normal, incident.dir_to_light), 0.0);
    }
    irradiance[texel] = vec4f(sum, 0.0);
}

fn texel_vector(first: u32) -> vec3f {
    return vec3f(texels[first], texels[first + 1u], texels[first + 2u]);
}
